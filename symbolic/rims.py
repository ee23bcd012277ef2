"""Distances of the rims of cylinders from lines and from each other.

Lengths are in radii of a rim, and vectors in its frame, of which the third axis is that of the
cylinder and looks out: at the angle s the rim is e = (cos s, sin s, 0), with the tangent
(-sin s, cos s, 0).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import sympy as sp

from dmoc.symbolic.called import LeastAngle, SharedExpression
from dmoc.symbolic.cores import Rim, Round
from dmoc.symbolic.vectors import Vector, added, cross, dot, times

Define = Callable[[Any], Any]
NEAR = sp.Float(1e-24)  # squares of lengths below it count as zero, where a root has no slope
AXIS = (0, 0, 1)
PARALLEL = sp.Float(1e-12)  # squares of sines below it are those of lines that are parallel


class NearestToLine(LeastAngle):
    """Where a rim is nearest to the line p + t u: with v = (p . u) u - p the square of the distance
    is v . v + 1 + 2 v . e - (u . e)^2."""

    nargs, code, places = 4, "nearest_to_line", 12

    @classmethod
    def least(cls, angle: Any, *z: Any) -> Any:
        v_1, v_2, u_1, u_2 = z
        c, s = sp.cos(angle), sp.sin(angle)
        return 2 * (v_1 * c + v_2 * s) - (u_1 * c + u_2 * s) ** 2


class NearestToRim(LeastAngle):
    """Where a rim is nearest to another one of the radius R, about the axis b through p: with
    q = e - p, h = q . b and rho^2 = q . q - h^2 the square of the distance is
    h^2 + (rho - R)^2 = q . q + R^2 - 2 R rho."""

    nargs, code, places = 7, "nearest_to_rim", 36

    @classmethod
    def least(cls, angle: Any, *z: Any) -> Any:
        p_1, p_2, square, b_1, b_2, height, radius = z
        c, s = sp.cos(angle), sp.sin(angle)
        q = square + 1 - 2 * (p_1 * c + p_2 * s)
        beside = q - (b_1 * c + b_2 * s - height) ** 2
        return q - 2 * radius * sp.sqrt(sp.Max(beside, NEAR))


class RimAndEdge(SharedExpression):
    """The signed distance of a rim from the line p + t u."""

    nargs, code = 6, "rim_and_edge"

    @classmethod
    def value(cls, define: Define, *z: Any) -> Any:
        return to_edge(z[:3], z[3:], define)[0]


class RimAndLine(SharedExpression):
    """The distance of a rim from the line p + t u."""

    nargs, code = 6, "rim_and_line"

    @classmethod
    def value(cls, define: Define, *z: Any) -> Any:
        p, u = z[:3], _unit(z[3:], define)
        way = added(p, times(-1, _at_line(p, u, define)[0]))
        return sp.sqrt(sp.Max(define(dot(way, way) - dot(way, u) ** 2), NEAR))


class RimAndRim(SharedExpression):
    """The signed distance of a rim from another one, about the axis b through p."""

    nargs, code = 7, "rim_and_rim"

    @classmethod
    def value(cls, define: Define, *z: Any) -> Any:
        return to_rim(z[:3], z[3:6], z[6], define)[0]


def to_edge(p: Vector, u: Vector, define: Define) -> tuple[Any, Vector]:
    """The signed distance of a rim from the line p + t u, and its direction."""
    u = _unit(u, define)
    e, tangent = _at_line(p, u, define)
    way = added(p, times(-1, e))
    off = added(way, times(-define(dot(way, u)), u))
    return _signed(tangent, u, added(e, AXIS), off, define)


def to_rim(p: Vector, b: Vector, radius: Any, define: Define) -> tuple[Any, Vector]:
    """The signed distance of a rim from another one, about the axis b through p, and its
    direction."""
    b = _unit(b, define)
    square, height = define(dot(p, p)), define(dot(p, b))
    e, tangent = _at(NearestToRim(p[0], p[1], square, b[0], b[1], height, radius), define)
    q = defined(added(e, times(-1, p)), define)
    off = defined(added(q, times(-define(dot(q, b)), b)), define)
    out = times(1 / define(root(dot(off, off))), off)
    way = defined(added(times(radius, out), times(-1, q)), define)
    outwards = added(e, AXIS, times(-1, added(out, b)))
    return _signed(tangent, defined(cross(b, out), define), outwards, way, define)


def from_rim(rim: Rim, other: Rim | Round, define: Define) -> Any:
    """The distance of a rim from another one, from the line of an edge, from a ball, or from what
    is within a radius of a line."""
    r = rim.radius
    p = defined(rim.inside(times(1 / r, added(other.at, times(-1, rim.at)))), define)
    if isinstance(other, Rim):
        b = defined(rim.inside(other.along), define)
        return define(r * RimAndRim(*p, *b, other.radius / r))
    if other.along is None:
        beside = define(root(p[0] ** 2 + p[1] ** 2))
        return define(r * root((beside - 1) ** 2 + p[2] ** 2)) - other.radius
    u = defined(rim.inside(other.along), define)
    if other.radius == 0:
        return define(r * RimAndEdge(*p, *u))
    return define(r * RimAndLine(*p, *u)) - other.radius


def _signed(
    tangent: Vector, u: Vector, out: Vector, way: Vector, define: Define
) -> tuple[Any, Vector]:
    """The way from a rim along what is perpendicular to both tangents, positive outwards; where
    these are parallel, its length.  And the direction of the way."""
    n = defined(cross(tangent, u), define)
    square = define(dot(n, n))
    across = _outwards(dot(n, out), define) * dot(n, way) / sp.sqrt(sp.Max(square, PARALLEL))
    straight = _outwards(dot(way, out), define) * root(dot(way, way))
    crossing = square > PARALLEL
    pairs = zip((across, *n), (straight, *way), strict=True)
    gap, *along = (sp.Piecewise((x, crossing), (y, True)) for x, y in pairs)
    return gap, tuple(along)


def root(square: Any) -> Any:
    return sp.sqrt(sp.Max(square, NEAR))


def _outwards(x: Any, define: Define) -> Any:
    return define(sp.Piecewise((1, define(x) >= 0), (-1, True)))


def _at_line(p: Vector, u: Vector, define: Define) -> tuple[Vector, Vector]:
    along = define(dot(p, u))
    v = (define(along * a - b) for a, b in zip(u[:2], p[:2], strict=True))
    return _at(NearestToLine(*v, u[0], u[1]), define)


def _at(angle: Any, define: Define) -> tuple[Vector, Vector]:
    """The place on a rim at an angle, and the tangent there."""
    angle = define(angle)
    c, s = define(sp.cos(angle)), define(sp.sin(angle))
    return (c, s, sp.S.Zero), (-s, c, sp.S.Zero)


def _unit(v: Vector, define: Define) -> Vector:
    """A direction, also where attitudes are none, as between the iterates of a solver: so the
    slopes of the distance by the angle are zero everywhere."""
    return defined(times(1 / define(sp.sqrt(dot(v, v))), v), define)


def defined(v: Vector, define: Define) -> Vector:
    return tuple(define(e) for e in v)
