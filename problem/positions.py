"""The positions at both ends of a problem, as far as it says where they are."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.problem.quantities import onto_quantities
from dmoc.problem.ranges import midpoints
from dmoc.problem.reach import onto_first
from dmoc.problem.relations import carried

if TYPE_CHECKING:
    from dmoc.problem.problem import Problem


def start_position_of(problem: Problem) -> Array:
    """The position at the start: fixed values, middles of ranges, and for free ones what
    their bounds have nearest to zero; where neither end says anything of a coordinate, it is
    that of the first surface of the sequence."""
    q = midpoints(problem.start_bounds.position, np.zeros(problem.nq))
    (at,) = onto_quantities(problem, "start", onto_first(problem, q)[None])
    return np.asarray(at)


def goal_position_of(problem: Problem) -> Array:
    """The position at the goal: fixed values, middles of ranges, free ones as ``periodic`` says
    or as at the start; moved to where the quantities are that the goal states."""
    q = midpoints(problem.goal_bounds.position, carried(problem, problem.start_position))
    (at,) = onto_quantities(problem, "goal", q[None])
    return np.asarray(at)


def unsaid_of(problem: Problem) -> Array:
    """1 for coordinates of which neither start nor goal say where they are, else 0."""
    ends = np.hstack([problem.start_bounds.position, problem.goal_bounds.position])
    return np.where(np.isinf(ends).all(axis=1), 1.0, 0.0)
