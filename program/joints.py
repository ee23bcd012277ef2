"""The unknown impulses of constraints phi(q, t) = 0 that hold in every phase."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from dmoc.base.records import record
from dmoc.mechanics.conditions import JOINTS
from dmoc.program.blocks import Bools, Index, Numbering
from dmoc.program.reactions import (
    EventImpulses,
    PhaseReaction,
    event_impulses,
)
from dmoc.program.stations import Stations


@record(frozen=True, eq=False)
class JointUnknowns:
    """Impulses R, shape (stations, nj), and those of impacts R_c, shape (events, nj)."""

    stations: Stations
    names: tuple[str, ...]
    R: Index
    R_c: Index

    @classmethod
    def of(
        cls, block: Numbering, stations: Stations, names: tuple[str, ...], impacts: Bools
    ) -> JointUnknowns:
        rows, count = len(stations.phase) if names else 0, sum(stations.steps)
        impulses = block(
            "R",
            (rows, len(names)),
            lambda r, j: f"impulse of constraint {names[j]} {stations.label(r)}",
            lambda s: s.reaction / count * stations.size,
        )
        of_impacts = block(
            "R_c",
            np.repeat(impacts[:, None], len(names), axis=1),
            lambda i, j: f"impulse of constraint {names[j]} at event {i + 1}",
            lambda s: s.reaction,
        )
        return cls(stations, names, impulses.index, of_impacts.index)

    def impulses(self, i: int) -> Iterator[EventImpulses]:
        """Impulses of all constraints at event i."""
        yield event_impulses("reaction", self.names, self.R_c[i], pulls=True)

    def reactions(self, i: int) -> Iterator[PhaseReaction]:
        """Impulses of all constraints in phase i."""
        if self.names:
            every, holds = tuple(range(len(self.names))), np.ones(len(self.names), dtype=bool)
            rows = self.R[self.stations.rows(i)]
            yield PhaseReaction(JOINTS, self.names, every, rows, holds, holds, holds)
