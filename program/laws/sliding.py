"""The directions in which contacts and rails slide: their rows and terms.

What slides in a phase does so in its direction s = 1 or -1 from event to event::

    direction  s (tau(q_kp1) - tau(q_k)) >= 0, s sigma >= 0 on both sides of an impact,
               at the ends of the motion, and at nodes whose velocities are unknowns

A contact that slides the other way after an impact than before has s of either phase on either
side.  Where the impact presses it, P_c > 0, its friction turns at a moment within, which these rows
do not know: the check refuses such a motion.

Places are measured by how far the contact could move in one step.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from dmoc.motion.friction import friction_word
from dmoc.program.blocks import NOWHERE, Block, Bools, Counted, Index, Numbering, two_sided
from dmoc.program.bound_kinds import BoundKind
from dmoc.program.laws.contact import LawAtContacts
from dmoc.program.laws.impact import ends_motion
from dmoc.program.layout import Layout
from dmoc.program.terms import Places, Term, forward

if TYPE_CHECKING:
    from dmoc.program.laws.laws import Laws


@dataclass(eq=False, repr=False)
class SlidingLaw(LawAtContacts):
    """Law of the direction of tangents that slide along phases, at the contacts of the law
    ``contact``."""

    in_steps: Block = field(init=False)
    at_nodes: Block = field(init=False)
    at_ends: Block = field(init=False)
    in_impacts: Block = field(init=False)

    # Rows -----------------------------------------------------------------------------------------

    def inequalities(self, block: Numbering) -> None:
        """Number the rows; the last axis of ``in_impacts`` are the two sides of an impact."""
        lay, touch = self.lay, self.touch
        names = touch.contacts.tangents
        slides = touch.slides[lay.phase_of_step]
        slides = slides if not touch.free else slides[:0]
        steps = np.arange(len(slides))

        def word(i: int, j: int) -> str:
            return friction_word(touch.modes[i].rubbing[j])

        self.in_steps = block(
            "direction",
            slides,
            lambda k, j: f"{word(int(lay.phase_of_step[k]), j)} of {names[j]} in step {k}",
            lambda s: s.slide * s.h[lay.phase_of_step][: len(slides), None],
            steps,
            counted=Counted(BoundKind.DIRECTION, names, steps),
        )
        passing = np.vstack([slides, slides[-1:]]) & (lay.index_w[: len(slides) + 1, :1] != NOWHERE)
        passed = np.arange(len(passing))
        self.at_nodes = block(
            "direction at nodes",
            passing,
            lambda k, j: f"{word(int(lay.phase_of_step[k]), j)} of {names[j]} at node {k}",
            lambda s: s.slide,
            passed,
            counted=Counted(BoundKind.DIRECTION, names, passed),
        )
        self.at_ends = block(
            "direction at the ends",
            self._slides_freely,
            lambda e, j: f"{word(-e, j)} of {names[j]} at the {('start', 'end')[e]}",
            lambda s: s.slide,
        )
        self.in_impacts = block(
            "direction of an impact",
            two_sided(touch.rubs_in_impact & ~touch.sticks[1:]),
            lambda i, j, side: (
                f"{word(i + (1 if side or not touch.turns[i, j] else 0), j)} of {names[j]} "
                f"{'after' if side else 'before'} event {i + 1}"
            ),
            lambda s: s.slide[:, None],
        )

    @property
    def _slides_freely(self) -> Bools:
        """Tangents that slide at the start and at the end of the motion, and whose rates there are
        not fixed, shape (2, nt)."""
        lay = self.lay
        unknown = np.array([len(lay.index_v_B) > 0, len(lay.index_v_E) > 0]) & (not lay.touch.free)
        slides = self.touch.slides[[0, -1]] & ~self.contact.settled.slides
        for i in np.flatnonzero(ends_motion(lay)):
            slides[-1] &= ~(self.touch.rubs_in_impact[i] | self.touch.passes[i])  # said there
        return np.asarray(slides & unknown[:, None])

    # Terms ----------------------------------------------------------------------------------------

    def terms(self, places: Places, laws: Laws) -> list[Term]:
        if self.touch.free:
            return []
        return [
            *self._rates_in_impacts(places),
            *self._rates_at_ends(places),
            *self._rates_at_nodes(places),
            *self._ways(places),
        ]

    def _rates_in_impacts(self, places: Places) -> Iterator[Term]:
        """Sliding velocities before and after impacts."""
        lay, touch, nodes = self.lay, self.touch, self.lay.collision_nodes
        if not len(nodes):
            return
        before = np.where(touch.turns, touch.signs[:-1], touch.signs[1:])
        rows = np.moveaxis(self.in_impacts.index, -1, 0)
        yield from forward(lay, nodes, lay.impact.v_a, before, rows[0], places)
        yield from forward_after(lay, lay.impact.v_c, rows[1], places)

    def _rates_at_ends(self, places: Places) -> Iterator[Term]:
        """Sliding velocities at both ends of the motion."""
        lay, signs, rows = self.lay, self.touch.signs, self.at_ends.index
        for e, v in ((0, lay.index_v_B), (-1, lay.index_v_E)):
            if len(v):
                yield from forward(lay, lay.ends[[e]], v[None], signs[[e]], rows[[e]], places)

    def _rates_at_nodes(self, places: Places) -> Iterator[Term]:
        """Sliding velocities at the nodes inside phases."""
        lay, rows = self.lay, self.at_nodes.index
        signs = self.touch.signs[np.append(lay.phase_of_step, lay.phases - 1)]
        return forward(lay, np.arange(len(rows)), lay.index_w, signs, rows, places)

    def _ways(self, places: Places) -> Iterator[Term]:
        """Differences of the tangential positions at both ends of steps, in the direction of
        sliding."""
        lay, rows = self.lay, self.in_steps.index
        signs = self.touch.signs[lay.phase_of_step]
        for sign in (1.0, -1.0):
            at = np.where(signs == sign, rows, NOWHERE)
            for nodes, side in ((np.arange(1, lay.total + 1), sign), (np.arange(lay.total), -sign)):
                place = (lay.index_q[nodes], places.times(nodes))
                yield Term("tangent", place, (at,), side)


def forward_after(lay: Layout, v: Index, rows: Index, places: Places) -> Iterator[Term]:
    """Sliding velocities in impacts, in the direction of after, of the velocities of unknowns v
    (events, nq) in rows (events, nt)."""
    return forward(lay, lay.collision_nodes, v, lay.touch.signs[1:], rows, places)
