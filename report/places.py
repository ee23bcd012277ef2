"""Where the shapes of a scene are: the room that they take, and their values at a time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from dmoc.base.tolerances import SAME
from dmoc.motion.scene import Array, Scene, Shape
from dmoc.report.camera import Camera, camera_of

# Walls are seen this far beyond what moves, as a share of the room of what moves.
BEYOND = 0.5


class Room(NamedTuple):
    """What is seen of the plane, or of a picture of space by a camera."""

    left: float
    right: float
    bottom: float
    top: float
    camera: Camera | None = None

    @property
    def sides(self) -> tuple[float, float]:
        """Width and height."""
        return self.right - self.left, self.top - self.bottom


def flat_marks(marks: Sequence[Any], camera: Camera | None) -> list[Any]:
    """Marks of an event as they are in the picture of a camera: those in space with the normal and
    the impulse that are seen."""
    if camera is None:
        return list(marks)
    flat = []
    for mark in marks:
        x, y, nx, ny, *push = camera.flat(np.concatenate([mark["at"], mark["impulse"]])).tolist()
        size = float(np.hypot(nx, ny)) or 1.0
        flat.append(
            {**mark, "at": np.array([x, y, nx / size, ny / size]), "impulse": np.array(push)}
        )
    return flat


def phase_at(scene: Scene, t: float) -> int:
    """The phase that a time lies in; at an event the one after it."""
    return max(sum(bool(times[0] <= t) for times in scene.times) - 1, 0)


def values_at(scene: Scene, t: float) -> Array:
    """The values of all shapes at a time, linear between its samples."""
    phase = phase_at(scene, t)
    return np.array([np.interp(t, scene.times[phase], c) for c in scene.values[phase].T])


def extent_of(scene: Scene) -> tuple[Array, Array]:
    """Lowest and highest point, each of shape (2,), of all that moves, and of the walls near it."""
    moving = [_ends(scene, s) for s in scene.shapes if s.kind not in ("wall", "contact")]
    walls = [_ends(scene, s) for s in scene.shapes if s.kind == "wall"]
    points = np.vstack(moving or walls or [np.zeros((1, 2))])
    low, high = points.min(axis=0), points.max(axis=0)
    beyond = BEYOND * max(high - low)
    near = [np.clip(wall, low - beyond, high + beyond) for wall in walls]
    points = np.vstack([points, *near])
    return points.min(axis=0), points.max(axis=0)


def room_of(scenes: Sequence[Scene], margin: float, least: float) -> Room:
    """The room of some scenes, those in space as one camera sees them, with a margin in shares of
    the larger side; each side is at least a share of the other one."""
    spatial = [scene for scene in scenes if scene.in_space]
    camera = camera_of(spatial) if spatial else None
    extents = [extent_of(scene) for scene in scenes if not scene.in_space]
    if camera:
        seen = camera.seen(camera.corners)[:, :2]
        extents.append((seen.min(axis=0), seen.max(axis=0)))
    lows, highs = zip(*extents, strict=True)
    low, high = np.min(lows, axis=0), np.max(highs, axis=0)
    side = max(*(high - low), SAME * np.abs([low, high]).max()) or 1.0
    half = np.maximum(high - low, least * side) / 2 + margin * side
    (left, bottom), (right, top) = (low + high) / 2 - half, (low + high) / 2 + half
    return Room(float(left), float(right), float(bottom), float(top), camera)


def _ends(scene: Scene, shape: Shape) -> Array:
    """Points that bound a shape along the motion, shape (n, 2)."""
    values = np.vstack([scene.of(shape, i) for i in range(len(scene.times))])
    if shape.kind not in ("disc", "box"):
        return values.reshape(-1, 2)
    half = values[:, 2:3]
    if shape.kind == "box":
        w, h, angle = values[:, 2:].T
        c, s = np.abs(np.cos(angle)), np.abs(np.sin(angle))
        half = np.stack([c * w + s * h, s * w + c * h], axis=1) / 2
    return np.vstack([values[:, :2] - half, values[:, :2] + half])
