"""The law of quantities z(q, v, u, t) at both ends and at events.

::

    fixed   z - value = 0
    within  z - lower >= 0, upper - z >= 0
"""

from __future__ import annotations

from collections.abc import Iterator
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from dmoc.base.names import unit_of
from dmoc.codegen.kernels import Array
from dmoc.problem.problem import Problem
from dmoc.program.blocks import GOAL, NOWHERE, Block, Index, Missed, Numbering
from dmoc.program.laws.law import Law
from dmoc.program.layout import Layout
from dmoc.program.terms import Places, Term

if TYPE_CHECKING:
    from dmoc.program.laws.laws import Laws


@dataclass(eq=False, repr=False)
class QuantityLaw(Law):
    """Quantities at the start, at the goal and at the events, in this order."""

    problem: Problem
    lay: Layout
    fixed: Block = field(init=False)
    within: Block = field(init=False)

    def stating(self, problem: Problem) -> QuantityLaw:
        """The same rows with the values and ranges of another problem."""
        other = copy(self)
        other.problem = problem
        other.__dict__.pop("ranges", None)
        return other

    @cached_property
    def ranges(self) -> Array:
        """Lower and upper values at the start, at the goal and at the events, shape (events + 2,
        nz, 2)."""
        ranges = self.problem.quantity_ranges
        return np.concatenate([ranges.start[None], ranges.goal[None], ranges.via])

    @property
    def idle(self) -> bool:
        """Whether nothing is said."""
        return not np.isfinite(self.ranges).any()

    def _label(self, row: int, j: int, *_: int) -> str:
        where = ("at the start", "at the goal")[row] if row < 2 else f"at event {row - 1}"
        return f"{self.problem.kernels.quantities[j]} {where}"

    @property
    def _missed(self) -> Missed:
        names, units = self.problem.kernels.quantities, self.problem.kernels.manifest.units
        return Missed(
            GOAL,
            lambda row, j, *_: f"{self._label(row, j)} is missed",
            lambda _, j, *__: unit_of(names[j], units),
            apart=1,
        )

    def equations(self, block: Numbering) -> None:
        if not self.idle:
            low, high = np.moveaxis(self.ranges, -1, 0)
            self.fixed = block(
                "quantity fixed",
                low == high,
                self._label,
                lambda s: s.quantity,
                missed=self._missed,
            )

    def inequalities(self, block: Numbering) -> None:
        if not self.idle:
            low, high = np.moveaxis(self.ranges, -1, 0)
            self.within = block(
                "quantity within",
                np.isfinite(self.ranges) & (low < high)[..., None],
                self._label,
                lambda s: s.quantity[:, None],
                missed=self._missed,
            )

    @property
    def _sides(self) -> Iterator[tuple[float, Index, Array]]:
        """Signs, rows (events + 2, nz) and values."""
        fixed, (lower, upper) = self.fixed.index, np.moveaxis(self.within.index, -1, 0)
        yield 1.0, np.where(fixed == NOWHERE, lower, fixed), self.ranges[..., 0]
        yield -1.0, upper, self.ranges[..., 1]

    def terms(self, places: Places, laws: Laws) -> list[Term]:
        if self.idle:
            return []
        lay, nodes = self.lay, self.lay.collision_nodes
        still, idle = (np.full((len(nodes), size), places.zero) for size in (lay.nq, lay.nu))
        at_events = lay.index_q[nodes], still, idle, places.times(nodes)
        pushed = np.full((1, lay.force.count), places.zero)
        parts: list[tuple[int | slice, tuple[Index, ...]]] = [
            (0, places.quantities_at_end(False)),
            (1, places.quantities_at_end(True)),
            (slice(2, None), (*at_events, pushed) if lay.force.count else at_events),
        ]
        return [
            Term("quantity_point", at, (np.atleast_2d(rows[part]),), sign)
            for sign, rows, _ in self._sides
            for part, at in parts
        ]

    def constants(self) -> Iterator[tuple[int, float]]:
        if self.idle:
            return
        for sign, rows, values in self._sides:
            there = rows != NOWHERE
            yield from zip(rows[there].tolist(), (-sign * values[there]).tolist(), strict=True)
