"""The law of bounded velocities: rows without kernels, linear in coordinates and the step size.

::

    velocity    sum_a D_a(c) q_a - h lower >= 0,  h upper - sum_a D_a(c) q_a >= 0

with D_a the slopes of the shape functions at places c of a step: its middle, where the velocity is
one along the step, otherwise the places that a polynomial of its degree goes through, both ends
among them.  At the ends of phases velocities are unknowns, which have bounds; their polynomials are
bounded half the way to the next place, or they would jump there.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from dmoc.base.discretisation import DISCRETISATIONS
from dmoc.base.names import velocity_name
from dmoc.codegen.kernels import Array
from dmoc.problem.problem import Problem
from dmoc.program.blocks import Block, Bools, Counted, Entries, Numbering
from dmoc.program.bound_kinds import BoundKind
from dmoc.program.laws.law import Law
from dmoc.program.layout import Layout
from dmoc.program.scale import Scale

if TYPE_CHECKING:
    from dmoc.program.laws.laws import Laws


@dataclass(eq=False, repr=False)
class VelocityLaw(Law):
    """Bounds of the velocities, shape (nq, 2)."""

    lay: Layout
    coordinates: tuple[str, ...]
    limits: Array
    within: Block = field(init=False)

    @cached_property
    def bounded(self) -> bool:
        return bool(np.isfinite(self.limits).any())

    @cached_property
    def places(self) -> Array:
        """Places in a step, from 0 to 1, at which velocities are bounded, shape (places,)."""
        degree = self.lay.scheme.degree
        if degree == 1:
            return np.array([0.5])
        return np.sort(DISCRETISATIONS[2 * (degree - 1)].nodes)

    @property
    def slopes(self) -> Array:
        """Slopes of the shape functions there, shape (total, places, degree + 1)."""
        lay, places = self.lay, np.tile(self.places, (self.lay.total, 1))
        if lay.inside:
            first, last = lay.ends[: lay.stepped], lay.ends[1 : lay.stepped + 1] - 1
            places[first, 0], places[last, -1] = self.places[:2].mean(), self.places[-2:].mean()
        return lay.scheme.slopes(places.ravel()).reshape(*places.shape, -1)

    def bounds(self, problem: Problem, box: Array, scale: Scale) -> None:
        if self.bounded:
            for index in (self.lay.impact.v_a, self.lay.impact.v_c, self.lay.index_w):
                there = index >= 0
                limits = np.broadcast_to(self.limits, (*index.shape, 2))[there]
                at, (low, high) = index[there], limits.T
                box[..., at, 0] = np.maximum(box[..., at, 0], low)
                box[..., at, 1] = np.minimum(box[..., at, 1], high)

    def inequalities(self, block: Numbering) -> None:
        lay, nq, count = self.lay, self.lay.nq, len(self.places)
        stands = np.zeros((lay.total * self.bounded, count, 2, nq), dtype=bool)
        stands[:] = np.isfinite(self.limits).T
        names = [velocity_name(q) for q in self.coordinates]
        steps = np.arange(len(stands))

        def label(k: int, j: int) -> str:
            return f"bound of {names[j % nq]} in step {k}"

        self.within = block(
            "velocity bound",
            stands.reshape(-1, count * 2 * nq),
            label,
            lambda s: (
                np.tile(s.v, 2 * count)[..., None, :] * s.h[..., lay.phase_of_step[steps], None]
            ),
            steps,
            counted=Counted(BoundKind.BOUND, names, steps),
        )

    def entries(self, laws: Laws) -> list[Entries]:
        if not self.within.count:
            return []
        lay = self.lay
        rows = self.within.index.reshape(lay.total, len(self.places), 2, lay.nq)
        within = lay.index_q_i.reshape(lay.total, -1, lay.nq)
        q = np.concatenate([lay.index_q[:-1, None], lay.index_q[1:, None], within], axis=1)
        entries = []
        for place, slopes in enumerate(np.moveaxis(self.slopes, 1, 0)):
            for side, sign in enumerate((1.0, -1.0)):
                row = rows[:, place, side]
                there: Bools = row >= 0
                bound = np.broadcast_to(self.limits[:, side], row.shape)[there]
                h = np.broadcast_to(lay.index_h[lay.phase_of_step][:, None], row.shape)[there]
                entries.append((row[there], h, -sign * bound))
                entries += [
                    (
                        row[there],
                        q[:, a][there],
                        sign * np.broadcast_to(slope, row.T.shape).T[there],
                    )
                    for a, slope in enumerate(slopes.T)
                ]
        return entries
