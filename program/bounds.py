"""Bounds of the unknowns, in units of the problem."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from dmoc.base.names import momentum_name, velocity_name
from dmoc.codegen.kernels import Array
from dmoc.problem.problem import Problem
from dmoc.problem.surfaces import near_surface
from dmoc.program.blocks import NOWHERE, Index
from dmoc.program.hit_stages import STOP
from dmoc.program.laws.ends import Goal
from dmoc.program.laws.impact import ImpactLaw
from dmoc.program.layout import Layout
from dmoc.program.scale import Scale

# The smallest step that is distinguishable from none, relative to the final time: shorter steps
# divide rounding errors by h^2.
SMALLEST_STEP = 1e-8
# A bound that lies on the surface to be hit gives way by this share of the coordinate's size.
GIVES_WAY = 1e-3
# Where collisions would rather merge, a phase between them shrinks to nothing and its equations
# with it: share of the largest final time (or of its own longest duration) that each phase of a
# motion with collisions keeps, unless the problem says otherwise.
SHORTEST_PHASE = 1e-3


def goal_rows(problem: Problem, lay: Layout) -> list[Goal]:
    """The values of the goal as constraints, where they are not to be bounds."""
    goal, names, found = problem.goal_bounds, problem.kernels.coordinates, list[Goal]()
    for index, bounds, name in (
        (lay.index_q[-1], goal.position, str),
        (lay.index_p_E, goal.momentum, momentum_name),
        (lay.index_v_E, goal.velocity, velocity_name),
    ):
        for i, (low, high), q in zip(index, bounds, names, strict=False):
            if low > -np.inf or high < np.inf:
                found.append(Goal(int(i), float(low), float(high), name(q)))
    return found


def limits(
    problem: Problem,
    lay: Layout,
    law: ImpactLaw,
    scale: Scale,
    goals: list[Goal],
    pulling: bool = False,
) -> tuple[Array, Array]:
    """Lower and upper bounds of x; ``goals`` are constraints and bound nothing, and closed contacts
    may pull if they are ``pulling``."""
    box = np.tile((-np.inf, np.inf), (lay.size, 1))
    box[lay.index_h] = np.maximum(
        _durations(problem) / np.array(lay.steps)[:, None], SMALLEST_STEP * scale.time
    )
    box[lay.index_q] = problem.coordinate_bounds
    box[lay.index_u] = problem.input_bounds
    box[lay.index_lam] = np.stack([np.zeros(len(lay.index_lam)), law.most_impulse], axis=1)
    for node, boundary, p, v in (
        (0, problem.start_bounds, lay.index_p_B, lay.index_v_B),
        (-1, problem.goal_bounds, lay.index_p_E, lay.index_v_E),
    ):
        at = lay.index_q[node]
        box[at, 0] = np.maximum(box[at, 0], boundary.position[:, 0])
        box[at, 1] = np.minimum(box[at, 1], boundary.position[:, 1])
        box[p] = boundary.momentum
        if len(v):
            box[v] = boundary.velocity
    for unknown, side, limit in list(_at_contacts(problem, lay, scale, box)):
        box[unknown, side] = limit
    for node, places in zip(lay.collision_nodes, problem.via_bounds, strict=True):
        at = lay.index_q[node]
        box[at, 0] = np.maximum(box[at, 0], places[:, 0])
        box[at, 1] = np.minimum(box[at, 1], places[:, 1])
    if not pulling:
        for index in (lay.index_P, lay.index_P_c):
            box[index[index != NOWHERE], 0] = 0.0
    struck, touched = (lay.index_P_h[touches] for touches in (~law.touching, law.touching))
    box[struck[struck != NOWHERE], 0] = 0.0
    # Of a touch, the impulse of compression is zero by its equation, and no bound beside it.
    stops = touched[:, STOP]
    box[stops[stops != NOWHERE]] = 0.0
    smooth = lay.touch.sticks & (problem.model.friction == 0)
    if smooth.any():  # they hold nothing
        along = np.repeat(smooth, [n + 1 for n in lay.steps], axis=0)
        box[lay.index_T[along]] = 0.0
        box[lay.index_T_c[smooth[1:] & lay.touch.rubs_in_impact]] = 0.0
    box[lay.index_q_i] = np.tile(problem.coordinate_bounds, (lay.inside, 1))
    box[lay.index_t[:1]] = 0.0
    for goal in goals:
        box[goal.unknown] = (-np.inf, np.inf)
    if goals:
        box[lay.index_q[-1]] = problem.coordinate_bounds
    return box[:, 0].copy(), box[:, 1].copy()


def _durations(problem: Problem) -> Array:
    """Bounds of the durations of the phases; a bound that was given counts."""
    latest = problem.final_time_bounds[1]
    shortest = SHORTEST_PHASE * latest if len(problem.sequence) and np.isfinite(latest) else 0.0
    low, high = problem.duration_bounds.T
    return np.stack(
        [np.where(low > 0, low, np.minimum(shortest, SHORTEST_PHASE * high)), high], axis=1
    )


def _at_contacts(
    problem: Problem, lay: Layout, scale: Scale, box: Array
) -> Iterator[tuple[int, int, float]]:
    """Bounds of coordinates that contacts hold where the bounds are, which would leave no interior:
    unknown, side, and a bound that gives way a little."""
    manifest = problem.kernels.manifest
    for nodes, surface in _closed(problem, lay):
        involved = manifest["surface_coordinates"][surface]
        if len(involved) > 1 or surface in manifest["moving_surfaces"]:
            continue
        j = int(involved[0])
        unknowns = lay.index_q[nodes, j]
        unknowns = unknowns[box[unknowns, 0] < box[unknowns, 1]]
        for side, sign in enumerate((-1.0, 1.0)):
            for limit in np.unique(box[unknowns, side]):
                q = np.zeros(problem.nq)
                q[j] = limit
                if np.isfinite(limit) and near_surface(problem, q, surface):
                    way = sign * GIVES_WAY * max(abs(limit), scale.q[j])
                    for unknown in unknowns[box[unknowns, side] == limit]:
                        yield int(unknown), side, float(limit + way)
    yield from _where_stuck(problem, lay, box)


def _closed(problem: Problem, lay: Layout) -> Iterator[tuple[Index, str]]:
    """Nodes at which a surface is hit, or closed."""
    for node, event in zip(lay.collision_nodes, problem.events, strict=True):
        if event.surface:
            yield np.array([node]), event.surface
    for i, mode in enumerate(problem.modes):
        nodes = np.arange(lay.ends[i], lay.ends[i + 1] + 1)
        yield from ((nodes, surface) for surface in mode.closed)


def _where_stuck(problem: Problem, lay: Layout, box: Array) -> Iterator[tuple[int, int, float]]:
    """Bounds of a coordinate along which a contact sticks: one node of the phase says them for all,
    and none beside one where the coordinate is fixed."""
    if problem.explicit_time:
        return
    on = problem.kernels.manifest["tangent_coordinates"]
    for i, mode in enumerate(problem.modes):
        nodes = np.arange(lay.ends[i], lay.ends[i + 1] + 1)
        for tangent in mode.sticking:
            if len(on[tangent]) > 1:
                continue
            j = int(on[tangent][0])
            unknowns = lay.index_q[nodes, j]
            fixed = box[unknowns, 0] == box[unknowns, 1]
            usual = (box[unknowns] == problem.coordinate_bounds[j]).all(axis=1) & ~fixed
            usual[0] &= fixed.any()
            for unknown in unknowns[usual]:
                yield from ((int(unknown), side, way) for side, way in ((0, -np.inf), (1, np.inf)))
