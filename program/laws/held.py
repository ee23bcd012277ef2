"""What holds during an impact with friction: closed contacts and constraints, with their impulses.

At the moments within an impact (:mod:`dmoc.program.laws.hit`) the contacts that stay closed and the
constraints have no rates, and have taken impulses P_b, T_b and R_b until then.  The friction of
these contacts does not change in the impact::

    within      ... + P_b grad g - T_b grad tau - R_b grad phi = 0
    held        gamma(q_c, v_h) = 0         of what is closed
    held fast   sigma(q_c, v_h) = 0         of what sticks
    drags       T_b + s mu P_b = 0          of what slides
    joined      phi_dot(q_c, v_h) = 0       of constraints
    presses     dP >= 0                     of contacts that do not stick
    grips       mu dP - |dT| >= 0           of those that stick
    slides on   s sigma(q_c, v_h) >= 0      of what slides, at the stop

with the differences dP, dT from the begin to the stop of sliding, and from there to the end: while
the friction of the impact is the same, all impulses grow in one proportion.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.mechanics.contacts import RAIL
from dmoc.program.blocks import NOWHERE, Block, Bools, Entries, Index, Numbering, two_sided
from dmoc.program.coefficients import AFTER, Product, against, at_events, entries_of, terms_of
from dmoc.program.hit_stages import MOMENTS, STOP, HeldUnknowns, moment
from dmoc.program.laws.contact import LawAtContacts
from dmoc.program.laws.law import COLLISION, Pivot, key
from dmoc.program.laws.sliding import forward_after
from dmoc.program.terms import Places, Term

if TYPE_CHECKING:
    from dmoc.program.laws.laws import Laws

PARTS = ("until", "after")


@dataclass(eq=False, repr=False)
class HeldLaw(LawAtContacts):
    """What holds during the impacts with friction of a problem.

    Attributes
    ----------
    contact : ContactLaw
    mu : array, shape (events, nt)
    grazing : array of bool, shape (events,)
        Hits that graze their surface.
    following : array of bool, shape (phases, nj)
        Constraints that follow from others.
    """

    numbers = ("mu",)

    mu: Array
    grazing: Bools
    following: Bools
    held: Block = field(init=False)
    fast: Block = field(init=False)
    drags: Block = field(init=False)
    joined: Block = field(init=False)
    presses: Block = field(init=False)
    grips: Block = field(init=False)
    slides_on: Block = field(init=False)

    @property
    def unknowns(self) -> HeldUnknowns:
        return self.lay.held

    @property
    def _sticks(self) -> Bools:
        """Tangents that stick after the events, shape (events, nt)."""
        return self.lay.touch.sticks[1:]

    # Rows -----------------------------------------------------------------------------------------

    def equations(self, block: Numbering) -> None:
        names, settled, held = self.lay.touch.contacts, self.contact.settled, self.unknowns
        self.held = block(
            "held",
            (held.P_b != NOWHERE) & ~settled.closed[1:, None],
            lambda i, m, j: f"rate of {names.surfaces[j]} {moment(i, m)}",
            lambda s: s.rate,
        )
        self.fast = block(
            "held fast",
            (held.T_b != NOWHERE) & (self._sticks & ~settled.sticks[1:])[:, None],
            lambda i, m, k: f"sliding velocity of {names.tangents[k]} {moment(i, m)}",
            lambda s: s.slide,
        )
        self.drags = block(
            "drags",
            (held.T_b != NOWHERE) & ~self._sticks[:, None],
            lambda i, m, k: f"sliding friction of {names.tangents[k]} {moment(i, m)}",
            lambda s: s.friction,
        )
        self.joined = block(
            "joined",
            (held.R_b != NOWHERE) & ~self.following[1:, None],
            lambda i, m, j: f"rate of constraint {self.lay.joint.names[j]} {moment(i, m)}",
            lambda s: s.joint_rate,
        )

    def inequalities(self, block: Numbering) -> None:
        """The first two axes of both are events and the parts before the stop and after it; the
        last one of ``grips`` are the two sides."""
        names, held = self.lay.touch.contacts, self.unknowns
        stops = ~self.grazing[:, None]
        drags = (held.T_b[:, STOP] != NOWHERE) & stops
        grips = drags & self._sticks
        presses = (held.P_b[:, STOP] != NOWHERE) & stops & ~names.pull
        for i, k in np.argwhere(grips).tolist():
            presses[i, names.supports[k]] = False  # its cone says more

        def part(i: int, of: int) -> str:
            return f"{PARTS[of]} sliding stops at event {i + 1}"

        self.presses = block(
            "presses",
            np.repeat(presses[:, None], len(PARTS), axis=1),
            lambda i, of, j: f"impulse of {names.surfaces[j]} {part(i, of)} >= 0",
            lambda s: s.lam,
        )
        self.grips = block(
            "grips",
            two_sided(np.repeat(grips[:, None], len(PARTS), axis=1)),
            lambda i, of, k, _: f"friction cone of {names.tangents[k]} {part(i, of)}",
            lambda s: s.friction[:, None],
        )
        self.slides_on = block(
            "slides on",
            drags & ~grips,
            lambda i, k: f"sliding of {names.tangents[k]} {moment(i, STOP)}",
            lambda s: s.slide,
        )

    # Terms ----------------------------------------------------------------------------------------

    def terms(self, places: Places, laws: Laws) -> list[Term]:
        lay, held, nodes = self.lay, self.unknowns, self.lay.collision_nodes
        terms = list[Term]()
        for m in range(len(MOMENTS)):
            here = np.flatnonzero(lay.hit.moments[:, m])
            if not len(here):
                continue
            q, t = lay.index_q[nodes[here]], places.times(nodes[here])
            within, v = laws.hit.within.index[here, m], lay.hit.v_h[here, m]
            for unknown, row, push, rate, sign in (
                (held.P_b, self.held, "normal", "gap_rate", 1.0),
                (held.T_b, self.fast, "traction", "slide_rate", -1.0),
                (held.R_b, self.joined, "reaction", "joint_rate", -1.0),
            ):
                if (unknown[here, m] != NOWHERE).any():
                    impulse = places.or_zero(unknown[here, m])
                    terms.append(Term(push, (q, impulse, t), (within,), sign))
                    terms.append(Term(rate, (q, v, t), (row.index[here, m],)))
        terms += forward_after(lay, lay.hit.v_h[:, STOP], self.slides_on.index, places)
        return [*terms, *terms_of(self.mu, self._holding, at_events(lay), places)]

    def entries(self, laws: Laws) -> list[Entries]:
        """Entries of the linear rows: friction of what slides, and how impulses grow until sliding
        stops, and after it."""
        if not self.lay.hit.passages:
            return []
        rows, T_b = self.drags.index, self.unknowns.T_b
        there = rows != NOWHERE
        entries: list[Entries] = [(rows[there], T_b[there], np.ones(int(there.sum())))]
        for of in range(len(PARTS)):
            for rows, unknown, sign in _growth(self.presses.index[:, of], self._P, of):
                there = (rows != NOWHERE) & (unknown != NOWHERE)
                entries.append((rows[there], unknown[there], np.full(int(there.sum()), sign)))
            for side, way in enumerate((-1.0, 1.0)):
                T = self.unknowns.T_b[:, STOP], self.lay.contact.T_c
                for rows, unknown, sign in _growth(self.grips.index[:, of, :, side], T, of):
                    there = (rows != NOWHERE) & (unknown != NOWHERE)
                    factors = np.full(int(there.sum()), way * sign)
                    entries.append((rows[there], unknown[there], factors))
        return [*entries, *entries_of(self.mu, self._holding)]

    @property
    def _P(self) -> tuple[Index, Index]:
        """Normal impulses until sliding stops, and of the whole impact, shape (events, nc)."""
        return self.unknowns.P_b[:, STOP], self.lay.contact.P_c

    @property
    def _holding(self) -> Iterator[Product]:
        """Friction of contacts that stay closed: mu P_b in the rows of sliding, and mu dP in the
        rows of cones."""
        at = np.arange(len(self.lay.touch.events))
        for k, j in enumerate(self.lay.touch.contacts.supports):
            if j == RAIL or not self.lay.hit.passages:
                continue
            one = np.ones(len(at))
            for m in range(len(MOMENTS)):
                rows, P_b = self.drags.index[:, m, k], self.unknowns.P_b[:, m, j]
                yield against(self.lay, AFTER, Product(k, at, rows, P_b, one))
            P = tuple(impulses[:, j] for impulses in self._P)
            for of in range(len(PARTS)):
                for side in range(2):
                    for rows, unknown, sign in _growth(self.grips.index[:, of, k, side], P, of):
                        yield Product(k, at, rows, unknown, sign * one)

    # Pivots ---------------------------------------------------------------------------------------

    def pivots(self, laws: Laws) -> Iterator[Pivot]:
        """The rows of conditions that hold in impacts determine their impulses."""
        before, held = key(self.lay.collision_nodes - 1, COLLISION), self.unknowns
        yield Pivot(held.P_b, self.held.index, before)
        yield Pivot(held.T_b, self.fast.index, before)
        yield Pivot(held.T_b, self.drags.index, before)
        yield Pivot(held.R_b, self.joined.index, before)

    def loose(self) -> Iterator[tuple[Index, Index]]:
        before = key(self.lay.collision_nodes - 1, COLLISION)[:, None, None]
        settled, held = self.contact.settled, self.unknowns
        for unknown, follows in (
            (held.P_b, settled.closed), (held.T_b, settled.sticks), (held.R_b, self.following),
        ):  # fmt: skip
            chosen = (unknown != NOWHERE) & follows[1:, None]
            yield unknown[chosen], np.broadcast_to(before, chosen.shape)[chosen]


def _growth(
    rows: Index, impulses: tuple[Index, ...], part: int
) -> Iterator[tuple[Index, Index, float]]:
    """Rows, unknowns and signs of the growth of impulses in one part of an impact, shape (events,)
    each; ``impulses`` are those until sliding stops and those of the whole impact."""
    at_stop, whole = impulses
    for unknown, sign in ((at_stop, -1.0), (whole, 1.0)) if part else ((at_stop, 1.0),):
        yield rows, unknown, sign
