"""Figures of a search: the tree of sequences with its verdicts, and the best motions side by
side."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from dmoc.report.canvas import new_figure, symbol, write
from dmoc.trajectory import Trajectory, noun_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Colours that stay apart for colour-blind readers (Okabe & Ito 2008).
COLOURS = {
    "optimal": "#009E73",
    "feasible": "#56B4E9",
    "grazes": "#F0E442",
    "collapses": "#0072B2",
    "unverified": "#E69F00",
    "infeasible": "#BBBBBB",
    "unreachable": "#D55E00",
    "failed": "#CC79A7",
}
# Nodes of a tree that can still be labelled with their costs.
MOST_LABELS = 130
ROW, COLUMN = 0.27, 2.3  # inches of a leaf and of a depth


def plot_tree(
    nodes: Sequence[tuple[tuple[str, ...], str, float | None]],
    path: str | os.PathLike[str] | None = None,
) -> Figure:
    """Draw the tree of sequences: verdict by colour, cost on the nodes.

    Parameters
    ----------
    nodes : sequence of (sequence, verdict, cost)
    path : path, optional
        Where to write the figure.
    """
    verdict = {s: v for s, v, _ in nodes}
    cost = {s: c for s, _, c in nodes}
    rows = _rows(list(verdict))
    depth = max(map(len, verdict), default=0)
    leaves = len(set(rows.values()))
    height = min(max(2.4, ROW * leaves + 1.2), 40.0)
    figure = new_figure(COLUMN * (depth + 1) + 0.6, height)
    axes = figure.add_subplot()
    for s in verdict:
        if s:
            parent = s[:-1]
            axes.plot([len(parent), len(s)], [rows[parent], rows[s]], color="0.75", lw=1, zorder=1)
    noun = noun_of(word for s in verdict for word in s)
    labelled = len(verdict) <= MOST_LABELS
    for s, v in verdict.items():
        number = cost[s]
        text = (f"{s[-1]} " if s else f"no {noun} ") + ("" if number is None else f"{number:.4g}")
        if labelled:
            weight = "bold" if v == "optimal" else "normal"
            axes.text(
                len(s),
                rows[s],
                text.strip(),
                ha="center",
                va="center",
                fontsize=7.5,
                weight=weight,
                zorder=2,
                bbox={"boxstyle": "round,pad=0.25", "fc": COLOURS[v], "ec": "none", "alpha": 0.9},
            )
        else:
            axes.plot(
                len(s), rows[s], "o", color=COLOURS[v], ms=7 if v == "optimal" else 4, zorder=2
            )
    from matplotlib.lines import Line2D

    counts = {v: sum(1 for w in verdict.values() if w == v) for v in COLOURS}
    handles = [
        Line2D([], [], marker="s", ls="", color=COLOURS[v], label=f"{v} ({n})")
        for v, n in counts.items()
        if n
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=3, frameon=False, fontsize=8)
    axes.set_xlim(-0.5, depth + 0.5)
    axes.set_ylim(max(rows.values(), default=0) + 0.8, -0.8)
    axes.set_xticks(range(depth + 1))
    axes.set_xlabel(f"{noun}s")
    axes.set_yticks([])
    for side in ("left", "right", "top"):
        axes.spines[side].set_visible(False)
    return _finished(figure, path)


def _rows(sequences: list[tuple[str, ...]]) -> dict[tuple[str, ...], float]:
    """Rows of a tree whose nodes stand in the middle of their children."""
    rows: dict[tuple[str, ...], float] = {}
    children: dict[tuple[str, ...], list[tuple[str, ...]]] = {}
    for s in sequences:
        if s:
            children.setdefault(s[:-1], []).append(s)
    free = 0.0

    def place(s: tuple[str, ...]) -> float:
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
    motions: Sequence[tuple[str, float, Trajectory]], path: str | os.PathLike[str] | None = None
) -> Figure:
    """Draw motions side by side: coordinates and inputs over time, collisions as lines.

    Parameters
    ----------
    motions : sequence of (name, cost, trajectory)
    path : path, optional
        Where to write the figure.
    """
    if not motions:
        figure = new_figure(4.0, 1.2)
        axes = figure.add_subplot()
        axes.text(0.5, 0.5, "no confirmed motion", ha="center", va="center")
        axes.set_axis_off()
        return _finished(figure, path)
    t0 = motions[0][2]
    names = [*t0.coordinates, *t0.inputs]
    figure = new_figure(0.8 + 3.2 * len(motions), 0.8 + 1.5 * len(names))
    grid = figure.subplots(len(names), len(motions), sharex="col", sharey="row", squeeze=False)
    nq = len(t0.coordinates)
    for column, (name, cost, trajectory) in enumerate(motions):
        grid[0, column].set_title(f"{name}\ncost {cost:.6g}", fontsize=9)
        for row, label in enumerate(names):
            axes = grid[row, column]
            for phase in trajectory.phases:
                if row < nq:
                    axes.plot(phase.t, phase.q[:, row], color="#0072B2")
                elif not trajectory.input_form.width:
                    axes.stairs(phase.u[:, row - nq], phase.t, baseline=None, color="#D55E00")
                else:
                    axes.plot(trajectory.input_times(phase), phase.u[:, row - nq], color="#D55E00")
            for c in trajectory.collisions:
                axes.axvline(c.time, color="0.6", lw=0.8, ls=":")
            axes.margins(x=0)
            if column == 0:
                axes.set_ylabel(f"${symbol(label)}$")
        grid[-1, column].set_xlabel("time $t$ [s]")
    return _finished(figure, path)


def _finished(figure: Figure, path: str | os.PathLike[str] | None) -> Figure:
    if path is not None:
        write(figure, Path(path))
    return figure
