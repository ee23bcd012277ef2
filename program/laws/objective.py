"""The law of totals: integrals over the whole motion as unknowns, and the objective of these, of
peaks, and of the states at both ends.

::

    total   I - sum over steps of I_d - sum over hits of I_c = 0
    range   bounds of the unknowns I, where the goal states them

The peaks are unknowns above the quantities they are the largest of
(:class:`~dmoc.program.laws.path.PathLaw`), at a minimum the least ones.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.problem.problem import Problem
from dmoc.program.blocks import LAW, NOWHERE, Block, Bools, Entries, Index, Missed, Numbering
from dmoc.program.laws.law import Law
from dmoc.program.layout import Layout
from dmoc.program.scale import Scale
from dmoc.program.terms import COST, Places, Term
from dmoc.program.totals import impulses_at_events

if TYPE_CHECKING:
    from dmoc.program.laws.laws import Laws


@dataclass(eq=False, repr=False)
class ObjectiveLaw(Law):
    """Totals and the objective."""

    lay: Layout
    names: tuple[str, ...]
    totals_of_hits: Index  # of what hits add, (terms,)
    counts: Bools  # which of it each event adds, (events, terms)
    total: Block = field(init=False)

    def bounds(self, problem: Problem, box: Array, scale: Scale) -> None:
        if self.names:
            box[self.lay.index_totals] = problem.total_bounds

    def equations(self, block: Numbering) -> None:
        if self.names:
            self.total = block(
                "total",
                (len(self.names),),
                lambda i: f"total {self.names[i]}",
                lambda s: s.totals,
                missed=Missed(LAW, lambda i: f"the total {self.names[i]} is not the sum of steps"),
            )

    def entries(self, laws: Laws) -> list[Entries]:
        if not self.names:
            return []
        return [(self.total.numbers, self.lay.index_totals, np.ones(len(self.names)))]

    def terms(self, places: Places, laws: Laws) -> list[Term]:
        lay, terms = self.lay, []
        if self.names:
            rows, step = (
                np.tile(self.total.numbers, (lay.total, 1)),
                places.step(np.arange(lay.total)),
            )
            at = (*step, lay.hidden_of_kernels) if lay.index_s.size else step
            terms += [Term("integral", at, (rows,), -1.0), *self._of_hits(places)]
        shared = lay.index_totals[None], lay.index_peaks[None]
        ends = *places.at_end(False)[:2], *places.at_end(True)[:2]
        return [*terms, Term("objective", (*shared, *ends), (np.full((1, 1), COST),))]

    def _of_hits(self, places: Places) -> list[Term]:
        """What hits add to the totals."""
        lay, nodes = self.lay, self.lay.collision_nodes
        if not self.counts.any():
            return []
        rows = np.where(self.counts, self.total.numbers[self.totals_of_hits], NOWHERE)
        lam = places.or_zero(impulses_at_events(lay))
        at = lay.index_q[nodes], lay.impact.v_a, lay.impact.v_c, lam, places.times(nodes)
        return [Term("hit_sum", at, (rows,), -1.0, places.of_events)]
