"""The law of steps: discrete Euler-Lagrange equations, gaps, and the cost.

::

    momentum  r_plus(k-1) + r_minus(k) - lam grad g(q_c) = 0; + p_B at the start, - p_E at the end
    inside    r_i(k) = 0                in each step with nodes inside
    passing   r_plus(k-1) - dL/dv(q_k, w_k) = 0    at nodes where both steps have impulses of
                                                   their own; there the momentum is that of the
                                                   step that begins, dL/dv(q_k, w_k) + r_minus(k)
    time      t_kp1 - t_k - h = 0       in each step, where the model depends on the time, and
                                        t_i - t_k - c h = 0 where times inside are unknowns
    gap       -g(q_k) >= 0              at every node, and inside the steps
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from dmoc.base.names import momentum_name, unit_of, velocity_name
from dmoc.codegen.kernels import Array
from dmoc.mechanics.contact_mode import Event
from dmoc.problem.design import by_design
from dmoc.problem.problem import Problem
from dmoc.program.blocks import (
    LAW,
    NOWHERE,
    Block,
    Bools,
    Counted,
    Entries,
    Index,
    Missed,
    Numbering,
    seconds,
)
from dmoc.program.bound_kinds import BoundKind
from dmoc.program.laws.law import COLLISION, INSIDE, STATE, Law, Pivot, key
from dmoc.program.layout import Layout
from dmoc.program.presolve import gaps_returned
from dmoc.program.scale import Scale
from dmoc.program.terms import COST, Places, Term

if TYPE_CHECKING:
    from dmoc.program.laws.laws import Laws


@dataclass(eq=False, repr=False)
class StepLaw(Law):
    """The steps of all phases; ``gaps`` tells the nodes and surfaces whose gap is a constraint."""

    problem: Problem
    lay: Layout
    gaps: Bools = field(init=False)
    momentum: Block = field(init=False)
    inside: Block = field(init=False)
    passing: Block = field(init=False)
    time: Block = field(init=False)
    time_inside: Block = field(init=False)
    gap: Block = field(init=False)
    gap_inside: Block = field(init=False)

    def settle(self, problem: Problem, limits: tuple[Array, Array]) -> None:
        free = limits[0] != limits[1]
        self.gaps = self._gaps((free[self.lay.index_q[0]], free[self.lay.index_q[-1]]))
        if problem.relations:
            determined = ~self.gaps[[0, -1]] & ~self._ignored()
            self.gaps[[0, -1]] &= ~gaps_returned(problem, self.lay, limits, determined)

    def equations(self, block: Numbering) -> None:
        lay, names, nq = self.lay, self.problem.kernels.coordinates, self.lay.nq
        units = self.problem.kernels.manifest.units
        self.momentum = block(
            "momentum",
            (lay.total + 1, nq),
            lambda k, i: f"momentum of {names[i]} at node {k}",
            lambda s: s.p,
            missed=Missed(
                LAW,
                lambda k, i: f"the momentum of {names[i]} jumps at node {k}",
                lambda _, i: unit_of(momentum_name(names[i]), units),
                apart=1,
            ),
        )
        self.inside = block(
            "inside",
            (lay.total, lay.inside * nq),
            lambda k, i: f"equation of motion of {names[i % nq]} in step {k}",
            lambda s: np.tile(s.p, lay.inside),
            missed=Missed(
                LAW,
                lambda k, i: f"the equation of motion of {names[i % nq]} is violated in step {k}",
                apart=1,
            ),
        )
        self.passing = block(
            "passing",
            lay.index_w != NOWHERE,
            lambda k, i: f"{velocity_name(names[i])} at node {k}",
            lambda s: s.p,
            missed=Missed(LAW, lambda *_: "the velocity at a node does not fit its momentum"),
        )
        self.time = block(
            "time",
            (lay.total * lay.timed,),
            lambda k: f"time of node {k + 1}",
            lambda s: s.time,
            missed=Missed(LAW, lambda _: "the time jumps", seconds),
        )
        self.time_inside = block(
            "time inside",
            lay.index_t_i.shape,
            lambda k, _: f"time inside step {k}",
            lambda s: s.time,
            missed=Missed(LAW, lambda *_: "the time jumps", seconds),
        )

    @property
    def reached(self) -> Index:
        """Rows of the momentum that each node is reached with, shape (total + 1, nq)."""
        passing = self.passing.index
        return np.where(passing == NOWHERE, self.momentum.index, passing)

    def inequalities(self, block: Numbering) -> None:
        """Gaps have the shapes (nodes, nc) and (nodes inside steps, nc)."""
        model, total, inside = self.problem.model, self.lay.total, self.lay.inside
        nodes, steps = np.arange(total + 1), np.repeat(np.arange(total), inside)
        surfaces = model.kernels.surfaces
        moving = np.isin(np.arange(model.nc), list(model.moving))
        self.gap = block(
            "gap",
            self.gaps,
            lambda k, j: f"gap to {surfaces[j]} at node {k}",
            lambda s: self._sizes(s, self._at_nodes(self._beside)),
            nodes,
            missed=Missed(
                words=lambda k, j: f"the motion passes {surfaces[j]} at node {k}", apart=1
            ),
            counted=Counted(BoundKind.GAP, surfaces, nodes),
        )
        self.gap_inside = block(
            "gap inside",
            self._gaps_inside(~moving | (self.lay.index_t_i.size > 0)),
            lambda k, j: f"gap to {surfaces[j]} inside step {k // inside}",
            lambda s: self._sizes(s, np.repeat(self._beside, inside, axis=0)),
            steps,
            counted=Counted(BoundKind.INSIDE, surfaces, steps),
        )

    def _sizes(self, scale: Scale, beside: Bools) -> Array:
        """Sizes of gaps, and of how far places ``beside`` a surface, shape (places, nc), are from
        its end."""
        return np.where(beside, scale.within, scale.gap) if beside.any() else scale.gap

    def _gaps(self, free: tuple[Bools, Bools]) -> Bools:
        """Nodes and surfaces whose gap is a constraint, shape (nodes, nc); ``free`` tells which
        coordinates of the first and of the last node are not fixed.

        Contacts of collisions and those that last hold with equality.  At a fixed end the gap is
        known and was checked: a constraint that cannot move would have no interior, nor would one
        that periodic states make a contact of the other end.  After a lift-off whose force says
        when, the first gap is one of the errors of the step.
        """
        problem, lay, model = self.problem, self.lay, self.problem.model
        keep = np.ones((lay.total + 1, model.nc), dtype=bool)
        hits = (lay.touch.surfaces != NOWHERE) & (lay.touch.open is None)
        keep[lay.collision_nodes[hits], lay.touch.surfaces[hits]] = False
        for step, surfaces in lay.begins_open:
            keep[step + 1, surfaces] = False
        keep[:, self._ignored()] = False
        for step, surfaces in self._left():
            keep[step + 1, surfaces] = True
        for i, mode in enumerate(lay.touch.modes):
            keep[lay.ends[i] : lay.ends[i + 1] + 1, list(mode.closed)] = False
        for node, event in zip(lay.collision_nodes, lay.touch.events, strict=True):
            keep[node, list(event.lands)] = False
        chosen = by_design(problem, model.barrier_kernel)
        for j, own in enumerate(model.surface_coordinates):
            on = sorted({*own, *model.ends.get(j, ())})
            keep[0, j] &= bool(chosen[j] or free[0][on].any())
            keep[-1, j] &= j in model.moving or bool(chosen[j] or free[1][on].any())
        return keep

    def _gaps_inside(self, timed: Bools) -> Bools:
        """Gaps that have rows at the nodes inside steps, shape (total * inside, nc): of the
        surfaces whose times are known there."""
        lay = self.lay
        keep = ~lay.touch.is_closed[lay.phase_of_step] & timed
        for step, surfaces in lay.begins_open:
            keep[step, surfaces] = False
        keep[:, self._ignored()] = False
        for step, surfaces in self._left():
            keep[step, surfaces] = timed[surfaces]
        return np.repeat(keep, lay.inside, axis=0)

    def _ignored(self) -> Bools:
        """Surfaces that the problem ignores, and the places of grips."""
        ignored = np.isin(self.problem.kernels.surfaces, self.problem.ignored)
        return np.asarray(ignored | self.lay.touch.contacts.pull)

    def _left(self) -> Iterator[tuple[int, list[int]]]:
        """Steps that begin where surfaces that are ignored are left, and these: the sequence names
        them, so that they are not passed there, as under load."""
        ignored = self._ignored() & ~self.lay.touch.contacts.pull
        for step, event in zip(self.lay.collision_nodes, self.lay.touch.events, strict=True):
            if step < self.lay.total:
                yield int(step), [surface for surface in event.leaves if ignored[surface]]

    def terms(self, places: Places, laws: Laws) -> list[Term]:
        lay, momentum = self.lay, self.momentum.index
        cost, none = np.full((lay.total, 1), COST), np.full((1, 1), places.zero)
        rows = (momentum[:-1], self.reached[1:], cost, self.inside.index)
        at = lay.index_q, places.times(np.arange(lay.total + 1))
        clocks = lay.index_t_i.reshape(-1, 1) if lay.index_t_i.size else none
        within = lay.index_q_i.reshape(-1, lay.nq), clocks
        (passed,) = np.nonzero(lay.index_w[:, 0] != NOWHERE)
        velocity = lay.index_q[passed], lay.index_w[passed], places.times(passed)
        v_E = lay.index_v_E if len(lay.index_v_E) else np.full(lay.nq, NOWHERE)
        end = (lay.index_q[-1:], places.or_zero(v_E[None]), places.or_zero(lay.time_columns[-1:]))
        return [
            Term("step", places.step(np.arange(lay.total)), rows),
            *self._gap_terms(at, self.gap.index, self._at_nodes(self._beside)),
            *self._gap_terms(
                within, self.gap_inside.index, np.repeat(self._beside, lay.inside, axis=0)
            ),
            Term("terminal_cost", end, (cost[:1],)),
            Term("momentum", velocity, (self.passing.index[passed],), -1.0),
            Term("momentum", velocity, (momentum[passed],)),
        ]

    @cached_property
    def _beside(self) -> Bools:
        """Steps of phases that begin where a contact slips off an end and do not end on the same
        surface, shape (total, nc): there it stays beside it, W <= 0."""
        lay, touch = self.lay, self.lay.touch
        beside = np.zeros((lay.total, self.problem.model.nc), dtype=bool)
        ways = zip(touch.events, (*touch.events[1:], Event()), lay.ends[1:], strict=False)
        for i, (event, then, begin) in enumerate(ways):
            off = [j for j in event.off if j != then.hit and j not in then.lands]
            beside[begin : lay.ends[i + 2], off] = True
        return beside

    def _at_nodes(self, of_steps: Bools) -> Bools:
        """Values of nodes, shape (total + 1, nc), from those of the steps that come to them."""
        return np.vstack([np.zeros_like(of_steps[:1]), of_steps])

    def _gap_terms(self, at: tuple[Index, Index], rows: Index, beside: Bools) -> Iterator[Term]:
        """What is not positive in front of surfaces, and beside their ends."""
        kernel = self.problem.model.barrier_kernel
        yield Term(kernel, at, (np.where(beside, NOWHERE, rows),), -1.0)
        if beside.any():
            yield Term("within", at, (np.where(beside, rows, NOWHERE),), -1.0)

    def entries(self, laws: Laws) -> list[Entries]:
        """Boundary momenta, and the clock."""
        lay, t, momentum = self.lay, self.time.numbers, self.momentum.index
        within, number = self.time_inside.index, np.sort(lay.scheme.nodes)[1:-1]
        h = lay.index_h[lay.phase_of_step]
        parts = (
            (momentum[0], lay.index_p_B, 1.0),
            (momentum[-1], lay.index_p_E, -1.0),
            (t, lay.index_t[1:], 1.0),
            (t, lay.index_t[:-1], -1.0),
            (t, h[: len(t)], -1.0),
            *(
                (within[:, a], unknown, factor)
                for a in range(within.shape[1])
                for unknown, factor in (
                    (lay.index_t_i[:, a], 1.0), (lay.index_t[:-1], -1.0), (h, -number[a])
                )
            ),
        )  # fmt: skip
        return [(row, unknown, np.full(len(row), factor)) for row, unknown, factor in parts]

    def pivots(self, laws: Laws) -> Iterator[Pivot]:
        """The momentum equation of a node determines the next node, those of nodes inside a step
        come before it; the momentum that the next node is reached with determines its velocity."""
        lay, steps, momentum = self.lay, np.arange(self.lay.total), self.momentum.index
        inside = lay.index_q_i.reshape(self.inside.index.shape)
        yield Pivot(inside, self.inside.index, key(steps, INSIDE))
        yield Pivot(lay.index_t_i, self.time_inside.index, key(steps, INSIDE))
        yield Pivot(lay.index_q[1:], momentum[:-1], key(steps, STATE))
        yield Pivot(lay.index_w[1:], self.passing.index[1:], key(steps, COLLISION))
        yield Pivot(lay.index_t[1:], self.time.numbers, key(steps[: self.time.count], STATE))
        yield Pivot(lay.index_p_E, momentum[-1], key(lay.total, STATE))
