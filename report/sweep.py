"""Figures of a sweep: the cost and the times of collisions over one value, or a map of the cost
over two."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dmoc.errors import ProblemError
from dmoc.report.canvas import new_figure, symbol, write
from dmoc.trajectory import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Colours that stay apart for colour-blind readers (Okabe & Ito 2008).
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
UNSOLVED = "#B00020"
# Where unsolved points are marked in a panel, as a share of its height.
FOOT = 0.03


def plot_sweep(
    given: Mapping[str, Array],
    cost: Array,
    final_time: Array,
    collision_times: Array,
    solved: NDArray[np.bool_],
    path: str | os.PathLike[str] | None = None,
    noun: str = "collision",
) -> Figure:
    """Draw a sweep over one or two values; points that are not solved are crosses.

    Parameters
    ----------
    given : mapping of str to array, shape (n,)
        What is varied.
    cost, final_time : array, shape (n,)
    collision_times : array, shape (n, most collisions)
        NaN where there are fewer.
    solved : array of bool, shape (n,)
    path : path, optional
        Where to write the figure; the ending decides the format (png, pdf, svg).
    noun : str
        What happens between the phases: "collision" or "event".

    Raises
    ------
    ProblemError
        If not one or two values are varied.
    MissingExtraError
        If Matplotlib is not installed.
    OutputError
        If the file cannot be written or its format is unknown.
    """
    if len(given) not in (1, 2):
        raise ProblemError(
            f"the table varies {len(given)} values ({', '.join(given) or 'none'}): a figure shows "
            "1 or 2; take to_csv or to_frame."
        )
    if len(given) == 1:
        figure = _curves(given, cost, final_time, collision_times, solved, noun)
    else:
        figure = _map(given, cost, solved)
    if path is not None:
        write(figure, Path(path))
    return figure


def _curves(
    given: Mapping[str, Array],
    cost: Array,
    final_time: Array,
    collision_times: Array,
    solved: NDArray[np.bool_],
    noun: str,
) -> Figure:
    [(name, values)] = given.items()
    order = np.argsort(values, kind="stable")
    values, solved = values[order], solved[order]
    figure = new_figure(7.0, 5.2)
    above, below = figure.subplots(2, 1, sharex=True)
    times = collision_times[order].T

    def line(axes: Axes, y: Array, colour: str, label: str = "", style: str = "-") -> None:
        y = np.where(solved, y, np.nan)
        axes.plot(
            values, y, color=colour, linestyle=style, lw=1.2, marker="o", ms=3, label=label or None
        )

    line(above, cost[order], COLOURS[0])
    for i, row in enumerate(times):
        line(below, row, COLOURS[i % len(COLOURS)], f"{noun} {i + 1}")
    line(below, final_time[order], "0.5", "end", "--")
    for axes, label in ((above, "cost"), (below, "time [s]")):
        axes.set_ylabel(label)
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(True, color="#e4e4e4", linewidth=0.6)
        axes.set_axisbelow(True)
        if not solved.all():
            missing = values[~solved]
            axes.plot(
                missing, np.full(len(missing), FOOT), "x", color=UNSOLVED, ms=6,
                transform=axes.get_xaxis_transform(), label="not solved",
            )  # fmt: skip
    below.set_xlabel(_label(name))
    below.set_ylim(bottom=0.0)
    below.legend(frameon=False, fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def _map(given: Mapping[str, Array], cost: Array, solved: NDArray[np.bool_]) -> Figure:
    (name_x, x), (name_y, y) = given.items()
    (places_x, column), (places_y, row) = (np.unique(v, return_inverse=True) for v in (x, y))
    grid = np.full((len(places_y), len(places_x)), np.nan)
    grid[row[solved], column[solved]] = cost[solved]
    figure = new_figure(7.0, 5.2)
    axes = figure.add_subplot()
    shown = axes.pcolormesh(_edges(places_x), _edges(places_y), grid, cmap="viridis")
    if solved.any():
        figure.colorbar(shown, ax=axes, label="cost")
    if not solved.all():
        axes.plot(x[~solved], y[~solved], "x", color=UNSOLVED, ms=6, label="not solved")
        axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), frameon=False, fontsize=8)
    axes.set_xlabel(_label(name_x))
    axes.set_ylabel(_label(name_y))
    return figure


def _edges(places: Array) -> Array:
    """Edges of cells around places: half-way between neighbours."""
    if len(places) == 1:
        return np.array([places[0] - 0.5, places[0] + 0.5])
    half = np.diff(places) / 2
    low, high = places[:1] - half[:1], places[-1:] + half[-1:]
    return np.concatenate([low, places[:-1] + half, high])


def _label(column: str) -> str:
    """The name of a column, with its last word as mathematics."""
    *words, name = column.split(" ")
    return " ".join([*words, f"${symbol(name)}$"])
