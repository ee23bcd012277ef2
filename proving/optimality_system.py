"""The optimality conditions of a program whose active constraints are known, as equations F(z) = 0.

z are the unknowns x that no bound holds and the multipliers y of the rows (c | d) that hold with
equality.  With L = f + y . (c | d), the equations are grad L = 0 and (c | d) = 0.  Their Jacobian
K = [[H, A'], [A, 0]] is symmetric.  Equations and unknowns are scaled by the same powers of two, so
that the rows of K have about the same size.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.program.blocks import Bools, Index
from dmoc.program.transcription import Transcription
from dmoc.proving.ball_program import BallProgram, Sum
from dmoc.proving.balls import Ball
from dmoc.solvers.kkt_layout import pivots

Matrix = Any  # of SciPy, sparse

BALANCING = 6  # rounds


class Values(NamedTuple):
    """What a program is within balls: the cost and the rows (f | c | d), the gradient of L, shape
    (n,), and the entries of H and A."""

    rows: Ball
    slope: Ball
    hess: Ball
    jac: Ball


class OptimalitySystem:
    """The equations of a program with known active constraints.

    ``held``: limits of the unknowns that are fixed or at a bound, in the problem's units, shape
    (n,); no numbers elsewhere.  ``rows``: mask of the rows (c | d) that hold with equality.
    """

    def __init__(self, nlp: Transcription, held: Array, rows: Bools) -> None:
        self.nlp, self.held, self.rows = nlp, held, rows
        self.free = np.isnan(held)
        inside = np.concatenate([self.free, rows])
        order, _ = pivots(nlp)
        self.order: Index = order[inside[order]]
        self.place = np.full(len(inside), -1)
        self.place[self.order] = np.arange(len(self.order))
        hess, jac = nlp.assembled.hessian, nlp.assembled.jacobian
        self.entry_rows: Index = np.repeat(np.arange(len(rows)), np.diff(jac.indptr))
        self.entry_columns: Index = jac.indices.astype(np.intp)
        bent = np.repeat(np.arange(nlp.n), np.diff(hess.indptr))
        a = self.place[np.concatenate([bent, self.entry_columns])]
        b = self.place[np.concatenate([hess.indices, nlp.n + self.entry_rows])]
        self._inside = (a >= 0) & (b >= 0)
        self._at = np.minimum(a, b)[self._inside], np.maximum(a, b)[self._inside]

    @property
    def size(self) -> int:
        return len(self.order)

    def upper(self, hess: Array, jac: Array) -> Matrix:
        """The upper triangle of K from entries of H and A, not scaled."""
        import scipy.sparse

        entries = np.concatenate([hess, jac])[self._inside]
        return scipy.sparse.csr_matrix((entries, self._at), shape=(self.size, self.size))

    def at(self, x: Array, y: Array) -> tuple[Array, Matrix]:
        """F and the upper triangle of K at a point, not scaled."""
        nlp, e = self.nlp, self.nlp.n_eq
        slope = nlp.lagrangian_gradient(x, y[:e], -y[e:])
        F = np.concatenate([slope, nlp.values(x)[1:]])[self.order]
        return F, self.upper(nlp.program.curvatures(x, y, 1.0), nlp.slopes(x)[nlp.n :])

    def parts(self, z: Array) -> tuple[Array, Array]:
        """Values for all unknowns and for all multipliers from those of z, zero elsewhere."""
        every = np.zeros(len(self.place))
        every[self.order] = z
        return every[: self.nlp.n], every[self.nlp.n :]

    @cached_property
    def balls(self) -> BallProgram:
        return BallProgram(self.nlp)

    def enclosed(self, x: Array, y: Array, radii: Array) -> Values:
        """The program in balls around a point, with radii of z, shape (size,), not scaled."""
        nlp, balls = self.nlp, self.balls
        of_x, of_y = self.parts(radii)
        multipliers = Ball(y, of_y)
        with np.errstate(all="ignore"):  # what has no bounds is seen at the end
            pool = balls.pool(Ball(x, of_x), multipliers, self.held)
            rows, slopes, hess = balls.values(pool), balls.slopes(pool), balls.curvatures(pool)
            slope = Sum(nlp.n)
            slope.add(np.arange(nlp.n), slopes[: nlp.n])
            at = np.flatnonzero(self.rows[self.entry_rows])
            slope.add(self.entry_columns[at], slopes[nlp.n + at] * multipliers[self.entry_rows[at]])
        return Values(rows, slope.result, hess, slopes[nlp.n :])

    def equations(self, values: Values) -> Array:
        """More than |F|, not scaled."""
        every = np.concatenate([values.slope.most, values.rows.most[1:]])
        return np.asarray(every[self.order])


def whole(upper: Matrix) -> Matrix:
    """A symmetric matrix from its upper triangle."""
    import scipy.sparse

    return (upper + scipy.sparse.triu(upper, 1).T).tocsr()


def scaled(upper: Matrix, d: Array) -> Matrix:
    """d K d, exactly where d are powers of two."""
    import scipy.sparse

    D = scipy.sparse.diags(d)
    return (D @ upper @ D).tocsr()


def balanced(upper: Matrix) -> Array:
    """Powers of two d, shape (n,), for which the largest entries of the rows of d K d are about
    1."""
    part = upper.tocoo()
    kept = part.data != 0
    i, j, logs = part.row[kept], part.col[kept], np.log2(np.abs(part.data[kept]))
    d = np.zeros(upper.shape[0])
    for _ in range(BALANCING):
        now, most = logs + d[i] + d[j], np.full(len(d), -np.inf)
        np.maximum.at(most, i, now)
        np.maximum.at(most, j, now)
        d -= np.where(np.isfinite(most), most / 2, 0.0)
    return np.asarray(2.0 ** np.round(d))
