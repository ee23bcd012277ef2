"""The law of quantities that there are at hits alone, z_c of velocities before and after a hit and
of its impulses.

::

    at hits          z_c - lower >= 0, upper - z_c >= 0
    peak of hits     peak - z_c >= 0, and peak + z_c >= 0 where it is that of both signs
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from dmoc.base.names import unit_of
from dmoc.codegen.kernels import Array
from dmoc.problem.problem import Problem
from dmoc.program.blocks import NOWHERE, Block, Bools, Entries, Index, Missed, Numbering
from dmoc.program.laws.law import Law
from dmoc.program.layout import Layout
from dmoc.program.scale import Scale
from dmoc.program.terms import Places, Term
from dmoc.program.totals import impulses_at_events, surfaces_hit

if TYPE_CHECKING:
    from dmoc.program.laws.laws import Laws


@dataclass(eq=False, repr=False)
class HitQuantityLaw(Law):
    """Quantities of hits, within their bounds and below their peaks."""

    problem: Problem
    lay: Layout
    there: Bools  # which of them each event has, (events, number)
    within: Block = field(init=False)
    peak: Block = field(init=False)

    @classmethod
    def of(cls, problem: Problem, lay: Layout) -> HitQuantityLaw:
        return cls(problem, lay, problem.model.hits_of_quantities(surfaces_hit(lay.touch)))

    @property
    def _peaks(self) -> Index:
        """The unknowns that are peaks of hits, shape (peaks,)."""
        count = len(self.problem.model.hit_peaks_of)
        return self.lay.index_peaks[len(self.lay.index_peaks) - count :]

    def bounds(self, problem: Problem, box: Array, scale: Scale) -> None:
        """A peak of hits that there are not is zero."""
        box[self._peaks, 0] = 0.0

    def inequalities(self, block: Numbering) -> None:
        if not self.there.any():
            return
        kernels, ranges = self.problem.kernels, self.problem.hit_quantity_bounds
        names = kernels.hit_quantities

        def label(i: int, j: int, *_: int) -> str:
            return f"{names[j]} at event {i + 1}"

        missed = Missed(
            words=lambda i, j, *_: f"{label(i, j)} is missed",
            unit=lambda _, j, *__: unit_of(names[j], kernels.manifest.units),
            apart=1,
        )
        nodes, mask = self.lay.collision_nodes, self.there[..., None] & np.isfinite(ranges)
        self.within = block(
            "quantity of a hit", mask, label, lambda s: s.hit_quantity[:, None], nodes,
            missed=missed,
        )  # fmt: skip
        peaks = self.problem.model.hit_peaks_of
        mask = np.zeros((len(self.there), len(peaks), 2), dtype=bool)
        for k, (j, both) in enumerate(peaks):
            mask[:, k, : 1 + both] = self.there[:, j, None]
        self.peak = block(
            "peak of hits", mask,
            lambda i, k, *_: f"peak of {label(i, peaks[k][0])}",
            lambda s: s.hit_quantity[[j for j, _ in peaks], None], nodes,
        )  # fmt: skip

    def terms(self, places: Places, laws: Laws) -> list[Term]:
        if not self.there.any():
            return []
        lay, nodes = self.lay, self.lay.collision_nodes
        lam = places.or_zero(impulses_at_events(lay))
        at = lay.index_q[nodes], lay.impact.v_a, lay.impact.v_c, lam, places.times(nodes)
        terms = [
            Term("hit_value", at, (self.within.index[..., side],), sign, places.of_events)
            for side, sign in enumerate((1.0, -1.0))
        ]
        for k, (j, _) in enumerate(self.problem.model.hit_peaks_of):
            for side, sign in enumerate((-1.0, 1.0)):
                rows = np.full(self.there.shape, NOWHERE)
                rows[:, j] = self.peak.index[:, k, side]
                terms.append(Term("hit_value", at, (rows,), sign, places.of_events))
        return terms

    def entries(self, laws: Laws) -> list[Entries]:
        if not self.there.any():
            return []
        unknowns = np.broadcast_to(self._peaks[None, :, None], self.peak.index.shape)
        own = self.peak.index != NOWHERE
        return [(self.peak.index[own], unknowns[own], np.ones(int(own.sum())))]

    def above(self, x: Array, values: Array) -> Array:
        """Differences of peaks of hits and their quantities, shape (peaks,), from the scaled
        unknowns x and the values of all rows (c | d)."""
        lowest = x[self._peaks].copy()
        if self.there.any():
            _, peaks, _ = np.nonzero(self.peak.index != NOWHERE)
            np.minimum.at(lowest, peaks, values[self.peak.numbers])
        return lowest

    def constants(self) -> Iterator[tuple[int, float]]:
        if self.there.any():
            for side, sign in enumerate((1.0, -1.0)):
                events, which = np.nonzero(self.within.index[..., side] != NOWHERE)
                rows = self.within.index[events, which, side]
                values = -sign * self.problem.hit_quantity_bounds[which, side]
                yield from zip(rows.tolist(), values.tolist(), strict=True)
