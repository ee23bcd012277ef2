"""Snapshots of a scene: what a mechanism looks like at some times, all at one scale."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import ceil, cos, sin
from typing import TYPE_CHECKING, Any

import numpy as np

from dmoc.motion.scene import Array, Scene, Shape
from dmoc.motion.trajectory import Trajectory
from dmoc.report.canvas import SMALL, inked, symbol
from dmoc.report.style import Style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.gridspec import SubplotSpec

SHOTS = 7  # of each phase, equally spaced in time
FAINT = 0.18  # strength of the first of them
# What has many strokes is drawn less often: a spring at every third time, a moving wall at both
# ends.
OFTEN = {"spring": 3, "wall": SHOTS - 1}
MARGIN = 0.06  # of the extent, around it
TALLEST, ROOMY = 4.2, 7.4  # inches that all snapshots may take in height, and take in width
ABOVE, BESIDE = 0.55, 0.45  # inches of a title, and of the numbers beside the axes
MOST = 12  # phases that are shown apart; more of them are shown together
CLEARLY = 1.15  # how much larger snapshots must become to be worth a row more
SMALLEST = 0.6  # inches of the height of a snapshot, at least
COILS = 6  # of a spring
HATCH = 0.03  # distance of the strokes behind a wall, in extents
ARROW = 0.13  # length of the arrow of an impulse, in extents


@dataclass(frozen=True)
class Layout:
    """Rows and columns of snapshots, and the height of all in inches."""

    rows: int
    columns: int
    height: float


def extent_of(scene: Scene) -> tuple[Array, Array]:
    """Lowest and highest point of all shapes along the whole motion, each of shape (2,)."""
    found = []
    for shape in scene.shapes:
        for phase in range(len(scene.times)):
            values = scene.of(shape, phase)
            if shape.kind in ("link", "spring", "wall"):
                found.append(values.reshape(-1, 2))
            elif shape.kind in ("disc", "box"):
                half = values[:, 2:3] if shape.kind == "disc" else _half(values)
                found += [values[:, :2] - half, values[:, :2] + half]
            elif shape.kind == "point":
                found.append(values)
    points = np.vstack(found) if found else np.zeros((1, 2))
    return points.min(axis=0), points.max(axis=0)


def _half(boxes: Array) -> Array:
    """Half the widths and heights of what encloses turned boxes, shape (n, 2)."""
    w, h, angle = boxes[:, 2:].T
    c, s = np.abs(np.cos(angle)), np.abs(np.sin(angle))
    return np.stack([c * w + s * h, s * w + c * h], axis=1) / 2


def joined(scene: Scene) -> Scene:
    """The scene with a phase for each snapshot: its own, or one of all where they are many."""
    if len(scene.times) <= MOST:
        return scene
    return Scene(scene.shapes, (np.concatenate(scene.times),), (np.vstack(scene.values),))


def layout_of(scene: Scene) -> Layout:
    """The arrangement in which the snapshots are largest."""
    scene = joined(scene)
    count, (width, height) = len(scene.times), _size(scene)
    best, largest = Layout(1, count, 0.0), 0.0
    for columns in range(count, 0, -1):
        rows = ceil(count / columns)
        scale = min(
            (ROOMY / columns - BESIDE) / width, max(TALLEST / rows - ABOVE, SMALLEST) / height
        )
        if scale > CLEARLY * largest:
            each = max(scale * height, SMALLEST)
            best, largest = Layout(rows, columns, rows * (each + ABOVE) + 0.3), scale
    return best


def _size(scene: Scene) -> tuple[float, float]:
    """Width and height of the window on a scene."""
    (left, right), (low, high) = window_of([scene])
    return right - left, high - low


def window_of(scenes: Iterable[Scene]) -> tuple[tuple[float, float], tuple[float, float]]:
    """Limits in x and y around all of some scenes, with a margin; neither way much narrower than
    the other."""
    ends = [extent_of(scene) for scene in scenes]
    low = np.min([end[0] for end in ends], axis=0)
    high = np.max([end[1] for end in ends], axis=0)
    half = (0.5 + MARGIN) * np.maximum(high - low, 0.08 * max(*(high - low), 1e-12))
    (left, bottom), (right, top) = (low + high) / 2 - half, (low + high) / 2 + half
    return (float(left), float(right)), (float(bottom), float(top))


def draw_snapshots(
    figure: Figure, place: SubplotSpec, scene: Scene, trajectory: Trajectory, style: Style
) -> None:
    """Draw all phases, each with what happens at its end."""
    layout, window, unit = layout_of(scene), window_of([scene]), max(_size(scene))
    apart = len(scene.times) <= MOST
    scene = joined(scene)
    grid = place.subgridspec(layout.rows, layout.columns)
    first: Axes | None = None
    for phase in range(len(scene.times)):
        axes = figure.add_subplot(grid[phase // layout.columns, phase % layout.columns])
        _look_through(axes, window)
        _phase(axes, scene, phase, style, unit)
        if apart and phase < len(trajectory.collisions):
            _impulses(axes, scene, trajectory, phase, style, unit)
        axes.set_title(_title(trajectory, phase if apart else None), fontsize=SMALL)
        _frame(axes, trajectory, style, first)
        first = first or axes


def height_of(scenes: Sequence[Scene], width: float) -> float:
    """Height in inches of axes through which motions are seen at a width."""
    (left, right), (low, high) = window_of(scenes)
    return max(width * (high - low) / (right - left), SMALLEST)


def draw_motions(
    places: Sequence[Axes], motions: Sequence[tuple[Scene, Trajectory]], style: Style
) -> None:
    """Draw whole motions, each into axes of its own, all at one scale."""
    window = window_of([scene for scene, _ in motions])
    unit = max(high - low for low, high in window)
    first: Axes | None = None
    for axes, (scene, trajectory) in zip(places, motions, strict=True):
        _look_through(axes, window)
        for phase in range(len(scene.times)):
            _phase(axes, scene, phase, style, unit)
            if phase < len(trajectory.collisions):
                _impulses(axes, scene, trajectory, phase, style, unit)
        _frame(axes, trajectory, style, first)
        first = first or axes


def _look_through(axes: Axes, window: tuple[tuple[float, float], tuple[float, float]]) -> None:
    axes.set_xlim(*window[0])
    axes.set_ylim(*window[1])
    axes.set_aspect("equal", adjustable="box")


def _frame(axes: Axes, trajectory: Trajectory, style: Style, first: Axes | None) -> None:
    """Numbers on the axes where they are lengths; a drawing made from coordinates has none."""
    if trajectory.scene is None:
        axes.set_axis_off()
        return
    axes.spines[["top", "right"]].set_visible(False)
    inked(axes, style)
    axes.tick_params(labelsize=7)
    unit = _length(trajectory)
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    axes.locator_params(axis="x", nbins=5)
    axes.locator_params(axis="y", nbins=5 if high - low > 0.3 * (right - left) else 2)
    if first is None:
        axes.set_ylabel(unit, fontsize=SMALL)
    axes.set_xlabel(unit, fontsize=SMALL)


def _length(trajectory: Trajectory) -> str:
    """The unit of the lengths of a model, where it has but one."""
    found = {unit for unit in trajectory.units.values() if unit in ("m", "cm", "mm", "km")}
    return f"[{found.pop()}]" if len(found) == 1 else ""


def _title(trajectory: Trajectory, phase: int | None) -> str:
    """Times of a phase and the event at its end, or of the whole motion."""
    if phase is None:
        return f"0 to {trajectory.final_time:.3g} s, {len(trajectory.collisions)} events"
    t = trajectory.phases[phase].t
    span = f"{t[0]:.3g} to {t[-1]:.3g} s"
    events = trajectory.collisions
    if phase < len(events):
        return f"{span},\nthen {events[phase].word}"
    return f"{span},\nafter {events[-1].word}" if events else span


def _phase(axes: Axes, scene: Scene, phase: int, style: Style, unit: float) -> None:
    """What stands still once, what moves at times from faint to full, and the ways of masses."""
    t = scene.times[phase]
    rows = np.unique(np.searchsorted(t, np.linspace(t[0], t[-1], SHOTS)).clip(max=len(t) - 1))
    for shape in scene.shapes:
        if shape.kind == "contact":
            continue
        values = scene.of(shape, phase)
        still = _stands_still(scene, shape)
        if shape.kind in ("point", "disc") and not still:
            axes.plot(*values[:, :2].T, color=style.muted, linewidth=0.6, zorder=1.5)
        for row in rows[-1:] if still else rows[:: OFTEN.get(shape.kind, 1)]:
            share = (t[row] - t[0]) / (t[-1] - t[0])
            strength = 1.0 if still else FAINT + (1 - FAINT) * share**1.5
            draw_shape(axes, shape, values[row], style, unit, strength, still)


def _stands_still(scene: Scene, shape: Shape) -> bool:
    """Whether a shape is the same along the whole motion."""
    values = np.vstack([scene.of(shape, phase) for phase in range(len(scene.times))])
    return bool((np.ptp(values, axis=0) <= 1e-9 * (1 + np.abs(values).max(axis=0))).all())


def draw_shape(
    axes: Axes,
    shape: Shape,
    values: Array,
    style: Style,
    unit: float,
    strength: float = 1.0,
    still: bool = False,
) -> None:
    """Draw a shape from its values at one time.

    ``unit`` is the extent of the scene, ``strength`` 0 what cannot be seen and 1 in full.
    """
    blue, red = (_mixed(colour, style.paper, strength) for colour in style.colours[:2])
    colour = style.muted if still else blue
    order = 2 + strength
    match shape.kind:
        case "link":
            axes.plot(*values.reshape(-1, 2).T, color=colour, linewidth=1.8, zorder=order)
        case "point":
            axes.plot(*values, "o", color=red, markersize=6, markeredgewidth=0, zorder=order + 0.2)
        case "spring":
            axes.plot(*_coils(values, 0.03 * unit), color=colour, linewidth=1.2, zorder=order)
        case "wall":
            _wall(axes, values, style, unit)
        case _:
            corners = _round(values) if shape.kind == "disc" else _corners(values)
            inside = _mixed(colour, style.paper, 0.25)
            fill: dict[str, Any] = {
                "facecolor": inside if strength == 1 else "none",
                "edgecolor": colour,
            }
            axes.fill(*corners.T, **fill, linewidth=1.2, zorder=order)
            if shape.kind == "disc" and values[3]:
                x, y, r, angle = values
                spoke = ([x, x + r * cos(angle)], [y, y + r * sin(angle)])
                axes.plot(*spoke, color=colour, linewidth=1.2, zorder=order)
    if shape.name and still:
        _label(axes, shape, values, style)


def _label(axes: Axes, shape: Shape, values: Array, style: Style) -> None:
    """The name of what stands still, on its left."""
    x = values[0] - (values[2] if shape.kind == "disc" else 0.0)
    axes.annotate(
        f"${symbol(shape.name)}$", (x, values[1]), xytext=(-6, 0), textcoords="offset points",
        ha="right", va="center", fontsize=SMALL, color=style.ink,
    )  # fmt: skip


def _mixed(colour: str, paper: str, strength: float) -> str:
    """A colour mixed with that of the paper: opaque, so that overlaps do not look like more."""
    from matplotlib.colors import to_hex, to_rgb

    a, b = np.array(to_rgb(colour)), np.array(to_rgb(paper))
    return to_hex(tuple((strength * a + (1 - strength) * b).tolist()))


def _round(disc: Array) -> Array:
    x, y, r, _ = disc
    around = np.linspace(0, 2 * np.pi, 49)
    return np.stack([x + r * np.cos(around), y + r * np.sin(around)], axis=1)


def _corners(box: Array) -> Array:
    x, y, w, h, angle = box
    corners = np.array([(-w, -h), (w, -h), (w, h), (-w, h), (-w, -h)]) / 2
    c, s = cos(angle), sin(angle)
    return np.asarray(corners @ np.array([(c, s), (-s, c)]) + (x, y))


def _coils(ends: Array, width: float) -> tuple[Array, Array]:
    """A zigzag from one end to the other, straight near both."""
    a, b = ends[:2], ends[2:]
    along = b - a
    across = np.array([-along[1], along[0]]) / max(float(np.hypot(*along)), 1e-300)
    places = np.concatenate([[0.0], np.linspace(0.12, 0.88, 2 * COILS + 1), [1.0]])
    side = np.concatenate([[0.0, 0.0], np.tile([1.0, -1.0], COILS)[: 2 * COILS - 1], [0.0, 0.0]])
    x, y = a[:, None] + along[:, None] * places + width * across[:, None] * side
    return x, y


def _wall(axes: Axes, ends: Array, style: Style, unit: float) -> None:
    """A line with strokes on its solid side, the right one."""
    a, b = ends[:2], ends[2:]
    length = float(np.hypot(*(b - a)))
    axes.plot(*np.stack([a, b]).T, color=style.muted, linewidth=1.6, zorder=1)
    if length <= 0:
        return
    along = (b - a) / length
    right = np.array([along[1], -along[0]])
    step = HATCH * unit
    starts = a + along * (np.arange(0.5, length / step) * step)[:, None]
    lines: Any = np.stack([starts, starts + step * (right - along) / 1.6], axis=1)
    from matplotlib.collections import LineCollection

    strokes = LineCollection(lines, colors=style.muted, linewidths=0.7, zorder=1, clip_on=False)
    axes.add_collection(strokes, autolim=False)


def _impulses(
    axes: Axes, scene: Scene, trajectory: Trajectory, phase: int, style: Style, unit: float
) -> None:
    """Arrows where and in which direction the surfaces of the event at the end push."""
    event = trajectory.collisions[phase]
    hit = {*event.impulses, event.hit} if not event.grazes else {event.surface}
    for contact in scene.contacts:
        if contact.name not in hit:
            continue
        x, y, nx, ny = scene.of(contact, phase)[-1]
        tip = (x + ARROW * unit * nx, y + ARROW * unit * ny)
        axes.annotate(
            "", tip, (x, y), annotation_clip=False, zorder=5,
            arrowprops={"arrowstyle": "-|>", "color": style.colours[1], "linewidth": 1.4,
                        "shrinkA": 0, "shrinkB": 0},
        )  # fmt: skip
