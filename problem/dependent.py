"""What a start leaves out and the constraints of the model decide."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from dmoc.base.tolerances import SAME
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
    slopes = problem.model.joint_slopes(_anywhere(problem))
    return _decide(slopes[problem.model.joints_in_place], left)


def following_rates(
    problem: Problem, position: Array, velocity: Array, still: list[int], left: Sequence[int]
) -> Array:
    """The bounds of the velocities at the start, shape (nq, 2), as they are given and with those
    that are ``still`` to be said.

    Where a velocity is given, or a constraint moves with the time, those that the constraints
    decide are what these make of the others; so are those of coordinates that are ``left`` out.
    They are free where that depends on the place or on the design.  All others are zero.
    """
    velocity = velocity.copy()
    velocity[still] = 0.0
    if not still or not problem.model.nj:
        return velocity
    fixed = position[:, 0] == position[:, 1]
    chosen = bool(problem.design) and by_design(problem, "joint_rate").any()
    placed = bool(fixed.all()) and not chosen
    slopes = problem.model.joint_slopes(position[:, 0] if placed else _anywhere(problem))
    of_left = [i for i in still if i in left]
    moves = velocity.any() or bool(slopes[:, -1].any())
    follow = _decided(slopes, still if moves else of_left)
    if not {*of_left} <= {*follow}:
        follow = _decided(slopes, of_left)
    others = np.setdiff1d(np.arange(problem.nq), follow)
    velocity[follow] = -np.inf, np.inf
    if follow and placed and (velocity[others, 0] == velocity[others, 1]).all():
        moved = slopes[:, others] @ velocity[others, 0] + slopes[:, -1]
        velocity[follow] = least_squares(slopes[:, follow], -moved)[:, None]
    return velocity


def _anywhere(problem: Problem) -> Array:
    """A position of no special kind."""
    return np.cos(1 + np.arange(problem.nq))


def _decide(slopes: Array, left: Sequence[int]) -> bool:
    """Whether constraints of these slopes (nj, nq + 1) decide some coordinates."""
    return len(_decided(slopes, left)) == len(left)


def _decided(slopes: Array, left: Sequence[int]) -> list[int]:
    """Coordinates among those ``left``, or rates, that constraints of these slopes (nj, nq + 1)
    decide where all others are known: the motions that constraints allow move none of them."""
    own = slopes[:, list(left)]
    if not (own.size and np.isfinite(own).all()):
        return []
    open_ways = np.linalg.svd(own)[2][np.linalg.matrix_rank(own) :]
    moved = np.abs(open_ways).max(axis=0, initial=0.0)
    return [i for i, far in zip(left, moved, strict=True) if far <= SAME]
