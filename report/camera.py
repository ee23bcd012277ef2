"""A camera that looks at a scene in space, and what it sees in the plane of a picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from dmoc.base.tolerances import SAME
from dmoc.motion.scene import Array, Scene, Shape

# Kinds of bodies, which have frames and sizes.
BODIES = ("block", "sphere", "capsule", "cylinder")
STILL = ("plane", "touch", "force", "torque")  # of which nothing is seen that moves

# Where it stands: turned to the right of -y, and lifted, in rad; and how far it is, in halves of
# the room's diagonal.
YAW, PITCH, FAR = 0.6, 0.38, 4.0
SHORT = 1e-4  # by which a point goes along a direction, in distances of the camera
# The light comes from here.
LIGHT = np.array([0.35, -0.25, 1.0]) / np.sqrt(0.35**2 + 0.25**2 + 1)


@dataclass(frozen=True)
class Camera:
    """A camera that looks at a point, z upwards in its picture.

    Lengths at the depth of that point are those of the picture.
    """

    centre: Array
    far: float
    floor: float  # height of the ground, on which shadows fall
    low: Array  # corners of the room
    high: Array
    yaw: float = YAW
    pitch: float = PITCH

    @property
    def axes(self) -> Array:
        """Rows: to the right, upwards in the picture, and back to the eye."""
        c, s = np.cos([self.yaw, self.pitch]), np.sin([self.yaw, self.pitch])
        back = np.array([c[1] * s[0], -c[1] * c[0], s[1]])
        right = np.array([c[0], s[0], 0.0])
        return np.array([right, np.cross(back, right), back])

    @property
    def corners(self) -> Array:
        """Those of the room, shape (8, 3)."""
        return np.array(list(product(*zip(self.low, self.high, strict=True))))

    @property
    def bounds(self) -> Array:
        """Lowest and highest x, then y, then z, of the room."""
        return np.stack([self.low, self.high], axis=1).ravel()

    @property
    def side(self) -> float:
        """The diagonal of the room."""
        return float(np.linalg.norm(self.high - self.low))

    @property
    def eye(self) -> Array:
        return np.asarray(self.centre + self.far * self.axes[2])

    def seen(self, points: Array) -> Array:
        """Places in the picture, shape (..., 2), of points (..., 3), and their depths behind it:
        shape (..., 3)."""
        right, up, back = np.moveaxis((points - self.eye) @ self.axes.T, -1, 0)
        scale = self.far / -back
        return np.stack([scale * right, scale * up, -back], axis=-1)

    def flat(self, values: Array) -> Array:
        """A place with directions of length 1 behind it, shape (3 n,), as they are in the picture,
        shape (2 n,): directions are as long as they are seen."""
        at, *ways = np.reshape(values, (-1, 3))
        step = SHORT * self.far
        x = self.seen(at)[:2]
        ends = [(self.seen(at + step * way)[:2] - x) / step for way in ways]
        return np.concatenate([x, *ends])


def camera_of(scenes: Sequence[Scene]) -> Camera:
    """A camera that sees all of some scenes in space."""
    lows, highs = zip(*map(reach_of, scenes), strict=True)
    low, high = np.min(lows, axis=0), np.max(highs, axis=0)
    if float(max(high - low)) <= SAME * float(np.abs([low, high]).max()):
        low, high = low - 0.5, high + 0.5
    far = FAR * float(np.linalg.norm(high - low)) / 2
    return Camera((low + high) / 2, far, floor_of(scenes[0], low), low, high)


def floor_of(scene: Scene, low: Array) -> float:
    """The height of the ground: of the highest floor, or else of the lowest point."""
    heights = []
    for shape in scene.shapes:
        values = scene.of(shape, 0)[0]
        if shape.kind == "plane" and values[5] > 1 - SAME:
            heights.append(float(values[2]))
    return max(heights, default=float(low[2]))


def reach_of(scene: Scene) -> tuple[Array, Array]:
    """Lowest and highest point, each of shape (3,), of all that moves, and of the floors and walls
    next to it."""
    bodies = [_ends(scene, s) for s in scene.shapes if s.kind not in STILL]
    planes = [s for s in scene.shapes if s.kind == "plane"]
    points = np.vstack(bodies or [np.zeros((1, 3))])
    low, high = points.min(axis=0), points.max(axis=0)
    side = float(max(high - low)) or 1.0
    for shape in planes:
        at, normal = np.split(scene.of(shape, 0)[0], 2)
        feet = np.stack([p - ((p - at) @ normal) * normal for p in (low, high)])
        near = np.linalg.norm(feet - [low, high], axis=1).min() < side
        points = np.vstack([points, feet]) if near else points
    return points.min(axis=0), points.max(axis=0)


def _ends(scene: Scene, shape: Shape) -> Array:
    """Points that bound a shape along the motion, shape (n, 3)."""
    values = np.vstack([scene.of(shape, i) for i in range(len(scene.times))])
    if shape.kind in ("rod", "coil", "bob"):
        return values.reshape(-1, 3)
    sizes = values[:, 9:]
    half = np.abs(extents(shape.kind, values[:, 3:9], sizes))
    return np.vstack([values[:, :3] - half, values[:, :3] + half])


def extents(kind: str, axes: Array, sizes: Array) -> Array:
    """How far a shape reaches from its middle along the axes of the world, shape (n, 3)."""
    if kind == "sphere":
        return np.repeat(sizes, 3, axis=1)
    first, second = axes[:, :3], axes[:, 3:]
    third = np.cross(first, second)
    if kind == "block":
        frame = np.stack([first, second, third], axis=1)
        return np.asarray((np.abs(frame) * sizes[:, :, None]).sum(axis=1) / 2)
    radius, length = sizes[:, :1], sizes[:, 1:]
    along = np.abs(third) * length / 2
    across = 1.0 if kind == "capsule" else np.sqrt(np.maximum(1 - third**2, 0.0))
    return np.asarray(along + radius * across)
