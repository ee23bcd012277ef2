"""Hits with friction whose course is not said.

The law of Poisson and Coulomb says which course a hit takes from the state before it.  So a motion
says the courses of its hits, and the courses say the program whose motion is the next one.  From
where that leads, the courses of one hit after the other are changed as long as the cost falls.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from dmoc.base.deadline import Deadline
from dmoc.codegen.kernels import Array
from dmoc.guess.hit_course import courses_at, states_before
from dmoc.mechanics.modes import Course
from dmoc.problem.problem import Problem
from dmoc.results.solution import Solution
from dmoc.solvers.outcome import Options, Status

# Courses of all hits together that are tried at most, and those that follow each other's motions
# before it is settled that these lead nowhere.
MOST_WAYS, LAPS = 100, 4
# Starts of a course that the law takes, at most, and of any other one.
STARTS, FEW = 16, 4
# Share of the time that the tries may take, and of what is left of it which one may take.
SHARE = 0.5
CONFIRMED = (Status.SOLVED, Status.GRAZES)
# Statuses after which no further way is tried.
ENDING = (Status.INTERRUPTED, Status.TIME_LIMIT)

Words = tuple[str, ...]


class Solving(Protocol):
    """Solves the problem of one way within limits: as is asked for, or on a coarse mesh,
    from few starts, which may lead to nothing, or from the guess alone; and gives its guess."""

    def thorough(self, way: Problem, options: Options) -> Solution: ...

    def rough(self, way: Problem, options: Options, starts: int) -> Solution | None: ...

    def alone(self, way: Problem, options: Options) -> Solution: ...

    def start(self, way: Problem) -> Array: ...


def first_way(problem: Problem) -> Problem:
    """The problem with some course of its hits."""
    return problem.but(sequence=[word for word, *_ in _words(problem)])


def best_way(problem: Problem, solving: Solving, options: Options) -> Solution:
    """The best solution among the courses of the hits with friction.

    Courses are solved from few starts on a coarse mesh; those that lead to a motion are solved
    as is asked for, the cheapest first, until one is confirmed.  Where none does, the course that
    comes nearest to a motion from the guess is solved.  ``options`` limits all of this together.
    """
    tries = _Tries(problem, solving, options, options.deadline.share(SHARE))
    tries.follow_the_law()
    tries.change_single_ones()
    if not tries.good:
        tries.enumerate()
    spent, answers, ended = tries.spent, list[Solution](), False
    for words in sorted(tries.good, key=tries.rank) or [tries.nearest()]:
        answers.append(solving.thorough(problem.but(sequence=words), options.after(spent)))
        spent += answers[-1].iterations
        ended = answers[-1].status in (*CONFIRMED, *ENDING)
        if ended or spent >= options.iterations:
            break
    answer = answers[-1 if ended else 0]
    return _told(replace(answer, iterations=spent), len(tries.good), len(tries.tried))


@dataclass
class _Tries:
    """Ways that were tried on a coarse mesh.

    Attributes
    ----------
    deadline : Deadline
        After it no further way is tried.
    tried : dict of words to Solution or None
        A minimum, where there is one.
    near : dict of words to Solution
        Where the guess alone leads.
    spent : int
        Iterations of these.
    """

    problem: Problem
    solving: Solving
    options: Options
    deadline: Deadline
    tried: dict[Words, Solution | None] = field(default_factory=dict)
    near: dict[Words, Solution] = field(default_factory=dict)
    spent: int = 0

    @property
    def good(self) -> dict[Words, Solution]:
        return {words: s for words, s in self.tried.items() if s is not None}

    def rank(self, words: Words) -> tuple[bool, float]:
        """Confirmed ones first, by cost; then those that lead to nothing."""
        s = self.tried.get(words)
        return (True, np.inf) if s is None else (s.status not in CONFIRMED, s.cost)

    def follow_the_law(self) -> None:
        """Try the courses that the law takes in the guess, and then, as long as they lead to no
        motion, those that it takes where they end."""
        way = first_way(self.problem)
        words = _said(self.problem, courses_at(way, states_before(way, self.solving.start(way))))
        for _ in range(LAPS):
            if words in self.tried or self._try(words, STARTS) is not None or not self._goes_on:
                return
            way, end = self.problem.but(sequence=words), self._alone(words)
            states = [(p.q[-1], p.v[-1], float(p.t[-1])) for p in end.phases[:-1]]
            words = _said(self.problem, courses_at(way, states))

    def change_single_ones(self) -> None:
        """Change the course of one hit after the other, as long as that costs less."""
        if not self.tried:
            return
        best = min(self.tried, key=self.rank)
        places, unchanged = itertools.cycle(self.problem.open_hits), 0
        while unchanged < len(self.problem.open_hits):
            i = next(places)
            others = [(*best[:i], word, *best[i + 1 :]) for word in self.problem.open_hits[i]]
            for words in others:
                if words not in self.tried and self._goes_on:
                    self._try(words)
            better = min([best, *others], key=self.rank)
            unchanged = unchanged + 1 if better == best else 1
            best = better

    def enumerate(self) -> None:
        """Try all ways, in as far as they are not too many."""
        for words in itertools.product(*_words(self.problem)):
            if not self._goes_on:
                return
            if words not in self.tried:
                self._try(words)

    def nearest(self) -> Words:
        """The way that comes nearest to a motion, of some."""
        for words in list(self.tried)[:LAPS]:
            self._alone(words)
        return min(self.near, key=lambda words: self.near[words].max_violation)

    @property
    def _goes_on(self) -> bool:
        return len(self.tried) < MOST_WAYS and not self.deadline.passed

    def _limits(self) -> Options:
        left = self.options.after(self.spent)
        return replace(left, deadline=left.deadline.share(SHARE))

    def _try(self, words: Words, starts: int = FEW) -> Solution | None:
        # A start has its own limit of iterations.
        limits = replace(self._limits(), iterations=self.options.iterations)
        self.tried[words] = self.solving.rough(self.problem.but(sequence=words), limits, starts)
        return self.tried[words]

    def _alone(self, words: Words) -> Solution:
        if words not in self.near:
            limits = self._limits()
            few = replace(limits, iterations=max(limits.iterations // (2 * LAPS), 1))
            self.near[words] = self.solving.alone(self.problem.but(sequence=words), few)
            self.spent += self.near[words].iterations
        return self.near[words]


def _words(problem: Problem) -> list[list[str]]:
    """The words that each event may have."""
    return [problem.open_hits.get(i, [word]) for i, word in enumerate(problem.sequence)]


def _said(problem: Problem, courses: Mapping[int, Course]) -> Words:
    """The words of a sequence with courses of its hits; where one is none of theirs, the first."""

    def said() -> Iterator[str]:
        for i, words in enumerate(_words(problem)):
            wanted = f"{problem.events[i].hit}:{courses.get(i)}"
            yield next((word for word in words if wanted in word.split()), words[0])

    return tuple(said())


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
