"""Surfaces that have ends: where they are hit, where contacts with them last, and where these slip
off.

With W(q, t) >= 0 where a surface is, and omega its rate (equation :eq:`ends-of-surfaces` of the
theory)::

    within      W(q_k) >= 0               at the nodes of phases in which it is closed
                W(q_c) >= 0               where it is hit or lands
    end         W(q_c) = 0                where a contact slips off
    outwards    -omega(q_c, v+) >= 0      there

Elsewhere the gap is not bounded: the rows of :mod:`dmoc.program.laws.step` have B <= 0 instead, or
W <= 0 where the contact has slipped off before.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.mechanics.contacts import NOWHERE
from dmoc.problem.design import by_design
from dmoc.problem.problem import Problem
from dmoc.program.blocks import Block, Bools, Missed, Numbering
from dmoc.program.laws.law import Law
from dmoc.program.layout import Layout
from dmoc.program.terms import Places, Term

if TYPE_CHECKING:
    from dmoc.program.laws.laws import Laws


@dataclass(eq=False, repr=False)
class SurfaceEndsLaw(Law):
    """The ends of the surfaces of a problem; without rows where there are none."""

    problem: Problem
    lay: Layout
    stands: Bools = field(init=False)
    within: Block = field(init=False)
    end: Block = field(init=False)
    outwards: Block = field(init=False)

    def settle(self, problem: Problem, limits: tuple[Array, Array]) -> None:
        free = limits[0] != limits[1]
        self.stands = self._stands([free[self.lay.index_q[node]] for node in (0, -1)])

    def _stands(self, free: list[Bools]) -> Bools:
        """Nodes at which a surface has to be there, shape (nodes, nc); ``free`` tells which
        coordinates of the first and of the last one are not fixed: where all are, the start was
        checked, and the goal is beyond an end or not."""
        lay, model = self.lay, self.problem.model
        there = np.zeros((lay.total + 1, model.nc), dtype=bool)
        for i, mode in enumerate(lay.touch.modes):
            there[lay.ends[i] : lay.ends[i + 1] + 1, list(mode.closed)] = True
        for node, event in zip(lay.collision_nodes, lay.touch.events, strict=True):
            there[node, [event.hit] if event.hit != NOWHERE else []] = True
        for node, event in zip(lay.collision_nodes, lay.touch.events, strict=True):
            there[node, list(event.off)] = False
        chosen = by_design(self.problem, "within") if model.ends else ()
        beyond = np.zeros(model.nc, dtype=bool), model.within(self.problem.goal_position) < 0
        for j in range(model.nc):
            on = model.ends.get(j, [])
            there[:, j] &= j in model.ends
            for node, open_there, off in zip((0, -1), free, beyond, strict=True):
                moves = bool(on and (chosen[j] or open_there[on].any() or j in model.moving))
                there[node, j] &= moves or off[j]
        return there

    @property
    def _off(self) -> Bools:
        """Surfaces off which contacts slip at each event, shape (events, nc)."""
        off = np.zeros((len(self.lay.touch.events), self.problem.model.nc), dtype=bool)
        for i, event in enumerate(self.lay.touch.events):
            off[i, list(event.off)] = True
        return off

    def equations(self, block: Numbering) -> None:
        if not self.problem.model.ends:
            return
        names = self.problem.kernels.surfaces
        self.end = block(
            "end of a surface",
            self._off,
            lambda i, j: f"end of {names[j]} at event {i + 1}",
            lambda s: s.within,
            missed=Missed(
                words=lambda i, j: f"event {i + 1} ({self.problem.sequence[i]}) {self._misses(j)}",
                apart=0,
            ),
        )

    def _misses(self, surface: int) -> str:
        """The end that is not reached, in words."""
        names = self.problem.kernels.coordinates
        on = ", ".join(names[i] for i in self.problem.model.ends[surface])
        return (
            f"misses the ends of {self.problem.kernels.surfaces[surface]!r}, which depend on {on}"
        )

    def inequalities(self, block: Numbering) -> None:
        if not self.problem.model.ends:
            return
        names, nodes = self.problem.kernels.surfaces, np.arange(self.lay.total + 1)
        self.within = block(
            "within ends",
            self.stands,
            lambda k, j: f"{names[j]} at node {k}",
            lambda s: s.within,
            nodes,
            missed=Missed(
                words=lambda k, j: f"{names[j]} is touched beyond its end at node {k}", apart=1
            ),
        )
        self.outwards = block(
            "outwards",
            self._off,
            lambda i, j: f"way off {names[j]} at event {i + 1}",
            lambda s: s.within_rate,
            self.lay.collision_nodes,
        )

    def terms(self, places: Places, laws: Laws) -> list[Term]:
        if not self.problem.model.ends:
            return []
        lay, nodes = self.lay, self.lay.collision_nodes
        (k,) = np.nonzero(self.stands.any(axis=1))
        terms = [Term("within", (lay.index_q[k], places.times(k)), (self.within.index[k],))]
        if len(nodes):
            q, t = lay.index_q[nodes], places.times(nodes)
            terms += [
                Term("within", (q, t), (self.end.index,)),
                Term("within_rate", (q, lay.impact.v_c, t), (self.outwards.index,), -1.0),
            ]
        return [term for term in terms if term.enters]
