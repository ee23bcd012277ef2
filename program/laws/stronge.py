"""Stronge's restitution: the normal impulse gives back e^2 of the work that compression took::

    restitution  e^2 W_compression + W_restitution = 0,    2 W = sum of dP (gamma + gamma')

over the stages, with the rates gamma at their ends, linear in P between them.  Where sliding does
not stop in the hit they change alike all along, and the row is that of Poisson's law, which says
the same and is linear; so it is in hits that are none and where e = 0.

W. J. Stronge, Proceedings of the Royal Society A 431 (1990) 169-181.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from itertools import pairwise
from math import sqrt
from typing import TYPE_CHECKING

import numpy as np

from dmoc.program.blocks import Entries
from dmoc.program.hit_stages import END, STOP, Passage
from dmoc.program.laws.poisson import PoissonRestitution
from dmoc.program.laws.restitution import Spent
from dmoc.program.terms import Places, Term

if TYPE_CHECKING:
    from dmoc.program.laws.hit import HitLaw


class StrongeRestitution(PoissonRestitution):
    """The row is one of works in hits during which sliding stops."""

    def left(self, e: float, full: Spent, now: Spent, n: float, slope: float) -> float:
        """The root of n dP + slope dP^2/2 = the work that is left."""
        work = -(e**2) * full.W - (now.W - full.W)
        rate = n + sqrt(max(n**2 + 2 * slope * work, 0.0))  # at its end, beside n
        return 2 * work / rate if rate > 0 else 0.0

    def is_quadratic(self, hit: HitLaw, p: Passage) -> bool:
        restores = not p.lands and hit.e[p.event] > 0 and not hit.grazing[p.event]
        return bool(restores and STOP in p.moments)

    def entries(self, hit: HitLaw, p: Passage) -> Iterator[Entries]:
        return iter(()) if self.is_quadratic(hit, p) else super().entries(hit, p)

    def terms(self, hit: HitLaw, passages: Sequence[Passage], places: Places) -> list[Term]:
        lay, terms = hit.lay, list[Term]()
        for p in passages:
            if not self.is_quadratic(hit, p):
                continue
            i, node = p.event, lay.collision_nodes[[p.event]]
            works = _works(hit, p)
            lam = np.full((len(works), places.nc), places.zero)
            lam[:, p.surface] = [P for P, _ in works]
            v = np.array(
                [[lay.impact.v_a[i], *lay.hit.v_h[i], lay.impact.v_c[i]][k] for _, k in works]
            )
            at = np.repeat(lay.index_q[node], len(works), axis=0), v, lam
            rows = np.full((len(works), 1), hit.restitution.index[i])
            when = places.times(np.repeat(node, len(works)))
            factors = np.array(list(works.values()))[:, None]
            terms.append(Term("rate_work", (*at, when), (rows,), factors))
        return terms


def _works(hit: HitLaw, p: Passage) -> dict[tuple[int, int], float]:
    """Factors of the row by impulses and the numbers of velocities, before the hit, at its moments
    and after it: the rate vanishes where compression ends."""
    (P, _), sides = hit.impulses(p), (0, *(1 + m for m in p.moments), 3)
    works, until = defaultdict[tuple[int, int], float](float), p.moments.index(END)
    for k, (ends, rates) in enumerate(zip(pairwise(P.tolist()), pairwise(sides), strict=True)):
        share = (hit.e[p.event] ** 2 if k <= until else 1.0) / 2
        for sign, impulse in zip((-1, 1), ends, strict=True):
            for rate in rates:
                works[impulse, rate] += sign * share
    return {
        of: factor for of, factor in works.items() if factor and of[0] >= 0 and of[1] != 1 + END
    }
