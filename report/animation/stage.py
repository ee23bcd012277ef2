"""A mechanism at a time, drawn with Matplotlib: its shapes, hits and contact forces."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from dmoc.motion.trajectory import Array
from dmoc.report.camera import Camera
from dmoc.report.film import Arrow, EventMark, Take
from dmoc.report.labels import math, short
from dmoc.report.places import Room, flat_marks, phase_at, values_at
from dmoc.report.shapes import SEEN, Placed, look_of, painter
from dmoc.report.snapshots import length_unit
from dmoc.report.solid_painter import draw_ground, draw_ways, solids
from dmoc.report.style import Style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.patches import FancyArrowPatch
    from matplotlib.text import Annotation

ARROW = 0.22  # of the smaller side of the room: the largest contact force
SHORT = 0.015  # of that side: the shortest arrow that is drawn
NAMED = 0.055  # of that side: from the tip of an arrow to its name
SHOWN = 0.18  # of the whole time, for which a hit is told
WIDE, LINE = 5.2, 12  # points of a character of what is told, about, and of a line of it
WEIGHT = 1.5  # of lines, which are finer in figures

# Draws what is seen at a time.
Drawn = Callable[[float], None]


def stage_of(axes: Axes, take: Take, room: Room, style: Style) -> Drawn:
    """Draw a mechanism into axes; return what places it for a time."""
    motion, scene = take.trajectory, take.scene
    axes.set_axis_off()
    axes.set(xlim=room[:2], ylim=room[2:4])
    text: dict[str, Any] = {"transform": axes.transAxes, "parse_math": False}
    below = {**text, "va": "top", "fontsize": 10}
    clock = axes.text(0.02, -0.01, "", color=style.ink, **below)
    mode = axes.text(0.98, -0.01, "", color=style.muted, ha="right", **below)
    banner = axes.text(0.02, 0.94, "", color=style.hit, fontsize=10, **text)
    legend = f"longest arrow {short(take.largest)} N" if take.largest else ""
    axes.text(0.98, 0.98, legend, color=style.muted, fontsize=9, ha="right", va="top", **text)
    camera = room.camera if scene.in_space else None
    places = _solids(axes, take, camera, style) if camera else _shapes(axes, take, room, style)
    forces = [_force(axes, take, arrow, room, style) for arrow in take.arrows]
    hits = [_hit(axes, take, i, room, style) for i in range(len(take.events))]

    def draw(t: float) -> None:
        end = min(t, motion.final_time)
        values = values_at(scene, end)
        for place, own in places:
            place(values[own])
        for force in forces:
            force(end)
        for hit in hits:
            hit(t)
        clock.set_text(f"{end:.3f} s")
        mode.set_text(motion.phases[phase_at(scene, end)].mode if motion.lasting else "")
        banner.set_text(_banner_text(take, t))

    return draw


def _shapes(axes: Axes, take: Take, room: Room, style: Style) -> list[tuple[Placed, slice]]:
    """The shapes of a drawing in the plane, each with its columns, and the ways of masses."""
    scene, look = take.scene, look_of(style, max(room.sides), WEIGHT)
    places: list[tuple[Placed, slice]] = []
    for shape in scene.shapes:
        if shape.kind in ("point", "disc", "box"):
            for phase in range(len(scene.times)):
                way = scene.of(shape, phase).T[:2]
                axes.plot(*way, color=style.mass, linestyle=":", linewidth=1.2, alpha=0.7, zorder=1)
        if shape.kind in SEEN:
            own = slice(shape.start, shape.start + shape.size)
            places.append((painter(axes, scene, shape, look), own))
            if shape.name:
                label = _text(axes, math(shape.name), style.muted, (0, 6), zorder=6)
                places.append((partial(_move, label), own))
    return places


def _solids(axes: Axes, take: Take, camera: Camera, style: Style) -> list[tuple[Placed, slice]]:
    """The bodies of a drawing in space, on their ground, and their ways."""
    step = draw_ground(axes, take.scene, camera, style)
    if unit := length_unit(take.trajectory):
        words = f"grid {short(step)} {unit}"
        look: dict[str, Any] = {"color": style.muted, "fontsize": 9, "ha": "right"}
        axes.text(0.98, 0.02, words, transform=axes.transAxes, **look)
    draw_ways(axes, take.scene, camera, {"color": style.mass, "linestyle": ":", "linewidth": 1.2})
    return [(solids(axes, take.scene, camera, style), slice(None))]


def _banner_text(take: Take, t: float) -> str:
    """Words about the event that has just been, where its place is not known."""
    since = SHOWN * take.trajectory.final_time
    recent = [e for e in take.events if not e["marks"] and e["time"] <= t < e["time"] + since]
    return ": ".join(filter(None, (recent[-1]["word"], recent[-1]["told"]))) if recent else ""


def _text(
    axes: Axes, text: str, colour: str, beside: tuple[float, float], **look: Any
) -> Annotation:
    """A text beside a place, in points."""
    look = {"textcoords": "offset points", "color": colour, "fontsize": 9, "zorder": 6, **look}
    return axes.annotate(text, (0, 0), beside, **look)


def _move(label: Annotation, values: Array) -> None:
    label.xy = (float(values[0]), float(values[1]))


def _halo(style: Style) -> list[Any]:
    from matplotlib.patheffects import withStroke

    return [withStroke(linewidth=3, foreground=style.paper)]


def _arrow(axes: Axes, colour: str, head: str) -> FancyArrowPatch:
    from matplotlib.patches import FancyArrowPatch

    arrow = FancyArrowPatch((0, 0), (0, 0), arrowstyle=head, mutation_scale=12, linewidth=2,
                            color=colour, shrinkA=0, shrinkB=0, zorder=5)  # fmt: skip
    axes.add_patch(arrow)
    return arrow


def _force(axes: Axes, take: Take, arrow: Arrow, room: Room, style: Style) -> Drawn:
    """A contact force: N along the normal, T along the normal turned clockwise."""
    kind = arrow["kind"]
    colour = {"N": style.normal, "T": style.friction, "u": style.colours[4]}[kind]
    shaft = _arrow(axes, colour, "->")
    panel, shape = take.panels[arrow["panel"]], take.scene.shapes[arrow["shape"]]
    curve = panel.curves[arrow["curve"]]
    name, values = f"${curve.label.tex}$" if kind == "u" else kind, curve.values
    label = axes.text(0, 0, name, color=colour, fontsize=9, weight="bold", ha="center",
                      va="center", zorder=6, path_effects=_halo(style))  # fmt: skip
    side = min(room.sides)

    def draw(t: float) -> None:
        phase = phase_at(take.scene, t)
        course = values[phase]
        force = 0.0 if course is None else float(np.interp(t, panel.times[phase], course))
        length = ARROW * side * force / (arrow["largest"] or 1.0)
        at = values_at(take.scene, t)[shape.start : shape.start + shape.size]
        x, y, nx, ny = at if len(at) == 4 or room.camera is None else room.camera.flat(at)
        along = np.array((ny, -nx) if kind == "T" else (nx, ny))
        for artist in (shaft, label):
            artist.set_visible(abs(length) * np.hypot(nx, ny) > SHORT * side)
        tip = (x, y) + length * along
        shaft.set_positions((x, y), tip)
        beyond = tip + np.sign(length) * NAMED * side * along
        beside = tip + NAMED * side * np.array((along[1], -along[0]))
        label.set_position(beyond if _shown(room, beyond) else beside)

    return draw


def _shown(room: Room, place: Array) -> bool:
    """Whether the name of a force is seen at a place."""
    x, y = map(float, place)
    return room.left < x < room.right and room.bottom < y < room.top


def _beside(axes: Axes, mark: EventMark, room: Room, width: float) -> tuple[float, float]:
    """How far from a contact, in points, the middle of a text of a width stands on the side that
    the surface is on, within the picture."""
    x, _, nx, ny = mark["at"]
    aside = -12 * nx - (np.sign(nx) * width / 2 if abs(nx) > 0.5 else 0.0)
    whole = 72 * axes.bbox.width / axes.figure.dpi
    at = whole * (x - room.left) / room.sides[0]
    half = min(width, whole - 8) / 2
    kept = min(max(at + aside, half + 4), whole - half - 4) - at
    pushed = 2 * LINE if abs(nx) > 0.5 and abs(kept - aside) > 8 else 0  # back over the mechanism
    return kept, -16 * ny - pushed


def _hit(axes: Axes, take: Take, i: int, room: Room, style: Style) -> Drawn:
    """A hit: a ring that fades, its impulse, what is told for a while on the side of the surface,
    and a cross with its number on the other side."""
    event = take.events[i]
    look: dict[str, Any] = {"va": "center", "ha": "center", "path_effects": _halo(style),
                            "parse_math": False}  # fmt: skip
    artists = []
    for k, mark in enumerate(
        flat_marks(event["marks"], room.camera if take.scene.in_space else None)
    ):
        x, y, nx, ny = mark["at"]
        (cross,) = axes.plot([x], [y], "x", color=style.hit, markersize=7, zorder=5)
        (ring,) = axes.plot([x], [y], "o", color=style.hit, fillstyle="none", zorder=5)
        words = f"{i + 1} {mark['told']}"
        aside, down = _beside(axes, mark, room, WIDE * len(words))
        down -= LINE * k  # a line of its own for each contact
        label = _text(axes, words, style.hit, (aside, down), **look)
        number = _text(axes, str(i + 1), style.hit, (12 * nx, 13 * ny), **look)
        # The direction and the size of the impulse; one that would hardly be seen is not drawn.
        way = ARROW * min(room.sides) * mark["impulse"]
        push = _arrow(axes, style.hit, "-|>")
        push.set(alpha=float(np.hypot(*way) > SHORT * min(room.sides)))
        push.set_positions((x, y), (x + way[0], y + way[1]))
        for text in (label, number):
            _move(text, mark["at"])
        artists.append((ring, cross, label, push, number))

    def draw(t: float) -> None:
        since = (t - event["time"]) / (SHOWN * take.trajectory.final_time)
        for ring, cross, label, push, number in artists:
            for artist, seen in ((ring, since >= 0), (cross, since >= 0), (number, since >= 1),
                                 (label, 0 <= since < 1), (push, 0 <= since < 1)):  # fmt: skip
                artist.set_visible(seen)
            ring.set(alpha=min(max(1.0 - since, 0.0), 1.0), markersize=14 + 18 * min(since, 1.0))

    return draw
