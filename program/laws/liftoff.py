"""The law of lift-offs that no input decides.

Before an event at which contacts leave without an impact, at its place with the velocity and the
inputs there, stand accelerations and forces y = (a | N | T | R)
(:mod:`dmoc.program.liftoffs`, equation :eq:`lift-off`)::

    forces     the equations of forces (:mod:`dmoc.program.laws.force`) of the mode that ends
    vanishes   sum N = 0 of the contacts that leave

Several of them leave at once only where their forces vanish at once, so that the sum is enough.
Impulses of these contacts at their last station may pull, and gaps in the step that follows may
close: both vanish with a power of the step, and their signs are those of its error.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.program.blocks import LAW, NOWHERE, Block, Bools, Entries, Index, Missed, Numbering
from dmoc.program.laws.force import by_kernel, signs_of, sizes_of_equations
from dmoc.program.laws.law import INPUT, Law, Pivot, key
from dmoc.program.layout import Layout
from dmoc.program.terms import Places, Term

if TYPE_CHECKING:
    from dmoc.program.laws.laws import Laws


@dataclass(eq=False, repr=False)
class LiftoffLaw(Law):
    """Contacts that leave where they do not press; without rows where there are none.

    Attributes
    ----------
    lay : Layout
    pulling : bool
        Closed contacts may pull, also where they leave.
    """

    lay: Layout
    pulling: bool
    forces: Block = field(init=False)
    vanishes: Block = field(init=False)

    @cached_property
    def _leaving(self) -> Bools:
        """Surfaces that leave at each event, shape (events, nc)."""
        touch = self.lay.touch
        leaving = np.zeros((len(touch.events), len(touch.contacts.surfaces)), dtype=bool)
        for one in self.lay.liftoff.of:
            leaving[one.event, list(one.surfaces)] = True
        return leaving

    @cached_property
    def _signs(self) -> Array:
        """Directions of sliding at each row of y, shape (events, ny)."""
        return signs_of(self.lay, self._y.shape[1])[:-1]

    @property
    def _y(self) -> Index:
        return self.lay.liftoff.y_lift_off

    def equations(self, block: Numbering) -> None:
        if not self.lay.liftoff.of:
            return
        leaving, surfaces = self._leaving, np.array(self.lay.touch.contacts.surfaces)
        names = [", ".join(surfaces[row]) for row in leaving]
        self.forces = block(
            "force before lift-off",
            self._y != NOWHERE,
            lambda i, j: f"equation {j} of forces before event {i + 1}",
            lambda s: sizes_of_equations(s, self._signs),
            missed=Missed(LAW, lambda *_: "forces do not fit the motion"),
        )
        self.vanishes = block(
            "lift-off",
            np.asarray(leaving.any(axis=1) & (not self.pulling)),
            lambda i: f"normal force of {names[i]} at event {i + 1}",
            lambda s: np.where(leaving, s.lam, 0.0).max(axis=1) / s.time,
            missed=Missed(
                words=lambda i: f"the normal force of {names[i]} misses zero at event {i + 1}",
                unit=lambda _: "N",
                apart=0,
            ),
        )

    def terms(self, places: Places, laws: Laws) -> list[Term]:
        lay, events = self.lay, [one.event for one in self.lay.liftoff.of]
        if not events:
            return []
        nodes, y = lay.collision_nodes[events], places.or_zero(self._y[events])
        u = lay.index_u[lay.row_u_kp1[nodes - 1]]
        state = lay.index_q[nodes], lay.impact.v_a[events], u, places.times(nodes), y
        rows = by_kernel(lay, self._signs, self.forces.index)[events]
        return [Term("forces_point", state, (rows,))]

    def entries(self, laws: Laws) -> list[Entries]:
        if not self.lay.liftoff.of or self.pulling:
            return []
        events, surfaces = np.nonzero(self._leaving)
        N = self._y[events, self.lay.nq + surfaces]
        return [(self.vanishes.index[events], N, np.ones(len(N)))]

    def pivots(self, laws: Laws) -> Iterator[Pivot]:
        """Each equation determines the force of its own place."""
        if self.lay.liftoff.of:
            yield Pivot(self._y, self.forces.index, key(self.lay.collision_nodes - 1, INPUT))
