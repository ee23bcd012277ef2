"""The table that stands for the result of a search."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dmoc.table import Table, toned

if TYPE_CHECKING:
    from dmoc.sequences.engine import SearchResult

TONES = {
    "optimal": "best",
    "feasible": "good",
    "grazes": "fair",
    "collapses": "merged",
    "unverified": "doubtful",
    "infeasible": "dim",
    "unreachable": "bad",
    "failed": "broken",
}
MOST_ROWS = 40  # the JSON has all nodes
HEAD = ("sequence", "verdict", "cost", "phases [s]", "minima", "evidence")


def table_of(result: SearchResult) -> Table:
    """The nodes, the cheapest first, and what they come to."""
    nodes = sorted(result.nodes, key=lambda n: (n.cost is None, n.cost or 0.0, len(n.sequence)))
    rows = tuple(
        (
            result.name_of(n),
            toned(n.verdict.value, TONES[n.verdict.value]),
            "" if n.cost is None else f"{n.cost:.6g}",
            " ".join(f"{t:.4g}" for t in n.phases),
            str(len(n.minima) or ""),
            "; ".join(n.evidence[:2]),
        )
        for n in nodes[:MOST_ROWS]
    )
    more = len(nodes) - MOST_ROWS
    notes = [f"... and {more} more: --json FILE, or to_dict(), has all of them"] if more > 0 else []
    notes += [f"note: {note}" for note in result.notes]
    rate = f"{len(nodes) / max(result.seconds, 1e-9):.1f} a second"
    notes.append(f"{best_of(result)}; {len(nodes)} sequences in {result.seconds:.1f} s ({rate})")
    return Table(rows, HEAD, tuple(notes), f"search of {result.problem.kernels.name}")


def best_of(result: SearchResult) -> str:
    """The answer in a few words."""
    if result.best is None:
        return "no confirmed motion"
    return f"best: {result.name_of(result.best)}, cost {result.best.cost:.6g}"
