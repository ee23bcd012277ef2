"""Who touches whom along a motion: the modes of its phases and the events between them, also as
masks, with a row for each phase or event and a column for each surface or tangent."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dmoc.base.records import value_class
from dmoc.codegen.kernels import Array
from dmoc.mechanics.contact_mode import Course, Event, Mode
from dmoc.mechanics.contacts import NOWHERE, RAIL, Contacts
from dmoc.motion.friction import STICK

Bools = NDArray[np.bool_]


@value_class(frozen=True)
class Open:
    """What no word says: surfaces that may be closed and tangents that may rub at any time, and
    surfaces that are closed at the start.  The hits of events are left open too: they may be
    none."""

    surfaces: tuple[int, ...] = ()
    tangents: tuple[int, ...] = ()
    closed: tuple[int, ...] = ()


@value_class(frozen=True)
class Touch:
    """The modes of the phases of a motion, and the events between them; what is left open in all of
    them, of a relaxed program."""

    contacts: Contacts
    modes: tuple[Mode, ...]
    events: tuple[Event, ...]
    open: Open | None = None

    @cached_property
    def free(self) -> bool:
        """Whether no contact lasts."""
        return all(mode.free for mode in self.modes)

    # Phases ---------------------------------------------------------------------------------------

    @cached_property
    def is_closed(self) -> Bools:
        """Surfaces that are closed in each phase, shape (phases, nc)."""
        closed = np.zeros((len(self.modes), len(self.contacts.surfaces)), dtype=bool)
        for i, mode in enumerate(self.modes):
            closed[i, list(mode.closed)] = True
        return closed

    @cached_property
    def rubs(self) -> Bools:
        """Tangents that rub in each phase, shape (phases, nt)."""
        rubs = np.asarray(self.signs != 0)
        for i, mode in enumerate(self.modes):
            rubs[i, list(mode.sticking)] = True
        return rubs

    @cached_property
    def signs(self) -> Array:
        """Directions of sliding, 0 for what sticks or does not rub, shape (phases, nt)."""
        signs = np.zeros((len(self.modes), len(self.contacts.tangents)))
        for i, mode in enumerate(self.modes):
            for k, sign in mode.sliding:
                signs[i, k] = sign
        return signs

    @cached_property
    def sticks(self) -> Bools:
        """Tangents that stick in each phase, shape (phases, nt)."""
        return np.asarray(self.rubs & (self.signs == STICK))

    @cached_property
    def slides(self) -> Bools:
        """Tangents that slide in each phase, shape (phases, nt)."""
        return np.asarray(self.rubs & ~self.sticks)

    def astray(self, phase: int, rates: Array) -> Array:
        """Distances (..., nt) of sliding velocities (..., nt) from those of a phase: speeds of
        tangents that do not slide, and speeds against the direction of those that do."""
        back = -self.signs[phase] * rates
        return np.asarray(np.where(self.slides[phase], back, np.abs(rates)))

    # Events ---------------------------------------------------------------------------------------

    @cached_property
    def surfaces(self) -> NDArray[np.intp]:
        """The surface of each event, NOWHERE of one without an impact, shape (events,)."""
        return np.array([event.surface for event in self.events], dtype=np.intp)

    @cached_property
    def switches(self) -> NDArray[np.intp]:
        """The crossing function of each event, NOWHERE of another one, shape (events,)."""
        return np.array([event.switch for event in self.events], dtype=np.intp)

    @cached_property
    def impacts(self) -> Bools:
        """Events at which something is hit or lands, shape (events,)."""
        return np.asarray(self.surfaces != NOWHERE)

    @cached_property
    def courses(self) -> tuple[Course | None, ...]:
        """Course of friction in the impact of each event: the one of its word, and sticking in hits
        whose tangential impulse nothing limits; None for others."""
        free = self.contacts.frictionless if self.open is None else ()
        return tuple(
            Course(STICK)
            if event.hit != NOWHERE and self.contacts.surfaces[event.hit] in free
            else event.course
            for event in self.events
        )

    @cached_property
    def beside(self) -> Bools:
        """Surfaces that take an impulse beside the first one in an impact: those that stay closed,
        and those that land with it, shape (events, nc)."""
        beside = self.is_closed[:-1] & self.is_closed[1:] & self.impacts[:, None]
        for i, event in enumerate(self.events):
            beside[i, list(event.lands[1:])] = True
        return beside

    @cached_property
    def rubs_in_impact(self) -> Bools:
        """Tangents of closed surfaces that take a tangential impulse by the law of contacts that
        last, shape (events, nt)."""
        at_surfaces = np.array(self.contacts.supports, dtype=np.intp) != RAIL
        return np.asarray(self.rubs[1:] & at_surfaces & self.impacts[:, None] & ~self.passes)

    @cached_property
    def drags(self) -> Bools:
        """Tangents of ``rubs_in_impact`` that have friction, shape (events, nt)."""
        rough = np.array(
            [name in self.contacts.rough for name in self.contacts.tangents], dtype=bool
        )
        return np.asarray(self.rubs_in_impact & rough)

    @cached_property
    def grips(self) -> Bools:
        """Tangents of ``drags`` that stick after the impact, shape (events, nt)."""
        return np.asarray(self.drags & self.sticks[1:])

    @cached_property
    def turns(self) -> Bools:
        """Tangents of closed surfaces that slide in the other direction after an impact, shape
        (events, nt)."""
        return np.asarray(self.rubs_in_impact & (self.signs[:-1] * self.signs[1:] < 0))

    @cached_property
    def stops(self) -> Bools:
        """Tangents that slide in a phase, and after its event, which is no impact, no longer in
        this direction, shape (phases, nt)."""
        stops = np.zeros_like(self.rubs)
        slid, goes_on = self.signs[:-1] != 0, self.rubs[1:]
        turned = self.signs[1:] != self.signs[:-1]
        stops[:-1] = slid & goes_on & turned & ~self.impacts[:, None]
        return stops

    @cached_property
    def passes(self) -> Bools:
        """Tangents that rub in an impact with a course, shape (events, nt)."""
        passes = np.zeros((len(self.events), len(self.contacts.tangents)), dtype=bool)
        for i, event in enumerate(self.events):
            if self.courses[i] is not None:
                passes[i, list(self.contacts.tangents_of(event.surface))] = True
        return passes


def friction_changes(before: Mode, after: Mode) -> dict[int, int]:
    """Friction of the tangents that rub otherwise in the later mode."""
    return {k: s for k, s in after.rubbing.items() if before.rubbing.get(k) != s}
