"""Problems of one form as one problem, whose numbers have a leading axis for them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from dmoc.base.records import record
from dmoc.codegen.kernels import Array, Kernels
from dmoc.mechanics.model import Model
from dmoc.problem.problem import Problem
from dmoc.problem.ranges import Boundary
from dmoc.problem.reach import end_speeds_of_rows


def _stacked(name: str) -> Any:
    """An array that each problem has under a name."""
    return cached_property(lambda self: np.array([getattr(p, name) for p in self.each]))


@record(frozen=True, eq=False)
class Stacked:
    """R problems that differ in numbers alone.  What they have under the names of a
    :class:`Problem` are arrays with a leading axis of R, or what is the same for all."""

    each: Sequence[Problem]

    input_bounds = _stacked("input_bounds")
    coordinate_bounds = _stacked("coordinate_bounds")
    velocity_bounds = _stacked("velocity_bounds")
    duration_bounds = _stacked("duration_bounds")
    via_bounds = _stacked("via_bounds")
    restitution_values = _stacked("restitution_values")
    unsaid = _stacked("unsaid")
    reach = _stacked("reach")
    parameter_values = _stacked("parameter_values")
    design_bounds = _stacked("design_bounds")
    design_values = _stacked("design_values")

    @cached_property
    def end_speeds(self) -> Array:
        return end_speeds_of_rows(self.each)

    @property
    def first(self) -> Problem:
        return self.each[0]

    @property
    def kernels(self) -> Kernels:
        return self.first.kernels

    @property
    def model(self) -> Model:
        """That of the first one: for what no number changes."""
        return self.first.model

    @property
    def nq(self) -> int:
        return self.first.nq

    @property
    def nu(self) -> int:
        return self.first.nu

    @property
    def phases(self) -> int:
        return self.first.phases

    @property
    def design(self) -> Mapping[str, Any]:
        return self.first.design

    @property
    def sequence(self) -> Sequence[str]:
        return self.first.sequence

    @cached_property
    def final_time_bounds(self) -> tuple[Array, Array]:
        low, high = np.array([p.final_time_bounds for p in self.each]).T
        return low, high

    @property
    def kinds(self) -> Iterator[Array]:
        """Which bounds of both ends and of the time are equal, and which are none, shape (R,
        ...)."""
        low, high = self.final_time_bounds
        yield np.stack([low == high, low > 0, high < np.inf], axis=1)
        for end in (self.start_bounds, self.goal_bounds):
            for box in (end.position, end.velocity, end.momentum):
                yield box[..., 0] == box[..., 1]
                yield np.isfinite(box).reshape(len(box), -1)

    @cached_property
    def start_bounds(self) -> Boundary:
        return self._boundary("start_bounds")

    @cached_property
    def goal_bounds(self) -> Boundary:
        return self._boundary("goal_bounds")

    def _boundary(self, end: str) -> Boundary:
        every = [getattr(p, end) for p in self.each]
        names = "position", "velocity", "momentum"
        return Boundary(*(np.array([getattr(b, name) for b in every]) for name in names))
