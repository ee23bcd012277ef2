"""The law of kinks: hidden unknowns s in the place of abs, Max and Min, at the quadrature points.

::

    limit   l(q_i, v_i, u_i, s_i, t_i) >= 0

What they add to the cost are terms, what they add to integrals those of
:class:`~dmoc.program.laws.objective.ObjectiveLaw`.  Unknowns of an integral that is neither bounded
nor priced are fixed, and have no limits: nothing would hold them.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.problem.problem import Problem
from dmoc.problem.quantities import pressing_integrals
from dmoc.program.blocks import NOWHERE, Block, Bools, Counted, Index, Numbering
from dmoc.program.bound_kinds import BoundKind
from dmoc.program.laws.law import Law
from dmoc.program.layout import Layout
from dmoc.program.scale import Scale
from dmoc.program.terms import COST, Places, Term

if TYPE_CHECKING:
    from dmoc.program.laws.laws import Laws


@dataclass(eq=False, repr=False)
class KinkLaw(Law):
    """Hidden unknowns; ``limited`` tells which ones something holds."""

    problem: Problem
    lay: Layout
    limited: Bools = field(init=False)
    limit: Block = field(init=False)

    @cached_property
    def _of(self) -> Index:
        """The hidden unknown that each limit belongs to."""
        counts = self.problem.kernels.manifest.hidden_limits
        return np.repeat(np.arange(len(counts)), counts)

    def bounds(self, problem: Problem, box: Array, scale: Scale) -> None:
        names = problem.kernels.manifest.hidden_of
        loose = np.array([name not in pressing_integrals(problem) for name in names], dtype=bool)
        own = self.lay.index_s.reshape(self.lay.total, -1, len(names) or 1)
        box[own[:, :, loose] if len(names) else own] = 0.0

    def settle(self, problem: Problem, limits: tuple[Array, Array]) -> None:
        self.limited = (limits[0] < limits[1])[self.lay.index_s]

    def inequalities(self, block: Numbering) -> None:
        lay, count = self.lay, self.problem.model.ns
        steps = np.arange(lay.total)
        limited = self.limited.reshape(lay.total, -1, max(count, 1))[:, :, self._of]
        each = limited.shape[1]

        def label(k: int, j: int) -> str:
            place, own = divmod(j, len(self._of))
            name = self.problem.model.hidden_names[self._of[own]]
            return f"limit {own} of {name} at point {place} of step {k}"

        self.limit = block(
            "kink",
            limited.reshape(lay.total, -1),
            label,
            lambda s: np.tile(s.s[self._of], each),
            steps,
            counted=Counted(BoundKind.PATH, ("",), steps),
        )

    def terms(self, places: Places, laws: Laws) -> list[Term]:
        lay = self.lay
        if not lay.index_s.size:
            return []
        s, limits = lay.hidden_of_kernels, self.limit.index
        again = (
            np.full_like(limits, NOWHERE) if s.shape[1] > lay.index_s.shape[1] else limits[:, :0]
        )
        rows = np.full((lay.total, 1), COST), np.hstack([limits, again])
        return [Term("lifted", (*places.step(np.arange(lay.total)), s), rows)]
