"""Friction that breaks away: its rows where static friction is not the kinetic one.

At the end of a phase in which it sticks, what slides in the direction s from there on has reached
its static friction (equation :eq:`static-friction` of the theory), and no input jumps::

    breaks away    T_N + s mu_s P_N = 0
    goes on        u(t_c, -) - u(t_c, +) = 0
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from dmoc.program.blocks import NOWHERE, Block, Entries, Numbering
from dmoc.program.coefficients import AFTER, Product, against, at_stations, entries_of, terms_of
from dmoc.program.laws.friction import FrictionLaw
from dmoc.program.laws.law import Law
from dmoc.program.terms import Places, Term

if TYPE_CHECKING:
    from dmoc.program.laws.laws import Laws


@dataclass(eq=False, repr=False)
class BreakawayLaw(Law):
    """Law of contacts that break away at the end of a phase from the static ``friction`` there."""

    friction: FrictionLaw
    breaks: Block = field(init=False)
    goes_on: Block = field(init=False)

    def equations(self, block: Numbering) -> None:
        away, lay = self.friction.breaks, self.friction.lay
        names = self.friction.touch.contacts.tangents
        self.breaks = block(
            "breaks away",
            away,
            lambda i, j: f"static friction of {names[j]} at event {i + 1}",
            lambda s: s.friction / lay.total,
        )
        self.goes_on = block(
            "goes on",
            np.repeat(np.asarray(away.any(axis=1))[:, None], lay.index_u.shape[1], axis=1),
            lambda i, j: f"input {j + 1} at event {i + 1}, where friction breaks away",
            lambda s: s.u,
        )

    def terms(self, places: Places, laws: Laws) -> list[Term]:
        law = self.friction
        if not self.breaks.count:
            return []
        mu_s, site = law.along_phases(law.mu_s), at_stations(law.lay)
        return [*terms_of(mu_s, self._holding, site, places, law.static)]

    def entries(self, laws: Laws) -> list[Entries]:
        if not self.breaks.count:
            return []
        law, lay = self.friction, self.friction.lay
        i, k = np.nonzero(self.breaks.index != NOWHERE)
        T = lay.contact.T[law.last[i], k]
        entries: list[Entries] = [(self.breaks.index[i, k], T, np.ones(len(i)))]
        nodes, there = lay.collision_nodes, self.goes_on.index != NOWHERE
        after = lay.row_u_k[np.minimum(nodes, lay.total - 1)]
        for side, sign in ((lay.row_u_kp1[nodes - 1], 1.0), (after, -1.0)):
            u = lay.index_u[side][there]
            entries.append((self.goes_on.index[there], u, np.full(len(u), sign)))
        return [*entries, *entries_of(law.along_phases(law.mu_s), self._holding)]

    @property
    def _holding(self) -> Iterator[Product]:
        """Static friction mu_s P at the ends of phases, in the rows of breaking away."""
        law, events = self.friction, len(self.friction.touch.events)
        last = law.last[:events]
        for k, (_, limit, factor) in enumerate(law.limits):
            product = Product(k, last, self.breaks.index[:, k], limit[last], factor[last])
            yield against(law.lay, AFTER, product)
