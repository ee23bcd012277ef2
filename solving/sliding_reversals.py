"""Hits after which what slides goes the other way, in sequences that do not say so."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import islice

from dmoc.base.deadline import Deadline
from dmoc.mechanics.contact_mode import STICK
from dmoc.mechanics.contacts import NOWHERE
from dmoc.mechanics.sequence_words import touch_along
from dmoc.motion.trajectory import FRICTION_WORDS
from dmoc.problem.problem import Problem
from dmoc.results.solution import Solution, saying
from dmoc.solvers.outcome import Status

# Sequences that are tried, and steps of a phase at most.
MOST_TRIED, STEPS = 6, 24


def naming_turns(
    problem: Problem,
    answer: Solution,
    solve: Callable[[Problem], Solution],
    deadline: Deadline,
) -> Solution:
    """The answer; where there is no motion because a hit throws back what slides, its message names
    the sequence that says so.  ``solve`` solves a problem from few starts."""
    if answer.status is not Status.INFEASIBLE:
        return answer
    for words in islice(_turned(problem, ()), MOST_TRIED):
        if words == problem.sequence or deadline.passed:
            continue
        other = problem.but(sequence=words)
        tried = solve(other.meshed([min(n, STEPS) for n in other.phase_steps]))
        if tried.converged:
            return saying(
                answer,
                f"what slides does not go on so after a hit: sequence = {list(words)} leads to a "
                f"motion, which costs {tried.cost:.4g}",
            )
    return answer


def _turned(problem: Problem, words: Sequence[str]) -> Iterator[tuple[str, ...]]:
    """The sequences that begin with some words and in which hits turn or stop what slides, or leave
    it; those with more turns first."""
    if len(words) == len(problem.sequence):
        yield tuple(words)
        return
    word, contacts = problem.sequence[len(words)], problem.touch.contacts
    touch = touch_along(problem.touch.modes[0], [*words, word], contacts)
    event, friction = touch.events[-1], dict(touch.events[-1].friction)
    if event.hit != NOWHERE and event.course is None:
        for k, sign in touch.modes[-1].sliding:
            if k in friction:
                continue
            for state in (-sign, STICK):
                turn = f"{contacts.tangents[k]}:{FRICTION_WORDS[state]}"
                yield from _turned(problem, [*words, f"{word} {turn}"])
    yield from _turned(problem, [*words, word])
