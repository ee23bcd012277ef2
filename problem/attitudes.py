"""What a problem says of attitudes: quaternions and their rates in the place of attitudes and
angular velocities, and pitches of Euler angles away from where these say nothing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from dmoc.base.arguments import is_number
from dmoc.base.errors import ProblemError
from dmoc.base.names import omega_names, velocity_name
from dmoc.codegen.kernels import Array, Kernels
from dmoc.mechanics.attitudes import coordinates_of, in_coordinates, in_rates, quaternion_of
from dmoc.mechanics.model_values import by_name
from dmoc.motion.attitude import attitude, nearer

if TYPE_CHECKING:
    from dmoc.problem.problem import Problem

# The largest pitch of Euler angles, 85 degrees, where a problem states none; at a quarter of a turn
# yaw and roll are one, and the mass matrix is singular.
STEEPEST, QUARTER = float(np.deg2rad(85)), np.pi / 2
ANOTHER = (
    "where yaw and roll turn about one axis and the mass matrix is singular: build the body with "
    "world.free(place, attitude='q'), whose quaternion has no such place"
)


def read_attitudes(kernels: Kernels, state: Mapping[str, Any], what: str) -> dict[str, Any]:
    """A state by name with attitudes as such, however they are stated."""
    return {
        name: attitude(quaternion_of(value, f"{what} of {name}"))
        if name in kernels.manifest.attitudes and value is not None
        else value
        for name, value in state.items()
    }


def ends_of(problem: Problem) -> dict[str, dict[str, Any]]:
    """Start and goal by name of coordinates, velocities, momenta and quantities.  A goal has the
    sign of its quaternion that is nearer to the start."""
    kernels = problem.kernels
    start = _with_rates(kernels, in_coordinates(kernels, problem.start, "start"), "start")
    goal = in_coordinates(kernels, problem.goal, "goal")
    for name in {*kernels.manifest.attitudes} & {*problem.goal}:
        own = coordinates_of(kernels, name)
        both = [[end.get(q) for q in own] for end in (start, goal)]
        if all(is_number(x) for p in both for x in p):
            p = nearer(*np.array(both, dtype=float))
            goal |= dict(zip(own, p.tolist(), strict=True))
    ends = {"start": start, "goal": _with_rates(kernels, goal, "goal")}
    _check_pitches(kernels, ends)
    return ends


def _with_rates(kernels: Kernels, state: Mapping[str, Any], what: str) -> dict[str, Any]:
    """A state with rates in the place of angular velocities.  Where these are ranges, or the
    attitude is no number, they stay, those of a start that are left out as 0, and its rates are
    free."""
    plain = in_rates(kernels, state, state, what)
    for name in kernels.manifest.attitudes:
        spin, rates = omega_names(name), map(velocity_name, coordinates_of(kernels, name))
        if what == "start" and {*spin} & {*plain}:
            plain = dict.fromkeys(spin, 0.0) | dict.fromkeys(rates) | plain
    return plain


def _check_pitches(kernels: Kernels, ends: Mapping[str, Mapping[str, Any]]) -> None:
    """Refuse ends with a pitch of a quarter of a turn."""
    for end, state in ends.items():
        for name in (kernels.coordinates[i] for i in kernels.manifest.pitches):
            value: Any = state.get(name)
            if is_number(value) and abs(np.cos(float(value))) < np.cos(STEEPEST):
                raise ProblemError(
                    f"the {end} has the pitch {name} = {float(value):g}, within 5 degrees of a "
                    f"quarter of a turn, {ANOTHER}."
                )


def with_pitches(problem: Problem, boxes: Array) -> Array:
    """Bounds of the coordinates, shape (nq, 2), with those of pitches that have none."""
    for i in problem.kernels.manifest.pitches:
        low, high = boxes[i]
        if low == -np.inf and high == np.inf:
            boxes[i] = -STEEPEST, STEEPEST
        elif np.floor((high - QUARTER) / np.pi) >= np.ceil((low - QUARTER) / np.pi):
            name = problem.kernels.coordinates[i]
            raise ProblemError(
                f"the bounds of the pitch {name} ({low:g} to {high:g}) hold a quarter of a turn, "
                f"{ANOTHER}; or bound {name} to ({-STEEPEST:.2f}, {STEEPEST:.2f})."
            )
    return boxes


def quaternions_of_goal(problem: Problem) -> list[list[int]]:
    """Columns of the attitudes that a goal states as such, for a start with numbers."""
    fixed = problem.start_bounds.position
    named = problem.kernels.manifest.attitudes
    return [
        list(columns) for name, columns in named.items()
        if problem.goal.get(name) is not None
        and (fixed[columns, 0] == fixed[columns, 1]).all()
    ]  # fmt: skip


def with_goal_of(problem: Problem, q: Array) -> Problem:
    """The problem whose quaternions at the goal have the signs that are nearer to a position."""
    goal = dict(problem.goal)
    for name, columns in problem.kernels.manifest.attitudes.items():
        if goal.get(name) is None:
            continue
        stated = goal.pop(name)
        p = nearer(q[columns], quaternion_of(stated, name))
        goal |= dict(zip(coordinates_of(problem.kernels, name), p.tolist(), strict=True))
    return problem if goal.keys() == problem.goal.keys() else problem.but(goal=goal)


def by_coordinates(problem: Problem, q: Array) -> Problem:
    """The problem that states attitudes by their coordinates, at the goal with the signs that are
    nearer to a position, and angular velocities that are numbers by rates."""
    kernels = problem.kernels
    if not kernels.manifest.attitudes:
        return problem
    ends = with_goal_of(problem, q).ends
    via = [in_coordinates(kernels, by_name(p or {}, "via"), "via") for p in problem.via or ()]
    return problem.but(start=ends["start"], goal=ends["goal"], via=via or None)
