"""Vectors of expressions in the plane and in space."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from dmoc.base.arguments import listed, shown
from dmoc.base.errors import ModelError
from dmoc.symbolic.expressions import expression_in

Vector: TypeAlias = tuple[Any, ...]


def vector(value: Any, count: int, what: str) -> Vector:
    """Expressions of a place or a direction in the frame of a body."""
    example = "(" + ", ".join("ab0"[:count]) + ")"
    try:
        entries: Sequence[Any] = listed(
            list(value) if isinstance(value, sp.MatrixBase) else value, what, "", ModelError
        )
    except ModelError:
        entries = ()
    if len(entries) != count:
        raise ModelError(f"{what} = {shown(value)}: expected {count} expressions, as in {example}.")
    return tuple(expression_in(e, what) for e in entries)


def unit_vector(value: Any, count: int, what: str) -> Vector:
    """A direction of length 1."""
    entries = vector(value, count, what)
    length = sp.sqrt(sum(e**2 for e in entries))
    if length == 0 or not length.is_number:
        raise ModelError(f"{what} = {shown(value)}: expected numbers, not all 0.")
    return tuple(e / length for e in entries)


def positive_length(value: Any, what: str) -> Any:
    """An expression that is positive where it is a number."""
    size = expression_in(value, what)
    if size.is_number and not size > 0:
        raise ModelError(f"{what} = {shown(size)}: expected a positive length.")
    return size


def added(*vectors: Vector) -> Vector:
    return tuple(sum(entries) for entries in zip(*vectors, strict=True))


def times(factor: Any, v: Vector) -> Vector:
    return tuple(factor * e for e in v)


def dot(a: Vector, b: Vector) -> Any:
    return sum(x * y for x, y in zip(a, b, strict=True))


def cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def rate(v: Vector) -> Vector:
    return tuple(e.diff(dynamicsymbols._t) for e in v)
