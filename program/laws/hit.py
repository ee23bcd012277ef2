"""Impacts with friction: their rows and terms, after Coulomb and a law of restitution.

In an impact the impulse P along the normal takes the place of the time; T is that along the
tangent.  An impact goes through stages (:mod:`dmoc.program.hit_stages`), in each of which the
contact slides in one direction or sticks.  At the moments between them, the end of compression and
the stop of sliding, there are a velocity v_h and the impulses P_h, T_h until then; the whole
impulses are lam and T_c::

    within       dL/dv(q_c, v_h) - dL/dv(q_c, v_a) + P_h grad g - T_h grad tau = 0
    energy       gamma(q_c, v_h) = 0                       at the end of compression
    restitution  the law of restitution                    of the whole impact
    halts        sigma(q_c, v) = 0                         where sliding stops, and while it sticks
    slips        dT + s mu dP = 0                          in stages that slide in the direction s
    share        dP >= 0                                   in stages
    bears        mu dP - |dT| >= 0                         in the stage that sticks
    heads        s sigma(q_c, v) >= 0                      before and after the impact, where it
                                                           slides

with the differences dP, dT of a stage.  The rates are linear in the impulses, so that within a
stage sigma has the sign that it has at both ends.  A landing is compression alone and has the law
of :mod:`dmoc.program.laws.impact` for its end.  No term needs the inverse of the mass matrix.  The
laws of restitution are a file each: :mod:`dmoc.program.laws.poisson`.

Hits with tangential restitution have the row within of this law, and those of
:mod:`dmoc.program.laws.tangential` beside it.

In a hit that grazes, all impulses are zero: lam and P_h where sliding stops by their bounds,
the others by the equations.  Inequalities between them would have no interior, nor would those of
directions where sliding stops; the velocity is the same before and after.

Y. Wang and M. T. Mason, Journal of Applied Mechanics 59 (1992) 635-642.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from dmoc.base.names import momentum_name
from dmoc.codegen.kernels import Array
from dmoc.motion.friction import friction_word, sticks
from dmoc.motion.impact_laws import IMPACT_LAWS, POISSON, STRONGE
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
)
from dmoc.program.coefficients import Product, at_events, entries_of, terms_of
from dmoc.program.hit_stages import END, MOMENTS, STAGES, STOP, Passage, moment
from dmoc.program.laws.impact import ImpactLaw, restitution_of
from dmoc.program.laws.law import COLLISION, Law, Pivot, key
from dmoc.program.laws.poisson import PoissonRestitution
from dmoc.program.laws.restitution import Restitution
from dmoc.program.laws.stronge import StrongeRestitution
from dmoc.program.layout import Layout
from dmoc.program.scale import Scale
from dmoc.program.terms import Places, Term, forward

if TYPE_CHECKING:
    from dmoc.program.laws.laws import Laws

RESTITUTIONS: dict[str, Restitution] = {
    POISSON: PoissonRestitution(), STRONGE: StrongeRestitution(),
}  # fmt: skip
# Columns of the row "halts": before, at the moments, after; of "heads": before, after.
BEFORE, AFTER = 0, 1 + len(MOMENTS)


@dataclass(eq=False, repr=False)
class HitLaw(Law):
    """The impacts with friction of a problem.

    Attributes
    ----------
    lay : Layout
    names : tuple of str
        Coordinates.
    mu : array, shape (events, nt)
    e : array, shape (events,)
        Coefficients of restitution, not a number where they vary with the rate before the hit.
    grazing : array of bool, shape (events,)
        Hits that graze their surface.
    """

    numbers = "mu", "e"

    lay: Layout
    names: tuple[str, ...]
    mu: Array
    e: Array
    grazing: Bools
    within: Block = field(init=False)
    restitution: Block = field(init=False)
    halts: Block = field(init=False)
    slips: Block = field(init=False)
    share: Block = field(init=False)
    bears: Block = field(init=False)
    heads: Block = field(init=False)

    @classmethod
    def of(cls, problem: Problem, lay: Layout, impact: ImpactLaw) -> HitLaw:
        names, e = tuple(problem.kernels.coordinates), restitution_of(problem, lay.touch.surfaces)
        for p in lay.hit.passages:
            if IMPACT_LAWS[p.law].constant:
                e[p.event] = _constant(problem, p.event, p.surface)
        return cls(lay, names, problem.friction[:-1], e, impact.grazing)

    def bounds(self, problem: Problem, box: Array, scale: Scale) -> None:
        P_h = self.lay.hit.P_h
        struck, stops = P_h[~self.grazing & ~self.whole], P_h[self.grazing, STOP]
        box[struck[struck != NOWHERE], 0] = 0.0
        # Of a graze, the impulse of compression is zero by its equation, and no bound beside it.
        box[stops[stops != NOWHERE]] = 0.0

    @property
    def passages(self) -> tuple[Passage, ...]:
        """Passages of hits whose law has stages."""
        return tuple(p for p in self.lay.hit.passages if not p.whole)

    @property
    def whole(self) -> Bools:
        """Hits that do not, shape (events,)."""
        return mask_of(len(self.e), [p.event for p in self.lay.hit.passages if p.whole])

    def _law(self, p: Passage) -> Restitution:
        """The law of restitution of a hit."""
        return RESTITUTIONS[p.law]

    # Rows -----------------------------------------------------------------------------------------

    def equations(self, block: Numbering) -> None:
        moments, count = self.lay.hit.moments, len(self.lay.touch.surfaces)
        halts = np.zeros((count, AFTER + 1), dtype=bool)
        slips = np.zeros((count, STAGES), dtype=bool)
        ways = self.passages
        for p in ways:
            halts[p.event, BEFORE] = sticks(p.friction[0])
            halts[p.event, [1 + m for m in p.rests]] = True
            halts[p.event, AFTER] = sticks(p.friction[-1])
            slips[p.event, np.flatnonzero(p.friction)] = True
        quadratic = mask_of(count, [p.event for p in ways if self._law(p).is_quadratic(self, p)])
        hit, rubbed, contacts = self.lay.hit.hit, self.lay.hit.rubbed, self.lay.touch.contacts
        names, tangents = self.names, contacts.tangents

        def place(i: int, column: int) -> str:
            sides = {BEFORE: f"before event {i + 1}", AFTER: f"after event {i + 1}"}
            return sides.get(column) or moment(i, column - 1)

        self.within = block(
            "within",
            np.repeat(moments[:, :, None], len(names), axis=2),
            lambda i, m, j: f"{momentum_name(names[j])} {moment(i, m)}",
            lambda s: s.p,
            missed=Missed(LAW, lambda *_: "a velocity within a hit does not fit its momentum"),
        )
        self.restitution = block(
            "restitution",
            moments[:, END] & ~self.whole,
            lambda i: f"restitution of {contacts.surfaces[hit[i]]} at event {i + 1}",
            lambda s: s.lam[hit] * np.where(quadratic, s.rate[hit], 1.0),
            missed=Missed(LAW),
        )
        self.halts = block(
            "halts",
            halts,
            lambda i, m: f"sliding velocity of {tangents[rubbed[i]]} {place(i, m)}",
            lambda s: s.slide[rubbed][:, None],
        )
        self.slips = block(
            "slips",
            slips,
            lambda i, k: f"sliding friction of {self._stage(i, k)}",
            lambda s: s.friction[rubbed][:, None],
            missed=Missed(LAW),
        )

    def inequalities(self, block: Numbering) -> None:
        """The last axis of ``bears`` are the two sides of the cone."""
        count = len(self.lay.touch.surfaces)
        share = np.zeros((count, STAGES), dtype=bool)
        bears = np.zeros((count, STAGES, 2), dtype=bool)
        heads = np.zeros((count, 2), dtype=bool)
        for p in self.passages:
            if self.grazing[p.event]:
                heads[p.event, 1] = not sticks(p.friction[-1]) and STOP not in p.moments
                continue
            heads[p.event] = [not sticks(p.friction[side]) for side in (0, -1)]
            sticking, last = p.bears(self.e[p.event]), len(p.moments)
            share[p.event, list(p.shares(self.e[p.event]))] = True
            share[p.event, last] |= sticking != last and self._law(p).is_quadratic(self, p)
            if sticking is not None:
                bears[p.event, sticking] = True
        hit, rubbed = self.lay.hit.hit, self.lay.hit.rubbed
        tangents, of = self.lay.touch.contacts.tangents, {p.event: p for p in self.passages}

        def direction(i: int, side: int) -> str:
            word = friction_word(of[i].friction[-side])
            return f"{word} of {tangents[rubbed[i]]} {'after' if side else 'before'} event {i + 1}"

        self.share = block(
            "share",
            share,
            lambda i, k: f"impulse of {self._stage(i, k)} >= 0",
            lambda s: s.lam[hit][:, None],
        )
        self.bears = block(
            "bears",
            bears,
            lambda i, k, _: f"friction cone of {self._stage(i, k)}",
            lambda s: s.friction[rubbed][:, None, None],
        )
        self.heads = block("heads", heads, direction, lambda s: s.slide[rubbed][:, None])

    def _stage(self, event: int, stage: int) -> str:
        name = self.lay.touch.contacts.tangents[self.lay.hit.rubbed[event]]
        return f"{name} in stage {stage + 1} of event {event + 1}"

    # Terms ----------------------------------------------------------------------------------------

    def terms(self, places: Places, laws: Laws) -> list[Term]:
        """Terms of the rows of hits, and of their tangential impulses in the momentum."""
        lay, momentum = self.lay, laws.step.momentum.index
        if not lay.hit.passages:
            return []
        nodes = lay.collision_nodes
        q, t = lay.index_q[nodes], places.times(nodes)
        hit, rubbed = lay.hit.hit, lay.hit.rubbed
        P = places.or_zero(in_columns(lay.hit.P_h, hit, places.nc))
        T = places.or_zero(in_columns(lay.hit.T_h, rubbed, self.mu.shape[1]))
        terms = []
        if lay.touch.free:  # else the law of contacts that last adds them all
            traction = places.or_zero(lay.contact.T_c)
            terms.append(Term("traction", (q, traction, t), (momentum[nodes],)))
        v_h = places.or_zero(lay.hit.v_h)
        for m in range(len(MOMENTS)):
            rows, here = self.within.index[:, m], np.flatnonzero(lay.hit.moments[:, m])
            if not len(here):
                continue
            at, when, rows = q[here], t[here] if lay.timed else t, rows[here]
            terms += [
                Term("momentum", (at, v_h[here, m], when), (rows,)),
                Term("momentum", (at, lay.impact.v_a[here], when), (rows,), -1.0),
                Term("normal", (at, P[here, m], when), (rows,)),
                Term("traction", (at, T[here, m], when), (rows,), -1.0),
            ]
        compressed = lay.hit.moments[:, END] & ~self.whole
        ended = np.where(compressed, laws.impact.energy.index, NOWHERE)
        terms.append(Term("gap_rate", (q, v_h[:, END], t), (in_columns(ended, hit, places.nc),)))
        for name, law in RESTITUTIONS.items():
            terms += law.terms(self, [p for p in self.passages if p.law == name], places)
        sides = [lay.impact.v_a, *np.moveaxis(v_h, 1, 0), lay.impact.v_c]
        for v, rows in zip(sides, self.halts.index.T, strict=True):
            terms.append(
                Term("slide_rate", (q, v, t), (in_columns(rows, rubbed, self.mu.shape[1]),))
            )
        states = np.zeros((len(nodes), 2))
        for p in self.passages:
            states[p.event] = p.friction[0], p.friction[-1]
        for side, v in enumerate((lay.impact.v_a, lay.impact.v_c)):
            rows = in_columns(self.heads.index[:, side], rubbed, self.mu.shape[1])
            terms += forward(lay, nodes, v, states[:, side, None], rows, places)
        return [*terms, *terms_of(self.mu, self._holding, at_events(lay), places)]

    # Linear rows ----------------------------------------------------------------------------------

    def entries(self, laws: Laws) -> list[Entries]:
        """Entries of the linear rows: restitution, and what impulses stages have."""
        entries = list[Entries]()
        for p in self.passages:
            i, (P, T) = p.event, self.impulses(p)
            entries += self._law(p).entries(self, p)
            for k in range(len(p.friction)):
                bears = self.bears.index[i, k]
                for row, at, sign in (
                    (self.slips.index[i, k], T, 1.0),
                    (self.share.index[i, k], P, 1.0),
                    (bears[0], T, -1.0),
                    (bears[1], T, 1.0),
                ):
                    ends = at[[k + 1, k]]
                    there = (ends != NOWHERE) & (row != NOWHERE)
                    factors = sign * np.array([1.0, -1.0])[there]
                    entries.append((np.full(int(there.sum()), row), ends[there], factors))
        return [*entries, *entries_of(self.mu, self._holding)]

    def impulses(self, p: Passage) -> tuple[Index, Index]:
        """Unknown impulses P and T until each moment and of the whole impact, shape (moments + 2,)
        each; nowhere at its begin."""
        i, lay, moments = p.event, self.lay, list(p.moments)
        P = [NOWHERE, *lay.hit.P_h[i, moments], lay.impact.lam[i]]
        return np.array(P), np.array(
            [NOWHERE, *lay.hit.T_h[i, moments], lay.contact.T_c[i, p.tangent]]
        )

    @property
    def _holding(self) -> Iterator[Product]:
        """Friction mu dP of stages, in the rows of sliding and of cones."""
        for p in self.passages:
            i, (P, _) = p.event, self.impulses(p)
            for k, s in enumerate(p.friction):
                for row, sign in (
                    (self.slips.index[i, k], float(s)), (self.bears.index[i, k, 0], 1.0),
                    (self.bears.index[i, k, 1], 1.0),
                ):  # fmt: skip
                    rows, at = np.full(2, row), np.full(2, i)
                    factors = sign * np.array([1.0, -1.0])
                    yield Product(p.tangent, at, rows, P[[k + 1, k]], factors)

    # Pivots ---------------------------------------------------------------------------------------

    def pivots(self, laws: Laws) -> Iterator[Pivot]:
        """A velocity follows from its momentum, the tangential impulse from the law of sliding or
        from the rest, and then the normal one from the rate that ends its stage."""
        lay, energy = self.lay, laws.impact.energy.index
        for p in self.passages:
            i, node = p.event, lay.collision_nodes[p.event]
            before, after = key(node - 1, COLLISION), key(node, COLLISION)
            for stage, m in enumerate(p.moments):
                T, P = lay.hit.T_h[i, [m]], lay.hit.P_h[i, [m]]
                yield Pivot(lay.hit.v_h[i, m], self.within.index[i, m], before)
                slides = not sticks(p.friction[stage])
                rest = self.halts.index[i, [1 + m]]
                yield Pivot(T, self.slips.index[i, [stage]] if slides else rest, before)
                yield Pivot(P, rest if m == STOP else energy[[i]], before)
            if not p.lands:
                yield Pivot(lay.impact.lam[[i]], self.restitution.index[[i]], before)
            T_c, last = lay.contact.T_c[i, [p.tangent]], len(p.moments)
            if not sticks(p.friction[-1]):
                yield Pivot(T_c, self.slips.index[i, [last]], before)
            else:
                yield Pivot(T_c, self.halts.index[i, [AFTER]], after)


def _constant(problem: Problem, event: int, surface: int) -> float:
    """The coefficient of restitution of a surface at an event, in which no state is."""
    nowhere, values = np.zeros(problem.nq), problem.restitution_values
    return float(problem.models[event].coefficients(values, nowhere, nowhere, 0.0)[surface])
