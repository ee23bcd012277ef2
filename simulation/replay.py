"""A motion as what a simulation takes: its start, inputs and coefficients of restitution."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from dmoc.base.arguments import positive, whole
from dmoc.base.errors import SimulationError
from dmoc.base.tolerances import KEPT, ROUNDING, SAME
from dmoc.codegen.kernels import Kernels
from dmoc.mechanics.contact_mode import mode_by_names
from dmoc.mechanics.model import Model
from dmoc.mechanics.model_values import by_name, parameter_rows
from dmoc.motion.trajectory import Array, Trajectory
from dmoc.simulation.contact_motion import on_surfaces
from dmoc.simulation.forward import MOST_STEPS
from dmoc.simulation.grips import grasps_along
from dmoc.simulation.mode_choice import Setting

# Steps of a replay in the smallest step of its solution: its own error is then a sixteenth of that
# of the solution at order 2.
FINER = 4
# A replay takes its smallest step, or the mean one divided by this where that is longer: a
# far shorter phase would make thousands of steps of all others.
UNEVEN = 8


def replay(
    motion: Trajectory,
    kernels: Kernels,
    changes: Mapping[str, Any],
    step_size: float | None,
    steps: int | None,
) -> dict[str, Any]:
    """A motion as arguments of a simulation, some of them changed."""
    if motion.ignored:
        raise SimulationError(
            f"the solution ignores {', '.join(motion.ignored)}: a simulation hits every surface, "
            "use verify(), which follows the solution's own events."
        )
    count = replay_steps(motion, step_size, steps)
    parameters = dict(motion.parameters)
    parameters |= by_name(changes.get("parameters", {}), "parameters", SimulationError)
    own = {
        "velocity": _start_velocity(motion),
        "inputs": mean_inputs(motion, count),
        "restitution": plastic(motion),
    }
    if motion.grips:
        values = parameter_rows(kernels, parameters, None, SimulationError)
        model = Model(kernels, values[:1])
        own["grips"] = grasps_along(model, motion)
    if "position" not in changes:
        own["position"] = _on_surfaces(kernels, parameters, motion.phases[0].q[0])
    mesh = {"step_size": motion.final_time / count, "steps": count}
    return {**own, **changes, "parameters": parameters, **mesh}


def replay_steps(motion: Trajectory, step_size: float | None, steps: int | None) -> int:
    """Number of steps of a replay."""
    if steps is not None:
        if step_size is not None:
            raise SimulationError(
                "a solution is simulated for its final time: give step_size or steps, not both."
            )
        return whole(steps, "steps", 1, MOST_STEPS, SimulationError)
    if step_size is None:
        mean = motion.final_time / sum(phase.steps for phase in motion.phases)
        smallest = min(phase.step_size for phase in motion.phases if phase.steps)
        step_size = max(smallest, mean / UNEVEN) / FINER
    size = positive(step_size, "step_size", "expected a time in seconds", SimulationError)
    return max(1, int(np.ceil(motion.final_time / size * (1 - SAME))))


def _start_velocity(motion: Trajectory) -> Array:
    """The velocity at the start; zero where only the solver's rounding errors move."""
    fastest = np.max([np.abs(phase.v).max(axis=0) for phase in motion.phases], axis=0)
    v = motion.phases[0].v[0]
    return np.where(np.abs(v) > ROUNDING * fastest, v, 0.0)


def _on_surfaces(kernels: Kernels, parameters: Mapping[str, Any], q: Array) -> Array:
    """A start that lies on surfaces up to the solver's tolerance, moved onto them."""
    model = Model(kernels, parameter_rows(kernels, parameters, None, SimulationError)[:1])
    setting = Setting(model, np.zeros(model.nc), 1.0)
    return on_surfaces(setting, np.concatenate([q, 0 * q]), 0.0, KEPT)[: model.nq]


def moved(model: Model, motion: Trajectory, y: Array) -> Array:
    """A state, shape (2 nq,), moved to where the contacts and constraints of the start of a motion
    hold."""
    first, rows = motion.phases[0], y[None].copy()
    mode = mode_by_names(model.contacts, first.closed, first.rubbing)
    anchors = model.tangents(np.ascontiguousarray(rows[:, : model.nq]))
    integrator = Setting(model, np.zeros(model.nc), 1.0).integrator
    for _ in range(2):  # to rounding errors
        integrator.project(mode, rows, np.zeros(1), anchors)
    return np.asarray(rows[0])


def plastic(motion: Trajectory) -> dict[str, float | None]:
    """The coefficients of restitution of a motion, 0 of what it lands on and never hits."""
    hit = {c.hit for c in motion.collisions}
    lands = {name for c in motion.collisions for name in c.lands} - hit
    return {name: 0.0 if name in lands else e for name, e in motion.restitution.items()}


def mean_inputs(motion: Trajectory, steps: int) -> Array:
    """Means of the inputs of a motion over equal steps of its time, shape (steps, nu)."""
    begins = np.concatenate([phase.t[:-1] for phase in motion.phases])
    sizes = np.concatenate([np.diff(phase.t) for phase in motion.phases])
    ends = [motion.input_ends(phase) for phase in motion.phases]
    first, last = (np.vstack([pair[side] for pair in ends]) for side in range(2))
    whole = np.vstack(
        [np.zeros((1, first.shape[1])), np.cumsum(sizes[:, None] * (first + last) / 2, axis=0)]
    )
    edges = np.linspace(0.0, motion.final_time, steps + 1)
    k = np.clip(np.searchsorted(begins, edges, side="right") - 1, 0, len(begins) - 1)
    part = np.clip((edges - begins[k]) / sizes[k], 0.0, 1.0)[:, None]
    within = sizes[k, None] * part * (first[k] + part * (last[k] - first[k]) / 2)
    return np.asarray(np.diff(whole[k] + within, axis=0) * steps / motion.final_time)
