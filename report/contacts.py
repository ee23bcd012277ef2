"""Panels of contacts that last: a strip of the modes with the events above it, the contact forces,
and friction in its cone, with the impulses of the events."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

import numpy as np

from dmoc.motion.trajectory import Array, Phase, Trajectory
from dmoc.report.canvas import LENGTH, SMALL, legend_beside, symbol
from dmoc.report.style import DOTS, Style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WIDE, HIGH = 0.064, 0.15  # inches of a character and of a line of small text
# The limits of friction are drawn up to this many times the largest force: beyond it they would
# flatten the curves.
FAR = 5.0
MARGIN = 0.05  # of the height, above a force that is constant
MOST_NAMED = 24  # events: the names of more would be a tower
MARKED = 0.13  # share of the height that one mark of an impulse takes


def strip_height(trajectory: Trajectory) -> float:
    """Height of the strip of modes in inches: a line for each contact of the longest one; 0 where
    contacts do not last."""
    if not trajectory.lasting:
        return 0.0
    return HIGH * max(len(phase.mode.split()) for phase in trajectory.phases) + 0.1


def mode_strip(axes: Axes, trajectory: Trajectory, style: Style) -> None:
    """Modes as colours, named where there is room and in a legend else."""
    modes = list(dict.fromkeys(phase.mode for phase in trajectory.phases if not phase.free))
    tints = {mode: style.tints[i % len(style.tints)] for i, mode in enumerate(modes)}
    tints["free"] = style.free
    per_second = LENGTH / trajectory.final_time
    named = set()
    for phase in trajectory.phases:
        axes.axvspan(phase.t[0], phase.t[-1], facecolor=tints[phase.mode], linewidth=0)
        words = phase.mode.split()
        if WIDE * max(map(len, words)) <= phase.duration * per_second:
            middle = (phase.t[0] + phase.t[-1]) / 2
            axes.text(
                middle, 0.5, "\n".join(words), ha="center", va="center_baseline", color=style.ink,
                fontsize=SMALL, transform=axes.get_xaxis_transform(), linespacing=1.0,
            )  # fmt: skip
            named.add(phase.mode)
    axes.set_ylabel("mode", fontsize=SMALL, rotation=0, ha="right", va="center")
    axes.set_yticks([])
    axes.set_ylim(0.0, 1.0)
    axes.spines[:].set_visible(False)
    axes.tick_params(axis="x", length=0, labelbottom=False)
    there = dict.fromkeys(phase.mode for phase in trajectory.phases)
    _legend_of_modes(axes, {mode: tints[mode] for mode in there if mode not in named}, style)


def _legend_of_modes(axes: Axes, tints: Mapping[str, str], style: Style) -> None:
    from matplotlib.patches import Patch

    if tints:
        edge = style.muted
        handles = [Patch(facecolor=tint, edgecolor=edge, label=m) for m, tint in tints.items()]
        axes.figure.legend(
            handles=handles, loc="outside lower center", ncols=3, frameon=False, fontsize=SMALL
        )


def event_names(axes: Axes, trajectory: Trajectory, style: Style) -> None:
    """Words of the events over their times, on lines of their own where they would overlap; those
    of very many are left out."""
    if len(trajectory.collisions) > MOST_NAMED:
        return
    per_second = LENGTH / trajectory.final_time
    ends: list[float] = []  # of the last word on each line, in inches
    for event in trajectory.collisions:
        half, at = WIDE * len(event.word) / 2, event.time * per_second
        # A word does not leave the axes.
        middle = min(max(at, half), max(LENGTH - half, half))
        line = next((k for k, end in enumerate(ends) if end <= middle - half), len(ends))
        ends[line : line + 1] = [middle + half + WIDE]
        axes.annotate(
            event.word,
            (middle / per_second, 1.0),
            xycoords=axes.get_xaxis_transform(),
            xytext=(0, 2 + 10 * line),
            textcoords="offset points",
            ha="center",
            va="bottom",
            fontsize=SMALL,
            color=style.ink,
        )


def contacts_of(trajectory: Trajectory) -> dict[str, int]:
    """All that touches along a motion, and its number."""
    names: dict[str, None] = {}
    for phase in trajectory.phases:
        names |= dict.fromkeys([*phase.closed, *phase.rubbing])
    for event in trajectory.collisions:
        names |= dict.fromkeys([*event.impulses, *event.tractions])
    return {name: i for i, name in enumerate(names)}


def has_normal_forces(trajectory: Trajectory) -> bool:
    """Whether a surface pushes in some phase."""
    return any(phase.closed for phase in trajectory.phases)


def has_friction(trajectory: Trajectory) -> bool:
    """Whether something rubs in some phase."""
    return any(phase.rubbing for phase in trajectory.phases)


def normal_forces(axes: Axes, trajectory: Trajectory, style: Style) -> None:
    """Normal forces over time, and the impulses of the events."""
    for name, number in contacts_of(trajectory).items():
        label: str | None = f"$N_{{{symbol(name)}}}$"
        for phase in trajectory.phases:
            if name in phase.closed:
                force = phase.normal[:, phase.closed.index(name)]
                axes.plot(phase.t, force, **style.stroke(number, number), label=label)
                label = None
    low, high = axes.get_ylim()
    limits = min(low, 0.0), high + MARGIN * (high - min(low, 0.0))
    _impulses(axes, trajectory, [e.impulses for e in trajectory.collisions], limits, style)
    _legend(axes, style)


def friction_forces(axes: Axes, trajectory: Trajectory, style: Style) -> None:
    """Friction over time, what it cannot exceed as dotted lines behind it, and the tangential
    impulses of the events; the normal ones too where nothing else shows them."""
    largest = max(float(np.abs(p.tangential).max(initial=0.0)) for p in trajectory.phases)
    far = FAR * largest or np.inf
    outside = []
    for name, number in contacts_of(trajectory).items():
        stroke = style.stroke(number, number)
        label: str | None = f"$T_{{{symbol(name)}}}$"
        phases = [phase for phase in trajectory.phases if name in phase.rubbing]
        limits = [_column(trajectory.friction_limits(phase), phase, name) for phase in phases]
        for phase in phases:
            force = _column(phase.tangential, phase, name)
            axes.plot(phase.t, force, **stroke, label=label)
            label = None
        if phases and min(limit.min() for limit in limits) > far:
            outside.append(name)
            continue
        for phase, limit in zip(phases, limits, strict=True):
            for side in (limit, -limit):
                axes.plot(
                    phase.t, side, color=stroke["color"], ls=DOTS, lw=1.2, zorder=1, gid="limit"
                )
    low, high = np.clip(axes.get_ylim(), -far, far)
    impulses = [e.tractions for e in trajectory.collisions]
    if not has_normal_forces(trajectory):
        impulses = [{**e.impulses, **e.tractions} for e in trajectory.collisions]
    _impulses(axes, trajectory, impulses, (low, high), style)
    _legend(axes, style, _limits_named(trajectory, outside))


def _column(forces: Array, phase: Phase, name: str) -> Array:
    """What of the friction of a phase is that of one tangent."""
    return forces[:, list(phase.rubbing).index(name)]


def _limits_named(trajectory: Trajectory, outside: Iterable[str]) -> str:
    """What the dotted lines are, and which of them lie outside."""
    rails = {t for p in trajectory.phases for t in p.rubbing if t not in p.closed}
    contacts = {t for p in trajectory.phases for t in p.rubbing if t in p.closed}
    said = " and ".join([r"$\pm\mu N$"] * bool(contacts) + [r"$\pm F$"] * bool(rails))
    hidden = ", ".join(outside)
    return said + (f" ({hidden}: outside)" if hidden else "")


def _impulses(
    axes: Axes,
    trajectory: Trajectory,
    impulses: Iterable[Mapping[str, float]],
    limits: tuple[float, float],
    style: Style,
) -> None:
    """Marks at the events with the values of their impulses, above the curves; with the names of
    contacts that have no curve."""
    colours = {
        name: str(style.stroke(i, 0)["color"]) for name, i in contacts_of(trajectory).items()
    }
    rows = 0
    drawn = {line.get_color() for line in axes.lines}
    for event, found in zip(trajectory.collisions, impulses, strict=True):
        right = event.time > 0.75 * trajectory.final_time
        for row, (name, value) in enumerate(found.items()):
            rows = max(rows, row + 1)
            height = 1 - MARKED * (row + 0.5)
            axes.plot(
                event.time, height, "v", color=colours[name], ms=6, clip_on=False,
                transform=axes.get_xaxis_transform(),
            )  # fmt: skip
            axes.annotate(
                f"{value:.3g} N s".replace("-", "\N{MINUS SIGN}")
                + ("" if colours[name] in drawn else f" of {name}"),
                (event.time, height),
                xycoords=axes.get_xaxis_transform(),
                xytext=(-7 if right else 7, 0),
                textcoords="offset points",
                ha="right" if right else "left",
                va="center",
                fontsize=SMALL,
                color=colours[name],
                bbox={"facecolor": style.paper, "edgecolor": "none", "pad": 0.5},
            )
    low, high = limits
    axes.set_ylim(low, high + (high - low) * rows * MARKED / (1 - rows * MARKED))


def _legend(axes: Axes, style: Style, limits: str = "") -> None:
    """A legend beside the axes, with what the dotted lines are."""
    from matplotlib.lines import Line2D

    handles = axes.get_legend_handles_labels()[0]
    if limits:
        handles.append(Line2D([], [], color=style.muted, ls=DOTS, lw=1.2, label=limits))
    if handles:
        legend_beside(axes, handles)
