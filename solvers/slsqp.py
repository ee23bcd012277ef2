"""SciPy's SLSQP on the condensed program, restarted in the metric of the exact Hessian.

SLSQP builds its Hessian from first derivatives, one rank-two update an iteration, starting from the identity, and its work grows with the cube
of the unknowns.  Four things make it practical here:

* the coordinates inside segments are eliminated (:mod:`dmoc.solvers.condensed`);
* SLSQP runs for a few iterations at a time in unknowns s with y = y_0 + M s, where M is chosen from the exact Hessian of the Lagrangian
  so that the identity *is* the Hessian on the constraints' null space, and the constraints depend on one part of s alone: its first
  step is then a Newton step;
* once the equations are nearly met, they are solved in every trial point, so that SLSQP sees the inequalities alone: equations bend, and
  a line search that weighs their violation against the cost shortens every step across the bend;
* of the many inequalities (gaps and bounds at every node) only those that are or may become active are passed to it; the others are checked
  after every run and added when they are violated.
"""

from __future__ import annotations

import numpy as np
import scipy.optimize
import scipy.sparse

from dmoc.codegen.kernels import Array
from dmoc.mechanics.algebra import least_squares
from dmoc.nlp.tables import NOWHERE
from dmoc.nlp.transcription import Transcription
from dmoc.solvers.condensed import Elimination, Reduced, partition
from dmoc.solvers.judge import INFEASIBLE, meets
from dmoc.solvers.kkt import residuals, violation, with_bounds, worst_constraints
from dmoc.solvers.outcome import Duals, Ending, Options, Residuals, Status
from dmoc.solvers.polish import polish
from dmoc.solvers.runs import (
    EQUATION_TOLERANCE,
    FOLLOWING_LIMIT,
    REFUSED,
    FollowingRun,
    Progress,
    Run,
    Stop,
    Working,
)

# Segments of each phase in the condensed form: fewer make the program more nonlinear, more make each iteration more expensive.
SEGMENTS = 16
# SLSQP iterations between two metrics: enough to settle the active set, few enough to profit from the exact Hessian.
RUN = 5
# Curvatures below this share of the cost's own count as flat; it bounds the first step along them.
FLATTEST = 1e-3
# An inequality within this share of its scale joins the working set.
NEAR = 1e-3
# Runs in a row that may pass without progress, and searches for a feasible point before giving up.
IDLE_RUNS = 8
RESTORATIONS = 2
RESTORATION_LIMIT = 60
# Violation below which a converged run is close enough for Newton's method.
POLISH_FROM = 1e-6
# Relative change of the cost in a run below which Newton's method is tried, and curvature below which its end is a saddle.
SLOW = 1e-3
SADDLE = 1e-4
# Violation of the equations below which they are met before a run, and below which a run follows them.
NEAR_EQUATIONS = 0.1
ON_EQUATIONS = 1e-8
SHORTEST_SHARE = 1e-3


class Driver:
    """SLSQP on one nonlinear program; ``segments`` = 0 is the full form."""

    def __init__(self, nlp: Transcription, x: Array, segments: int) -> None:
        self.nlp = nlp
        self.parts = partition(nlp, segments)
        self.elimination = Elimination(nlp, self.parts, x)
        self.is_eliminated = np.isin(np.arange(nlp.n), self.parts.eliminated)
        self.free = np.flatnonzero(nlp.lower != nlp.upper)
        self.scale = self._scale(x)
        self.y = np.zeros(nlp.n_eq)
        self.w = np.zeros(nlp.n_in)
        self.bound_force = np.zeros(nlp.n)  # multipliers of the bounds, positive at a lower one
        self.watched_rows = np.zeros(nlp.n_in, dtype=bool)
        self.watched_lower = np.zeros(nlp.n, dtype=bool)
        self.watched_upper = np.zeros(nlp.n, dtype=bool)
        self.follows = segments > 0
        self._always()

    def _always(self) -> None:
        """Inequalities that shape the problem from the start: beside collisions, on the times, and on steps and impulses."""
        nlp, lay = self.nlp, self.nlp.layout
        d = nlp.rows.d
        for c, s in zip(lay.collision_nodes, lay.surfaces, strict=True):
            rows = d.gap.index[max(c - 2, 0) : c + 3, s]
            self.watched_rows[rows[rows != NOWHERE] - nlp.n_eq] = True
        for block in (d.earliest, d.latest, d.approach, d.separation):
            self.watched_rows[block.numbers - nlp.n_eq] = True
        self.watched_rows[nlp.minimal_times] = True
        for index in (lay.index_h, lay.index_lam):
            self.watched_lower[index] = np.isfinite(nlp.lower[index])
            self.watched_upper[index] = np.isfinite(nlp.upper[index])
        self.permanent = (self.watched_rows.copy(), self.watched_lower.copy(), self.watched_upper.copy())

    def _scale(self, x: Array) -> Array:
        """Typical size of a change of each unknown; for inputs the size that changes the cost by one half."""
        nlp, lay = self.nlp, self.nlp.layout
        scale = np.ones(nlp.n)
        q = x[lay.index_q]
        scale[lay.index_q] = np.maximum(np.ptp(q, axis=0), 1e-2) / 20
        scale[lay.index_h] = x[lay.index_h] / 10
        scale[lay.index_lam] = np.maximum(np.abs(x[lay.index_lam]), 1.0) / 3
        if lay.nu:
            q_k, _, u, _, h, t_k, _ = lay.step_inputs(nlp.physical(x))
            curvature = nlp.problem.model.running_cost_curvatures(q_k, None, u, t_k[:, 0])
            curvature = h * curvature * nlp.scale.u**2 / nlp.scale.cost
            box = nlp.problem.input_bounds / nlp.scale.u[:, None]
            width = np.where(np.isfinite(box[:, 1] - box[:, 0]), box[:, 1] - box[:, 0], 1.0) / 4
            with np.errstate(divide="ignore"):
                size = np.where(curvature > 0, 1 / np.sqrt(np.maximum(curvature, 1e-300)), width)
            scale[lay.index_u[lay.row_u_kp1]] = size
            scale[lay.index_u[lay.row_u_k]] = size
        return scale

    # Working set -----------------------------------------------------------------------------------------------------

    def working(self, x: Array) -> Working:
        """Return the watched inequalities; watch those that are violated or nearly so, forget those that have become idle."""
        nlp = self.nlp
        d = nlp.inequality(x)
        near = NEAR * self.scale
        with np.errstate(invalid="ignore"):
            below, above = x - nlp.lower, nlp.upper - x
        self.watched_rows = (self.watched_rows & ((d < 1e-1) | (self.w > 0))) | (d < NEAR) | self.permanent[0]
        idle = 1e3 * near
        self.watched_lower = (self.watched_lower & (below < idle)) | (below < near) | self.permanent[1]
        self.watched_upper = (self.watched_upper & (above < idle)) | (above < near) | self.permanent[2]
        free = np.isin(np.arange(nlp.n), self.free)
        return Working(
            np.flatnonzero(self.watched_rows),
            np.flatnonzero(self.watched_lower & free),
            np.flatnonzero(self.watched_upper & free),
        )

    # Metric ----------------------------------------------------------------------------------------------------------

    def metric(self, x: Array) -> tuple[Array, Array] | None:
        """Return (move, null), shapes (n_y, rank) and (n_y, n_y - rank): M = (move | null).

        The columns of ``move`` change the kept equations one by one, dK = I, and are conjugate to those of ``null``, which leave
        the equations as they are and make the Hessian of the Lagrangian the identity, up to signs and the flattest curvatures.
        """
        none = np.zeros(0, dtype=np.intp)
        reduced = self.elimination.reduce(x, none, none)
        if reduced is None:
            return None
        if not self.y.any():
            self._estimate_multipliers(x, reduced)
        self._complete_multipliers(x, reduced)
        D = self.scale[self.parts.kept]
        H = self._hessian(x, reduced, D)
        if not (np.isfinite(H).all() and np.isfinite(reduced.equality).all()):
            return None
        move, null = _split(reduced.equality * D)
        values, V = np.linalg.eigh(null.T @ H @ null)
        null = null @ (V / np.sqrt(np.maximum(np.abs(values), FLATTEST)))
        move = move - null @ (null.T @ (H @ move))
        return D[:, None] * move, D[:, None] * null

    def is_minimum(self, x: Array) -> bool:
        """Whether the Hessian of the Lagrangian is positive where the equations and the active inequalities stay as they are."""
        rows, bounds = np.flatnonzero(self.w > 0), np.flatnonzero(self.bound_force)
        reduced = self.elimination.reduce(x, rows, bounds[self.is_eliminated[bounds]])
        if reduced is None:
            return False
        D = self.scale[self.parts.kept]
        fixed = np.flatnonzero(np.isin(self.parts.kept, bounds))
        held = np.vstack([reduced.equality, reduced.inequality, reduced.unknowns, np.eye(len(D))[fixed]]) * D
        if not np.isfinite(held).all():
            return False
        null = _split(held)[1]
        H = self._hessian(x, reduced, D)
        if not np.isfinite(H).all():
            return False
        return not null.shape[1] or bool(np.linalg.eigvalsh(null.T @ H @ null)[0] > -SADDLE)

    def _hessian(self, x: Array, reduced: Reduced, D: Array) -> Array:
        """Hessian of the Lagrangian in the scaled kept unknowns, dense."""
        nlp, parts = self.nlp, self.parts
        upper = nlp.lagrangian_hessian(x, self.y, -self.w)
        Z = np.zeros((nlp.n, len(parts.kept)))
        Z[parts.kept, np.arange(len(parts.kept))] = D
        if reduced.factors is not None:
            Z[parts.eliminated] = -reduced.factors.solve(self.elimination.kept_columns(x) * D)
        H = Z.T @ ((upper + scipy.sparse.triu(upper, 1).T) @ Z)
        return np.asarray((H + H.T) / 2)

    def estimate_multipliers(self, x: Array) -> None:
        """Multipliers of the equations by least squares, without active inequalities."""
        self.forget_multipliers()
        none = np.zeros(0, dtype=np.intp)
        reduced = self.elimination.reduce(x, none, none)
        if reduced is not None:
            self._estimate_multipliers(x, reduced)
            self._complete_multipliers(x, reduced)

    def _estimate_multipliers(self, x: Array, reduced: Reduced) -> None:
        """Least-squares multipliers of the kept equations."""
        D = self.scale[self.parts.kept]
        if len(reduced.equality):
            self.y[self.parts.kept_rows] = -np.nan_to_num(least_squares((reduced.equality * D).T, reduced.cost * D))

    def _complete_multipliers(self, x: Array, reduced: Reduced) -> None:
        """Multipliers of the eliminated equations, which make the Lagrangian stationary in the eliminated unknowns."""
        if reduced.factors is None:
            return
        nlp, parts = self.nlp, self.parts
        self.y[parts.used_rows] = 0.0
        slope = (
            nlp.cost_gradient(x) + nlp.equality_jacobian(x).T @ self.y - nlp.inequality_jacobian(x).T @ self.w - self.bound_force
        )
        self.y[parts.used_rows] = self.elimination.multipliers(slope, reduced.factors)

    # Equations -------------------------------------------------------------------------------------------------------

    def equation_error(self, x: Array) -> float:
        """Largest violation of an equality constraint."""
        return float(np.abs(self.nlp.equality(x)).max())

    def onto_equations(self, x: Array) -> Array:
        """Meet the kept equations by Gauss-Newton steps of least scaled length; returns the best point found."""
        none = np.zeros(0, dtype=np.intp)
        D = self.scale[self.parts.kept]
        error = self.equation_error(x)
        for _ in range(FOLLOWING_LIMIT):
            if error <= EQUATION_TOLERANCE:
                break
            reduced = self.elimination.reduce(x, none, none)
            if reduced is None or not np.isfinite(reduced.equality).all():
                break
            c = self.nlp.equality(x)[self.parts.kept_rows]
            step = D * least_squares(reduced.equality * D, -c)
            share, better = 1.0, None
            while share > SHORTEST_SHARE and better is None:
                trial = self.elimination.complete(x, self._within_times(x, x[self.parts.kept] + share * step))
                if trial is not None and self.equation_error(trial) < (1 - 0.1 * share) * error:
                    better = trial
                share /= 2
            if better is None:
                break
            x, error = better, self.equation_error(better)
        return x

    def _within_times(self, x: Array, y: Array) -> Array:
        """Change no step size by more than a tenth at once."""
        times = np.isin(self.parts.kept, self.nlp.layout.index_h)
        before = x[self.parts.kept][times]
        y[times] = np.clip(y[times], 0.9 * before, 1.1 * before)
        return y

    def forget_multipliers(self) -> None:
        self.y, self.w, self.bound_force = np.zeros(self.nlp.n_eq), np.zeros(self.nlp.n_in), np.zeros(self.nlp.n)

    def take_multipliers(self, x: Array, y_kept: Array, w_working: Array, working: Working) -> None:
        self.y = np.zeros(self.nlp.n_eq)
        self.y[self.parts.kept_rows] = y_kept
        self.w = np.zeros(self.nlp.n_in)
        a, b = len(working.rows), len(working.rows) + len(working.lower)
        self.w[working.rows] = w_working[:a]
        force = np.zeros(self.nlp.n)
        force[working.lower] += w_working[a:b]
        force[working.upper] -= w_working[b:]
        self.bound_force = force
        none = np.zeros(0, dtype=np.intp)
        reduced = self.elimination.reduce(x, none, none)
        if reduced is not None:
            self._complete_multipliers(x, reduced)


def _split(A: Array) -> tuple[Array, Array]:
    """Return a right inverse of A (if its rows are independent, else of its row space) and an orthonormal basis of its null space."""
    if not A.shape[0]:
        return np.zeros((A.shape[1], 0)), np.eye(A.shape[1])
    U, sizes, Vt = np.linalg.svd(A, full_matrices=True)
    rank = int((sizes > 1e-10 * max(sizes[0], 1e-300)).sum())
    inverse = Vt[:rank].T / sizes[:rank]
    return inverse @ U.T if rank == len(A) else inverse, Vt[rank:].T


def solve(nlp: Transcription, x: Array, options: Options, duals: Duals | None = None) -> Ending:
    """Minimise from x on the condensed program; multipliers of a neighbouring solution do not serve."""
    return _solve(nlp, x, options, SEGMENTS)


def solve_full(nlp: Transcription, x: Array, options: Options, duals: Duals | None = None) -> Ending:
    """Minimise from x on the full program."""
    return _solve(nlp, x, options, 0)


def _solve(nlp: Transcription, x: Array, options: Options, segments: int) -> Ending:
    progress = Progress(nlp, options)
    x = np.clip(x, nlp.lower, nlp.upper)
    progress.consider(x, nlp.cost(x), violation(nlp, x))
    driver = Driver(nlp, x, segments)
    restorations = 0
    try:
        x = _completed(driver, x)
        watch = _Watch()
        while True:
            before = nlp.cost(x)
            x, found, converged = _round(driver, x, progress)
            slow = abs(nlp.cost(x) - before) <= SLOW * max(1.0, abs(before))
            if found.violation <= POLISH_FROM and (converged or slow):
                x, found = _polished(driver, x, options)
            progress.consider(x, nlp.cost(x), found.violation)
            if meets(found, options):
                return _outcome(driver, Status.SOLVED, "", x, progress)
            if watch.progressing(found.violation, nlp.cost(x)):
                continue
            if found.violation <= options.violation:
                return _outcome(driver, Status.STALLED, f"optimality {found.optimality:.1e}", x, progress)
            x = _least_violation(driver, x, progress)
            least = violation(nlp, x)
            if restorations == RESTORATIONS or least > INFEASIBLE:
                detail = "least violation: " + "; ".join(worst_constraints(nlp, x))
                return _outcome(driver, Status.STALLED, detail, x, progress)
            restorations, watch = restorations + 1, _Watch()
            driver.forget_multipliers()
    except Stop as stop:
        return _outcome(driver, stop.status, "", x if progress.best is None else progress.best, progress)
    except KeyboardInterrupt:
        return _outcome(driver, Status.INTERRUPTED, "", x if progress.best is None else progress.best, progress)
    except (np.linalg.LinAlgError, FloatingPointError, ZeroDivisionError) as error:
        return _outcome(
            driver,
            Status.STALLED,
            f"the equations become singular on the way: {error}",
            x if progress.best is None else progress.best,
            progress,
        )


class _Watch:
    """Tells whether the runs still get somewhere: towards the constraints, or, once they hold, to lower cost."""

    def __init__(self) -> None:
        self.violation, self.cost, self.idle = np.inf, np.inf, 0

    def progressing(self, violation: float, cost: float) -> bool:
        held = violation <= POLISH_FROM
        better = violation < 0.9 * self.violation or (held and cost < self.cost - 1e-7 * max(1.0, abs(cost)))
        self.violation = min(violation, self.violation)
        self.cost = min(cost, self.cost) if held else self.cost
        self.idle = 0 if better else self.idle + 1
        return self.idle < IDLE_RUNS


def _completed(driver: Driver, x: Array) -> Array:
    """Solve for the eliminated unknowns; where that fails from the guess, the guess stays as it is and the first run repairs it."""
    full = driver.elimination.complete(x, x[driver.parts.kept])
    return x if full is None else full


def _round(driver: Driver, x: Array, progress: Progress) -> tuple[Array, Residuals, bool]:
    """One metric and one run of SLSQP in it: along the equations if they can be met, else towards them."""
    if driver.follows and driver.equation_error(x) <= NEAR_EQUATIONS:
        x = driver.onto_equations(x)
    metric = driver.metric(x)
    if metric is None:
        raise Stop(Status.STALLED)
    if not metric[1].shape[1]:  # the equations leave no freedom: meeting them is all there is to do
        x = driver.onto_equations(x)
        progress.step(x)
        driver.estimate_multipliers(x)
        return x, residuals(driver.nlp, x, with_bounds(driver.nlp, x, driver.y, driver.w)), True
    working = driver.working(x)
    on = driver.follows and driver.equation_error(x) <= ON_EQUATIONS
    run = FollowingRun(driver, x, metric, working) if on else Run(driver, x, metric, working)
    x, y, w, converged = run.minimise(RUN, progress)
    driver.take_multipliers(x, y, w, working)
    return x, residuals(driver.nlp, x, with_bounds(driver.nlp, x, driver.y, driver.w)), converged


def _polished(driver: Driver, x: Array, options: Options) -> tuple[Array, Residuals]:
    """Take Newton steps with the active set that SLSQP found; keep them if they end in a minimum of no higher cost."""
    rows, bounds = np.flatnonzero(driver.w > 0), np.flatnonzero(driver.bound_force)
    before = driver.y, driver.w, driver.nlp.cost(x)
    better, driver.y, driver.w, found = polish(driver.nlp, x, driver.y, driver.w, rows, bounds)
    solved = meets(found, options)
    lower = driver.nlp.cost(better) <= before[2] + SLOW * max(1.0, abs(before[2]))
    if solved and lower and driver.is_minimum(better):
        return better, found
    driver.y, driver.w = before[:2]
    return x, Residuals(np.inf, violation(driver.nlp, x)) if solved else residuals(
        driver.nlp, x, with_bounds(driver.nlp, x, driver.y, driver.w)
    )


def _least_violation(driver: Driver, x: Array, progress: Progress) -> Array:
    """Minimise the sum of squared violations of constraints and bounds."""
    nlp, parts = driver.nlp, driver.parts
    kept = parts.kept
    gone = parts.eliminated
    rows = np.arange(nlp.n_in)
    low, high = nlp.lower[kept], nlp.upper[kept]
    last = {"x": x}

    def completed(y: Array) -> Array | None:
        progress.check_time()
        return driver.elimination.complete(last["x"], y)

    def residual(y: Array) -> Array:
        full = completed(y)
        if full is None:
            return np.full(len(parts.kept_rows) + nlp.n_in + len(gone), REFUSED)
        last["x"] = full
        excess = np.minimum(full - nlp.lower, 0.0) + np.maximum(full - nlp.upper, 0.0)
        return np.concatenate([nlp.equality(full)[parts.kept_rows], np.minimum(nlp.inequality(full), 0.0), excess[gone]])

    def jacobian(y: Array) -> Array:
        full = completed(y)
        reduced = None if full is None else driver.elimination.reduce(full, rows, gone)
        if full is None or reduced is None:
            raise Stop(Status.STALLED)
        d = nlp.inequality(full) < 0
        outside = ((full < nlp.lower) | (full > nlp.upper))[gone]
        progress.step(full)
        return np.vstack([reduced.equality, reduced.inequality * d[:, None], reduced.unknowns * outside[:, None]])

    margin = 1e-12 * np.maximum(1.0, np.abs(x[kept]))  # least_squares wants a start strictly inside its bounds
    start = np.clip(x[kept], low + margin, high - margin)
    full = completed(start)
    if full is None or not np.isfinite(residual(start)).all():
        return x
    with np.errstate(all="ignore"):
        result = scipy.optimize.least_squares(
            residual, start, jac=jacobian, bounds=(low, high), x_scale=driver.scale[kept], ftol=1e-10, xtol=1e-10, gtol=1e-12,
            max_nfev=RESTORATION_LIMIT,
        )  # fmt: skip
    full = completed(result.x)
    return x if full is None else full


def _outcome(driver: Driver, status: Status, detail: str, x: Array, progress: Progress) -> Ending:
    return Ending(status, detail, x, with_bounds(driver.nlp, x, driver.y, driver.w), progress.count)
