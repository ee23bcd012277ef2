"""Costs that have no minimum, because they fall as long as the motion takes longer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from dmoc.problem.problem import Problem
from dmoc.results.solution import Solution
from dmoc.solvers.kkt import LEAST_COST
from dmoc.solvers.outcome import Status

# A cost that goes on to fall ends where it is so small that residuals are no longer compared with
# itself; one that is nothing but rounding errors, whose squares inputs leave, is below the share.
NONE = 1e-17
# The motion is looked at once more with so many times the time; a smaller relative fall of its cost
# tells nothing.
LONGER, FALLS = 2.0, 0.01


def bounded(
    problem: Problem, answer: Solution, solve: Callable[[Problem, Solution], Solution]
) -> Solution:
    """The answer; one whose cost falls with the final time, however long that is, has stalled.

    ``solve`` solves a problem from the motion of the answer.
    """
    share = answer.cost / answer.scale.get("cost", np.inf)
    limited = np.isfinite(problem.final_time_bounds[1])
    if limited or not answer.minimum or not NONE < share < LEAST_COST:
        return answer
    time = LONGER * answer.final_time
    longer = solve(problem.but(final_time=(time, None)), answer)
    if not (longer.minimum and longer.cost < (1 - FALLS) * answer.cost):
        return answer
    message = (
        "the cost has no minimum, it falls as long as the motion takes longer: "
        f"{answer.cost:.3g} in {answer.final_time:.3g} s, {longer.cost:.3g} in "
        f"{longer.final_time:.3g} s; give final_time an upper limit"
    )
    return replace(answer, status=Status.STALLED, message=message, verification=None)
