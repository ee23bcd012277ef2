"""Grips that no word says: complementarity of forces with both signs, relaxed by eps.

At every node stand impulses P of the places of grips that may be closed, as those of contacts
(:mod:`dmoc.program.laws.complementarity`), with either sign.  They act where all places of their
grip vanish before and after the next step, which closes as its word does, plastically::

    holding      eps -+ P_k^i phi_j(q_k) >= 0        for all places i, j of a grip
                 eps -+ P_k^i phi_j(q_kp1) >= 0
    by its rate  eps -+ P_k^i (phi_j(q_kp1) - phi_j(q_k)) >= 0
    held         eps -+ phi(q_0) >= 0                of what is closed at the start
    last         eps -+ (P_k - P_km1 / 2) >= 0       k the last node

No grip closes at the end of the motion: its impulse there is that of half a step.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.problem.problem import Problem
from dmoc.program.blocks import NOWHERE, Block, Bools, Entries, Index, Numbering, two_sided
from dmoc.program.laws.complementarity import settled_at_start
from dmoc.program.laws.law import Law
from dmoc.program.layout import Layout
from dmoc.program.scale import Scale
from dmoc.program.terms import Places, Term

if TYPE_CHECKING:
    from dmoc.program.laws.laws import Laws

SIGNS = 1.0, -1.0
NOW, LATE = range(2)


@dataclass(eq=False, repr=False)
class OpenGripsLaw(Law):
    """The grips that are left open; where none is, the law has no rows.

    Attributes
    ----------
    lay : Layout
    eps : float
    scale : Scale
    """

    lay: Layout
    eps: float
    scale: Scale
    settled: Bools = field(init=False)
    holding: Block | None = None
    held: Block | None = None
    last: Block | None = None

    @cached_property
    def _grips(self) -> list[tuple[int, ...]]:
        """Numbers of the places of each grip that is left open."""
        left, contacts = self.lay.touch.open, self.lay.touch.contacts
        of = [tuple(contacts.surface_numbers[n] for n in names) for _, names in contacts.grips]
        return [places for places in of if left and places[0] in left.surfaces]

    @cached_property
    def _partners(self) -> Index:
        """For each place j of a grip the places i, one in each column, shape (nc, most);
        NOWHERE where there are no more."""
        most = max(map(len, self._grips), default=0)
        partners = np.full((len(self.lay.touch.contacts.surfaces), most), NOWHERE)
        for places in self._grips:
            partners[list(places), : len(places)] = places
        return partners

    @cached_property
    def _floats(self) -> Bools:
        """Places that close wherever they are, shape (nc,)."""
        contacts = self.lay.touch.contacts
        return np.isin(np.arange(len(contacts.surfaces)), contacts.floating)

    @cached_property
    def _next(self) -> Index:
        """The node after each, and the last one after itself."""
        return np.minimum(np.arange(1, self.lay.total + 2), self.lay.total)

    def settle(self, problem: Problem, limits: tuple[Array, Array]) -> None:
        self.settled = settled_at_start(problem, self.lay, limits)

    def inequalities(self, block: Numbering) -> None:
        if not self._grips:
            return
        lay, names, total = self.lay, self.lay.touch.contacts.surfaces, self.lay.total
        partners = self._partners
        late = partners != NOWHERE
        pairs = np.stack([late & ~self._floats[:, None], late], axis=-1)
        self.holding = block(
            "holding",
            two_sided(np.repeat(pairs[None], total + 1, axis=0)),
            lambda k, j, i, *_: (
                f"force of {names[self._partners[j, i]]} off {names[j]} at node {k}"
            ),
            lambda s: (s.gap * s.lam / total)[:, None, None, None],
            self._next,
        )
        closed = lay.touch.open.closed if lay.touch.open else ()
        of_grips = late[:, 0]
        held = of_grips & np.isin(np.arange(len(names)), closed) & ~self.settled & ~self._floats
        self.held = block(
            "held at the start",
            two_sided(held[None]),
            lambda _, j, *__: f"place {names[j]} at the start",
            lambda s: s.gap[:, None],
            np.array([1]),
        )
        self.last = block(
            "last forces",
            two_sided(of_grips[None]),
            lambda _, j, *__: f"force of {names[j]} at the end",
            lambda s: s.lam[:, None],
            np.array([total]),
        )

    def _blocks(self) -> Iterator[Block]:
        yield from (block for block in (self.holding, self.held, self.last) if block is not None)

    def constants(self) -> Iterator[tuple[int, float]]:
        for block in self._blocks():
            sizes = self.eps * block.sizes(self.scale)
            yield from zip(block.numbers.tolist(), sizes.tolist(), strict=True)

    def terms(self, places: Places, laws: Laws) -> list[Term]:
        if self.holding is None or self.held is None:
            return []
        q, late, rows = self.lay.index_q, self._next, self.holding.index
        t, t_late = places.times(np.arange(self.lay.total + 1)), places.times(late)
        P, terms = places.or_zero(self.lay.relaxed.P_r), list[Term]()
        for side, sign in enumerate(SIGNS):
            own = self.held.index[:, :, side]
            terms.append(Term("surface", (q[:1], t[:1]), (own,), sign))
            for i, partner in enumerate(self._partners.T):
                force = np.where(partner != NOWHERE, P[:, partner], places.zero)
                now, then = (rows[:, :, i, end, side] for end in (NOW, LATE))
                since = np.where(self._floats, then, NOWHERE)
                terms += [
                    Term("gap_work", (q, force, t), (now,), sign),
                    Term("gap_work", (q[late], force, t_late), (then,), sign),
                    Term("gap_work", (q, force, t), (since,), -sign),
                ]
        return terms

    def entries(self, laws: Laws) -> list[Entries]:
        """Entries of the last forces."""
        entries = list[Entries]()
        for side, sign in enumerate(SIGNS) if self.last is not None else ():
            rows = self.last.index[0, :, side] if self.last is not None else np.zeros(0)
            at = rows != NOWHERE
            for node, share in ((-1, 1.0), (-2, -0.5)):
                P = self.lay.relaxed.P_r[node, at]
                entries.append((rows[at], P, np.full(int(at.sum()), sign * share)))
        return entries
