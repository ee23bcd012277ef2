"""Bounds of the unknowns, in units of the problem."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import cast

import numpy as np

from dmoc.base.names import momentum_name, velocity_name
from dmoc.codegen.kernels import Array
from dmoc.problem.problem import Problem
from dmoc.program.blocks import Index
from dmoc.program.laws.ends import Goal
from dmoc.program.laws.law import Law
from dmoc.program.layout import Layout
from dmoc.program.scale import Scale
from dmoc.program.stacked import Stacked

# The smallest step that is distinguishable from none, relative to the final time: shorter steps
# divide rounding errors by h^2.
SMALLEST_STEP = 1e-8
# Where collisions would rather merge, a phase between them shrinks to nothing and its equations
# with it: share of the largest final time (or of its own longest duration) that each phase of a
# motion with collisions keeps, unless the problem says otherwise.
SHORTEST_PHASE = 1e-3


def goal_rows(problem: Problem, lay: Layout) -> list[Goal]:
    """The values of the goal as constraints, where they are not to be bounds."""
    goal, coordinates, rows = problem.goal_bounds, problem.kernels.coordinates, list[Goal]()
    for index, bounds, names in (
        (lay.index_q[-1], goal.position, coordinates),
        (lay.index_p_E, goal.momentum, map(momentum_name, coordinates)),
        (lay.index_v_E, goal.velocity, map(velocity_name, coordinates)),
        (lay.index_totals, problem.total_bounds, problem.model.totals_of),
    ):
        for i, (low, high), name in zip(index, bounds, names, strict=False):
            if low > -np.inf or high < np.inf:
                rows.append(Goal(int(i), float(low), float(high), name))
    return rows


def limits(
    problem: Problem | Stacked,
    lay: Layout,
    laws: Iterable[Law],
    scale: Scale,
    goals: Sequence[Goal],
) -> tuple[Array, Array]:
    """Lower and upper bounds of x, shape (..., n) each; ``goals`` are constraints and bound
    nothing."""
    time = np.asarray(scale.time)[..., None]
    box = np.full((*time.shape[:-1], lay.size, 2), (-np.inf, np.inf))
    for side, durations in enumerate(np.moveaxis(shortest_durations(problem), -1, 0)):
        box[..., lay.index_h, side] = np.maximum(lay.step_sizes(durations), SMALLEST_STEP * time)
    places = problem.coordinate_bounds[..., None, :, :]
    box[..., lay.index_q, :] = places
    box[..., lay.index_u, :] = problem.input_bounds[..., None, :, :]
    for node, boundary, p, v in (
        (0, problem.start_bounds, lay.index_p_B, lay.index_v_B),
        (-1, problem.goal_bounds, lay.index_p_E, lay.index_v_E),
    ):
        _narrow(box, lay.index_q[node], boundary.position)
        box[..., p, :] = boundary.momentum
        if len(v):
            box[..., v, :] = boundary.velocity
            _narrow(box, v, problem.velocity_bounds)
    for law in laws:
        law.bounds(cast(Problem, problem), box, scale)
    for i, node in enumerate(lay.collision_nodes):
        _narrow(box, lay.index_q[node], problem.via_bounds[..., i, :, :])
    if lay.inside:
        box[..., lay.index_q_i, :] = np.concatenate([places] * lay.inside, axis=-2)
    box[..., lay.index_t[:1], :] = 0.0
    box[..., lay.index_design, :] = problem.design_bounds
    for goal in goals:
        box[goal.unknown] = (-np.inf, np.inf)
    if goals:
        box[lay.index_q[-1]] = problem.coordinate_bounds
        if len(lay.index_v_E):
            box[lay.index_v_E] = problem.velocity_bounds
    return box[..., 0].copy(), box[..., 1].copy()


def _narrow(box: Array, index: Index, bounds: Array) -> None:
    """Keep some unknowns within more bounds, shape (..., n, 2)."""
    box[..., index, 0] = np.maximum(box[..., index, 0], bounds[..., 0])
    box[..., index, 1] = np.minimum(box[..., index, 1], bounds[..., 1])


def shortest_durations(problem: Problem | Stacked) -> Array:
    """Bounds of the durations of the phases, shape (..., phases, 2): the shortest that programs
    know, unless a bound was given."""
    latest = np.asarray(problem.final_time_bounds[1])[..., None]
    shortest = np.where(np.isfinite(latest) & bool(problem.sequence), SHORTEST_PHASE * latest, 0.0)
    low, high = problem.duration_bounds[..., 0], problem.duration_bounds[..., 1]
    shortest = np.minimum(shortest, SHORTEST_PHASE * high)
    return np.stack([np.where(low > 0, low, shortest), high], axis=-1)
