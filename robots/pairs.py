"""Which shapes of a robot may meet each other."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import Any

import numpy as np
import sympy as sp

from dmoc.robots.parts import Part
from dmoc.robots.records import Array, Shape
from dmoc.robots.shapes import rounded, solid_of
from dmoc.symbolic.distances import distance_of
from dmoc.symbolic.solids import carried_solid
from dmoc.symbolic.vectors import Vector, added


def pairs_of(shapes: Sequence[tuple[str, Part, Shape]]) -> tuple[tuple[str, str], ...]:
    """Names of shapes of parts of which neither carries the other by a joint, but for those that
    overlap where the robot is as the file draws it."""
    return tuple(
        (a, b)
        for (a, first, one), (b, second, other) in combinations(shapes, 2)
        if not _neighbours(first, second) and not _overlap(first, one, second, other)
    )


def _neighbours(a: Part, b: Part) -> bool:
    return a is b or _carrier(a) is b or _carrier(b) is a


def _carrier(part: Part) -> Part | None:
    """The part before, past those between several joints of one link."""
    before = part.before
    while before is not None and not before.frames:
        before = before.before
    return before


def _overlap(a: Part, one: Shape, b: Part, other: Shape) -> bool:
    places = _drawn(a) + one.place, _drawn(b) + other.place
    if np.linalg.norm(places[0] - places[1]) > _reach(one) + _reach(other):
        return False
    gap = distance_of(_placed(_drawn(a), one), _placed(_drawn(b), other), lambda e: e)
    return bool(gap < 0)


def _drawn(part: Part) -> Array:
    """The origin of a part, whose frame is parallel to that of the world there."""
    origin = part.place
    while part.before is not None:
        part = part.before
        origin = origin + part.place
    return origin


def _placed(origin: Array, shape: Shape) -> Any:
    moved: Vector = tuple(sp.Float(x) for x in origin)
    return carried_solid(rounded(solid_of(shape)), lambda p: added(moved, p), lambda v: v)


def _reach(shape: Shape) -> float:
    """The radius of a ball around the middle of a shape that holds it."""
    sizes = shape.size if shape.kind == "box" else shape.size[: 1 if shape.kind == "sphere" else 2]
    return float(np.linalg.norm(sizes) if shape.kind == "box" else np.sum(sizes))
