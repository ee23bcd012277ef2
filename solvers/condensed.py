"""The condensed form: coordinates inside segments are eliminated by solving the discrete equations
of motion.

The chain of steps is cut into segments.  Within a segment the momentum equation of node k
determines q_{k+1}, and the equations of step k the node inside it, the times inside it and at its
end, and the velocity there, where there are such unknowns.  The eliminated unknowns X follow from
the remaining ones Y by a Newton iteration on a banded matrix, and derivatives with respect to Y
come from adjoint solves with the same factors.  What stays as an unknown is Y = (h, u, lam,
boundary values, and the two nodes that start each segment); what stays as a constraint is
everything that the elimination did not use.  One segment a phase is single shooting; more make the
program less nonlinear, so that the driver needs fewer iterations, each of which costs more.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from scipy.linalg import lapack

from dmoc.base.records import record
from dmoc.codegen.kernels import Array
from dmoc.program.blocks import NOWHERE, Index
from dmoc.program.evaluator import Matrix
from dmoc.program.transcription import Transcription

# Residual of the eliminated equations relative to the momenta: a few roundings.
NEWTON_TOLERANCE = 1e-13
NEWTON_LIMIT = 25
# A segment keeps two nodes as unknowns, so shorter ones eliminate next to nothing.
SHORTEST_SEGMENT = 4


@record(frozen=True, eq=False)
class Partition:
    """Eliminated unknowns and equations, and those that are kept (positions in x and in c)."""

    eliminated: Index
    used_rows: Index
    kept: Index
    kept_rows: Index


def partition(nlp: Transcription, segments: int) -> Partition:
    """Cut every phase into at most ``segments`` segments."""
    layout, step, impact = nlp.layout, nlp.laws.step, nlp.laws.impact
    gone_parts, used_parts = [np.zeros(0, dtype=np.intp)], [np.zeros(0, dtype=np.intp)]
    for i, (first, last) in enumerate(pairwise(layout.ends)):
        pieces = min(segments, max(1, (last - first) // SHORTEST_SEGMENT))
        cuts: Any = np.linspace(first, last, pieces + 1).round().astype(int)
        for a, b in pairwise(cuts):
            start = a if a == 0 else a + 1  # the first node's momentum equation starts the chain
            nodes, rows = np.arange(start + 1, b), np.arange(start, b - 1)
            # Step by step, so that the matrix is banded: the node inside step k, node k + 1, its
            # time and its velocity.
            timed = [layout.index_t[nodes][:, None]] if layout.timed else []
            clocks = [step.time.index[rows][:, None]] if layout.timed else []
            for parts, columns in (
                (gone_parts, (layout.index_t_i[rows], layout.index_q_i[rows],
                              layout.index_q[nodes], *timed, layout.index_w[nodes])),
                (used_parts, (step.time_inside.index[rows], step.inside.index[rows],
                              step.momentum.index[rows], *clocks, step.passing.index[nodes])),
            ):  # fmt: skip
                part = np.hstack(columns).ravel()
                parts.append(part[part != NOWHERE])
        if i < layout.phases - 1:  # the velocities beside the collision
            gone_parts.append(layout.impact.v_a[i])
            used_parts.append(impact.arrival.index[i])
        if i < layout.stepped - 1:  # after the end there may be a goal
            gone_parts.append(layout.impact.v_c[i])
            used_parts.append(impact.departure.index[i])
    gone, used_rows = np.concatenate(gone_parts), np.concatenate(used_parts)
    free = np.ones(nlp.n, dtype=bool)
    free[gone] = False
    free[nlp.lower == nlp.upper] = False
    rest = np.ones(nlp.n_eq, dtype=bool)
    rest[used_rows] = False
    return Partition(gone, used_rows, np.flatnonzero(free), np.flatnonzero(rest))


class _Submatrix:
    """Picks a fixed set of rows and columns out of matrices with one pattern, given by the
    values of their entries."""

    def __init__(
        self, pattern: Matrix, rows: Index, columns: Index, transposed: bool = False
    ) -> None:
        numbered = pattern.copy()
        numbered.data = np.arange(1.0, len(pattern.data) + 1)
        part = numbered[rows][:, columns]
        self.sparse = (part.T if transposed else part).tocsr()
        self.source = self.sparse.data.astype(np.intp) - 1
        self.row = np.repeat(np.arange(self.sparse.shape[0]), np.diff(self.sparse.indptr))
        self.column = self.sparse.indices

    def dense(self, values: Array, rows: Index | None = None) -> Array:
        """The submatrix, or some of its rows."""
        if rows is None:
            out = np.zeros(self.sparse.shape)
            out[self.row, self.column] = values[self.source]
            return out
        place = np.full(self.sparse.shape[0], -1)
        place[rows] = np.arange(len(rows))
        at = place[self.row]
        kept = at >= 0
        out = np.zeros((len(rows), self.sparse.shape[1]))
        out[at[kept], self.column[kept]] = values[self.source[kept]]
        return out

    def times(self, values: Array, right: Array) -> Array:
        """The submatrix (rows, columns) of the entries ``values``, shape (entries,), times a dense
        matrix (columns, k), or its transpose where it was made so."""
        self.sparse.data = values[self.source]
        return np.asarray(self.sparse @ right)


class Elimination:
    """Solves the eliminated equations and carries derivatives over to the kept unknowns."""

    def __init__(self, nlp: Transcription, parts: Partition, x: Array) -> None:
        self.nlp = nlp
        self.parts = parts
        equality, inequality = nlp.equality_jacobian(x), nlp.inequality_jacobian(x)
        rows = np.arange(nlp.n_in)
        self._E_X = _Submatrix(equality, parts.used_rows, parts.eliminated)
        self._E_Y = _Submatrix(equality, parts.used_rows, parts.kept)
        self._E_Y_T = _Submatrix(equality, parts.used_rows, parts.kept, transposed=True)
        self._K_X = _Submatrix(equality, parts.kept_rows, parts.eliminated)
        self._K_Y = _Submatrix(equality, parts.kept_rows, parts.kept)
        self._D_X = _Submatrix(inequality, rows, parts.eliminated)
        self._D_Y = _Submatrix(inequality, rows, parts.kept)
        offset = self._E_X.row - self._E_X.column
        self._kl, self._ku = int(offset.max(initial=0)), int(-offset.min(initial=0))
        self._place = np.full(nlp.n, -1)
        self._place[parts.eliminated] = np.arange(len(parts.eliminated))
        with np.errstate(all="ignore"):
            size = float(np.abs(nlp.momenta(x)[1] / nlp.scale.p).max())
        # Residual of the eliminated equations that rounding errors leave.
        self.tolerance = NEWTON_TOLERANCE * max(1.0, size if np.isfinite(size) else 1.0)
        self._band = (self._kl + self._ku + self._E_X.row - self._E_X.column, self._E_X.column)

    @property
    def size(self) -> int:
        return len(self.parts.eliminated)

    def complete(self, x: Array, y: Array) -> Array | None:
        """Return x, shape (n,), with the kept unknowns y, shape (kept,), and the eliminated ones
        solved for, started from those in x; None if Newton fails."""
        x = x.copy()
        x[self.parts.kept] = y
        previous, tolerance = np.inf, self.tolerance
        for _ in range(NEWTON_LIMIT):
            with np.errstate(all="ignore"):
                residual = self.nlp.equality(x)[self.parts.used_rows]
                error = float(np.abs(residual).max())
            if not np.isfinite(error):
                return None
            if error <= tolerance or (error <= 1e4 * tolerance and error > 0.3 * previous):
                return x
            previous = error
            factors = self.factor(x)
            if factors is None:
                return None
            x[self.parts.eliminated] -= factors.solve(residual)
        return None

    def factor(self, x: Array) -> Factors | None:
        """Factor the derivative of the eliminated equations with respect to the eliminated unknowns
        at x, shape (n,); None where it is singular or not finite."""
        values = self.nlp.equality_slopes(x)
        band = np.zeros((2 * self._kl + self._ku + 1, self.size), order="F")
        band[self._band] = values[self._E_X.source]
        if not np.isfinite(values).all():
            return None
        lu, pivots, info = lapack.dgbtrf(band, self._kl, self._ku, overwrite_ab=True)
        return Factors(lu, pivots, self._kl, self._ku) if info == 0 else None

    def reduce(self, x: Array, rows: Index, columns: Index) -> Reduced | None:
        """Derivatives at x, shape (n,), with respect to y of the cost, of the kept equations, of
        the inequalities ``rows`` and of x[columns], numbers of shape (k,) each."""
        cost, equality = self.nlp.cost_gradient(x), self.nlp.equality_slopes(x)
        inequality = self.nlp.inequality_slopes(x) if len(rows) else np.zeros(0)
        parts = self.parts
        K_Y, D_Y = self._K_Y.dense(equality), self._D_Y.dense(inequality, rows)
        f_Y = cost[parts.kept]
        B_Y = np.zeros((len(columns), len(parts.kept)))
        factors = self.factor(x)
        if factors is None:
            return None
        picked = np.zeros((len(columns), self.size))
        picked[np.arange(len(columns)), self._place[columns]] = 1.0
        right = np.vstack(
            [
                cost[parts.eliminated][None],
                self._K_X.dense(equality),
                self._D_X.dense(inequality, rows),
                picked,
            ]
        )
        adjoint = factors.solve(right.T, transposed=True)
        change = -self._E_Y_T.times(equality, adjoint).T
        a, b, c = 1, 1 + len(K_Y), 1 + len(K_Y) + len(D_Y)
        return Reduced(
            f_Y + change[0], K_Y + change[a:b], D_Y + change[b:c], B_Y + change[c:], factors
        )

    def linearised(self, x: Array, factors: Factors, move: Array, inverse: Array) -> Linearised:
        """The equations to first order at x, shape (n,), where y = y_0 + move r: ``move`` is (kept,
        equations), ``inverse`` (equations, equations), both of the kept ones."""
        return Linearised(self.nlp.equality_slopes(x), factors, move, inverse)

    def step(self, at: Linearised, c: Array) -> tuple[Array, Array]:
        """Changes of the eliminated unknowns, shape (eliminated,), and of r that cancel all
        equations c, shape (n_eq,), to first order."""
        t = at.factors.solve(c[self.parts.used_rows])
        r = -at.inverse @ (c[self.parts.kept_rows] - self._K_X.times(at.slopes, t))
        return -t - at.factors.solve(self._E_Y.times(at.slopes, at.move @ r)), r

    def kept_columns(self, x: Array) -> Array:
        """Derivative of the eliminated equations at x, shape (n,), with respect to the kept
        unknowns, dense, shape (eliminated, kept)."""
        return self._E_Y.dense(self.nlp.equality_slopes(x))

    def multipliers(self, stationarity: Array, factors: Factors) -> Array:
        """Multipliers of the eliminated equations, shape (eliminated,), that make ``stationarity``
        + J^T y, shape (n,), vanish in the eliminated unknowns."""
        return -factors.solve(stationarity[self.parts.eliminated], transposed=True)


@record(frozen=True, eq=False)
class Factors:
    """Banded LU factors."""

    lu: Array
    pivots: Index
    kl: int
    ku: int

    def solve(self, right: Array, transposed: bool = False) -> Array:
        """Solve for a right-hand side of shape (size,) or (size, k)."""
        solution, info = lapack.dgbtrs(
            self.lu, self.kl, self.ku, right, self.pivots, trans=int(transposed)
        )
        if info != 0:
            raise ValueError(f"dgbtrs: argument {-info} is wrong")
        return np.asarray(solution)


@record(frozen=True, eq=False)
class Linearised:
    """The equations to first order in the eliminated unknowns and in r, where y = y_0 + move r:
    entries of their Jacobian, factors of the eliminated ones, and the inverse of d(kept
    equations)/dr."""

    slopes: Array
    factors: Factors
    move: Array
    inverse: Array


@record(frozen=True, eq=False)
class Reduced:
    """Gradient of the cost, Jacobians of the kept equations, of chosen inequalities and of
    chosen eliminated unknowns, dense, in y."""

    cost: Array
    equality: Array
    inequality: Array
    unknowns: Array
    factors: Factors
