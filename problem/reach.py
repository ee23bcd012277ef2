"""How far the coordinates of a problem may be expected to move, by what it says."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dmoc.base.tolerances import BALANCED
from dmoc.codegen.kernels import Array

if TYPE_CHECKING:
    from dmoc.problem.problem import Problem

# Newton steps to the surface where a motion may begin anywhere, and times at which a surface is
# looked at to see how far it moves.
NEWTON, MOVING = 30, 33


def onto_first(problem: Problem, q: Array) -> Array:
    """Move the coordinates of which nothing is said onto the first surface of the sequence, as
    it is at the start; the point as it is where that does not lead there."""
    surfaces = [event.surface for event in problem.touch.events if event.impact]
    if not surfaces or not problem.unsaid.any():
        return q
    j, at = surfaces[0], q.copy()
    inertia = np.abs(np.diagonal(problem.model.mass(q)))
    with np.errstate(all="ignore"):
        for _ in range(NEWTON):
            gap, slope = (
                problem.model.gaps(at)[j],
                problem.model.gap_slopes(at)[j, :-1] * problem.unsaid,
            )
            if abs(gap) <= problem.model.gap_rounding(at, 0.0)[j]:
                return at
            at = at - gap * (slope / inertia) / (slope @ (slope / inertia))
    return q


def reach_of(problem: Problem) -> Array:
    """How far each coordinate may be expected to move: to the goal, to zero, to the surfaces
    of the sequence, or, where that says nothing, what the inertias make of the reach of the
    others, shape (nq,)."""
    start, goal = problem.start_position, problem.goal_position
    reach = np.max(np.abs([goal - start, start, goal]), axis=0) * (1 - problem.unsaid)
    if problem.kernels.surfaces:
        slopes, gaps = problem.model.gap_slopes(start), np.abs(problem.model.gaps(start))
        gaps = np.where(gaps <= problem.model.gap_rounding(start), 0.0, gaps)
        for j in {event.surface for event in problem.touch.events if event.impact}:
            size = np.abs(slopes[j, :-1])
            with np.errstate(divide="ignore", invalid="ignore"):
                away = np.where(size > 0, gaps[j] / size, 0.0)
            reach = np.where((reach == 0) & np.isfinite(away), away, reach)
    box = problem.coordinate_bounds
    width = np.where(
        np.isfinite(box).all(axis=1), np.ptp(np.where(np.isfinite(box), box, 0.0), axis=1), 0.0
    )
    reach = np.where(reach > 0, reach, width)
    root = np.sqrt(np.abs(problem.inertia))
    reach = np.where(reach > 0, reach, (reach * root).max() / np.where(root > 0, root, 1.0))
    return reach if (reach > 0).all() else np.where(reach > 0, reach, _swing(problem))


def _swing(problem: Problem) -> Array:
    """How far each coordinate gets in the time that a problem allows where nothing else says
    so, shape (nq,): up and down against its forces in a phase, or as far as surfaces of the
    sequence move; where these balance, what the inertias make of the others; 1 where these
    say nothing either."""
    low, high = problem.final_time_bounds
    time = high if np.isfinite(high) else max(low, 0.0)
    with np.errstate(all="ignore"):
        force = np.abs(problem.model.acceleration(problem.start_position, u=np.zeros(problem.nu)))
        swing = np.where(np.isfinite(force), force, 0.0) * (time / problem.phases) ** 2 / 8
        times = np.linspace(0.0, time, MOVING)
        gaps = problem.model.gaps(np.tile(problem.start_position, (MOVING, 1)), times)
        slopes = np.abs(problem.model.gap_slopes(problem.start_position)[:, :-1])
        for j in {event.surface for event in problem.touch.events if event.impact}:
            moved = np.ptp(gaps[:, j]) / slopes[j]
            swing = np.where(np.isfinite(moved), np.maximum(swing, moved), swing)
    root = np.sqrt(np.abs(problem.inertia))
    share = (swing * root).max() / np.where(root > 0, root, 1.0)
    swing = np.where(swing > BALANCED * share, swing, share)
    return np.where(swing > 0, swing, 1.0)
