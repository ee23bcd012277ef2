"""Snapshots of a scene: what a mechanism looks like at some times, all at one scale."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil
from typing import TYPE_CHECKING

import numpy as np

from dmoc.base.tolerances import SAME
from dmoc.motion.scene import Array, Scene, Shape
from dmoc.motion.trajectory import Trajectory
from dmoc.report.canvas import SMALL, inked
from dmoc.report.film import Take
from dmoc.report.labels import math, short
from dmoc.report.places import Room, flat_marks, room_of
from dmoc.report.poses import Pose, poses_of
from dmoc.report.shapes import SEEN, look_of, painter
from dmoc.report.solid_painter import draw_ground, draw_ways, solids
from dmoc.report.style import Style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.gridspec import SubplotSpec

SHOTS, FEW_SHOTS = 7, 5  # of each phase, equally spaced in time; of bodies in space
FAINT = 0.18  # strength of the first of them
# What has many strokes is drawn less often: a spring at every third time, a moving wall at both
# ends.
OFTEN = {"spring": 3, "wall": SHOTS - 1}
MARGIN, LEAST = 0.04, 0.08  # around everything, and the least side, in shares of the larger one
TALLEST, ROOMY = 4.2, 7.4  # inches that all snapshots may take in height, and take in width
ABOVE, BESIDE = 0.55, 0.45  # inches of a title, and of the numbers beside the axes
MOST = 12  # phases that are shown apart; more of them are shown together
CLEARLY = 1.15  # how much larger snapshots must become to be worth a row more
SMALLEST = 0.6  # inches of the height of a snapshot, at least
ARROW = 0.13  # length of the arrow of an impulse, in extents


@dataclass(frozen=True)
class SnapshotGrid:
    """Rows and columns of snapshots, and the height of all in inches."""

    rows: int
    columns: int
    height: float


def joined(scene: Scene) -> Scene:
    """The scene with a phase for each snapshot: its own, or one of all where they are many."""
    scene = _taking_time(scene)
    if len(scene.times) <= MOST:
        return scene
    return Scene(scene.shapes, (np.concatenate(scene.times),), (np.vstack(scene.values),))


def _taking_time(scene: Scene) -> Scene:
    """The scene without the state after an event that ends the motion."""
    if len(scene.times[-1]) > 1:
        return scene
    return Scene(scene.shapes, scene.times[:-1], scene.values[:-1])


def layout_of(scene: Scene) -> SnapshotGrid:
    """The arrangement in which the snapshots are largest."""
    count = len(poses_of(_taking_time(scene))) or len(joined(scene).times)
    width, height = window_of([scene]).sides
    best, largest = SnapshotGrid(1, count, 0.0), 0.0
    for columns in range(count, 0, -1):
        rows = ceil(count / columns)
        zoom = min(
            (ROOMY / columns - BESIDE) / width, max(TALLEST / rows - ABOVE, SMALLEST) / height
        )
        if zoom > CLEARLY * largest:
            each = max(zoom * height, SMALLEST)
            best, largest = SnapshotGrid(rows, columns, rows * (each + ABOVE) + 0.3), zoom
    return best


def window_of(scenes: Sequence[Scene]) -> Room:
    """The part of the plane that snapshots show."""
    return room_of(scenes, MARGIN, LEAST)


def draw_snapshots(figure: Figure, place: SubplotSpec, take: Take, style: Style) -> None:
    """Draw all phases, each with what happens at its end, or the poses of a motion that stays."""
    layout, window, trajectory = layout_of(take.scene), window_of([take.scene]), take.trajectory
    apart = len(_taking_time(take.scene).times) <= MOST
    scene, poses = joined(take.scene), poses_of(_taking_time(take.scene))
    grid = place.subgridspec(layout.rows, layout.columns)
    first: Axes | None = None
    for k in range(len(poses) or len(scene.times)):
        axes = figure.add_subplot(grid[k // layout.columns, k % layout.columns])
        _look_through(axes, window)
        if scene.in_space:
            _ground(axes, take, window, style, not poses)
        if poses:
            _pose(axes, take, poses[k], style, window)
        else:
            _phase(axes, scene, k, style, window)
            if apart:
                _impulses(axes, take, k, style, window)
            axes.set_title(_title(trajectory, k if apart else None), fontsize=SMALL)
        _frame(axes, trajectory, style, first)
        first = first or axes


def height_of(scenes: Sequence[Scene], width: float) -> float:
    """Height in inches of axes through which motions are seen at a width."""
    wide, tall = window_of(scenes).sides
    return max(width * tall / wide, SMALLEST)


def draw_motions(places: Sequence[Axes], takes: Sequence[Take], style: Style) -> None:
    """Draw whole motions, each into axes of its own, all at one scale."""
    window = window_of([take.scene for take in takes])
    for axes, take in zip(places, takes, strict=True):
        _look_through(axes, window)
        scene = _taking_time(take.scene)
        if scene.in_space:
            _ground(axes, take, window, style)
        for phase in range(len(scene.times)):
            _phase(axes, scene, phase, style, window)
            _impulses(axes, take, phase, style, window)
        _frame(axes, take.trajectory, style, None if axes is places[0] else places[0])


def _look_through(axes: Axes, window: Room) -> None:
    axes.set(xlim=window[:2], ylim=window[2:4])
    axes.set_aspect("equal", adjustable="box")


def _frame(axes: Axes, trajectory: Trajectory, style: Style, first: Axes | None) -> None:
    """Numbers on the axes where they are lengths; a drawing made from coordinates has none."""
    if trajectory.scene is None or trajectory.scene.in_space:
        axes.set_axis_off()
        return
    axes.spines[["top", "right"]].set_visible(False)
    inked(axes, style)
    axes.tick_params(labelsize=7)
    unit = length_unit(trajectory)
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    axes.locator_params(axis="x", nbins=5)
    axes.locator_params(axis="y", nbins=5 if high - low > 0.3 * (right - left) else 2)
    if first is None:
        axes.set_ylabel(unit and f"[{unit}]", fontsize=SMALL)
    axes.set_xlabel(unit and f"[{unit}]", fontsize=SMALL)


def length_unit(trajectory: Trajectory) -> str:
    """The unit of the lengths of a model, where it has but one."""
    lengths = {unit for unit in trajectory.units.values() if unit in ("m", "cm", "mm", "km")}
    return lengths.pop() if len(lengths) == 1 else ""


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


def _ground(axes: Axes, take: Take, window: Room, style: Style, ways: bool = True) -> None:
    """The ground of space, with the distance of its lines, and the ways of masses."""
    if window.camera is None:
        return
    step = draw_ground(axes, take.scene, window.camera, style)
    if ways:
        draw_ways(axes, take.scene, window.camera, {"color": style.muted, "linewidth": 0.6})
    if unit := length_unit(take.trajectory):
        words = f"grid {short(step)} {unit}"
        axes.text(1, 0, words, color=style.muted, fontsize=7, ha="right", transform=axes.transAxes)


def _pose(axes: Axes, take: Take, pose: Pose, style: Style, window: Room) -> None:
    """One pose of a motion that stays, with its time and the event that it is at."""
    title = f"{pose.time:.3g} s"
    if window.camera:
        values = take.scene.values[pose.phase][pose.row]
        solids(axes, take.scene, window.camera, style)(values)
    if pose.last and pose.phase < len(take.events):
        _impulses(axes, take, pose.phase, style, window)
        title += f": {take.trajectory.collisions[pose.phase].word}"
    axes.set_title(title, fontsize=SMALL)


def _phase(axes: Axes, scene: Scene, phase: int, style: Style, window: Room) -> None:
    """Draw a phase: shapes that stand still once, those that move at times from faint to full, and
    the ways of masses."""
    t, extent = scene.times[phase], max(window.sides)
    shots = FEW_SHOTS if scene.in_space else SHOTS
    rows = np.unique(np.searchsorted(t, np.linspace(t[0], t[-1], shots)).clip(max=len(t) - 1))
    if scene.in_space and window.camera:
        for row in rows:
            share = (t[row] - t[0]) / (t[-1] - t[0])
            strength = FAINT + (1 - FAINT) * share**1.5
            solids(axes, scene, window.camera, style, strength)(scene.values[phase][row])
        return
    for shape in scene.shapes:
        if shape.kind not in SEEN:
            continue
        values = scene.of(shape, phase)
        still = _stands_still(scene, shape, extent)
        if shape.kind in ("point", "disc") and not still:
            axes.plot(*values[:, :2].T, color=style.muted, linewidth=0.6, zorder=1.5)
        for row in rows[-1:] if still else rows[:: OFTEN.get(shape.kind, 1)]:
            share = (t[row] - t[0]) / (t[-1] - t[0])
            strength = 1.0 if still else FAINT + (1 - FAINT) * share**1.5
            look = look_of(style, extent, strength=strength, still=still)
            painter(axes, scene, shape, look)(values[row])
        if shape.name and still:
            _label(axes, shape, values[-1], style)


def _stands_still(scene: Scene, shape: Shape, extent: float) -> bool:
    """Whether a shape is the same along the whole motion, in a picture of some size."""
    values = np.vstack([scene.of(shape, phase) for phase in range(len(scene.times))])
    sizes = np.maximum(np.abs(values).max(axis=0), extent)
    if shape.kind in ("disc", "box"):
        sizes[-1] = 1.0  # an angle
    return bool((np.ptp(values, axis=0) <= SAME * sizes).all())


def _label(axes: Axes, shape: Shape, values: Array, style: Style) -> None:
    """The name of what stands still, on its left."""
    x = values[0] - (values[2] if shape.kind == "disc" else 0.0)
    axes.annotate(
        math(shape.name), (x, values[1]), xytext=(-6, 0), textcoords="offset points",
        ha="right", va="center", fontsize=SMALL, color=style.ink,
    )  # fmt: skip


def _impulses(axes: Axes, take: Take, phase: int, style: Style, window: Room) -> None:
    """Arrows where and in which direction the surfaces of the event at the end push."""
    extent = max(window.sides)
    marks = take.events[phase]["marks"] if phase < len(take.events) else []
    for mark in flat_marks(marks, window.camera if take.scene.in_space else None):
        way = mark["impulse"]
        size = float(np.hypot(*way))
        if size:
            x, y = mark["at"][:2].tolist()
            dx, dy = (ARROW * extent / size * way).tolist()
            axes.annotate(
                "", (x + dx, y + dy), (x, y), annotation_clip=False, zorder=5,
                arrowprops={"arrowstyle": "-|>", "color": style.hit, "linewidth": 1.4,
                            "shrinkA": 0, "shrinkB": 0},
            )  # fmt: skip
