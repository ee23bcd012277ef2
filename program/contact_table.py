"""The unknown impulses of contacts that last."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from dmoc.base.records import record
from dmoc.mechanics.conditions import GAPS, TANGENTS
from dmoc.mechanics.contact_mode import names_of
from dmoc.mechanics.touch import Touch
from dmoc.program.blocks import Index, Numbering
from dmoc.program.reactions import (
    EventImpulses,
    PhaseReaction,
    event_impulses,
)
from dmoc.program.stations import Stations


@record(frozen=True, eq=False)
class ContactUnknowns:
    """Impulses of the contacts of a touch.

    Attributes
    ----------
    P, T : arrays of int, shapes (stations, nc) and (stations, nt)
        Normal and tangential impulses; of a touch where no contact lasts without rows.
    P_c, T_c : arrays of int, shapes (events, nc) and (events, nt)
        Those that closed contacts take in an impact beside lam, T_c also that of a hit with
        friction.
    """

    stations: Stations
    touch: Touch
    P: Index
    T: Index
    P_c: Index
    T_c: Index

    @classmethod
    def of(cls, block: Numbering, stations: Stations, touch: Touch) -> ContactUnknowns:
        phase = stations.phase[: 0 if touch.free else None]
        count, names = sum(stations.steps), touch.contacts
        blocks = (
            block(
                "P",
                touch.is_closed[phase],
                lambda r, j: f"contact impulse of {names.surfaces[j]} {stations.label(r)}",
                lambda s: s.lam / count * stations.size[: len(phase)],
            ),
            block(
                "T",
                touch.rubs[phase],
                lambda r, j: f"friction impulse of {names.tangents[j]} {stations.label(r)}",
                lambda s: s.friction / count * stations.size[: len(phase)],
            ),
            block(
                "P_c",
                touch.beside,
                lambda i, j: f"impulse of {names.surfaces[j]} at event {i + 1}",
                lambda s: s.lam,
            ),
            block(
                "T_c",
                touch.rubs_in_impact | touch.passes,
                lambda i, j: f"friction impulse of {names.tangents[j]} at event {i + 1}",
                lambda s: s.friction,
            ),
        )
        return cls(stations, touch, *(b.index for b in blocks))

    def reactions(self, i: int) -> Iterator[PhaseReaction]:
        """Impulses of phase i: of its closed contacts, and of its tangents that rub."""
        mode, rows = self.touch.modes[i], self.stations.rows(i)
        closed, rubbing = names_of(self.touch.contacts, mode)
        if closed:
            index, holds = self.P[rows][:, list(mode.closed)], np.ones(len(closed), dtype=bool)
            on, floating = list(mode.closed), self.touch.contacts.floating
            pulls, in_place = self.touch.contacts.pull[on], ~np.isin(on, floating)
            yield PhaseReaction(GAPS, closed, mode.closed, index, holds, pulls, in_place)
        if rubbing:
            columns = tuple(mode.rubbing)
            sticks = np.isin(columns, mode.sticking)
            index = self.T[rows][:, list(columns)]
            every, of_rates = np.ones_like(sticks), ~self.touch.contacts.in_place[list(columns)]
            yield PhaseReaction(TANGENTS, tuple(rubbing), columns, index, sticks, every, of_rates)

    def impulses(self, i: int) -> Iterator[EventImpulses]:
        """Impulses at event i beside lam: of other contacts, and of friction."""
        names = self.touch.contacts
        yield event_impulses("normal", names.surfaces, self.P_c[i], pulls=False)
        yield event_impulses("tangential", names.tangents, self.T_c[i], pulls=True)
