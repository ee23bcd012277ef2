"""Hits after which what slides goes the other way, in sequences that do not say so."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice

from dmoc.base.records import value_class
from dmoc.mechanics.contact_mode import Mode
from dmoc.mechanics.contacts import NOWHERE, Contacts
from dmoc.mechanics.sequence_words import touch_along
from dmoc.motion.friction import after_stop, rubbing_word, sticks
from dmoc.problem.problem import Problem
from dmoc.results.solution import Solution, saying
from dmoc.solvers.outcome import Status
from dmoc.solving.case import Case

# Sequences that are tried, and steps of a phase at most.
MOST_TRIED, STEPS = 6, 24


def naming_turns(answer: Solution, case: Case) -> Solution:
    """The answer; where there is no motion because a hit throws back what slides, its message names
    the sequence that says so."""
    problem, deadline = case.problem, case.request.options.deadline
    if answer.status is not Status.INFEASIBLE:
        return answer
    for words in islice(_turned(problem), MOST_TRIED):
        longer = problem.models.change and len(words) != len(problem.sequence)
        if longer or words == problem.sequence or deadline.passed:
            continue
        other = problem.but(sequence=words)
        tried = case.afresh(other.meshed([min(n, STEPS) for n in other.phase_steps]))
        if tried.converged:
            return saying(
                answer,
                f"what slides does not go on so after a hit: sequence = {list(words)} leads to a "
                f"motion, which costs {tried.cost:.4g}",
            )
    return answer


@value_class(frozen=True)
class _Said:
    """The first words of a sequence: the last of them with the mode before it, and those before."""

    count: int
    mode: Mode
    word: str
    before: _Said | None

    def words(self) -> tuple[str, ...]:
        words, said = list[str](), self
        while said.before is not None:
            words.append(said.word)
            said = said.before
        return tuple(reversed(words))


def _turned(problem: Problem) -> Iterator[tuple[str, ...]]:
    """The sequences in which hits turn or stop what slides, or leave it; those with more turns
    first."""
    contacts, waiting = problem.touch.contacts, [_Said(0, problem.touch.modes[0], "", None)]
    while waiting:
        said = waiting.pop()
        if said.count == len(problem.sequence):
            yield said.words()
            continue
        mode = touch_along(said.mode, [said.word] if said.count else [], contacts).modes[-1]
        word = problem.sequence[said.count]
        waiting += [
            _Said(said.count + 1, mode, way, said)
            for way in (word, *reversed([*_turns(mode, word, contacts)]))
        ]


def _turns(mode: Mode, word: str, contacts: Contacts) -> Iterator[str]:
    """Words that may stand instead of a word in a mode: hits that turn or stop what slides."""
    touch = touch_along(mode, [word], contacts)
    event, friction = touch.events[-1], dict(touch.events[-1].friction)
    if event.hit == NOWHERE or event.course is not None:
        return
    for k, slides in touch.modes[-1].rubbing.items():
        if k not in friction and not sticks(slides):
            for state in reversed(after_stop(slides)):
                yield f"{word} {rubbing_word(contacts.tangents[k], state)}"
