"""A motion that is to be checked: its data beside the flow of its model."""

from __future__ import annotations

import time
from dataclasses import dataclass, fields
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from dmoc.codegen.kernels import Array, Kernels
from dmoc.errors import SimulationError
from dmoc.mechanics.model import Model
from dmoc.mechanics.values import parameter_row, restitution_row
from dmoc.simulation.arcs import allowance, arcs_of
from dmoc.simulation.flow import Flow, Steps
from dmoc.simulation.sizes import Sizes, sizes_of
from dmoc.trajectory import Trajectory

SEGMENTS = 10  # of a phase


class OutOfTimeError(SimulationError):
    """The check was not finished in its time."""


@dataclass(frozen=True, eq=False)
class Motion:
    """A motion, its model with its parameters, its sizes, its phases as steps, and the flow it is
    compared with."""

    trajectory: Trajectory
    model: Model
    sizes: Sizes
    flow: Flow
    steps: tuple[Steps, ...]

    @classmethod
    def of(cls, trajectory: Trajectory, kernels: Kernels, seconds: float | None) -> Motion:
        """Read a motion that is to be checked within some seconds."""
        deadline = np.inf if seconds is None else time.perf_counter() + seconds

        def check_time() -> None:
            if time.perf_counter() > deadline:
                raise OutOfTimeError(
                    "the time for the check was used up: raise it, or take fewer steps."
                )

        restitution = restitution_row(kernels, trajectory.restitution, SimulationError)
        model = Model(kernels, parameter_row(kernels, trajectory.parameters, SimulationError))
        sizes = sizes_of(trajectory, model)
        arcs = arcs_of(trajectory, model, sizes)
        steps = [
            Steps(
                *(
                    np.ascontiguousarray(part, dtype=float)
                    for part in (p.t[:-1], np.diff(p.t), *trajectory.input_ends(p))
                )
            )
            for p in trajectory.phases
        ]
        flow = Flow(model, sizes, restitution, partial(allowance, arcs, model.nc), check_time)
        return cls(trajectory, model, sizes, flow, tuple(steps))

    @cached_property
    def all_steps(self) -> Steps:
        """The steps of all phases, one after the other."""
        names = [f.name for f in fields(Steps)]
        return Steps(*(np.concatenate([getattr(s, name) for s in self.steps]) for name in names))

    def error(self, y: Array, t: Array, q_wanted: Array, p_wanted: Array) -> Array:
        """Largest relative error of each row's state y = (q | v ...)."""
        nq = self.model.nq
        q, p = y[:, :nq], self.model.momentum(y[:, :nq], y[:, nq : 2 * nq], t)
        parts = np.hstack(
            [np.abs(q - q_wanted) / self.sizes.q, np.abs(p - p_wanted) / self.sizes.p]
        )
        return np.asarray(np.nan_to_num(parts.max(axis=1), nan=np.inf))


def nodes_of_segments(steps: int) -> NDArray[np.intp]:
    """First nodes of the segments of a phase, and its last node."""
    return np.unique(np.linspace(0, steps, SEGMENTS + 1).round().astype(np.intp))
