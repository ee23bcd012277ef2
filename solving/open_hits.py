"""Hits with friction whose course is not said.

The law of Poisson and Coulomb says which course a hit takes from the state before it.  So a motion
says the courses of its hits, and the courses say the program whose motion is the next one; where
that leads to no motion, all hits take one course after the other.  From where that leads, the
courses of one hit after the other are changed as long as the cost falls.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from dmoc.base.deadline import Deadline
from dmoc.guess.hit_course import courses_at, states_before
from dmoc.mechanics.contact_mode import Course
from dmoc.mechanics.contacts import NOWHERE
from dmoc.problem.design import designed_as
from dmoc.problem.problem import Problem
from dmoc.program.iterate import Iterate
from dmoc.results.solution import Solution, saying
from dmoc.solvers.outcome import Status
from dmoc.solving.answer import answer_of
from dmoc.solving.mesh.one_mesh import on_coarse_mesh, solved_on_mesh
from dmoc.solving.multistart.effort import Effort
from dmoc.solving.multistart.exploration import coarse_of, explored
from dmoc.solving.request import GIVEN, Request
from dmoc.solving.starts import InitialGuess, starts_of

# Courses of all hits together that are tried at most, and those that follow each other's motions
# before it is said that these lead nowhere.
MOST_WAYS, LAPS = 100, 4
# Starts of a course that the law takes, at most, and of any other one.
STARTS, FEW = 16, 4
# Share of the time that the tries may take; each has an equal one of what is left for it and those
# that are still to come, so that a slow one leaves time for the word that helps.
SHARE = 0.5
CONFIRMED = (Status.SOLVED, Status.GRAZES)
# Statuses after which no further way is tried.
ENDING = (Status.INTERRUPTED, Status.TIME_LIMIT)

Words = tuple[str, ...]


def first_way(problem: Problem) -> Problem:
    """The problem with some course of its hits."""
    return problem.but(sequence=[word for word, *_ in _words(problem)])


def best_way(problem: Problem, guess: InitialGuess, request: Request) -> Solution:
    """The best solution among the courses of the hits with friction.

    Courses are solved from few starts on a coarse mesh; those that lead to a motion are solved
    as is asked for, the cheapest first, until one is confirmed.  Where none does, the course that
    comes nearest to a motion from the guess is solved.  The limits are those of all this together.
    """
    options = request.options
    tries = _Tries(problem, guess, request, options.deadline.share(SHARE))
    tries.follow_the_law()
    if not tries.good:
        tries.take_all_alike()
    tries.change_single_ones()
    if not tries.good:
        tries.enumerate()
    spent, answers, ended = tries.spent, list[Solution](), False
    for words in sorted(tries.good, key=tries.rank) or [tries.nearest()]:
        left = replace(request, options=options.after(spent))
        answers.append(answer_of(problem.but(sequence=words), guess, left))
        spent += answers[-1].iterations
        ended = answers[-1].status in (*CONFIRMED, *ENDING)
        if ended or spent >= options.iterations:
            break
    answer = answers[-1 if ended else 0]
    ways = _ways_in_words(answer, len(tries.good), len(tries.tried), tries.deadline.ends)
    return replace(saying(answer, ways), iterations=spent)


@dataclass
class _Tries:
    """Ways that were tried on a coarse mesh."""

    problem: Problem
    guess: InitialGuess
    request: Request
    deadline: Deadline  # after which no further way is tried
    tried: dict[Words, Solution | None] = field(default_factory=dict)  # a minimum, if there is one
    near: dict[Words, Solution] = field(default_factory=dict)  # where the guess alone leads
    spent: int = 0  # iterations of these

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
        x = starts_of(way, self.guess).points[0]
        chosen = Iterate.of(way, x).problem
        words = _words_with(self.problem, courses_at(chosen, states_before(way, x)))
        others = len(_alike(self.problem))
        for _ in range(LAPS):
            if words in self.tried or not self._goes_on:
                return
            if self._try(words, others, STARTS) is not None:
                return
            way, end = self.problem.but(sequence=words), self._alone(words, self._share(others))
            states = [(p.q[-1], p.v[-1], float(p.t[-1])) for p in end.phases[:-1]]
            chosen = designed_as(way, end.trajectory.parameters)
            words = _words_with(self.problem, courses_at(chosen, states))

    def take_all_alike(self) -> None:
        """Try the ways in which all hits take the same course."""
        self._try_all(_alike(self.problem), further=1)

    def change_single_ones(self) -> None:
        """Change the course of one hit after the other, as long as that costs less."""
        if not self.tried:
            return
        best = min(self.tried, key=self.rank)
        places, unchanged = itertools.cycle(self.problem.open_hits), 0
        while unchanged < len(self.problem.open_hits):
            i = next(places)
            others = [(*best[:i], word, *best[i + 1 :]) for word in self.problem.open_hits[i]]
            self._try_all(others, further=len(self.problem.open_hits) - unchanged)
            better = min([best, *others], key=self.rank)
            unchanged = unchanged + 1 if better == best else 1
            best = better

    def enumerate(self) -> None:
        """Try all ways, in as far as they are not too many."""
        self._try_all([*itertools.islice(itertools.product(*_words(self.problem)), MOST_WAYS)])

    def nearest(self) -> Words:
        """The way that comes nearest to a motion, of some, for which half of the time is left."""
        some = list(self.tried)[:LAPS]
        for words in some:
            self._alone(words, self.request.options.deadline.share(SHARE / len(some)))
        return min(self.near, key=lambda words: self.near[words].max_violation)

    @property
    def _goes_on(self) -> bool:
        return len(self.tried) < MOST_WAYS and not self.deadline.passed

    def _share(self, others: int) -> Deadline:
        """Until when one try may take that has so many others beside it."""
        return self.deadline.share(1 / (1 + others))

    def _try_all(self, ways: Sequence[Words], further: int = 0) -> None:
        """Try those of some ways that were not tried, as long as it goes on; ``further`` others are
        to come after them."""
        untried = [words for words in ways if words not in self.tried]
        for k, words in enumerate(untried, 1):
            if self._goes_on:
                self._try(words, len(untried) - k + further)

    def _try(self, words: Words, others: int, starts: int = FEW) -> Solution | None:
        """The best minimum on a coarse mesh, from some starts, in time for others; a start has its
        own limit of iterations."""
        way = self.problem.but(sequence=words)
        request = self.request.within(deadline=self._share(others))
        if way.kernels.compiled:
            effort = Effort.of(min(request.starts or starts, starts), request.seed)
            points = on_coarse_mesh(way, self.guess)
            minima = explored(coarse_of(way), effort, request.options, points).solutions
            self.tried[words] = minima[0] if minima else None
        else:
            s = self._from_guess(way, request)
            self.tried[words] = s if s.minimum else None
        return self.tried[words]

    def _alone(self, words: Words, deadline: Deadline) -> Solution:
        """Where the guess alone leads."""
        if words not in self.near:
            left = self.request.options.after(self.spent)
            few = max(left.iterations // (2 * LAPS), 1)
            request = self.request.within(iterations=few, deadline=deadline)
            way = self.problem.but(sequence=words)
            self.near[words] = self._from_guess(way, request)
            self.spent += self.near[words].iterations
        return self.near[words]

    def _from_guess(self, way: Problem, request: Request) -> Solution:
        guess = on_coarse_mesh(way, self.guess).get(GIVEN)
        s = solved_on_mesh(coarse_of(way), guess, request)
        if s.status is Status.INTERRUPTED:
            raise KeyboardInterrupt
        return s


def _words(problem: Problem) -> list[list[str]]:
    """The words that each event may have."""
    return [problem.open_hits.get(i, [word]) for i, word in enumerate(problem.sequence)]


def _alike(problem: Problem) -> list[Words]:
    """The ways in which all hits take the same course."""
    words, count = _words(problem), max(map(len, problem.open_hits.values()))
    return [tuple(one[min(k, len(one) - 1)] for one in words) for k in range(count)]


def _words_with(problem: Problem, courses: Mapping[int, Course]) -> Words:
    """The words of a sequence with courses of its hits; where one is none of theirs, the first."""

    def words_of_events() -> Iterator[str]:
        for i, words in enumerate(_words(problem)):
            hit = problem.touch.events[i].hit
            wanted = "" if hit == NOWHERE else f"{problem.kernels.surfaces[hit]}:{courses.get(i)}"
            yield next((word for word in words if wanted in word.split()), words[0])

    return tuple(words_of_events())


def _ways_in_words(answer: Solution, good: int, ways: int, timed: bool) -> str:
    """A sentence about the other courses, each of which had its part of a time limit, if any."""
    words = ", ".join(c.word for c in answer.collisions)
    if not good:
        within = " in its part of the time" if timed else ""
        return (
            f"none of {ways} ways through the hits with friction led to a motion{within}; this is "
            f"{words}"
        )
    return (
        f"{good} of {ways} ways through the hits with friction led to a motion, the best is {words}"
    )
