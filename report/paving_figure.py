"""The figure of a proof: boxes of durations with a bound of the cost in each."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from itertools import compress
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dmoc.motion.trajectory import Array
from dmoc.report.canvas import SMALL, WIDTH, inked, new_figure, painted, plain_axes, written
from dmoc.report.style import Style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import PolyCollection
    from matplotlib.figure import Figure

DEAREST = 2.0  # bounds above so many times the cost have one shade
HIGH = 4.4  # inches
MOST_EDGES = 4000  # boxes whose edges can still be seen
Bools = NDArray[np.bool_]


class Paved(NamedTuple):
    """Regions, arrays of the shape (corners, durations), their bounds, and which hold no motion or
    are open, shape (regions,); words for the first of these; names of the durations and the longest
    ones, shape (durations,); the least cost and where it is, shape (durations,), None where no
    motion is known."""

    regions: Sequence[Array]
    bound: Array
    empty: Bools
    open: Bools
    no_motion: str
    names: Sequence[str]
    longest: Array
    cost: float | None
    best: Array | None

    @property
    def dear(self) -> Bools:
        return ~self.empty & ~self.open


def plot_paving(
    paved: Paved, path: str | os.PathLike[str] | None = None, *, style: str = "light"
) -> Figure:
    """Draw the regions over one or two durations; write the figure if a path is given."""
    with painted(style, path) as colours:
        draw = _line if len(paved.names) == 1 else _plane
        figure = draw(paved, colours)
        _legend(figure, paved, colours)
        return written(figure, path)


def _looks(p: Paved, style: Style) -> Iterator[tuple[Bools, str, dict[str, Any]]]:
    """Regions without a bound that is shown, with their words."""
    yield p.empty, p.no_motion, {"fc": style.free, "ec": style.muted, "hatch": "////", "lw": 0.3}
    yield p.open, "not done", {"fc": style.paper, "ec": style.alarm, "hatch": "....", "lw": 0.3}


def _legend(figure: Figure, p: Paved, style: Style) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles: list[Any] = [
        Patch(**look, label=f"{words} ({which.sum()} boxes)")
        for which, words, look in _looks(p, style)
        if which.any()
    ]
    if p.best is not None:
        handles.insert(0, Line2D([], [], **_star(style), label=f"best motion, cost {p.cost:.6g}"))
    figure.legend(
        handles=handles, loc="outside upper center", ncols=3, frameon=False, fontsize=SMALL
    )


def _star(style: Style) -> dict[str, Any]:
    return {
        "marker": "*",
        "ms": 13,
        "mfc": style.paper,
        "mec": style.ink,
        "mew": 1.2,
        "ls": "",
        "clip_on": False,
    }


def _plane(p: Paved, style: Style) -> Figure:
    from matplotlib.colors import PowerNorm

    figure = new_figure(0.75 * WIDTH, HIGH)
    axes = figure.add_subplot()
    for which, _, look in _looks(p, style):
        axes.add_collection(_polygons(p, which, **look))
    if p.dear.any():
        least = p.bound[p.dear].min() if p.cost is None else p.cost
        lines = {"lw": 0.25, "ec": style.paper} if len(p.bound) < MOST_EDGES else {"ec": "face"}
        shades = PowerNorm(0.5, least, DEAREST * least)
        boxes = _polygons(p, p.dear, cmap="viridis", norm=shades, **lines)
        boxes.set_array(p.bound[p.dear])
        axes.add_collection(boxes)
        bar = figure.colorbar(boxes, ax=axes, label="cost at least", extend="max")
        inked(bar.ax, style)
    if p.best is not None:
        axes.plot(*p.best[:, None], **_star(style), zorder=3)
    inked(axes, style)
    right, top = p.longest
    axes.set(xlabel=p.names[0], ylabel=p.names[1], xlim=(0.0, right), ylim=(0.0, top))
    return figure


def _polygons(p: Paved, which: Bools, **look: Any) -> PolyCollection:
    from matplotlib.collections import PolyCollection

    return PolyCollection([*compress(p.regions, which)], **look)


def _line(p: Paved, style: Style) -> Figure:
    figure = new_figure(WIDTH, 0.75 * HIGH)
    axes: Axes = figure.add_subplot()
    ends = np.array([(region.min(), region.max()) for region in p.regions]).reshape(-1, 2)
    for which, _, look in _looks(p, style):
        for low, high in ends[which]:
            axes.axvspan(low, high, **look)
    axes.hlines(p.bound[p.dear], *ends[p.dear].T, color=style.colours[0], lw=1.6)
    if p.best is not None and p.cost is not None:
        axes.axhline(p.cost, color=style.muted, lw=0.8, ls="--")
        axes.plot(p.best, [p.cost], **_star(style), zorder=3)
    plain_axes(axes, style)
    axes.set(xlabel=p.names[0], ylabel="cost at least", xlim=(0.0, p.longest[0]))
    return figure
