"""A strip of the modes of contacts that last, and the events above it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from dmoc.motion.trajectory import Phase, Trajectory
from dmoc.report.canvas import LENGTH, SMALL
from dmoc.report.style import Style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WIDE, HIGH = 0.064, 0.15  # inches of a character and of a line of small text
MOST_NAMED = 24  # events: the names of more would be a tower


def strip_height(trajectory: Trajectory) -> float:
    """Height of the strip of modes in inches: a line for each contact of the longest one; 0 where
    contacts do not last."""
    if not trajectory.lasting:
        return 0.0
    return HIGH * max(len(phase.mode.split()) for phase in _phases(trajectory)) + 0.1


def _phases(trajectory: Trajectory) -> list[Phase]:
    """Phases that take time."""
    return [phase for phase in trajectory.phases if phase.steps]


def mode_strip(axes: Axes, trajectory: Trajectory, style: Style) -> None:
    """Modes as colours, named where there is room and in a legend else."""
    modes = list(dict.fromkeys(phase.mode for phase in _phases(trajectory) if not phase.free))
    tints = {mode: style.tints[i % len(style.tints)] for i, mode in enumerate(modes)}
    tints["free"] = style.free
    per_second = LENGTH / trajectory.final_time
    named = set()
    for phase in _phases(trajectory):
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
    there = dict.fromkeys(phase.mode for phase in _phases(trajectory))
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
