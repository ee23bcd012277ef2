"""The law of switches: events where a crossing function w(q, v, t) of the model vanishes while it
grows (equation :eq:`switch` of the theory)::

    crossing    w(q_c, v_a, t_c) = 0
    rising      dw/dt >= 0             with the acceleration of the last step before

Momenta and contacts go on: what an event without an impact has is in
:mod:`dmoc.program.laws.impact`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from dmoc.program.blocks import (
    NOWHERE,
    Block,
    Bools,
    Index,
    Missed,
    Numbering,
    in_columns,
    sizes_of,
)
from dmoc.program.laws.law import COLLISION, Law, Pivot, key
from dmoc.program.layout import Layout
from dmoc.program.terms import Places, Term

if TYPE_CHECKING:
    from dmoc.program.laws.laws import Laws


@dataclass(eq=False, repr=False)
class CrossingLaw(Law):
    """Switches of a sequence; without rows where there are none.

    Attributes
    ----------
    lay : Layout
    count : int
        The number of crossing functions.
    """

    lay: Layout
    count: int
    crossing: Block = field(init=False)
    rising: Block = field(init=False)

    @property
    def _switches(self) -> Index:
        """The switch of each event, shape (events,), NOWHERE of another one."""
        return self.lay.touch.switches

    @property
    def _there(self) -> Bools:
        return np.asarray(self._switches != NOWHERE)

    def equations(self, block: Numbering) -> None:
        if not self._there.any():
            return
        names = self.lay.impact.names
        self.crossing = block(
            "crossing",
            self._there,
            lambda k: f"switch at {names[k]}",
            lambda s: sizes_of(s.crossing, self._switches),
            missed=Missed(words=lambda k: f"{names[k]} misses its switch", apart=0),
        )

    def inequalities(self, block: Numbering) -> None:
        if not self._there.any():
            return
        names = self.lay.impact.names
        self.rising = block(
            "rising",
            self._there,
            lambda k: f"growth of the switch at {names[k]}",
            lambda s: sizes_of(s.crossing, self._switches) / s.time,
            self.lay.collision_nodes,
            missed=Missed(words=lambda k: f"the switch of {names[k]} falls there", apart=0),
        )

    def terms(self, places: Places, laws: Laws) -> list[Term]:
        events = np.flatnonzero(self._there)
        if not len(events):
            return []
        lay, nodes, which = self.lay, self.lay.collision_nodes[events], self._switches[events]
        q, v, t = lay.index_q[nodes], lay.impact.v_a[events], places.times(nodes)
        step = lay.index_q[nodes - 1], q, v, lay.index_h[lay.phase_of_step[nodes - 1]][:, None], t
        zero, rate = (
            in_columns(rows.index[events], which, self.count, NOWHERE)
            for rows in (self.crossing, self.rising)
        )
        return [Term("crossing", (q, v, t), (zero,)), Term("crossing_rate", step, (rate,))]

    def pivots(self, laws: Laws) -> Iterator[Pivot]:
        """A switch determines the step size of the phase that ends with it."""
        events = np.flatnonzero(self._there)
        if len(events):
            before = key(self.lay.collision_nodes[events] - 1, COLLISION)
            yield Pivot(self.lay.index_h[events], self.crossing.index[events], before)
