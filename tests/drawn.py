"""What figures of motions show."""

from __future__ import annotations

from dataclasses import replace

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

import dmoc
from dmoc.motion.trajectory import Trajectory


def drawn(solution: dmoc.Solution, **changes: object) -> Figure:
    """The figure of a motion with one part changed."""
    motion: Trajectory = replace(solution.trajectory, **changes)  # type: ignore[arg-type]
    return replace(solution, trajectory=motion).plot()


def labelled(figure: Figure, label: str) -> Axes:
    (axes,) = (a for a in figure.axes if a.get_ylabel() == label)
    return axes


def legend(axes: Axes) -> list[str]:
    key = axes.get_legend()
    return [] if key is None else [t.get_text() for t in key.get_texts()]


def limits(axes: Axes) -> list[Line2D]:
    return [a for a in axes.lines if a.get_gid() == "limit"]


def nothing_is_cut_off(figure: Figure) -> None:
    figure.canvas.draw()
    for axes in figure.axes:
        box = axes.get_tightbbox()
        assert box is not None
        assert figure.bbox.x0 <= box.x0 and box.x1 <= figure.bbox.x1, axes.get_ylabel()
        assert figure.bbox.y0 <= box.y0 and box.y1 <= figure.bbox.y1, axes.get_ylabel()
