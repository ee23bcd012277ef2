"""Friction of contacts that last, and of rails: its rows and terms.

What rubs in a phase has tangential impulses T_k at each of its nodes, beside the normal ones P_k of
its contact (:mod:`dmoc.program.laws.contact`)::

    momentum   ... + sum T_k grad tau(q_k) = 0    also of arrival, departure
    stuck      tau(q_k) - tau(q_km1) = 0          where it sticks
    sliding    T_k + s mu P_k = 0                 where it slides in the direction s
    stopped    sigma(q_N, v-) = 0                 at the end of a phase in which it sticks, and
                                                  where it stops sliding or turns
    sticks     sigma(q_c, v+) = 0                 after an impact, with impulses T_c
    slides     T_c + s mu P_c = 0                 in an impact
    cone       mu_s P_k - |T_k| >= 0, mu P_c - |T_c| >= 0    where it sticks

That what slides does so in its direction s is a law of its own (:mod:`dmoc.program.laws.sliding`).
Where static friction is another one, mu_s, what sticks breaks away by rows of its own
(:mod:`dmoc.program.laws.breakaway`).

A rail has the largest force F instead of mu P_k, times the time that the node stands for.  The
places of stuck are measured by how far the contact could move in one step.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.mechanics.contacts import RAIL
from dmoc.motion.friction import SLIDING, STICK, sticks
from dmoc.problem.problem import Problem
from dmoc.program.blocks import (
    NOWHERE,
    Block,
    Bools,
    Counted,
    Entries,
    Index,
    Numbering,
    two_sided,
)
from dmoc.program.bound_kinds import BoundKind
from dmoc.program.coefficients import (
    AFTER,
    Product,
    against,
    at_events,
    at_stations,
    entries_of,
    terms_of,
    where_it_slides,
)
from dmoc.program.hit_stages import STOP
from dmoc.program.interior import bound_once
from dmoc.program.laws.contact import LawAtContacts
from dmoc.program.laws.impact import ends_motion
from dmoc.program.laws.law import AT_REST, INPUT, Edge, Pivot, key
from dmoc.program.laws.phase_nodes import end_of_phase, ends_of_phases, later
from dmoc.program.laws.sliding import SlidingLaw
from dmoc.program.scale import Scale
from dmoc.program.terms import Places, Term

if TYPE_CHECKING:
    from dmoc.program.laws.laws import Laws


@dataclass(eq=False, repr=False)
class FrictionLaw(LawAtContacts):
    """Law of the friction of contacts and rails along the phases of a problem.

    Attributes
    ----------
    contact : ContactLaw
        The law of the contacts at which it rubs.
    direction : SlidingLaw
        The law of what slides there.
    mu : array, shape (phases, nt)
        Coefficients of friction of surfaces, largest forces of rails; not a number where they
        vary.
    mu_s : array, shape (phases, nt)
        Coefficients or largest forces of static friction, as those of ``mu``.
    paired : array of bool, shape (nt,)
        Tangents whose static friction differs from that of sliding.
    slows : bool
        Whether some friction depends on the sliding speed.
    """

    numbers = "mu", "mu_s"

    direction: SlidingLaw
    mu: Array
    mu_s: Array
    paired: Bools
    slows: bool
    stuck: Block = field(init=False)
    sliding: Block = field(init=False)
    stopped: Block = field(init=False)
    sticks: Block = field(init=False)
    slides: Block = field(init=False)
    cone: Block = field(init=False)
    cone_of_impact: Block = field(init=False)

    def bounds(self, problem: Problem, box: Array, scale: Scale) -> None:
        lay, touch, unknowns = self.lay, self.touch, self.lay.contact
        if touch.free:
            return
        bound_once(problem, lay, box)
        smooth = touch.sticks & (self.mu_s == 0)  # they hold nothing
        box[unknowns.T[self.along.along(smooth)]] = 0.0
        smooth = touch.sticks[1:] & (self.in_impacts == 0)
        box[unknowns.T_c[smooth & touch.rubs_in_impact]] = 0.0

    # Rows -----------------------------------------------------------------------------------------

    def equations(self, block: Numbering) -> None:
        lay, touch, names = self.lay, self.touch, self.touch.contacts.tangents
        along, settled = self.along, self.settled
        moves = np.vstack([np.ones_like(settled.stuck[:1]), settled.stuck])
        sticks, stops = touch.sticks & ~settled.sticks, touch.stops & ~settled.stops
        self.stuck = block(
            "stuck",
            along.places(sticks, moves),
            lambda r, j: f"sticking of {names[j]} {along.at.label(r)}",
            lambda s: along.in_a_step(s.slide, s),
        )
        self.sliding = block(
            "sliding",
            along.along(touch.slides),
            lambda r, j: f"sliding friction of {names[j]} {along.at.label(r)}",
            lambda s: s.friction / lay.total * along.at.size,
        )
        self.stopped = block(
            "stopped",
            along.rates(sticks, ends_of_phases(sticks, settled.slides, stops)),
            lambda k, j: f"sliding velocity of {names[j]} {end_of_phase(lay, k)}",
            lambda s: s.slide,
        )
        self.sticks = block(
            "sticks",
            touch.rubs_in_impact & sticks[1:] & ~(ends_motion(lay)[:, None] & settled.slides[-1]),
            lambda i, j: f"sliding velocity of {names[j]} after event {i + 1}",
            lambda s: s.slide,
        )
        self.slides = block(
            "slides",
            touch.rubs_in_impact & ~touch.sticks[1:],
            lambda i, j: f"sliding friction of {names[j]} at event {i + 1}",
            lambda s: s.friction,
        )

    def inequalities(self, block: Numbering) -> None:
        """The last axis of cones are the two sides."""
        lay, touch = self.lay, self.touch
        names, at = touch.contacts.tangents, self.along.at
        stops = lay.hit.moments[:, STOP, None]  # cones within the impact say more
        cone = two_sided(self.along.along(self.sticking & self._lines))
        for i, k in np.argwhere(self.breaks).tolist():
            # what says that it breaks away says more of its side
            cone[self.last[i], k, int(touch.signs[i + 1, k] > 0)] = False
        self.cone = block(
            "cone",
            cone,
            lambda r, j, _: f"friction cone of {names[j]} {at.label(r)}",
            lambda s: s.friction[:, None] / lay.total * at.size[:, :, None],
            at.step if at.own else at.place,
            counted=Counted(BoundKind.CONE, names, at.place),
        )
        self.cone_of_impact = block(
            "cone of an impact",
            two_sided(
                touch.drags & touch.sticks[1:] & (self.in_impacts != 0) & ~stops & self._lines
            ),
            lambda i, j, _: f"friction cone of {names[j]} at event {i + 1}",
            lambda s: s.friction[:, None],
        )

    @property
    def _lines(self) -> Bools:
        """Tangents with one direction, shape (nt,): the cones of those with two are a law of their
        own (:mod:`dmoc.program.laws.rolling`)."""
        lines = np.ones(len(self.touch.contacts.tangents), dtype=bool)
        lines[[k for pair in self.touch.contacts.rolling for k in pair]] = False
        return lines

    @property
    def sticking(self) -> Bools:
        """Tangents that stick with friction, shape (phases, nt): without friction the cone has no
        interior, and bounds say T = 0."""
        return np.asarray(self.touch.sticks & (self.mu_s != 0))

    def along_phases(self, mu: Array) -> Array:
        """Coefficients of phases at the stations, shape (rows, nt)."""
        return np.asarray(mu[self.along.at.phase])

    @property
    def in_impacts(self) -> Array:
        """Coefficients at events, those of the phases that they end, shape (events, nt)."""
        return self.mu[:-1]

    @property
    def static(self) -> str:
        """Name of the kernel of static friction."""
        return "holding" if self.paired.any() or self.slows else "bearing"

    @property
    def last(self) -> Index:
        """Rows of the stations at the ends of phases, shape (phases with steps,)."""
        return np.flatnonzero(self.along.at.is_last)

    @property
    def breaks(self) -> Bools:
        """Tangents that break away from another static friction at events, shape (events, nt)."""
        touch = self.touch
        begins = touch.sticks[:-1] & touch.slides[1:] & ~touch.impacts[:, None]
        return np.asarray(begins & self.paired)

    # Terms ----------------------------------------------------------------------------------------

    def terms(self, places: Places, laws: Laws) -> list[Term]:
        along, unknowns = self.along, self.lay.contact
        if self.touch.free:
            return []
        q, t = along.state(places)
        stuck, site = self.stuck.index, at_stations(self.lay)
        slides = ("dragging", where_it_slides(self.lay)) if self.slows else ("bearing", site)
        stuck = np.where(self.touch.contacts.in_place, stuck, NOWHERE)
        return [
            *along.pushes("traction", unknowns.T, 1.0, places, laws),
            *along.rests("slide_rate", self.stopped.index, places),
            Term("tangent", (q, t), (stuck,)),
            Term("tangent", (q, t), (later(stuck),), -1.0),
            *self._at_events(places, laws.step.momentum.index),
            *terms_of(self.along_phases(self.mu), self._sliding, slides[1], places, slides[0]),
            *terms_of(self.along_phases(self.mu_s), self._sticking, site, places, self.static),
            *terms_of(self.in_impacts, self._in_impacts, at_events(self.lay), places),
        ]

    def _at_events(self, places: Places, momentum: Index) -> Iterator[Term]:
        """Impulses of impacts, and rates after them."""
        lay, nodes = self.lay, self.lay.collision_nodes
        if not len(nodes):
            return
        q, t, T_c = lay.index_q[nodes], places.times(nodes), places.or_zero(lay.contact.T_c)
        yield Term("traction", (q, T_c, t), (momentum[nodes],))
        yield Term("slide_rate", (q, lay.impact.v_c, t), (self.sticks.index,))

    # Linear rows ----------------------------------------------------------------------------------

    def entries(self, laws: Laws) -> list[Entries]:
        """Entries of the rows that say how large friction is: sliding, and cones."""
        lay = self.lay
        if self.touch.free:
            return []
        of_T: list[Entries] = []
        for T, slides, cone in (
            (lay.contact.T, self.sliding.index, self.cone.index),
            (lay.contact.T_c, self.slides.index, self.cone_of_impact.index),
        ):
            for rows, sign in ((slides, 1.0), (cone[..., 0], -1.0), (cone[..., 1], 1.0)):
                there = rows != NOWHERE
                of_T.append((rows[there], T[there], np.full(int(there.sum()), sign)))
        return [
            *of_T,
            *entries_of(self.along_phases(self.mu), self._sliding),
            *entries_of(self.in_impacts, self._in_impacts),
            *entries_of(self.along_phases(self.mu_s), self._sticking),
        ]

    @property
    def _sliding(self) -> Iterator[Product]:
        """Friction s mu P along phases, in the rows of sliding."""
        phase = self.along.at.phase
        for k, (at, limit, factor) in enumerate(self.limits):
            rows = self.sliding.index[:, k]
            yield against(self.lay, phase, Product(k, at, rows, limit, factor))

    @property
    def _sticking(self) -> Iterator[Product]:
        """Largest static friction mu_s P along phases, in the rows of both sides of cones."""
        for k, (at, limit, factor) in enumerate(self.limits):
            for side in range(2):
                yield Product(k, at, self.cone.index[:, k, side], limit, factor)

    @property
    def limits(self) -> Iterator[tuple[Index, Index, Array]]:
        """For each tangent the rows of stations, and the unknowns that press it there, with their
        factors, shape (rows,) each."""
        lay, phase, share = self.lay, self.along.at.phase, self.along.at.share
        for surface in self.touch.contacts.supports:
            rail = surface == RAIL
            limit = lay.index_h[phase] if rail else lay.contact.P[:, surface]
            yield np.arange(len(phase)), limit, share if rail else np.ones(len(phase))

    @property
    def _in_impacts(self) -> Iterator[Product]:
        """Friction mu P of impacts, in the rows of sliding and of cones."""
        lay, touch = self.lay, self.touch
        at = np.arange(len(touch.events))
        for k, surface in enumerate(touch.contacts.supports):
            if surface != RAIL and len(at):
                hit = touch.surfaces == surface
                normal = np.where(hit, lay.impact.lam, lay.contact.P_c[:, surface])
                slides, one = self.slides.index[:, k], np.ones(len(at))
                yield against(lay, AFTER, Product(k, at, slides, normal, one))
                for side in range(2):
                    yield Product(k, at, self.cone_of_impact.index[:, k, side], normal, one)

    # Edges and pivots -----------------------------------------------------------------------------

    def edges(self, i: int) -> Iterator[Edge]:
        """Edges beyond which a tangent that slides sticks, or one that sticks slides: there the
        speed vanishes, or friction is at its limit."""
        lay, rows, by_step = self.lay, self.lay.stations.rows(i), self.lay.stations.by_step
        steps = slice(lay.ends[i], lay.ends[i + 1])
        for k, s in self.touch.modes[i].rubbing.items():
            name = self.touch.contacts.tangents[k]
            if self.paired[k] or not self._lines[k]:
                continue  # friction jumps there, or slides in a direction that turns
            if sticks(s):
                gives = by_step(self.stuck.index[rows, k])
                for side, way in enumerate(sorted(SLIDING)):
                    cone = self.cone.index[rows, k, side]
                    yield Edge(name, k, (s, way), cone, gives, way)
            else:
                gives, T = (by_step(a[rows, k]) for a in (self.sliding.index, lay.contact.T))
                yield Edge(
                    name, k, (s, STICK), self.direction.in_steps.index[steps, k], gives, s, T
                )

    def pivots(self, laws: Laws) -> Iterator[Pivot]:
        """Rows of friction determine its impulses."""
        touch, along, unknowns = self.touch, self.along, self.lay.contact
        if touch.free:
            return
        yield Pivot(unknowns.T, self.sliding.index, key(along.at.step, INPUT))
        stopped, count = self.stopped.index.copy(), self.lay.stepped
        ends = self.lay.ends[1 : count + 1]
        stopped[ends] = np.where(touch.sticks[:count], stopped[ends], NOWHERE)
        yield from along.pivots(unknowns.T, self.stuck.index, stopped)
        events = self.lay.collision_nodes
        yield Pivot(unknowns.T_c, self.sticks.index, key(events, AT_REST))
        yield Pivot(unknowns.T_c, self.slides.index, key(events - 1, INPUT))

    def loose(self) -> Iterator[tuple[Index, Index]]:
        if not self.touch.free:
            unknowns = self.lay.contact
            yield from self.along.loose(unknowns.T, unknowns.T_c, self.settled.sticks)
