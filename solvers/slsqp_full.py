"""SciPy's SLSQP on the full program as it stands: all unknowns, all constraints.

It serves as the measure of what the condensed form gains, and is practical up to some tens of
steps.  SLSQP places unknowns no better than costs can be compared, so that Newton's method on the
active set has the last word.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.optimize

from dmoc.codegen.kernels import Array
from dmoc.program.transcription import Transcription
from dmoc.solvers.iterations import Stop, Tally, Watch
from dmoc.solvers.judge import meets
from dmoc.solvers.kkt import violation, with_bounds
from dmoc.solvers.outcome import Duals, Ending, Options, Status
from dmoc.solvers.polish import polish

# Accuracy asked of SLSQP: it stands for optimality, step and violation at once, relative to the
# cost.
ACCURACY = 1e-10
# Iterations in a row that may pass without progress, and starts with a fresh Hessian.
IDLE_ITERATIONS = 100
FRESH_STARTS = 3


def solve_slsqp_full(
    nlp: Transcription, x: Array, options: Options, duals: Duals | None = None
) -> Ending:
    """Minimise from x; multipliers of a neighbouring solution do not serve."""
    x = np.clip(x, nlp.lower, nlp.upper)
    tally, last = Tally(nlp, options, x), Duals(*map(np.zeros, (nlp.n_eq, nlp.n_in, nlp.n)))

    def duals_at(x: Array) -> Duals:
        return with_bounds(nlp, x, last.y, last.w)

    def descend() -> Ending:
        nonlocal x, last
        for _ in range(FRESH_STARTS):
            x, y, w = _run(nlp, x, tally)
            last = with_bounds(nlp, x, y, w)
            x, y, w, left = polish(nlp, x, y, w, np.flatnonzero(w > 0), np.flatnonzero(last.z))
            last = with_bounds(nlp, x, y, w)
            if meets(left, options):
                return Ending(Status.SOLVED, "", x, last, tally.count)
        return Ending(Status.STALLED, "", x, last, tally.count)

    return tally.ending(descend, duals_at)


def _run(nlp: Transcription, x: Array, tally: Tally) -> tuple[Array, Array, Array]:
    """One run of SLSQP in the free unknowns; return x and the multipliers of c and d."""
    free = np.flatnonzero(nlp.lower != nlp.upper)
    watch = Watch(IDLE_ITERATIONS, tally.options.violation)

    def full(s: Array) -> Array:
        tally.check_time()
        there = x.copy()
        there[free] = s
        return there

    def report(s: Array) -> None:
        there = full(s)
        tally.step(there)
        if not watch.progressing(violation(nlp, there), nlp.cost(there)):
            raise Stop(Status.STALLED)

    constraints: list[dict[str, Any]] = [
        {
            "type": "eq",
            "fun": lambda s: nlp.equality(full(s)),
            "jac": lambda s: nlp.equality_jacobian(full(s)).toarray()[:, free],
        },
        {
            "type": "ineq",
            "fun": lambda s: nlp.inequality(full(s)),
            "jac": lambda s: nlp.inequality_jacobian(full(s)).toarray()[:, free],
        },
    ]
    result = scipy.optimize.minimize(
        lambda s: nlp.cost(full(s)),
        x[free],
        jac=lambda s: nlp.cost_gradient(full(s))[free],
        method="SLSQP",
        bounds=np.stack([nlp.lower[free], nlp.upper[free]], axis=1),
        constraints=constraints,
        callback=report,
        options={
            "maxiter": tally.options.iterations,
            "ftol": ACCURACY * max(1.0, abs(nlp.cost(x))),
        },
    )
    multipliers = np.asarray(result.multipliers)
    return (
        full(result.x),
        -multipliers[: nlp.n_eq],
        np.maximum(multipliers[nlp.n_eq : nlp.n_eq + nlp.n_in], 0.0),
    )
