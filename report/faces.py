"""Shapes in space as flat faces of four corners each."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from dmoc.motion.scene import Array

# Faces of what is round, around its axis and of half a ball; in a row of a side of a box, and along
# a cylinder: small ones, since they are painted one behind another.
SIDES, RINGS, CELLS = 20, 5, 4
COILS, ACROSS = 8, 0.025  # of a spring, and its half width, in sides of the room
THICK = 0.012  # half of a rod, in sides of the room
BOB = 0.03  # radius of a point mass
THIN = 0.004  # the least side of a box
HEAD = 0.035  # length of the head of an arrow
# What a face is part of, which decides its colour: a body, the other half of a ball, a rod or a
# spring, a point mass.
BODY, OTHER, EDGE, MASS = range(4)


def faces_of(kind: str, values: Array, side: float) -> tuple[Array, Array]:
    """The faces of a shape with some values: their corners, shape (n, 4, 3), counterclockwise from
    outside, and what each is part of, shape (n,); ``side`` is that of the room."""
    if kind in ("rod", "coil"):
        points = values.reshape(-1, 3)
        radius = THICK * side
        if kind == "coil":
            points, radius = helix(points[0], points[1], ACROSS * side), radius / 3
        faces = np.concatenate(list(_pipes(points, radius)))
        return faces, np.full(len(faces), EDGE)
    if kind == "bob":
        faces = lathe(_ball(BOB * side)) + values
        return faces, np.full(len(faces), MASS)
    at, first, second, sizes = values[:3], values[3:6], values[6:9], values[9:]
    frame = frame_of(first, second)
    if kind == "block":
        own = block(np.maximum(sizes, THIN * side))
    elif kind == "sphere":
        own = lathe(_ball(sizes[0]))
    else:
        radius, half = sizes[0], sizes[1] / 2
        own = lathe(_pipe(radius, half) if kind == "cylinder" else _ball(radius, half))
    parts = np.full(len(own), BODY)
    if kind in ("sphere", "cylinder"):
        middle = own.mean(axis=1)
        parts[middle.prod(axis=1) > 0] = OTHER  # every second eighth
    return own @ frame + at, parts


def frame_of(first: Array, second: Array) -> Array:
    """Rows: the axes of a frame, of its first two to rounding and interpolation."""
    x = first / np.linalg.norm(first)
    z = np.cross(x, second)
    z = z / np.linalg.norm(z)
    return np.array([x, np.cross(z, x), z])


def block(size: Array) -> Array:
    """A box around the origin, each side in CELLS x CELLS faces: shape (n, 4, 3)."""
    square = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
    cells = np.stack(np.divmod(np.arange(CELLS**2), CELLS), axis=1)[:, None]
    side = 2 / CELLS * (cells + square) - 1
    faces = np.empty((3, 2, CELLS**2, 4, 3))
    for k in range(3):
        for end, sign in enumerate((1, -1)):
            faces[k, end][..., [(k + 1) % 3, (k + 2) % 3]] = side[:, ::sign]
            faces[k, end, ..., k] = sign
    return faces.reshape(-1, 4, 3) * size / 2


def lathe(profile: Array) -> Array:
    """What a profile (n, 2) of distances from the z axis and heights, from above, turns to."""
    angles = np.linspace(0.0, 2 * np.pi, SIDES + 1)
    r, z = profile.T
    around = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    flat = r[:, None, None] * around
    heights = np.broadcast_to(z[:, None, None], (len(r), SIDES + 1, 1))
    rings = np.concatenate([flat, heights], axis=2)
    a, b, c, d = rings[:-1, :-1], rings[1:, :-1], rings[1:, 1:], rings[:-1, 1:]
    return np.stack([a, b, c, d], axis=2).reshape(-1, 4, 3)


def _ball(radius: float, half: float = 0.0) -> Array:
    """The profile of a ball, or of a capsule of some half length."""
    above = np.linspace(0.0, np.pi / 2, RINGS + 1)
    angles = np.concatenate([above, np.pi / 2 + (above[1:] if half == 0 else above)])
    lifts = np.where(np.arange(len(angles)) <= RINGS, half, -half)
    return np.stack([radius * np.sin(angles), radius * np.cos(angles) + lifts], axis=1)


def helix(a: Array, b: Array, across: float) -> Array:
    """Points of a spring from one end to the other, shape (n, 3)."""
    x, y, _ = upright(b - a)
    s = np.linspace(0.0, 1.0, 12 * COILS + 1)[:, None]
    turn = 2 * np.pi * COILS * s
    wide = across * np.clip(np.minimum(s, 1 - s) / 0.1, 0.0, 1.0)
    return np.asarray(a + s * (b - a) + wide * (np.cos(turn) * x + np.sin(turn) * y))


def upright(way: Array) -> Array:
    """Rows: axes of a frame whose third one is along a way, which may have no length."""
    length = float(np.linalg.norm(way))
    z = way / length if length else np.array([0.0, 0.0, 1.0])
    x = np.cross((0.0, 0.0, 1.0) if abs(z[2]) < 0.9 else (1.0, 0.0, 0.0), z)
    x = x / np.linalg.norm(x)
    return np.array([x, np.cross(z, x), z])


def _pipe(radius: float, half: float) -> Array:
    """The profile of a cylinder of some half length."""
    side = [(radius, z) for z in np.linspace(half, -half, CELLS + 1).tolist()]
    return np.array([(0.0, half), *side, (0.0, -half)])


def _pipes(points: Array, radius: float) -> Iterator[Array]:
    """Thin cylinders between points that follow each other."""
    for a, b in pairwise(points):
        half = float(np.linalg.norm(b - a)) / 2
        yield lathe(_pipe(radius, half)) @ upright(b - a) + (a + b) / 2
