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
    goes on     s sigma(q_c, v_h) >= 0      of what slides, at the stop

with the differences dP, dT from the begin to the stop of sliding, and from there to the end: while
the friction of the impact is the same, all impulses grow in one proportion.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.program.blocks import NOWHERE, Block, Bools, Entries, Index, Numbering, two_sided
from dmoc.program.hit_stages import MOMENTS, STOP, HeldUnknowns, moment
from dmoc.program.laws.contact import ContactLaw
from dmoc.program.laws.law import COLLISION, Law, Pivot, key
from dmoc.program.layout import Layout
from dmoc.program.terms import Places, Term

if TYPE_CHECKING:
    from dmoc.program.laws.laws import Laws

PARTS = ("until", "after")


@dataclass(eq=False)
class HeldLaw(Law):
    """What holds during the impacts with friction of a problem.

    Attributes
    ----------
    contact : ContactLaw
    mu : array, shape (nt,)
    touching : array of bool, shape (events,)
        Hits that only touch their surface.
    """

    contact: ContactLaw
    mu: Array
    touching: Bools
    held: Block = field(init=False)
    fast: Block = field(init=False)
    drags: Block = field(init=False)
    joined: Block = field(init=False)
    presses: Block = field(init=False)
    grips: Block = field(init=False)
    goes_on: Block = field(init=False)

    @property
    def lay(self) -> Layout:
        return self.contact.lay

    @property
    def unknowns(self) -> HeldUnknowns:
        return self.lay.held

    @property
    def _sticks(self) -> Bools:
        """What sticks after the events, shape (events, nt)."""
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
            held.R_b != NOWHERE,
            lambda i, m, j: f"rate of constraint {self.lay.joint.names[j]} {moment(i, m)}",
            lambda s: s.joint_rate,
        )

    def inequalities(self, block: Numbering) -> None:
        """The first two axes of both are events and the parts before the stop and after it; the
        last one of ``grips`` are the two sides."""
        names, held = self.lay.touch.contacts, self.unknowns
        stops = ~self.touching[:, None]
        drags = (held.T_b[:, STOP] != NOWHERE) & stops
        grips = drags & self._sticks
        presses = (held.P_b[:, STOP] != NOWHERE) & stops
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
        self.goes_on = block(
            "goes on",
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
                    impulse = places.known(unknown[here, m])
                    terms.append(Term(push, (q, impulse, t), (within,), sign))
                    terms.append(Term(rate, (q, v, t), (row.index[here, m],)))
        for sign in (1.0, -1.0):
            rows = np.where(lay.touch.signs[1:] == sign, self.goes_on.index, NOWHERE)
            (here,) = np.nonzero((rows != NOWHERE).any(axis=1))
            if len(here):
                q, t = lay.index_q[nodes[here]], places.times(nodes[here])
                state = q, lay.hit.v_h[here, STOP], t
                terms.append(Term("slide_rate", state, (rows[here],), sign))
        return terms

    def entries(self, laws: Laws) -> list[Entries]:
        """Entries of the linear rows: friction of what slides, and how impulses grow until sliding
        stops, and after it."""
        if not self.lay.hit.passages:
            return []
        contact, held = self.lay.contact, self.unknowns
        P, T = (held.P_b[:, STOP], contact.P_c), (held.T_b[:, STOP], contact.T_c)
        on = np.array(self.lay.touch.contacts.supports, dtype=np.intp)
        rubs = self.mu * self.lay.touch.signs[1:]
        rows = self.drags.index
        there = rows != NOWHERE
        entries: list[Entries] = [
            (rows[there], held.T_b[there], np.ones(int(there.sum()))),
            (
                rows[there],
                held.P_b[:, :, on][there],
                np.broadcast_to(rubs[:, None], rows.shape)[there],
            ),
        ]
        for of in range(len(PARTS)):
            rows, ones = self.presses.index[:, of], np.ones_like(self.presses.index[:, of])
            entries += _growth(rows, P, of, ones.astype(float))
            for side, sign in enumerate((-1.0, 1.0)):
                rows = self.grips.index[:, of, :, side]
                mu = np.broadcast_to(self.mu, rows.shape)
                entries += _growth(rows, tuple(p[:, on] for p in P), of, mu)
                entries += _growth(rows, T, of, np.full(rows.shape, sign))
        return entries

    # Pivots ---------------------------------------------------------------------------------------

    def pivots(self, laws: Laws) -> Iterator[Pivot]:
        """What holds determines its impulses."""
        before, held = key(self.lay.collision_nodes - 1, COLLISION), self.unknowns
        yield Pivot(held.P_b, self.held.index, before)
        yield Pivot(held.T_b, self.fast.index, before)
        yield Pivot(held.T_b, self.drags.index, before)
        yield Pivot(held.R_b, self.joined.index, before)

    def loose(self) -> Iterator[tuple[Index, Index]]:
        before = key(self.lay.collision_nodes - 1, COLLISION)[:, None, None]
        follow = self.contact.settled.closed[1:, None], self.contact.settled.sticks[1:, None]
        for unknown, follows in zip((self.unknowns.P_b, self.unknowns.T_b), follow, strict=True):
            chosen = (unknown != NOWHERE) & follows
            yield unknown[chosen], np.broadcast_to(before, chosen.shape)[chosen]


def _growth(
    rows: Index, impulses: tuple[Index, ...], part: int, factor: Array
) -> Iterator[Entries]:
    """Entries of what impulses, until sliding stops and in all, grow by in one of the parts."""
    at_stop, whole = impulses
    for unknown, sign in ((at_stop, -1.0), (whole, 1.0)) if part else ((at_stop, 1.0),):
        there = (rows != NOWHERE) & (unknown != NOWHERE)
        yield rows[there], unknown[there], sign * factor[there]
