"""Solve a problem: programs, starts, a method, the check, and meshes where a tolerance asks for
them."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from dmoc.arguments import choice, flag, function, positive, text, whole
from dmoc.codegen.kernels import COMPILED
from dmoc.nlp.problem import Problem
from dmoc.nlp.scaling import scale_of
from dmoc.solution import Solution
from dmoc.solvers.outcome import ITERATIONS, OPTIMALITY, VIOLATION, Iteration, Options, Status
from dmoc.solving.attempts import attempted, remaining
from dmoc.solving.exploration import Effort, explored
from dmoc.solving.methods import DEFAULT, FORMS, METHODS, REFINING, Method
from dmoc.solving.program import Programs
from dmoc.solving.refinement import refined
from dmoc.solving.result import checked, solution_of
from dmoc.solving.sensitivity import check_problem
from dmoc.solving.starts import Given, starts_of

# A mesh is solved to the tolerance of a refinement, but not below what rounding allows; the barrier
# may be driven further down.
BASE_OPTIMALITY, LEAST_OPTIMALITY = 1e-8, 1e-11
MOST_STARTS = 1_000_000
MOST_ITERATIONS = 2**31 - 1  # what the compiled method can count


def solve(
    problem: Problem,
    method: str | None = None,
    *,
    tolerance: float | None = None,
    form: str = "condensed",
    guess: Given = None,
    starts: int | None = None,
    seed: int = 0,
    optimality: float = OPTIMALITY,
    violation: float = VIOLATION,
    iterations: int = ITERATIONS,
    seconds: float | None = None,
    progress: Callable[[Iteration], None] | None = None,
    verify: bool = True,
    reference: str = "",
) -> Solution:
    """Solve an optimal control problem for its sequence of collisions.

    Parameters
    ----------
    problem : Problem
    method : {"slsqp", "ipm", "ipopt", "uno"}
        SciPy's sequential quadratic programming on the condensed program; the compiled
        interior-point method of dmoc; IPOPT; Uno.  The last two are extras.  The default is
        "slsqp", with a tolerance "ipm".
    tolerance : float, optional
        Refine the mesh, beginning with the problem's steps, until the estimated relative error of
        cost, durations and positions and the simulated errors over segments are below it.  The
        solution has the estimate and the meshes.
    form : {"condensed", "full"}
        For slsqp: "condensed" eliminates coordinates by solving the discrete equations of motion;
        "full" leaves all unknowns to the solver, which is practical up to some tens of steps.  The
        other methods work on the full sparse program.
    guess : Solution, path, mapping, list of mappings, or array, optional
        Where to start; by default an automatic guess.  A solution, or that of a file, must have the
        same number of collisions; one on another mesh or of another order is interpolated, the
        multipliers of one with the same steps serve too (not with slsqp).  A mapping gives courses
        of coordinates and inputs by name, and "durations", the seconds of each phase, as
        ``{"alpha": [0, 0.5, -3.1], "F": 0, "durations": [0.2, 0.8]}``: a number, which is kept,
        keyframes, which are spread evenly over the time, or a function of an array of times in
        seconds.  A list of mappings gives them for each phase, keyframes spread over the phase.
        What is not named is that of the automatic guess; velocities and impulses follow.
    optimality, violation : float
        Tolerances of the optimality residual and of the constraints.
    iterations : int
        Limit; where another method takes over (from slsqp, ipm), half of them are kept for it.
    seconds : float, optional
        Limit of the guess, the solve and the check together.
    progress : callable, optional
        Called with an Iteration (number, cost, violation) after every iteration.
    verify : bool
        Check a converged solution by simulation; one that fails has the status "not_verified".
    reference : str
        How the model was named, where its kernels do not know; kept in the solution so that it can
        be found again.

    Returns
    -------
    Solution
        Also when no solution was found: look at its status and message.

    Raises
    ------
    ProblemError
        If an argument does not fit.
    """
    check_problem(problem)
    name = (DEFAULT if tolerance is None else REFINING) if method is None else method
    chosen = METHODS[choice(name, "method", tuple(METHODS))]
    choice(form, "form", FORMS)
    optimality = positive(optimality, "optimality", "expected a positive number")
    violation = positive(violation, "violation", "expected a positive number")
    if tolerance is not None:
        tolerance = positive(tolerance, "tolerance", "expected a positive number, or None")
    if seconds is not None:
        seconds = positive(seconds, "seconds", "expected a positive time limit, or None")
    iterations = whole(iterations, "iterations", 1, MOST_ITERATIONS)
    function(progress, "progress")
    flag(verify, "verify")
    text(reference, "reference")
    chosen.require(problem.kernels.backend)
    options = Options(optimality, violation, iterations, seconds, progress)
    if starts is not None:
        starts = whole(starts, "starts", 1, MOST_STARTS)
    seed = whole(seed, "seed", 0, MOST_ITERATIONS)
    if starts is None and guess is not None:
        starts = 1
    if reference:
        problem = problem.but(kernels=replace(problem.kernels, reference=reference))
    request = Request(chosen, form, options, verify, starts, seed)
    if tolerance is None:
        return _best(problem, guess, request)
    return _on_meshes(problem, guess, request, tolerance)


@dataclass(frozen=True)
class Request:
    """How a problem shall be solved; its parts are checked."""

    method: Method
    form: str
    options: Options
    verify: bool
    starts: int | None
    seed: int


def _on_meshes(problem: Problem, guess: Given, request: Request, tolerance: float) -> Solution:
    """Solve on finer and finer meshes; only the finest is checked."""
    begin, options = time.perf_counter(), request.options
    base = min(options.optimality, max(tolerance, BASE_OPTIMALITY))

    def on_mesh(problem: Problem, coarse: Solution | None, sharper: float | None) -> Solution:
        optimality = base if sharper is None else max(sharper, LEAST_OPTIMALITY)
        sharp = replace(remaining(options, begin), optimality=optimality)
        wanted = replace(request, options=sharp, verify=False)
        return _solved(problem, coarse, wanted) if coarse else _best(problem, guess, wanted)

    def check(solution: Solution) -> Solution:
        return checked(solution, remaining(options, begin).seconds)

    return refined(problem, tolerance, options.seconds, on_mesh, check)


def _best(problem: Problem, guess: Given, request: Request) -> Solution:
    """Solve on one mesh, from the best of many starts or from a guess alone."""
    if request.starts == 1 or problem.kernels.backend != COMPILED:
        return _solved(problem, guess, request)
    options, begin = request.options, time.perf_counter()
    try:
        with np.errstate(all="ignore"):
            effort = Effort.of(request.starts)
            found = explored(problem, effort, request.seed, options, request.verify)
    except KeyboardInterrupt:
        stopped = replace(request, options=replace(options, iterations=1), verify=False)
        status = Status.INTERRUPTED
        return replace(_solved(problem, guess, stopped), status=status, message=status.sentence)
    spent, tried = time.perf_counter() - begin, None
    for i, start in enumerate(found.ranked):
        answer = _answer(problem, start, replace(request, options=remaining(options, begin)))
        tried = tried or (answer, i)
        if answer.minimum or answer.status in (Status.INTERRUPTED, Status.TIME_LIMIT):
            tried = answer, i
            break
    if tried is None:
        answer = _solved(problem, guess, replace(request, options=remaining(options, begin)))
        tried = answer, len(found.ranked)
    answer, i = tried
    return replace(
        answer,
        message=f"{answer.message}; {found.told(i)}",
        starts=len(found.starts),
        found=found.found[i] if i < len(found.found) else 0,
        others=found.others(i),
        seconds={**answer.seconds, "explore": spent},
    )


def _answer(problem: Problem, start: Solution, request: Request) -> Solution:
    """The solution from a minimum on the ranking mesh: itself where that is the problem's."""
    same = tuple(p.steps for p in start.phases) == problem.phase_steps
    if same and start.method == request.method.name:
        return start
    return _solved(problem, start, request)


def _solved(problem: Problem, guess: Given, request: Request) -> Solution:
    """Solve on one mesh."""
    method, options = request.method, request.options
    method.check_size(problem.steps, problem.nu * sum(problem.phase_steps))
    begin = time.perf_counter()
    deadline = np.inf if options.seconds is None else begin + options.seconds
    with np.errstate(all="ignore"):
        starts = starts_of(problem, guess, deadline)
        guessed = time.perf_counter()
        scale = scale_of(problem, starts.points[0], starts.minimum)
        left = _in_units(remaining(options, begin), scale.cost)
        found = attempted(Programs(problem, scale), starts, method, request.form, left)
        solved = time.perf_counter()
        seconds = {
            "build": problem.kernels.seconds,
            "guess": guessed - begin,
            "solve": solved - guessed,
        }
        solution = solution_of(found, method.name, seconds)
    if not (request.verify and solution.minimum):
        return solution
    return checked(solution, remaining(options, begin).seconds)


def _in_units(options: Options, cost: float) -> Options:
    """Options whose progress is told with costs in units of the problem."""
    tell = options.progress
    if tell is None:
        return options
    return replace(options, progress=lambda i: tell(replace(i, cost=i.cost * cost)))
