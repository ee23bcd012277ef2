"""How far the coordinates of a problem may be expected to move, by what it says."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dmoc.base.tolerances import BALANCED, SAME
from dmoc.codegen.kernels import Array

if TYPE_CHECKING:
    from dmoc.problem.problem import Problem

# Newton steps to the surface where a motion may begin anywhere, and times at which a surface is
# looked at to see how far it moves.
NEWTON, MOVING = 30, 33
# Ends at this share of the way to a surface, or of what the forces alone do in a phase, say
# nothing, as the 1e-16 that a user has computed instead of 0.  A spring does as much in 14
# oscillations, which need finer meshes.
UNRESOLVED = 1e-3


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


def inertia_of(problem: Problem) -> Array:
    """Diagonal of the mass matrix at the start, shape (nq,)."""
    return np.diagonal(problem.model.mass(problem.start_position)).copy()


def reach_of(problem: Problem) -> Array:
    """How far each coordinate may be expected to move: to the goal, to zero, to the surfaces
    of the sequence, or, where that says nothing, what the inertias make of the reach of the
    others, which for a light leg are many turns: half of one is as far as it gets, shape (nq,)."""
    start, goal = problem.start_position, problem.goal_position
    ends = np.max(np.abs([goal - start, start, goal]), axis=0) * (1 - problem.unsaid)
    root = np.sqrt(np.abs(problem.inertia))
    root = np.where(root > 0, root, 1.0)
    away, shortest = _to_surfaces(problem, root)
    least = SAME * (np.maximum(ends, away) * root).max() / root
    least = np.maximum(least, UNRESOLVED * np.maximum(shortest, _swung(problem)))
    box = problem.coordinate_bounds
    width = np.where(
        np.isfinite(box).all(axis=1), np.ptp(np.where(np.isfinite(box), box, 0.0), axis=1), 0.0
    )
    reach = np.zeros(problem.nq)
    for other in (ends, away, width):
        reach = np.where(reach > least, reach, other)
    reach = np.where(reach > least, reach, (reach * root).max() / root)
    reach = reach if (reach > 0).all() else np.where(reach > 0, reach, _swing(problem))
    far = (reach > np.pi) & (np.maximum(ends, width) <= least)
    return np.where(far & _turns(problem), np.pi, reach) if far.any() else reach


def gap_sizes(problem: Problem, q: Array, t: float = 0.0) -> Array:
    """Sizes of the gaps at a position, of what makes them there and of how far they may move, where
    that is a number, shape (nc,)."""
    moved = np.abs(problem.model.gap_slopes(q, t)[:, :-1]) @ problem.reach
    return np.asarray(np.fmax(problem.model.gap_sizes(q, t), moved))


def latest_time(problem: Problem) -> float:
    """The end of the time that a problem allows, or a time behind its beginning."""
    low, high = problem.final_time_bounds
    return float(high if np.isfinite(high) else 1.0 + 2.0 * low)


def rate_sizes(problem: Problem, slopes: Array, v: Array) -> Array:
    """Sizes of rates with some slopes (..., n, nq + 1), of velocities (..., nq) and of what makes
    the reach in the time that a problem allows, shape (..., n)."""
    fast = np.maximum(np.abs(v), problem.reach / latest_time(problem))
    one = np.ones((*v.shape[:-1], 1))
    return np.asarray((np.abs(slopes) @ np.concatenate([fast, one], axis=-1)[..., None])[..., 0])


def _to_surfaces(problem: Problem, root: Array) -> tuple[Array, Array]:
    """How far each coordinate alone is from the surfaces of the sequence, and its part of the
    shortest ways to them, where inertias with these roots measure lengths, shape (nq,) each."""
    start, away, shortest = problem.start_position, np.zeros(problem.nq), np.zeros(problem.nq)
    if not problem.kernels.surfaces:
        return away, shortest
    slopes, gaps = np.abs(problem.model.gap_slopes(start)), np.abs(problem.model.gaps(start))
    gaps = np.where(gaps <= problem.model.gap_rounding(start), 0.0, gaps)
    for j in {event.surface for event in problem.touch.events if event.impact}:
        with np.errstate(divide="ignore", invalid="ignore"):
            to = gaps[j] / slopes[j, :-1]
            part = (slopes[j, :-1] / root) ** 2
            way = to * (part / part.sum())
        away = np.where((away == 0) & np.isfinite(to), to, away)
        shortest = np.where(np.isfinite(way), np.maximum(shortest, way), shortest)
    return away, shortest


def _turns(problem: Problem) -> NDArray[np.bool_]:
    """Which coordinates are angles: inertias, forces and contacts are as before after a full turn,
    and not after another one, shape (nq,)."""
    model, nq = problem.model, problem.nq
    ways = np.vstack([np.zeros(nq), 2 * np.pi * np.eye(nq), np.eye(nq)])
    q = problem.start_position + np.cos(np.arange(nq)) + ways  # where no sine is zero
    v = np.ones_like(q)
    with np.errstate(all="ignore"):
        parts = (*model.equations(q, v), model.gaps(q), model.tangent_slopes(q))
        turned, other = np.ones(nq, bool), np.zeros(nq, bool)
        for part in parts:
            rows = part.reshape(len(q), -1)
            least = SAME * np.abs(rows).max(initial=0.0)
            moved = np.abs(rows[1:] - rows[0]).max(axis=1, initial=0.0)
            turned &= moved[:nq] <= least
            other |= moved[nq:] > least
    return turned & other


def _time(problem: Problem) -> float:
    low, high = problem.final_time_bounds
    return high if np.isfinite(high) else max(low, 0.0)


def _swung(problem: Problem) -> Array:
    """How far the forces alone move each coordinate up and down in a phase, shape (nq,)."""
    with np.errstate(all="ignore"):
        force = np.abs(problem.model.acceleration(problem.start_position, u=np.zeros(problem.nu)))
        return np.where(np.isfinite(force), force, 0.0) * (_time(problem) / problem.phases) ** 2 / 8


def _swing(problem: Problem) -> Array:
    """How far each coordinate gets in the time that a problem allows where nothing else says
    so, shape (nq,): up and down against its forces in a phase, or as far as surfaces of the
    sequence move; where these balance, what the inertias make of the others; 1 where these
    say nothing either."""
    swing = _swung(problem)
    with np.errstate(all="ignore"):
        times = np.linspace(0.0, _time(problem), MOVING)
        gaps = problem.model.gaps(np.tile(problem.start_position, (MOVING, 1)), times)
        slopes = np.abs(problem.model.gap_slopes(problem.start_position)[:, :-1])
        for j in {event.surface for event in problem.touch.events if event.impact}:
            moved = np.ptp(gaps[:, j]) / slopes[j]
            swing = np.where(np.isfinite(moved), np.maximum(swing, moved), swing)
    root = np.sqrt(np.abs(problem.inertia))
    share = (swing * root).max() / np.where(root > 0, root, 1.0)
    swing = np.where(swing > BALANCED * share, swing, share)
    return np.where(swing > 0, swing, 1.0)
