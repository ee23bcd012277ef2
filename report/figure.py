"""The figure of a motion: snapshots before and after the collisions, and over time positions,
momenta with their jumps, inputs with their bounds, modes and forces of contacts that last."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import TYPE_CHECKING

from dmoc.base.arguments import flag
from dmoc.base.errors import OutputError
from dmoc.motion.trajectory import Trajectory
from dmoc.report import contacts
from dmoc.report.canvas import WIDTH, new_figure, painted, plain_axes, written
from dmoc.report.default_drawing import scene_for
from dmoc.report.panels import panels_of
from dmoc.report.rounding import without_rounding
from dmoc.report.snapshots import draw_snapshots, layout_of
from dmoc.report.style import Style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FEW, HIGH, LOW = 4, 1.7, 1.35  # inches of a panel: of up to FEW of them, and of more


def plot(
    trajectory: Trajectory,
    path: str | os.PathLike[str] | None = None,
    *,
    velocities: bool = False,
    style: str = "light",
) -> Figure:
    """Draw a motion.

    Parameters
    ----------
    trajectory : Trajectory
    path : path, optional
        Where to write the figure; the ending decides the format (png, pdf, svg).
    velocities : bool, optional
        Draw the velocities too.
    style : {"light", "dark"}, optional

    Returns
    -------
    matplotlib Figure

    Raises
    ------
    MissingExtraError
        If Matplotlib is not installed.
    OutputError
        If the file cannot be written, its format is unknown, or there is no such style.
    """
    flag(velocities, "velocities", OutputError)
    with painted(style, path) as colours:
        return written(_drawn(trajectory, velocities, colours), path)


def _drawn(trajectory: Trajectory, velocities: bool, style: Style) -> Figure:
    scene = scene_for(trajectory)
    panels = panels_of(without_rounding(trajectory), velocities, style)
    snapshots, strip = layout_of(scene).height, contacts.strip_height(trajectory)
    each = HIGH if len(panels) <= FEW else LOW
    heights = [snapshots, *([strip] if strip else []), *[each] * len(panels)]
    figure = new_figure(WIDTH, sum(heights) + 0.6)
    grid = figure.add_gridspec(len(heights), 1, height_ratios=heights)
    draw_snapshots(figure, grid[0], scene, trajectory, style)
    curves = [figure.add_subplot(grid[i]) for i in range(len(heights) - len(panels), len(heights))]
    _draw_panels(curves, panels, trajectory, style)
    above = curves[0]
    if strip:
        above = figure.add_subplot(grid[1], sharex=curves[0])
        contacts.mode_strip(above, trajectory, style)
    contacts.event_names(above, trajectory, style)
    return figure


def _draw_panels(
    curves: list[Axes],
    panels: list[tuple[str, Callable[[Axes], None]]],
    trajectory: Trajectory,
    style: Style,
) -> None:
    """Panels with one axis of time."""
    for axes, (label, draw) in zip(curves, panels, strict=True):
        if axes is not curves[0]:
            axes.sharex(curves[0])
        if axes is not curves[-1]:
            axes.tick_params(labelbottom=False)
        draw(axes)
        axes.set_ylabel(label)
        plain_axes(axes, style)
        for collision in trajectory.collisions:
            axes.axvline(collision.time, color=style.muted, lw=0.8, ls=(0, (4, 3)), zorder=0)
    curves[-1].set_xlabel("time $t$ [s]")
    curves[-1].set_xlim(0.0, trajectory.final_time)
    curves[0].figure.align_ylabels(curves)
