"""Figures of a sweep: the cost and the times of collisions over one value, or a map of the cost
over two."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dmoc.base.errors import ProblemError
from dmoc.motion.trajectory import Array
from dmoc.report.canvas import (
    SMALL,
    WIDTH,
    inked,
    legend_beside,
    new_figure,
    painted,
    plain_axes,
    written,
)
from dmoc.report.labels import math
from dmoc.report.style import DASHES, Style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MARKS = "osD^vP"  # of the points of curves
# Where unsolved points are marked in a panel, as a share of its height.
FOOT = 0.03


def plot_sweep(
    varied: Mapping[str, Array],
    cost: Array,
    final_time: Array,
    collision_times: Array,
    solved: NDArray[np.bool_],
    path: str | os.PathLike[str] | None = None,
    noun: str = "collision",
    *,
    style: str = "light",
) -> Figure:
    """Draw a sweep over one or two values, (n,) each; points that are not solved are crosses, and
    times are NaN where a row has fewer collisions. ``noun`` is what happens between phases."""
    if len(varied) not in (1, 2):
        raise ProblemError(
            f"the table varies {len(varied)} values ({', '.join(varied) or 'none'}): a figure "
            "shows 1 or 2; take to_csv or to_frame."
        )
    with painted(style, path) as colours:
        if len(varied) == 1:
            figure = _curves(varied, cost, final_time, collision_times, solved, noun, colours)
        else:
            figure = _map(varied, cost, solved, colours)
        return written(figure, path)


def _curves(
    varied: Mapping[str, Array],
    cost: Array,
    final_time: Array,
    collision_times: Array,
    solved: NDArray[np.bool_],
    noun: str,
    style: Style,
) -> Figure:
    [(name, values)] = varied.items()
    order = np.argsort(values, kind="stable")
    values, solved = values[order], solved[order]
    figure = new_figure(WIDTH, 5.2)
    above, below = figure.subplots(2, 1, sharex=True)
    times = collision_times[order].T

    def line(axes: Axes, y: Array, number: int, label: str | None = None) -> None:
        y = np.where(solved, y, np.nan)
        stroke = {**style.stroke(number, number), "marker": MARKS[number % len(MARKS)]}
        axes.plot(values, y, **stroke, lw=1.2, ms=3.5, label=label)

    line(above, cost[order], 0)
    for i, row in enumerate(times):
        line(below, row, i, f"{noun} {i + 1}")
    end = np.where(solved, final_time[order], np.nan)
    below.plot(values, end, color=style.muted, ls=DASHES[1], lw=1.2, marker="o", ms=3, label="end")
    for axes, label in ((above, "cost"), (below, "time [s]")):
        axes.set_ylabel(label)
        plain_axes(axes, style)
        if not solved.all():
            missing = values[~solved]
            axes.plot(
                missing, np.full(len(missing), FOOT), "x", color=style.alarm, ms=6,
                transform=axes.get_xaxis_transform(), label="not solved",
            )  # fmt: skip
    below.set_xlabel(math(name))
    below.set_ylim(bottom=0.0)
    legend_beside(below, below.get_legend_handles_labels()[0])
    return figure


def _map(
    varied: Mapping[str, Array], cost: Array, solved: NDArray[np.bool_], style: Style
) -> Figure:
    (name_x, x), (name_y, y) = varied.items()
    (places_x, column), (places_y, row) = (np.unique(v, return_inverse=True) for v in (x, y))
    grid = np.full((len(places_y), len(places_x)), np.nan)
    grid[row[solved], column[solved]] = cost[solved]
    figure = new_figure(7.0, 5.2)
    axes = figure.add_subplot()
    shown = axes.pcolormesh(_edges(places_x), _edges(places_y), grid, cmap="viridis")
    if solved.any():
        figure.colorbar(shown, ax=axes, label="cost")
    if not solved.all():
        axes.plot(x[~solved], y[~solved], "x", color=style.alarm, ms=6, label="not solved")
        axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), frameon=False, fontsize=SMALL)
    inked(axes, style)
    axes.set_xlabel(math(name_x))
    axes.set_ylabel(math(name_y))
    return figure


def _edges(places: Array) -> Array:
    """Edges of cells around places: half-way between neighbours."""
    if len(places) == 1:
        return np.array([places[0] - 0.5, places[0] + 0.5])
    half = np.diff(places) / 2
    low, high = places[:1] - half[:1], places[-1:] + half[-1:]
    return np.concatenate([low, places[:-1] + half, high])
