"""Costs that have no minimum, because they fall as long as the motion takes longer or inputs
grow."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np

from dmoc.base.tolerances import KEPT
from dmoc.codegen.kernels import Array
from dmoc.guess.automatic import NO_TIME, expected_time, initial_guesses
from dmoc.problem.problem import Problem
from dmoc.program.scaling import scale_of
from dmoc.results.solution import Solution
from dmoc.solvers.kkt import LEAST_COST
from dmoc.solvers.outcome import Status
from dmoc.solving.attempts import UNDECIDED

# A cost that goes on to fall ends where it is so small that residuals are no longer compared with
# itself; one that is nothing but rounding errors, whose squares inputs leave, is below the share.
NONE = 1e-17
# The motion is looked at once more with so many times the time; a smaller relative fall of its cost
# tells nothing.
LONGER, FALLS = 2.0, 0.01
# A negative cost that falls by this factor where it is solved once more from its end had no minimum
# there.  An input or a final time has run away that is so many times that of a first motion, if
# limits of so many times these sizes let the cost fall by the factor from each to the next.
TWICE, FAR, LIMITS = 2.0, 100.0, (10.0, 100.0, 1000.0)


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


def ended(
    problem: Problem,
    answer: Solution,
    solve: Callable[[Problem, Solution], Solution],
    afresh: Callable[[Problem], Solution],
) -> Solution:
    """The answer; one whose cost falls without end, as an input or the final time grows, has
    stalled.

    ``solve`` solves a problem from the motion of the answer, ``afresh`` from starts of its own.
    """
    if not (answer.cost < 0 and (answer.minimum or answer.status in UNDECIDED)):
        return answer
    running = list(_running(problem, answer))
    if running and answer.minimum and not solve(problem, answer).cost < TWICE * answer.cost:
        return answer
    for name, limited, size in running:
        ends = [afresh(limited(most * size)) for most in LIMITS]
        costs = [end.cost for end in ends]
        falls = all(after < TWICE * before < 0 for before, after in pairwise(costs))
        if falls and all(end.max_violation <= KEPT for end in ends):
            message = (
                f"the cost has no minimum, it falls as {name} grows: "
                f"{costs[1]:.3g} within {LIMITS[1] * size:.3g}, {costs[2]:.3g} within "
                f"{LIMITS[2] * size:.3g}; bound {name}, or give it a price"
            )
            return replace(answer, status=Status.STALLED, message=message, verification=None)
    return answer


def _running(
    problem: Problem, answer: Solution
) -> Iterator[tuple[str, Callable[[float], Problem], float]]:
    """What may have run away: its name, the problem with a limit of it, and its size in a first
    motion."""
    scale = scale_of(problem, initial_guesses(problem)[0].x)
    for j, (name, box) in enumerate(zip(problem.kernels.inputs, problem.input_bounds, strict=True)):
        largest = max(float(np.abs(phase.u[:, j]).max(initial=0.0)) for phase in answer.phases)
        if np.isinf(box).any() and largest > FAR * scale.u[j]:
            yield name, partial(_with_input, problem, name, box), float(scale.u[j])
    low, high = problem.final_time_bounds
    time = min(scale.time, expected_time(problem) or NO_TIME)
    if np.isinf(high) and answer.final_time > FAR * time:
        yield "final_time", lambda size: problem.but(final_time=(min(low, size), size)), time


def _with_input(problem: Problem, name: str, box: Array, size: float) -> Problem:
    """The problem with an input within a size where it has no bounds."""
    ends = zip((-size, size), box.tolist(), strict=True)
    low, high = (bound if np.isfinite(bound) else end for end, bound in ends)
    return problem.but(bounds={**problem.bounds, name: (min(low, high), max(low, high))})
