"""The table that stands for the result of a search."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from dmoc.base.table import Table, toned

if TYPE_CHECKING:
    from dmoc.sequences.nodes import Node
    from dmoc.sequences.search import SearchResult

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
HEAD, WHY = ("sequence", "verdict", "cost"), "durations [s], minima and evidence"
# Verdicts that make one ask why.
UNEXPLAINED = TONES.keys() - {"optimal", "feasible"}


def table_of_search(result: SearchResult, why: bool = False) -> Table:
    """The nodes, the cheapest first, and what they come to; with durations and evidence if
    wanted."""
    nodes = sorted(result.nodes, key=lambda n: (n.cost is None, n.cost or 0.0, len(n.sequence)))
    rows = tuple(
        (
            result.name_of(n),
            toned(n.verdict.value, TONES[n.verdict.value]),
            "" if n.cost is None else f"{n.cost:.6g}",
            *([_proved(result, n)] if result.proof else []),
            *([_evidence_of(n)] if why else []),
        )
        for n in nodes[:MOST_ROWS]
    )
    more = len(nodes) - MOST_ROWS
    notes = [f"... and {more} more: --json FILE, or to_dict(), has all of them"] if more > 0 else []
    notes += [f"note: {note}" for note in result.notes]
    if not why and any(n.verdict.value in UNEXPLAINED for n in nodes[:MOST_ROWS]):
        notes.append("note: dmoc search --verbose, or evidence of the nodes, tells why")
    if result.proof is not None:
        notes.append(result.proof.in_words)
    rate = f"{len(nodes) / max(result.seconds, 1e-9):.1f} a second"
    notes.append(
        f"{best_in_words(result)}; {len(nodes)} sequences in {result.seconds:.1f} s ({rate})"
    )
    return Table(
        rows,
        (*HEAD, *(["proved"] if result.proof else []), *([WHY] if why else [])),
        tuple(notes),
        f"search of {result.problem.kernels.name}",
    )


def table_of_node(node: Node) -> Table:
    """Table of the facts about one sequence."""
    costs = ", ".join(f"{cost:.6g}" for cost in node.minima)
    rows = (
        ("verdict", toned(node.verdict.value, TONES[node.verdict.value])),
        ("cost", "" if node.cost is None else f"{node.cost:.6g}"),
        ("durations [s]", ", ".join(f"{t:.4g}" for t in node.phases)),
        ("minima", costs if len(node.minima) > 1 else ""),
        ("starts", str(len(node.starts) or "")),
        ("evidence", "; ".join(node.evidence)),
    )
    return Table(tuple(row for row in rows if row[1]), title=f"sequence {node.name}")


def _proved(result: SearchResult, node: Node) -> str:
    """What is proved of a sequence: its claim and its bound."""
    bounded = None if result.proof is None else result.proof.of(node.sequence)
    if bounded is None:
        return ""
    word = str(bounded.claim).removesuffix(" (proved)")
    return f"{word}, >= {bounded.bound:.6g}" if np.isfinite(bounded.bound) else word


def _evidence_of(node: Node) -> str:
    """Durations of a motion, the number of its minima, and the evidence."""
    durations = " ".join(f"{t:.4g}" for t in node.phases)
    minima = f"{len(node.minima)} minima" if len(node.minima) > 1 else ""
    return "; ".join(part for part in (durations, minima, *node.evidence[:2]) if part)


def best_in_words(result: SearchResult) -> str:
    """The answer in a few words."""
    if result.best is None:
        return "no confirmed motion"
    return f"best: {result.name_of(result.best)}, cost {result.best.cost:.6g}"
