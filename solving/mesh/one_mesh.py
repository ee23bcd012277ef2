"""Solve on one mesh: from the best of many starts, or from a guess alone."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from dmoc.base.deadline import Deadline
from dmoc.base.records import record
from dmoc.codegen.kernels import Array
from dmoc.guess.transfer import on_mesh
from dmoc.problem.problem import Problem
from dmoc.program.scaling import scale_of
from dmoc.results.solution import Minimum, Solution, broken_off, saying
from dmoc.solvers.outcome import Options, Status
from dmoc.solving.attempts import attempted
from dmoc.solving.checked_solution import checked, solution_of
from dmoc.solving.programs import Programs
from dmoc.solving.request import GIVEN, Request
from dmoc.solving.starts import InitialGuess, starts_of

if TYPE_CHECKING:
    from dmoc.solving.multistart.exploration import Exploration

# What follows the starts may take so many times as long as before; more starts are worth their time
# where they have such a share of what is left.
MARGIN, WORTH = 2.0, 0.25
# Share of the time after which other forms are tried where no start has led to a motion.
BEFORE_OTHERS = 1 / 3
# Starts that were not tried may lead to a motion.
OUT_OF_STARTS = "the time limit was used up before a start led to a motion: raise it"


@record(frozen=True, eq=False)
class MeshAnswer:
    """The solution on one mesh, and its minimum on the coarse mesh of the starts that led to it."""

    solution: Solution
    coarse: Minimum | None = None


def best_on_mesh(problem: Problem, guess: InitialGuess, request: Request) -> Solution:
    """Solve on one mesh, from the best of many starts or from a guess alone."""
    return next(filter(None, answers_on_mesh(problem, guess, request))).solution


def answers_on_mesh(
    problem: Problem, guess: InitialGuess, request: Request
) -> Iterator[MeshAnswer | None]:
    """The solution on one mesh, and, if another one is asked for and there was no time for enough
    starts, that after more of them: until what is left takes the time that it has taken between
    the two, with a margin.  Where no start has led to a motion, None comes first."""
    if request.starts == 1 or not problem.kernels.compiled:
        yield MeshAnswer(solved_on_mesh(problem, guess, request))
        return
    # here, because a solve from its guess alone needs none of it
    from dmoc.solving.multistart.effort import Effort
    from dmoc.solving.multistart.exploration import SEEKING, continued, explored
    from dmoc.solving.other_forms import other_forms

    lasts = request.thorough and request.options.deadline.ends
    effort = Effort.of(request.starts, request.seed, request.ranks_checked, request.most)
    hurries = lasts and request.starts is None and other_forms(problem)
    effort = replace(effort, lasts=lasts, share=BEFORE_OTHERS if hurries else None)
    begin = time.perf_counter()
    points = on_coarse_mesh(problem, guess, request.given)
    exploration = explored(problem, effort, request.options, points)
    spent = time.perf_counter() - begin
    if not exploration.ranked:
        yield None
        if hurries:
            until = request.options.deadline.share(SEEKING)
            exploration = continued(exploration, request.options, until) or exploration
    yield _best_explored(problem, guess, request, exploration, spent)
    deadline, now = request.options.deadline, time.perf_counter()
    until = Deadline(deadline.at - MARGIN * (now - exploration.end))
    more = None
    if lasts and exploration.ranked and until.left > WORTH * deadline.left:
        more = continued(exploration, request.options, until)
    if more is not None:
        spent += time.perf_counter() - now
        yield _best_explored(problem, guess, request, more, spent)


def _best_explored(
    problem: Problem,
    guess: InitialGuess,
    request: Request,
    exploration: Exploration,
    seconds: float,
) -> MeshAnswer:
    """The solution from the best minimum of an exploration, which has taken some seconds."""
    spent = {"build": problem.kernels.seconds, "explore": seconds}
    answer, i = _best_of(problem, exploration.solutions, request)
    if answer is None:
        answer = _without_start(problem, guess, request)
        if exploration.late and answer.status is Status.INFEASIBLE:
            until_then = f"{OUT_OF_STARTS}; until then {answer.cause}"
            answer = replace(answer, status=Status.TIME_LIMIT, cause=until_then)
    confirmed = [s for s in exploration.solutions if s.minimum]
    if answer.status is Status.NOT_VERIFIED and confirmed:
        answer = saying(answer, _cheapest(confirmed))
    met = exploration.ranked[i] if i < len(exploration.ranked) else None
    ranked = met.minimum if met else None
    answer = replace(
        answer,
        starts=len(exploration.starts),
        agreeing_starts=ranked.starts if ranked else 0,
        first_start=ranked.first if ranked else "",
        unseen_share=exploration.unseen,
        others=exploration.others(i),
        seconds=spent | {"guess": 0.0, "solve": 0.0} | dict(answer.seconds),
    )
    return MeshAnswer(answer, met.coarse.unrefined if met else None)


def _cheapest(confirmed: Sequence[Solution]) -> str:
    """A sentence with the cost of the cheapest of some confirmed minima."""
    best = min(confirmed, key=lambda s: s.cost)
    grazes = ", but one of its collisions has no effect" if best.status is Status.GRAZES else ""
    return f"the best minimum that is confirmed costs {best.cost:.6g}{grazes}"


def _best_of(
    problem: Problem, minima: Sequence[Solution], request: Request
) -> tuple[Solution | None, int]:
    """The answer from the first of some ranked minima that leads to one, with its number; else that
    from the first of all."""
    first = None
    for i, start in enumerate(minima):
        answer = _from_minimum(problem, start, request)
        # On the ranking mesh the first one is known to be the best, confirmed or not.
        is_best = not start.minimum and on_mesh_of(problem, start)
        if answer.minimum or is_best or answer.status in (Status.INTERRUPTED, Status.TIME_LIMIT):
            return answer, i
        first = first or answer
    return first, 0


def interrupted(problem: Problem, guess: InitialGuess, request: Request) -> Solution:
    """The answer where Ctrl-C has come before there was one."""
    stopped = replace(request.within(iterations=1), verify=False)
    return broken_off(solved_on_mesh(problem, guess, stopped))


def _without_start(problem: Problem, guess: InitialGuess, request: Request) -> Solution:
    """The answer where no start has led to a motion.  That there is none is told by the compiled
    method, which takes a hundredth of the time that SLSQP takes to find it out."""
    method = request.method
    if method.falls_back_on:
        compiled = request.compiled()
        s = solved_on_mesh(problem, guess, compiled)
        if s.status in (Status.INFEASIBLE, Status.INTERRUPTED):
            return saying(s, f"{compiled.method.name} told it, {method.name} was not tried")
        guess = s if s.minimum else guess
    return solved_on_mesh(problem, guess, request)


def on_coarse_mesh(problem: Problem, guess: InitialGuess, name: str = GIVEN) -> dict[str, Array]:
    """A guess that was given on the coarse mesh, by its name."""
    if guess is None:
        return {}
    from dmoc.solving.multistart.exploration import coarse_of

    with np.errstate(all="ignore"):
        x = starts_of(problem, guess).points[0]
        return {name: on_mesh(coarse_of(problem), problem, x)}


def on_mesh_of(problem: Problem, solution: Solution) -> bool:
    return problem.steps is None or solution.steps == problem.phase_steps


def _from_minimum(problem: Problem, start: Solution, request: Request) -> Solution:
    """The solution from a minimum on the ranking mesh: itself where that is the problem's.

    SLSQP gets a minimum on the problem's own mesh: from others it may take many of its dense
    iterations to a point that is flat, as the switches of inputs at their limits are.
    """
    method = request.method
    if on_mesh_of(problem, start):
        as_requested = request.verify == request.ranks_checked and start.method == method.name
        if as_requested and request.options.progress is None:
            return start
    elif method.falls_back_on:
        refined = solved_on_mesh(problem, start, replace(request.compiled(), verify=False))
        if refined.status is Status.INTERRUPTED:
            return refined
        start = refined if refined.minimum else start
    return solved_from(problem, start, request)


def solved_from(problem: Problem, motion: Solution, request: Request) -> Solution:
    """Solve from a motion, on its mesh where the problem leaves its own open."""
    mesh = problem if problem.steps is not None else problem.meshed(motion.steps)
    return solved_on_mesh(mesh, motion, request)


def solved_on_mesh(problem: Problem, guess: InitialGuess, request: Request) -> Solution:
    """Solve on one mesh."""
    method, options = request.method, request.options
    method.check_size(problem.steps, problem.nu * sum(problem.phase_steps))
    begin, begun = time.perf_counter(), request.begun
    with np.errstate(all="ignore"):
        starts = begun.starts if begun else starts_of(problem, guess, options.deadline)
        guessed = time.perf_counter()
        scale = scale_of(problem, starts.points[0], starts.minimum)
        programs = Programs(problem, scale)
        limits = _in_units(options, scale.cost)
        end = begun.end if begun else None
        attempt = attempted(programs, starts, method, request.form, limits, end)
        solved = time.perf_counter()
        seconds = {
            "build": problem.kernels.seconds,
            "guess": guessed - begin,
            "solve": solved - guessed,
        }
        solution = solution_of(attempt, method.name, seconds)
    if not (request.verify and solution.minimum):
        return solution
    try:
        return checked(solution, options.deadline)
    except KeyboardInterrupt:
        return broken_off(solution)


def _in_units(options: Options, cost: float) -> Options:
    """Options whose progress is told with costs in units of the problem."""
    tell = options.progress
    if tell is None:
        return options
    return replace(options, progress=lambda i: tell(replace(i, cost=i.cost * cost)))
