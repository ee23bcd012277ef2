"""Hits with tangential restitution: their rows and terms, after Chatterjee and Ruina.

The impulses P_h and T_h are those of the hit that stops all at once, plastic and without sliding,
and v_h is the velocity after it.  Of the hit itself, the rate of the gap obeys Newton's law
(:mod:`dmoc.program.laws.impact`), and the tangential impulse T_c is the one that stops sliding with
what comes back of it, or that of friction where this holds less (equation :eq:`hit-tangential` of
the theory)::

    within     dL/dv(q_c, v_h) - dL/dv(q_c, v_a) + P_h grad g - T_h grad tau = 0
    stops      gamma(q_c, v_h) = 0,  sigma(q_c, v_h) = 0
    returns    T_c - (1 + e_t) T_h = 0                  of a hit that sticks
               T_c + s mu lam = 0                       of one that slides in the direction s
    holds      mu lam - |T_c| >= 0                      of a hit that sticks, with friction
    slides     -s (1 + e_t) T_h - mu lam >= 0           of one that slides

The row within is that of :mod:`dmoc.program.laws.hit`.  A hit that grazes has no impulse:
T_c = 0.

A. Chatterjee and A. Ruina, Journal of Applied Mechanics 65 (1998) 939-951.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dmoc.base.tolerances import SAME
from dmoc.codegen.kernels import Array
from dmoc.motion.friction import STICK, sliding_against, sticks
from dmoc.motion.impact_laws import RETURNING
from dmoc.program.blocks import (
    LAW,
    NOWHERE,
    Block,
    Bools,
    Entries,
    Missed,
    Numbering,
    in_columns,
    mask_of,
)
from dmoc.program.coefficients import Product, at_events, entries_of, terms_of
from dmoc.program.hit_stages import END, Passage
from dmoc.program.laws.law import COLLISION, Law, Pivot, key
from dmoc.program.layout import Layout
from dmoc.program.terms import Places, Term

if TYPE_CHECKING:
    from dmoc.program.laws.laws import Laws

# Columns of the row "stops".
GAP, SLIDE = 0, 1


class Returned(NamedTuple):
    """Impulses along normal and tangent (2,) of the hit that stops all at once and of the hit, and
    how it ends: it sticks, or slides in a direction."""

    stopping: Array
    impulses: Array
    friction: int

    @property
    def path(self) -> Array:
        """Both impulses, shape (2, 2)."""
        return np.array([self.stopping, self.impulses])


def _is_bound(A: Array) -> bool:
    """Whether a tangent moves with the gap alone, so that nothing is left to come back along it."""
    return not A[1, 1] * A[0, 0] - A[0, 1] ** 2 > SAME * A[1, 1] * A[0, 0]


def returned(rates: Array, A: Array, mu: float, e: float, e_t: float) -> Returned:
    """The hit from the rates of separation, negative where the bodies approach, and of sliding
    (2,), and what impulses along normal and tangent change them by, A (2, 2)."""
    n, sigma = float(rates[0]), float(rates[1])
    along = A[0, 1] / A[0, 0]
    T_0 = 0.0 if _is_bound(A) else -(sigma - along * n) / (A[1, 1] - along * A[0, 1])
    stopping = np.array([-n / A[0, 0] - along * T_0, T_0])
    T, s = (1 + e_t) * T_0, STICK
    lam = -(1 + e) * n / A[0, 0] - along * T
    if mu < np.inf and abs(T) > mu * lam:
        s = sliding_against(T)
        lam = -(1 + e) * n / (A[0, 0] - s * mu * A[0, 1])
        T = -s * mu * lam
    return Returned(stopping, np.array([lam, T]), s)


@dataclass(eq=False, repr=False)
class TangentialLaw(Law):
    """The hits with tangential restitution of a problem.

    Attributes
    ----------
    lay : Layout
    mu : array, shape (events, nt)
        Friction in hits, without end where there is no limit.
    e_t : array, shape (nt,)
        Tangential restitution.
    grazing : array of bool, shape (events,)
        Hits that graze their surface.
    """

    numbers = "mu", "e_t"

    lay: Layout
    mu: Array
    e_t: Array
    grazing: Bools
    stops: Block = field(init=False)
    returns: Block = field(init=False)
    holds: Block = field(init=False)
    slides: Block = field(init=False)

    @property
    def passages(self) -> tuple[Passage, ...]:
        return tuple(p for p in self.lay.hit.passages if p.law == RETURNING)

    def _mask(self, passages: Iterable[Passage]) -> Bools:
        """The events of some hits, shape (events,)."""
        return mask_of(len(self.grazing), [p.event for p in passages])

    # Rows -----------------------------------------------------------------------------------------

    def equations(self, block: Numbering) -> None:
        hit, rubbed, names = self.lay.hit.hit, self.lay.hit.rubbed, self.lay.touch.contacts
        mine = self._mask(self.passages)

        def rate(i: int, side: int) -> str:
            of = names.tangents[rubbed[i]] if side == SLIDE else names.surfaces[hit[i]]
            what = "sliding velocity" if side == SLIDE else "rate"
            return f"{what} of {of} where all of event {i + 1} stops"

        self.stops = block(
            "stops all",
            np.repeat(mine[:, None], 2, axis=1),
            rate,
            lambda s: np.stack([s.rate[hit], s.slide[rubbed]], axis=1),
            missed=Missed(LAW),
        )
        self.returns = block(
            "returns",
            mine,
            lambda i: f"tangential restitution of {names.tangents[rubbed[i]]} at event {i + 1}",
            lambda s: s.friction[rubbed],
            missed=Missed(
                LAW,
                lambda i: (
                    f"the hit of {names.surfaces[hit[i]]} at event {i + 1} violates its law "
                    "of tangential restitution"
                ),
            ),
        )

    def inequalities(self, block: Numbering) -> None:
        """The last axis of ``holds`` are the two sides of the cone."""
        rubbed, tangents = self.lay.hit.rubbed, self.lay.touch.contacts.tangents
        limited = [p for p in self.passages if self.mu[p.event, p.tangent] != np.inf]
        holds = self._mask(p for p in limited if sticks(p.friction[-1])) & ~self.grazing
        slides = self._mask(p for p in limited if not sticks(p.friction[-1]))
        self.holds = block(
            "cone of a return",
            np.repeat(holds[:, None], 2, axis=1),
            lambda i, _: f"friction cone of {tangents[rubbed[i]]} at event {i + 1}",
            lambda s: s.friction[rubbed][:, None],
        )
        self.slides = block(
            "slides in a return",
            slides,
            lambda i: f"sliding of {tangents[rubbed[i]]} in event {i + 1}",
            lambda s: s.friction[rubbed],
        )

    # Terms and entries ----------------------------------------------------------------------------

    def terms(self, places: Places, laws: Laws) -> list[Term]:
        if not self.passages:
            return []
        lay, nodes = self.lay, self.lay.collision_nodes
        at = lay.index_q[nodes], places.or_zero(lay.hit.v_h[:, END]), places.times(nodes)
        gap = in_columns(self.stops.index[:, GAP], lay.hit.hit, places.nc)
        slide = in_columns(self.stops.index[:, SLIDE], lay.hit.rubbed, self.mu.shape[1])
        rubs = terms_of(self.mu, self._holding, at_events(lay), places)
        return [Term("gap_rate", at, (gap,)), Term("slide_rate", at, (slide,)), *rubs]

    def entries(self, laws: Laws) -> list[Entries]:
        own = [row for p in self.passages for row in self._of_hit(p)]
        return [*own, *entries_of(self.mu, self._holding)]

    def _of_hit(self, p: Passage) -> Iterator[Entries]:
        """Entries of the tangential impulses of one hit."""
        i, s = p.event, p.friction[-1]
        T_c, T_h = self.lay.contact.T_c[i, p.tangent], self.lay.hit.T_h[i, END]
        back = 1 + float(self.e_t[p.tangent])
        comes_back = sticks(s) and not self.grazing[i]
        for row, unknown, factor in (
            (self.returns.index[i], T_c, 1.0),
            (self.returns.index[i] if comes_back else NOWHERE, T_h, -back),
            (self.holds.index[i, 0], T_c, -1.0),
            (self.holds.index[i, 1], T_c, 1.0),
            (self.slides.index[i], T_h, -s * back),
        ):
            if row != NOWHERE:
                yield np.array([row]), np.array([unknown]), np.array([factor])

    @property
    def _holding(self) -> Iterator[Product]:
        """Friction mu lam, in the rows of hits that it limits."""
        for p in self.passages:
            i, s = p.event, float(p.friction[-1])
            if self.mu[i, p.tangent] == np.inf:
                continue
            slides = self.returns.index[i] if s and not self.grazing[i] else NOWHERE
            rows = np.array([slides, *self.holds.index[i], self.slides.index[i]])
            at, lam = np.full(4, i), np.full(4, self.lay.impact.lam[i])
            yield Product(p.tangent, at, rows, lam, np.array([s, 1.0, 1.0, -1.0]))

    # Pivots ---------------------------------------------------------------------------------------

    def pivots(self, laws: Laws) -> Iterator[Pivot]:
        """The velocity that is stopped follows from its momentum, its impulses from the rates, and
        the tangential impulse of the hit from these."""
        hit = self.lay.hit
        for p in self.passages:
            i, before = p.event, key(self.lay.collision_nodes[p.event] - 1, COLLISION)
            yield Pivot(hit.v_h[i, END], laws.hit.within.index[i, END], before)
            yield Pivot(hit.T_h[i, [END]], self.stops.index[i, [SLIDE]], before)
            yield Pivot(hit.P_h[i, [END]], self.stops.index[i, [GAP]], before)
            T_c = self.lay.contact.T_c[i, [p.tangent]]
            yield Pivot(T_c, self.returns.index[[i]], before)
