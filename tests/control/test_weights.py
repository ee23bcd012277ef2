"""Matrices that may be weights of states and of inputs, by their eigenvalues, and the gains beside
a phase."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

from dmoc.base.errors import SimulationError
from dmoc.control import feedback
from dmoc.control.feedback import weight_matrix

NAMES = "x", "y", "z"
ONE = np.eye(3)


def with_eigenvalues(*values: float) -> np.ndarray:
    """A symmetric matrix that has them."""
    turned = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0]
    matrix = turned @ np.diag(values) @ turned.T
    return np.asarray((matrix + matrix.T) / 2)


@pytest.mark.parametrize(
    ("values", "of_states", "of_inputs"),
    [
        ((1.0, 2.0, 3.0), True, True),
        ((0.0, 2.0, 3.0), True, None),  # by rounding, it may be just above 0
        ((0.0, 0.0, 3.0), True, None),
        ((-0.1, 2.0, 3.0), False, False),
        ((2.0, -0.1, 3.0), False, False),
        ((-1.0, -2.0, -3.0), False, False),
        ((1e-6, 1.0, 2.0), True, True),
    ],
)
def test_the_least_eigenvalue_decides(
    values: tuple[float, float, float], of_states: bool, of_inputs: bool | None
) -> None:
    matrix = with_eigenvalues(*values)
    for definite, taken in ((False, of_states), (True, of_inputs)):
        if taken:
            np.testing.assert_allclose(weight_matrix(matrix, "Q", NAMES, ONE, definite), matrix)
        elif taken is not None:
            with pytest.raises(SimulationError, match=f"Q has the eigenvalue {min(values):.3g} in"):
                weight_matrix(matrix, "Q", NAMES, ONE, definite)


def test_eigenvalues_are_those_in_sizes() -> None:
    """diag(1, -0.01, 1) where states have the sizes 1, 10 and 1: -1."""
    sizes = np.array([1.0, 10.0, 1.0])
    with pytest.raises(SimulationError, match="the eigenvalue -1 in sizes"):
        weight_matrix(np.diag([1.0, -0.01, 1.0]), "Q", NAMES, np.diag(sizes**-2))


@pytest.mark.parametrize("place", [(0, 1), (2, 0), (1, 2)])
def test_a_weight_is_symmetric(place: tuple[int, int]) -> None:
    matrix = with_eigenvalues(1.0, 2.0, 3.0)
    matrix[place] += 1e-3
    with pytest.raises(SimulationError, match="Q is not symmetric"):
        weight_matrix(matrix, "Q", NAMES, ONE)


@pytest.mark.parametrize("t", [2.0, 2.05, 2.1, 2.25, 2.4, 2.7, 2.99, 3.0])
def test_a_motion_is_followed_along_cubics_with_linear_gains(t: float) -> None:
    """Between nodes of positions and rates; before the first and after the last as there."""
    nodes = np.array([2.0, 2.1, 2.4, 3.0])
    q, v = np.array([[1.0, 4.0], [2.0, 3.0], [5.0, 0.0], [4.0, 1.0]]), np.arange(8.0).reshape(4, 2)
    K, u = nodes[:, None, None] ** 2, np.arange(4.0)[:, None]
    guide = feedback.Guide(2.1, 2.4, nodes, np.hstack([q, v]), u, K)
    cubics, k = CubicHermiteSpline(nodes, q, v), min(np.searchsorted(nodes, t, "right") - 1, 2)
    y, inputs, gains = feedback.follow(guide, t)
    np.testing.assert_allclose(y, [*cubics(t), *cubics(t, 1)], atol=1e-12)
    assert inputs == [k] and gains == pytest.approx(np.interp(t, nodes, nodes**2))
    for outside, end in ((1.0, 0), (9.0, 3)):
        assert feedback.follow(guide, outside)[0] == pytest.approx([*q[end], *v[end]])


@pytest.mark.parametrize(("before", "after"), [(0, 0), (1, 3), (3, 1), (2, 0)])
def test_gains_are_constant_beside_a_phase(
    before: int, after: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A phase of four nodes, passed by on both sides as far as its states are finite."""
    K, u = np.arange(4.0)[:, None, None], np.arange(10.0, 13.0)[:, None]
    sides = {-1: before, 1: after}
    monkeypatch.setattr(feedback, "gains", lambda *_: K)
    monkeypatch.setattr(feedback, "projection", lambda *_: None)
    monkeypatch.setattr(feedback, "input_slopes", lambda *_: None)
    monkeypatch.setattr(
        feedback, "beyond",
        lambda motion, i, s, side: (np.full(sides[side], 100.0 * side), np.zeros((sides[side], 2))),
    )  # fmt: skip
    steps = SimpleNamespace(u0=np.array([[7.0], [8.0]]), u1=np.array([[8.0], [9.0]]))
    phase = SimpleNamespace(t=np.array([2.0, 5.0]))
    motion: Any = SimpleNamespace(
        trajectory=SimpleNamespace(phases=[phase]), modes=[None], steps=[steps]
    )
    linear: Any = SimpleNamespace(t=np.linspace(2.0, 5.0, 4), y=np.ones((4, 2)), u=u)
    one: Any = None
    guide = feedback._guide(motion, 0, linear, one, one)
    assert (guide.begin, guide.end) == (2.0, 5.0)
    assert guide.t.tolist() == [-100.0] * before + [2.0, 3.0, 4.0, 5.0] + [100.0] * after
    assert guide.u[:, 0].tolist() == [7.0] * before + [10.0, 11.0, 12.0, 9.0] + [9.0] * after
    assert guide.K[:, 0, 0].tolist() == [0.0] * before + [0.0, 1.0, 2.0, 3.0] + [3.0] * after
