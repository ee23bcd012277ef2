"""Contacts that no word says: complementarity, relaxed by eps.

At every node stand impulses P >= 0 of the surfaces that may be closed, and friction T of what may
rub; the hits of the sequence may be none::

    momentum     ... - sum P_k grad g(q_k) + sum T_k grad tau(q_k) = 0      of every node
    pressing     eps + P_k g(q_kp1) >= 0                        nothing pushes from afar
    cone         mu P_k -+ T_k >= 0
    dissipation  eps - d_k (T_k +- mu P_k) >= 0                 d_k = tau(q_kp1) - tau(q_k)
    ends         eps + P_1 - P_0 >= 0, eps + P_km1 - P_k >= 0    k the last node
    closed       eps + g(q_0) >= 0                              of what is closed at the start
    hit          eps + lam g(q_c) >= 0
    rebound      eps -+ lam (gamma(q_c, v_c) + e gamma(q_c, v_a)) >= 0

Grips that no word says are in :mod:`dmoc.program.laws.open_grips`.  No contact is hit at the ends
of the motion, where there is no rate on one side: what presses there does not press more than
beside.  Dissipation says that friction opposes sliding.  A hit with
friction has mu (P + lam) at its node, a rail h F in the place of mu P.  eps is a share of the sizes
of both factors; for eps to zero the motions are those of all sequences, and each says its own
(:mod:`dmoc.sequences.proposals`).
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.mechanics.contacts import RAIL
from dmoc.mechanics.touch import Open
from dmoc.problem.design import by_design
from dmoc.problem.problem import Problem
from dmoc.program.blocks import (
    NOWHERE,
    Block,
    Bools,
    Entries,
    Index,
    Label,
    Numbering,
    in_columns,
    sizes_of,
    two_sided,
)
from dmoc.program.coefficients import Product, at_nodes, entries_of, terms_of
from dmoc.program.laws.law import INPUT, Law, Pivot, key
from dmoc.program.layout import Layout
from dmoc.program.scale import Scale
from dmoc.program.terms import Places, Term

if TYPE_CHECKING:
    from dmoc.program.laws.laws import Laws


# eps of hits at most: they begin where the start has them, and would fade away from far.
OF_HITS = 1e-2


def settled_at_start(problem: Problem, lay: Layout, limits: tuple[Array, Array]) -> Bools:
    """Surfaces whose gaps at the start fixed values settle, shape (nc,)."""
    fixed = (limits[0] == limits[1])[lay.index_q[0]]
    on, chosen = problem.model.surface_coordinates, by_design(problem, "surface")
    settled: Bools = np.array([bool(fixed[list(q)].all()) for q in on], dtype=bool) & ~chosen
    return settled


@dataclass(eq=False, repr=False)
class ComplementarityLaw(Law):
    """The contacts that are left open; where nothing is, the law has no rows.

    Attributes
    ----------
    lay : Layout
    mu : array, shape (nt,)
        Coefficients of friction of surfaces, largest forces of rails; not a number where they
        vary.
    e : array, shape (nc,)
        Coefficients of restitution, not a number where the law of the model says them.
    eps : float
    scale : Scale
    """

    lay: Layout
    mu: Array
    e: Array
    eps: float
    scale: Scale
    settled: Bools = field(init=False)
    closed: Block = field(init=False)
    ends: Block = field(init=False)
    pressing: Block = field(init=False)
    cone: Block = field(init=False)
    dissipation: Block = field(init=False)
    hit: Block = field(init=False)
    rebound: Block = field(init=False)

    @property
    def _used(self) -> bool:
        return self.lay.touch.open is not None

    @property
    def _open(self) -> Open:
        return self.lay.touch.open or Open()

    @property
    def _presses(self) -> Bools:
        """Where impulses of surfaces stand that push alone, and are no places of grips, shape
        (nodes, nc)."""
        return np.asarray((self.lay.relaxed.P_r != NOWHERE) & ~self.lay.touch.contacts.pull)

    @cached_property
    def _next(self) -> Index:
        """The node after each, and the last one after itself."""
        return np.minimum(np.arange(1, self.lay.total + 2), self.lay.total)

    @property
    def facts(self) -> Hashable:
        """None: problems whose contacts are left open share no rows, and others have none of it."""
        return None

    def bounds(self, problem: Problem, box: Array, scale: Scale) -> None:
        box[self.lay.relaxed.P_r[self._presses], 0] = 0.0

    def settle(self, problem: Problem, limits: tuple[Array, Array]) -> None:
        self.settled = settled_at_start(problem, self.lay, limits)

    def inequalities(self, block: Numbering) -> None:
        if not self._used:
            return
        lay, names, hit = self.lay, self.lay.touch.contacts, self.lay.touch.surfaces
        nodes, at = np.arange(lay.total + 1), lay.collision_nodes
        presses, rubs = self._presses, two_sided(lay.relaxed.T_r != NOWHERE)
        every = np.ones(len(hit), dtype=bool)

        def of(names: tuple[str, ...], what: str) -> Label:
            return lambda k, j, *_: f"{what} of {names[j]} at node {k}"

        def at_hit(what: str) -> Label:
            return lambda i, *_: f"{what} of {lay.impact.names[i]}"

        self.ends = block(
            "ends",
            presses[[0, -1]],
            lambda e, j: f"impulse of {names.surfaces[j]} at the {('start', 'end')[e]}",
            lambda s: s.lam / lay.total,
            nodes[[1, -1]],
        )
        held = np.isin(np.arange(len(names.surfaces)), self._open.closed) & ~self.settled
        held &= ~names.pull
        self.closed = block(
            "closed at the start",
            held[None],
            of(names.surfaces, "contact"),
            lambda s: s.gap,
            nodes[:1] + 1,
        )
        self.pressing = block(
            "pressing",
            presses,
            of(names.surfaces, "complementarity"),
            lambda s: s.gap * s.lam / lay.total,
            self._next,
        )
        self.cone = block(
            "relaxed cone",
            rubs,
            of(names.tangents, "friction cone"),
            lambda s: s.friction[:, None] / lay.total,
            nodes,
        )
        self.dissipation = block(
            "dissipation",
            rubs,
            of(names.tangents, "dissipation"),
            lambda s: (s.slide * s.time * s.friction)[:, None] / lay.total**2,
            self._next,
        )
        self.hit = block(
            "hit", every, at_hit("complementarity"), lambda s: sizes_of(s.gap * s.lam, hit), at
        )
        self.rebound = block(
            "rebound",
            np.repeat(every[:, None], 2, axis=1),
            at_hit("restitution"),
            lambda s: sizes_of(s.rate * s.lam, hit)[:, None],
            at,
        )

    def constants(self) -> Iterator[tuple[int, float]]:
        if not self._used:
            return
        at_nodes = self.ends, self.closed, self.pressing, self.dissipation
        of_hits = self.hit, self.rebound
        for eps, blocks in ((self.eps, at_nodes), (min(self.eps, OF_HITS), of_hits)):
            for block in blocks:
                sizes = eps * block.sizes(self.scale)
                yield from zip(block.numbers.tolist(), sizes.tolist(), strict=True)

    # Terms ----------------------------------------------------------------------------------------

    def terms(self, places: Places, laws: Laws) -> list[Term]:
        if not self._used:
            return []
        lay, momentum, late = self.lay, laws.step.momentum.index, self._next
        P, T = places.or_zero(lay.relaxed.P_r), places.or_zero(lay.relaxed.T_r)
        t, t_late = places.times(np.arange(lay.total + 1)), places.times(late)
        return [
            Term("normal", (lay.index_q, P, t), (momentum,), -1.0),
            Term("traction", (lay.index_q, T, t), (momentum,)),
            Term("surface", (lay.index_q[:1], t[:1]), (self.closed.index,)),
            Term("gap_work", (lay.index_q[late], P, t_late), (self.pressing.index,)),
            *self._slides(places, T),
            *terms_of(self._at_nodes, self._holding, at_nodes(lay), places),
            *self._hits(places),
        ]

    def _hits(self, places: Places) -> Iterator[Term]:
        lay, nodes, hit = self.lay, self.lay.collision_nodes, self.lay.touch.surfaces
        if not len(nodes):
            return
        q, t = lay.index_q[nodes], places.times(nodes)
        lam = in_columns(lay.impact.lam, hit, places.nc, places.zero)
        yield Term("gap_work", (q, lam, t), (in_columns(self.hit.index, hit, places.nc),))
        by_law = np.isnan(self.e[hit])[:, None]
        e = np.where(by_law, 0.0, self.e[hit][:, None])
        for side, sign in enumerate((1.0, -1.0)):
            rows = self.rebound.index[:, [side]]
            yield Term("rate_work", (q, lay.impact.v_c, lam, t), (rows,), sign)
            yield Term("rate_work", (q, lay.impact.v_a, lam, t), (rows,), sign * e)
            if by_law.any():
                none = in_columns(np.full(len(hit), NOWHERE), hit, places.nc)
                law = np.where(by_law, rows, NOWHERE)
                yield Term("rebound", (q, lay.impact.v_a, lam, t), (none, none, law), sign)

    def _slides(self, places: Places, T: Index) -> Iterator[Term]:
        """Friction times how far its tangent slides in the step after the node; after the last one,
        in the step before it."""
        lay, late, rows = self.lay, self._next, self.dissipation.index
        ends = lay.index_q[late - 1], lay.index_q[late]
        when = places.times(late - 1), places.times(late)
        *state, at = at_nodes(lay)(np.arange(lay.total + 1), places)
        for side, sign in enumerate((1.0, -1.0)):
            yield Term("slip_work", (*ends, T, *when), (rows[:, :, side],), -1.0)
            for t in self._open.tangents:
                for limit, factor in self._pressed(t):
                    alone = np.full(T.shape, places.zero)
                    alone[:, t] = places.or_zero(limit)
                    own = np.full(T.shape, NOWHERE)
                    own[:, t] = rows[:, t, side]
                    factors = -sign * factor[:, None]
                    if np.isnan(self.mu[t]):
                        arguments = (*state, alone, at, *ends, *when)
                        yield Term("bearing_work", arguments, (own,), factors)
                    else:
                        factors = self.mu[t] * factors
                        yield Term("slip_work", (*ends, alone, *when), (own,), factors)

    @property
    def _holding(self) -> Iterator[Product]:
        """Friction mu P, in the rows of the cones."""
        at = np.arange(self.lay.total + 1)
        for t in self._open.tangents:
            for side in range(2):
                for limit, factor in self._pressed(t):
                    yield Product(t, at, self.cone.index[:, t, side], limit, factor)

    @property
    def _at_nodes(self) -> Array:
        """Coefficients at the nodes, shape (total + 1, nt)."""
        return np.broadcast_to(self.mu, (self.lay.total + 1, len(self.mu)))

    def _pressed(self, t: int) -> Iterator[tuple[Index, Array]]:
        """Unknowns that press a tangent at the nodes, and their factors, shape (total + 1,)
        each."""
        lay, surface = self.lay, self.lay.touch.contacts.supports[t]
        if surface != RAIL:
            struck, of = np.full(lay.total + 1, NOWHERE), lay.touch.surfaces == surface
            struck[lay.collision_nodes[of]] = lay.impact.lam[of]
            for impulses in (lay.relaxed.P_r[:, surface], struck):
                yield impulses, np.ones(lay.total + 1)
            return
        h, none = lay.index_h[lay.phase_of_step], np.full(1, NOWHERE)
        before, after = np.concatenate([none, h]), np.concatenate([h, none])
        same = before == after  # one unknown, which a row has once
        yield np.where(same, NOWHERE, before), np.full(lay.total + 1, 0.5)
        yield after, np.where(same, 1.0, 0.5)

    # Linear rows and pivots -----------------------------------------------------------------------

    def entries(self, laws: Laws) -> list[Entries]:
        """Entries of the cones, and of the ends: there is no impact."""
        P, entries = self.lay.relaxed.P_r, list[Entries]()
        for e, beside in ((0, 1), (-1, -2)) if self._used else ():
            rows = self.ends.index[e]
            at = rows != NOWHERE
            for unknowns, sign in ((P[e], -1.0), (P[beside], 1.0)):
                entries.append((rows[at], unknowns[at], np.full(at.sum(), sign)))
        for t in self._open.tangents:
            for side, sign in enumerate((1.0, -1.0)):
                rows = self.cone.index[:, t, side]
                at = rows != NOWHERE
                T = self.lay.relaxed.T_r[at, t]
                entries.append((rows[at], T, np.full(int(at.sum()), sign)))
        return [*entries, *entries_of(self._at_nodes, self._holding)]

    def pivots(self, laws: Laws) -> Iterator[Pivot]:
        """Impulses belong to their nodes, as inputs do."""
        if not self._used:
            return
        lay = self.lay
        at = key(np.minimum(np.arange(lay.total + 1), lay.total - 1), INPUT)
        yield Pivot(lay.relaxed.P_r, None, at)
        yield Pivot(lay.relaxed.T_r, None, at)
        yield Pivot(lay.impact.lam, None, key(lay.collision_nodes, INPUT))
