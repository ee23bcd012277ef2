"""Other forms of the same expressions, which take fewer operations."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from heapq import heapify, heappop, heappush
from itertools import chain

from dmoc.symbolic.graph import PRODUCT, SUM, GraphNode
from dmoc.symbolic.pairs import Part, with_shared_sums
from dmoc.symbolic.traversal import operations, reached, remembered

# Operations of rows from which on no other way to write them is looked for.
LONG = 5000


def cheapest(ways: Iterable[list[list[GraphNode]]]) -> list[list[GraphNode]]:
    """The way to write some rows that takes fewest operations; of long ones the first, which is the
    cheapest where derivatives are large."""
    waiting = iter(ways)
    first = next(waiting)
    if operations(chain.from_iterable(first)) > LONG:
        return first
    others = list(waiting)
    return min((first, *others), key=_cost) if others else first


def shared(rows: list[list[GraphNode]]) -> list[list[GraphNode]]:
    """The same rows with sums whose common parts are written once."""
    entries = iter(with_shared_sums([e for row in rows for e in row]))
    return [[next(entries) for _ in row] for row in rows]


def _cost(rows: list[list[GraphNode]]) -> int:
    entries = [e for row in rows for e in row if e is not e.graph.zero]
    return operations(with_common_factors(entries))


def flat(terms: Sequence[tuple[GraphNode, GraphNode]]) -> GraphNode:
    """The sum of products of two nodes, of which the second may be a sum, as one sum."""
    parts: list[Part] = []
    for factor, value in terms:
        node, c = _plain((value, 1.0))
        inner = [*node.parts, (node.graph.one, node.value)] if node.kind == SUM else [(node, 1.0)]
        parts += [(n * factor, c * d) for n, d in inner]
    return terms[0][1].graph.sum(parts)


@remembered
def with_common_factors(results: Sequence[GraphNode]) -> list[GraphNode]:
    """The same expressions, where sums stand behind the common factors of terms that nobody else
    needs."""
    nodes = reached(results)
    uses = Counter(results)
    uses.update(chain.from_iterable(node.children for node in nodes))
    new: dict[GraphNode, GraphNode] = {}
    for node in nodes:
        if node.kind != SUM or len(node.parts) < 2:
            new[node] = node.rebuilt(new)
        else:
            opened, constant = _opened(node, uses)
            alone = [(new[n], c) for n, c in opened if uses[n] == 1]
            others = [(new[n], c) for n, c in opened if uses[n] > 1]
            new[node] = node.graph.sum([*others, *_factored(alone)], constant)
    return [new[r] for r in results]


def _opened(node: GraphNode, uses: Counter[GraphNode]) -> tuple[list[Part], float]:
    """The terms of a sum and its constant, and those of sums in it that nobody else needs."""
    terms, constant = [], node.value
    for n, c in node.parts:
        if n.kind == SUM and uses[n] == 1 and (abs(c) == 1 or len(n.parts) == 1):
            inner, value = _opened(n, uses)
            terms += [(m, c * d) for m, d in inner]
            constant += c * value
        else:
            terms.append((n, c))
    return terms, constant


def _factored(terms: Sequence[Part]) -> list[Part]:
    """Terms of a sum, in which the factor that most of them share stands before a sum, and so
    on."""
    if len(terms) < 2:
        return [*map(_plain, terms)]
    products, taken = dict(enumerate(map(_plain, terms))), list[Part]()
    owners: defaultdict[tuple[GraphNode, int], list[int]] = defaultdict(list)
    for i, (node, _) in products.items():
        if node.kind == PRODUCT:
            for n, e in node.parts:
                if e == int(e):
                    owners[n, 1 if e > 0 else -1].append(i)
    shared = {(-n.number, -sign): (n, sign) for (n, sign), own in owners.items() if len(own) > 1}
    heap = [(-len(owners[factor]), *key) for key, factor in shared.items()]
    heapify(heap)
    while heap:
        most, *key = heappop(heap)
        factor, sign = shared[key[0], key[1]]
        own = [i for i in owners[factor, sign] if i in products]
        if len(own) < -most:  # others have taken some of them
            if len(own) > 1:
                heappush(heap, (-len(own), key[0], key[1]))
            continue
        g, divided = factor.graph, list[Part]()
        exponents = (e for i in own for n, e in products[i][0].parts if n is factor)
        power = sign * int(min(map(abs, exponents)))
        for i in own:
            n, c = products.pop(i)
            divided.append((g.divided(n, factor, power), c))
        taken.append((g.product([(factor, power), (g.sum(_factored(divided)), 1)]), 1.0))
    return [*taken, *products.values()]


def _plain(term: Part) -> Part:
    """A term whose coefficient is not inside its node."""
    node, c = term
    if node.kind == SUM and len(node.parts) == 1 and not node.value:
        ((node, factor),) = node.parts
        return node, c * factor
    return term
