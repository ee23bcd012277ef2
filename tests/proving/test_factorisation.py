"""Factors of sparse symmetric matrices: their signs, their error, and radii of solutions."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
import scipy.sparse

from dmoc.codegen.kernels import Array
from dmoc.proving.enclosure import Inverse, radii
from dmoc.proving.factorisation import WIDTH, SignedFactors, _without


def banded(seed: int, size: int, off: float = 0.0) -> Array:
    """An indefinite matrix with a band and a border, and zeros on its diagonal."""
    rng = np.random.default_rng(seed)
    A = np.triu(np.tril(rng.normal(size=(size, size)), 4), -4)
    A[:, -2:] = rng.normal(size=(size, 2))
    A = np.triu(A) + np.triu(A, 1).T
    A[np.arange(0, size, 2), np.arange(0, size, 2)] = off
    return np.asarray(A)


def upper(A: Array) -> scipy.sparse.csr_matrix:
    return scipy.sparse.csr_matrix(np.triu(A))


def product(factors: SignedFactors) -> Array:
    """The product of the factors, in numbers with more digits."""
    rest = np.zeros((0, 0), np.longdouble)  # of what waits, and of the unknowns behind a block
    for f in reversed(factors.fronts):
        pivots = len(f.lam)
        Z = np.zeros((pivots + factors.size - f.last,) * 2, np.longdouble)
        (gone,), (stay,) = np.nonzero(f.gone), np.nonzero(~f.gone)
        later, at = np.arange(pivots, len(Z)), pivots + f.at - f.last
        both = np.concatenate([stay, later])
        Z[np.ix_(both, both)] = rest
        lam, T = f.lam[gone].astype(np.longdouble), f.T[gone].astype(np.longdouble)
        Z[gone, gone] = lam
        Z[np.ix_(gone, at)] += T
        Z[np.ix_(at, gone)] += T.T
        Z[np.ix_(at, at)] += T.T @ (T / lam[:, None])
        rotation = np.eye(len(Z), dtype=np.longdouble)
        rotation[:pivots, :pivots] = f.Q
        rest = rotation @ Z @ rotation.T
    return np.asarray(rest)


@pytest.mark.parametrize(("seed", "size"), [(0, 30), (1, 70), (2, 110)])
def test_signs_are_those_of_the_eigenvalues(seed: int, size: int) -> None:
    A = banded(seed, size)
    factors, eigenvalues = SignedFactors(upper(A)), np.linalg.eigvalsh(A)
    assert factors.positive == (eigenvalues > 0).sum()
    assert factors.negative == (eigenvalues < 0).sum()
    assert factors.error < 1e-9 < np.abs(eigenvalues).min()
    right = np.random.default_rng(3).normal(size=(size, 2))
    assert A @ factors.solve(right) == pytest.approx(right, abs=1e-9)
    off = np.linalg.norm((product(factors) - A).astype(float), 2)
    assert 1e-16 < off <= factors.error  # as far as it is said to be at most


def test_what_is_subtracted_has_its_rounding_error() -> None:
    rng = np.random.default_rng(4)
    lam, T, rest = rng.uniform(1, 2, 30), rng.normal(size=(30, 5)), np.diag(rng.normal(size=5))
    left, error = _without(rest, lam, T, np.ones(30, dtype=bool))
    digits = T.astype(np.longdouble)
    off = rest - digits.T @ (digits / lam[:, None].astype(np.longdouble)) - left
    assert 1e-16 < np.linalg.norm(off.astype(float), 2) <= error < 1e-11


def test_a_singular_matrix_has_no_signs() -> None:
    A = np.ones((3, 3))
    A[2, 2] = 0.0
    A[:2, :2] = 0.0
    assert SignedFactors(upper(A * 0)).error == np.inf
    with np.errstate(all="ignore"):
        assert Inverse(scipy.sparse.csr_matrix(A), SignedFactors(upper(A))).norm == np.inf


def test_unknowns_wait_for_those_that_they_need() -> None:
    """Multipliers before their unknowns have no pivots of their own."""
    n = 60
    A = np.zeros((2 * n, 2 * n))
    A[:n, n:] = A[n:, :n] = np.eye(n)
    factors = SignedFactors(upper(A))
    assert factors.fronts[0].waiting > 0
    assert (factors.positive, factors.negative) == (n, n)


def test_the_root_of_two_lies_within_its_radius() -> None:
    """x^2 = 2 and x y = 1 as an optimum's conditions: symmetric Jacobian [[2 y, 2 x], [2 x, 0]] of
    F = (2 x y - 2, x^2 - 2)."""
    x, y = 1.41421356, 0.70710678
    K = np.array([[2 * y, 2 * x], [2 * x, 0.0]])
    inverse = Inverse(scipy.sparse.csr_matrix(K), SignedFactors(upper(K)))
    exact = Fraction(x), Fraction(y)
    F = np.array([float(abs(2 * exact[0] * exact[1] - 2)), float(abs(exact[0] ** 2 - 2))])

    def variation(r: Array) -> scipy.sparse.csr_matrix:
        return scipy.sparse.csr_matrix([[2 * r[1], 2 * r[0]], [2 * r[0], 1e-15]])

    r = radii(inverse, F * (1 + 1e-15), variation)
    assert r is not None
    low, high = exact[0] - Fraction(r[0]), exact[0] + Fraction(r[0])
    assert low**2 <= 2 <= high**2 and r[0] < 4e-9
    assert (exact[1] - Fraction(r[1])) ** 2 <= Fraction(1, 2) <= (exact[1] + Fraction(r[1])) ** 2
    assert np.linalg.norm(np.linalg.inv(K), 2) <= inverse.norm < 3
    # Where slopes vary too much, nothing is said.
    steep = scipy.sparse.csr_matrix(5 * np.ones((2, 2)))
    assert radii(inverse, F, lambda r: steep) is None


def test_errors_of_all_blocks_are_summed(monkeypatch: pytest.MonkeyPatch) -> None:
    """What elimination loses of three blocks counts once each, and is stretched by each rotation
    before it."""
    A = upper(banded(3, 3 * WIDTH, 4.0))
    plain = SignedFactors(A).error
    monkeypatch.setattr(f"{SignedFactors.__module__}._without", lambda *of: (_without(*of)[0], 1.0))
    assert SignedFactors(A).error == pytest.approx(3 + plain, abs=1e-6)
    monkeypatch.setattr(f"{SignedFactors.__module__}._off_orthogonal", lambda _: 0.25)
    assert SignedFactors(A).error == pytest.approx(1 + 1.25 + 1.25**2, abs=1e-6)
