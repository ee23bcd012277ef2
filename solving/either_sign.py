"""Goals that are attitudes, which a quaternion and its opposite both reach: the short way and the
long one are motions of two programs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.problem.attitudes import quaternions_of_goal, with_goal_of
from dmoc.problem.problem import Problem
from dmoc.program.layout import Layout
from dmoc.results.solution import Minimum, Solution, saying
from dmoc.solvers.outcome import CONVERGED, MINIMA, Status
from dmoc.solving.request import Request
from dmoc.solving.starts import InitialGuess, starts_of

Solve = Callable[[Problem, InitialGuess, Request], Solution]

# Attitudes of which all signs are tried together; of more, one has the other sign at a time.
TOGETHER = 2


def best_sign(problem: Problem, guess: InitialGuess, request: Request, solve: Solve) -> Solution:
    """The best solution among the signs of the quaternions at the goal.

    A guess goes one way, and a single start the short one.  The limits are those of all ways
    together; the minima of the others are among the other ones of the answer.
    """
    if guess is not None and quaternions_of_goal(problem):
        return solve(with_goal_of(problem, _end(problem, guess)), guess, request)
    ways = [problem] if guess is not None or request.starts == 1 else ways_of(problem)
    if len(ways) == 1:
        return solve(problem, guess, request)
    answers, spent = list[Solution](), 0
    for k, way in enumerate(ways):
        options = request.options.after(spent)
        share = options.deadline.share(1 / (len(ways) - k))
        answers.append(
            solve(way, guess, replace(request, options=replace(options, deadline=share)))
        )
        spent += answers[-1].iterations
        if answers[-1].status is Status.INTERRUPTED:
            break
    best = min(answers, key=_rank)
    return _among(best, [a for a in answers if a is not best], spent)


def _end(problem: Problem, guess: InitialGuess) -> Array:
    """The position at the end of a guess."""
    if isinstance(guess, Solution):
        return np.asarray(guess.phases[-1].q[-1])
    x = starts_of(problem, guess).points[0]
    return np.asarray(x[Layout.of(problem).index_q[-1]])


def ways_of(problem: Problem) -> list[Problem]:
    """The problem with either sign of the quaternions at its goal, the nearer ones first."""
    goals = quaternions_of_goal(problem)
    if len(goals) <= TOGETHER:
        flips = [np.ones(0)] if not goals else list(_signs(len(goals)))
    else:
        flips = [np.ones(len(goals)), *(1 - 2 * np.eye(len(goals)))]
    ways = [problem]
    for own in flips[1:]:
        q = problem.goal_position.copy()
        for sign, columns in zip(own, goals, strict=True):
            q[columns] *= sign
        ways.append(with_goal_of(problem, q))
    return ways


def _signs(count: int) -> list[np.ndarray]:
    grid = np.array(np.meshgrid(*[(1.0, -1.0)] * count, indexing="ij"))
    return list(grid.reshape(count, -1).T)


def _rank(answer: Solution) -> tuple[bool, bool, float]:
    """Confirmed ones first, by their cost."""
    cost = answer.cost if answer.status in CONVERGED else answer.max_violation
    return answer.status not in MINIMA, answer.status not in CONVERGED, cost


def _among(best: Solution, others: list[Solution], iterations: int) -> Solution:
    """The best of some answers, with the minima of all."""
    ends = [a for a in others if a.status in CONVERGED]
    minima = [Minimum(a.cost, a.agreeing_starts, a.status, a.steps) for a in ends]
    every = [*best.others, *minima, *(m for a in others for m in a.others)]
    merged = replace(best, iterations=iterations, others=tuple(sorted(every, key=lambda m: m.cost)))
    cost = f"it costs {min(a.cost for a in ends):.6g}" if ends else "no motion was found"
    return saying(merged, f"with the other sign of a quaternion at the goal {cost}")
