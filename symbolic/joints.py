"""Joints of linkages in space: where a body begins in the frame of the one before it, and how it is
turned; and what a body consists of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from dmoc.base.arguments import shown
from dmoc.base.errors import ModelError
from dmoc.motion.attitude import rotation
from dmoc.symbolic.attitudes import angular_velocity
from dmoc.symbolic.expressions import expression_in
from dmoc.symbolic.vectors import Vector, added, cross, dot, times, unit_vector, vector

AXES = {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1)}
ORIGIN: Vector = (sp.S.Zero,) * 3


class Joint(Protocol):
    """The place of a joint in the frame before it, and the angular velocity of the frame behind it
    against that one, in its own axes."""

    @property
    def at(self) -> Vector: ...

    @property
    def spin(self) -> Vector: ...

    def turned(self, v: Vector) -> Vector:
        """A vector of the frame before the joint in that behind it."""


@dataclass(frozen=True)
class Hinge:
    """A turn about an axis that both frames have; without a turn, a place alone."""

    at: Vector
    axis: Vector = ORIGIN
    turn: Any = sp.S.Zero

    @property
    def spin(self) -> Vector:
        return times(self.turn.diff(dynamicsymbols._t), self.axis)

    def turned(self, v: Vector) -> Vector:
        if self.turn == 0:
            return v
        along = times(dot(self.axis, v), self.axis)
        across = added(v, times(-1, along))
        turned = times(-sp.sin(self.turn), cross(self.axis, v))
        return added(along, times(sp.cos(self.turn), across), turned)


@dataclass(frozen=True)
class Ball:
    """Any turn, by the quaternion p: v behind the joint is R(p)^T v."""

    at: Vector
    rows: tuple[Vector, ...]  # of R^T
    spin: Vector

    @classmethod
    def of(cls, at: Vector, p: Vector, name: str, define: Callable[[str, Any], Any]) -> Ball:
        """The joint with names for the entries of R and for the angular velocity."""
        columns = zip(*rotation(p), strict=True)
        rows = tuple(
            tuple(define(f"R{j}{i}_{name}", e) for j, e in enumerate(row, 1))
            for i, row in enumerate(columns, 1)
        )
        omega = enumerate(angular_velocity(p), 1)
        return cls(at, rows, tuple(define(f"omega{i}_{name}", e) for i, e in omega))

    def turned(self, v: Vector) -> Vector:
        return tuple(dot(row, v) for row in self.rows)


@dataclass(frozen=True)
class Load:
    """What a body consists of, in its frame."""

    tip: Vector
    mass: Any
    centre: Vector
    inertia: sp.Matrix


def read_axis(axis: Any, name: str) -> Vector:
    named = isinstance(axis, str) and axis in AXES
    return unit_vector(AXES[axis] if named else axis, 3, f"the axis of body {name}")


def read_moments(inertia: Any, what: str) -> sp.Matrix:
    """Moments of inertia, as three of them or as a symmetric matrix."""
    if isinstance(inertia, sp.MatrixBase) and inertia.shape == (3, 3):
        if inertia != inertia.T:
            raise ModelError(f"{what} = {shown(inertia)}: expected a symmetric matrix.")
        return inertia.applyfunc(lambda e: expression_in(e, what))
    return sp.diag(*vector(inertia, 3, what))


def read_load(
    size: Callable[[Any, str], Any], name: str, tip: Any, mass: Any, centre: Any, inertia: Any
) -> Load:
    """What a body consists of, as it was passed; ``size`` reads what is 0 or more."""
    what = f"of body {name}"
    end = vector(tip, 3, f"the tip {what}")
    mass = size(mass, f"the mass {what}")
    middle = tuple(e / 2 for e in end) if centre is None else centre
    rod = mass * (dot(end, end) * sp.eye(3) - sp.Matrix(end) * sp.Matrix(end).T) / 12
    moments = rod if inertia is None else read_moments(inertia, f"the inertia {what}")
    for k, axis in enumerate(AXES):
        size(moments[k, k], f"the inertia {what} about {axis}")
    return Load(end, mass, vector(middle, 3, f"the centre {what}"), moments)
