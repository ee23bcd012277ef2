"""Contacts that last: their rows and terms.

A phase with closed contacts has normal impulses P_k >= 0 at each of its nodes, the ends among them,
and velocities v- before and v+ after its events (equations :eq:`del-contact` to :eq:`events` of the
theory), but at the last one before a lift-off whose force says when
(:mod:`dmoc.program.laws.liftoff`); what rubs at them is the law of friction
(:mod:`dmoc.program.laws.friction`)::

    momentum   ... - sum P_k grad g(q_k) = 0      also of arrival, departure
    closed     g(q_k) = 0                         at the nodes after the first one
               g(q_k) - g(q_km1) = 0              of what closes wherever it is
    at rest    gamma(q_N, v-) = 0                 at the end of the phase
    lands      g(q_c) = 0                         of what lands beside the first one
    stays      gamma(q_c, v+) = 0                 after an impact, with impulses P_c
    opens      -gamma(q_c, v+) >= 0               of what leaves with an event that ends the motion

Of grips P_k has both signs; they open whatever it is.

This is the scheme RATTLE with the momenta of the step element.  Steps with nodes inside have an
impulse of their own at each of their nodes, keep the places of all of them, and the rates at their
ends, gamma(q_k, w_k) = 0 (:eq:`held-step`, :mod:`dmoc.program.stations`).  Places are measured by
how far the contact could move in one step.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.mechanics.touch import Touch
from dmoc.problem.problem import Problem
from dmoc.program.blocks import NOWHERE, Block, Index, Numbering
from dmoc.program.interior import give_way
from dmoc.program.laws.impact import ends_motion
from dmoc.program.laws.law import AT_REST, Edge, Law, Pivot, key
from dmoc.program.laws.phase_nodes import PhaseNodes, end_of_phase, ends_of_phases, later
from dmoc.program.layout import Layout
from dmoc.program.presolve import Settled, settled
from dmoc.program.scale import Scale
from dmoc.program.terms import Places, Term

if TYPE_CHECKING:
    from dmoc.program.laws.laws import Laws


@dataclass(eq=False, repr=False)
class ContactLaw(Law):
    """The contacts that last along the phases of a problem.

    Attributes
    ----------
    lay : Layout
    pulling : bool
        Closed contacts may pull, to see how strongly they would have to.
    settled : Settled
        Rows that the fixed values of the problem settle.
    """

    lay: Layout
    pulling: bool
    settled: Settled = field(init=False)
    closed: Block = field(init=False)
    at_rest: Block = field(init=False)
    opens: Block = field(init=False)
    lands: Block = field(init=False)
    stays: Block = field(init=False)

    @cached_property
    def along(self) -> PhaseNodes:
        """The stations of all phases, if something touches in one of them."""
        return PhaseNodes(self.lay, not self.lay.touch.free)

    def bounds(self, problem: Problem, box: Array, scale: Scale) -> None:
        lay, unknowns = self.lay, self.lay.contact
        held = [
            (lay.index_places[lay.places_of_phase(i)], surface)
            for i, mode in enumerate(lay.touch.modes)
            for surface in mode.closed
        ]
        give_way(problem, box, scale, held)
        if not self.pulling:
            one_way = ~lay.touch.contacts.pull
            for index in (unknowns.P[:, one_way], unknowns.P_c[:, one_way]):
                box[index[index != NOWHERE], 0] = 0.0
            for one in lay.liftoff.of:
                last = lay.stations.rows(one.event).stop - 1
                box[unknowns.P[last, list(one.surfaces)], 0] = -np.inf

    def settle(self, problem: Problem, limits: tuple[Array, Array]) -> None:
        free = self.lay.touch.free
        self.settled = Settled.nothing(self.lay) if free else settled(problem, self.lay, limits)

    def equations(self, block: Numbering) -> None:
        lay, touch, along = self.lay, self.lay.touch, self.along
        names, landing = touch.contacts.surfaces, np.zeros_like(touch.beside)
        grips = touch.contacts.pull
        kinds, lands = np.where(grips, "grip", "contact"), np.where(grips, "closing", "landing")
        closed, beside = touch.is_closed & ~self.settled.closed, ~self.settled.closed[1:]
        for i, event in enumerate(touch.events):
            landing[i, list(event.lands[1:])] = True
        landing[:, list(touch.contacts.floating)] = False
        at_end = ends_motion(lay)[:, None]
        self.closed = block(
            "closed",
            along.places(closed, self.settled.places),
            lambda r, j: f"{kinds[j]} {names[j]} {along.at.label(r)}",
            lambda s: along.in_a_step(s.rate, s),
        )
        self.at_rest = block(
            "at rest",
            along.rates(closed, ends_of_phases(closed, self.settled.rates)),
            lambda k, j: f"rate of {kinds[j]} {names[j]} {end_of_phase(lay, k)}",
            lambda s: s.rate,
        )
        self.lands = block(
            "lands",
            landing & beside & ~(at_end & self.settled.places[-1]),
            lambda i, j: f"{lands[j]} of {names[j]} at event {i + 1}",
            lambda s: s.gap,
        )
        self.stays = block(
            "stays",
            touch.beside & beside & ~(at_end & self.settled.rates[-1]),
            lambda i, j: f"rate of {names[j]} after event {i + 1}",
            lambda s: s.rate,
        )

    def inequalities(self, block: Numbering) -> None:
        """Contacts that leave with an event at the end, where no gap says that they open."""
        touch, names = self.lay.touch, self.lay.touch.contacts.surfaces
        leaving = np.zeros_like(touch.beside)
        for i in np.flatnonzero(ends_motion(self.lay)):
            event = touch.events[i]
            leaving[i, [j for j in event.leaves if j not in event.off]] = True
        leaving[:, touch.contacts.pull] = False
        self.opens = block(
            "opens",
            leaving,
            lambda i, j: f"opening of {names[j]} at event {i + 1}",
            lambda s: s.rate,
        )

    def terms(self, places: Places, laws: Laws) -> list[Term]:
        lay, along, nodes = self.lay, self.along, self.lay.collision_nodes
        if lay.touch.free:
            return []
        floating = self.closed.index.copy()
        floating[:, ~np.isin(np.arange(places.nc), lay.touch.contacts.floating)] = NOWHERE
        terms = [
            *along.pushes("normal", lay.contact.P, -1.0, places, laws),
            *along.rests("gap_rate", self.at_rest.index, places),
            Term("surface", along.state(places), (self.closed.index,)),
            Term("surface", along.state(places), (later(floating),), -1.0),
        ]
        if len(nodes):
            q, t, P_c = lay.index_q[nodes], places.times(nodes), places.or_zero(lay.contact.P_c)
            terms += [
                Term("normal", (q, P_c, t), (laws.step.momentum.index[nodes],), -1.0),
                Term("surface", (q, t), (self.lands.index,)),
                Term("gap_rate", (q, lay.impact.v_c, t), (self.stays.index,)),
                Term("gap_rate", (q, lay.impact.v_c, t), (self.opens.index,), -1.0),
            ]
        return terms

    def edges(self, i: int) -> Iterator[Edge]:
        """Edges beyond which a contact leaves: there it does not press."""
        lay, rows = self.lay, self.lay.stations.rows(i)
        for j in lay.touch.modes[i].closed:
            if lay.touch.contacts.pull[j]:
                continue
            gives = lay.stations.by_step(self.closed.index[rows, j])
            name = lay.touch.contacts.surfaces[j]
            yield Edge(name, j, None, lay.contact.P[rows, j], gives, -1.0)

    def pivots(self, laws: Laws) -> Iterator[Pivot]:
        """Places and rates of contacts determine their impulses."""
        unknowns = self.lay.contact
        if not self.lay.touch.free:
            yield from self.along.pivots(unknowns.P, self.closed.index, self.at_rest.index)
            after = key(self.lay.collision_nodes, AT_REST)
            yield Pivot(unknowns.P_c, self.stays.index, after)

    def loose(self) -> Iterator[tuple[Index, Index]]:
        if not self.lay.touch.free:
            unknowns = self.lay.contact
            yield from self.along.loose(unknowns.P, unknowns.P_c, self.settled.closed)


@dataclass(eq=False, repr=False)
class LawAtContacts(Law):
    """A law of what touches or rubs at the contacts of the law ``contact``."""

    contact: ContactLaw

    @property
    def lay(self) -> Layout:
        return self.contact.lay

    @property
    def touch(self) -> Touch:
        return self.lay.touch

    @property
    def along(self) -> PhaseNodes:
        return self.contact.along

    @property
    def settled(self) -> Settled:
        return self.contact.settled
