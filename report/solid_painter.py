"""Bodies in space, drawn with Matplotlib: the ground, shadows on it, and faces from the farthest to
the nearest."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dmoc.base.tolerances import SAME
from dmoc.motion.scene import Array, Scene
from dmoc.report.camera import BODIES, LIGHT, Camera
from dmoc.report.faces import faces_of, upright
from dmoc.report.style import Style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DARKEST = 0.62  # of a colour, away from the light
SHADE = 0.16, 0.5  # of black, in a shadow on light and on dark paper
WALL = 0.16  # of a wall's colour: what is behind it is seen
LINES = 6  # of the ground, in a side of the room, at least
BEYOND = 0.12  # of the room, which the ground reaches beyond it
FEW = 4  # bodies whose ways are drawn
SEEN = (*BODIES, "rod", "bob", "coil")

# Draws the bodies of a scene with some values.
Placed = Callable[[Array], None]


def solids(axes: Axes, scene: Scene, camera: Camera, style: Style, strength: float = 1.0) -> Placed:
    """Draw bodies into axes that have their limits; they are seen where they are placed, fainter
    the smaller their strength is."""
    from matplotlib.collections import PolyCollection

    shadows = PolyCollection([], zorder=1.2)
    bodies = PolyCollection([], linewidths=0.4, zorder=2 + strength)
    for collection in (shadows, bodies):
        axes.add_collection(collection, autolim=False)
    colours = np.array([_rgb(c) for c in _colours(style)])
    paper = _rgb(style.paper)
    dark = (1 - SHADE[bool(paper.mean() < 0.5)] * strength) * paper

    def place(values: Array) -> None:
        faces, parts = _faces(scene, values, camera.side)
        if not len(faces):
            return
        normals = normals_of(faces)
        shadow = shadows_of(faces[normals @ LIGHT > 0], camera.floor)
        shadows.set(verts=list(camera.seen(shadow)[..., :2]), facecolor=dark, edgecolor=dark)
        order = painters_order(faces, normals, camera)
        lit = DARKEST + (1 - DARKEST) * np.clip(normals[order] @ LIGHT, 0.0, 1.0)
        shown = (1 - strength) * paper + strength * colours[parts[order]] * lit[:, None]
        bodies.set(verts=list(camera.seen(faces[order])[..., :2]), facecolor=shown)
        edges: Any = shown  # without which the paper would be seen between faces
        bodies.set_edgecolor(edges)

    return place


def draw_ground(axes: Axes, scene: Scene, camera: Camera, style: Style) -> float:
    """Draw the ground with its lines, and walls; return the distance of the lines."""
    from matplotlib.collections import LineCollection, PolyCollection

    step = 10.0 ** np.floor(np.log10(camera.side / LINES))
    step *= max(k for k in (1, 2, 5) if k * step <= camera.side / LINES * (1 + SAME))
    lines = camera.seen(np.array(list(_ground_lines(camera, step))))[..., :2]
    grid = LineCollection(list(lines), colors=style.grid, linewidths=0.8, zorder=0.5)
    axes.add_collection(grid, autolim=False)
    walls = [wall_of(scene.of(s, 0)[0], camera) for s in scene.shapes if s.kind == "plane"]
    seen = [camera.seen(wall)[..., :2] for wall in walls if wall is not None]
    look: dict[str, Any] = {"facecolor": (*_rgb(style.muted), WALL), "edgecolor": style.muted}
    axes.add_collection(PolyCollection(seen, linewidths=0.8, zorder=1.4, **look), autolim=False)
    return float(step)


def draw_ways(axes: Axes, scene: Scene, camera: Camera, look: Mapping[str, Any]) -> None:
    """Draw the ways of masses, and of the middles of bodies where these are few."""
    few = sum(shape.kind in BODIES for shape in scene.shapes) <= FEW
    for shape in scene.shapes:
        if shape.kind == "bob" or (few and shape.kind in BODIES):
            for phase in range(len(scene.times)):
                way = camera.seen(scene.of(shape, phase)[:, :3])
                axes.plot(way[:, 0], way[:, 1], zorder=1.5, **look)


def _ground_lines(camera: Camera, step: float) -> Iterator[list[tuple[float, ...]]]:
    """Ends of the lines of the ground, whole multiples of a step."""
    beyond = BEYOND * camera.side
    low, high = camera.low[:2] - beyond, camera.high[:2] + beyond
    for k in (0, 1):
        for s in step * np.arange(np.ceil(low[k] / step), np.floor(high[k] / step) + 1):
            ends = [[0.0, 0.0, camera.floor], [0.0, 0.0, camera.floor]]
            for end, other in zip(ends, (low, high), strict=True):
                end[k], end[1 - k] = float(s), float(other[1 - k])
            yield [tuple(end) for end in ends]


def wall_of(values: Array, camera: Camera) -> Array | None:
    """The corners of a plane as far as the room reaches, shape (4, 3); None of the ground."""
    at, normal = values[:3], values[3:]
    if normal[2] > 1 - SAME and abs(at[2] - camera.floor) <= SAME * camera.side:
        return None
    x, y, _ = upright(normal)
    along = (camera.corners - at) @ np.array([x, y]).T
    (a, b), (c, d) = along.min(axis=0), along.max(axis=0)
    return np.array([at + s * x + t * y for s, t in ((a, b), (c, b), (c, d), (a, d))])


def normals_of(faces: Array) -> Array:
    """Outward normals of length 1, shape (n, 3)."""
    normals = np.cross(faces[:, 2] - faces[:, 0], faces[:, 3] - faces[:, 1])
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.asarray(normals / np.where(length > 0, length, 1.0))


def painters_order(faces: Array, normals: Array, camera: Camera) -> NDArray[np.intp]:
    """The numbers of the faces that look at the eye, from the farthest to the nearest."""
    middles = faces.mean(axis=1)
    towards = ((camera.eye - middles) * normals).sum(axis=1) > 0
    numbers = np.flatnonzero(towards)
    depth = camera.seen(middles[numbers])[:, 2]
    return np.asarray(numbers[np.argsort(-depth, kind="stable")])


def shadows_of(faces: Array, floor: float) -> Array:
    """Faces along the light on the ground."""
    return np.asarray(faces - (faces[..., 2:] - floor) / LIGHT[2] * LIGHT)


def _faces(scene: Scene, values: Array, side: float) -> tuple[Array, Array]:
    drawn = [
        faces_of(s.kind, values[s.start : s.start + s.size], side)
        for s in scene.shapes
        if s.kind in SEEN
    ]
    if not drawn:
        return np.empty((0, 4, 3)), np.empty(0, dtype=int)
    faces, parts = zip(*drawn, strict=True)
    return np.concatenate(faces), np.concatenate(parts)


def _colours(style: Style) -> list[Any]:
    """Of bodies, the other half of balls, rods and springs, point masses."""
    body = 0.55 * _rgb(style.edge) + 0.45 * _rgb(style.body)
    return [body, style.body, style.edge, style.mass]


def _rgb(colour: Any) -> Array:
    from matplotlib.colors import to_rgb

    return np.array(to_rgb(colour))
