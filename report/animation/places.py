"""The parts of a scene over time, the room that they take, and where contacts are."""

from __future__ import annotations

from typing import TypeAlias, TypedDict

import numpy as np

from dmoc.motion.scene import Array, Scene, Shape
from dmoc.report.animation.numbers import Column, column, rounded

Place: TypeAlias = list[float]  # x, y, and the direction in which the surface pushes
Bounds: TypeAlias = list[float]  # left, right, bottom, top
# Walls are seen this far beyond what moves, as a share of the room of what moves.
BEYOND = 0.5
MARGIN = 0.1  # of the larger side, around everything
# The least side of a picture, as a share of the other one, and in metres where nothing moves.
LEAST, NOTHING = 0.3, 1e-9


class Part(TypedDict):
    """A phase of a scene: times, and columns of the shapes."""

    times: list[float]
    columns: list[Column]


def parts_of(scene: Scene) -> tuple[list[Part], list[int]]:
    """Times and columns of each phase, and which of these columns stands for each of the scene:
    those that are the same all along are there once.  One that does not change is one number."""
    _, first, which = np.unique(
        np.vstack(scene.values), axis=1, return_index=True, return_inverse=True
    )
    parts: list[Part] = [
        {"times": rounded(t), "columns": [column(v) for v in values.T[first]]}
        for t, values in zip(scene.times, scene.values, strict=True)
    ]
    return parts, which.ravel().tolist()


def place_at(scene: Scene, phase: int, name: str) -> Place | None:
    """Where a contact is when a phase ends; None where the scene does not say."""
    for shape in scene.contacts:
        if shape.name == name:
            return rounded(scene.of(shape, phase)[-1])
    return None


def bounds_of(scene: Scene) -> Bounds:
    """The room of a motion: of all that moves, and of the walls near it."""
    moving = [_corners(scene, s) for s in scene.shapes if s.kind not in ("wall", "contact")]
    walls = [_corners(scene, s) for s in scene.shapes if s.kind == "wall"]
    points = np.vstack(moving or walls or [np.zeros((1, 2))])
    low, high = points.min(axis=0), points.max(axis=0)
    beyond = BEYOND * max(high - low)
    for wall in walls:
        near = np.clip(wall, low - beyond, high + beyond)
        points = np.vstack([points, near])
    low, high = points.min(axis=0), points.max(axis=0)
    side = max(max(high - low), NOTHING)
    room = np.maximum(high - low, LEAST * side) / 2 + MARGIN * side
    middle = (low + high) / 2
    (left, bottom), (right, top) = middle - room, middle + room
    return rounded(np.array([left, right, bottom, top]))


def _corners(scene: Scene, shape: Shape) -> Array:
    """Points that bound a shape along the motion, shape (n, 2)."""
    values = np.vstack([scene.of(shape, i) for i in range(len(scene.times))])
    if shape.kind in ("disc", "box"):
        size = values[:, 2] if shape.kind == "disc" else np.hypot(values[:, 2], values[:, 3]) / 2
        return np.vstack([values[:, :2] - size[:, None], values[:, :2] + size[:, None]])
    return values.reshape(-1, 2)
