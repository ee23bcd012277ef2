"""What the nodes of a search are worth beside each other: the best one, those that collapse into a
shorter sequence, and what limits the answer."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from itertools import combinations

import numpy as np

from dmoc.base.tolerances import SAME_COST
from dmoc.sequences.nodes import Node, Sequence, Verdict

CONFIRMED = (Verdict.OPTIMAL, Verdict.FEASIBLE)
# Verdicts of nodes that may be no more than a shorter one with a phase of next to no length.
MAY_COLLAPSE = (Verdict.FEASIBLE, Verdict.UNVERIFIED)


def best_of(nodes: Iterable[Node]) -> Node | None:
    """The cheapest confirmed node; among those that cost the same the shortest sequence."""
    good = [n for n in nodes if n.verdict in CONFIRMED]
    least = min((_cost(n) for n in good), default=np.inf)
    same = [n for n in good if _cost(n) <= least + SAME_COST * abs(least)]
    return min(same, key=lambda n: (len(n.sequence), n.cost, n.sequence), default=None)


def better(node: Node, other: Node) -> Node:
    """The cheaper confirmed one of two nodes of one sequence, else the first with a motion."""
    return best_of((node, other)) or (node if node.solution is not None else other)


def with_optimum(nodes: Mapping[Sequence, Node]) -> list[Node]:
    """The nodes with verdicts that need the others: the optimal one, and those that collapse."""
    best = best_of(nodes.values())
    optimal = None if best is None else best.sequence
    return [
        replace(n, verdict=Verdict.OPTIMAL) if n.sequence == optimal else _collapsed(n, nodes)
        for n in nodes.values()
    ]


def _collapsed(node: Node, nodes: Mapping[Sequence, Node]) -> Node:
    """A node that is limited by a shortest phase, where a sequence with one or two of its events
    less costs no more."""
    if not node.shortest or node.verdict not in MAY_COLLAPSE:
        return node
    shorter = best_of(nodes[s] for s in _within(node.sequence) if s in nodes)
    if shorter is None or _cost(shorter) > _cost(node) + SAME_COST * abs(_cost(node)):
        return node
    why = (
        f"a shorter sequence does better: {shorter.name} costs {_cost(shorter):.6g}, this one "
        f"{_cost(node):.6g}, and {' and '.join(node.shortest)} holds its motion"
    )
    return replace(node, verdict=Verdict.COLLAPSES, evidence=(why, *node.evidence))


def _within(sequence: Sequence) -> Iterator[Sequence]:
    """The sequences with one event less, and with two, as at both ends of a phase."""
    for fewer in (1, 2):
        if fewer <= len(sequence):
            yield from combinations(sequence, len(sequence) - fewer)


def _cost(node: Node) -> float:
    return np.inf if node.cost is None else node.cost
