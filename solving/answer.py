"""The answer to a problem: on its mesh or to a tolerance, with what can be told of it."""

from __future__ import annotations

from dataclasses import replace
from functools import partial, reduce

from dmoc.problem.problem import Problem
from dmoc.program.sharing import in_words
from dmoc.results.exploration import exploration_in_words
from dmoc.results.notes import Topic
from dmoc.results.solution import Solution, broken_off, saying
from dmoc.solvers.outcome import Status
from dmoc.solving.case import Case, Critic, first_of
from dmoc.solving.checked_solution import checked
from dmoc.solving.indeterminacy import telling, undetermined
from dmoc.solving.mesh.coarseness import telling_coarseness
from dmoc.solving.mesh.confirmation import naming_steps
from dmoc.solving.mesh.one_mesh import (
    MeshAnswer,
    answers_on_mesh,
    on_mesh_of,
    solved_from,
    solved_on_mesh,
)
from dmoc.solving.mesh.refinement import refined
from dmoc.solving.request import Request
from dmoc.solving.sliding_reversals import naming_turns
from dmoc.solving.starts import InitialGuess
from dmoc.solving.unbounded_cost import bounded, ended, in_time, resumed

# Iterations on a mesh that begins with the motion of a coarser one: more lead elsewhere.
FROM_COARSE = 300
# A mesh is solved to the tolerance of a refinement, but not below what rounding allows; the barrier
# may be driven further down.
BASE_OPTIMALITY, LEAST_OPTIMALITY = 1e-8, 1e-11
NO_EVENT = (
    "the sequence is empty: dmoc.search(problem, strategy='propose') looks for events with which "
    "there is a motion"
)


def answer_of(problem: Problem, guess: InitialGuess, request: Request) -> Solution:
    """Solve on the mesh of the problem, or to a tolerance; from a guess alone if one is given
    without a number of starts."""
    alone = request.starts is None and guess is not None
    return best_answer(problem, guess, replace(request, starts=1) if alone else request)


def best_answer(problem: Problem, guess: InitialGuess, request: Request) -> Solution:
    """Solve on the mesh of the problem, or to a tolerance; a guess is one of many starts, unless
    their number is 1."""
    tolerance, of_mesh = request.tolerance, request
    if tolerance is not None:
        base = min(request.options.optimality, max(tolerance, BASE_OPTIMALITY))
        of_mesh = replace(request.within(optimality=base), verify=False)
    asked, first = (replace(of, begun=None) for of in (request, of_mesh))
    case, answer, other, without = Case(problem, guess, asked, first), None, None, ""
    answers = answers_on_mesh(problem, guess, of_mesh)
    best = next(answers)
    if best is None:
        if request.thorough and request.starts is None:
            from dmoc.solving.other_forms import in_other_form  # here, because it is rare

            other, without = in_other_form(problem, request, best_answer)
            if other is not None and other.status is not Status.GRAZES:
                return other
        best = next(filter(None, answers))
    try:
        answer = _told(best, case)
        if other is not None and not answer.minimum:
            return other
        answer = saying(answer, without) if without and not answer.minimum else answer
        for later in filter(None, answers) if request.thorough else ():
            told = _told(later, case)
            if told.minimum and not (answer.minimum and answer.cost < told.cost):
                answer = told
        return answer
    except KeyboardInterrupt:
        return broken_off(answer or best.solution)


def _told(best: MeshAnswer, case: Case) -> Solution:
    """What all critics make of the best solution on the first mesh."""
    case = replace(case, coarse=best.coarse)
    return reduce(lambda answer, critic: critic(answer, case), CRITICS, best.solution)


def _leaving_open(answer: Solution, case: Case) -> Solution:
    """The answer with a note on what its minimum does not determine."""
    problem = case.problem
    if not (answer.minimum and problem.lasting and problem.phases > 1):
        return answer
    return telling(answer, undetermined(problem.meshed(answer.steps), answer))


def _sharing_forces(answer: Solution, case: Case) -> Solution:
    """Forces of which the motion determines sums alone."""
    forces = in_words(case.problem) if answer.minimum else ""
    return saying(answer, forces) if forces else answer


def _exploring(answer: Solution, case: Case) -> Solution:
    """The answer with a note on where its starts have led."""
    return saying(answer, exploration_in_words(answer)) if answer.starts else answer


def _wanting_events(answer: Solution, case: Case) -> Solution:
    """The answer with a note that events may lead to a motion where a sequence has none."""
    wants = answer.status is Status.INFEASIBLE and _may_touch(case.problem)
    return saying(answer, NO_EVENT) if wants else answer


def _proposing(answer: Solution, case: Case) -> Solution:
    """Another sequence that its motion proposes."""
    proposal = answer.proposal
    return answer if proposal is None else saying(answer, str(proposal), Topic.PROPOSAL)


def _may_touch(problem: Problem) -> bool:
    """Whether something may touch of which a problem without a sequence says nothing."""
    grips = problem.touch.contacts.named(problem.touch.contacts.of_grips)
    open_ones = {*problem.kernels.surfaces} - {*problem.ignored, *grips}
    return not problem.sequence and bool(open_ones or problem.model.has_friction.any())


def _refined(first: Solution, case: Case) -> Solution:
    """Solve on finer and finer meshes to a tolerance, from what the first one has led to; a larger
    error is a solution too where they do not lead there."""
    problem, request = case.problem, case.of_mesh
    tolerance, options, steps = request.tolerance, request.options, problem.phase_steps
    if tolerance is None:
        return first

    def on_mesh(problem: Problem, coarse: Solution | None, sharper: float | None) -> Solution:
        if coarse is None and sharper is None and problem.phase_steps == steps:
            return first
        optimality = options.optimality if sharper is None else max(sharper, LEAST_OPTIMALITY)
        now = request.within(optimality=optimality)
        motion = coarse or (first if first.minimum and on_mesh_of(problem, first) else None)
        if motion is None:  # many starts have led nowhere, and begin on the same coarse mesh
            return solved_on_mesh(problem, case.guess, now)
        few = now.within(iterations=min(options.iterations, FROM_COARSE))
        return solved_from(problem, motion, few)

    check = partial(checked, deadline=options.deadline)
    answer = refined(problem, tolerance, options.deadline, on_mesh, check)
    met = ("starts", "agreeing_starts", "first_start", "unseen_share", "others")
    answer = replace(answer, **{name: getattr(first, name) for name in met})
    confirmed = answer.verification is not None and answer.verification.passed
    near = answer.error_estimate is not None and answer.error_estimate <= request.loose
    if answer.status is Status.NOT_VERIFIED and confirmed and near:
        status = Status.GRAZES if any(c.grazes for c in answer.collisions) else Status.SOLVED
        cause = f"a local minimum was found, confirmed by simulation; {answer.cause}"
        answer = replace(answer, status=status, cause=cause)
    return ended(answer, case)


def _within_time(answer: Solution, case: Case) -> Solution:
    """A motion that starts with a limited final time alone lead to, judged as all others."""
    other = in_time(answer, case)
    return first_of(bounded, ended, _refined)(other, case) if other.minimum else other


# What is told of an answer, in order: minima that are none, and what the mesh leaves of the others,
# then notes.
CRITICS: tuple[Critic, ...] = (
    resumed,
    first_of(_within_time, bounded, ended, _refined),
    naming_steps,
    telling_coarseness,
    _leaving_open,
    _sharing_forces,
    _exploring,
    naming_turns,
    _wanting_events,
    _proposing,
)
