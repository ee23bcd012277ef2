"""SciPy's SLSQP on the condensed program, restarted in the metric of the exact Hessian.

SLSQP builds its Hessian from first derivatives, one rank-two update an iteration, starting from the
identity, and its work grows with the cube of the unknowns.  Four things make it practical here:

* the coordinates inside segments are eliminated (:mod:`dmoc.solvers.condensed`);
* SLSQP runs for a few iterations at a time in unknowns s with y = y_0 + M s, where M is chosen from
  the exact Hessian of the Lagrangian
  so that the identity *is* the Hessian on the constraints' null space, and the constraints depend
  on one part of s alone: its first step is then a Newton step;
* once the equations are nearly met, they are solved in every trial point, so that SLSQP sees the
  inequalities alone: equations bend, and
  a line search that weighs their violation against the cost shortens every step across the bend;
* of the many inequalities (gaps and bounds at every node) only those that are or may become active
  are passed to it; the others are checked
  after every run and added when they are violated.
"""

from __future__ import annotations

import numpy as np
import scipy.optimize

from dmoc.codegen.kernels import Array
from dmoc.program.transcription import Transcription
from dmoc.solvers.iterations import MET, Stop, Tally, Watch
from dmoc.solvers.judge import INFEASIBLE, meets
from dmoc.solvers.kkt import residuals, violation, worst_constraints
from dmoc.solvers.outcome import Duals, Ending, Options, Residuals, Status
from dmoc.solvers.polish import polish
from dmoc.solvers.slsqp_runs import REFUSED, FollowingRun, SlsqpRun
from dmoc.solvers.slsqp_state import Descent

# SLSQP iterations between two metrics: enough to find the active set, few enough to profit from
# the exact Hessian.
RUN = 5
# Runs in a row that may pass without progress, and searches for a feasible point before giving up.
IDLE_RUNS = 8
RESTORATIONS = 2
RESTORATION_LIMIT = 60
# Relative change of the cost in a run below which Newton's method is tried.
SLOW = 1e-3
# Violation of the equations below which they are met before a run, and below which a run follows
# them.
NEAR_EQUATIONS = 0.1
ON_EQUATIONS = 1e-8


def solve_slsqp(
    nlp: Transcription, x: Array, options: Options, duals: Duals | None = None
) -> Ending:
    """Minimise from x on the condensed program.

    Multipliers tell whether x is a solution already, which stays one where the first run of SLSQP
    finds nothing better; where x is none they do not serve."""
    solution = None
    if duals is not None and meets(residuals(nlp, x, duals), options):
        solution = duals
    x = np.clip(x, nlp.lower, nlp.upper)
    tally, descent = Tally(nlp, options, x), Descent(nlp, x)
    return tally.ending(lambda: _descended(descent, x, solution, tally), descent.duals_at)


def _descended(descent: Descent, start: Array, solution: Duals | None, tally: Tally) -> Ending:
    """Run after run of SLSQP; the start itself where it is a solution and nothing better is
    near."""
    nlp, options, least_cost = descent.nlp, tally.options, descent.nlp.cost(start)
    x, restorations = _completed(descent, start), 0
    watch = Watch(IDLE_RUNS, options.violation)

    def ending(status: Status, detail: str = "") -> Ending:
        return Ending(status, detail, x, descent.duals_at(x), tally.count)

    while True:
        before = nlp.cost(x)
        x, left, converged = _round(descent, x, tally)
        slow = abs(nlp.cost(x) - before) <= SLOW * max(1.0, abs(before))
        if left.violation <= MET and (converged or slow):
            x, left = _polished(descent, x, options)
        tally.consider(x, nlp.cost(x), left.violation)
        if meets(left, options):
            return ending(Status.SOLVED)
        better = left.violation <= MET and nlp.cost(x) < least_cost - SLOW * abs(least_cost)
        if solution is not None and not better:
            return Ending(Status.SOLVED, "", start, solution, tally.count)
        if watch.progressing(left.violation, nlp.cost(x)):
            continue
        if left.violation <= options.violation:
            return ending(Status.STALLED, f"optimality {left.optimality:.1e}")
        x = _least_violation(descent, x, tally)
        if restorations == RESTORATIONS or violation(nlp, x) > INFEASIBLE:
            named = "; ".join(worst_constraints(nlp, x))
            return ending(Status.STALLED, f"least violation: {named}")
        restorations, watch = restorations + 1, Watch(IDLE_RUNS, options.violation)
        descent.forget_multipliers()


def _completed(descent: Descent, x: Array) -> Array:
    """Solve for the eliminated unknowns; where that fails from the guess, the guess stays as it
    is and the first run repairs it."""
    full = descent.elimination.complete(x, x[descent.parts.kept])
    return x if full is None else full


def _round(descent: Descent, x: Array, tally: Tally) -> tuple[Array, Residuals, bool]:
    """One metric and one run of SLSQP in it: along the equations if they can be met, else
    towards them."""
    if descent.equation_error(x) <= NEAR_EQUATIONS:
        x = descent.onto_equations(x)
    metric = descent.metric(x)
    if metric is None:
        raise Stop(Status.STALLED)
    if not metric[1].shape[1]:  # the equations leave no freedom: meeting them is all there is to do
        x = descent.onto_equations(x)
        tally.step(x)
        descent.estimate_multipliers(x)
        return x, descent.residuals_at(x), True
    working = descent.working(x)
    on = descent.equation_error(x) <= ON_EQUATIONS
    run = FollowingRun(descent, x, metric, working) if on else SlsqpRun(descent, x, metric, working)
    x, y, w, converged = run.minimise(RUN, tally)
    descent.take_multipliers(x, y, w, working)
    return x, descent.residuals_at(x), converged


def _polished(descent: Descent, x: Array, options: Options) -> tuple[Array, Residuals]:
    """Take Newton steps with the active set that SLSQP found; keep them if they end in a minimum
    of no higher cost."""
    rows, bounds = np.flatnonzero(descent.w > 0), np.flatnonzero(descent.bound_force)
    before = descent.y, descent.w, descent.nlp.cost(x)
    better, descent.y, descent.w, left = polish(descent.nlp, x, descent.y, descent.w, rows, bounds)
    solved = meets(left, options)
    lower = descent.nlp.cost(better) <= before[2] + SLOW * max(1.0, abs(before[2]))
    if solved and lower and descent.is_minimum(better):
        return better, left
    descent.y, descent.w = before[:2]
    if solved:
        return x, Residuals(np.inf, violation(descent.nlp, x))
    return x, descent.residuals_at(x)


def _least_violation(descent: Descent, x: Array, tally: Tally) -> Array:
    """Minimise the sum of squared violations of constraints and bounds."""
    nlp, parts = descent.nlp, descent.parts
    kept = parts.kept
    gone = parts.eliminated
    rows = np.arange(nlp.n_in)
    low, high = nlp.lower[kept], nlp.upper[kept]
    last = {"x": x}

    def completed(y: Array) -> Array | None:
        tally.check_time()
        return descent.elimination.complete(last["x"], y)

    def residual(y: Array) -> Array:
        full = completed(y)
        if full is None:
            return np.full(len(parts.kept_rows) + nlp.n_in + len(gone), REFUSED)
        last["x"] = full
        excess = np.minimum(full - nlp.lower, 0.0) + np.maximum(full - nlp.upper, 0.0)
        return np.concatenate(
            [
                nlp.equality(full)[parts.kept_rows],
                np.minimum(nlp.inequality(full), 0.0),
                excess[gone],
            ]
        )

    def jacobian(y: Array) -> Array:
        full = completed(y)
        reduced = None if full is None else descent.elimination.reduce(full, rows, gone)
        if full is None or reduced is None:
            raise Stop(Status.STALLED)
        d = nlp.inequality(full) < 0
        outside = ((full < nlp.lower) | (full > nlp.upper))[gone]
        tally.step(full)
        return np.vstack(
            [reduced.equality, reduced.inequality * d[:, None], reduced.unknowns * outside[:, None]]
        )

    # Least_squares wants a start strictly inside its bounds.
    margin = 1e-12 * np.maximum(1.0, np.abs(x[kept]))
    start = np.clip(x[kept], low + margin, high - margin)
    full = completed(start)
    if full is None or not np.isfinite(residual(start)).all():
        return x
    with np.errstate(all="ignore"):
        result = scipy.optimize.least_squares(
            residual,
            start,
            jac=jacobian,
            bounds=(low, high),
            x_scale=descent.lengths[kept],
            ftol=1e-10,
            xtol=1e-10,
            gtol=1e-12,
            max_nfev=RESTORATION_LIMIT,
        )
    full = completed(result.x)
    return x if full is None else full
