"""What several sums, or several products, have in common, two parts at a time."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from heapq import heapify, heappop, heappush
from itertools import combinations
from typing import TypeAlias

from dmoc.symbolic.graph import SUM, GraphNode, is_normal
from dmoc.symbolic.traversal import in_order, reached, remembered

Part: TypeAlias = tuple[GraphNode, float]

# Terms that several sums share all at once: of more, the pairs would be thousands.
MANY = 40


def share_pairs(
    parts: dict[GraphNode, list[Part]],
    combined: Callable[[GraphNode, GraphNode, float, Sequence[GraphNode]], Part],
) -> None:
    """Replace pairs of parts (a, w), (b, w ratio) that several owners have by one part, those that
    most have first; ``combined(a, b, ratio, owners)`` is the node that stands for (a, 1) and
    (b, ratio), and its weight, where these owners have no other parts."""
    nodes: dict[int, GraphNode] = {}
    owners: dict[tuple[int, int, float], set[GraphNode]] = defaultdict(set)
    heap: list[tuple[int, int, int, float]] = []

    def enter(owner: GraphNode, x: Part, y: Part, waiting: bool = True) -> None:
        i, j = x[0].number, y[0].number
        if i <= j:
            (a, weight), (b, other) = x, y
        else:
            (a, weight), (b, other), i, j = y, x, j, i
        ratio = other / weight
        if ratio != 1.0 and not (is_normal(ratio) and is_normal(weight / other)):
            return
        nodes[i], nodes[j] = a, b
        having = owners[i, j, ratio]
        having.add(owner)
        if waiting and len(having) > 1:
            heappush(heap, (-len(having), i, j, ratio))

    # What one owner has alone is in no pair that others have.
    owners_of: dict[GraphNode, dict[GraphNode, None]] = defaultdict(dict)
    for owner, own in parts.items():
        for n, _ in own:
            owners_of[n][owner] = None

    def shared(own: Sequence[Part]) -> list[Part]:
        return [part for part in own if len(owners_of[part[0]]) > 1]

    def give(node: GraphNode, new: Sequence[GraphNode]) -> None:
        before = [*owners_of[node]]
        owners_of[node].update(dict.fromkeys(new))
        if len(before) == 1 < len(owners_of[node]):
            own = shared(parts[before[0]])
            for part in [part for part in own if part[0] is node]:
                for other in own:
                    if other is not part:
                        enter(before[0], part, other)

    for owner, own in parts.items():
        for x, y in combinations(shared(own), 2):
            enter(owner, x, y, False)
    heap += [(-len(having), *key) for key, having in owners.items() if len(having) > 1]
    heapify(heap)
    while heap:
        count, *key_of = heappop(heap)
        i, j, ratio = key = (int(key_of[0]), int(key_of[1]), key_of[2])
        a, b = nodes[i], nodes[j]
        having = owners[key] = {n for n in owners[key] if _has(parts[n], a, b, ratio)}
        if len(having) != -count:
            if len(having) > 1:
                heappush(heap, (-len(having), *key))
            continue
        ordered = sorted(having, key=lambda n: n.number)
        node, weight = combined(a, b, ratio, [n for n in ordered if len(parts[n]) == 2])
        ordered = [n for n in ordered if n is not node]
        give(node, ordered)
        for owner in ordered:
            own = parts[owner]
            x = own.pop(_place(own, a))
            own.pop(_place(own, b))
            new = (node, x[1] / weight)
            for other in shared(own):
                enter(owner, new, other)
            own.append(new)
        # Where a sum holds a part of its own, the other may cancel all but a symbol, say.
        if node not in parts and node.kind == next(iter(having)).kind:
            parts[node] = [(a, 1.0 / weight), (b, ratio / weight)]
        owners[key] = {node}


def _place(own: Sequence[Part], node: GraphNode) -> int:
    for i, (n, _) in enumerate(own):
        if n is node:
            return i
    return -1


def _has(own: Sequence[Part], a: GraphNode, b: GraphNode, ratio: float) -> bool:
    first = second = None
    for n, weight in own:
        if n is a and first is None:
            first = weight
        elif n is b and second is None:
            second = weight
    return first is not None and second is not None and second / first == ratio


@remembered
def with_shared_sums(results: Sequence[GraphNode]) -> list[GraphNode]:
    """The same expressions with nested sums: SymPy writes them as flat ones."""
    parts = {
        node: list(node.parts)
        for node in reached(results)
        if node.kind == SUM and len(node.parts) > 1
    }
    _share_bundles(parts)
    share_pairs(parts, _sum_of)
    new: dict[GraphNode, GraphNode] = {}
    for node in in_order(results, lambda n: [p for p, _ in parts[n]] if n in parts else n.children):
        new[node] = (
            node.graph.sum([(new[n], c) for n, c in parts[node]], node.value)
            if node in parts
            else node.rebuilt(new)
        )
    return [new[r] for r in results]


def _share_bundles(parts: dict[GraphNode, list[Part]]) -> None:
    """Replace many terms that the same sums have in the same ratios by one, at once."""
    owners: dict[GraphNode, list[Part]] = defaultdict(list)
    for owner, own in parts.items():
        for node, c in own:
            owners[node].append((owner, c))
    bundles: dict[tuple[Part, ...], list[Part]] = defaultdict(list)
    for node, having in owners.items():
        first = having[0][1]
        bundles[tuple((owner, c / first) for owner, c in having)].append((node, first))
    for places, terms in bundles.items():
        if len(places) > 1 and len(terms) >= MANY and all(is_normal(r) for _, r in places):
            whole = terms[0][0].graph.sum(terms)
            alone = len(whole.parts) == 1
            node, factor = whole.parts[0] if alone else (whole, 1.0)
            parts.setdefault(node, list(node.parts))
            inside = {n for n, _ in terms}
            for owner, ratio in places:
                if owner is not node:
                    rest = [(n, c) for n, c in parts[owner] if n not in inside]
                    parts[owner] = [*rest, (node, ratio * factor)]


def _sum_of(a: GraphNode, b: GraphNode, ratio: float, _: Sequence[GraphNode]) -> Part:
    node = a.graph.sum([(a, 1.0), (b, ratio)])
    if len(node.parts) == 1:  # a multiple of the sum
        ((plain, factor),) = node.parts
        return plain, 1 / factor
    return node, 1.0
