"""What distances of shapes in space are made of."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Any, TypeAlias

import sympy as sp

from dmoc.base.arguments import shown
from dmoc.base.errors import ModelError
from dmoc.symbolic.hulls import Hull
from dmoc.symbolic.solids import Box, Capsule, Cylinder, Plane, Sphere, unit
from dmoc.symbolic.vectors import Vector, added, cross, dot, times, vector


@dataclass(frozen=True)
class HalfSpace:
    """What is behind a plane."""

    at: Vector
    normal: Vector


@dataclass(frozen=True)
class Round:
    """What is within a radius of a point, or of a segment."""

    at: Vector
    along: Vector | None
    half: Any
    radius: Any

    @property
    def axes(self) -> list[Vector]:
        return self.directions

    @property
    def sides(self) -> list[tuple[Vector, Any]]:
        return [] if self.along is None else [(self.along, self.half)]

    @property
    def ends(self) -> list[Vector]:
        if self.along is None:
            return [self.at]
        return [added(self.at, times(sign * self.half, self.along)) for sign in (1, -1)]

    @property
    def normals(self) -> list[Vector]:
        return []

    @property
    def directions(self) -> list[Vector]:
        return [] if self.along is None else [self.along]


@dataclass(frozen=True)
class Edge(Round):
    """An edge of a box or a hull, that of two faces; ``out`` is the sum of their normals."""

    out: Vector


@dataclass(frozen=True)
class Rim:
    """A rim of a cylinder, seen from outside along -``along``; ``across`` are two directions in its
    plane."""

    at: Vector
    along: Vector
    radius: Any
    across: tuple[Vector, Vector]

    def inside(self, v: Vector) -> Vector:
        """A direction in the frame of the rim."""
        return tuple(dot(v, axis) for axis in (*self.across, self.along))


@dataclass(frozen=True)
class Drum:
    """A cylinder."""

    at: Vector
    along: Vector
    half: Any
    radius: Any
    across: tuple[Vector, Vector]

    @property
    def axes(self) -> tuple[Vector, ...]:
        return *self.across, self.along

    @property
    def rims(self) -> list[Rim]:
        ways = [times(sign, self.along) for sign in (1, -1)]
        return [Rim(added(self.at, times(self.half, n)), n, self.radius, self.across) for n in ways]


@dataclass(frozen=True)
class Block:
    """A box: its middle, and its axes with half its sides."""

    at: Vector
    sides: tuple[tuple[Vector, Any], ...]

    @property
    def axes(self) -> list[Vector]:
        return self.normals

    @property
    def normals(self) -> list[Vector]:
        return [axis for axis, _ in self.sides]

    @property
    def directions(self) -> list[Vector]:
        return self.normals

    @property
    def corners(self) -> list[Vector]:
        return [self._shifted([1 - 2 * (k >> axis & 1) for axis in range(3)]) for k in range(8)]

    @property
    def edges(self) -> list[Round]:
        return [
            Round(self._shifted(signs), axis, half, 0)
            for k, (axis, half) in enumerate(self.sides)
            for signs in product(*((0,) if i == k else (1, -1) for i in range(3)))
        ]

    @property
    def outward(self) -> list[Vector]:
        """The directions in which the edges look, in their order."""
        return [
            added(*(times(sign, axis) for sign, (axis, _) in zip(signs, self.sides, strict=True)))
            for k in range(3)
            for signs in product(*((0,) if i == k else (1, -1) for i in range(3)))
        ]

    @property
    def faces(self) -> list[tuple[Vector, Vector]]:
        """The outward normals of the faces, each with a place on it."""
        ways = [[sign * (i == k) for i in range(3)] for k in range(3) for sign in (1, -1)]
        axes = (axis for axis, _ in self.sides for _ in range(2))
        normals = [times(sum(way), axis) for way, axis in zip(ways, axes, strict=True)]
        return [(n, self._shifted(way)) for n, way in zip(normals, ways, strict=True)]

    def _shifted(self, signs: Any) -> Vector:
        shifts = zip(signs, self.sides, strict=True)
        return added(self.at, *(times(sign * half, axis) for sign, (axis, half) in shifts))


@dataclass(frozen=True)
class Cut:
    """What a few corners hold.

    Of each face there are the outward normal and a corner, and the outward normals of its sides in
    its plane, each with a corner; of each edge the ends.  ``own`` are corners, normals and edges in
    its frame, at a place with three axes.
    """

    corners: tuple[Vector, ...]
    sided: tuple[tuple[Vector, Vector, tuple[tuple[Vector, Vector], ...]], ...]
    edges: tuple[Round, ...]
    outward: tuple[Vector, ...]
    at: Vector
    axes: tuple[Vector, ...]
    own: Any  # corners, normals, edges with their directions, in its frame

    @property
    def normals(self) -> list[Vector]:
        return [normal for normal, _ in self.faces]

    @property
    def faces(self) -> list[tuple[Vector, Vector]]:
        """The outward normals of the faces, each with a place on it."""
        return [(normal, place) for normal, place, _ in self.sided]

    @property
    def directions(self) -> list[Vector]:
        return [edge.along for edge in self.edges if edge.along is not None]


Core: TypeAlias = Round | Block | Cut | Drum | Rim


def core_of(shape: Any) -> Core | HalfSpace:
    """What the distances of a shape in the world are made of; a point is its place."""
    match shape:
        case Edge() | Rim():
            return shape
        case Plane():
            return HalfSpace(shape.at, unit(shape.normal))
        case Sphere():
            return Round(shape.at, None, 0, shape.radius)
        case Capsule():
            return Round(shape.at, _axis(shape, 2), shape.length / 2, shape.radius)
        case Cylinder():
            across = _axis(shape, 0), _axis(shape, 1)
            return Drum(shape.at, _axis(shape, 2), shape.length / 2, shape.radius, across)
        case Box():
            return Block(shape.at, tuple((_axis(shape, k), shape.size[k] / 2) for k in range(3)))
        case Hull():
            return _cut(shape)
    if isinstance(shape, (tuple, list, sp.MatrixBase)):
        return Round(vector(shape, 3, "the place of a point"), None, 0, sp.S.Zero)
    raise ModelError(
        f"{shown(shape)} has no distance: expected a shape in space, such as "
        "dmoc.spatial.Sphere(0.1), or the place of a point."
    )


def _cut(hull: Hull) -> Cut:
    own, turned, points = hull.points, hull.turned, hull.places
    faces, normals = [], []
    for turn in hull.faces:
        a, b, c = (own[i] for i in turn[:3])
        normal = unit(cross(_way(a, b), _way(b, c)))
        sides = []
        for i, j in zip(turn, (*turn[1:], turn[0]), strict=True):
            outward = unit(cross(_way(own[i], own[j]), normal))
            sides.append((turned(outward), points[i]))
        faces.append((turned(normal), points[turn[0]], tuple(sides)))
        normals.append(normal)
    edges = tuple(
        Round(
            times(sp.Rational(1, 2), added(points[i], points[j])),
            turned(unit(_way(own[i], own[j]))),
            sp.sqrt(dot(_way(own[i], own[j]), _way(own[i], own[j]))) / 2, 0,
        )
        for i, j in hull.edges
    )  # fmt: skip
    outward = tuple(
        added(*(n for (n, _, _), turn in zip(faces, hull.faces, strict=True) if {*ends} <= {*turn}))
        for ends in hull.edges
    )
    axes = tuple(turned(tuple(sp.Integer(i == k) for i in range(3))) for k in range(3))
    inside = (own, tuple(normals), tuple(
        (times(sp.Rational(1, 2), added(own[i], own[j])), unit(_way(own[i], own[j])))
        for i, j in hull.edges
    ))  # fmt: skip
    return Cut(points, tuple(faces), edges, outward, hull.origin, axes, inside)


def _way(a: Vector, b: Vector) -> Vector:
    return added(b, times(-1, a))


def _axis(shape: Any, k: int) -> Vector:
    return tuple(row[k] for row in shape.attitude)
