"""Linear systems and products of small matrices beside NumPy's."""

from __future__ import annotations

import numpy as np
import pytest

from dmoc.mechanics.algebra import (
    SMALL,
    SMALLEST,
    largest_form,
    largest_stretch,
    most_of,
    products_from,
    reached,
    solved,
    solved_small,
)

RNG = np.random.default_rng(3)


@pytest.mark.parametrize("n", [1, 2, 3, 7, SMALL, SMALL + 1])
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
@pytest.mark.parametrize("n", [2, 3, SMALL + 1])
def test_without_a_finite_solution_nothing_is_a_number(n: int, bad: float) -> None:
    A, b = np.tile(np.eye(n), (4, 1, 1)), np.ones((4, n))
    A[2, 1] = bad
    assert np.isnan(solved(A, b)).all()
    if bad:
        b[1, 0] = bad
        assert np.isnan(solved(np.tile(np.eye(n), (4, 1, 1)), b)).all()


@pytest.mark.parametrize("shapes", [((3, 3), (5, 3, 2)), ((1, 3, 3), (5, 3)), ((5, 3, 3), (1, 3))])
def test_one_serves_many_others(shapes: tuple[tuple[int, ...], tuple[int, ...]]) -> None:
    A, b = (RNG.normal(size=shape) for shape in shapes)
    right = b[..., None] if b.ndim == A.ndim - 1 else b
    assert solved(A, b) == pytest.approx(
        np.linalg.solve(A, right).reshape(5, 3, *b.shape[2:]), rel=1e-9
    )


def test_systems_that_do_not_fit_are_refused() -> None:
    for A, b in (((2, 2), (3,)), ((2, 3), (3,)), ((4, 2, 2), (3, 2)), ((4, 2, 2), (2, 1))):
        with pytest.raises(ValueError, match="do not fit"):
            solved_small(np.ones(A), np.ones(b))
    assert solved(np.zeros((0, 2, 2)), np.zeros((0, 2))).shape == (0, 2)


@pytest.mark.parametrize("m", [1, 2, 4, SMALLEST, SMALLEST + 1])
@pytest.mark.parametrize("size", [1.0, 1e-200, 1e200])
def test_the_largest_singular_value_of_matrices(m: int, size: float) -> None:
    stack = size * RNG.normal(size=(6, m, m)) * np.logspace(0, -3, 6)[:, None, None]
    stack[1] = size * np.outer(np.ones(m), RNG.normal(size=m))  # of rank one
    wanted = size * np.linalg.svd(stack / size, compute_uv=False).max()
    for some in (stack, stack[::-1]):
        assert largest_stretch(some) == pytest.approx(wanted, rel=1e-12)
    assert largest_stretch(np.zeros((2, m, m))) == largest_stretch(np.zeros((0, m, m))) == 0
    for bad in (np.nan, np.inf):
        stack[4, 0, 0] = bad
        assert largest_stretch(stack) == np.inf


def test_products_back_to_each_matrix() -> None:
    stack = np.swapaxes(RNG.normal(size=(3, 4, 4)), 1, 2)
    first, second, third, one = products_from(stack)
    assert (one == np.eye(4)).all() and (third == stack[2]).all()
    assert second == pytest.approx(stack[2] @ stack[1], rel=1e-12)
    assert first == pytest.approx(stack[2] @ stack[1] @ stack[0], rel=1e-12)
    for function in (products_from, largest_stretch):
        with pytest.raises(ValueError, match="square"):
            function(np.ones((2, 3, 4)))


def test_extremes_of_rows() -> None:
    rows = RNG.normal(size=(20, 3, 4))
    assert (most_of(rows) == np.abs(rows).max(axis=0)).all()
    assert (most_of(rows.T) == np.abs(rows.T).max(axis=0)).all()  # not together in memory
    assert most_of(np.zeros((5, 0, 3))).shape == (0, 3)
    v, M = RNG.normal(size=(20, 3)), RNG.normal(size=(20, 3, 3))
    assert largest_form(v, M) == pytest.approx(np.einsum("ki,kij,kj->k", v, M, v).max(), rel=1e-12)
    assert largest_form(v, -np.tile(np.eye(3), (20, 1, 1))) < 0
    for place in (0, 10, 19):
        bad = rows.copy()
        bad[place, 1, 2] = np.nan
        most = most_of(bad)
        assert np.isnan(most[1, 2]) and np.isfinite(most).sum() == most.size - 1
        M[place, 0, 0] = np.nan
        assert np.isnan(largest_form(v, M))
    with pytest.raises(ValueError, match="expected 20 matrices"):
        largest_form(v, M[:3])


@pytest.mark.parametrize("n", [1, 2, 5])
@pytest.mark.parametrize("m", [0, 1, 4])
def test_what_motions_of_some_sizes_reach_is_that_of_numpy(n: int, m: int) -> None:
    """Slopes that do not lie together in memory, and masses that need exchanges of rows."""
    slopes, sizes = RNG.normal(size=(m, n + 1))[:, :-1], RNG.random((3, n))
    M = RNG.normal(size=(n, n))
    M[0, 0] = 0.0 if n > 1 else M[0, 0]
    most, squares = reached(slopes, sizes, M)
    assert most == pytest.approx(sizes @ np.abs(slopes.T)) and most.shape == (3, m)
    assert squares == pytest.approx(np.diag(slopes @ np.linalg.solve(M, slopes.T)), rel=1e-9)


@pytest.mark.parametrize("bad", [np.nan, np.inf, 0.0])
def test_nothing_answers_without_masses(bad: float) -> None:
    M = np.diag([1.0, bad])
    most, squares = reached(np.ones((2, 2)), np.ones((1, 2)), M)
    assert np.isnan(squares).all() and (most == 2).all()
    with pytest.raises(ValueError, match="of 2 coordinates"):
        reached(np.ones((2, 2)), np.ones((1, 3)), M)
