"""Matrices that may be weights of states and of inputs: by their eigenvalues."""

from __future__ import annotations

import numpy as np
import pytest

from dmoc.base.errors import SimulationError
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
