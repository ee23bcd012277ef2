"""Small linear systems beside NumPy's."""

from __future__ import annotations

import numpy as np
import pytest

from dmoc.mechanics.small_systems import solved

RNG = np.random.default_rng(3)


@pytest.mark.parametrize("n", [1, 2, 3, 7])
@pytest.mark.parametrize("stack", [(), (5,), (2, 3)])
@pytest.mark.parametrize("columns", [None, 1, 4])
def test_solutions_are_those_of_numpy(n: int, stack: tuple[int, ...], columns: int | None) -> None:
    """Matrices that need exchanges of rows, as rows that do not lie together in memory."""
    A = RNG.normal(size=(*stack, n, n))
    A[..., 0, 0] = 0.0 if n > 1 else A[..., 0, 0]
    b = RNG.normal(size=(*stack, n) if columns is None else (*stack, columns, n))
    b = b if columns is None else np.swapaxes(b, -1, -2)
    before = A.copy(), b.copy()
    x, right = solved(A, b), b[..., None] if columns is None else b
    wanted = np.linalg.solve(A, right)
    assert x.shape == b.shape and x == pytest.approx(wanted.reshape(b.shape), rel=1e-9, abs=1e-12)
    assert (before[0] == A).all() and (before[1] == b).all()


@pytest.mark.parametrize("bad", [np.nan, np.inf, 0.0])
@pytest.mark.parametrize("n", [2, 3])
def test_without_a_finite_solution_nothing_is_a_number(n: int, bad: float) -> None:
    A, b = np.tile(np.eye(n), (4, 1, 1)), np.ones((4, n))
    A[2, 1] = bad
    assert np.isnan(solved(A, b)).all()
    if bad:
        b[1, 0] = bad
        assert np.isnan(solved(np.tile(np.eye(n), (4, 1, 1)), b)).all()


def test_one_matrix_serves_a_stack() -> None:
    A, b = RNG.normal(size=(3, 3)), RNG.normal(size=(5, 3, 2))
    assert solved(A, b) == pytest.approx(np.linalg.solve(A, b), rel=1e-9)


def test_systems_that_do_not_fit_are_refused() -> None:
    for A, b in (((2, 2), (3,)), ((2, 3), (3,)), ((4, 2, 2), (3, 2)), ((4, 2, 2), (2, 1))):
        with pytest.raises(ValueError, match="do not fit"):
            solved(np.ones(A), np.ones(b))
    assert solved(np.zeros((0, 2, 2)), np.zeros((0, 2))).shape == (0, 2)
