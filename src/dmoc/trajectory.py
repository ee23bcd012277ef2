"""A motion as plain data: phases between collisions, and the collisions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Phase:
    """A phase of N steps.

    Attributes
    ----------
    t : array of shape (N + 1,)
        Times of the nodes in seconds.
    q, p, v : arrays of shape (N + 1, nq)
        Coordinates, momenta and velocities at the nodes; at a collision those of this phase's side.
    u : array of shape (N, nu) or (N + 1, nu)
        Inputs of the steps (constant) or at the nodes (linear).
    """

    t: Array
    q: Array
    p: Array
    v: Array
    u: Array

    @property
    def steps(self) -> int:
        return len(self.t) - 1

    @property
    def step_size(self) -> float:
        return self.duration / self.steps

    @property
    def duration(self) -> float:
        return float(self.t[-1] - self.t[0])


@dataclass(frozen=True)
class Collision:
    """A collision: surface, time (s), position, impulse lam >= 0 along grad g, momenta before and after."""

    surface: str
    time: float
    position: Array
    impulse: float
    momentum_before: Array
    momentum_after: Array


@dataclass(frozen=True)
class Trajectory:
    """A motion with what is needed to draw and to check it.

    Attributes
    ----------
    model, fingerprint : str
        Name and digest of the model.
    coordinates, inputs : tuples of str
    parameters : mapping of str to float
    phases : tuple of Phase
    collisions : tuple of Collision
        One between any two phases.
    controls : {"constant", "linear"}
    input_bounds, coordinate_bounds : arrays of shape (nu, 2), (nq, 2)
    """

    model: str
    fingerprint: str
    coordinates: tuple[str, ...]
    inputs: tuple[str, ...]
    parameters: Mapping[str, float]
    phases: tuple[Phase, ...]
    collisions: tuple[Collision, ...]
    controls: str
    input_bounds: Array
    coordinate_bounds: Array

    @property
    def final_time(self) -> float:
        return float(self.phases[-1].t[-1])

    @property
    def parameter_row(self) -> Array:
        """Parameter values in the model's order, shape (1, npar)."""
        return np.array([list(self.parameters.values())], dtype=float)
