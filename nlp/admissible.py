"""Whether a problem's start and goal are states of its model: regular, in front of the surfaces,
and not moving into them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.errors import ProblemError

if TYPE_CHECKING:
    from dmoc.nlp.problem import Boundary, Problem

# Share of the gap's largest possible rate below which a state on a surface does not move into it.
MOVING_INTO = 1e-9


def check_mass_matrix(problem: Problem) -> None:
    """Refuse a start at which the equations of motion are not finite or their mass matrix is
    none."""
    mass, force = problem.model.equations(problem.start_position)
    values = dict(zip(problem.kernels.parameters, problem.parameter_values[0], strict=True))
    suspects = [
        f"{n}={values[n]:g}" for n in problem.kernels.manifest["mass_parameters"] if values[n] <= 0
    ]
    cause = f" ({', '.join(suspects)})" if suspects else ""
    if not (np.isfinite(mass).all() and np.isfinite(force).all()):
        raise ProblemError(
            f"the equations of motion are not finite at the start{cause}: check the parameters and "
            "the start."
        )
    if np.linalg.eigvalsh(mass)[0] <= 1e-14 * np.abs(mass).max():
        remedy = (
            "expected positive masses and lengths"
            if suspects
            else "check the parameters and the start"
        )
        raise ProblemError(
            f"the mass matrix is not positive definite at the start{cause}: {remedy}."
        )


def check_admissible(problem: Problem, end: str, boundary: Boundary) -> None:
    """Check the gaps at a fixed position; a gap that contains a coordinate left free is the
    solver's business."""
    fixed = boundary.position[:, 0] == boundary.position[:, 1]
    if not problem.kernels.surfaces or not fixed.any():
        return
    at = np.where(fixed, boundary.position[:, 0], 0.0)
    gaps = problem.model.gaps(at)
    ends = [
        np.where(b[:, 0] == b[:, 1], b[:, 0], 0.0)
        for b in (problem.start_bounds.position, problem.goal_bounds.position)
    ]
    rounding = np.max([problem.model.gap_rounding(q) for q in (at, *ends)], axis=0)
    for j, surface in enumerate(problem.kernels.surfaces):
        if end == "goal" and surface in problem.kernels.manifest["moving_surfaces"]:
            continue
        involved = problem.kernels.manifest["surface_coordinates"][surface]
        state = ", ".join(f"{problem.kernels.coordinates[i]}={at[i]:g}" for i in involved)
        if fixed[involved].all() and not gaps[j] <= rounding[j]:
            raise ProblemError(
                f"the {end} ({state}) lies behind surface {surface!r}, {gaps[j]:g} outside the "
                f"admissible set g <= 0: move the {end} or the surface."
            )
        if end == "start" and fixed.all() and gaps[j] >= -rounding[j]:
            _check_leaving(problem, at, j, state)


def _check_leaving(problem: Problem, q: Array, j: int, state: str) -> None:
    """Refuse a start on a surface with a fixed velocity that moves into it."""
    v = _fixed_velocity(problem, q)
    if v is None:
        return
    rate, slope = float(problem.model.gap_rates(q, v)[j]), problem.model.gap_slopes(q)[j]
    if rate > MOVING_INTO * float(np.abs(slope) @ np.append(np.abs(v), 1.0)):
        raise ProblemError(
            f"the start ({state}) lies on surface {problem.kernels.surfaces[j]!r} and moves into "
            f"it (the gap changes by {rate:g} per second): give a velocity that leaves it, or "
            "leave the velocity free."
        )


def _fixed_velocity(problem: Problem, q: Array) -> Array | None:
    """The velocity at the start where it is fixed, by itself or by momenta."""
    velocity, momentum = problem.start_bounds.velocity, problem.start_bounds.momentum
    if (velocity[:, 0] == velocity[:, 1]).all():
        return velocity[:, 0]
    if not (momentum[:, 0] == momentum[:, 1]).all():
        return None
    return problem.model.velocity(q, momentum[:, 0])
