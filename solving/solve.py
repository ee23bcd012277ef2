"""Solve a problem: programs, starts, a method, the check, and meshes where a tolerance asks for
them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from dmoc.base.errors import ProblemError
from dmoc.base.options import read
from dmoc.base.progress import Listener, told
from dmoc.codegen.kernels import COMPILED, Array
from dmoc.problem.problem import Problem
from dmoc.results.solution import Solution
from dmoc.solvers.outcome import ITERATIONS, OPTIMALITY, VIOLATION, Iteration, Options, Status
from dmoc.solving.checked_solution import checked, with_proposal
from dmoc.solving.hit_words import best_way, first_way
from dmoc.solving.indeterminacy import telling, undetermined
from dmoc.solving.mesh.confirmation import naming_steps
from dmoc.solving.mesh.one_mesh import (
    best_on_mesh,
    interrupted,
    meshed_as,
    on_coarse_mesh,
    on_mesh_of,
    solved_on_mesh,
)
from dmoc.solving.mesh.refinement import refined
from dmoc.solving.methods import METHODS, REFINING, usual
from dmoc.solving.multistart.exploration import Effort, coarse_of, explored
from dmoc.solving.request import Keywords, Request
from dmoc.solving.sensitivity import check_problem
from dmoc.solving.sliding_reversals import naming_turns
from dmoc.solving.starts import Given, starts_of
from dmoc.solving.unbounded_cost import bounded

# The error up to which a motion that the check confirms is a solution where nobody has asked for a
# tolerance and finer meshes do not lead to the usual one: the check itself allows as much.
LOOSE = 1e-2
# Starts of another sequence, of which it is asked whether it leads to a motion.
FEW = 16
# Iterations on a mesh that begins with the motion of a coarser one: more lead elsewhere.
FROM_COARSE = 300
# A mesh is solved to the tolerance of a refinement, but not below what rounding allows; the barrier
# may be driven further down.
BASE_OPTIMALITY, LEAST_OPTIMALITY = 1e-8, 1e-11


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
    progress: Listener[Iteration] = None,
    verify: bool = True,
    reference: str = "",
) -> Solution:
    """Solve an optimal control problem for its sequence of collisions.

    A hit with friction of which the sequence does not say how it goes ("wall" instead of
    "wall:slip+") begins with the way that the law takes in the guess; then the ways of one hit
    after the other are tried, from few starts on a coarse mesh, as long as the cost falls.  The
    best that is confirmed is the answer; its collisions tell the way.  The limits are those of all
    ways together.

    Parameters
    ----------
    problem : Problem
    method : {"slsqp", "ipm", "ipopt", "uno"}
        SciPy's sequential quadratic programming on the condensed program; the compiled
        interior-point method of dmoc; IPOPT; Uno.  The last two are extras.  The default is
        "slsqp", with a tolerance, contacts that last or hits with friction "ipm" if the kernels
        are compiled.
    tolerance : float, optional
        Refine the mesh, beginning with the problem's steps, until the estimated relative error of
        cost, durations and positions and the simulated errors over segments are below it.  The
        solution has the estimate and the meshes.  1e-3 for a problem without ``steps``.
    form : {"condensed", "full"}
        For slsqp: "condensed" eliminates coordinates by solving the discrete equations of motion;
        "full" leaves all unknowns to the solver, which is practical up to some tens of steps.  The
        other methods work on the full sparse program.
    guess : Solution, path, mapping, list of mappings, or array, optional
        Where to start; by default an automatic guess.  A solution, or that of a file, must have the
        same number of collisions, or propose the sequence of the problem; one on another mesh or of
        another order is interpolated, the multipliers of one with the same steps serve too (not
        with slsqp).  A mapping gives courses of coordinates and inputs by name, and "durations",
        the seconds of each phase, as
        ``{"alpha": [0, 0.5, -3.1], "F": 0, "durations": [0.2, 0.8]}``: a number, which is kept,
        keyframes, which are spread evenly over the time, or a function of an array of times in
        seconds.  A list of mappings gives them for each phase, keyframes spread over the phase.
        What is not named is that of the automatic guess; velocities and impulses follow.
    starts : int, optional
        How many starts are tried on a coarse mesh by the compiled method before the mesh of the
        problem is: a guess that is given, the automatic guesses, and random motions through the
        collisions.  The distinct minima they lead to are refined and checked, and the method begins
        with the best of them; ``others`` of the solution are the rest.  By default as many as it
        seems to take: 16 random ones, 100 where those do not agree on a minimum, 300 where fewer
        than five of these have met the best one, and where there is none with limits of the inputs
        that are tightened step by step.  1
        begins with the guess alone, as does a guess that is given and kernels without a compiler.
        No better minimum than the answer was met; that none exists is not shown.
    seed : int
        Of the random motions: the same seed gives the same answer.
    optimality, violation : float
        Tolerances of the optimality residual and of the constraints.
    iterations : int
        Limit of the solve, and of each start; where another method takes over (from slsqp, ipm),
        half of them are kept for it.
    seconds : float, optional
        Limit of the guess, the solve and the check together.
    progress : callable, bool or "lines", optional
        Called with an Iteration (number, cost, violation) after every iteration.  True shows it in
        a line on a terminal or in a notebook, "lines" writes it to standard error every second.
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

    Examples
    --------
    >>> import dmoc
    >>> from dmoc.models.registry import find
    >>> reference = find("puck_table")
    >>> problem = dmoc.Problem(reference.kernels(), **reference.defaults)
    >>> solution = dmoc.solve(problem.but(sequence=["east"]), "ipm")
    >>> solution.status, round(solution.cost, 3)
    (<Status.SOLVED: 'solved'>, 2.815)
    >>> again = dmoc.solve(problem.but(sequence=["east"], steps=80), "ipm", guess=solution)
    >>> again.starts, round(again.cost, 3)
    (0, 2.815)

    Notes
    -----
    The program is equation :eq:`program` of the theory, "solved" means :eq:`optimality` and
    :eq:`measures`.
    """
    check_problem(problem)
    asked = read(Keywords, locals(), ProblemError)
    request = asked.request(problem)
    if reference:
        problem = problem.but(kernels=replace(problem.kernels, reference=reference))
    with told(progress, "first guess") as tell:
        request = replace(request, options=replace(request.options, progress=tell))
        if problem.open_hits:
            try:
                return best_way(problem, _Ways(guess, request, asked), request.options)
            except KeyboardInterrupt:
                return interrupted(first_way(problem), guess, request)
        return _solved(problem, guess, request, asked)


@dataclass(frozen=True)
class _Ways:
    """Solves a problem of hits with friction that do not say how they go, way by way."""

    guess: Given
    request: Request
    asked: Keywords

    def thorough(self, way: Problem, options: Options) -> Solution:
        return _solved(way, self.guess, replace(self.request, options=options), self.asked)

    def rough(self, way: Problem, options: Options, starts: int) -> Solution | None:
        if way.kernels.backend != COMPILED:
            s = self.alone(way, options)
            return s if s.minimum else None
        effort = Effort.of(min(self.request.starts or starts, starts))
        points, seed = on_coarse_mesh(way, self.guess), self.request.seed
        with np.errstate(all="ignore"):
            minima = explored(coarse_of(way), effort, seed, options, points=points).ranked
        return minima[0] if minima else None

    def start(self, way: Problem) -> Array:
        return starts_of(way, self.guess).points[0]

    def alone(self, way: Problem, options: Options) -> Solution:
        guess = on_coarse_mesh(way, self.guess).get("given")
        s = solved_on_mesh(coarse_of(way), guess, replace(self.request, options=options))
        if s.status is Status.INTERRUPTED:
            raise KeyboardInterrupt
        return s


def _solved(problem: Problem, guess: Given, request: Request, asked: Keywords) -> Solution:
    """Solve on the mesh of the problem, or to a tolerance."""
    if request.starts is None and guess is not None:
        request = replace(request, starts=1)
    tolerance = asked.tolerance_of(problem)
    if tolerance is None:
        answer = _bounded(problem, best_on_mesh(problem, guess, request), request)
        fine = replace(_compiled(problem, request), verify=True)
        answer = naming_steps(problem, answer, partial(_from_motion, fine))
    else:
        loose = LOOSE if asked.tolerance is None else tolerance
        answer = _on_meshes(problem, guess, request, (tolerance, loose))
    answer = _telling_starts(_naming_durations(problem, answer))
    return with_proposal(_naming_turns(problem, answer, request))


def _on_meshes(
    problem: Problem, guess: Given, request: Request, tolerances: tuple[float, float]
) -> Solution:
    """Solve on finer and finer meshes to a tolerance; a larger error, up to a second one, is a
    solution too where they do not lead there."""
    tolerance, loose = tolerances
    options, steps = request.options, problem.phase_steps
    base = min(options.optimality, max(tolerance, BASE_OPTIMALITY))

    def wanted(optimality: float) -> Request:
        return replace(request, options=replace(options, optimality=optimality), verify=False)

    best = best_on_mesh(problem, guess, wanted(base))
    unrefined = _bounded(problem, best, wanted(base))
    if unrefined is not best:
        return unrefined

    def on_mesh(problem: Problem, coarse: Solution | None, sharper: float | None) -> Solution:
        if coarse is None and sharper is None and problem.phase_steps == steps:
            return unrefined
        now = wanted(base if sharper is None else max(sharper, LEAST_OPTIMALITY))
        motion = coarse or (
            unrefined if on_mesh_of(problem, unrefined) and unrefined.minimum else None
        )
        if motion is None:  # many starts have led nowhere, and begin on the same coarse mesh
            return best_on_mesh(problem, guess, replace(now, starts=1))
        few = replace(now.options, iterations=min(options.iterations, FROM_COARSE))
        return solved_on_mesh(meshed_as(problem, motion), motion, replace(now, options=few))

    check = partial(checked, deadline=options.deadline)
    answer = refined(problem, tolerance, options.deadline, on_mesh, check)
    answer = replace(answer, starts=best.starts, found=best.found, others=best.others)
    confirmed = answer.verification is not None and answer.verification.passed
    near = answer.error_estimate is not None and answer.error_estimate <= loose
    if answer.status is Status.NOT_VERIFIED and confirmed and near:
        status = Status.GRAZES if any(c.grazes for c in answer.collisions) else Status.SOLVED
        message = f"a local minimum was found, confirmed by simulation; {answer.message}"
        answer = replace(answer, status=status, message=message)
    return answer


def _bounded(problem: Problem, answer: Solution, request: Request) -> Solution:
    """The answer, unless its cost has no minimum."""
    plain = replace(_compiled(problem, request), verify=False)
    return bounded(problem, answer, partial(_from_motion, plain))


def _compiled(problem: Problem, request: Request) -> Request:
    """The request for further meshes: silent, by the compiled method if there is one."""
    method = METHODS[usual(REFINING, problem.kernels.backend == COMPILED)]
    return replace(request, method=method, options=replace(request.options, progress=None))


def _from_motion(request: Request, problem: Problem, motion: Solution) -> Solution:
    return solved_on_mesh(meshed_as(problem, motion), motion, request)


def _naming_durations(problem: Problem, answer: Solution) -> Solution:
    """The answer; durations that a problem with contacts that last does not determine are told in
    its message, unless a refinement has told it."""
    if not (answer.minimum and problem.lasting and problem.phases > 1):
        return answer
    sentence = undetermined(problem.meshed(answer.steps), answer)
    return replace(answer, message=telling(answer.message, sentence))


def _naming_turns(problem: Problem, answer: Solution, request: Request) -> Solution:
    """The answer, with a sequence of the same hits that leads to a motion where it has none."""

    def few(problem: Problem) -> Solution:
        return best_on_mesh(problem, None, replace(_compiled(problem, request), starts=FEW))

    return naming_turns(problem, answer, few, request.options.deadline)


def _telling_starts(s: Solution) -> Solution:
    """The answer with what is known of the starts in its message."""
    if not s.starts:
        return s
    told = f"{s.found} of {s.starts} starts led to it, "
    if not s.others:
        told += "none to another one"
    elif len(s.others) == 1:
        told += "others to one other minimum"
    else:
        told += f"others to {len(s.others)} other minima"
    if not s.found:
        told = f"none of {s.starts} starts on a coarse mesh led to a motion"
        if s.others:
            several = "one minimum" if len(s.others) == 1 else f"{len(s.others)} minima"
            told = f"{s.starts} starts led to {several} on a coarse mesh alone"
    return replace(s, message=f"{s.message}; {told}")
