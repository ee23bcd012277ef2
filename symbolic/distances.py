"""Distances between shapes in space, as expressions with names for their parts.

A shape is what lies within a radius of a point or a segment (spheres, capsules), what corners hold
(boxes, hulls: :mod:`dmoc.symbolic.cores`), a cylinder, or what is behind a plane.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import sympy as sp

from dmoc.base.arguments import shown
from dmoc.base.errors import ModelError
from dmoc.symbolic.cores import Block, Core, Cut, Drum, Edge, HalfSpace, Rim, Round, core_of
from dmoc.symbolic.hulls import Hull, carried_hull
from dmoc.symbolic.rims import from_rim
from dmoc.symbolic.separation import PARALLEL, STEEP, gap_between
from dmoc.symbolic.solids import Box, Capsule, Cylinder, Moved, Plane, Sphere, carried_solid
from dmoc.symbolic.vectors import Vector, added, cross, dot, times

Define = Callable[[Any], Any]  # a name for an expression

# Squares of lengths below it count as zero, where a root has no slope: of shapes in m that is
# 1e-12 m.
LEAST = sp.Float(1e-24)
# By how much a distance from an edge or a corner is too small, so that it does not hide one from a
# face that vanishes.
SHY = sp.Float(2e-12)


def distance_of(a: Any, b: Any, define: Define) -> Any:
    """The distance of two shapes in the world, negative where they overlap."""
    first, second = core_of(a), core_of(b)
    if isinstance(first, HalfSpace):
        first, second = second, first
    if isinstance(first, HalfSpace):
        raise ModelError("both shapes of a distance are planes: expected one that moves.")
    if isinstance(second, HalfSpace):
        n = second.normal
        return _lowest(first, n, define) - dot(n, second.at)
    return _between(first, second, define)


def carried_shape(shape: Any, point: Moved, turned: Moved, body: str) -> Any:
    """A shape in the frame of a body as one in the world."""
    if isinstance(shape, Hull):
        return carried_hull(shape, point, turned)
    if not isinstance(shape, (Sphere, Capsule, Cylinder, Box, Plane)):
        raise ModelError(
            f"body {body} carries {shown(shape)}: expected a shape in space, such as "
            "dmoc.spatial.Sphere(0.1)."
        )
    return carried_solid(shape, point, turned)


def _between(a: Core, b: Core, define: Define) -> Any:
    match a, b:
        case (Rim(), Rim() | Round()):
            return from_rim(a, b, define)
        case (Round(), Rim()):
            return _between(b, a, define)
        case (Rim(), _) | (_, Rim()):
            raise ModelError(
                "a rim has a distance from other rims, edges, spheres, capsules, points and "
                "planes: take edges or faces of the other shape, or the whole cylinder."
            )
        case (Edge(), Edge()):
            return define(_across(a, b, define))
        case (Round(), Round()):
            square = _square(a, b, define)
            points = a.along is None and b.along is None
            way = sp.sqrt(square) if points else define(_root(square))
            return way - a.radius - b.radius
        case (Round(along=None), Drum()):
            return define(_to_drum(a.at, b, define)) - a.radius
        case (Drum(), Round(along=None)):
            return _between(b, a, define)
        case (Round(), Block() | Cut()):
            return define(_to_corners(a, b, define)) - a.radius
        case (Drum(), Round()):
            return gap_between(a, b, define) - b.radius
        case (Drum(), _) | (Block() | Cut(), Block() | Cut()):
            return gap_between(a, b, define)
    return _between(b, a, define)


def _lowest(core: Core, n: Vector, define: Define) -> Any:
    """The least n . x of a shape."""
    match core:
        case Round():
            return _span(core, n, define)[0] - core.radius
        case Rim():
            slope = define(dot(n, core.along))
            return dot(n, core.at) - core.radius * define(_root(1 - slope**2))
        case Drum():
            slope = define(dot(n, core.along))
            reach = core.half * sp.Abs(slope) + core.radius * _root(1 - slope**2)
            return dot(n, core.at) - define(reach)
    return _span(core, n, define)[0]


def _span(core: Any, n: Vector, define: Define) -> tuple[Any, Any]:
    """The least and the largest n . x of a segment, a box or a hull."""
    if isinstance(core, Cut):
        along = [define(dot(n, corner)) for corner in core.corners]
        return define(sp.Min(*along)), define(sp.Max(*along))
    middle = define(dot(n, core.at))
    reach = define(sum(h * sp.Abs(define(dot(n, a))) for a, h in core.sides))
    return middle - reach, middle + reach


def _square(a: Round, b: Round, define: Define) -> Any:
    """The least square of the distance of two segments or points.

    Of c + s a and e + t b, |s| <= h, |t| <= k, with d = c - e: the least over t is a convex
    function of s, quadratic on either side of the ends of b, whose least place lies between the
    places that are nearest to these.
    """
    if b.along is None:
        a, b = b, a
    d = tuple(define(e) for e in added(a.at, times(-1, b.at)))
    D = define(dot(d, d))
    if b.along is None:
        return D
    q = define(dot(d, b.along))
    if a.along is None:
        return define(D - q**2 + _excess(q, b.half, define))
    p, u = define(dot(d, a.along)), define(dot(a.along, b.along))
    free = define((u * q - p) / sp.Max(1 - u**2, PARALLEL))
    reach = define(sp.Abs(u) * b.half)
    near = define(_within(free, -p - reach, reach - p))
    s = define(_within(near, -a.half, a.half))
    w = define(q + u * s)
    return define(D + s**2 + 2 * s * p - w**2 + _excess(w, b.half, define))


def _across(a: Edge, b: Edge, define: Define) -> Any:
    """The signed distance of the lines of two edges."""
    n = tuple(define(e) for e in cross(a.along or a.at, b.along or b.at))
    facing = define(dot(n, added(a.out, times(-1, b.out))))
    way = define(dot(n, added(b.at, times(-1, a.at))))
    length = sp.sqrt(sp.Max(define(dot(n, n)), PARALLEL))
    return way * facing / (_root(define(facing**2)) * length)


def _within(x: Any, low: Any, high: Any) -> Any:
    return sp.Min(sp.Max(x, low), high)


def _excess(w: Any, k: Any, define: Define) -> Any:
    return define(sp.Max(sp.Abs(w) - k, 0)) ** 2


def _to_drum(point: Vector, drum: Drum, define: Define) -> Any:
    """The distance of a point from a cylinder, negative within."""
    d = added(point, times(-1, drum.at))
    along = define(dot(d, drum.along))
    square, beyond = define(dot(d, d) - along**2), define(sp.Abs(along) - drum.half)
    over = _root(define(sp.Max(square, drum.radius**2))) - drum.radius
    outside = define(over**2 + sp.Max(beyond, 0) ** 2)
    apart = define(sp.Max(beyond, define(_root(square) - drum.radius)))
    return _signed(apart, outside, define)


def _to_corners(ball: Round, solid: Block | Cut, define: Define) -> Any:
    """The distance of a point or a segment from what corners hold, negative within."""
    if isinstance(solid, Block) and ball.along is None:
        beyond = _beyond(solid, ball.at, define)
        return _signed(define(sp.Max(*beyond)), define(_outside(beyond)), define)
    squares = [_square_to(solid, end, define) for end in ball.ends]
    squares += [_square(ball, edge, define) for edge in solid.edges]
    apart = gap_between(solid, ball, define)
    return _signed(apart, define(sp.Min(*squares)), define)


def _signed(apart: Any, square: Any, define: Define) -> Any:
    """The distance of which there are a lower bound, that of both within each other, and the square
    where they are not; it is that bound where a face is nearest."""
    near = define(_root(square) - SHY)
    return sp.Max(apart, define(sp.Min(near, STEEP * apart)))


def _beyond(block: Block, point: Vector, define: Define) -> list[Any]:
    """How far a point is beyond each pair of faces of a box."""
    arm = tuple(define(e) for e in added(point, times(-1, block.at)))
    return [define(sp.Abs(define(dot(arm, axis))) - half) for axis, half in block.sides]


def _outside(beyond: list[Any]) -> Any:
    return sum(sp.Max(e, 0) ** 2 for e in beyond)


def _square_to(solid: Block | Cut, point: Vector, define: Define) -> Any:
    """The square of the distance of a point from a box, or from the faces of a hull above which it
    is: beside these it is larger than that from an edge."""
    if isinstance(solid, Block):
        return define(_outside(_beyond(solid, point, define)))
    squares = []
    for normal, place, sides in solid.sided:
        height = define(dot(normal, added(point, times(-1, place))))
        off = [define(dot(out, added(point, times(-1, at)))) for out, at in sides]
        beside = define(sp.Max(0, *off))
        squares.append(define(height**2 + STEEP * beside**2))
    return define(sp.Min(*squares))


def _root(square: Any) -> Any:
    return sp.sqrt(sp.Max(square, LEAST))
