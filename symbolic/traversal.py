"""Going through a graph from its operands to its results."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from dmoc.symbolic.graph import (
    CALL,
    CALLED,
    JUNCTION,
    NUMBER,
    PRODUCT,
    RELATION,
    SUM,
    SYMBOL,
    GraphNode,
)

CHILDREN_OF = operator.attrgetter("children")


def reached(results: Iterable[GraphNode]) -> list[GraphNode]:
    """Nodes that results are made of, parts first."""
    return in_order(results, CHILDREN_OF)


def operations(results: Iterable[GraphNode]) -> int:
    """About how many operations results take."""
    count = 0
    seen: set[GraphNode] = set()
    waiting = [*results]
    while waiting:
        node = waiting.pop()
        if node in seen or not node.parts:
            continue
        seen.add(node)
        waiting += node.children
        if node.kind in (SUM, PRODUCT):
            count += len(node.parts) - 1 + sum([abs(weight) != 1 for _, weight in node.parts])
        else:
            count += 1
    return count


def in_order(
    results: Iterable[GraphNode], operands: Callable[[GraphNode], Sequence[GraphNode]]
) -> list[GraphNode]:
    """Results and what they need, operands first."""
    order: list[GraphNode] = []
    seen: set[GraphNode] = set()
    waiting: list[Any] = [*results][::-1]
    while waiting:
        node = waiting.pop()
        if node is None:  # the operands of the next one are done
            order.append(waiting.pop())
        elif node not in seen:
            seen.add(node)
            own = [n for n in operands(node) if n not in seen]
            if own:
                waiting += (node, None)
                own.reverse()
                waiting += own
            else:
                order.append(node)
    return order


def remembered(
    form: Callable[[Sequence[GraphNode]], list[GraphNode]],
) -> Callable[[Sequence[GraphNode]], list[GraphNode]]:
    """Another form of the same results, which is made once."""

    def known(results: Sequence[GraphNode]) -> list[GraphNode]:
        if not results:
            return []
        forms, key = results[0].graph.forms, (form, *results)
        if key not in forms:
            forms[key] = form(results)
        return forms[key]

    return known


def evaluated(
    results: Sequence[GraphNode], values: Mapping[GraphNode, Any], functions: Any
) -> list[Any]:
    """Values of expressions at values of their symbols; ``functions`` is a module that has those
    of the expressions, such as mpmath."""
    done = dict(values)
    for node in reached(results):
        if node.kind == NUMBER:
            done[node] = node.value
        elif node.kind == SUM:
            done[node] = node.value + sum(c * done[n] for n, c in node.parts)
        elif node.kind == PRODUCT:
            done[node] = math.prod(done[n] ** e for n, e in node.parts)
        elif node.kind != SYMBOL:
            parts = [done[n] for n in node.parts]
            done[node] = _value(node, parts, functions)
    return [done[r] for r in results]


def _value(node: GraphNode, parts: Sequence[Any], functions: Any) -> Any:
    if node.kind == CALL and node.value == "pow":
        return parts[0] ** parts[1]
    if node.kind == CALL:
        return getattr(functions, node.value)(*parts)
    if node.kind == CALLED:
        return node.value.at(parts)
    if node.kind == RELATION:
        return COMPARISONS[node.value](*parts)
    if node.kind == JUNCTION:
        return (all if node.value == "And" else any)(parts)
    holds = (value for value, condition in zip(parts[:-1:2], parts[1::2], strict=True) if condition)
    return next(holds, parts[-1])


COMPARISONS = {"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge,
               "==": operator.eq, "!=": operator.ne}  # fmt: skip
