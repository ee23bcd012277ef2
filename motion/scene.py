"""What a motion looks like as plain data: the shapes of its model, and their places over time."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from dmoc.base.records import value_class

Array = NDArray[np.float64]

# Columns of each kind of shape; those of a link are pairs, as many as it has points, those of a rod
# triples.  Bodies in space have a place, the first two axes of their frame, and sizes.
FRAME = ("x", "y", "z", "x1", "y1", "z1", "x2", "y2", "z2")
COLUMNS = {
    "link": ("x0", "y0", "x1", "y1"),
    "point": ("x", "y"),
    "disc": ("x", "y", "radius", "angle"),
    "box": ("x", "y", "width", "height", "angle"),
    "spring": ("x0", "y0", "x1", "y1"),
    "wall": ("x0", "y0", "x1", "y1"),
    "contact": ("x", "y", "nx", "ny"),
    "rod": ("x0", "y0", "z0", "x1", "y1", "z1"),
    "bob": ("x", "y", "z"),
    "coil": ("x0", "y0", "z0", "x1", "y1", "z1"),
    "block": (*FRAME, "width", "depth", "height"),
    "sphere": (*FRAME, "radius"),
    "capsule": (*FRAME, "radius", "length"),
    "cylinder": (*FRAME, "radius", "length"),
    "plane": ("x", "y", "z", "nx", "ny", "nz"),
    "touch": ("x", "y", "z", "nx", "ny", "nz"),
    "force": ("x", "y", "z", "dx", "dy", "dz"),
    "torque": ("x", "y", "z", "dx", "dy", "dz"),
}
CONTACTS, INPUTS = ("contact", "touch"), ("force", "torque")
FIRST_IN_SPACE = list(COLUMNS).index("rod")
# Intervals of a phase between two samples: at least, so that its arcs look round, and at most.
FINE, FINEST = 60, 3000


@value_class(frozen=True)
class Shape:
    """A shape of a drawing: its columns are ``start`` to ``start + size``.

    Attributes
    ----------
    kind : str
        One of COLUMNS, those from ``rod`` on in space.  Lengths are in the unit of the drawing,
        angles in rad, counterclockwise; directions and axes have the length 1.  A wall is solid to
        the right of the way from its first point to its second, a plane behind its normal.
    name : str
        Of a contact or a touch its surface or rail, of a force or torque its input; of other shapes
        a label, which may be empty.
    start, size : int
    """

    kind: str
    name: str
    start: int
    size: int


@value_class(frozen=True)
class Scene:
    """Shapes and their places along a motion.

    Attributes
    ----------
    shapes : tuple of Shape
    times : tuple of arrays, shape (n,) for each phase
        In seconds.
    values : tuple of arrays, shape (n, columns) for each phase
    """

    shapes: tuple[Shape, ...]
    times: tuple[Array, ...]
    values: tuple[Array, ...]

    def of(self, shape: Shape, phase: int) -> Array:
        """Values of a shape along a phase, shape (n, shape.size)."""
        return self.values[phase][:, shape.start : shape.start + shape.size]

    @property
    def contacts(self) -> tuple[Shape, ...]:
        """Places at which forces act."""
        return tuple(shape for shape in self.shapes if shape.kind in CONTACTS)

    @property
    def in_space(self) -> bool:
        """Whether its places have three coordinates."""
        return bool(self.shapes) and list(COLUMNS).index(self.shapes[0].kind) >= FIRST_IN_SPACE


def resampled(t: Array, q: Array, v: Array) -> tuple[Array, Array]:
    """Times (n,) and positions (n, nq) of a phase, finely enough to be drawn, by cubics between its
    nodes. These have times (N + 1,), positions and velocities (N + 1, nq); some of them are enough
    if they are more than FINEST."""
    if len(t) == 1:
        return t, q
    if len(t) > FINEST + 1:
        chosen = np.linspace(0, len(t) - 1, FINEST + 1).round().astype(int)
        return t[chosen], q[chosen]
    parts = -(-FINE // (len(t) - 1))
    if parts == 1:
        return t, q
    s = (np.arange(parts) / parts)[:, None]
    h = np.diff(t)[:, None, None]
    begins, ends = q[:-1, None], q[1:, None]
    way = begins + s**2 * (3 - 2 * s) * (ends - begins)
    way = way + h * s * (1 - s) * ((1 - s) * v[:-1, None] - s * v[1:, None])
    times = t[:-1, None] + s[:, 0] * np.diff(t)[:, None]
    return np.append(times.ravel(), t[-1]), np.vstack([way.reshape(-1, q.shape[1]), q[-1:]])


def shapes_in(table: Iterable[tuple[str, str, int, int]]) -> tuple[Shape, ...]:
    """The shapes that a manifest lists."""
    return tuple(Shape(*row) for row in table)


def wrong_scene(scene: Scene) -> str | None:
    """A sentence about shapes of a scene that do not fit together."""
    start = 0
    for shape in scene.shapes:
        size = len(COLUMNS[shape.kind])
        fits = shape.size == size or (
            shape.kind in ("link", "rod") and shape.size > size and shape.size % (size // 2) == 0
        )
        if not fits or shape.start != start:
            return f"a {shape.kind} of the scene has the wrong columns"
        start += shape.size
    if len(scene.times) != len(scene.values):
        return "the scene has times and values of different phases"
    for i, (t, values) in enumerate(zip(scene.times, scene.values, strict=True)):
        least = 1 if 0 < i == len(scene.times) - 1 else 2  # the motion may end with an event
        if len(t) < least or not (np.diff(t) > 0).all():
            return "the times of the scene do not increase"
        if values.shape != (len(t), start):
            return "the scene has values of the wrong shape"
    return None
