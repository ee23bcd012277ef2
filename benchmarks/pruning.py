"""What a search loses by its verdict `unreachable`, which is that of a coarse mesh: every sequence
that it cuts off is solved again on the problem's own mesh, from many starts."""

from __future__ import annotations

from typing import Any

from common import Section, clocked

import dmoc
from dmoc.models.registry import find

STARTS = 50  # of each sequence on its own mesh
SECONDS = 30.0
CASES = {
    # The name of a problem, its changes, and the most collisions.
    "cart-pendulum, 60 N, 0.6 s": (
        "cart_pendulum",
        {"bounds": {"F": (-60, 60)}, "final_time": (None, 0.6)},
        3,
    ),
    "cart-pendulum, 30 N, 0.5 s": (
        "cart_pendulum",
        {"bounds": {"F": (-30, 30)}, "final_time": (None, 0.5)},
        3,
    ),
    "puck, inputs within 1": (
        "puck_table",
        {"bounds": {"f_x": (-1, 1), "f_y": (-1, 1)}, "final_time": 1.0},
        3,
    ),
}


def compare(quick: bool) -> Section:
    section = Section(
        "Pruning: what `unreachable` cuts off",
        "A search with N = 40 a phase says `unreachable` of a sequence whose last collision no "
        f"start makes on a coarse mesh. Tried again: each of these with N = 40, {STARTS} starts, "
        "the goal left out, by `dmoc.solve`. Wrong: a confirmed motion makes its collisions. Best: "
        "whether a sequence below a wrong one would have been the optimum.",
        ["problem", "sequences in the tree", "solved", "unreachable", "wrong", "best", "s"],
    )  # fmt: skip
    for name, (model, changes, depth) in list(CASES.items())[: 1 if quick else None]:
        reference = find(model)
        fields: dict[str, Any] = {**reference.defaults, **changes, "steps": 40, "sequence": ()}
        problem = dmoc.Problem(reference.kernels(), **fields)
        words = len(problem.kernels.surfaces)
        result = dmoc.search(problem, depth)
        cut = [n.sequence for n in result.nodes if str(n.verdict) == "unreachable"]
        seconds, wrong = clocked(lambda p=problem, c=cut: [s for s in c if _made(p, s)])
        section.row(
            name, sum(words**k for k in range(depth + 1)), len(result.nodes), len(cut),
            ", ".join(" ".join(s) for s in wrong) or 0, _better(problem, result, wrong),
            f"{seconds:.1f}",
        )  # fmt: skip
    return section


def _made(problem: dmoc.Problem, sequence: tuple[str, ...]) -> bool:
    """Whether a confirmed motion makes the collisions of a sequence."""
    free = problem.but(sequence=sequence, goal={})
    return bool(dmoc.solve(free, "ipm", starts=STARTS, seconds=SECONDS).status == "solved")


def _better(problem: dmoc.Problem, result: Any, wrong: list[tuple[str, ...]]) -> str:
    """Sequences that were cut off wrongly and cost less than the best one."""
    least = float("inf") if result.best is None else result.best.cost
    costs = []
    for sequence in wrong:
        solution = dmoc.solve(problem.but(sequence=sequence), "ipm", starts=STARTS, seconds=SECONDS)
        if solution.status == "solved" and solution.cost < least:
            costs.append(f"{' '.join(sequence)}: {solution.cost:.5g}")
    return ", ".join(costs) or "no"
