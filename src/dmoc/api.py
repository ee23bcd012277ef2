"""Solve a problem and check the solution."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np

from dmoc.arguments import choice, flag, function, positive, shown, text, whole
from dmoc.codegen.kernels import Array, Kernels
from dmoc.errors import ProblemError, SolutionFileError
from dmoc.nlp.guess import initial_guesses
from dmoc.nlp.layout import Layout
from dmoc.nlp.motion import active_bounds, given_multipliers, named_multipliers, singular_at, trajectory
from dmoc.nlp.problem import Problem
from dmoc.nlp.scaling import scale_of
from dmoc.nlp.sensitivity import Sensitivities
from dmoc.nlp.sensitivity import sensitivities as find_sensitivities
from dmoc.nlp.transcription import Transcription
from dmoc.nlp.transfer import pieces_of, unknowns_along
from dmoc.refinement import refined
from dmoc.simulation.check import OutOfTimeError
from dmoc.solution import Solution
from dmoc.solvers import external, ipm, slsqp
from dmoc.solvers.diagnosis import diagnose
from dmoc.solvers.kkt import duality_gap, residuals
from dmoc.solvers.outcome import INFEASIBLE, Duals, Iteration, Options, Outcome, Status
from dmoc.solvers.threads import ONE_THREAD
from dmoc.solvers.touching import pays, pushed, suspects, touches

METHODS = ("slsqp", "ipm", "ipopt", "uno")
Driver: TypeAlias = Callable[[Transcription, Array, Options], Outcome]
FORMS = ("condensed", "full")
# A mesh is solved to the tolerance of a refinement, but not below what rounding allows; the barrier may be driven further down.
SHARP, SHARPEST = 1e-8, 1e-11
# Residuals above this are those of another problem.
OTHER_PROBLEM = 1e-4
MOST_ITERATIONS = 2**31 - 1  # what the compiled method can count


def solve(
    problem: Problem,
    method: str | None = None,
    *,
    tolerance: float | None = None,
    form: str = "condensed",
    guess: Solution | Array | None = None,
    optimality: float = 1e-6,
    violation: float = 1e-10,
    iterations: int = 1000,
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
        SciPy's sequential quadratic programming on the condensed program; the compiled interior-point method of dmoc; IPOPT; Uno.  The
        last two are extras.  The default is "slsqp", with a tolerance "ipm".
    tolerance : float, optional
        Refine the mesh, beginning with the problem's steps, until the estimated relative error of cost, durations and positions and the simulated
        errors over segments are below it.  The solution has the estimate and the meshes.
    form : {"condensed", "full"}
        For slsqp: "condensed" eliminates coordinates by solving the discrete equations of motion; "full" leaves all unknowns to the
        solver, which is practical up to some tens of steps.  The other methods work on the full sparse program.
    guess : Solution or array, optional
        Where to start; by default an automatic guess.  A solution must have the same number of collisions; one on another mesh
        or of another order is interpolated, the multipliers of one with the same steps serve too (not with slsqp).
    optimality, violation : float
        Tolerances of the optimality residual and of the constraints.
    iterations : int
    seconds : float, optional
        Limits.
    progress : callable, optional
        Called with an Iteration (number, cost, violation) after every iteration.
    verify : bool
        Check a converged solution by simulation; one that fails has the status "not_verified".
    reference : str
        How the model was named; kept in the solution so that it can be found again.

    Returns
    -------
    Solution
        Also when no solution was found: look at its status and message.

    Raises
    ------
    ProblemError
        If an argument does not fit.
    """
    _check_problem(problem)
    method = choice(("slsqp" if tolerance is None else "ipm") if method is None else method, "method", METHODS)
    choice(form, "form", FORMS)
    optimality = positive(optimality, "optimality", "expected a positive number")
    violation = positive(violation, "violation", "expected a positive number")
    tolerance = None if tolerance is None else positive(tolerance, "tolerance", "expected a positive number, or None")
    seconds = None if seconds is None else positive(seconds, "seconds", "expected a positive time limit, or None")
    iterations = whole(iterations, "iterations", 1, MOST_ITERATIONS)
    function(progress, "progress")
    flag(verify, "verify")
    text(reference, "reference")
    if method not in ("slsqp", "ipm"):
        external.require(method)
    options = Options(optimality, violation, iterations, seconds, progress)
    if tolerance is None:
        return _solve(problem, method, form, guess, options, verify, reference)
    begin, base = time.perf_counter(), min(optimality, max(tolerance, SHARP))

    def on_mesh(problem: Problem, coarse: Solution | None, sharper: float | None) -> Solution:
        sharp = replace(_remaining(options, begin), optimality=base if sharper is None else max(sharper, SHARPEST))
        return _solve(problem, method, form, coarse or guess, sharp, False, reference)

    def check(solution: Solution) -> Solution:
        return _checked(solution, _remaining(options, begin).seconds)

    return refined(problem, tolerance, seconds, on_mesh, check)


def _solve(
    problem: Problem, method: str, form: str, guess: Solution | Array | None, options: Options, verify: bool, reference: str
) -> Solution:
    if method == "slsqp":
        _check_size(problem)
    start = time.perf_counter()
    deadline = np.inf if options.seconds is None else start + options.seconds
    with ONE_THREAD, np.errstate(all="ignore"):
        points = _starting_points(problem, guess, deadline)
        guessed = time.perf_counter()
        scale = scale_of(problem, points[0], minimum=isinstance(guess, Solution))
        # Minimal times keep slsqp on the right track; they may limit no solution, and the other methods do without.
        nlp = Transcription(problem, scale, None if method == "slsqp" else False)
        driver = _driver(method, form, nlp, guess)
        options = replace(options, progress=_in_units(options.progress, scale.cost))
        left = _remaining(options, start)
        search = _best_of_all if method == "ipm" else _first_success
        nlp, outcome = search(nlp, [nlp.scaled(x) for x in points], left, driver)
        conflicts: tuple[str, ...] = ()
        if method == "slsqp" and outcome.status in (Status.INFEASIBLE, Status.STALLED) and nlp.program.compiled:
            nlp, outcome = _taken_over(nlp, outcome, points, _remaining(options, start, outcome.iterations))
        if outcome.status is Status.INFEASIBLE and nlp.program.compiled:
            left = _remaining(options, start, outcome.iterations)
            nlp, outcome, conflicts = _explained(nlp, outcome, points[0], left, driver)
        solved = time.perf_counter()
        timings = {"build": problem.kernels.seconds, "guess": guessed - start, "solve": solved - guessed}
        solution = _solution(nlp, outcome, method, timings, reference, conflicts)
    if not (verify and solution.minimum):
        return solution
    return _checked(solution, None if options.seconds is None else max(deadline - time.perf_counter(), 0.0))


def _taken_over(nlp: Transcription, outcome: Outcome, points: list[Array], options: Options) -> tuple[Transcription, Outcome]:
    """What the compiled method finds where slsqp has ended without a solution; the outcome as it is where that finds none either."""
    free = Transcription(nlp.problem, nlp.scale, minimal_times=False)
    used, again = _best_of_all(free, [free.scaled(x) for x in points], options, ipm.solve)
    again = replace(again, iterations=outcome.iterations + again.iterations)
    if again.status in (Status.SOLVED, Status.TIME_LIMIT, Status.INTERRUPTED):
        ended = outcome.status.name.lower()
        return used, replace(again, detail=f"slsqp ended {ended}, the compiled method took over")
    return nlp, replace(outcome, iterations=again.iterations)


def _in_units(progress: Callable[[Iteration], None] | None, cost: float) -> Callable[[Iteration], None] | None:
    """Iterations with costs in units of the problem."""
    if progress is None:
        return None
    tell = progress
    return lambda i: tell(replace(i, cost=i.cost * cost))


def _checked(solution: Solution, seconds: float | None = None) -> Solution:
    """The solution with the result of the independent simulation; one that it contradicts is not verified."""
    start = time.perf_counter()
    try:
        check = solution.verify(seconds=seconds)
    except OutOfTimeError:
        timings = {**solution.seconds, "verify": time.perf_counter() - start}
        message = f"{solution.message}, but the time limit was reached before the simulation had checked it: raise it"
        return replace(solution, status="time_limit", message=message, seconds=timings)
    timings = {**solution.seconds, "verify": time.perf_counter() - start}
    summary = {
        "passed": check.passed,
        "message": check.message,
        "terminal_error": check.terminal_error,
        "amplification": check.amplification,
        "max_defect": check.max_defect,
        "max_segment_defect": float(check.segment_defects.max(initial=0.0)),
        "energy_error": check.energy_error,
        "impact_error": check.impact_error,
        "missed_contacts": list(check.missed_contacts),
        "extra_contacts": list(check.extra_contacts),
        "penetration": check.penetration,
        "limit_excess": check.limit_excess,
    }
    if check.passed:
        message = f"{solution.message}; {check.message}" if check.message else solution.message
        return replace(solution, message=message, verification=summary, seconds=timings)
    message = f"{solution.message}, but an independent simulation contradicts it: {check.message}"
    return replace(solution, status="not_verified", message=message, verification=summary, seconds=timings)


def sensitivities(problem: Problem, solution: Solution) -> Sensitivities:
    """Derivatives of the optimal cost with respect to parameters, coefficients of restitution, positions of surfaces, final time, boundary values
    and bounds, from the multipliers of a solution; see :class:`~dmoc.nlp.sensitivity.Sensitivities`.

    Raises
    ------
    ProblemError
        If the solution belongs to another problem, or is none.
    """
    _check_problem(problem)
    if not isinstance(solution, Solution):
        raise ProblemError(f"solution = {shown(solution)}: expected the Solution of the problem.")
    steps = tuple(p.steps for p in solution.phases)
    sequence = tuple(c.surface for c in solution.collisions)
    size = Layout.of(problem).size
    if (steps, sequence, len(solution.unknowns)) != (problem.phase_steps, tuple(problem.sequence), size):
        raise ProblemError(
            f"the solution has the sequence {list(sequence)} with {list(steps)} steps, the problem {list(problem.sequence)} with "
            f"{list(problem.phase_steps)}: give the problem that was solved."
        )
    if solution.status not in ("solved", "grazes", "not_verified"):
        raise ProblemError(f"the solution has the status {solution.status!r}: sensitivities need a minimum.")
    check_same_model(solution, problem.kernels)
    nlp = Transcription(problem, scale_of(problem, solution.unknowns, minimum=True), minimal_times=False)
    found = residuals(nlp, nlp.scaled(solution.unknowns), Duals(*given_multipliers(nlp, solution.multipliers)))
    if found.violation > OTHER_PROBLEM or found.optimality > OTHER_PROBLEM:
        raise ProblemError(
            f"the solution is no minimum of this problem (violation {found.violation:.1e}, optimality {found.optimality:.1e}): "
            "give the problem that was solved."
        )
    return find_sensitivities(problem, solution.unknowns, solution.multipliers)


def _check_size(problem: Problem) -> None:
    inputs = problem.nu * sum(problem.phase_steps)
    if inputs > slsqp.MOST_INPUTS:
        raise ProblemError(
            f"steps = {problem.steps}: method slsqp works with dense matrices and takes at most {slsqp.MOST_INPUTS} inputs in all steps, "
            f"this problem has {inputs}; take fewer steps, or method ipm."
        )


def _driver(method: str, form: str, nlp: Transcription, guess: Solution | Array | None) -> Driver:
    """Return the method as a function of program, start and options; multipliers of another mesh or sequence do not serve."""
    if method == "slsqp":
        segments = slsqp.SEGMENTS if form == "condensed" else 0
        return lambda nlp, x, options: slsqp.solve(nlp, x, options, segments)
    minimise = {"ipm": ipm.solve, "ipopt": external.solve_ipopt, "uno": external.solve_uno}[method]
    duals = None
    if (
        isinstance(guess, Solution)
        and _same_mesh(nlp.problem, guess)
        and tuple(c.surface for c in guess.collisions) == nlp.problem.sequence
    ):
        duals = Duals(*given_multipliers(nlp, guess.multipliers))

    def fitting(nlp: Transcription) -> Duals | None:
        """Multipliers fit the program that they were read for, not one in which collisions have become touches."""
        return duals if duals is not None and (len(duals.y), len(duals.w)) == (nlp.n_eq, nlp.n_in) else None

    return lambda nlp, x, options: minimise(nlp, x, options, fitting(nlp))


def _check_problem(problem: Any) -> None:
    if not isinstance(problem, Problem):
        raise ProblemError(f"problem = {shown(problem)}: expected a Problem, as dmoc.Problem(system, start=..., ...) states it.")


def _starting_points(problem: Problem, guess: Solution | Array | None, deadline: float) -> list[Array]:
    """Unknowns to start from, in units of the problem."""
    if guess is None:
        return [g.x for g in initial_guesses(problem, deadline)]
    size = Layout.of(problem).size
    if isinstance(guess, Solution):
        _check_motion(problem, guess)
        if _same_mesh(problem, guess):
            return [guess.unknowns.copy()]
        return [unknowns_along(problem, pieces_of(guess.trajectory), [c.impulse for c in guess.collisions])]
    try:
        given = np.array(guess)
    except (TypeError, ValueError):  # rows of different lengths
        given = np.array(None)
    if given.dtype.kind not in "iuf":
        raise ProblemError(f"guess = {shown(guess)}: expected a Solution, or an array of {size} unknowns.")
    x = given.astype(float)
    if x.shape != (size,) or not np.isfinite(x).all():
        raise ProblemError(
            f"guess has shape {x.shape}: expected {size} finite unknowns, from a solution of the same model with the same steps."
        )
    return [x]


def _check_motion(problem: Problem, guess: Solution) -> None:
    names = [*problem.kernels.coordinates, *problem.kernels.inputs]
    given = [*guess.trajectory.coordinates, *guess.trajectory.inputs]
    if given != names:
        raise ProblemError(
            f"guess is a motion of {', '.join(given)}: expected one of the coordinates and inputs {', '.join(names)}."
        )
    if len(guess.phases) != problem.phases:
        raise ProblemError(
            f"guess has {len(guess.collisions)} collisions: expected a motion with {problem.phases - 1}, as the problem has."
        )


def _same_mesh(problem: Problem, guess: Solution) -> bool:
    """Whether the unknowns and multipliers of a motion are those of the problem."""
    steps, controls = tuple(p.steps for p in guess.phases), guess.trajectory.controls
    size = Layout.of(problem).size
    return steps == problem.phase_steps and controls == problem.control_form and len(guess.unknowns) == size


def _first_success(nlp: Transcription, points: list[Array], options: Options, driver: Driver) -> tuple[Transcription, Outcome]:
    """Solve from one starting point after the other until one succeeds or a limit is reached; else return the least violation."""
    tried: list[tuple[float, Transcription, Outcome]] = []
    count, begin = 0, time.perf_counter()
    for x in points:
        used, outcome = _minimise(nlp, x, _remaining(options, begin, count), driver)
        count += outcome.iterations
        outcome = replace(outcome, iterations=count)
        if outcome.status not in (Status.INFEASIBLE, Status.STALLED) or count >= options.iterations:
            return used, outcome
        tried.append((residuals(used, outcome.x, outcome.duals).violation, used, outcome))
    _, used, outcome = min(tried, key=lambda t: t[0])
    return used, replace(outcome, iterations=count)


def _best_of_all(nlp: Transcription, points: list[Array], options: Options, driver: Driver) -> tuple[Transcription, Outcome]:
    """Solve from every starting point, which costs the compiled method next to nothing, and return the cheapest minimum, one whose collisions all
    have an effect if there is one; where there is none, what the first success is."""
    begin, count, found = time.perf_counter(), 0, list[tuple[bool, float, Transcription, Outcome]]()
    for i, x in enumerate(points):
        left = _remaining(options, begin, count)
        used, outcome = _first_success(nlp, points[i:], left, driver) if not found and i == 0 else _minimise(nlp, x, left, driver)
        count += outcome.iterations
        if outcome.status is not Status.SOLVED:
            if not found:
                return used, replace(outcome, iterations=count)
            if outcome.status is Status.INTERRUPTED:
                _, _, used, best = min(found, key=lambda f: f[:2])
                return used, replace(best, status=Status.INTERRUPTED, iterations=count)
            if outcome.status in (Status.TIME_LIMIT, Status.ITERATION_LIMIT):
                break
            continue
        found.append((bool(used.touching.any()), nlp.cost(outcome.x), used, outcome))
    _, _, used, outcome = min(found, key=lambda f: f[:2])
    return used, replace(outcome, iterations=count)


def _remaining(options: Options, begin: float, iterations: int = 0) -> Options:
    """What is left of the limits of a solve that began at a time and has taken some iterations, which are counted on."""
    seconds = None if options.seconds is None else max(options.seconds - (time.perf_counter() - begin), 1e-9)
    tell = options.progress
    progress = (lambda i: tell(replace(i, number=i.number + iterations))) if tell is not None and iterations else tell
    return replace(options, seconds=seconds, iterations=max(options.iterations - iterations, 1), progress=progress)


def _explained(
    nlp: Transcription, outcome: Outcome, x: Array, options: Options, driver: Driver
) -> tuple[Transcription, Outcome, tuple[str, ...]]:
    """Say what conflicts; if nothing does, the search for it has found a feasible motion to solve from."""
    begin = time.perf_counter()
    try:
        diagnosis = diagnose(nlp.problem, nlp.scale, x, options)
    except KeyboardInterrupt:
        return nlp, replace(outcome, status=Status.INTERRUPTED), ()
    if diagnosis.violation <= INFEASIBLE and outcome.iterations < options.iterations:
        again = driver(nlp, nlp.scaled(diagnosis.x), _remaining(options, begin, outcome.iterations))
        if again.status is not Status.INFEASIBLE:
            return nlp, replace(again, iterations=outcome.iterations + again.iterations), ()
    return nlp, outcome, diagnosis.sentences


def _minimise(nlp: Transcription, x: Array, options: Options, driver: Driver) -> tuple[Transcription, Outcome]:
    """Solve; an estimated minimal time that limits the solution is dropped, because the dynamics decide and not the estimate, and collisions
    that have no effect become touches."""
    begin = time.perf_counter()
    outcome = driver(nlp, x, options)
    timed = nlp.inequality_rows("minimal time")
    limited = outcome.status is Status.SOLVED and bool((outcome.duals.w[timed] > 0).any())
    if outcome.status is Status.INFEASIBLE and len(timed):
        limited = bool((nlp.inequality(outcome.x)[timed] < options.violation).any())
    if limited:
        free = Transcription(nlp.problem, nlp.scale, minimal_times=False)
        nlp, outcome = free, _continued(free, outcome, _remaining(options, begin, outcome.iterations), driver)
    at = suspects(nlp, outcome.x)
    if not len(at) or outcome.status not in (Status.SOLVED, Status.INFEASIBLE, Status.STALLED):
        return nlp, outcome
    touching = touches(nlp, at)
    touched = _continued(touching, outcome, _remaining(options, begin, outcome.iterations), driver)
    if touched.status in (Status.INTERRUPTED, Status.TIME_LIMIT):
        return nlp, replace(outcome, status=touched.status)
    if touched.status is not Status.SOLVED:
        return nlp, replace(outcome, iterations=touched.iterations)
    if not pays(touching, touched):
        return touching, touched
    hit = replace(touched, x=pushed(nlp, touched.x, at))
    again = _continued(nlp, hit, _remaining(options, begin, hit.iterations), driver)
    better = again.status is Status.SOLVED and (outcome.status is not Status.SOLVED or nlp.cost(again.x) <= nlp.cost(outcome.x))
    return nlp, again if better else replace(outcome, iterations=again.iterations)


def _continued(nlp: Transcription, outcome: Outcome, options: Options, driver: Driver) -> Outcome:
    """Solve another program of the same unknowns from where one has ended."""
    again = driver(nlp, outcome.x, options)
    return replace(again, iterations=outcome.iterations + again.iterations)


def _solution(
    nlp: Transcription,
    outcome: Outcome,
    method: str,
    timings: dict[str, float],
    reference: str,
    conflicts: tuple[str, ...],
) -> Solution:
    problem, found = nlp.problem, residuals(nlp, outcome.x, outcome.duals)
    detail = f" ({outcome.detail})" if outcome.detail else ""
    message = outcome.status.value + (": " + "; ".join(conflicts) if conflicts else detail)
    singular = None if outcome.status is Status.SOLVED else singular_at(nlp, outcome.x)
    if singular is not None:
        message += f"; the mass matrix is singular or negative on the way, first at {singular:.4g} s: check the parameters and the bounds"
    motion, status = trajectory(nlp, outcome.x), outcome.status.name.lower()
    grazing = [f"{i + 1} ({c.surface})" for i, c in enumerate(motion.collisions) if c.grazes]
    if outcome.status is Status.SOLVED and grazing:
        status = "grazes"
        message += f"; collision {' and '.join(grazing)} has no effect: the motion touches the surface without an impulse"
    return Solution(
        status=status,
        message=message,
        method=method,
        cost=nlp.cost(outcome.x) * nlp.scale.cost,
        trajectory=motion,
        multipliers=named_multipliers(nlp, outcome.duals.y, outcome.duals.w, outcome.duals.z),
        active_bounds=active_bounds(nlp, outcome.x, outcome.duals.w, outcome.duals.z),
        max_violation=found.violation,
        optimality=found.optimality,
        iterations=outcome.iterations,
        seconds=timings,
        unknowns=nlp.physical(outcome.x),
        scale=nlp.scale.named(problem),
        reference=reference or problem.kernels.name,
        conflicts=conflicts,
        duality_gap=duality_gap(nlp, outcome.x, outcome.duals),
        kernels=problem.kernels,
    )


def check_same_model(solution: Solution, kernels: Kernels) -> None:
    """Raise SolutionFileError unless the kernels are those of the solution's model."""
    wanted, given = solution.trajectory.fingerprint, kernels.manifest["fingerprint"]
    if wanted != given:
        raise SolutionFileError(
            f"the solution was made for another version of model {solution.trajectory.model!r} than {kernels.name!r} as it is now: "
            "solve again, or give the model it was made for."
        )
