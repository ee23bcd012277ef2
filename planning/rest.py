"""The problem of the rest of a motion: what is left of its phases, from a state that is
measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from typing import Any, ClassVar

import numpy as np

from dmoc.base.arguments import Range, is_number
from dmoc.base.errors import ProblemError
from dmoc.base.names import momentum_name, velocity_name
from dmoc.mechanics.sequence_words import parts_of
from dmoc.planning.measured_state import MeasuredState
from dmoc.problem.problem import Problem
from dmoc.program.extraction import stated_as
from dmoc.program.scaling import scale_of
from dmoc.results.solution import Solution
from dmoc.solving.sensitivity import as_solved


class Rest(Problem):
    """A problem whose start is measured."""

    measured: ClassVar[bool] = True


def planned(problem: Problem, solution: Solution, tolerance: float) -> Problem:
    """The problem as its solution has it: its mesh, the law of impact, chosen parameters, and the
    states at the end that ``periodic`` makes of its start; what is fixed there may be missed by a
    share of its size."""
    _check(problem)
    problem = stated_as(as_solved(problem, solution), solution.multipliers)
    motion = solution.trajectory
    first, names = motion.phases[0], motion.coordinates
    start = _start(names, (first.q[0], first.v[0]))
    begins = start | dict(zip(map(momentum_name, names), first.p[0].tolist(), strict=True))
    goal = dict(problem.goal)
    for r in problem.relations:
        at = sum(factor * begins[name] for name, factor in r.terms)
        goal[r.end] = at + r.low if r.fixed else _range((at + r.low, at + r.high))
    if tolerance:
        sizes = scale_of(problem, solution.unknowns, minimum=True).named(problem)
        goal = {name: _around(at, tolerance * sizes.get(name, 0.0)) for name, at in goal.items()}
    chosen = {name: float(motion.parameters[name]) for name in problem.design}
    return problem.unchecked(
        start=start, goal=goal, periodic=(), design={},
        parameters={**problem.parameters, **chosen},
    )  # fmt: skip


def _around(value: Any, by: float) -> Any:
    """A range around what is a number."""
    return (value - by, value + by) if by and is_number(value) else value


def _start(names: Sequence[str], state: MeasuredState) -> dict[str, float]:
    """A state by name."""
    q, v = state
    rates = zip(map(velocity_name, names), v.tolist(), strict=True)
    return dict(zip(names, q.tolist(), strict=True)) | dict(rates)


def _check(problem: Problem) -> None:
    """Refuse problems whose rest is none of the same kind."""
    refused = {
        "its parameters have a value for each phase": problem.models.change,
        "its model depends on the time, which begins with each plan": problem.explicit_time,
        "its objective or its bounds of integrals look at the whole motion": bool(
            problem.model.totals_of or problem.model.peaks_of or problem.model.has_objective
        ),
        "it counts the hits of the whole motion in a bound": any(
            number for _, number in problem.kernels.manifest.hit_quantities.values()
        ),
        "its kernels run on NumPy, and a plan needs compiled ones": not problem.kernels.compiled,
    }
    for reason, stands in refused.items():
        if stands:
            raise ProblemError(
                f"a Planner cannot take this problem of {problem.kernels.name!r}: {reason}."
            )


def check_recedes(problem: Problem) -> None:
    """Refuse a horizon that recedes where phases are too short for it once others are over."""
    longest, least = problem.duration_bounds[1:, 1].sum(), problem.final_time_bounds[0]
    if problem.phases > 1 and longest < least:
        raise ProblemError(
            f"horizon = 'recedes': the phases after the first last {longest:.4g} s at most, and "
            f"the final time is {least:.4g} s at least; take 'shrinks', or open durations."
        )


def rest_of(
    problem: Problem, phase: int, state: MeasuredState, elapsed: float, begun: float, shrinks: bool
) -> Problem:
    """The problem from phase ``phase`` on, which began at the time ``begun``, from a state at the
    time ``elapsed``; with less time where its horizon shrinks."""
    if not problem.phase_steps[phase]:
        raise ProblemError("the motion is over: its last event has happened.")
    spent = np.zeros(problem.phases - phase)
    spent[0] = elapsed - begun if shrinks else 0.0
    durations = [
        _left((low, high), float(over), "a phase")
        for (low, high), over in zip(problem.duration_bounds[phase:], spent, strict=True)
    ]
    total = problem.final_time_bounds
    changed = {
        "start": _start(problem.kernels.coordinates, state),
        "sequence": problem.sequence[phase:],
        "steps": problem.phase_steps[phase:],
        "durations": durations,
        "final_time": _left(total, elapsed if shrinks else 0.0, "the motion"),
        "via": None if problem.via is None else problem.via[phase:],
        "contacts": parts_of(problem.touch.modes[phase], problem.touch.contacts),
    }
    kept = {field.name: getattr(problem, field.name) for field in fields(problem)}
    rest = Rest(**{**kept, **changed})
    return rest.in_rates() if problem.by_rates else rest


def _left(bounds: Range, spent: float, what: str) -> Any:
    """What is left of bounds of a duration."""
    low, high = bounds
    if high == 0:  # the phase after the last event
        return 0
    if high <= spent:
        raise ProblemError(f"{what} was to end {spent - high:.3g} s ago: nothing is left of it.")
    return _range((low - spent if low > spent else -np.inf, high - spent))


def _range(bounds: Range) -> tuple[float | None, float | None]:
    """Bounds as they are stated."""
    low, high = (float(b) if np.isfinite(b) else None for b in bounds)
    return low, high
