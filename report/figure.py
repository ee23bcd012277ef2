"""The figure of a motion: snapshots before and after the collisions, positions, momenta with
their jumps, inputs with their bounds, modes and forces of contacts that last."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dmoc.report import contacts
from dmoc.report.canvas import entries_in_a_row, legend_above, new_figure, symbol, write
from dmoc.report.shapes import Shape
from dmoc.trajectory import Array, Phase, Trajectory

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = ("#1f4e79", "#c1440e", "#2e7d32", "#6a1b9a", "#8d6e00", "#00796b")
GREY = "#8a8a8a"
STILL = 1e-9  # of the range of the other coordinate
SNAPSHOTS = 8  # of each phase, equally spaced in time


def plot(
    trajectory: Trajectory, path: str | os.PathLike[str] | None = None, shape: Shape | None = None
) -> Figure:
    """Draw a motion.

    Parameters
    ----------
    trajectory : Trajectory
    path : path, optional
        Where to write the figure; the ending decides the format (png, pdf, svg).
    shape : callable, optional
        Picture of a position, from (q, parameters), for snapshots.

    Returns
    -------
    matplotlib Figure

    Raises
    ------
    MissingExtraError
        If Matplotlib is not installed.
    OutputError
        If the file cannot be written or its format is unknown.
    """
    draw = _panels(trajectory)
    panels, strip = len(draw), contacts.strip_height(trajectory) if trajectory.lasting else 0.0
    rows = panels + bool(strip) + (1 if shape else 0)
    figure = new_figure(7.0, 2.0 * panels + strip + (2.8 if shape else 0.4))
    ratios = ([1.5] if shape else []) + ([strip / 2.0] if strip else []) + [1.0] * panels
    grid = figure.add_gridspec(rows, len(trajectory.phases) if shape else 1, height_ratios=ratios)
    if shape:
        _snapshots(figure, grid, trajectory, shape)
    curves = [figure.add_subplot(grid[i, :]) for i in range(rows - panels, rows)]
    for axes in curves[1:]:
        axes.sharex(curves[0])
    for axes in curves[:-1]:
        axes.tick_params(labelbottom=False)
    for panel, axes in zip(draw, curves, strict=True):
        panel(axes, trajectory)
    curves[-1].set_xlabel("time $t$ [s]")
    curves[-1].set_xlim(0.0, trajectory.final_time)
    _collision_lines(curves, trajectory)
    if strip:
        above = figure.add_subplot(grid[rows - panels - 1, :], sharex=curves[0])
        contacts.mode_strip(above, trajectory)
    else:
        _collision_names(curves[0], trajectory)
    if path is not None:
        write(figure, Path(path))
    return figure


def _panels(trajectory: Trajectory) -> list[Callable[[Axes, Trajectory], None]]:
    """What draws the panels from top to bottom."""
    found: list[Callable[[Axes, Trajectory], None]] = [_positions, _momenta]
    if trajectory.inputs:
        found.append(_inputs)
    if trajectory.lasting and contacts.has_normal_forces(trajectory):
        found.append(_normal_forces)
    if contacts.has_friction(trajectory):
        found.append(_friction)
    return found


def _finish(axes: Axes, label: str) -> None:
    axes.set_ylabel(label)
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(True, color="#e4e4e4", linewidth=0.6)
    axes.set_axisbelow(True)


def _strokes(trajectory: Trajectory, count: int) -> list[tuple[str, str]]:
    """Colours and styles of some lines: those of contacts that last have others beside them."""
    colours = contacts.COLOURS if trajectory.lasting else COLOURS
    many = len(colours)
    return [(colours[i % many], ("-", "-.")[i // many % 2]) for i in range(count)]


def _legend(axes: Axes, trajectory: Trajectory, handles: Sequence[Artist], columns: int) -> None:
    """A legend where it hides least; above the axes where forces have theirs, or where it would
    not fit into them."""
    labels = [str(handle.get_label()) for handle in handles]
    if trajectory.lasting or columns > entries_in_a_row(labels):
        legend_above(axes, handles)
    else:
        axes.legend(handles=list(handles), loc="best", frameon=False, ncols=columns)


def _positions(axes: Axes, trajectory: Trajectory) -> None:
    """Coordinates; the second and later ones on an axis of their own if their ranges differ
    much."""
    q = np.vstack([p.q for p in trajectory.phases])
    spans = np.ptp(q, axis=0)
    apart = q.shape[1] == 2 and spans.max() > 3 * max(spans.min(), 1e-12)
    if trajectory.lasting:  # what a contact holds still moves by rounding errors alone
        apart = apart and spans.min() > STILL * spans.max()
    lines: list[Artist] = []
    strokes = _strokes(trajectory, len(spans))
    for i, (name, (colour, style)) in enumerate(zip(trajectory.coordinates, strokes, strict=True)):
        target = axes.twinx() if apart and i == 1 else axes
        for phase in trajectory.phases:
            (line,) = target.plot(
                phase.t, phase.q[:, i], color=colour, linestyle=style, label=f"${symbol(name)}$"
            )
        lines.append(line)
        if target is not axes:
            target.set_ylabel(f"${symbol(name)}$", color=colour)
            target.spines["top"].set_visible(False)
            target.tick_params(axis="y", colors=colour)
            axes.tick_params(axis="y", colors=strokes[0][0])
    label = f"${symbol(trajectory.coordinates[0])}$" if apart or q.shape[1] == 1 else "coordinates"
    _finish(axes, label)
    if apart:
        axes.yaxis.label.set_color(strokes[0][0])
        axes.grid(axis="y", visible=False)
    if q.shape[1] > 1 and not apart:
        _legend(axes, trajectory, lines, len(lines))


def _momenta(axes: Axes, trajectory: Trajectory) -> None:
    strokes = _strokes(trajectory, len(trajectory.coordinates))
    for i, (name, (colour, style)) in enumerate(zip(trajectory.coordinates, strokes, strict=True)):
        for k, phase in enumerate(trajectory.phases):
            axes.plot(
                phase.t,
                phase.p[:, i],
                color=colour,
                linestyle=style,
                label=f"$p_{{{symbol(name)}}}$" if k == 0 else None,
            )
        for before, after in pairwise(trajectory.phases):
            ends = (before.p[-1, i], after.p[0, i])
            axes.plot([before.t[-1]] * 2, ends, color=colour, linestyle=":", linewidth=1.2)
    _finish(axes, "momenta")
    lines = axes.get_legend_handles_labels()[0]
    _legend(axes, trajectory, lines, len(lines))


def _inputs(axes: Axes, trajectory: Trajectory) -> None:
    values = np.vstack([p.u for p in trajectory.phases])
    strokes = _strokes(trajectory, len(trajectory.inputs))
    for i, (name, (colour, style)) in enumerate(zip(trajectory.inputs, strokes, strict=True)):
        for k, phase in enumerate(trajectory.phases):
            label = f"${symbol(name)}$" if k == 0 else None
            if not trajectory.input_form.width:
                axes.stairs(
                    phase.u[:, i],
                    phase.t,
                    baseline=None,
                    color=colour,
                    linestyle=style,
                    label=label,
                    linewidth=1.5,
                )
            else:
                axes.plot(
                    trajectory.input_times(phase),
                    phase.u[:, i],
                    color=colour,
                    linestyle=style,
                    label=label,
                )
        name = f"${symbol(name)}$ " if len(trajectory.inputs) > 1 else ""
        for bound in trajectory.input_bounds[i]:
            if np.isfinite(bound):
                _bound(axes, bound, values, colour, name, i)
    _finish(
        axes, "inputs" if len(trajectory.inputs) > 1 else f"input ${symbol(trajectory.inputs[0])}$"
    )
    if len(trajectory.inputs) > 1:
        _legend(axes, trajectory, axes.get_legend_handles_labels()[0], 1)


def _bound(axes: Axes, bound: float, values: Array, colour: str, name: str, line: int) -> None:
    """A line where the bound is near the values, else a note of its value: a far one would
    flatten the curves."""
    low, high = float(values.min()), float(values.max())
    span = max(high - low, 1e-12)
    if low - span <= bound <= high + span:
        axes.axhline(bound, color=colour, linestyle="--", linewidth=0.9)
        return
    above = bound > high
    text = f"{name}upper bound {bound:g} \u2191" if above else f"{name}lower bound {bound:g} \u2193"
    place = 0.97 - 0.09 * line if above else 0.03 + 0.09 * line
    axes.annotate(
        text,
        (0.995, place),
        xycoords="axes fraction",
        ha="right",
        va="top" if above else "bottom",
        fontsize=8,
        color=GREY,
    )


def _normal_forces(axes: Axes, trajectory: Trajectory) -> None:
    contacts.normal_forces(axes, trajectory)
    _finish(axes, "normal forces [N]")


def _friction(axes: Axes, trajectory: Trajectory) -> None:
    contacts.friction_forces(axes, trajectory)
    _finish(axes, "friction [N]")


def _collision_lines(curves: list[Axes], trajectory: Trajectory) -> None:
    for collision in trajectory.collisions:
        for axes in curves:
            axes.axvline(collision.time, color=GREY, linewidth=0.8, linestyle=(0, (4, 3)), zorder=0)


def _collision_names(axes: Axes, trajectory: Trajectory) -> None:
    for collision in trajectory.collisions:
        axes.annotate(
            collision.word,
            (collision.time, 1.0),
            xycoords=("data", "axes fraction"),
            ha="center",
            va="bottom",
            fontsize=8,
            color=GREY,
        )


def _snapshots(figure: Figure, grid: object, trajectory: Trajectory, shape: Shape) -> None:
    from matplotlib.colors import to_rgba

    pictures = [
        [shape(q, trajectory.parameters) for q in _at_times(phase)] for phase in trajectory.phases
    ]
    points = np.vstack(
        [line for picture in pictures for shot in picture for line in (*shot.lines, *shot.bodies)]
    )
    low, high = points.min(axis=0), points.max(axis=0)
    margin = 0.08 * max(high - low)
    for i, picture in enumerate(pictures):
        axes = figure.add_subplot(grid[0, i])  # type: ignore[index]
        contact = picture[-1] if i < len(trajectory.collisions) else picture[0]
        for line in contact.limits:
            axes.plot(
                line[:, 0],
                line[:, 1],
                color="#b0b0b0",
                linewidth=2.5,
                solid_capstyle="butt",
                zorder=1,
            )
        for k, shot in enumerate(picture):
            strength = 0.2 + 0.8 * k / max(len(picture) - 1, 1)
            for line in shot.lines:
                axes.plot(
                    line[:, 0], line[:, 1], color=to_rgba(COLOURS[0], strength), linewidth=1.6
                )
            for line in shot.bodies if k in (0, len(picture) - 1) else ():
                axes.plot(
                    line[:, 0], line[:, 1], color=to_rgba(COLOURS[0], strength), linewidth=1.2
                )
            for x, y in shot.masses:
                axes.plot(
                    x, y, "o", color=to_rgba(COLOURS[1], strength), markersize=6, markeredgewidth=0
                )
        axes.set_xlim(low[0] - margin, high[0] + margin)
        axes.set_ylim(low[1] - margin, high[1] + margin)
        axes.set_aspect("equal", adjustable="box")
        axes.spines[["top", "right"]].set_visible(False)
        axes.tick_params(labelsize=7)
        axes.set_title(_phase_title(trajectory, i), fontsize=9)
        if i == 0:
            axes.set_ylabel("[m]", fontsize=8)
        axes.set_xlabel("[m]", fontsize=8)


def _phase_title(trajectory: Trajectory, i: int) -> str:
    phase = trajectory.phases[i]
    span = f"{phase.t[0]:.3g} to {phase.t[-1]:.3g} s"
    if not trajectory.collisions:
        return span
    where = (
        f"before {trajectory.collisions[i].word!r}"
        if i < len(trajectory.collisions)
        else f"after {trajectory.collisions[-1].word!r}"
    )
    return f"{where}: {span}"


def _at_times(phase: Phase) -> list[Array]:
    times = np.linspace(phase.t[0], phase.t[-1], SNAPSHOTS)
    return [np.array([np.interp(t, phase.t, column) for column in phase.q.T]) for t in times]
