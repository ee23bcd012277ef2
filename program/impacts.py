"""The unknowns of what happens between phases: impulses, and velocities on both sides."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from dmoc.base.records import record
from dmoc.mechanics.touch import Touch
from dmoc.motion.trajectory import noun_of
from dmoc.program.blocks import Block, Index, Numbering, sizes_of
from dmoc.program.reactions import EventImpulses


@record(frozen=True, eq=False)
class ImpactUnknowns:
    """Impulses lam of what is hit or lands first, shape (events,), and velocities v_a before and
    v_c after the events, shape (events, nq); ``names`` are those of the events."""

    touch: Touch
    names: Sequence[str]
    lam: Index
    v_a: Index
    v_c: Index

    def impulses(self, i: int) -> Iterator[EventImpulses]:
        """The impulse lam of event i, if it is an impact."""
        if self.touch.impacts[i]:
            names = self.touch.contacts.named([self.touch.surfaces[i]])
            yield EventImpulses("normal", names, self.lam[[i]], pulls=False)


def impulses(block: Numbering, touch: Touch, at: Sequence[str]) -> Block:
    """The block of impulses lam, one for each event, by its name; bounds hold those without an
    impact at zero."""
    return block(
        "lam",
        (len(at),),
        lambda i: f"impulse of {at[i]}",
        lambda s: sizes_of(s.lam, touch.surfaces),
    )


def velocities(block: Numbering, names: Sequence[str], at: Sequence[str]) -> tuple[Block, Block]:
    """The blocks of velocities before and after each event, by names of velocities and events."""
    shape = len(at), len(names)
    return (
        block("v_a", shape, lambda k, i: f"{names[i]} before {at[k]}", lambda s: s.v),
        block("v_c", shape, lambda k, i: f"{names[i]} after {at[k]}", lambda s: s.v),
    )


def names_of_events(sequence: Sequence[str], switches: Sequence[str]) -> list[str]:
    """Names of the events of a sequence in the user's words; some of these are switches."""

    return [f"{noun_of([s], switches)} {i + 1} ({s})" for i, s in enumerate(sequence)]
