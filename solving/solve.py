"""Solve a problem: read what is asked for, then one way or the best of several."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from dmoc.base.errors import ProblemError
from dmoc.base.options import read
from dmoc.base.progress import Listener, listener
from dmoc.base.signatures import public
from dmoc.base.tolerances import ITERATIONS, OPTIMALITY, VIOLATION
from dmoc.problem.problem import Problem
from dmoc.results.solution import Solution, saying
from dmoc.solvers.outcome import Iteration
from dmoc.solving.answer import answer_of
from dmoc.solving.beginning import Beginning
from dmoc.solving.either_sign import best_sign
from dmoc.solving.keywords import Keywords
from dmoc.solving.mesh.one_mesh import interrupted
from dmoc.solving.request import Request, check_hits, check_problem, request_of, without_hits
from dmoc.solving.starts import InitialGuess, loaded


@public(ProblemError)
def solve(
    problem: Problem,
    method: str | None = None,
    *,
    tolerance: float | None = None,
    form: str = "condensed",
    guess: InitialGuess = None,
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
    "wall:slip+") begins with the way that the law takes in the guess, or, where that leads to no
    motion, with one way for all hits; then the ways of one hit after the other are tried, from few
    starts on a coarse mesh, as long as the cost falls.  The
    best that is confirmed is the answer; its collisions tell the way.  The limits are those of all
    ways together.

    Parameters
    ----------
    problem : Problem
    method : {"slsqp", "ipm", "ipopt", "uno"}
        SciPy's sequential quadratic programming on the condensed program; the compiled
        interior-point method of dmoc; IPOPT; Uno.  The last two are extras.  The default is
        "slsqp", with a tolerance, contacts that last, hits with friction, peaks in the objective or
        more than 1000 inputs "ipm" if the kernels are compiled.
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
        another order is interpolated, the multipliers of one with the same steps serve too (with
        slsqp, those of a solution of the same program, which is the answer).  A mapping gives
        courses of coordinates and inputs by name, and "durations", the seconds of each phase, as
        ``{"alpha": [0, 0.5, -3.1], "F": 0, "durations": [0.2, 0.8]}``: a number, which is kept,
        keyframes, which are spread evenly over the time, or a function of an array of times in
        seconds.  A list of mappings gives them for each phase, keyframes spread over the phase.
        What is not named is that of the automatic guess; velocities and impulses follow.
    starts : int, optional
        How many starts are tried on a coarse mesh by the compiled method before the mesh of the
        problem is: a guess that is given, the automatic guesses, and random motions through the
        collisions.  The distinct minima they lead to are refined and checked, and the method begins
        with the best of them (slsqp keeps it where it meets the tolerances already); ``others`` of
        the solution are the rest.  By default as many as it seems to take: 16 random ones, 100
        where those do not agree on a minimum, 300 where fewer than five of these have met the best
        one, and where there is none with limits of the inputs that are tightened step by step.  1
        begins with the guess alone, as does a guess that is given and kernels without a compiler.
        No better minimum than the answer was met; that none exists is not shown.  Where none leads
        to a motion by default, in a third of the time if there is a limit, other forms are tried: a
        last duration of 0 where the motion ends at rest after an event and no durations are stated;
        order 2 with 60 steps where no steps are.  A note of the solution says so.
    seed : int
        Of the random motions: the same seed gives the same answer.
    optimality, violation : float
        Tolerances of the optimality residual and of the constraints.
    iterations : int
        Limit of the solve, and of each start; where another method takes over (from slsqp, ipm),
        half of them are kept for it.
    seconds : float, optional
        Limit of the guess, the solve and the check together.  The starts have half of it, and nine
        tenths as long as none has led to a motion.  Where these were not enough, further ones have
        what is left after the answer, however many these are, but for the time that an answer
        takes.  Of hits whose course is not said, the courses that are tried have half of it, in
        equal parts.
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
    keywords = read(Keywords, locals(), ProblemError)
    return solved(problem, keywords, loaded(guess), progress, thorough=True)


def solved(
    problem: Problem,
    keywords: Keywords,
    guess: InitialGuess,
    progress: Listener[Iteration] = None,
    *,
    thorough: bool = False,
    begun: Beginning | None = None,
) -> Solution:
    """Solve a problem with keywords that were read, from a guess that was loaded; a thorough
    solve uses the time limit to its end, tries other forms where no start leads to a motion, and
    says with how many steps the check confirms an answer that it contradicts.  ``begun`` is where
    the solve of this very problem begins, if others have begun with it."""
    request, reference = request_of(problem, keywords), keywords.reference
    lasts = thorough and not problem.open_hits
    request = replace(request, thorough=lasts, names_steps=thorough, begun=begun)
    check_hits(problem)
    if reference:
        problem = problem.but(kernels=replace(problem.kernels, reference=reference))
    with listener(progress, "first guess") as tell:
        request = request.within(progress=tell)
        try:
            answer = best_sign(problem, guess, request, _way(problem))
            never = without_hits(problem)
            return saying(answer, never) if never else answer
        except KeyboardInterrupt:
            from dmoc.solving.open_hits import first_way

            return interrupted(first_way(problem), guess, request)


def _way(problem: Problem) -> Callable[[Problem, InitialGuess, Request], Solution]:
    """How a problem is solved."""
    if not problem.open_hits:
        return answer_of
    from dmoc.solving.open_hits import best_way  # here, because most problems say all courses

    return best_way
