"""The answer to a problem: on its mesh or to a tolerance, with what can be told of it."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from dmoc.problem.problem import Problem
from dmoc.program.sharing import in_words
from dmoc.results.exploration import exploration_in_words
from dmoc.results.notes import Topic
from dmoc.results.solution import Solution, broken_off, saying
from dmoc.solvers.outcome import Status
from dmoc.solving.checked_solution import checked
from dmoc.solving.indeterminacy import telling, undetermined
from dmoc.solving.mesh.confirmation import naming_steps
from dmoc.solving.mesh.one_mesh import best_on_mesh, on_mesh_of, solved_from, solved_on_mesh
from dmoc.solving.mesh.refinement import refined
from dmoc.solving.request import Request
from dmoc.solving.sliding_reversals import naming_turns
from dmoc.solving.starts import InitialGuess
from dmoc.solving.unbounded_cost import bounded, ended, resumed

# Starts of another sequence, of which it is asked whether it leads to a motion.
FEW = 16
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
    best = best_on_mesh(problem, guess, of_mesh)
    try:
        return _completed(problem, guess, request, of_mesh, best)
    except KeyboardInterrupt:
        return broken_off(best)


def _completed(
    problem: Problem, guess: InitialGuess, request: Request, of_mesh: Request, best: Solution
) -> Solution:
    """What the first mesh has led to on others, and with what can be told of it."""
    tolerance, further = request.tolerance, of_mesh.compiled()

    def solve(verify: bool, problem: Problem, motion: Solution) -> Solution:
        return _finished(solved_from(problem, motion, replace(further, verify=verify)))

    def few(problem: Problem) -> Solution:
        return _finished(best_on_mesh(problem, None, replace(request.compiled(), starts=FEW)))

    def kept(answer: Solution) -> Solution:
        return ended(problem, answer, partial(solve, False), few)

    best = resumed(problem, best, partial(solve, of_mesh.verify))
    longer = bounded(problem, best, partial(solve, False))
    answer = kept(best) if longer is best else longer
    if tolerance is None:
        answer = naming_steps(problem, answer, partial(solve, True))
    elif answer is best:
        answer = kept(_refined(problem, guess, of_mesh, best))
    if answer.minimum and problem.lasting and problem.phases > 1:
        answer = telling(answer, undetermined(problem.meshed(answer.steps), answer))
    forces = in_words(problem) if answer.minimum else ""
    answer = saying(answer, forces) if forces else answer
    if answer.starts:
        answer = saying(answer, exploration_in_words(answer))
    answer = naming_turns(problem, answer, few, request.options.deadline)
    if answer.status is Status.INFEASIBLE and _may_touch(problem):
        answer = saying(answer, NO_EVENT)
    proposal = answer.proposal
    return answer if proposal is None else saying(answer, str(proposal), Topic.PROPOSAL)


def _finished(solution: Solution) -> Solution:
    """A solution of another problem; one that Ctrl-C has ended breaks off the answer too."""
    if solution.status is Status.INTERRUPTED:
        raise KeyboardInterrupt
    return solution


def _may_touch(problem: Problem) -> bool:
    """Whether something may touch of which a problem without a sequence says nothing."""
    open_ones = {*problem.kernels.surfaces} - {*problem.ignored}
    return not problem.sequence and bool(open_ones or problem.model.has_friction.any())


def _refined(problem: Problem, guess: InitialGuess, request: Request, first: Solution) -> Solution:
    """Solve on finer and finer meshes to a tolerance, from what the first one has led to; a larger
    error is a solution too where they do not lead there."""
    tolerance, options, steps = request.tolerance or 0.0, request.options, problem.phase_steps

    def on_mesh(problem: Problem, coarse: Solution | None, sharper: float | None) -> Solution:
        if coarse is None and sharper is None and problem.phase_steps == steps:
            return first
        optimality = options.optimality if sharper is None else max(sharper, LEAST_OPTIMALITY)
        now = request.within(optimality=optimality)
        motion = coarse or (first if first.minimum and on_mesh_of(problem, first) else None)
        if motion is None:  # many starts have led nowhere, and begin on the same coarse mesh
            return solved_on_mesh(problem, guess, now)
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
    return answer
