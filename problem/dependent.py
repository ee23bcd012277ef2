"""What a start leaves out and the constraints of the model decide."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.mechanics.algebra import least_squares
from dmoc.problem.design import by_design

if TYPE_CHECKING:
    from dmoc.problem.problem import Problem


def places_follow(problem: Problem, left: Sequence[int]) -> bool:
    """Whether the constraints decide these coordinates where the others are known, at a position of
    no special kind."""
    if not left or len(left) > problem.model.nj:
        return not left
    return _decide(problem.model.joint_slopes(np.cos(1 + np.arange(problem.nq))), left)


def following_rates(
    problem: Problem, position: Array, velocity: Array, still: list[int], left: Sequence[int]
) -> Array:
    """The bounds of the velocities at the start, shape (nq, 2), as they are given and with those
    that are ``still`` to be said: zero, or what the constraints make of the others, where one of
    these moves, and of coordinates that are left out; free where that depends on the place or on
    the design."""
    velocity = velocity.copy()
    velocity[still] = 0.0
    left = still if velocity.any() else [i for i in still if i in left]
    if not left or len(left) > problem.model.nj:
        return velocity
    fixed = position[:, 0] == position[:, 1]
    others = np.setdiff1d(np.arange(problem.nq), left)
    chosen = bool(problem.design) and by_design(problem, "joint").any()
    known = not chosen and fixed.all() and (velocity[others, 0] == velocity[others, 1]).all()
    at = position[:, 0] if known else np.cos(1 + np.arange(problem.nq))
    slopes = problem.model.joint_slopes(at)
    if not _decide(slopes, left):
        return velocity
    velocity[left] = -np.inf, np.inf
    if known:
        moved = slopes[:, others] @ velocity[others, 0] + slopes[:, -1]
        velocity[left] = least_squares(slopes[:, left], -moved)[:, None]
    return velocity


def _decide(slopes: Array, left: Sequence[int]) -> bool:
    """Whether constraints of these slopes (nj, nq + 1) decide some coordinates."""
    own = slopes[:, list(left)]
    return bool(np.isfinite(own).all()) and np.linalg.matrix_rank(own) == len(left)
