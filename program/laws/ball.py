"""Hits of contacts with two tangential directions, as those of a ball: their rows and terms.

Where the normal impulse changes no sliding velocity sigma (2,), and tangential ones change it alike
in all directions, sigma keeps its direction in a hit.  The rate of the gap obeys Newton's law
(:mod:`dmoc.program.laws.impact`), and the tangential impulse T (2,) is the one that leaves -e_t
times the sliding velocity, or that of friction where this holds less (equation :eq:`ball` of the
theory)::

    stops      sigma(q_c, v_c) + e_t sigma(q_c, v_a) = 0       of a hit that sticks
    holds      (mu lam)^2 - T.T >= 0
    slides     T + mu lam sigma(q_c, v_a)/|sigma(q_c, v_a)| = 0      of one that slides
    goes on    -T.(sigma(q_c, v_c) + e_t sigma(q_c, v_a)) >= 0

The last row says that friction stops no more than what would stick.  A hit that grazes has T = 0.

R. L. Garwin, American Journal of Physics 37 (1969) 88-92.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.motion.friction import SLIP, STICK, sticks
from dmoc.motion.impact_laws import BALL
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
from dmoc.program.hit_stages import Passage
from dmoc.program.laws.law import COLLISION, Law, Pivot, key
from dmoc.program.layout import Layout
from dmoc.program.terms import Places, Term

if TYPE_CHECKING:
    from dmoc.program.laws.laws import Laws


class Bounce(NamedTuple):
    """Impulses (P, T) of a hit, shape (1, 3), and whether it sticks or slides."""

    path: Array
    friction: int


def bounced(rates: Array, A: Array, mu: float, e: float, e_t: float) -> Bounce:
    """The hit from the rates of separation, negative where the bodies approach, and of sliding
    (3,), and what impulses along normal and tangents change them by, A (3, 3)."""
    P, T = -(1 + e) * float(rates[0]) / A[0, 0], -(1 + e_t) * rates[1:] / A[1, 1]
    needed, held = float(np.hypot(*T)), mu * P
    if needed <= held:
        return Bounce(np.array([[P, *T]]), STICK)
    return Bounce(np.array([[P, *(T * (held / needed))]]), SLIP)


@dataclass(eq=False, repr=False)
class BallLaw(Law):
    """The hits of contacts with two tangential directions of a problem.

    Attributes
    ----------
    lay : Layout
    mu : array, shape (events,)
        Friction in its hits, by which their cones are measured; 1 where it is none or a solver
        chooses it.
    e_t : array, shape (nt,)
        Tangential restitution.
    grazing : array of bool, shape (events,)
        Hits that graze their surface.
    """

    lay: Layout
    mu: Array
    e_t: Array
    grazing: Bools
    stops: Block = field(init=False)
    slides: Block = field(init=False)
    rests: Block = field(init=False)
    holds: Block = field(init=False)
    goes_on: Block = field(init=False)

    @classmethod
    def of(cls, lay: Layout, mu: Array, e_t: Array, grazing: Bools) -> BallLaw:
        """The law with the friction of all events, shape (events, nt)."""
        law = cls(lay, np.ones(len(grazing)), e_t, grazing)
        for p in law.passages:
            if mu[p.event, p.tangent] > 0:
                law.mu[p.event] = mu[p.event, p.tangent]
        return law

    @property
    def passages(self) -> tuple[Passage, ...]:
        return tuple(p for p in self.lay.hit.passages if p.law == BALL)

    def _hits(self, way: int | None = None) -> Bools:
        """Hits, shape (events,); those of a way that do not graze."""
        if way is None:
            return mask_of(len(self.grazing), [p.event for p in self.passages])
        mine = [p.event for p in self.passages if p.friction[-1] == way]
        return mask_of(len(self.grazing), mine) & ~self.grazing

    # Rows -----------------------------------------------------------------------------------------

    def equations(self, block: Numbering) -> None:
        names, along = self.lay.touch.contacts.tangents, self._along

        def direction(of: str) -> Callable[[int, int], str]:
            return lambda i, d: f"{of} of {names[along[i, d]]} at event {i + 1}"

        def law(i: int, _: int) -> str:
            return f"the hit of {names[along[i, 0]]} at event {i + 1} violates the law of a ball"

        self.stops = block(
            "stops as a ball", _twice(self._hits(STICK)), direction("sliding velocity"),
            lambda s: s.slide[along], missed=Missed(LAW, law),
        )  # fmt: skip
        self.slides = block(
            "slides as a ball", _twice(self._hits(SLIP)), direction("sliding friction"),
            lambda s: s.friction[along], missed=Missed(LAW, law),
        )  # fmt: skip
        self.rests = block(
            "grazes as a ball", _twice(self._hits() & self.grazing),
            direction("friction impulse"), lambda s: s.friction[along],
        )  # fmt: skip

    def inequalities(self, block: Numbering) -> None:
        names, first = self.lay.touch.contacts.tangents, self._along[:, 0]
        self.holds = block(
            "cone of a ball",
            self._hits(STICK),
            lambda i: f"friction cone of {names[first[i]]} at event {i + 1}",
            lambda s: (self.mu * s.lam[self.lay.hit.hit]) ** 2,
        )
        self.goes_on = block(
            "a ball goes on",
            self._hits(SLIP),
            lambda i: f"sliding of {names[first[i]]} in event {i + 1}",
            lambda s: (s.friction * s.slide)[first],
        )

    @property
    def _along(self) -> Index:
        """Numbers of both tangents of events, shape (events, 2), 0 of others."""
        along = np.zeros((len(self.grazing), 2), dtype=np.intp)
        for p in self.passages:
            along[p.event] = p.tangents
        return along

    # Terms and entries ----------------------------------------------------------------------------

    def terms(self, places: Places, laws: Laws) -> list[Term]:
        own = np.flatnonzero(self._hits() & ~self.grazing)
        if not len(own):
            return []
        lay, contacts = self.lay, self.lay.touch.contacts
        q, hit = lay.index_q[lay.collision_nodes[own]], lay.hit.hit[own]
        t, before, after = (
            places.times(lay.collision_nodes[own]), lay.impact.v_a[own], lay.impact.v_c[own],
        )  # fmt: skip
        T = places.or_zero(lay.contact.T_c[own])
        lam = in_columns(lay.impact.lam[own], hit, places.nc, places.zero)
        pair = np.array([contacts.in_space.index(j) for j in hit.tolist()])

        def rows(of: Index) -> Index:
            return in_columns(of[own], pair, len(contacts.pairs))

        goes_on = rows(self.goes_on.index)
        e_t = self.e_t[self._along[own, :1]]
        stops, slides = (
            self._by_tangents(block.index[own], own) for block in (self.stops, self.slides)
        )
        return [
            Term("skid", (q, before, T, t), (goes_on,), -e_t),
            Term("skid", (q, after, T, t), (goes_on,), -1.0),
            Term("cone", (q, T, lam, t), (rows(self.holds.index),)),
            Term("drag", (q, before, lam, t), (slides,)),
            Term("slide_rate", (q, after, t), (stops,)),
            Term("slide_rate", (q, before, t), (stops,), e_t),
        ]

    def _by_tangents(self, rows: Index, events: Index) -> Index:
        """Rows of both directions of some events (k, 2) in the columns of their tangents."""
        columns = np.full((len(events), len(self.e_t)), NOWHERE)
        np.put_along_axis(columns, self._along[events], rows, axis=1)
        return columns

    def entries(self, laws: Laws) -> list[Entries]:
        """T of hits that slide, and of those that graze."""
        rows = [(self._rows(p), p) for p in self.passages]
        return [
            (of.index[p.event], self.lay.contact.T_c[p.event, list(p.tangents)], np.ones(2))
            for of, p in rows
            if of is not self.stops
        ]

    def _rows(self, p: Passage) -> Block:
        """The rows that say the tangential impulses of a hit."""
        if self.grazing[p.event]:
            return self.rests
        return self.stops if sticks(p.friction[-1]) else self.slides

    # Pivots ---------------------------------------------------------------------------------------

    def pivots(self, laws: Laws) -> Iterator[Pivot]:
        """The tangential impulses follow from the sliding velocity after the hit, or from friction
        and the one before."""
        for p in self.passages:
            i = p.event
            T_c = self.lay.contact.T_c[i, list(p.tangents)]
            yield Pivot(T_c, self._rows(p).index[i], key(self.lay.collision_nodes[i], COLLISION))


def _twice(mask: Bools) -> Bools:
    """For both directions, shape (events, 2)."""
    return np.repeat(mask[:, None], 2, axis=1)
