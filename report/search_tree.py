"""Figures of a search: the tree of sequences with its verdicts, and the best motions side by
side."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from textwrap import fill
from typing import TYPE_CHECKING

import numpy as np

from dmoc.motion.trajectory import Trajectory, noun_of
from dmoc.report.canvas import (
    SMALL,
    legend_beside,
    new_figure,
    painted,
    written,
)
from dmoc.report.curves import panels_of
from dmoc.report.film import Proofs, Take
from dmoc.report.labels import plain
from dmoc.report.panels import draw_curves
from dmoc.report.rounding import without_rounding
from dmoc.report.snapshots import draw_motions, height_of
from dmoc.report.style import SIGNS, Style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Nodes of a tree that can still be labelled with their costs.
MOST_LABELS = 130
ROW, CHARACTER = 0.3, 0.075  # inches of a leaf, and of a character of a label
PROVED = "\N{END OF PROOF}"
TALLEST = 40.0  # inches of a tree
WIDE, HIGH, DRAWN = 3.4, 1.4, 2.4  # inches of a motion, of its panels, of its drawing at most
Name = tuple[str, ...]


def plot_tree(
    nodes: Sequence[tuple[Name, str, float | None]],
    path: str | os.PathLike[str] | None = None,
    *,
    style: str = "light",
    proofs: Proofs | None = None,
) -> Figure:
    """Draw the tree of sequences (sequence, verdict, cost): verdict by colour and sign, cost and
    what is proved on the nodes; write it if a path is given."""
    with painted(style, path) as colours:
        return written(_tree(nodes, colours, proofs or Proofs()), path)


def _tree(nodes: Sequence[tuple[Name, str, float | None]], style: Style, proofs: Proofs) -> Figure:
    rows = _rows([s for s, _, _ in nodes])
    depth = max(map(len, rows), default=0)
    noun = noun_of(word for s in rows for word in s)
    labels = {s: f"{SIGNS[verdict][0]} {_label(s, cost, noun)}" for s, verdict, cost in nodes}
    labels |= {s: f"{labels[s]} {PROVED}" for s in labels if s in proofs.proved}
    columns = _columns(labels, depth)
    height = min(max(1.6, ROW * (max(rows.values(), default=0.0) + 1) + 1.1), TALLEST)
    figure = new_figure(columns[-1] + 0.5, height)
    axes = figure.add_subplot()
    for s in rows:
        if s:
            ends = [columns[len(s) - 1], columns[len(s)]], [rows[s[:-1]], rows[s]]
            axes.plot(*ends, color=style.muted, alpha=0.6, lw=1, zorder=1)
    labelled = len(rows) <= MOST_LABELS
    if labelled:
        _beginnings(axes, {s: (columns[len(s)], rows[s]) for s in rows if s not in labels}, style)
    for s, verdict, _ in nodes:
        place = columns[len(s)], rows[s]
        if labelled:
            _node(axes, place, labels[s], verdict, style)
        else:
            size = 7 if verdict == "optimal" else 4
            axes.plot(*place, "o", color=style.verdicts[verdict], ms=size, zorder=2)
    _verdict_legend(figure, [verdict for _, verdict, _ in nodes], proofs, style)
    axes.set_xlim(0.0, columns[-1] + 0.5)
    axes.set_ylim(max(rows.values(), default=0) + 0.8, -0.8)
    axes.set_xticks(columns[:-1], [str(k) for k in range(depth + 1)])
    axes.set_xlabel(f"{noun}s")
    axes.set_yticks([])
    axes.spines[["left", "right", "top"]].set_visible(False)
    return figure


def _label(sequence: Name, cost: float | None, noun: str) -> str:
    name = sequence[-1] if sequence else f"no {noun}"
    return name if cost is None else f"{name} {cost:.4g}"


def _columns(labels: dict[Name, str], depth: int) -> list[float]:
    """Middles of the columns in inches, each as wide as its longest label, and the right end."""
    widths = [0.0] * (depth + 1)
    for s, text in labels.items():
        widths[len(s)] = max(widths[len(s)], CHARACTER * len(text) + 0.45)
    ends = np.concatenate([[0.0], np.cumsum(np.maximum(widths, 1.2))])
    return [*((ends[:-1] + ends[1:]) / 2).tolist(), float(ends[-1])]


def _node(axes: Axes, place: tuple[float, float], text: str, verdict: str, style: Style) -> None:
    best = verdict == "optimal"
    box = {"boxstyle": "round,pad=0.28", "facecolor": style.verdicts[verdict], "linewidth": 1.4,
           "edgecolor": style.ink if best else "none"}  # fmt: skip
    axes.text(
        *place, text, ha="center", va="center", fontsize=7.5, zorder=2, bbox=box,
        weight="bold" if best else "normal", color=style.on_verdict,
    )  # fmt: skip


def _beginnings(axes: Axes, places: Mapping[Name, tuple[float, float]], style: Style) -> None:
    """Words of sequences that were not looked at, with which others begin."""
    box = {"boxstyle": "round,pad=0.2", "facecolor": style.paper, "edgecolor": "none"}
    for s, place in places.items():
        if s:
            axes.text(
                *place, s[-1], ha="center", va="center", fontsize=7.5, zorder=2, bbox=box,
                color=style.muted,
            )  # fmt: skip


def _verdict_legend(figure: Figure, verdicts: list[str], proofs: Proofs, style: Style) -> None:
    from matplotlib.patches import Patch

    handles = [
        Patch(facecolor=colour, label=f"{SIGNS[verdict][0]} {verdict} ({verdicts.count(verdict)})")
        for verdict, colour in style.verdicts.items()
        if verdict in verdicts
    ]
    if proofs.proved:
        handles.append(Patch(fill=False, lw=0, label=f"{PROVED} proved ({len(proofs.proved)})"))
    if proofs.statement:
        wide = int(figure.get_figwidth() / CHARACTER)
        figure.suptitle(fill(proofs.statement, wide), fontsize=SMALL)
    columns = max(1, int(figure.get_figwidth() / 1.5))
    figure.legend(
        handles=handles, loc="outside lower center", ncols=columns, frameon=False, fontsize=SMALL
    )


def _rows(sequences: list[Name]) -> dict[Name, float]:
    """Rows of a tree whose nodes stand in the middle of their children; what sequences begin with
    has one too."""
    rows: dict[Name, float] = {}
    children: dict[Name, list[Name]] = {}
    beginnings = dict.fromkeys(s[:k] for s in sequences for k in range(len(s) + 1))
    for s in beginnings:
        if s:
            children.setdefault(s[:-1], []).append(s)
    free = 0.0

    def place(s: Name) -> float:
        nonlocal free
        below = [place(c) for c in children.get(s, [])]
        if not below:
            rows[s] = free
            free += 1.0
        else:
            rows[s] = float(np.mean(below))
        return rows[s]

    if sequences:
        place(())
    return rows


def plot_motions(
    motions: Sequence[tuple[str, float, Trajectory]],
    path: str | os.PathLike[str] | None = None,
    *,
    style: str = "light",
) -> Figure:
    """Draw motions (name, cost, trajectory) side by side: snapshots, coordinates and inputs over
    time, collisions as lines; write the figure if a path is given."""
    with painted(style, path) as colours:
        return written(_motions(motions, colours), path)


def _motions(motions: Sequence[tuple[str, float, Trajectory]], style: Style) -> Figure:
    if not motions:
        figure = new_figure(4.0, 1.2)
        axes = figure.add_subplot()
        axes.text(0.5, 0.5, "no confirmed motion", ha="center", va="center")
        axes.set_axis_off()
        return figure
    takes = [Take(name, without_rounding(motion), cost=cost) for name, cost, motion in motions]
    beside = [take.trajectory for take in takes]
    panels = [[p for p in panels_of(m, beside) if p.quantity in "qu"] for m in beside]
    drawn = min(height_of([take.scene for take in takes], WIDE - 0.8), DRAWN) + 0.7
    heights = [drawn, *[HIGH] * len(panels[0])]
    figure = new_figure(1.6 + WIDE * len(takes), 0.6 + sum(heights))
    grid = figure.subplots(len(heights), len(takes), squeeze=False, height_ratios=heights)
    draw_motions(grid[0], takes, style)
    for axes, take in zip(grid[0], takes, strict=True):
        axes.set_title(f"{plain(take.name)}\ncost {take.cost:.6g}", fontsize=9)
    for row, places in enumerate(grid[1:]):
        for k, (axes, take) in enumerate(zip(places, takes, strict=True)):
            if k:
                axes.sharey(places[0])
            curves = draw_curves(axes, panels[k][row], take.trajectory.collisions, style)
            axes.margins(x=0)
            axes.tick_params(labelbottom=row == len(panels[0]) - 1)
            if k == len(takes) - 1 and len(curves) > 1:
                legend_beside(axes, curves)
            if k:
                axes.tick_params(labelleft=False)
                axes.set_ylabel("")
    for axes in grid[-1]:
        axes.set_xlabel("time $t$ [s]")
    return figure
