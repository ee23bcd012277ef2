"""The figure of a fit: measured values, the fitted motion and its hits, and residuals."""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from dmoc.report.canvas import SMALL, WIDTH, legend_beside, new_figure, painted, plain_axes, written
from dmoc.report.labels import label_of, plain, rate_of
from dmoc.report.style import DOTS, Style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from dmoc.fitting.result import Fit, SensorFit

MOST_SENSORS, MOST_RUNS = 6, 6  # that are drawn
HIGH, LOW = 1.6, 1.1  # inches of a panel of values, and of one of residuals


def plot_fit(
    fit: Fit, path: str | os.PathLike[str] | None = None, *, style: str = "light"
) -> Figure:
    """Draw a fit; write it if a path is given, whose ending decides the format."""
    with painted(style, path) as colours:
        return written(_drawn(fit, colours), path)


def _drawn(fit: Fit, style: Style) -> Figure:
    names = list(dict.fromkeys(s.sensor for s in fit.sensors if s.sensor != "event"))
    names = names[:MOST_SENSORS] or ["event"]
    heights = [HIGH, LOW] * len(names)
    figure = new_figure(WIDTH, sum(heights) + 0.6)
    grid = figure.add_gridspec(len(heights), 1, height_ratios=heights)
    panels: list[Axes] = []
    for i in range(len(heights)):
        panels.append(figure.add_subplot(grid[i], sharex=panels[0] if panels else None))
    for k, name in enumerate(names):
        _values(panels[2 * k], fit, name, style)
        _residuals(panels[2 * k + 1], fit, name, style)
    for axes in panels[:-1]:
        axes.tick_params(labelbottom=False)
    panels[-1].set_xlabel("time $t$ [s]")
    figure.align_ylabels(panels)
    return figure


def _parts(fit: Fit, name: str) -> Iterator[tuple[int, SensorFit, slice]]:
    """The values of a sensor, run by run, with the number of the run."""
    runs, begin = list(fit.words), 0
    for s in fit.sensors:
        number = runs.index(s.run)
        if s.sensor == name and number < MOST_RUNS:
            yield number, s, slice(begin, begin + s.count)
        begin += s.count


def _values(axes: Axes, fit: Fit, name: str, style: Style) -> None:
    handles = []
    for number, s, at in _parts(fit, name):
        colour = style.colours[number % len(style.colours)]
        t, order = fit.t[at], np.argsort(fit.t[at], kind="stable")
        axes.plot(t, fit.measured[at], ".", color=colour, markersize=2.5, alpha=0.45)
        for part in np.split(order, np.searchsorted(t[order], fit.event_times[s.run])):
            (line,) = axes.plot(t[part], fit.predicted[at][part], color=colour, linewidth=1.3)
        line.set_label(plain(s.run))
        handles.append(line)
        _hits(axes, fit, s.run, style)
    axes.set_ylabel(f"${_tex(name)}$")
    plain_axes(axes, style)
    if len(handles) > 1:
        legend_beside(axes, handles)


def _residuals(axes: Axes, fit: Fit, name: str, style: Style) -> None:
    for number, s, at in _parts(fit, name):
        colour = style.colours[number % len(style.colours)]
        axes.plot(fit.t[at], fit.residual[at], ".", color=colour, markersize=2.5)
        _hits(axes, fit, s.run, style)
    for level in (-2, 2):
        axes.axhline(level, color=style.muted, linestyle=DOTS, linewidth=0.9)
    axes.set_ylabel("residual\n[noise]", fontsize=SMALL)
    plain_axes(axes, style)


def _hits(axes: Axes, fit: Fit, run: str, style: Style) -> None:
    """The events of a run as lines."""
    for time in fit.event_times[run]:
        axes.axvline(time, color=style.hit, linestyle=DOTS, linewidth=1.0)


def _tex(name: str) -> str:
    if name.endswith("_dot"):
        return rate_of(label_of(name.removesuffix("_dot"))).tex
    return label_of(name).tex
