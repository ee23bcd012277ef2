"""Runs of SLSQP: a few iterations in the unknowns s of a metric, towards the equations or along
them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import scipy.optimize
from numpy.typing import NDArray

from dmoc.codegen.kernels import Array
from dmoc.mechanics.algebra import least_squares, solved
from dmoc.nlp.tables import Index
from dmoc.nlp.transcription import Transcription
from dmoc.solvers.condensed import Elimination, Partition, Reduced
from dmoc.solvers.outcome import Status
from dmoc.solvers.tally import Stop, Tally

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
# A trial step may shrink no step size below this share of what it was at the start of the run.
LEAST_SHRINK = 0.02


class Setting(Protocol):
    """What a run needs to know of the descent that it is part of."""

    nlp: Transcription
    parts: Partition
    elimination: Elimination
    is_eliminated: NDArray[np.bool_]


@dataclass(frozen=True)
class Working:
    """Working set: rows of d, and unknowns (positions in x) at their lower and upper bounds."""

    rows: Index
    lower: Index
    upper: Index

    @property
    def size(self) -> int:
        return len(self.rows) + len(self.lower) + len(self.upper)


@dataclass
class _Point:
    """A trial point: completed unknowns, and the derivatives once they are asked for."""

    s: Array
    x: Array | None
    reduced: tuple[Reduced, Array] | None = None


class Run:
    """One run of SLSQP in Y = Y_0 + S s over a working set, with the kept equations as
    constraints."""

    def __init__(
        self, setting: Setting, x: Array, metric: tuple[Array, Array], working: Working
    ) -> None:
        self.setting, self.working = setting, working
        self.S = np.hstack([CONSTRAINT_SCALE * metric[0], metric[1]])
        self.origin = x[setting.parts.kept].copy()
        self.x = x
        bound = np.concatenate([working.lower, working.upper])
        self.by_elimination = bound[setting.is_eliminated[bound]]
        self._point = _Point(np.full(self.S.shape[1], np.nan), None)
        self.tally: Tally | None = None

    def _complete(self, s: Array) -> Array | None:
        y = self.origin + self.S @ s
        return self.setting.elimination.complete(self.x, y) if self._keeps_time(y) else None

    def _keeps_time(self, y: Array) -> bool:
        """Whether no step size has shrunk to a small share of what it was: negative ones would
        pass for short ones."""
        times = np.isin(self.setting.parts.kept, self.setting.nlp.layout.index_h)
        return bool((y[times] > LEAST_SHRINK * self.origin[times]).all())

    def _directions(self, reduced: Reduced) -> Array:
        """dy/ds."""
        return self.S

    def _at(self, s: Array) -> _Point:
        if self.tally is not None:
            self.tally.check_time()
        if not np.array_equal(self._point.s, s):
            self._point = _Point(s.copy(), self._complete(s))
        return self._point

    def _derivatives(self, s: Array) -> tuple[Reduced, Array]:
        """Derivatives with respect to y, and dy/ds."""
        point = self._at(s)
        if point.reduced is None:
            x = self.x if point.x is None else point.x
            reduced = self.setting.elimination.reduce(x, self.working.rows, self.by_elimination)
            if reduced is None:
                raise Stop(Status.STALLED)
            point.reduced = reduced, self._directions(reduced)
            self.x = x
            self._moved(s)
        return point.reduced

    def _moved(self, s: Array) -> None:
        """Called when the derivatives at a new point are asked for: SLSQP has accepted it."""

    def cost(self, s: Array) -> float:
        x = self._at(s).x
        return REFUSED if x is None else self.setting.nlp.cost(x)

    def cost_gradient(self, s: Array) -> Array:
        reduced, directions = self._derivatives(s)
        return np.asarray(reduced.cost @ directions)

    def equality(self, s: Array) -> Array:
        x = self._at(s).x
        rows = self.setting.parts.kept_rows
        return np.full(len(rows), REFUSED) if x is None else self.setting.nlp.equality(x)[rows]

    def equality_jacobian(self, s: Array) -> Array:
        reduced, directions = self._derivatives(s)
        return np.asarray(reduced.equality @ directions)

    def inequality(self, s: Array) -> Array:
        x = self._at(s).x
        w, nlp = self.working, self.setting.nlp
        if x is None:
            return np.full(w.size, -REFUSED)
        return np.concatenate(
            [nlp.inequality(x)[w.rows], (x - nlp.lower)[w.lower], (nlp.upper - x)[w.upper]]
        )

    def inequality_jacobian(self, s: Array) -> Array:
        reduced, directions = self._derivatives(s)
        return np.asarray(self._working_slopes(reduced) @ directions)

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
        """Run SLSQP; return x, multipliers of the kept equations and of the working set, and
        whether it converged."""
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

    def _multipliers(self, found: Array, s: Array) -> tuple[Array, Array]:
        n_eq = len(self.setting.parts.kept_rows)
        return -found[:n_eq], np.maximum(found[n_eq:], 0.0)


class FollowingRun(Run):
    """A run along the manifold of the kept equations: y = y_0 + null s + move r, where r(s) solves
    them.

    The equations bend, and a line search that weighs their violation against the cost would shorten
    every step across the bend.
    """

    def __init__(
        self, setting: Setting, x: Array, metric: tuple[Array, Array], working: Working
    ) -> None:
        super().__init__(setting, x, metric, working)
        self.move, self.S = metric
        self._point = _Point(np.full(self.S.shape[1], np.nan), None)
        self.r = self._trial_r = np.zeros(self.move.shape[1])

    def _complete(self, s: Array) -> Array | None:
        r, x, previous = self.r.copy(), self.x, np.inf
        base = self.origin + self.S @ s
        if not self._keeps_time(base):
            return None
        for _ in range(FOLLOWING_LIMIT):
            y = base + self.move @ r
            full = self.setting.elimination.complete(x, y) if self._keeps_time(y) else None
            if full is None:
                return None
            x = full
            error = self.setting.nlp.equality(x)[self.setting.parts.kept_rows]
            size = float(np.abs(error).max())
            if size <= EQUATION_TOLERANCE or (
                size <= 100 * EQUATION_TOLERANCE and size > 0.5 * previous
            ):
                self._trial_r = r
                return x
            if not size < 1e3 * min(previous, 1.0):
                return None
            chord = size < 0.1 * previous and len(r) == len(error)
            change = error if chord else self._newton(x, error)
            if change is None:
                return None
            r, previous = r - change, size
        return None

    def _newton(self, x: Array, error: Array) -> Array | None:
        """Change of r that cancels the error to first order at x."""
        none = np.zeros(0, dtype=np.intp)
        reduced = self.setting.elimination.reduce(x, none, none)
        if reduced is None:
            return None
        return solve_linear(reduced.equality @ self.move, error)

    def _moved(self, s: Array) -> None:
        self.r = self._trial_r

    def _directions(self, reduced: Reduced) -> Array:
        bend = solve_linear(reduced.equality @ self.move, reduced.equality @ self.S)
        return np.asarray(self.S - self.move @ bend)

    def _constraints(self) -> list[dict[str, Any]]:
        return []

    def _multipliers(self, found: Array, s: Array) -> tuple[Array, Array]:
        """Those of the equations make the Lagrangian stationary along ``move``."""
        w = np.maximum(found, 0.0)
        reduced, _ = self._derivatives(s)
        slope = reduced.cost - w @ self._working_slopes(reduced)
        y = -solve_linear((reduced.equality @ self.move).T, slope @ self.move)
        return y, w


def solve_linear(A: Array, b: Array) -> Array:
    """Solve A x = b, in the sense of least squares where A is singular or not square."""
    if A.shape[0] == A.shape[1]:
        found = solved(A, b)
        if np.isfinite(found).all():
            return found
    return least_squares(A, b)
