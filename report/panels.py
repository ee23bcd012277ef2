"""Panels of curves over time, drawn with Matplotlib: with jumps, bounds, limits of friction and
impulses of the events."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from dmoc.base.tolerances import ROUNDING
from dmoc.motion.trajectory import Array, Collision, Trajectory
from dmoc.report.canvas import SMALL, legend_beside, plain_axes
from dmoc.report.curves import Panel, contacts_of
from dmoc.report.style import DOTS, Style

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

# The limits of friction are drawn up to this many times the largest force: beyond it they would
# flatten the curves.
FAR = 5.0
MARGIN = 0.05  # of the height, above a force that is constant
MARKED = 0.13  # share of the height that one mark of an impulse takes


def draw_panel(axes: Axes, panel: Panel, motion: Trajectory, style: Style) -> None:
    """Draw a panel with all that belongs to it, and a legend beside it."""
    handles = draw_curves(axes, panel, motion.collisions, style)
    if panel.quantity not in "NT" and len(handles) == 1:
        handles = []
    if panel.quantity in ("u", "v", "quantities"):
        handles += _bounds(axes, panel, style)
    if panel.quantity in "NT":
        low, high = axes.get_ylim()
        limits = min(low, 0.0), high + MARGIN * (high - min(low, 0.0))
        if panel.quantity == "T":
            far = FAR * _largest(panel) or np.inf
            handles += _limits(axes, panel, motion, far, style)
            low, high = axes.get_ylim()
            limits = max(low, -far), min(high, far)
        _impulses(axes, panel, motion, limits, style)
    if handles:
        legend_beside(axes, handles)


def draw_curves(
    axes: Axes, panel: Panel, events: Sequence[Collision], style: Style
) -> list[Artist]:
    """Draw curves of the phases, joined by dots where states jump, and lines at the events; return
    one of each for a legend."""
    first: list[Artist] = []
    for place, curve in enumerate(panel.curves):
        stroke = style.stroke(curve.number, curve.number if curve.contact else place)
        parts = [(t, v) for t, v in zip(panel.times, curve.values, strict=True) if v is not None]
        lines = [
            axes.plot(*part, **stroke, **_dot(panel, part[0]), label=f"${curve.label.tex}$")[0]
            for part in parts
        ]
        first.append(lines[0])
        for (t, before), (_, after) in pairwise(parts) if panel.quantity in "vp" else ():
            look = {"color": stroke["color"], "linestyle": DOTS, "lw": 1.2, "gid": "jump"}
            axes.plot([t[-1]] * 2, [before[-1], after[0]], **look)
    for event in events:
        axes.axvline(event.time, color=style.muted, lw=0.8, ls=(0, (4, 3)), zorder=0)
    axes.set_ylabel(panel.axis)
    plain_axes(axes, style)
    return first


def _dot(panel: Panel, times: Array) -> dict[str, Any]:
    """Style of the dot that marks a state after the end."""
    jumps = panel.quantity in ("v", "p", "quantities") and len(times) == 1
    return {"marker": "o", "markersize": 3.5, "clip_on": False, "zorder": 4} if jumps else {}


def _dotted(style: Style, label: str) -> Artist:
    """Entry of the legend for dotted lines."""
    from matplotlib.lines import Line2D

    return Line2D([], [], color=style.muted, linestyle=DOTS, lw=1.2, label=label)


def _bounds(axes: Axes, panel: Panel, style: Style) -> list[Artist]:
    """Lines at bounds near the values; what else bounds the inputs as texts: a far line would
    flatten the curves."""
    from matplotlib.lines import Line2D

    values = np.concatenate([v for c in panel.curves for v in c.values if v is not None])
    low, high = float(values.min()), float(values.max())
    span = max(high - low, ROUNDING * max(abs(low), abs(high)))
    handles: list[Artist] = []
    near = False
    for curve in panel.curves:
        far = ["", ""]
        for side, bound in enumerate(curve.bounds):
            if low - span <= bound <= high + span:
                colour = style.stroke(curve.number, 0)["color"]
                axes.axhline(bound, color=colour, linestyle=DOTS, linewidth=1.2, gid="limit")
                near = True
            elif np.isfinite(bound):
                far[side] = rf"\leq {bound:g}" if side else rf"{bound:g}\leq "
        if any(far):
            text = f"${far[0]}{curve.label.tex}{far[1]}$"
            handles.append(Line2D([], [], linestyle="none", label=text))
    return [*handles, _dotted(style, "bounds")] if near else handles


def _largest(panel: Panel) -> float:
    return max(float(np.abs(v).max()) for c in panel.curves for v in c.values if v is not None)


def _limits(axes: Axes, panel: Panel, motion: Trajectory, far: float, style: Style) -> list[Artist]:
    """Draw the limits of friction as dotted lines behind it, and return entries of the legend, with
    the names of those that lie outside."""
    outside = []
    for curve in panel.curves:
        limits = [limit for limit in curve.limits if limit is not None]
        if min(limit.min() for limit in limits) > far:
            outside.append(curve.contact)
            continue
        colour = style.stroke(curve.number, 0)["color"]
        for t, limit in zip(panel.times, curve.limits, strict=True):
            for side in () if limit is None else (limit, -limit):
                axes.plot(t, side, color=colour, ls=DOTS, lw=1.2, zorder=1, gid="limit")
    kinds = {name in phase.closed for phase in motion.phases for name in phase.rubbing}
    label = " and ".join([r"$\pm\mu N$"] * (True in kinds) + [r"$\pm F$"] * (False in kinds))
    return [_dotted(style, label + (f" ({', '.join(outside)}: outside)" if outside else ""))]


def _impulses(
    axes: Axes, panel: Panel, motion: Trajectory, limits: tuple[float, float], style: Style
) -> None:
    """Marks at the events with the values of their impulses, above the curves; with the names of
    contacts that have no curve."""
    numbers, drawn = contacts_of(motion), {curve.contact for curve in panel.curves}
    rows = 0
    for event, impulses in zip(motion.collisions, panel.impulses, strict=True):
        right = event.time > 0.75 * motion.final_time
        for row, (name, value) in enumerate(impulses.items()):
            rows = max(rows, row + 1)
            place = (event.time, 1 - MARKED * (row + 0.5))
            across = axes.get_xaxis_transform()
            colour = style.stroke(numbers[name], 0)["color"]
            axes.plot(*place, "v", color=colour, ms=6, clip_on=False, transform=across)
            axes.annotate(
                f"{value:.3g}{'' if name in panel.grips else ' N s'}".replace("-", "\N{MINUS SIGN}")
                + ("" if name in drawn else f" of {name}"),
                place,
                xycoords=across,
                xytext=(-7 if right else 7, 0),
                textcoords="offset points",
                ha="right" if right else "left",
                va="center",
                fontsize=SMALL,
                color=colour,
                bbox={"facecolor": style.paper, "edgecolor": "none", "pad": 0.5},
            )
    low, high = limits
    axes.set_ylim(low, high + (high - low) * rows * MARKED / (1 - rows * MARKED))
