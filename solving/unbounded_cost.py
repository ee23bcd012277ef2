"""Costs that have no minimum, because they fall as long as the motion takes longer, or as inputs, a
state at the start or a design parameter grow."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np

from dmoc.base.names import velocity_name
from dmoc.base.tolerances import KEPT
from dmoc.codegen.kernels import Array
from dmoc.guess.automatic import NO_TIME, expected_time, initial_guesses
from dmoc.problem.problem import Problem
from dmoc.problem.ranges import LONGEST_TIME
from dmoc.program.scale import Scale
from dmoc.program.scaling import scale_of
from dmoc.results.solution import Solution, ending
from dmoc.solvers.kkt import LEAST_COST
from dmoc.solvers.outcome import Status
from dmoc.solving.attempts import UNDECIDED
from dmoc.solving.case import Case

# A cost that goes on to fall ends where it is so small that residuals are no longer compared with
# itself; one that is nothing but rounding errors, whose squares inputs leave, is below the share.
NONE = 1e-17
# The motion is looked at once more with so many times the time; a smaller relative fall of its cost
# tells nothing.
LONGER, FALLS = 2.0, 0.01
# A negative cost that falls by this factor where it is solved once more from its end had no minimum
# there.  What is so many times that of a first motion has run away, if limits of so many times
# these sizes let the cost fall more and more, by the factor.  Where it was not seen to go on, it
# has to fall by this share of the line through two of them: at the minimum of a parabola it has
# fallen by half of it.
TWICE, FAR, LIMITS, STRAIGHT = 2.0, 100.0, (10.0, 100.0, 1000.0), 0.75
STARTS = ("starts", "agreeing_starts", "others")  # fields of an answer: where its starts have led
# Solves that go on from where one has come to no end, each with sizes of its own.
RESUMED = 3


def resumed(answer: Solution, case: Case) -> Solution:
    """The answer; where one came to no end so far away that sizes of its first motion measure
    nothing there, the minimum that a solve from its end leads to, if there is one."""
    end = answer
    for _ in range(RESUMED):
        if not (end.status in UNDECIDED and any(_running(case.problem, end))):
            break
        end = case.along(case.problem, end, case.of_mesh.verify)
    if end is answer or not end.minimum:
        return answer
    return _with_starts(end, answer)


def in_time(answer: Solution, case: Case) -> Solution:
    """The answer; where no start leads to a motion whose final time has no upper limit, the one
    within a limit, unless its cost falls with that, so that starts drift away from all of them."""
    low, high = case.problem.final_time_bounds
    if answer.status is not Status.INFEASIBLE or np.isfinite(high):
        return answer
    size = _first_time(case.problem, scale_of(case.problem, initial_guesses(case.problem)[0].x))
    near = case.led(_in_time(case.problem, low, LIMITS[0] * size))
    if near is None or not near.minimum:
        return answer
    far = case.afresh(_in_time(case.problem, low, LIMITS[1] * size))
    if far.minimum and far.cost < near.cost / TWICE:
        ends = [(end.cost, most * size) for end, most in zip((near, far), LIMITS, strict=False)]
        return _running_away(far, "final_time", *ends)
    end = case.along(case.problem, near, case.of_mesh.verify)
    return _with_starts(end, near) if end.minimum else answer


def bounded(answer: Solution, case: Case) -> Solution:
    """The answer; one whose cost falls with the final time, however long that is, has stalled."""
    share = answer.cost / answer.scale.get("cost", np.inf)
    limited = np.isfinite(case.problem.final_time_bounds[1])
    if limited or not answer.converged or not NONE < share < LEAST_COST:
        return answer
    # with that time, not from it on: a solve of what has no minimum comes to no end
    time = min(LONGER * answer.final_time, LONGEST_TIME)
    longer = case.along(case.problem.but(final_time=time), answer)
    if not (longer.minimum and longer.cost < (1 - FALLS) * answer.cost):
        return answer
    cause = (
        "the cost has no minimum, it falls as long as the motion takes longer: "
        f"{answer.cost:.3g} in {answer.final_time:.3g} s, {longer.cost:.3g} in "
        f"{longer.final_time:.3g} s; give final_time an upper limit"
    )
    return replace(ending(answer, Status.STALLED, cause), verification=None)


def ended(answer: Solution, case: Case) -> Solution:
    """The answer; one whose cost falls without end, as an input, a state at the start, a design
    parameter or the final time grows, has stalled."""
    lost = answer.status in UNDECIDED
    if not (lost or (answer.minimum and answer.cost < 0)):
        return answer
    running = list(_running(case.problem, answer))
    again = case.along(case.problem, answer) if running and answer.minimum else answer
    ends_there = answer.minimum and not again.cost < TWICE * answer.cost
    for name, limited, size, reached in running:
        ends = [case.afresh(limited(most * size)) for most in LIMITS]
        costs = [end.cost for end in ends]
        first, second = (before - after for before, after in pairwise(costs))
        if min(answer.cost, costs[-1]) < 0:  # an end that is lost may have any cost
            falls = second > TWICE * first > 0 > costs[-1]
        else:
            falls = all(0 <= TWICE * after < before for before, after in pairwise(costs))
        falls &= not ends_there or _is_straight(answer.cost, costs, reached / size)
        if falls and all(end.max_violation <= KEPT for end in ends):
            most = [limit * size for limit in LIMITS]
            if answer.max_violation > KEPT:  # what diverges is no motion
                answer = _with_starts(ends[2], answer)
            return _running_away(answer, name, (costs[1], most[1]), (costs[2], most[2]))
    if again is not answer and again.cost < FAR * answer.cost and again.max_violation <= KEPT:
        farthest = {name: reached for name, _, _, reached in _running(case.problem, again)}
        for name, _, _, reached in running:
            if farthest.get(name, 0.0) > TWICE * reached:
                beyond = again.cost, farthest[name]
                return _running_away(answer, name, (answer.cost, reached), beyond)
    return answer


def _with_starts(end: Solution, answer: Solution) -> Solution:
    """A solution with what the starts of an answer have led to."""
    return replace(end, **{field: getattr(answer, field) for field in STARTS})


def _is_straight(cost: float, costs: Sequence[float], reached: float) -> bool:
    """Whether a cost where something reached so many times its size goes on to fall, by the costs
    within the limits: on the line through two limits that are nearer, or beyond it."""
    i = 2 if reached > TWICE * LIMITS[2] else 1
    slope = (costs[i - 1] - costs[i]) / (LIMITS[i] - LIMITS[i - 1])
    line = costs[i] - STRAIGHT * slope * (reached - LIMITS[i])
    return costs[2] < TWICE * cost or (reached > TWICE * LIMITS[i] and cost < line)


def _running_away(
    answer: Solution, name: str, near: tuple[float, float], beyond: tuple[float, float]
) -> Solution:
    """The answer, which has stalled because its cost falls as something grows: costs within two
    limits of it."""
    costs = ", ".join(f"{cost:.3g} within {limit:.3g}" for cost, limit in (near, beyond))
    cause = (
        f"the cost has no minimum, it falls as {name} grows: {costs}; bound {name}, or give it a "
        "price"
    )
    return replace(ending(answer, Status.STALLED, cause), verification=None)


def _running(
    problem: Problem, answer: Solution
) -> Iterator[tuple[str, Callable[[float], Problem], float, float]]:
    """Quantities that may have run away: the name, the problem with a limit of it as a function of
    the limit, its size in a first motion, and how far it is now."""
    scale, kernels = scale_of(problem, initial_guesses(problem)[0].x), problem.kernels
    first, start = answer.phases[0], problem.start_bounds
    inputs = np.max([np.abs(phase.u).max(axis=0, initial=0.0) for phase in answer.phases], axis=0)
    design = np.array([answer.design[name] for name in problem.design])
    turning = np.isinf(start.momentum).any(axis=1, keepdims=True)
    rates = np.where(turning, start.velocity, 0.0)
    for field, names, boxes, sizes, reached in (
        ("bounds", kernels.inputs, problem.input_bounds, scale.u, inputs),
        ("start", kernels.coordinates, start.position, scale.q, first.q[0]),
        ("start", [*map(velocity_name, kernels.coordinates)], rates, scale.v, first.v[0]),
        ("design", problem.design, problem.design_bounds, scale.design, design),
    ):
        for name, box, size, far in zip(names, boxes, sizes, np.abs(reached), strict=True):
            if np.isinf(box).any() and far > FAR * size:
                where = f"{name} at the start" if field == "start" else name
                yield where, partial(_within, problem, field, name, box), float(size), float(far)
    low, high = problem.final_time_bounds
    time = _first_time(problem, scale)
    if np.isinf(high) and answer.final_time > FAR * time:
        limited = partial(_in_time, problem, low)
        yield "final_time", limited, time, answer.final_time


def _first_time(problem: Problem, scale: Scale) -> float:
    """The final time of a first motion, at least the least one that is stated."""
    least = max(problem.final_time_bounds[0], float(problem.duration_bounds[:, 0].sum()))
    return max(least, min(scale.time, expected_time(problem) or NO_TIME))


def _within(problem: Problem, field: str, name: str, box: Array, size: float) -> Problem:
    """The problem with something within a size where it has no bounds."""
    ends = zip((-size, size), box.tolist(), strict=True)
    low, high = (bound if np.isfinite(bound) else end for end, bound in ends)
    stated = {**getattr(problem, field), name: (min(low, high), max(low, high))}
    return problem.but(**{field: stated})


def _in_time(problem: Problem, low: float, size: float) -> Problem:
    """The problem with a limit of the final time, above its least one."""
    return problem.but(final_time=(low, size))
