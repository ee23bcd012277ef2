"""What is proved of the sequences of a search: bounds of all of them, from the prefixes down."""

from __future__ import annotations

import enum
from collections import Counter
from dataclasses import dataclass
from typing import Any

import numpy as np

from dmoc.base.deadline import Deadline
from dmoc.base.errors import ProblemError, SearchError
from dmoc.base.table import Shown, Table, toned
from dmoc.problem.problem import Problem
from dmoc.proving.prove import lower_bound
from dmoc.sequences.settings import Settings, children

# Seconds of each bound at most.
LONGEST = 60.0
# How far the best cost of a search may lie above that of any sequence, relative to it.
GAP = 1e-4


class Claim(enum.StrEnum):
    """What is proved of a sequence."""

    OPTIMAL = "optimal (proved)"  # none costs less by more than the gap, nor does this one
    POINTLESS = "pointless (proved)"  # it costs at least as much as the best one, but for the gap
    IMPOSSIBLE = "impossible (proved)"  # it has no motion
    OPEN = "open"


@dataclass(frozen=True)
class Bounded:
    """What is proved of one sequence.

    Attributes
    ----------
    sequence : tuple of str
    claim : Claim
    bound : float
        No motion of it costs less.
    below : bool
        Whether the same holds of all sequences that begin with it, which were not looked at.
    why : str
        Why nothing is proved, where that is so.
    """

    sequence: tuple[str, ...]
    claim: Claim
    bound: float
    below: bool = False
    why: str = ""

    def __str__(self) -> str:
        begins = f"begins with {', '.join(self.sequence)}"
        if self.claim is Claim.OPEN and self.why:
            return f"{self.claim}: {self.why}"
        if self.claim is Claim.IMPOSSIBLE:
            return f"{self.claim}: {f'no motion {begins}' if self.below else 'it has no motion'}"
        what = f"whatever {begins}" if self.below else "it"
        return f"{self.claim}: {what} costs at least {self.bound:.6g}"

    def to_dict(self) -> dict[str, Any]:
        """The same as plain data."""
        bound = self.bound if np.isfinite(self.bound) else None
        return {
            "sequence": list(self.sequence), "claim": str(self.claim), "bound": bound,
            "below": self.below, "why": self.why,
        }  # fmt: skip


@dataclass(frozen=True, repr=False)
class TreeProof(Shown):
    """What is proved of all sequences up to a length.

    Attributes
    ----------
    bounded : tuple of Bounded
        In the order in which they were looked at: a prefix before what begins with it.
    cost : float or None
        Of the best motion of the search.
    longest : int
        The length of the longest sequences.
    complete : bool
        Whether something is proved of every one.
    """

    bounded: tuple[Bounded, ...]
    cost: float | None
    longest: int
    complete: bool

    @property
    def statement(self) -> str:
        """What is proved of all, in a sentence."""
        if not self.complete:
            left = sum(b.claim is Claim.OPEN for b in self.bounded)
            return (
                f"no bound of {left} of {len(self.bounded)} sequences is enough"
                if left
                else ("time ran out before all sequences were looked at")
            )
        if self.cost is None:
            return f"no sequence of at most {self.longest} events has a motion"
        return (
            f"no sequence of at most {self.longest} events has a motion that costs less than "
            f"{(1 - GAP) * self.cost:.9g}"
        )

    @property
    def in_words(self) -> str:
        """The sentence, and whether it is proved."""
        return f"{'proved' if self.complete else 'not proved'}: {self.statement}"

    def of(self, sequence: tuple[str, ...]) -> Bounded | None:
        """What is proved of a sequence, by itself or by what it begins with; None if it was not
        looked at."""
        known = {b.sequence: b for b in self.bounded}
        beginnings = (known.get(sequence[:n]) for n in range(len(sequence) + 1))
        all_below = next((b for b in beginnings if b is not None and b.below), None)
        return all_below or known.get(sequence)

    def __repr__(self) -> str:
        return f"<TreeProof: {self.statement}>"

    def summary(self) -> Table:
        """What ``print`` and notebooks show."""
        rows = tuple(
            (
                ", ".join(b.sequence) or "no event",
                toned(str(b.claim), TONES[b.claim]),
                f"{b.bound:.6g}" if np.isfinite(b.bound) else "",
                "and all that begin with it" if b.below else b.why,
            )
            for b in self.bounded[:MOST_ROWS]
        )
        counts = ", ".join(f"{n} {c}" for c, n in Counter(b.claim for b in self.bounded).items())
        more = len(self.bounded) - MOST_ROWS
        notes = [f"... and {more} more"] if more > 0 else []
        head = "sequence", "claim", "costs at least", ""
        return Table(rows, head, (*notes, counts, self.in_words), "Proof of a search")

    def to_dict(self) -> dict[str, Any]:
        """The same as plain data."""
        return {
            "statement": self.statement, "cost": self.cost, "longest": self.longest,
            "complete": self.complete, "sequences": [b.to_dict() for b in self.bounded],
        }  # fmt: skip


TONES = {
    Claim.OPTIMAL: "best", Claim.POINTLESS: "good", Claim.IMPOSSIBLE: "dim", Claim.OPEN: "doubtful"
}  # fmt: skip
MOST_ROWS = 40  # to_dict has all


def check_provable(problem: Problem) -> None:
    """Refuse a problem whose motions are not linear between events."""
    try:
        lower_bound(problem.but(sequence=(), durations=None, via=None), np.inf, Deadline.after(0.0))
    except ProblemError as error:
        raise SearchError(f"prove: {error}") from None


def proof_of(
    problem: Problem,
    settings: Settings,
    best: tuple[tuple[str, ...], float] | None,
    deadline: Deadline,
) -> TreeProof:
    """Bound all sequences of a search, whose best one has a cost."""
    limit = np.inf if best is None else (1 - GAP) * best[1]
    bounded, waiting = list[Bounded](), list[tuple[str, ...]]([()])
    try:
        while waiting and not deadline.passed:
            sequence = waiting[0]
            before = _of_prefix(problem, settings, sequence, limit, deadline) if sequence else None
            if before is None:
                bounded.append(_of_sequence(problem, settings, sequence, best, limit, deadline))
                if len(sequence) < settings.max_collisions:
                    waiting += [(*sequence, word) for word in children(problem, sequence, settings)]
            else:
                bounded.append(before)
            waiting.pop(0)
    except KeyboardInterrupt:
        pass  # what was bounded until then is kept
    complete = not waiting and all(b.claim is not Claim.OPEN for b in bounded)
    return TreeProof(tuple(bounded), best and best[1], settings.max_collisions, complete)


def _a_while(until: Deadline) -> Deadline:
    """The time of one bound."""
    return Deadline.after(min(LONGEST, max(until.left, 1e-9)))


def _of_prefix(
    problem: Problem, settings: Settings, sequence: tuple[str, ...], limit: float, until: Deadline
) -> Bounded | None:
    """What the first events cost, whatever is behind them, if that is enough for all sequences that
    begin so; what follows costs something more, or nothing."""
    spans = [(settings.shortest_phase, None)] * len(sequence)
    latest = problem.final_time_bounds[1]
    try:
        first = problem.but(
            sequence=sequence, durations=[*spans, 0], via=None, goal={}, periodic=(),
            final_time=(None, latest),
        )  # fmt: skip
        bound, most, seen = lower_bound(
            first, limit, _a_while(until), growing=True, workers=settings.workers
        )
    except ProblemError:
        return None
    if not seen:
        return None
    claim = Claim.IMPOSSIBLE if bound >= most else Claim.POINTLESS
    return Bounded(sequence, claim, bound, below=True)


def _of_sequence(
    problem: Problem, settings: Settings, sequence: tuple[str, ...],
    best: tuple[tuple[str, ...], float] | None, limit: float, until: Deadline,
) -> Bounded:  # fmt: skip
    """What a motion of a sequence costs at least."""
    spans = [(settings.shortest_phase, None)] * (len(sequence) + 1) if sequence else None
    try:
        whole = problem.but(sequence=sequence, durations=spans, via=None)
        bound, most, seen = lower_bound(whole, limit, _a_while(until), workers=settings.workers)
    except ProblemError as error:
        return Bounded(sequence, Claim.OPEN, -np.inf, why=str(error))
    if not seen:
        return Bounded(sequence, Claim.OPEN, bound, why="time ran out, or it is left out")
    if best is not None and sequence == best[0]:
        return Bounded(sequence, Claim.OPTIMAL, bound)
    return Bounded(sequence, Claim.IMPOSSIBLE if bound >= most else Claim.POINTLESS, bound)
