"""Distances between shapes of bodies and planes, as expressions."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import sympy as sp

from dmoc.robots.records import Array, Shape
from dmoc.symbolic.solids import Box, Capsule, Cylinder, Sphere
from dmoc.symbolic.spatial import Body
from dmoc.symbolic.vectors import Vector, added, dot, times


def plain(values: Any) -> Vector:
    """Numbers of an array for expressions, whole ones as such: they make short code."""
    return tuple(int(v) if v == int(v) else float(v) for v in np.asarray(values).ravel())


def features(shape: Shape) -> Iterator[tuple[str, Array, float]]:
    """What of a shape meets a plane first: endings of names, places in the frame of its part, and
    radii around them."""
    along = shape.turn[:, 2] * shape.size[1]
    if shape.kind in ("sphere", "site"):
        yield "", shape.place, float(shape.size[0])
    elif shape.kind == "box":
        for corner in range(8):
            signs = [1 - 2 * (corner >> axis & 1) for axis in range(3)]
            yield f"_{corner + 1}", shape.place + shape.turn @ (shape.size * signs), 0.0
    else:
        for ending, sign in (("_a", 1), ("_b", -1)):
            yield ending, shape.place + sign * along, float(shape.size[0])


def solid_of(shape: Shape) -> Box | Capsule | Cylinder | Sphere:
    """How a shape is drawn, in the frame of its part."""
    at, turned = plain(shape.place), not np.array_equal(shape.turn, np.eye(3))
    look = {"at": at, "attitude": sp.Matrix(3, 3, plain(shape.turn)) if turned else None}
    radius, half = plain(shape.size[:2])
    if shape.kind == "sphere":
        return Sphere(radius, at)
    if shape.kind == "box":
        return Box(plain(2 * shape.size), **look)
    return (Capsule if shape.kind == "capsule" else Cylinder)(radius, 2 * half, **look)


def rounded(solid: Box | Capsule | Cylinder | Sphere) -> Box | Capsule | Sphere:
    """A shape as one whose distance from each other one has a closed form: a cylinder as the
    capsule around it."""
    if isinstance(solid, Cylinder):
        return Capsule(solid.radius, solid.length, solid.at, sp.Matrix(solid.attitude))
    return solid


def gaps_to_plane(shape: Shape, body: Body, place: Vector, normal: Vector) -> dict[str, Any]:
    """Distances of the features of a shape from a plane, by their names."""
    parts = [(ending, body.point(*plain(at)), radius) for ending, at, radius in features(shape)]
    heights = [dot(normal, added(point, times(-1, place))) for _, point, _ in parts]
    radii = [radius for _, _, radius in parts]
    if shape.kind == "cylinder":  # rims, which lie lowest where the axis is not along the normal
        slope = (heights[0] - heights[1]) / (2 * float(shape.size[1]))
        radii = [radius * sp.sqrt(1 - slope**2) for radius in radii]
    return {
        f"{shape.name}{ending}": height - radius
        for (ending, _, _), height, radius in zip(parts, heights, radii, strict=True)
    }
