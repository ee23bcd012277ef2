"""Panels of contacts that last: a strip of the modes with the events above it, the contact forces,
and friction in its cone, with the impulses of the events."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

import numpy as np

from dmoc.report.canvas import LENGTH, legend_above, symbol
from dmoc.trajectory import Array, Phase, Trajectory

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Colours that stay apart for colour-blind readers (Okabe & Ito 2008).
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
# Light ones for modes: the same ones, mixed with white.
TINTS = ("#cce3f0", "#f7dfcc", "#b3e2d5", "#f5e4ed", "#faeccc", "#a6d7f3")
FREE, GREY, DARK = "#f4f4f4", "#8a8a8a", "#404040"
SMALL = 8  # points of small text
WIDE, HIGH = 0.064, 0.15  # inches of a character and of a line of small text
# The limits of friction are drawn up to this many times the largest force: beyond it they would
# flatten the curves.
FAR = 5.0
MARGIN = 0.05  # of the height, above a force that is constant
MARKED = 0.13  # share of the height that one mark of an impulse takes


def strip_height(trajectory: Trajectory) -> float:
    """Height of the strip of modes in inches: a line for each contact of the longest one."""
    return HIGH * max(len(phase.mode.split()) for phase in trajectory.phases) + 0.1


def mode_strip(axes: Axes, trajectory: Trajectory) -> None:
    """Modes as colours, named where there is room and in a legend else; above them the events."""
    modes = list(dict.fromkeys(phase.mode for phase in trajectory.phases if not phase.free))
    tints = {mode: TINTS[i % len(TINTS)] for i, mode in enumerate(modes)} | {"free": FREE}
    per_second = LENGTH / trajectory.final_time
    named = set()
    for phase in trajectory.phases:
        axes.axvspan(phase.t[0], phase.t[-1], facecolor=tints[phase.mode], linewidth=0)
        words = phase.mode.split()
        if WIDE * max(map(len, words)) <= phase.duration * per_second:
            middle = (phase.t[0] + phase.t[-1]) / 2
            axes.text(
                middle, 0.5, "\n".join(words), ha="center", va="center_baseline", color=DARK,
                fontsize=SMALL, transform=axes.get_xaxis_transform(), linespacing=1.0,
            )  # fmt: skip
            named.add(phase.mode)
    axes.set_ylabel("mode", fontsize=SMALL, rotation=0, ha="right", va="center")
    axes.set_yticks([])
    axes.set_ylim(0.0, 1.0)
    axes.spines[:].set_visible(False)
    axes.tick_params(axis="x", length=0, labelbottom=False)
    there = dict.fromkeys(phase.mode for phase in trajectory.phases)
    _legend_of_modes(axes, {mode: tints[mode] for mode in there if mode not in named})
    _events(axes, trajectory)


def _legend_of_modes(axes: Axes, tints: Mapping[str, str]) -> None:
    from matplotlib.patches import Patch

    if tints:
        handles = [Patch(facecolor=tint, edgecolor=GREY, label=m) for m, tint in tints.items()]
        axes.figure.legend(
            handles=handles, loc="outside lower center", ncols=3, frameon=False, fontsize=SMALL
        )


def _events(axes: Axes, trajectory: Trajectory) -> None:
    """Words of the events over their times, on lines of their own where they would overlap."""
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
            color=DARK,
        )


def contacts_of(trajectory: Trajectory) -> dict[str, str]:
    """All that touches along a motion, and its colour."""
    names: dict[str, None] = {}
    for phase in trajectory.phases:
        names |= dict.fromkeys([*phase.closed, *phase.rubbing])
    for event in trajectory.collisions:
        names |= dict.fromkeys([*event.impulses, *event.tractions])
    return {name: COLOURS[i % len(COLOURS)] for i, name in enumerate(names)}


def has_normal_forces(trajectory: Trajectory) -> bool:
    """Whether a surface pushes in some phase."""
    return any(phase.closed for phase in trajectory.phases)


def has_friction(trajectory: Trajectory) -> bool:
    """Whether something rubs in some phase."""
    return any(phase.rubbing for phase in trajectory.phases)


def normal_forces(axes: Axes, trajectory: Trajectory) -> None:
    """Normal forces over time, and the impulses of the events."""
    for name, colour in contacts_of(trajectory).items():
        label: str | None = f"$N_{{{symbol(name)}}}$"
        for phase in trajectory.phases:
            if name in phase.closed:
                force = phase.normal[:, phase.closed.index(name)]
                axes.plot(phase.t, force, color=colour, label=label)
                label = None
    low, high = axes.get_ylim()
    limits = min(low, 0.0), high + MARGIN * (high - min(low, 0.0))
    _impulses(axes, trajectory, [e.impulses for e in trajectory.collisions], limits)
    _legend(axes)


def friction_forces(axes: Axes, trajectory: Trajectory) -> None:
    """Friction over time, what it cannot exceed as dashed lines behind it, and the tangential
    impulses of the events; the normal ones too where nothing else shows them."""
    largest = max(float(np.abs(p.tangential).max(initial=0.0)) for p in trajectory.phases)
    far = FAR * largest or np.inf
    outside = []
    for name, colour in contacts_of(trajectory).items():
        label: str | None = f"$T_{{{symbol(name)}}}$"
        phases = [phase for phase in trajectory.phases if name in phase.rubbing]
        limits = [_column(trajectory.friction_limits(phase), phase, name) for phase in phases]
        for phase in phases:
            force = _column(phase.tangential, phase, name)
            axes.plot(phase.t, force, color=colour, label=label)
            label = None
        if phases and min(limit.min() for limit in limits) > far:
            outside.append(name)
            continue
        for phase, limit in zip(phases, limits, strict=True):
            for side in (limit, -limit):
                axes.plot(phase.t, side, color=colour, linestyle="--", linewidth=0.9, zorder=1)
    low, high = np.clip(axes.get_ylim(), -far, far)
    impulses = [e.tractions for e in trajectory.collisions]
    if not has_normal_forces(trajectory):
        impulses = [{**e.impulses, **e.tractions} for e in trajectory.collisions]
    _impulses(axes, trajectory, impulses, (low, high))
    _legend(axes, _limits_named(trajectory, outside))


def _column(forces: Array, phase: Phase, name: str) -> Array:
    """What of the friction of a phase is that of one tangent."""
    return forces[:, list(phase.rubbing).index(name)]


def _limits_named(trajectory: Trajectory, outside: Iterable[str]) -> str:
    """What the dashed lines are, and which of them lie outside."""
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
) -> None:
    """Marks at the events with the values of their impulses, above the curves; with the names of
    contacts that have no curve."""
    colours, rows = contacts_of(trajectory), 0
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
                bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.5},
            )
    low, high = limits
    axes.set_ylim(low, high + (high - low) * rows * MARKED / (1 - rows * MARKED))


def _legend(axes: Axes, limits: str = "") -> None:
    """A legend above the axes, with what the dashed lines are."""
    from matplotlib.lines import Line2D

    handles = axes.get_legend_handles_labels()[0]
    if limits:
        handles.append(Line2D([], [], color=GREY, linestyle="--", linewidth=0.9, label=limits))
    if handles:
        legend_above(axes, handles)
