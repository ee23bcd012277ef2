"""Names of constraints and unknowns in the user's words, for messages and results."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dmoc.nlp.layout import Index, Layout
from dmoc.nlp.problem import Problem
from dmoc.symbolic.names import momentum_name, velocity_name


@dataclass(frozen=True)
class Block:
    """Rows of one kind of constraint; ``labels`` name each row in the user's words."""

    name: str
    rows: Index
    labels: tuple[str, ...]


@dataclass(frozen=True)
class Goal:
    """A value of the goal that is a constraint: the unknown, its range and its name."""

    unknown: int
    low: float
    high: float
    name: str


def goal_limits(goals: Sequence[Goal]) -> list[tuple[Goal, float, float]]:
    """The inequalities sign * (unknown - value) >= 0 of goals that are ranges: goal, sign and value."""
    ranges = [g for g in goals if g.low < g.high]
    below = [(g, 1.0, g.low) for g in ranges if g.low > -np.inf]
    return below + [(g, -1.0, g.high) for g in ranges if g.high < np.inf]


def equality_blocks(problem: Problem, layout: Layout, goals: Sequence[Goal]) -> list[Block]:
    """Blocks of c, in the order of its rows; ``goals`` are those that are constraints."""
    names = problem.kernels.coordinates
    low, high = problem.final_time_bounds
    collisions = [f"collision {i + 1} ({s})" for i, s in enumerate(problem.sequence)]
    groups = [
        ("momentum", [f"momentum of {q} at node {k}" for k in range(layout.total + 1) for q in names]),
        ("inside", [f"equation of motion of {q} in step {k}" for k in range(layout.total) for q in names * layout.inside]),
        ("time", [f"time of node {k + 1}" for k in range(layout.total) if layout.timed]),
        ("arrival", [f"velocity {velocity_name(q)} before {c}" for c in collisions for q in names]),
        ("departure", [f"velocity {velocity_name(q)} after {c}" for c in collisions for q in names]),
        ("energy", [f"energy at {c}" for c in collisions]),
        ("contact", [f"contact at {c}" for c in collisions]),
        ("start velocity", [f"{momentum_name(q)} at the start" for q in names] if layout.velocity_at_start else []),
        ("goal velocity", [f"{momentum_name(q)} at the goal" for q in names] if layout.velocity_at_end else []),
        ("final time", [f"final time = {low:g} s"] if low == high else []),
        ("periodic", [f"periodic {name}" for name in problem.periodic]),
        ("goal", [f"goal of {g.name}" for g in goals if g.low == g.high]),
    ]
    return _blocks(groups)


def inequality_blocks(
    problem: Problem, layout: Layout, gaps: tuple[Index, Index, Index], goals: Sequence[Goal], timed: Sequence[int],
    sides: tuple[Index, Index],
) -> list[Block]:  # fmt: skip
    """Blocks of d, in the order of its rows.

    ``gaps`` are node and surface of each gap, and the surfaces whose gaps inside the steps count, ``goals`` those that are constraints,
    ``timed`` the phases with a minimal time, ``sides`` the collisions that must be approached and those after which the gap must open.
    """
    low, high = problem.final_time_bounds
    names, surfaces = problem.kernels.manifest["path_constraints"], problem.kernels.surfaces
    approach, separation = ([f"collision {i + 1} ({problem.sequence[i]})" for i in side] for side in sides)
    *at, still = gaps
    groups = [
        ("gap", [f"gap to {surfaces[j]} at node {k}" for k, j in zip(*at, strict=True)]),
        (
            "gap inside",
            [
                f"gap to {surfaces[j]} inside step {k // layout.inside}"
                for k in range(layout.total * layout.inside)
                for j in still
            ],
        ),
        ("path", [f"path constraint {n} in step {k}" for k in range(layout.total) for n in names * layout.scheme.points]),
        ("final time >=", [f"final time >= {low:g} s"] if 0 < low < high else []),
        ("final time <=", [f"final time <= {high:g} s"] if low < high < np.inf else []),
        ("goal", [f"goal of {g.name} {'>=' if sign > 0 else '<='} {value:g}" for g, sign, value in goal_limits(goals)]),
        ("approach", [f"approach of {c}" for c in approach]),
        ("separation", [f"separation after {c}" for c in separation]),
        ("minimal time", [f"minimal time of phase {i} -> {problem.sequence[i]}" for i in timed]),
    ]
    return _blocks(groups)


def unknown_names(problem: Problem, layout: Layout) -> list[str]:
    """Name every unknown in the user's words, in the order of x."""
    kernels = problem.kernels
    q, u = kernels.coordinates, kernels.inputs
    names = [f"step size of phase {i}" for i in range(layout.phases)]
    names += [f"{c} at node {k}" for k in range(layout.total + 1) for c in q]
    rows = range(layout.input_rows)
    names += [f"{c} in node {k}" if layout.form.shared else f"{c} in step {layout.step_of_input[k]}" for k in rows for c in u]
    names += [f"impulse of collision {i + 1} ({s})" for i, s in enumerate(problem.sequence)]
    for end in ("start", "goal"):
        names += [f"{momentum_name(c)} at the {end}" for c in q]
    for end, velocities in (("start", layout.velocity_at_start), ("goal", layout.velocity_at_end)):
        names += [f"{velocity_name(c)} at the {end}" for c in q] if velocities else []
    collisions = [f"collision {i + 1} ({s})" for i, s in enumerate(problem.sequence)]
    names += [f"{velocity_name(c)} {side} {at}" for side in ("before", "after") for at in collisions for c in q]
    names += [f"time of node {k}" for k in range(layout.total + 1) if layout.timed]
    names += [f"{c} inside step {k}" for k in range(layout.total) for c in q * layout.inside]
    return names


def _blocks(groups: list[tuple[str, list[str]]]) -> list[Block]:
    blocks = []
    start = 0
    for name, labels in groups:
        blocks.append(Block(name, np.arange(start, start + len(labels)), tuple(labels)))
        start += len(labels)
    return blocks
