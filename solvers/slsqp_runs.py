"""Runs of SLSQP: a few iterations in the unknowns s of a metric, towards the equations or along
them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import scipy.optimize
from numpy.typing import NDArray

from dmoc.base.records import record
from dmoc.codegen.kernels import Array
from dmoc.mechanics.algebra import least_squares, solved
from dmoc.program.blocks import Index
from dmoc.program.transcription import Transcription
from dmoc.solvers.condensed import Elimination, Linearised, Partition, Reduced
from dmoc.solvers.iterations import Stop, Tally
from dmoc.solvers.outcome import Status

# Weight of the constraint directions in the metric against the null space.
CONSTRAINT_SCALE = 0.1
# Accuracy asked of SLSQP: it stands for optimality, step and violation at once, relative to the
# cost.
SLSQP_ACCURACY = 1e-12
# What a trial step that cannot be completed reports, so that the line search shortens it.
REFUSED = 1e10
# What a run along the equations keeps them to, and how many corrections that may take.
EQUATION_TOLERANCE = 1e-12
FOLLOWING_LIMIT = 20
# Multiples of it that rounding errors may leave; share of its residual that an iteration may leave
# with old derivatives; growth from which the motion is lost.
UNCERTAIN, CHORD, MOST_GROWTH = 100.0, 0.1, 1e3
# A trial step may shrink no step size below this share of what it was at the start of the run.
LEAST_SHRINK = 0.02


class RunContext(Protocol):
    """The parts of a descent that each of its runs needs."""

    nlp: Transcription
    parts: Partition
    elimination: Elimination
    is_eliminated: NDArray[np.bool_]


@record(frozen=True, eq=False)
class Working:
    """Working set: rows of d, and unknowns (positions in x) at their lower and upper bounds."""

    rows: Index
    lower: Index
    upper: Index

    @property
    def size(self) -> int:
        return len(self.rows) + len(self.lower) + len(self.upper)


@dataclass
class _Trial:
    """A trial point: completed unknowns, and the derivatives once they are asked for."""

    s: Array
    x: Array | None
    reduced: Reduced | None = None


class SlsqpRun:
    """One run of SLSQP in Y = Y_0 + S s, s of shape (k,), over a working set, with the kept
    equations as constraints."""

    def __init__(
        self, setting: RunContext, x: Array, metric: tuple[Array, Array], working: Working
    ) -> None:
        self.setting, self.working = setting, working
        self.S = np.hstack([CONSTRAINT_SCALE * metric[0], metric[1]])
        self.origin = x[setting.parts.kept].copy()
        self.x = x
        self._times = np.flatnonzero(np.isin(setting.parts.kept, setting.nlp.layout.index_h))
        bound = np.concatenate([working.lower, working.upper])
        self.by_elimination = bound[setting.is_eliminated[bound]]
        self._point = _Trial(np.full(self.S.shape[1], np.nan), None)
        self.tally: Tally | None = None

    def _complete(self, s: Array) -> Array | None:
        y = self.origin + self.S @ s
        return self.setting.elimination.complete(self.x, y) if self._keeps_time(y) else None

    def _keeps_time(self, y: Array) -> bool:
        """Whether no step size has shrunk to a small share of its value at the start: negative ones
        would pass for short ones."""
        return bool((y[self._times] > LEAST_SHRINK * self.origin[self._times]).all())

    def _along(self, reduced: Reduced, slopes: Array) -> Array:
        """Derivatives with respect to s from those with respect to y, shape (..., kept)."""
        return np.asarray(slopes @ self.S)

    def _at(self, s: Array) -> _Trial:
        if self.tally is not None:
            self.tally.check_time()
        if not np.array_equal(self._point.s, s):
            self._point = _Trial(s.copy(), self._complete(s))
        return self._point

    def _derivatives(self, s: Array) -> Reduced:
        """Derivatives with respect to y."""
        point = self._at(s)
        if point.reduced is None:
            x = self.x if point.x is None else point.x
            reduced = self.setting.elimination.reduce(x, self.working.rows, self.by_elimination)
            if reduced is None:
                raise Stop(Status.STALLED)
            self.x, point.reduced = x, reduced
            self._moved(reduced)
        return point.reduced

    def _moved(self, reduced: Reduced) -> None:
        """Called when the derivatives at a new point are asked for: SLSQP has accepted it."""

    def cost(self, s: Array) -> float:
        """Cost at the unknowns s of SLSQP, shape (k,)."""
        x = self._at(s).x
        return REFUSED if x is None else self.setting.nlp.cost(x)

    def cost_gradient(self, s: Array) -> Array:
        """Gradient of the cost in s, shape (k,)."""
        reduced = self._derivatives(s)
        return self._along(reduced, reduced.cost)

    def equality(self, s: Array) -> Array:
        """Kept equations at s, shape (kept equations,)."""
        x = self._at(s).x
        rows = self.setting.parts.kept_rows
        return np.full(len(rows), REFUSED) if x is None else self.setting.nlp.equality(x)[rows]

    def equality_jacobian(self, s: Array) -> Array:
        reduced = self._derivatives(s)
        return self._along(reduced, reduced.equality)

    def inequality(self, s: Array) -> Array:
        """Inequalities and bounds of the working set at s, >= 0, shape (working set,)."""
        x = self._at(s).x
        w, nlp = self.working, self.setting.nlp
        if x is None:
            return np.full(w.size, -REFUSED)
        return np.concatenate(
            [nlp.inequality(x)[w.rows], (x - nlp.lower)[w.lower], (nlp.upper - x)[w.upper]]
        )

    def inequality_jacobian(self, s: Array) -> Array:
        """Derivatives of the working set in s, shape (working set, k)."""
        reduced = self._derivatives(s)
        return self._along(reduced, self._working_slopes(reduced))

    def _working_slopes(self, reduced: Reduced) -> Array:
        """Derivatives of the working set with respect to y."""
        lower, upper = (
            self._bound_slopes(index, reduced) for index in (self.working.lower, self.working.upper)
        )
        return np.vstack([reduced.inequality, lower, -upper])

    def _bound_slopes(self, unknowns: Index, reduced: Reduced) -> Array:
        """dx_i/dy of the given unknowns."""
        rows = np.zeros((len(unknowns), len(self.origin)))
        gone = self.setting.is_eliminated[unknowns]
        kept = np.flatnonzero(~gone)
        rows[kept, np.searchsorted(self.setting.parts.kept, unknowns[kept])] = 1.0
        if gone.any():
            order = np.array(
                [int(np.flatnonzero(self.by_elimination == i)[0]) for i in unknowns[gone]],
                dtype=np.intp,
            )
            rows[gone] = reduced.unknowns[order]
        return rows

    def _constraints(self) -> list[dict[str, Any]]:
        constraints: list[dict[str, Any]] = []
        if len(self.setting.parts.kept_rows):
            constraints.append({"type": "eq", "fun": self.equality, "jac": self.equality_jacobian})
        return constraints

    def minimise(self, iterations: int, tally: Tally) -> tuple[Array, Array, Array, bool]:
        """Run SLSQP; return x, shape (n,), multipliers of the kept equations and of the working
        set, shapes (kept equations,) and (working set,), and whether it converged."""
        self.tally = tally
        constraints = self._constraints()
        if self.working.size:
            constraints.append(
                {"type": "ineq", "fun": self.inequality, "jac": self.inequality_jacobian}
            )
        start = np.zeros(self.S.shape[1])
        accuracy = SLSQP_ACCURACY * max(1.0, abs(self.cost(start)))

        def report(s: Array) -> None:
            point = self._at(s)
            if point.x is not None:
                tally.step(point.x)

        with np.errstate(all="ignore"):
            result = scipy.optimize.minimize(
                self.cost,
                start,
                jac=self.cost_gradient,
                method="SLSQP",
                constraints=constraints,
                callback=report,
                options={"maxiter": iterations, "ftol": accuracy},
            )
        x = self._at(result.x).x
        y, w = self._multipliers(np.asarray(result.multipliers), result.x)
        return self.x if x is None else x, y, w, result.status in (0, 8)

    def _multipliers(self, multipliers: Array, s: Array) -> tuple[Array, Array]:
        n_eq = len(self.setting.parts.kept_rows)
        return -multipliers[:n_eq], np.maximum(multipliers[n_eq:], 0.0)


class FollowingRun(SlsqpRun):
    """A run along the manifold of the kept equations: y = y_0 + null s + move r, where r(s) solves
    them.

    The equations bend, and a line search that weighs their violation against the cost would shorten
    every step across the bend.
    """

    def __init__(
        self, setting: RunContext, x: Array, metric: tuple[Array, Array], working: Working
    ) -> None:
        super().__init__(setting, x, metric, working)
        self.move, self.S = metric
        self._point = _Trial(np.full(self.S.shape[1], np.nan), None)
        self.r = self._trial_r = np.zeros(self.move.shape[1])
        self._accepted: Linearised | None = None  # at the last point that SLSQP has accepted

    def _complete(self, s: Array) -> Array | None:
        """Solve the eliminated equations, then all of them at once for the eliminated unknowns
        and r, by Newton's method with the derivatives of the accepted point as long as they
        serve."""
        setting, elimination = self.setting, self.setting.elimination
        base, linear, none = self.origin + self.S @ s, self._accepted, np.zeros(0, dtype=np.intp)
        r, previous = self.r, np.inf
        begin = base + self.move @ r
        x = elimination.complete(self.x, begin) if self._keeps_time(begin) else None
        if x is None:
            return None
        for _ in range(FOLLOWING_LIMIT):
            y = base + self.move @ r
            if not self._keeps_time(y):
                return None
            x[setting.parts.kept] = y
            c = setting.nlp.equality(x)
            size = self._excess(c)
            if size <= 1 or (size <= UNCERTAIN and size > 0.5 * previous):
                self._trial_r = r
                return x
            if not size < MOST_GROWTH * previous:
                return None
            if linear is None or size > CHORD * previous:
                reduced = elimination.reduce(x, none, none)
                if reduced is None:
                    return None
                linear = self._linearised(x, reduced)
            previous = size
            eliminated, change = elimination.step(linear, c)
            x[setting.parts.eliminated] += eliminated
            r = r + change
        return None

    def _excess(self, c: Array) -> float:
        """Largest violation of the equations, in units of what is demanded."""
        parts = self.setting.parts
        used, kept = np.abs(c[parts.used_rows]), np.abs(c[parts.kept_rows])
        return max(
            float(used.max(initial=0.0)) / self.setting.elimination.tolerance,
            float(kept.max(initial=0.0)) / EQUATION_TOLERANCE,
        )

    def _linearised(self, x: Array, reduced: Reduced) -> Linearised:
        inverse = solve_linear(reduced.equality @ self.move, np.eye(len(reduced.equality)))
        return self.setting.elimination.linearised(x, reduced.factors, self.move, inverse)

    def _moved(self, reduced: Reduced) -> None:
        self.r = self._trial_r
        self._accepted = self._linearised(self.x, reduced)

    def _along(self, reduced: Reduced, slopes: Array) -> Array:
        along = slopes - self._prices(reduced, slopes) @ reduced.equality
        return np.asarray(along @ self.S)

    def _prices(self, reduced: Reduced, slopes: Array) -> Array:
        """What the kept equations contribute to slopes that vanish along ``move``."""
        at = self._accepted or self._linearised(self.x, reduced)
        return np.asarray(slopes @ self.move @ at.inverse)

    def _constraints(self) -> list[dict[str, Any]]:
        return []

    def _multipliers(self, multipliers: Array, s: Array) -> tuple[Array, Array]:
        """Multipliers of the kept equations, for a Lagrangian stationary along ``move``, and of the
        rest."""
        w = np.maximum(multipliers, 0.0)
        reduced = self._derivatives(s)
        return -self._prices(reduced, reduced.cost - w @ self._working_slopes(reduced)), w


def solve_linear(A: Array, b: Array) -> Array:
    """Solve A x = b, in the sense of least squares where A is singular or not square."""
    if A.shape[0] == A.shape[1]:
        x = solved(A, b)
        if np.isfinite(x).all():
            return x
    return least_squares(A, b)
