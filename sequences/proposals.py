"""Sequences that nobody has named: those that motions of the relaxed program have."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

from dmoc.base.deadline import Deadline
from dmoc.base.errors import ProblemError, SearchError
from dmoc.guess.folded import Folded
from dmoc.mechanics.sequence_words import parts_of, word_between
from dmoc.problem.problem import Problem
from dmoc.sequences.relaxation import Relaxation
from dmoc.sequences.relaxed_motion import Reading, RelaxedMotion
from dmoc.sequences.settings import BEYOND, Settings

# So many starts that have led to the cheapest sequence are enough.
OFTEN = 3
Words = tuple[str, ...]


@dataclass(frozen=True)
class Proposed:
    """A sequence that motions of the relaxed program have.

    Attributes
    ----------
    sequence : tuple of str
    cost : float
        Of the cheapest of them, on their mesh.
    starts : int
        How many starts have led to it.
    """

    sequence: Words
    cost: float
    starts: int = 1

    def to_dict(self) -> dict[str, Any]:
        """What the command line prints as JSON."""
        return {"sequence": list(self.sequence), "cost": self.cost, "starts": self.starts}

    def __str__(self) -> str:
        name = ", ".join(self.sequence) or "no event"
        return f"{name} ({self.starts} start{'s' * (self.starts != 1)}, about {self.cost:.4g})"


@dataclass
class Proposals:
    """What relaxed motions propose.

    Attributes
    ----------
    problem : Problem
        With the friction at its start that the cheapest of them begins with, where it says none.
    starts : int
        How many there were.
    proposed : dict
        By sequence.
    motions : dict
        The cheapest motion of each.
    relaxed : dict
        The relaxed motion that it was read from.
    refused : dict
        Sequences that no problem can have, and why.
    """

    problem: Problem
    relaxation: Relaxation
    settings: Settings
    starts: int = 0
    proposed: dict[Words, Proposed] = field(default_factory=dict)
    motions: dict[Words, Folded] = field(default_factory=dict)
    relaxed: dict[Words, RelaxedMotion] = field(default_factory=dict)
    refused: dict[Words, str] = field(default_factory=dict)

    @property
    def led(self) -> int:
        """Starts that led to a motion."""
        return sum(p.starts for p in self.proposed.values())

    def ranked(self) -> tuple[Proposed, ...]:
        """The cheapest first."""
        return tuple(sorted(self.proposed.values(), key=lambda p: (p.cost, p.sequence)))

    def take(self, motions: Iterable[RelaxedMotion | None]) -> list[Words]:
        """Add what some motions propose; return the sequences that are new."""
        new = list[Words]()
        for motion in motions:
            self.starts += 1
            if motion is None:
                continue
            words, way = self._in_the_problem(motion.reading)
            if not self.fits(words):
                continue
            before = self.proposed.get(words)
            if before is None:
                new.append(words)
            if before is None or motion.cost < before.cost:
                self.motions[words], self.relaxed[words] = way, motion
                before = Proposed(words, motion.cost, before.starts if before else 0)
            self.proposed[words] = replace(before, starts=before.starts + 1)
        return new

    def look_around(self, motion: Folded, deadline: Deadline) -> list[Words]:
        """Add what motions from another one propose; return the sequences that are new."""
        most = self.settings.max_collisions
        return self.take(self.relaxation.beside(motion, most, deadline))

    def in_detail(self) -> dict[Words, Folded]:
        """Sequences that the relaxed motions show step by step, the cheapest first."""
        motions = (self.relaxed[p.sequence] for p in self.ranked())
        return dict(self._in_the_problem(motion.in_detail) for motion in motions)

    def _in_the_problem(self, reading: Reading) -> tuple[Words, Folded]:
        """Words and motion of a reading, from the contacts with which the problem begins: where
        these are others, they change in the middle of the first step."""
        contacts, begins, way = (
            self.problem.touch.contacts,
            self.problem.touch.modes[0],
            reading.motion,
        )
        word = word_between(contacts, begins, reading.start)
        if not word:
            return reading.words, way
        first, *rest = way.pieces
        first = first.with_node(0)
        split = [
            replace(first, t=first.t[part], q=first.q[part], v=first.v[part])
            for part in (slice(2), slice(1, None))
        ]
        motion = Folded(("", *way.hits), (*split, *rest), (0.0, *way.impulses))
        return (word, *reading.words), motion

    def fits(self, words: Words) -> bool:
        """Whether a search may try them: its words, some that a problem can have, and not many more
        at which contacts change than it is deep."""
        s = self.settings
        if words in self.proposed or words in self.refused:
            return words in self.proposed
        if s.events is not None and not set(words) <= set(s.events):
            return False
        try:
            touch = self.problem.but(sequence=words, durations=None, via=None).touch
        except ProblemError as error:
            self.refused[words] = str(error)
            return False
        phases = zip(touch.events, pairwise(touch.modes), strict=True)
        changes = sum(event.impact or a.closed != b.closed for event, (a, b) in phases)
        return changes <= s.max_collisions + BEYOND


def proposals_of(problem: Problem, settings: Settings, deadline: Deadline) -> Proposals:
    """Sequences that relaxed motions propose: from random starts, and from the cheapest of them,
    until it stays the cheapest; they have half of the time."""
    deadline = deadline.share(0.5)
    if not problem.kernels.compiled:
        raise SearchError(
            f"strategy {settings.strategy!r} needs compiled kernels: install a C compiler and "
            "build the model again, or take another strategy."
        )
    relaxation = Relaxation.of(problem, settings)
    if relaxation.nothing_touches:
        raise SearchError(_nothing_proposed(problem))
    motions = list[RelaxedMotion | None]()
    for some in relaxation.motions(settings.max_collisions, settings.seed, deadline):
        motions += some
        if _met_often(motions):
            break
    proposals = Proposals(_begun_as(problem, motions), relaxation, settings)
    proposals.take(motions)
    best: Words | None = None
    while proposals.proposed and best != (cheapest := proposals.ranked()[0].sequence):
        best = cheapest
        proposals.look_around(proposals.motions[best], deadline)
    return proposals


def _nothing_proposed(problem: Problem) -> str:
    """Why no relaxed motion can say a sequence, and what to do instead."""
    name, ignored = problem.kernels.name, ", ".join(problem.ignored)
    if problem.touch.modes[0].closed:
        return (
            f"strategy 'propose' needs surfaces that are not ignored, in this problem of {name!r} "
            f"all are ({ignored}): relaxed motions would fall through them, which costs least; "
            "take strategy 'tree' with more starts (starts=64), or ignore less."
        )
    if not problem.ignored:
        return (
            f"nothing can touch in this problem of {name!r}: no surface can be met, and nothing "
            "rubs; solve it with dmoc.solve."
        )
    return (
        f"nothing can touch in this problem of {name!r}: its surfaces are ignored, and nothing "
        "rubs; solve it with dmoc.solve, or take strategy 'tree', which lands on ignored surfaces "
        "too."
    )


def _cheapest(motions: Iterable[RelaxedMotion | None]) -> Reading | None:
    """The reading of the cheapest motion."""
    good = [m for m in motions if m is not None]
    return min(good, key=lambda m: m.cost).reading if good else None


def _met_often(motions: Sequence[RelaxedMotion | None]) -> bool:
    """Whether enough starts have led to the sequence of the cheapest motion."""
    best = _cheapest(motions)
    if best is None:
        return False
    same = [m for m in motions if m is not None and m.reading.same(best)]
    return len(same) >= OFTEN


def _begun_as(problem: Problem, motions: Sequence[RelaxedMotion | None]) -> Problem:
    """The problem with the contacts at its start that the cheapest motion has, where the problem
    itself says nothing of them; grips are open there."""
    cheapest, contacts = _cheapest(motions), problem.touch.contacts
    if problem.contacts or cheapest is None:
        return problem
    start = cheapest.start
    for j in contacts.of_grips:
        start = start.opening(j, contacts)
    try:
        return problem.but(contacts=parts_of(start, contacts))
    except ProblemError:  # the start is not where they are closed
        return problem
