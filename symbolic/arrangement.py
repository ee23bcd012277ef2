"""Other forms of the same expressions, which take fewer operations."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence

from dmoc.symbolic.graph import PRODUCT, SUM, Node
from dmoc.symbolic.pairs import Part, with_shared_sums
from dmoc.symbolic.traversal import operations, reached


def cheapest(ways: Iterable[list[list[Node]]]) -> list[list[Node]]:
    """Of the ways to write some rows, as they are or with sums that share what they have in common,
    the one that takes fewest operations."""
    return min((form for rows in ways for form in (_shared(rows), rows)), key=_cost)


def _shared(rows: list[list[Node]]) -> list[list[Node]]:
    entries = iter(with_shared_sums([e for row in rows for e in row]))
    return [[next(entries) for _ in row] for row in rows]


def _cost(rows: list[list[Node]]) -> int:
    return operations(with_common_factors([e for row in rows for e in row]))


def flat(terms: Sequence[tuple[Node, Node]]) -> Node:
    """The sum of products of two nodes, of which the second may be a sum, as one sum."""
    parts: list[Part] = []
    for factor, value in terms:
        node, c = _plain((value, 1.0))
        inner = [*node.parts, (node.graph.one, node.value)] if node.kind == SUM else [(node, 1.0)]
        parts += [(n * factor, c * d) for n, d in inner]
    return terms[0][1].graph.sum(parts)


def with_common_factors(results: Sequence[Node]) -> list[Node]:
    """The same values, where sums have taken out what terms that nobody else needs share."""
    nodes = reached(results)
    uses = Counter(results)
    for node in nodes:
        uses.update(node.children)
    new: dict[Node, Node] = {}
    for node in nodes:
        new[node] = node.rebuilt(new)
        if node.kind == SUM and len(node.parts) > 1:
            opened, constant = _opened(node, uses)
            alone = [(new[n], c) for n, c in opened if uses[n] == 1]
            others = [(new[n], c) for n, c in opened if uses[n] > 1]
            new[node] = node.graph.sum([*others, *_factored(alone)], constant)
    return [new[r] for r in results]


def _opened(node: Node, uses: Counter[Node]) -> tuple[list[Part], float]:
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
    products, taken = [_plain(term) for term in terms], list[Part]()
    while True:
        count: Counter[tuple[Node, bool]] = Counter()
        for node, _ in products:
            if node.kind == PRODUCT:
                count.update((n, e > 0) for n, e in node.parts if e == int(e))
        (factor, above), most = max(
            count.items(), key=lambda c: (c[1], c[0][0].number, c[0][1]), default=((None, True), 0)
        )
        if factor is None or most < 2:
            return [*taken, *products]
        g, sign = factor.graph, 1 if above else -1
        inside = [
            (g.product([(n, 1), (factor, -sign)]), c)
            for n, c in products
            if _has_factor(n, factor, sign)
        ]
        taken.append((g.product([(factor, sign), (g.sum(_factored(inside)), 1)]), 1.0))
        products = [p for p in products if not _has_factor(p[0], factor, sign)]


def _has_factor(node: Node, factor: Node, sign: int) -> bool:
    return node.kind == PRODUCT and any(
        n is factor and e * sign > 0 and e == int(e) for n, e in node.parts
    )


def _plain(term: Part) -> Part:
    """A term whose coefficient is not inside its node."""
    node, c = term
    if node.kind == SUM and len(node.parts) == 1 and not node.value:
        ((node, factor),) = node.parts
        return node, c * factor
    return term
