"""Poisson's restitution: its normal impulse is e times that of compression::

    restitution  (1 + e) P_h - lam = 0                     e of the rate before the hit

Y. Wang and M. T. Mason, Journal of Applied Mechanics 59 (1992) 635-642.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from dmoc.program.blocks import NOWHERE, Entries, in_columns
from dmoc.program.hit_stages import END, Passage
from dmoc.program.laws.restitution import Restitution, Spent
from dmoc.program.terms import Places, Term, like

if TYPE_CHECKING:
    from dmoc.program.laws.hit import HitLaw


class PoissonRestitution(Restitution):
    """The row is linear, but for an e that the law of the model says: e P_h is a term then."""

    def left(self, e: float, full: Spent, now: Spent, n: float, slope: float) -> float:
        """Whatever the rate."""
        return (1 + e) * full.P - now.P

    def terms(self, hit: HitLaw, passages: Sequence[Passage], places: Places) -> list[Term]:
        own = np.array([p.event for p in passages if self._by_rate(hit, p)], dtype=np.intp)
        if not own.size:
            return []
        lay, nodes = hit.lay, hit.lay.collision_nodes[own]
        surfaces = lay.hit.hit[own]
        rows = in_columns(hit.restitution.index[own], surfaces, places.nc)
        P = places.or_zero(in_columns(lay.hit.P_h[own, END], surfaces, places.nc))
        before = lay.index_q[nodes], lay.impact.v_a[own], P, places.times(nodes)
        return [Term("rebound", before, (like(rows), rows, like(rows[:, :1])))]

    def entries(self, hit: HitLaw, p: Passage) -> Iterator[Entries]:
        row, lay = hit.restitution.index[p.event], hit.lay
        if row != NOWHERE:
            unknowns = np.array([lay.hit.P_h[p.event, END], lay.impact.lam[p.event]])
            compressed = 1.0 if self._by_rate(hit, p) else 1 + hit.e[p.event]
            yield np.full(2, row), unknowns, np.array([compressed, -1.0])

    def _by_rate(self, hit: HitLaw, p: Passage) -> bool:
        return not p.lands and bool(np.isnan(hit.e[p.event]))
