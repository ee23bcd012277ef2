"""The figure of a motion: snapshots before and after the collisions, and over time positions,
momenta with their jumps, inputs with their bounds, modes and forces of contacts that last."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from dmoc.base.arguments import flag
from dmoc.base.errors import OutputError
from dmoc.motion.trajectory import Trajectory
from dmoc.report import mode_strip
from dmoc.report.canvas import WIDTH, new_figure, painted, written
from dmoc.report.film import Take
from dmoc.report.panels import draw_panel
from dmoc.report.snapshots import draw_snapshots, layout_of
from dmoc.report.style import Style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FEW, HIGH, LOW = 4, 1.7, 1.35  # inches of a panel: of up to FEW of them, and of more


def plot(
    trajectory: Trajectory,
    path: str | os.PathLike[str] | None = None,
    *,
    velocities: bool = False,
    style: str = "light",
) -> Figure:
    """Draw a motion; write it if a path is given, whose ending decides the format."""
    flag(velocities, "velocities", OutputError)
    with painted(style, path) as colours:
        return written(_drawn(trajectory, velocities, colours), path)


def _drawn(trajectory: Trajectory, velocities: bool, style: Style) -> Figure:
    take = Take("", trajectory)
    panels = [panel for panel in take.panels if velocities or panel.quantity != "v"]
    strip = mode_strip.strip_height(trajectory)
    each = HIGH if len(panels) <= FEW else LOW
    heights = [layout_of(take.scene).height, *([strip] if strip else []), *[each] * len(panels)]
    figure = new_figure(WIDTH, sum(heights) + 0.6)
    grid = figure.add_gridspec(len(heights), 1, height_ratios=heights)
    draw_snapshots(figure, grid[0], take, style)
    curves = [figure.add_subplot(grid[i]) for i in range(len(heights) - len(panels), len(heights))]
    for axes, panel in zip(curves, panels, strict=True):
        if axes is not curves[0]:
            axes.sharex(curves[0])
        if axes is not curves[-1]:
            axes.tick_params(labelbottom=False)
        draw_panel(axes, panel, trajectory, style)
    curves[-1].set_xlabel("time $t$ [s]")
    curves[-1].set_xlim(0.0, trajectory.final_time)
    figure.align_ylabels(curves)
    above = curves[0]
    if strip:
        above = figure.add_subplot(grid[1], sharex=curves[0])
        mode_strip.mode_strip(above, trajectory, style)
    mode_strip.event_names(above, trajectory, style)
    return figure
