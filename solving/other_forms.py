"""Other forms of a problem, where no start leads to a motion as it is stated: what the user has
left open may be what stands in the way."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TypeAlias

from dmoc.base.errors import DmocError
from dmoc.codegen.system_kernels import build, kernels_of
from dmoc.problem.problem import Problem
from dmoc.problem.statement import AUTOMATIC_ORDER, DEFAULT_ORDER
from dmoc.results.solution import Solution, saying
from dmoc.solving.multistart.effort import Effort
from dmoc.solving.multistart.exploration import explored
from dmoc.solving.request import Request

# Steps of the form of lower order, which are the first of a refinement.
STEPS = 60
# Starts of a form, of which it is asked whether one leads to a motion, and their share of the time.
FEW, SHARE = 16, 0.5

BEFORE = "one of this form's"  # the name of the motion that these led to

Form: TypeAlias = tuple[str, Callable[[], Problem]]
Answer: TypeAlias = Callable[[Problem, Solution, Request], Solution]


def other_forms(problem: Problem) -> list[Form]:
    """Forms of a problem in words, the cheapest first: none where nothing was left open."""
    return list(_forms(problem))


def _forms(problem: Problem) -> Iterator[Form]:
    goal, kernels = problem.goal_bounds, problem.kernels
    at_rest = bool(((goal.velocity == 0) | (goal.momentum == 0)).all())
    if problem.durations is None and problem.sequence and at_rest and _steps_alike(problem):
        ranges = [(None, None)] * len(problem.sequence) + [(0, 0)]
        yield (
            "a last duration of 0, so that the motion ends with its last event",
            lambda: problem.but(durations=ranges),
        )
    system = kernels.system
    automatic = problem.steps is None and problem.order == AUTOMATIC_ORDER
    if system is not None and automatic and problem.controls is None:

        def lower() -> Problem:
            plain = build(system(), order=DEFAULT_ORDER, backend=kernels.backend)
            made = kernels_of(plain, DEFAULT_ORDER, kernels.design)
            return problem.but(kernels=replace(made, reference=kernels.reference), steps=STEPS)

        yield f"kernels of order {DEFAULT_ORDER} and {STEPS} steps a phase at first", lower


def _steps_alike(problem: Problem) -> bool:
    """Whether no phase has steps of its own, of which those of the last one would have to go."""
    return problem.steps is None or isinstance(problem.steps, int)


def in_other_form(
    problem: Problem, request: Request, answer: Answer
) -> tuple[Solution | None, str]:
    """The answer to the first form of a problem that some start leads to a motion of, with a note
    on it, or None; and a sentence on the forms that led to none."""
    tried = list[str]()
    for words, made in other_forms(problem):
        deadline = request.options.deadline
        try:
            form = made()
        except DmocError:  # there is no such form: its last event ends no motion, for instance
            continue
        effort = Effort.of(FEW, request.seed, request.ranks_checked)
        options = replace(request.options, deadline=deadline.share(SHARE))
        motions = explored(form, effort, options).solutions
        if motions:
            other = answer(form, motions[0], replace(request, thorough=False, given=BEFORE))
            if other.minimum:
                return saying(
                    other, f"as it was stated, no start led to a motion: it has {words}"
                ), ""
        tried.append(words)
        if deadline.passed:
            break
    return None, f"nor did {FEW} starts with {', or with '.join(tried)}" if tried else ""
