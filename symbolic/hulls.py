"""Convex hulls of a few points, with their faces and edges."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np

from dmoc.base.arguments import array, shown
from dmoc.base.errors import ModelError
from dmoc.base.signatures import public
from dmoc.symbolic.solids import Moved
from dmoc.symbolic.vectors import Vector, vector

FLAT = 1e-9  # of turns between faces that are one, and of what is no volume
MOST_CORNERS = 24  # a distance from them would be longer than the motion of a robot


def _kept(direction: Vector) -> Vector:
    return direction


@public(ModelError)
@dataclass(frozen=True)
class Hull:
    """The convex hull of a few points, for distances; it is drawn by its edges.

    Attributes
    ----------
    points : triples
        Its corners, numbers in the frame of the body that takes it, in the unit of lengths; points
        within the hull of the others are left out.

    Raises
    ------
    ModelError
        If the points are no numbers, lie in a plane, or are more than 24.

    Examples
    --------
    >>> import dmoc
    >>> wedge = dmoc.spatial.Hull([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)])
    >>> len(wedge.points), len(wedge.faces), len(wedge.edges)
    (4, 4, 6)
    """

    points: Any
    faces: Any = field(default=None, init=False, repr=False)  # corners in turn, seen from outside
    edges: Any = field(default=None, init=False, repr=False)
    places: Any = field(default=None, init=False, repr=False)  # of the points in the world
    turned: Any = field(default=None, init=False, repr=False)  # its directions in the world
    origin: Any = field(default=(0, 0, 0), init=False, repr=False)  # of its frame in the world

    def __post_init__(self) -> None:
        points = _read(self.points)
        corners, faces = _faces(points)
        sides = {tuple(sorted(p)) for turn in faces for p in pairwise((*turn, turn[0]))}
        own = tuple(vector(p, 3, "a point of a Hull") for p in points[corners].tolist())
        for name, value in (
            ("points", own), ("faces", faces), ("edges", tuple(sorted(sides))), ("places", own),
            ("turned", _kept),
        ):  # fmt: skip
            object.__setattr__(self, name, value)


def carried_hull(hull: Hull, point: Moved, turned: Moved) -> Hull:
    """A hull in the frame of a body as one in the world."""
    carried = copy(hull)
    object.__setattr__(carried, "places", tuple(point(p) for p in hull.points))
    object.__setattr__(carried, "turned", turned)
    object.__setattr__(carried, "origin", point((0, 0, 0)))
    return carried


def _read(value: Any) -> np.ndarray:
    points = array(value)
    if points is None or points.ndim != 2 or points.shape[1] != 3:
        raise ModelError(f"the points of a Hull = {shown(value)}: expected triples of numbers.")
    if not np.isfinite(points).all():
        raise ModelError(f"the points of a Hull = {shown(value)}: expected finite numbers.")
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    if len(points) < 4 or spread[2] <= FLAT * spread[0]:
        raise ModelError("the points of a Hull lie in a plane: expected four or more that do not.")
    return points


def _faces(points: np.ndarray) -> tuple[list[int], tuple[tuple[int, ...], ...]]:
    """Which points are corners, and the faces as corners in turn, seen from outside."""
    from scipy.spatial import ConvexHull  # when a hull is made: most models have none

    hull = ConvexHull(points)
    planes: list[np.ndarray] = []
    members: list[set[int]] = []
    for equation, simplex in zip(hull.equations, hull.simplices, strict=True):
        near = [k for k, other in enumerate(planes) if abs(other - equation).max() < FLAT]
        if not near:
            planes.append(equation)
            members.append(set())
        members[near[0] if near else -1] |= {*simplex.tolist()}
    corners = sorted(set().union(*members))
    if len(corners) > MOST_CORNERS:
        raise ModelError(
            f"a Hull has {len(corners)} corners: expected at most {MOST_CORNERS}; leave out what "
            "is between the others, or take a Box or a Capsule."
        )
    return corners, tuple(
        _in_turn(points, corners, sorted(own), plane[:3])
        for own, plane in zip(members, planes, strict=True)
    )


def _in_turn(
    points: np.ndarray, corners: list[int], own: list[int], normal: np.ndarray
) -> tuple[int, ...]:
    """Corners of a face counterclockwise about its outward normal."""
    arms = points[own] - points[own].mean(axis=0)
    along = arms[0] / np.linalg.norm(arms[0])
    angles = np.arctan2(arms @ np.cross(normal, along), arms @ along)
    return tuple(corners.index(own[k]) for k in np.argsort(angles))
