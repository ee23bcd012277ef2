"""The motion of a problem in which nothing can be chosen: that of a simulation from its start."""

from __future__ import annotations

import numpy as np

from dmoc.base.errors import DmocError
from dmoc.codegen.kernels import Array
from dmoc.guess.transfer import pieces_of, unknowns_along
from dmoc.problem.problem import Problem
from dmoc.problem.ranges import fixed_velocity


def only_motion(problem: Problem) -> Array | None:
    """Unknowns, shape (n,), along the motion without inputs from a state, for a time, that are
    fixed and in which nothing happens; None for any other problem."""
    low, high = problem.final_time_bounds
    chosen = problem.nu or problem.design or problem.sequence or problem.lasting
    if chosen or low != high or not problem.start_bounds.is_state:
        return None
    from dmoc.simulation import forward  # here, because most problems have something to choose
    from dmoc.simulation.recording import motion_of

    q = problem.start_position
    v = fixed_velocity(problem.start_bounds, problem, q)
    (steps,) = problem.phase_steps
    try:
        run = forward.simulate(
            problem.kernels, q, v, step_size=high / steps, steps=steps,
            parameters=problem.parameters,
        )  # fmt: skip
        trajectory = motion_of(run)
    except DmocError:  # one that cannot be followed is no guess
        return None
    if len(trajectory.phases) > 1:
        return None
    x = unknowns_along(problem, pieces_of(trajectory), ())
    return x if np.isfinite(x).all() else None
