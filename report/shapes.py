"""Shapes of a mechanism, drawn with Matplotlib."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from dmoc.motion.scene import Array, Scene, Shape
from dmoc.report.style import Style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COILS, COIL = 8, 0.02  # of a spring, and its half width in extents
HATCH = 0.025  # distance of the strokes behind a wall, in extents

# Places a shape by its values.
Placed = Callable[[Array], None]


class Look(NamedTuple):
    """How a shape is drawn: its colours, the extent of the scene, the weight of its lines, and its
    strength, 0 what cannot be seen and 1 in full."""

    edge: str
    body: str
    mass: str
    quiet: str
    paper: str
    length: float
    weight: float
    strength: float

    def line(self, width: float, above: float = 0.0) -> dict[str, Any]:
        return {"color": self.edge, "linewidth": width, "zorder": 2 + self.strength + above}

    @property
    def area(self) -> dict[str, Any]:
        """Settings of an area: a faint one has an edge alone, so that others are seen through
        it."""
        inside = self.body if self.strength == 1 else "none"
        look = {"facecolor": inside, "edgecolor": self.edge, "linewidth": 1.2}
        return {**look, "zorder": 2 + self.strength}


def look_of(
    style: Style, length: float, weight: float = 1.0, strength: float = 1.0, still: bool = False
) -> Look:
    """The look of a shape in a style; what stands still stands back."""

    def mixed(colour: str, share: float) -> str:
        """A colour mixed with that of the paper: opaque, so that overlaps do not look like more."""
        from matplotlib.colors import to_hex, to_rgb

        a, b = np.array(to_rgb(colour)), np.array(to_rgb(style.paper))
        return to_hex(tuple((share * a + (1 - share) * b).tolist()))

    body = mixed(style.muted, 0.25) if still else style.body
    colours = [mixed(c, strength) for c in (style.muted if still else style.edge, style.mass)]
    return Look(colours[0], body, colours[1], style.muted, style.paper, length, weight, strength)


def painter(axes: Axes, scene: Scene, shape: Shape, look: Look) -> Placed:
    """Draw a shape into axes that have their limits; it is seen where it is placed."""
    if shape.kind == "disc":
        values = [scene.of(shape, phase)[:, 3] for phase in range(len(scene.times))]
        return _disc(axes, look, any(angles.any() for angles in values))
    return MAKERS[shape.kind](axes, look)


def _link(axes: Axes, look: Look) -> Placed:
    (line,) = axes.plot([], [], **look.line(2.0 * look.weight, 0.1), solid_capstyle="round",
                        solid_joinstyle="round")  # fmt: skip
    return lambda values: line.set_data(values[::2], values[1::2])


def _point(axes: Axes, look: Look) -> Placed:
    (mark,) = axes.plot([], [], "o", color=look.mass, markersize=6 * look.weight,
                        markeredgewidth=0.5 * look.weight, markeredgecolor=look.paper,
                        zorder=2.2 + look.strength)  # fmt: skip
    return lambda values: mark.set_data(values[:1], values[1:])


def _disc(axes: Axes, look: Look, turns: bool) -> Placed:
    """A disc, with a radius if it turns."""
    from matplotlib.patches import Circle

    disc = Circle((0.0, 0.0), 1.0, **look.area)
    axes.add_patch(disc)
    lines = axes.plot([], [], **look.line(1.2)) if turns else []

    def place(values: Array) -> None:
        x, y, r, angle = values
        disc.set(center=(x, y), radius=r)
        for line in lines:
            line.set_data([x, x + r * np.cos(angle)], [y, y + r * np.sin(angle)])

    return place


def _box(axes: Axes, look: Look) -> Placed:
    from matplotlib.patches import Polygon

    box = Polygon(np.zeros((4, 2)), **look.area)
    axes.add_patch(box)
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) / 2

    def place(values: Array) -> None:
        x, y, width, height, angle = values
        turn = np.array([(np.cos(angle), np.sin(angle)), (-np.sin(angle), np.cos(angle))])
        box.set_xy((x, y) + corners * (width, height) @ turn)

    return place


def _spring(axes: Axes, look: Look) -> Placed:
    """A zigzag from one end to the other, straight near both."""
    (line,) = axes.plot([], [], **look.line(1.2))
    middle = 0.12 + 0.76 * (np.arange(COILS) + 0.5) / COILS
    along = np.concatenate([[0.0, 0.12], middle, [0.88, 1.0]])[:, None]
    across = np.concatenate([[0.0, 0.0], (-1.0) ** np.arange(COILS), [0.0, 0.0]])[:, None]

    def place(values: Array) -> None:
        a, way = values[:2], values[2:] - values[:2]
        normal = COIL * look.length * np.array([-way[1], way[0]]) / (np.hypot(*way) or 1.0)
        line.set_data(*(a + along * way + across * normal).T)

    return place


def _wall(axes: Axes, look: Look) -> Placed:
    """A line with strokes on its solid side, to the right of its way, as far as it is seen."""
    from matplotlib.collections import LineCollection

    (line,) = axes.plot([], [], color=look.quiet, linewidth=1.6, zorder=1)
    strokes = LineCollection([], colors=look.quiet, linewidths=0.7, zorder=1)
    axes.add_collection(strokes, autolim=False)
    apart = HATCH * look.length

    def place(values: Array) -> None:
        a, way = values[:2], values[2:] - values[:2]
        length = float(np.hypot(*way)) or 1.0
        along = way / length
        corners = np.array([(x, y) for x in axes.get_xlim() for y in axes.get_ylim()])
        ways = ((corners - a) @ along).clip(0.0, length) / apart
        feet = a + apart * (np.arange(int(ways.min()), int(ways.max())) + 0.5)[:, None] * along
        stroke = 0.65 * apart * np.array([along[1] - along[0], -along[0] - along[1]])
        line.set_data(values[::2], values[1::2])
        strokes.set_segments(list(np.stack([feet, feet + stroke], axis=1)))

    return place


MAKERS = {"link": _link, "point": _point, "box": _box, "spring": _spring, "wall": _wall}
# Shapes that are seen: a contact is a place alone.
SEEN = (*MAKERS, "disc")
