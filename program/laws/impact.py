"""The law of impact: its unknowns, its equations, its parameters.

At a collision with surface j the momentum jumps by an impulse lam >= 0 along the gradient of the
gap, and the rates gamma- of the gap before and gamma+ after it obey Newton's law of restitution,
gamma+ = -e gamma- (equations :eq:`impact` to :eq:`approach` of the theory)::

    momentum    r_plus(before) + r_minus(after) = lam grad g(q_c)
    arrival     r_plus(last step before) - dL/dv(q_c, v_a) = 0
    departure   r_minus(first step after) + dL/dv(q_c, v_c) = 0, with -p_E where the motion ends
    energy      e (e_plus(before) - e_minus(after) - W_t) - (1 - e)/2 W_gamma = 0
                gamma(q_c, v_c) + e gamma(q_c, v_a) = 0    where e = 0, where a collision only
                grazes, where the motion ends with it, and where the law is stated in the rates
    contact     g(q_c) = 0
    approach    gamma(q_c, v_a) >= 0                       but for grazes, whose rate is known
    separation  -gamma(q_c, v_c) >= 0                      where the law does not fix that rate

with the unknown velocities v_a before and v_c after the collision, and W_t, W_gamma of
:func:`dmoc.symbolic.continuous.impact_work`. The energies are those of the two steps beside the
collision, which tell little of the rates where one of them is long and the other one short, and
leave out the impulses of contacts that last and of constraints: beside these the law is stated in
the rates, and where the model states e by the rate before, or parameters change at the event. So
it is where something moves that the collision does not touch, whose inputs would buy restitution by
the energy of their steps. A surface that lands obeys the law with e = 0; an event without an impact
has arrival and departure alone. Of a hit with friction the row energy is that of
:mod:`dmoc.program.laws.hit`.

An event obeys its law with the parameters of the phase that it ends. Where those of the next one
are others, velocities and positions stay, and the momentum has one term more::

    momentum    r_plus(before) + r_minus(after) + p_after(q_c, v_c) - p_before(q_c, v_c)
                = lam grad g(q_c)
"""

from __future__ import annotations

from collections.abc import Iterator
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from dmoc.base.names import unit_of, velocity_name
from dmoc.codegen.kernels import Array
from dmoc.problem.problem import Problem
from dmoc.program.blocks import (
    LAW,
    NOWHERE,
    Block,
    Bools,
    Entries,
    Index,
    Missed,
    Numbering,
    in_columns,
    mask_of,
    sizes_of,
)
from dmoc.program.interior import give_way
from dmoc.program.laws.law import COLLISION, Law, Pivot, key
from dmoc.program.layout import Layout
from dmoc.program.presolve import settled
from dmoc.program.scale import Scale
from dmoc.program.terms import Places, Term, like

if TYPE_CHECKING:
    from dmoc.program.laws.laws import Laws


@dataclass(eq=False, repr=False)
class ImpactLaw(Law):
    """Newton's law at the collisions of a sequence.

    Attributes
    ----------
    problem : Problem
    lay : Layout
    e : array, shape (collisions,)
        Coefficients of restitution, 0 for grazes and landings; 1 where the law of the model says
        them.
    by_law : array of bool, shape (collisions,)
        Those where it does.
    grazing : array of bool, shape (collisions,)
        Collisions that graze their surface without an impulse.
    landing : array of bool, shape (collisions,)
        Those after which the surface stays closed.
    by_rates : array of bool, shape (collisions,)
        The law is stated in the rates, whatever e is.
    rough : array of bool, shape (collisions,)
        Hits with friction, which obey another law; not those that go as a whole.
    """

    numbers = ("e",)

    problem: Problem
    lay: Layout
    e: Array
    by_law: Bools
    grazing: Bools
    landing: Bools
    by_rates: Bools
    rough: Bools
    arrival: Block = field(init=False)
    departure: Block = field(init=False)
    settled: Bools = field(init=False)
    energy: Block = field(init=False)
    contact: Block = field(init=False)
    approach: Block = field(init=False)
    separation: Block = field(init=False)

    @classmethod
    def of(cls, problem: Problem, lay: Layout, grazing: Index) -> ImpactLaw:
        """The law of a problem; ``grazing`` are the events that graze, shape (k,)."""
        count, passages = len(lay.touch.surfaces), lay.hit.passages
        grazes = mask_of(count, grazing)
        landing = np.array([bool(event.lands) for event in problem.touch.events], dtype=bool)
        e, by_law = _coefficients(problem, lay, grazes | landing)
        joined = bool(problem.kernels.joints)
        lasts = np.array([joined or not mode.free for mode in problem.touch.modes], dtype=bool)
        rough = mask_of(count, [p.event for p in passages if not (p.lands or p.whole)])
        whole = mask_of(count, [p.event for p in passages if p.whole])
        last = ends_motion(lay)
        stated = lasts[:-1] | lasts[1:] | problem.by_rates | rough | by_law | whole | last
        stated |= _moves_apart(problem, lay.touch.surfaces)
        stated |= changes_of(problem)
        return cls(problem, lay, e, by_law, grazes, landing, stated, rough)

    def stating(self, problem: Problem) -> ImpactLaw:
        """The same rows with the coefficients of another problem, which are zero where these
        are."""
        values = problem.restitution_values
        if np.array_equal(values, self.problem.restitution_values, equal_nan=True):
            return self
        other = copy(self)
        other.problem = problem
        other.e, _ = _coefficients(problem, self.lay, self.grazing | self.landing)
        return other

    @property
    def surfaces(self) -> Index:
        """Surface of each event, shape (events,), NOWHERE of one without an impact."""
        return self.lay.touch.surfaces

    @property
    def impact(self) -> Bools:
        """Events at which something is hit or lands, shape (events,)."""
        return self.lay.touch.impacts

    @property
    def sure(self) -> Bools:
        """Events at which something is hit or lands for certain."""
        return self.impact & (self.lay.touch.open is None)

    @cached_property
    def grasps(self) -> Bools:
        """Events at which grips close and nothing else is hit or lands, shape (events,)."""
        return self.impact & np.isin(self.surfaces, self.lay.touch.contacts.of_grips)

    @property
    def plain(self) -> Bools:
        """Collisions whose law says what gamma is after them: plastic ones, grazes, landings, and
        all where it is stated in the rates."""
        return np.asarray(((self.e == 0) | self.by_rates) & self.impact)

    @cached_property
    def most_impulse(self) -> Array:
        """Upper bounds of the impulses."""
        return np.where(self.grazing | ~self.impact, 0.0, np.inf)

    def bounds(self, problem: Problem, box: Array, scale: Scale) -> None:
        lay = self.lay
        most = self.most_impulse
        box[..., lay.impact.lam, :] = np.stack([np.where(self.grasps, -most, 0.0), most], axis=1)
        hits = np.flatnonzero(self.impact)
        at = lay.index_q[lay.collision_nodes[hits], None]
        give_way(problem, box, scale, zip(at, self.surfaces[hits].tolist(), strict=True))

    def settle(self, problem: Problem, limits: tuple[Array, Array]) -> None:
        """Note what values fixed at the goal, lower and upper ``limits`` of shape (n,), settle of
        the event that ends a motion: where it is, and how fast its surface is left."""
        self.settled = np.zeros((2, len(self.surfaces)), dtype=bool)
        if self.lay.ends_with_event:
            at_end, j = settled(problem, self.lay, limits), self.surfaces[-1]
            stops = self.e[-1] == 0 and not self.rough[-1]
            self.settled[:, -1] = at_end.places[-1, j], at_end.rates[-1, j] and stops

    def equations(self, block: Numbering) -> None:
        at, hit, n = self.lay.impact.names, self.surfaces, len(self.surfaces)
        v = [velocity_name(q) for q in self.problem.kernels.coordinates]
        plain, surfaces = self.plain, self.problem.kernels.surfaces

        def velocities(name: str, side: str) -> Block:
            return block(
                name,
                (n, len(v)),
                lambda k, i: f"velocity {v[i]} {side} {at[k]}",
                lambda s: s.p,
                missed=Missed(
                    LAW, lambda *_: f"the velocity {side} a collision does not fit its momentum"
                ),
            )

        self.arrival = velocities("arrival", "before")
        self.departure = velocities("departure", "after")
        self.energy = block(
            "energy",
            self.sure & ~self.settled[1],
            lambda k: f"energy at {at[k]}",
            lambda s: np.where(plain, sizes_of(s.rate, hit), np.asarray(s.energy)[..., None]),
            missed=Missed(
                LAW,
                lambda k: f"collision {k + 1} ({surfaces[hit[k]]}) violates its law of restitution",
                apart=0,
            ),
        )
        events = np.where(self.lay.touch.contacts.pull, "event", "collision")
        self.contact = block(
            "contact",
            self.sure & ~self.settled[0] & ~np.isin(hit, self.lay.touch.contacts.floating),
            lambda k: f"contact at {at[k]}",
            lambda s: sizes_of(s.gap, hit),
            missed=Missed(
                words=lambda k: f"{events[hit[k]]} {k + 1} misses {surfaces[hit[k]]!r}",
                unit=lambda k: self._unit_of_gap(int(hit[k])),
                apart=0,
            ),
        )

    def _unit_of_gap(self, surface: int) -> str:
        """Unit of a gap: that of its coordinate, if it depends on one alone, else empty."""
        model = self.problem.model
        involved = [model.kernels.coordinates[j] for j in model.surface_coordinates[surface]]
        return unit_of(involved[0], model.kernels.manifest.units) if len(involved) == 1 else ""

    def inequalities(self, block: Numbering) -> None:
        at, hit, nodes = self.lay.impact.names, self.surfaces, self.lay.collision_nodes
        self.approach = block(
            "approach",
            self.sure & ~self.grazing & ~self.grasps,
            lambda k: f"approach of {at[k]}",
            lambda s: sizes_of(s.rate, hit),
            nodes,
        )
        self.separation = block(
            "separation",
            self.sure & ~self.plain,
            lambda k: f"separation after {at[k]}",
            lambda s: sizes_of(s.rate, hit),
            nodes,
        )

    def terms(self, places: Places, laws: Laws) -> list[Term]:
        lay, momentum, nodes = self.lay, laws.step.momentum.index, self.lay.collision_nodes
        if not len(nodes):
            return []
        q, t = lay.index_q[nodes], places.times(nodes)
        lam = self._by_surface(lay.impact.lam, places, places.zero)
        energy, e = self.energy.index[:, None], self.e[:, None]
        law = np.where(self.plain[:, None], NOWHERE, energy)
        before, later = places.step(nodes - 1), slice(int(np.sum(nodes < lay.total)))
        after = places.step(nodes[later])
        no_p, no_cost, no_inside = (
            like(q),
            like(energy),
            np.full((len(nodes), lay.inside * lay.nq), NOWHERE),
        )
        no_after = [rows[later] for rows in (no_p, no_cost, no_inside)]
        terms = [
            Term("normal", (q, lam, t), (momentum[nodes],), -1.0),
            Term("surface", (q, t), (self._by_surface(self.contact.index, places),)),
            Term("impact", before, (law, like(law)), e),
            Term("impact", after, (like(law[later]), law[later]), -e[later]),
            Term("moving_work", (q, lam, t), (law,), -e),
            Term("rate_work", (q, lay.impact.v_c, lam, t), (law,), (e - 1) / 2),
            Term("step", before, (no_p, self.arrival.index, no_cost, no_inside)),
            Term("step", after, (self.departure.index[later], *no_after)),
            Term("momentum", (q, lay.impact.v_a, t), (self.arrival.index,), -1.0),
            Term("momentum", (q, lay.impact.v_c, t), (self.departure.index,)),
            *self._carried_away(q, t, momentum[nodes]),
        ]
        plain = np.where(self.plain & ~self.rough, self.energy.index, NOWHERE)
        for v, rows, sign in (
            (lay.impact.v_a, self.approach.index, 1.0),
            (lay.impact.v_c, self.separation.index, -1.0),
            (lay.impact.v_c, plain, 1.0),
            (lay.impact.v_a, np.where((self.e > 0) & ~self.by_law, plain, NOWHERE), e),
        ):
            terms.append(Term("gap_rate", (q, v, t), (self._by_surface(rows, places),), sign))
        if (own := np.flatnonzero(self.by_law & ~self.rough)).size:
            rows = self._by_surface(plain, places)[own]
            none = np.full((len(own), places.nc), places.zero)
            before = q[own], lay.impact.v_a[own], none, t[own] if lay.timed else t
            terms.append(Term("rebound", before, (rows, like(rows), like(rows[:, :1]))))
        return terms

    def _carried_away(self, q: Index, t: Index, momentum: Index) -> Iterator[Term]:
        """The change of the momentum at events behind which parameters are others, at the same
        velocities: by the values after it, less that by those before."""
        changed = np.flatnonzero(changes_of(self.problem))
        if changed.size:
            at = q[changed], self.lay.impact.v_c[changed], t[changed] if self.lay.timed else t
            for phase, sign in ((changed + 1, 1.0), (changed, -1.0)):
                yield Term("momentum", at, (momentum[changed],), sign, phase)

    def entries(self, laws: Laws) -> list[Entries]:
        """The momentum after an event that ends the motion."""
        rows = self.departure.index[ends_motion(self.lay)].ravel()
        return [(rows, self.lay.index_p_E[: len(rows)], -np.ones(len(rows)))]

    def pivots(self, laws: Laws) -> Iterator[Pivot]:
        """The momenta beside a collision determine the velocities, the contact the step size of the
        phase that ends in it, and the energy the impulse."""
        lay, hit, newton = self.lay, self.impact, self.impact & ~self.rough
        before, after = key(lay.collision_nodes - 1, COLLISION), key(lay.collision_nodes, COLLISION)
        yield Pivot(lay.impact.v_a, self.arrival.index, before)
        yield Pivot(lay.index_h[: len(hit)][hit], self.contact.index[hit], before[hit])
        yield Pivot(lay.impact.v_c, self.departure.index, after)
        yield Pivot(lay.impact.lam[newton], self.energy.index[newton], after[newton])

    def _by_surface(self, values: Index, places: Places, otherwise: int = NOWHERE) -> Index:
        """Values of the collisions in the columns of their surfaces, shape (collisions, nc)."""
        return in_columns(values, self.surfaces, places.nc, otherwise)


def _moves_apart(problem: Problem, surfaces: Index) -> Bools:
    """Collisions beside which something moves that they do not touch, shape (events,): its kinetic
    energy has no part in them, but the discrete energies would count what its inputs do
    meanwhile."""
    apart = problem.model.moves_apart
    return np.array([j != NOWHERE and apart[j] and problem.nu > 0 for j in surfaces], dtype=bool)


def changes_of(problem: Problem) -> Bools:
    """Events behind which parameters have other values, shape (events,)."""
    return problem.models.changes(len(problem.touch.events))


def ends_motion(lay: Layout) -> Bools:
    """Mask of the event that ends the motion, shape (events,)."""
    return np.asarray(lay.collision_nodes == lay.total)


def _coefficients(problem: Problem, lay: Layout, plastic: Bools) -> tuple[Array, Bools]:
    """Coefficients of restitution of events, zero for ``plastic`` ones, 1 where the law of the
    model says them, and where it does."""
    e = np.where(plastic, 0.0, restitution_of(problem, lay.touch.surfaces))
    return np.where(np.isnan(e), 1.0, e), np.isnan(e)


def restitution_of(problem: Problem, surfaces: Index) -> Array:
    """Coefficients of restitution of events, zero where nothing is hit, not a number where the law
    of the model says them."""
    e = np.zeros(len(surfaces))
    hit = surfaces != NOWHERE
    e[hit] = problem.restitution_values[surfaces[hit]]
    return e


def states_energies(problem: Problem) -> bool:
    """Whether the program of a problem states a hit as a balance of energies, which says the same
    as the rates of the gap only where steps are short."""
    law = ImpactLaw.of(problem, Layout.of(problem), np.zeros(0, dtype=np.intp))
    return bool((law.impact & ~law.plain).any())
