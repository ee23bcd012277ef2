"""The stages of impacts with friction, by numbers.

An impact has moments at which something changes: compression ends (``END``), sliding stops
(``STOP``).  Between them, and before and after, are its stages, in each of which the contact slides
in one direction or sticks.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dmoc.base.records import record, value_class
from dmoc.mechanics.contact_mode import FREE, Course, Event, Mode
from dmoc.mechanics.contacts import NOWHERE
from dmoc.mechanics.touch import Touch
from dmoc.motion.friction import STICK, sticks
from dmoc.motion.impact_laws import IMPACT_LAWS, POISSON, ImpactLaw
from dmoc.program.blocks import Bools, Index, Numbering

# Moments within an impact.
END, STOP = 0, 1
MOMENTS = ("where compression ends", "where sliding stops")
# Stages that an impact has at most.
STAGES = 3


@value_class(frozen=True)
class Passage:
    """The way through the impact of one event.

    Attributes
    ----------
    event, surface : int
    tangents : tuple of int
        The directions of its tangent, one or two.
    lands : bool
        The contact stays closed: there is no restitution.
    moments : tuple of int
        In their order.
    friction : tuple of int
        Of each stage: a direction of sliding, or 0; one more than moments.
    holding : Mode
        What else is closed during the impact, and its friction.
    law : str
        That of the impact (:mod:`dmoc.motion.impact_laws`).  Where it is one of whole hits, the
        moment is that of the hit that stops all at once, and the last stage the whole impact; the
        law of a ball has no moment.
    """

    event: int
    surface: int
    tangents: tuple[int, ...]
    lands: bool
    moments: tuple[int, ...]
    friction: tuple[int, ...]
    holding: Mode = FREE
    law: str = POISSON

    @property
    def tangent(self) -> int:
        return self.tangents[0]

    @property
    def whole(self) -> bool:
        """Whether the hit has no stages by its law."""
        return IMPACT_LAWS[self.law].whole

    @property
    def late(self) -> bool:
        """Whether sliding stops during restitution."""
        return self.moments == (END, STOP)

    @property
    def rests(self) -> tuple[int, ...]:
        """Moments at which nothing slides."""
        until = zip(self.moments, self.friction, strict=False)
        return tuple(m for m, before in until if m == STOP or sticks(before))

    def bears(self, e: float) -> int | None:
        """The stage whose friction must be within its cone for all that stick: while a contact
        sticks, both impulses grow in one proportion.  It is the last one, but for a restitution
        without an impulse."""
        stage = len(self.moments)
        if not self.lands and not self.late and e == 0:
            stage -= 1
        return stage if sticks(self.friction[stage]) else None

    def shares(self, e: float) -> tuple[int, ...]:
        """Stages whose normal impulse could be negative by the other laws: not the first one, not a
        whole restitution, and not where the cone says more."""
        last = len(self.moments)
        by_law = not self.lands and not self.late
        return tuple(
            k for k in range(1, last + 1) if k != self.bears(e) and not (by_law and k == last)
        )


def moment(event: int, which: int) -> str:
    """A moment within an impact in words."""
    return f"{MOMENTS[which]} at event {event + 1}"


@record(frozen=True, eq=False)
class HitUnknowns:
    """Velocities v_h, shape (events, moments, nq), and impulses P_h and T_h until then, shape
    (events, moments), at the moments within impacts with friction.

    ``passages`` are the ways through those of them that have a course, ``hit`` and ``rubbed`` the
    surface and the tangent of each event, 0 where it has none.
    """

    passages: tuple[Passage, ...]
    hit: Index
    rubbed: Index
    moments: Bools
    v_h: Index
    P_h: Index
    T_h: Index

    @classmethod
    def of(cls, block: Numbering, touch: Touch, velocities: Sequence[str]) -> HitUnknowns:
        """The unknowns of a motion, with the names of its velocities."""
        passages, names = passages_of(touch), touch.contacts
        hit, rubbed = (np.zeros(len(touch.events), dtype=np.intp) for _ in range(2))
        moments = np.zeros((len(touch.events), len(MOMENTS)), dtype=bool)
        for p in passages:
            hit[p.event], rubbed[p.event] = p.surface, p.tangent
            moments[p.event, list(p.moments)] = True
        blocks = (
            block(
                "v_h",
                np.repeat(moments[:, :, None], len(velocities), axis=2),
                lambda i, m, j: f"{velocities[j]} {moment(i, m)}",
                lambda s: s.v,
            ),
            block(
                "P_h",
                moments,
                lambda i, m: f"impulse of {names.surfaces[hit[i]]} {moment(i, m)}",
                lambda s: s.lam[hit][:, None],
            ),
            block(
                "T_h",
                moments,
                lambda i, m: f"friction impulse of {names.tangents[rubbed[i]]} {moment(i, m)}",
                lambda s: s.friction[rubbed][:, None],
            ),
        )
        return cls(passages, hit, rubbed, moments, *(b.index for b in blocks))


@record(frozen=True, eq=False)
class HeldUnknowns:
    """Impulses of what holds until the moments within impacts with friction: of closed contacts
    P_b, of their friction T_b and of constraints R_b, shapes (events, moments, ...)."""

    P_b: Index
    T_b: Index
    R_b: Index

    @classmethod
    def of(
        cls, block: Numbering, touch: Touch, moments: Bools, joints: Sequence[str]
    ) -> HeldUnknowns:
        names, within = touch.contacts, moments[:, :, None]
        beside = touch.beside & within.any(axis=1)
        blocks = (
            block(
                "P_b",
                within & beside[:, None],
                lambda i, m, j: f"impulse of {names.surfaces[j]} {moment(i, m)}",
                lambda s: s.lam,
            ),
            block(
                "T_b",
                within & touch.drags[:, None],
                lambda i, m, k: f"friction impulse of {names.tangents[k]} {moment(i, m)}",
                lambda s: s.friction,
            ),
            block(
                "R_b",
                np.repeat(within, len(joints), axis=2),
                lambda i, m, j: f"impulse of constraint {joints[j]} {moment(i, m)}",
                lambda s: s.reaction,
            ),
        )
        return cls(*(b.index for b in blocks))


def passages_of(touch: Touch) -> tuple[Passage, ...]:
    """The ways through the impacts with friction of a motion that have a course: hits, and
    landings during which sliding stops."""
    return tuple(
        Passage(
            i, event.surface, touch.contacts.tangents_of(event.surface), bool(event.lands),
            *_stages(course, bool(event.lands), IMPACT_LAWS[law]), _holding(touch, i), law,
        )
        for i, (event, course) in enumerate(zip(touch.events, touch.courses, strict=True))
        if course is not None
        for law in (_law_of(touch, event),)
    )  # fmt: skip


def _law_of(touch: Touch, event: Event) -> str:
    """The impact law of an event's hit; a landing is compression alone, any law that has stages."""
    if event.hit == NOWHERE:
        return POISSON
    return touch.contacts.impact_law(touch.contacts.surfaces[event.hit])


def _holding(touch: Touch, event: int) -> Mode:
    """The mode during an impact: contacts that stay closed beside the hit, and their friction."""
    beside = np.flatnonzero(touch.beside[event]).tolist()
    return touch.modes[event + 1].among(beside, lambda k: bool(touch.drags[event, k]))


def _stages(course: Course, lands: bool, law: ImpactLaw) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Moments and friction of the stages of a course."""
    if law.in_space:
        return (), (course.first,)
    if law.whole:
        return (END,), (STICK, course.first)
    moments, friction = [END], [course.first, course.first]
    if course.then is not None:
        moments = [END, STOP] if course.late else [STOP, END]
        friction = [course.first, course.first if course.late else course.then, course.then]
    if lands:  # compression alone, which ends with the impact
        moments.remove(END)
        friction.pop()
    return tuple(moments), tuple(friction)
