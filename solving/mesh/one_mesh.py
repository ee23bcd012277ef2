"""Solve on one mesh: from the best of many starts, or from a guess alone."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from dmoc.codegen.kernels import COMPILED, Array
from dmoc.guess.transfer import on_mesh
from dmoc.problem.problem import Problem
from dmoc.program.scaling import scale_of
from dmoc.results.solution import Solution
from dmoc.solvers.outcome import Options, Status
from dmoc.solving.attempts import attempted
from dmoc.solving.checked_solution import checked, solution_of
from dmoc.solving.methods import METHODS
from dmoc.solving.multistart.exploration import Effort, coarse_of, explored
from dmoc.solving.programs import Programs
from dmoc.solving.request import Request
from dmoc.solving.starts import Given, starts_of


def best_on_mesh(problem: Problem, guess: Given, request: Request) -> Solution:
    """Solve on one mesh, from the best of many starts or from a guess alone."""
    if request.starts == 1 or problem.kernels.backend != COMPILED:
        return solved_on_mesh(problem, guess, request)
    options, begin = request.options, time.perf_counter()
    try:
        with np.errstate(all="ignore"):
            effort = Effort.of(request.starts)
            points = on_coarse_mesh(problem, guess)
            found = explored(problem, effort, request.seed, options, request.ranks_checked, points)
    except KeyboardInterrupt:
        return interrupted(problem, guess, request)
    spent, tried = time.perf_counter() - begin, None
    for i, start in enumerate(found.ranked):
        answer = _answer(problem, start, request)
        tried = tried or (answer, i)
        # On the ranking mesh it is settled that the first one is the best, confirmed or not.
        settled = not start.minimum and on_mesh_of(problem, start)
        if answer.minimum or settled or answer.status in (Status.INTERRUPTED, Status.TIME_LIMIT):
            tried = answer, i
            break
    if tried is None:
        tried = _without_start(problem, guess, request), len(found.ranked)
    answer, i = tried
    confirmed = [s.cost for s in found.ranked if s.minimum]
    if answer.status is Status.NOT_VERIFIED and confirmed:
        message = f"{answer.message}; the best minimum that is confirmed costs {min(confirmed):.6g}"
        answer = replace(answer, message=message)
    return replace(
        answer,
        starts=len(found.starts),
        found=found.found[i] if i < len(found.found) else 0,
        others=found.others(i),
        seconds={"build": problem.kernels.seconds, "explore": spent}
        | {"guess": 0.0, "solve": 0.0}
        | dict(answer.seconds),
    )


def interrupted(problem: Problem, guess: Given, request: Request) -> Solution:
    """The answer where Ctrl-C has come before there was one."""
    stopped = replace(request, options=replace(request.options, iterations=1), verify=False)
    status = Status.INTERRUPTED
    return replace(solved_on_mesh(problem, guess, stopped), status=status, message=status.sentence)


def _without_start(problem: Problem, guess: Given, request: Request) -> Solution:
    """The answer where no start has led to a motion.  That there is none is told by the compiled
    method, which takes a hundredth of the time that SLSQP takes to find it out."""
    method = request.method
    if method.falls_back_on:
        silent = replace(request.options, progress=None)
        compiled = replace(request, method=METHODS[method.falls_back_on], options=silent)
        found = solved_on_mesh(problem, guess, compiled)
        if found.status in (Status.INFEASIBLE, Status.INTERRUPTED):
            told = f"{found.message}; {compiled.method.name} told it, {method.name} was not tried"
            return replace(found, message=told)
        guess = found if found.minimum else guess
    return solved_on_mesh(problem, guess, request)


def on_coarse_mesh(problem: Problem, guess: Given) -> dict[str, Array]:
    """A guess that was given on the coarse mesh, by name."""
    if guess is None:
        return {}
    x = starts_of(problem, guess).points[0]
    return {"given": on_mesh(coarse_of(problem), problem, x)}


def meshed_as(problem: Problem, solution: Solution) -> Problem:
    """The problem, on the mesh of a solution where it leaves its own open."""
    return problem if problem.steps is not None else problem.meshed(solution.steps)


def on_mesh_of(problem: Problem, solution: Solution) -> bool:
    return problem.steps is None or solution.steps == problem.phase_steps


def _answer(problem: Problem, start: Solution, request: Request) -> Solution:
    """The solution from a minimum on the ranking mesh: itself where that is the problem's.

    SLSQP gets a minimum on the problem's own mesh: from others it may take many of its dense
    iterations to a point that is flat, as the switches of inputs at their limits are.
    """
    method = request.method
    problem = meshed_as(problem, start)
    as_asked = request.verify == request.ranks_checked and start.method == method.name
    if on_mesh_of(problem, start):
        given = as_asked and request.options.progress is None
        return start if given else solved_on_mesh(problem, start, request)
    if method.falls_back_on:
        silent = replace(request.options, progress=None)
        compiled = METHODS[method.falls_back_on]
        refined = solved_on_mesh(
            problem, start, replace(request, method=compiled, options=silent, verify=False)
        )
        if refined.status is Status.INTERRUPTED:
            return refined
        start = refined if refined.minimum else start
    return solved_on_mesh(problem, start, request)


def solved_on_mesh(problem: Problem, guess: Given, request: Request) -> Solution:
    """Solve on one mesh."""
    method, options = request.method, request.options
    method.check_size(problem.steps, problem.nu * sum(problem.phase_steps))
    begin = time.perf_counter()
    with np.errstate(all="ignore"):
        starts = starts_of(problem, guess, options.deadline)
        guessed = time.perf_counter()
        scale = scale_of(problem, starts.points[0], starts.minimum)
        told = _in_units(options, scale.cost)
        programs = Programs(problem, scale, request.by_rates)
        found = attempted(programs, starts, method, request.form, told)
        solved = time.perf_counter()
        seconds = {
            "build": problem.kernels.seconds,
            "guess": guessed - begin,
            "solve": solved - guessed,
        }
        solution = solution_of(found, method.name, seconds)
    if not (request.verify and solution.minimum):
        return solution
    return checked(solution, options.deadline)


def _in_units(options: Options, cost: float) -> Options:
    """Options whose progress is told with costs in units of the problem."""
    tell = options.progress
    if tell is None:
        return options
    return replace(options, progress=lambda i: tell(replace(i, cost=i.cost * cost)))
