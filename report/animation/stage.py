"""A mechanism at a time, drawn with Matplotlib: its shapes, hits and contact forces."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from dmoc.motion.trajectory import Array
from dmoc.report.animation.colours import Colours
from dmoc.report.animation.film import Arrow, Event, Mark, Motion
from dmoc.report.animation.numbers import Column, short
from dmoc.report.animation.places import Part

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ARROW = 0.22  # of the smaller side of the room: the largest contact force
SHORT = 0.015  # of that side: the shortest arrow that is drawn
TOLD = 0.18  # of the whole time, for which a hit is told
STROKES = 45  # of a wall, on the larger side of the room
COILS = 8
WIDE, LINE = 5.2, 12  # points of a character of what is told, about, and of a line of it

# Places an artist by the values of its columns, or by a time.
Placed = Callable[[Array], None]
Drawn = Callable[[float], None]


class Room(NamedTuple):
    """What is seen of the plane."""

    left: float
    right: float
    bottom: float
    top: float

    @property
    def sides(self) -> tuple[float, float]:
        """The smaller and the larger side."""
        low, high = sorted((self.right - self.left, self.top - self.bottom))
        return low, high


def stage_of(axes: Axes, motion: Motion, room: Room, colours: Colours) -> Drawn:
    """Draw a mechanism into axes; return what places it for a time."""
    axes.set_axis_off()
    axes.set(xlim=(room.left, room.right), ylim=(room.bottom, room.top))
    below: dict[str, Any] = {"y": -0.01, "transform": axes.transAxes, "va": "top", "fontsize": 10}
    clock = axes.text(0.02, s="", color=colours.text, **below)
    axes.text(
        0.98, 0.98, _scale_of_arrows(motion), color=colours.quiet, fontsize=9, ha="right",
        va="top", transform=axes.transAxes,
    )  # fmt: skip
    mode = axes.text(0.98, s="", color=colours.quiet, ha="right", parse_math=False, **below)
    banner = axes.text(
        0.02, 0.94, "", color=colours.hit, fontsize=10, transform=axes.transAxes, parse_math=False
    )
    for line in _traces(motion):
        axes.plot(*line, color=colours.mass, linestyle=":", linewidth=1.2, alpha=0.7, zorder=1)
    makers = {"link": _link, "point": _point, "disc": _disc, "box": _box, "spring": _spring,
              "wall": _wall}  # fmt: skip
    drawn = [shape for shape in motion["shapes"] if shape["kind"] in makers]
    shapes = [(makers[s["kind"]](axes, room, colours), s["columns"]) for s in drawn]
    shapes += [(_name(axes, s["name"], colours), s["columns"]) for s in drawn if s["name"]]
    forces = [_arrow(axes, motion, arrow, room, colours) for arrow in motion["arrows"]]
    hits = [_hit(axes, motion, i, room, colours) for i in range(len(motion["events"]))]

    def draw(t: float) -> None:
        end = min(t, motion["duration"])
        columns = columns_at(motion, end)
        for place, own in shapes:
            place(columns[own])
        for force in forces:
            force(end)
        for hit in hits:
            hit(t)
        clock.set_text(f"{end:.3f} s")
        mode.set_text(motion["modes"][_phase(motion, end)] if motion["lasting"] else "")
        banner.set_text(_told(motion, t))

    return draw


def _scale_of_arrows(motion: Motion) -> str:
    return f"longest arrow {short(motion['largest'])} N" if motion["arrows"] else ""


def _traces(motion: Motion) -> Iterator[tuple[list[float], list[float]]]:
    """The ways of masses and of the middles of bodies, phase by phase."""
    for shape in motion["shapes"]:
        if shape["kind"] in ("point", "disc", "box"):
            for part in motion["parts"]:
                x, y = (_along(part, k) for k in shape["columns"][:2])
                yield x, y


def _along(part: Part, k: int) -> list[float]:
    """A column of a part at all of its times."""
    column = part["columns"][k]
    return [column] * len(part["times"]) if isinstance(column, float) else column


def columns_at(motion: Motion, t: float) -> Array:
    """The columns of the scene of a motion at a time, linear between its samples."""
    part = motion["parts"][_phase(motion, t)]
    return np.array([_value(part["times"], column, t) for column in part["columns"]])


def _phase(motion: Motion, t: float) -> int:
    """The phase that a time lies in; at an event the one after it."""
    return max(int(np.searchsorted(motion["starts"], t, side="right")) - 1, 0)


def _value(times: list[float], column: Column, t: float) -> float:
    return column if isinstance(column, float) else float(np.interp(t, times, column))


def _told(motion: Motion, t: float) -> str:
    """What is told of the event that has just been, where its place is not known."""
    since = TOLD * motion["duration"]
    recent = [e for e in motion["events"] if not e["marks"] and e["time"] <= t < e["time"] + since]
    return ": ".join(filter(None, (recent[-1]["word"], recent[-1]["told"]))) if recent else ""


def _name(axes: Axes, name: str, colours: Colours) -> Placed:
    """The name of a shape, above its first point."""
    label = axes.annotate(name, (0, 0), (0, 6), textcoords="offset points", color=colours.quiet,
                          fontsize=9, zorder=6, parse_math=False)  # fmt: skip

    def place(values: Array) -> None:
        label.xy = (float(values[0]), float(values[1]))

    return place


def _link(axes: Axes, _: Room, colours: Colours) -> Placed:
    (line,) = axes.plot([], [], color=colours.edge, linewidth=3.2, solid_capstyle="round",
                        solid_joinstyle="round", zorder=3)  # fmt: skip
    return lambda values: line.set_data(values[::2], values[1::2])


def _point(axes: Axes, _: Room, colours: Colours) -> Placed:
    (mark,) = axes.plot([], [], "o", color=colours.mass, markersize=9, markeredgewidth=0.8,
                        markeredgecolor=colours.ground, zorder=4)  # fmt: skip
    return lambda values: mark.set_data(values[:1], values[1:])


def _disc(axes: Axes, _: Room, colours: Colours) -> Placed:
    from matplotlib.patches import Circle

    disc = Circle((0.0, 0.0), 1.0, facecolor=colours.body, edgecolor=colours.edge, zorder=2)
    axes.add_patch(disc)
    (radius,) = axes.plot([], [], color=colours.edge, linewidth=1.2, zorder=2)

    def place(values: Array) -> None:
        x, y, r, angle = values
        disc.set(center=(x, y), radius=r)
        radius.set_data([x, x + r * np.cos(angle)], [y, y + r * np.sin(angle)])

    return place


def _box(axes: Axes, _: Room, colours: Colours) -> Placed:
    from matplotlib.patches import Polygon

    box = Polygon(np.zeros((4, 2)), facecolor=colours.body, edgecolor=colours.edge, zorder=2)
    axes.add_patch(box)
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) / 2

    def place(values: Array) -> None:
        x, y, width, height, angle = values
        turn = np.array([(np.cos(angle), np.sin(angle)), (-np.sin(angle), np.cos(angle))])
        box.set_xy((x, y) + corners * (width, height) @ turn)

    return place


def _spring(axes: Axes, room: Room, colours: Colours) -> Placed:
    (line,) = axes.plot([], [], color=colours.edge, linewidth=1.2, zorder=2)
    wide = 0.02 * room.sides[1]
    middle = 0.12 + 0.76 * (np.arange(COILS) + 0.5) / COILS
    along = np.concatenate([[0.0, 0.12], middle, [0.88, 1.0]])
    across = np.concatenate([[0.0, 0.0], wide * (-1.0) ** np.arange(COILS), [0.0, 0.0]])

    def place(values: Array) -> None:
        a, way = values[:2], values[2:] - values[:2]
        normal = np.array([-way[1], way[0]]) / (np.hypot(*way) or 1.0)
        line.set_data(*(a + along[:, None] * way + across[:, None] * normal).T)

    return place


def _wall(axes: Axes, room: Room, colours: Colours) -> Placed:
    """A wall with strokes on its solid side, to the right of its way."""
    from matplotlib.collections import LineCollection

    (line,) = axes.plot([], [], color=colours.quiet, linewidth=1.6, zorder=1)
    strokes = LineCollection([], colors=colours.quiet, linewidths=0.7, zorder=1)
    axes.add_collection(strokes, autolim=False)
    apart = room.sides[1] / STROKES

    def place(values: Array) -> None:
        a, way = values[:2], values[2:] - values[:2]
        length = float(np.hypot(*way)) or 1.0
        along = way / length
        feet = a + np.arange(0.5 * apart, length, apart)[:, None] * along
        stroke = 0.7 * apart * np.array([along[1] - along[0], -along[0] - along[1]])
        line.set_data(values[::2], values[1::2])
        strokes.set_segments(list(np.stack([feet, feet + stroke], axis=1)))

    return place


def _arrow(axes: Axes, motion: Motion, arrow: Arrow, room: Room, colours: Colours) -> Drawn:
    """A contact force: N along the normal, T along the normal turned clockwise."""
    from matplotlib.patches import FancyArrowPatch
    from matplotlib.patheffects import withStroke

    colour = colours.normal if arrow["kind"] == "N" else colours.friction
    shaft = FancyArrowPatch((0, 0), (0, 0), arrowstyle="->", mutation_scale=12, linewidth=2,
                            color=colour, shrinkA=0, shrinkB=0, zorder=5)  # fmt: skip
    axes.add_patch(shaft)
    halo = [withStroke(linewidth=3, foreground=colours.ground)]
    label = axes.text(0, 0, arrow["kind"], color=colour, fontsize=9, weight="bold", ha="center",
                      va="center", zorder=6, path_effects=halo)  # fmt: skip
    panel = motion["panels"][arrow["panel"]]
    values = panel["curves"][arrow["curve"]]["values"]
    side = room.sides[0]

    def draw(t: float) -> None:
        phase = _phase(motion, t)
        course = values[phase]
        force = 0.0 if course is None else _value(panel["times"][phase], course, t)
        length = ARROW * side * force / (motion["largest"] or 1.0)
        seen = abs(length) > SHORT * side
        shaft.set_visible(seen)
        label.set_visible(seen)
        x, y, nx, ny = columns_at(motion, t)[motion["shapes"][arrow["shape"]]["columns"]]
        along = np.array((nx, ny) if arrow["kind"] == "N" else (ny, -nx))
        tip = (x, y) + length * along
        shaft.set_positions((x, y), tip)
        label.set_position(tip + np.sign(length) * 0.055 * side * along)

    return draw


def _beside(axes: Axes, mark: Mark, room: Room, width: float) -> tuple[float, float]:
    """How far from a contact, in points, the middle of a text of a width stands on the side that
    the surface is on, within the picture."""
    x, _, nx, ny = mark["at"]
    aside = -12 * nx - (np.sign(nx) * width / 2 if abs(nx) > 0.5 else 0.0)
    whole = 72 * axes.bbox.width / axes.figure.dpi
    at = whole * (x - room.left) / (room.right - room.left)
    half = min(width, whole - 8) / 2
    kept = min(max(at + aside, half + 4), whole - half - 4) - at
    pushed = 2 * LINE if abs(nx) > 0.5 and abs(kept - aside) > 8 else 0  # back over the mechanism
    return kept, -16 * ny - pushed


def _hit(axes: Axes, motion: Motion, i: int, room: Room, colours: Colours) -> Drawn:
    """A hit: a ring that fades, its impulse, what is told for a while on the side of the surface,
    and a cross with its number on the other side."""
    from matplotlib.patches import FancyArrowPatch
    from matplotlib.patheffects import withStroke

    event: Event = motion["events"][i]
    halo = [withStroke(linewidth=3, foreground=colours.ground)]
    artists = []
    for k, mark in enumerate(event["marks"]):
        x, y, nx, ny = mark["at"]
        (cross,) = axes.plot([x], [y], "x", color=colours.hit, markersize=7, zorder=5)
        (ring,) = axes.plot([x], [y], "o", color=colours.hit, fillstyle="none", zorder=5)
        text: dict[str, Any] = {"textcoords": "offset points", "va": "center", "ha": "center",
                                "color": colours.hit, "fontsize": 9, "path_effects": halo,
                                "zorder": 6}  # fmt: skip
        words = f"{i + 1} {mark['told']}"
        aside, down = _beside(axes, mark, room, WIDE * len(words))
        down -= LINE * k  # a line of its own for each contact
        label = axes.annotate(words, (x, y), (aside, down), parse_math=False, **text)
        number = axes.annotate(str(i + 1), (x, y), (12 * nx, 13 * ny), **text)
        # The direction and the size of the impulse; one that would hardly be seen is not drawn.
        way = ARROW * room.sides[0] * np.array(mark["impulse"])
        long = float(np.hypot(*way) > SHORT * room.sides[0])
        push = FancyArrowPatch((x, y), (x + way[0], y + way[1]), arrowstyle="-|>", alpha=long,
                               mutation_scale=13, color=colours.hit, linewidth=2.2, shrinkA=0,
                               shrinkB=0, zorder=5)  # fmt: skip
        axes.add_patch(push)
        artists.append((ring, cross, label, push, number))

    def draw(t: float) -> None:
        since = (t - event["time"]) / (TOLD * motion["duration"])
        for ring, cross, label, push, number in artists:
            for artist, seen in ((ring, since >= 0), (cross, since >= 0), (number, since >= 1),
                                 (label, 0 <= since < 1), (push, 0 <= since < 1)):  # fmt: skip
                artist.set_visible(seen)
            ring.set(alpha=min(max(1.0 - since, 0.0), 1.0), markersize=14 + 18 * min(since, 1.0))

    return draw
