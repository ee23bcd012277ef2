"""Hits with friction whose course is not said: all courses are tried."""

from __future__ import annotations

import itertools
import time
from dataclasses import replace
from typing import Protocol

import numpy as np

from dmoc.errors import ProblemError
from dmoc.nlp.problem import Problem
from dmoc.solution import Solution
from dmoc.solvers.outcome import Options, Status
from dmoc.solving.attempts import remaining

# Courses of all hits together that are tried at most.
MOST_WAYS = 100
# Share of the time that is left which one of them may take beside those that follow.
SHARE = 0.5
CONFIRMED = (Status.SOLVED, Status.GRAZES)
# Statuses after which no further way is tried.
ENDING = (Status.INTERRUPTED, Status.TIME_LIMIT)


class Solving(Protocol):
    """Solves the problem of one way within limits: as is asked for, or on a coarse mesh,
    from few starts, which may lead to nothing, or from the guess alone."""

    def thorough(self, way: Problem, options: Options) -> Solution: ...

    def rough(self, way: Problem, options: Options) -> Solution | None: ...

    def alone(self, way: Problem, options: Options) -> Solution: ...


def best_way(problem: Problem, solving: Solving, options: Options) -> Solution:
    """The best solution among the courses of the hits with friction.

    Each course is solved from few starts on a coarse mesh; those that lead to a motion are solved
    as is asked for, the cheapest first, until one is confirmed.  Where none does, the course that
    comes nearest to a motion from the guess is solved.  ``options`` limits all of this together.

    Raises
    ------
    ProblemError
        If the hits have more courses together than can be tried.
    """
    ways, begin, spent = ways_of(problem), time.perf_counter(), 0

    def limits(k: int) -> Options:
        """What a way may take beside those that follow."""
        left, share = remaining(options, begin, spent), SHARE / (len(ways) - k)
        seconds = None if left.seconds is None else share * left.seconds
        return replace(left, seconds=seconds, iterations=max(int(share * left.iterations), 1))

    tried = dict[int, Solution]()
    for k, way in enumerate(ways):
        # A start has its own limit of iterations.
        minimum = solving.rough(way, replace(limits(k), iterations=options.iterations))
        if minimum is not None:
            tried[k] = minimum
    order = sorted(tried, key=lambda k: (tried[k].status not in CONFIRMED, tried[k].cost))
    if not tried:
        nearest = list[Solution]()
        for k, way in enumerate(ways):
            nearest.append(solving.alone(way, limits(k)))
            spent += nearest[-1].iterations
            if nearest[-1].minimum:
                break
        order = [min(range(len(nearest)), key=lambda k: nearest[k].max_violation)]
    answers = list[Solution]()
    for k in order:
        answers.append(solving.thorough(ways[k], remaining(options, begin, spent)))
        spent += answers[-1].iterations
        ended = answers[-1].status in (*CONFIRMED, *ENDING)
        if ended or spent >= options.iterations:
            break
    answer = answers[-1 if ended else 0]
    return _told(replace(answer, iterations=spent), len(tried), len(ways))


def ways_of(problem: Problem) -> list[Problem]:
    """The problem with every course of its hits."""
    words = [problem.open_hits.get(i, [word]) for i, word in enumerate(problem.sequence)]
    count = int(np.prod([len(w) for w in words]))
    if count > MOST_WAYS:
        raise ProblemError(
            f"sequence = {list(problem.sequence)} has {len(problem.open_hits)} hits with friction "
            f"that do not say how they go, which makes {count} sequences: expected at most "
            f"{MOST_WAYS}; say it of some, as {problem.open_hits[min(problem.open_hits)][0]!r}."
        )
    return [problem.but(sequence=chosen) for chosen in itertools.product(*words)]


def _told(answer: Solution, good: int, ways: int) -> Solution:
    """The answer with what is known of the other courses."""
    words = ", ".join(c.word for c in answer.collisions)
    if not good:
        told = (
            f"none of {ways} ways through the hits with friction led to a motion; this is {words}"
        )
    else:
        told = f"{good} of {ways} ways through the hits with friction led to a motion, the best is"
        told += f" {words}"
    return replace(answer, message=f"{answer.message}; {told}")
