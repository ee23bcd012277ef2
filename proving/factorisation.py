"""A sparse symmetric matrix K as a product of factors: the signs of its eigenvalues, how far the
product is from K with rounding errors counted, and solutions with it.

The factorisation goes along an order of the unknowns, a block at a time.  A block is diagonalised,
A = Q L Q'; of its new unknowns those are eliminated whose eigenvalue is not small beside what they
share with others, the rest waits for the next block.  What was computed is the exact product of its
factors plus an error, whose norm is summed up on the way: the residuals that can be computed, and
what rounding may do to each product (N. J. Higham, Accuracy and Stability of Numerical Algorithms,
2002, section 3.5).  The eigenvalues of the product have the signs of the numbers that were
eliminated (Sylvester's law of inertia).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from dmoc.base.records import record
from dmoc.codegen.kernels import Array
from dmoc.program.blocks import Bools, Index
from dmoc.proving.balls import ROUNDED

Matrix = Any  # of SciPy, sparse

WIDTH = 48  # unknowns of a block
# An eigenvalue below this share of what its unknown shares with others waits.
WAITS = 0.05


@record(frozen=True, eq=False)
class Front:
    """A block: the number of unknowns that waited for it, which come before its own ones from
    ``first`` to ``last``, eigenvalues and eigenvectors, the columns T of the unknowns ``at`` that
    come later, in the coordinates of Q, and the mask of the eigenvalues that were eliminated."""

    waited: int
    first: int
    last: int
    lam: Array
    Q: Array
    T: Array
    at: Index
    gone: Bools

    @property
    def waiting(self) -> int:
        return int((~self.gone).sum())


class SignedFactors:
    """The factors of K, of which the upper triangle is given in CSR form.

    ``positive``, ``negative``: numbers of eigenvalues of the product.  ``error``: the 2-norm of the
    difference to K is less.
    """

    def __init__(self, upper: Matrix) -> None:
        self.size = upper.shape[0]
        self.fronts: list[Front] = []
        error, length = 0.0, 1.0  # length: of what the rotations make of a vector of length 1
        at, left, waited = np.zeros(0, dtype=np.intp), np.zeros((0, 0)), 0
        for first in range(0, self.size, WIDTH):
            last = min(first + WIDTH, self.size)
            A, at, of_sums = _assembled(upper, at, left, waited, (first, last))
            pivots = waited + last - first
            lam, Q, T, of_rotation = _rotated(A, pivots)
            gone = np.ones(pivots, dtype=bool)
            if last < self.size:
                gone = np.abs(lam) > WAITS * np.abs(T).max(axis=1, initial=0.0)
            left, of_rest = _without(A[pivots:, pivots:], lam, T, gone)
            error += length * (of_sums + of_rotation + of_rest)
            length *= 1 + _off_orthogonal(Q)
            at = at[last - first :]
            self.fronts.append(Front(waited, first, last, lam, Q, T, at, gone))
            waited = self.fronts[-1].waiting
        signs = np.concatenate([np.sign(f.lam[f.gone]) for f in self.fronts])
        self.positive, self.negative = int((signs > 0).sum()), int((signs < 0).sum())
        whole = self.positive + self.negative == self.size and length < 2
        self.error = error if whole else np.inf

    def solve(self, right: Array) -> Array:
        """About the x of K x = right, shape (size, columns)."""
        x, waiting = right.copy(), np.zeros((0, right.shape[1]))
        scaled = []
        for f in self.fronts:
            z = f.Q.T @ np.concatenate([waiting, x[f.first : f.last]])
            scaled.append(z[f.gone] / f.lam[f.gone, None])
            x[f.at] -= f.T[f.gone].T @ scaled[-1]
            waiting = z[~f.gone]
        for f, own in zip(self.fronts[::-1], scaled[::-1], strict=True):
            z = np.empty((len(f.lam), right.shape[1]))
            z[~f.gone] = waiting
            z[f.gone] = own - (f.T[f.gone] @ x[f.at]) / f.lam[f.gone, None]
            own_and_waiting = f.Q @ z
            waiting = own_and_waiting[: f.waited]
            x[f.first : f.last] = own_and_waiting[f.waited :]
        return x


def _assembled(
    upper: Matrix, before: Index, left: Array, waited: int, own: tuple[int, int]
) -> tuple[Array, Index, float]:
    """The rows of a block, with what waits before them, and what is ``left`` of the unknowns
    ``before``; the numbers of the unknowns of these rows; and the error of their sums."""
    first, last = own
    rows = upper[first:last].tocoo()
    at = np.union1d(np.concatenate([before, rows.col]), np.arange(first, last))
    places = np.concatenate([np.arange(waited), waited + np.searchsorted(at, before)])
    A = np.zeros((waited + len(at), waited + len(at)))
    A[np.ix_(places, places)] = left
    i, j = waited + rows.row, waited + np.searchsorted(at, rows.col)
    A[i, j] += rows.data
    A[j, i] = A[i, j]
    error = np.zeros(A.shape)
    error[i, j] = error[j, i] = ROUNDED * np.abs(A[i, j])
    return A, at, norm(error)


def _rotated(A: Array, pivots: int) -> tuple[Array, Array, Array, float]:
    """Eigenvalues and eigenvectors Q of the first unknowns, the other columns T of these in the
    coordinates of Q, and how far the first rows are from those of Q L Q' and Q T."""
    own, others = A[:pivots, :pivots], A[:pivots, pivots:]
    lam, Q = np.linalg.eigh(own)
    T = Q.T @ others
    size, lost = np.abs(Q), lost_of(pivots)
    of_own = np.abs(own - (Q * lam) @ Q.T) + lost * ((size * np.abs(lam)) @ size.T)
    of_others = np.abs(others - Q @ T) + lost * (size @ np.abs(T))
    return lam, Q, T, norm(of_own) + norm(of_others)


def _without(rest: Array, lam: Array, T: Array, gone: Bools) -> tuple[Array, float]:
    """What is left when some unknowns are eliminated, those that wait before the others, and how
    far it may be from what it should be."""
    out, stay = T[gone], T[~gone]
    scaled = out / lam[gone, None]
    left = rest - out.T @ scaled
    left = np.triu(left) + np.triu(left, 1).T  # rounding errors need not be symmetric
    lost = lost_of(len(out)) * (np.abs(out).T @ np.abs(scaled)) + ROUNDED * np.abs(left)
    return np.block([[np.diag(lam[~gone]), stay], [stay.T, left]]), norm(lost)


def _off_orthogonal(Q: Array) -> float:
    """Q stretches no vector by more than 1 and this, and none to nothing if it is below 1."""
    size = np.abs(Q)
    return norm(np.abs(Q.T @ Q - np.eye(len(Q))) + lost_of(len(Q)) * (size.T @ size))


def lost_of(terms: int) -> float:
    """Relative error of a sum of so many products, in any order, and of a few operations with
    it."""
    return (terms + 8) * ROUNDED


def norm(A: Array) -> float:
    """More than the 2-norm of a matrix of magnitudes."""
    if not A.size:
        return 0.0
    rows, columns = A.sum(axis=1).max(), A.sum(axis=0).max()
    return float(np.sqrt(rows * columns) * (1 + lost_of(sum(A.shape))))
