"""Hits with friction whose course is not said: all courses are tried."""

from __future__ import annotations

import itertools
import time
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from dmoc.errors import ProblemError
from dmoc.nlp.problem import Problem
from dmoc.solution import Solution
from dmoc.solvers.outcome import Status

# Courses of all hits together that are tried at most.
MOST_WAYS = 100
# Starts of each, and steps of a phase at most.
STARTS, STEPS = 16, 24
# Share of the time that is left which one of them may take beside those that follow.
SHARE = 0.5


class Solve(Protocol):
    """Solves a problem, from a number of starts or as many as are asked for."""

    def __call__(
        self, problem: Problem, *, starts: int | None, seconds: float | None
    ) -> Solution: ...


@dataclass(frozen=True)
class Budget:
    """Starts that are asked for, and seconds for all."""

    starts: int | None
    seconds: float | None


def best_way(problem: Problem, few: Solve, thorough: Solve, budget: Budget) -> Solution:
    """The best solution among the courses of the hits with friction.

    Each course is solved from few starts on a coarse mesh; those that lead to a motion are solved
    as is asked for, the cheapest first, until one is confirmed.

    Raises
    ------
    ProblemError
        If the hits have more courses together than can be tried.
    """
    ways = _ways(problem)
    begin, steps = time.perf_counter(), [min(n, STEPS) for n in problem.phase_steps]
    found: list[tuple[Problem, Solution]] = []
    for k, way in enumerate(ways):
        left = _left(begin, budget.seconds)
        share = None if left is None else SHARE * left / (len(ways) - k)
        tried = min(budget.starts or STARTS, STARTS)
        rough = few(way.meshed(steps), starts=tried, seconds=share)
        if rough.status is Status.INTERRUPTED:
            return rough
        found.append((way, rough))
    good = [(way, s) for way, s in found if s.minimum]
    confirmed = (Status.SOLVED, Status.GRAZES)
    ranked = sorted(good, key=lambda pair: (pair[1].status not in confirmed, pair[1].cost))
    ranked = ranked or [min(found, key=lambda pair: pair[1].max_violation)]
    answers = list[Solution]()
    for way, _ in ranked:
        answers.append(thorough(way, starts=budget.starts, seconds=_left(begin, budget.seconds)))
        if answers[-1].status in (*confirmed, Status.INTERRUPTED, Status.TIME_LIMIT):
            return _told(answers[-1], len(good), len(ways))
    return _told(answers[0], len(good), len(ways))


def _ways(problem: Problem) -> list[Problem]:
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


def _left(begin: float, seconds: float | None) -> float | None:
    return None if seconds is None else max(seconds - (time.perf_counter() - begin), 1e-9)


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
