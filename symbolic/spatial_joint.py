"""Joints in space, and the vectors that they turn."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeAlias

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

Vector: TypeAlias = tuple[Any, Any, Any]


@dataclass(frozen=True)
class Joint:
    """A joint in the frame of the body before it; one that slides does not turn."""

    start: Vector
    axis: Vector
    coordinate: Any
    turn: Any

    @property
    def slides(self) -> bool:
        return self.turn is None

    @property
    def rate(self) -> Any:
        return self.coordinate.diff(dynamicsymbols._t)

    @property
    def at(self) -> Vector:
        """The joint in the frame of the body before it."""
        moved = times(self.coordinate, self.axis)
        return added(self.start, moved) if self.slides else self.start

    def turned(self, v: Vector) -> Vector:
        """A vector of the frame before the joint in that behind it."""
        if self.slides:
            return v
        along = times(dot(self.axis, v), self.axis)
        across = added(v, times(-1, along))
        turned = times(-sp.sin(self.turn), cross(self.axis, v))
        return added(along, times(sp.cos(self.turn), across), turned)


def added(*vectors: Vector) -> Vector:
    x, y, z = (sum(entries) for entries in zip(*vectors, strict=True))
    return x, y, z


def times(factor: Any, v: Vector) -> Vector:
    return factor * v[0], factor * v[1], factor * v[2]


def dot(a: Vector, b: Vector) -> Any:
    return sum(x * y for x, y in zip(a, b, strict=True))


def cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
