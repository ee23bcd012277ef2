"""The way that a guess takes: points at the start, the collisions and the goal, velocities
there, and durations between them."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.nlp.problem import Boundary, Problem, midpoints
from dmoc.nlp.surfaces import contact_point
from dmoc.nlp.windows import WINDOW, Dynamics

# A plastic impact has no mirror image: coefficient of restitution that the plan assumes at least.
SOFTEST_MIRROR = 0.3
# Share of the final time that a phase gets at least.
SHORTEST_SHARE = 0.04


@dataclass(frozen=True)
class Plan:
    """Via points of all coordinates: positions (phases + 1, nq), velocities before each via
    point, and durations."""

    positions: Array
    velocities: Array
    durations: Array


def prescribed_of(problem: Problem, final_time: float) -> tuple[int, ...]:
    """Choose nu coordinates: those that surfaces and goal say most about, as long as the others
    can follow from them."""
    nq, nu = problem.nq, problem.nu
    if nu == 0 or nu >= nq:
        return tuple(range(nq))
    surfaces = problem.kernels.manifest["surface_coordinates"]
    goal = problem.goal_bounds.position
    said = [
        sum(i in surfaces[s] for s in problem.sequence) + bool(goal[i, 0] == goal[i, 1])
        for i in range(nq)
    ]
    order = sorted(range(nq), key=lambda i: (-said[i], i))
    points = _via_positions(problem, final_time)
    for choice in itertools.combinations(order, nu):
        if any(Dynamics(problem, q, np.zeros(nq), 0.0).reach(choice) > WINDOW for q in points):
            return tuple(sorted(choice))
    return tuple(range(nq))


def _via_positions(problem: Problem, final_time: float) -> Array:
    """Positions at the start, at the collisions and at the goal, shape (phases + 1, nq); the
    collisions are spread over the time."""
    start = problem.start_position
    goal = midpoints(problem.goal_bounds.position, start)
    share = np.linspace(0.0, 1.0, problem.phases + 1)[:, None]
    points = (1 - share) * start + share * goal
    for i, surface in enumerate(problem.sequence):
        points[i + 1] = contact_point(
            problem, points[i + 1], points[i], surface, float(share[i + 1, 0]) * final_time
        )
    return points


def plan_of(
    problem: Problem, prescribed: tuple[int, ...], final_time: float, even: bool = False
) -> Plan:
    """Durations in proportion to the distances, or even ones, and velocities that continue
    smoothly in the mirror image behind each surface."""
    points = _via_positions(problem, final_time)
    legs = np.diff(points, axis=0)
    inertia = problem.model.mass(points[0])[np.ix_(prescribed, prescribed)]
    lengths = np.sqrt(
        np.einsum("ki,ij,kj->k", legs[:, list(prescribed)], inertia, legs[:, list(prescribed)])
    )
    # Between two collisions with one surface the motion leaves and returns: such a phase gets an
    # average share.
    flights = lengths <= 1e-6 * lengths.sum()
    lengths = np.where(flights, lengths.sum() / max((~flights).sum(), 1) or 1.0, lengths)
    shares = np.ones(len(lengths)) if even else np.maximum(lengths / lengths.sum(), SHORTEST_SHARE)
    durations = np.clip(final_time * shares / shares.sum(), *problem.duration_bounds.T)
    velocities = np.zeros_like(points)
    velocities[0] = end_velocity(problem, problem.start_bounds, points[0], np.zeros(problem.nq))
    slowest = lengths.sum() / final_time / 2
    for i, surface in enumerate(problem.sequence):
        j = problem.kernels.surfaces.index(surface)
        slope = problem.model.gap_slopes(points[i + 1], float(durations[: i + 1].sum()))[j, :-1]
        e = max(float(problem.restitution_values[j]), SOFTEST_MIRROR)
        before, after = legs[i] / durations[i], legs[i + 1] / durations[i + 1]
        response, square = problem.model.impulse_response(points[i + 1], slope)
        mirrored = (
            after - (1 + 1 / e) * (slope @ after) / square * response if square > 0 else after
        )
        velocity = (durations[i + 1] * before + durations[i] * mirrored) / (
            durations[i] + durations[i + 1]
        )
        if square > 0:  # arrive with some speed, or there is no collision
            normal = slope @ velocity / np.sqrt(square)
            velocity += (max(normal, slowest) - normal) * response / np.sqrt(square)
        velocities[i + 1] = velocity
    natural = (
        1.5 * legs[-1] / durations[-1] - 0.5 * velocities[-2]
        if problem.phases == 1
        else legs[-1] / durations[-1]
    )
    velocities[-1] = end_velocity(problem, problem.goal_bounds, points[-1], natural)
    return Plan(points, velocities, durations)


def end_velocity(problem: Problem, boundary: Boundary, q: Array, default: Array) -> Array:
    """Velocity at an end: what the bounds fix, as velocity or as momentum, else the default."""
    if np.isfinite(boundary.momentum).all():
        return problem.model.velocity(q, midpoints(boundary.momentum, np.zeros(problem.nq)))
    return midpoints(
        boundary.velocity, np.where(np.isfinite(boundary.momentum).any(axis=1), 0.0, default)
    )
