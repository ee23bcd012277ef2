"""A mass that flies to a wall and back, and motions with one part changed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import motions
import numpy as np
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.motion.trajectory import Trajectory

Change = Callable[[Trajectory], Trajectory]
T = dynamicsymbols._t


def phase_changed(i: int, **changes: object) -> Change:
    def change(motion: Trajectory) -> Trajectory:
        phases = list(motion.phases)
        values = {k: f(phases[i]) if callable(f) else f for k, f in changes.items()}
        phases[i] = replace(phases[i], **values)
        return replace(motion, phases=tuple(phases))

    return change


def event_changed(i: int, **changes: object) -> Change:
    def change(motion: Trajectory) -> Trajectory:
        events = list(motion.collisions)
        events[i] = replace(events[i], **changes)  # type: ignore[arg-type]
        return replace(motion, collisions=tuple(events))

    return change


def valued(**parameters: float) -> Change:
    """Parameters changed."""
    return lambda motion: replace(motion, parameters={**motion.parameters, **parameters})


def cube_system() -> dmoc.MechanicalSystem:
    """A free unit mass in space, and a wall that it hits."""
    x, y, z = q = dynamicsymbols("x y z")
    kinetic = sum(c.diff(T) ** 2 for c in q) / 2
    return dmoc.MechanicalSystem("cube", [x, y, z], kinetic, {}, surfaces={"wall": x <= 1})


def flight(
    kernels: Kernels, after: tuple[float, ...] = (-1, 0.5, 0.5), jump: float = 0.0
) -> Trajectory:
    """From the origin with (1, 0.5, 0.5) m/s to the wall, and back with a velocity and from a
    place beside."""

    a, b, c = after
    pieces = [
        motions.Piece(1.0, lambda t: (t, t / 2, t / 2, 1, 0.5, 0.5)),
        motions.Piece(
            2.0, lambda t: (1 + a * (t - 1), 0.5 + jump + b * (t - 1), 0.5 + c * (t - 1), a, b, c)
        ),
    ]
    hit = {"surface": "wall", "impulse": 2.0}
    return motions.trajectory(kernels, pieces, [hit], 20, {"wall": 1.0})


def one(i: int, k: int, by: float, name: str = "q", column: int = 0) -> Change:
    """A node of a phase moved in one column."""

    def moved(phase: object) -> np.ndarray:
        values = getattr(phase, name).copy()
        values[(k, column) if values.ndim > 1 else k] += by
        return values

    return phase_changed(i, **{name: moved})
