"""Transition matrices of linear equations: exponentials, and Airy's equation, whose matrix varies
with the time and does not commute with itself."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from dmoc.control.linearisation import GAUSS, exponentials, magnus


def airy(t: float) -> np.ndarray:
    """x'' = -(1 + 4 t) x."""
    return np.array([[0.0, 1.0], [-(1 + 4 * t), 0.0]])


def error(t: float, h: float) -> float:
    A = np.array([[airy(t + c * h) for c in GAUSS]])
    (transition,) = exponentials(magnus(A, np.array([h])))
    exact = solve_ivp(
        lambda s, y: (airy(s) @ y.reshape(2, 2)).ravel(), (t, t + h), np.eye(2).ravel(),
        method="DOP853", rtol=1e-13, atol=1e-14,
    )  # fmt: skip
    return float(np.abs(transition - exact.y[:, -1].reshape(2, 2)).max())


@pytest.mark.parametrize("t", [0.0, 0.5])
def test_an_interval_of_a_varying_matrix_is_right_to_its_fifth_power(t: float) -> None:
    coarse, fine = error(t, 0.2), error(t, 0.1)
    assert coarse < 1e-4 and 25 < coarse / fine < 40


def test_exponentials_are_those_of_each_matrix() -> None:
    r = np.random.default_rng(3)
    matrices = r.normal(size=(4, 3, 3)) * np.array([0.1, 1.0, 10.0, 0.0])[:, None, None]
    for got, matrix in zip(exponentials(matrices), matrices, strict=True):
        np.testing.assert_allclose(got, expm(matrix), rtol=1e-9, atol=1e-12)
