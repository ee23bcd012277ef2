"""What the figures of the manual are drawn with: axes, arrows, texts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from dmoc.report.style import Style

WIDTH = 7.4  # inches


def empty_axes(style: Style, height: float, columns: int = 1) -> tuple[Figure, list[Axes]]:
    """A figure with empty axes side by side."""
    figure = Figure(figsize=(WIDTH, height), facecolor=style.paper, layout="constrained")
    axes = list(np.atleast_1d(figure.subplots(1, columns)))
    for a in axes:
        a.set_facecolor(style.paper)
        a.set_axis_off()
    return figure, axes


def arrow(axes: Axes, start: Sequence[float], end: Sequence[float], colour: str) -> None:
    look = {"arrowstyle": "-|>", "color": colour, "lw": 1.6, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", xy=tuple(end), xytext=tuple(start), arrowprops=look)


def write(axes: Axes, x: float, y: float, text: str, colour: str, **more: Any) -> None:
    axes.text(x, y, text, **{"color": colour, "fontsize": 10.5, "ha": "center", **more})


def frame(axes: Axes, style: Style, x: str, y: str) -> None:
    """Axes that are seen, with labels."""
    axes.set_axis_on()
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(style.muted)
    axes.tick_params(colors=style.muted, labelsize=8)
    axes.set_xlabel(x, color=style.ink, fontsize=10)
    axes.set_ylabel(y, color=style.ink, fontsize=10)
