"""Nodes of a graph as expressions that people read: what several of them share has a name."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from typing import Any

import sympy as sp

from dmoc.symbolic.derivation.document import Equation
from dmoc.symbolic.derivation.symbols import DisplayNames, latex_symbol
from dmoc.symbolic.graph import (
    CALL,
    CALLED,
    CHOICE,
    JUNCTION,
    NUMBER,
    PRODUCT,
    RELATION,
    SUM,
    SYMBOL,
    GraphNode,
)
from dmoc.symbolic.traversal import in_order

SHORT = 4  # symbols of an expression that is written again where it is used again
DENOMINATOR = 1000  # of numbers that are written as fractions


class NamedNodes:
    """Writes nodes with the names that some of them have, and names what they share."""

    def __init__(self, own: DisplayNames, names: Iterable[tuple[GraphNode, Any]]) -> None:
        self._own = own
        self._names: dict[GraphNode, Any] = {}
        for node, symbol in names:
            if node.kind != NUMBER:
                self._names.setdefault(node, symbol)
            if node.kind == SUM and len(node.parts) == 1 and node.value == 0:
                ((plain, sign),) = node.parts
                if abs(sign) == 1 and plain.kind != SYMBOL:
                    self._names.setdefault(plain, symbol / _number(sign))
        self._count = 0

    def write(self, results: Sequence[GraphNode]) -> tuple[list[Equation], list[Any]]:
        """Equations of the names that are new, and the results."""
        order = in_order(results, lambda n: () if n in self._names else n.children)
        uses: dict[GraphNode, int] = dict.fromkeys(results, 1)
        for node in order:
            for child in () if node in self._names else node.children:
                uses[child] = uses.get(child, 0) + 1
        new: list[Equation] = []
        written: dict[GraphNode, Any] = {}
        size: dict[GraphNode, int] = {}
        for node in order:
            if node in self._names:
                written[node], size[node] = self._names[node], 1
                continue
            size[node] = max(1, sum(size[child] for child in node.children))
            written[node] = _expression(node, written)
            if uses[node] > 1 and size[node] > SHORT and node.kind not in (RELATION, JUNCTION):
                self._count += 1
                symbol = self._own.symbol(f"z_{self._count}", "shared")
                new.append(Equation(str(symbol), latex_symbol(str(symbol)), written[node]))
                self._names[node], written[node], size[node] = symbol, symbol, 1
        return new, [written[r] for r in results]


def _number(value: float) -> Any:
    """A number, as a fraction where it is one."""
    near = Fraction(value).limit_denominator(DENOMINATOR)
    return sp.Rational(near) if float(near) == value else sp.Float(value)


def _expression(node: GraphNode, written: dict[GraphNode, Any]) -> Any:
    if node.kind == NUMBER:
        return _number(node.value)
    if node.kind == SUM:
        terms = [_number(c) * written[n] for n, c in node.parts]
        return sp.Add(_number(node.value), *terms)
    if node.kind == PRODUCT:
        return sp.Mul(*(written[n] ** _number(e) for n, e in node.parts))
    parts = [written[n] for n in node.parts]
    if node.kind == CALL:
        return parts[0] ** parts[1] if node.value == "pow" else getattr(sp, node.value)(*parts)
    if node.kind == CALLED:
        return sp.Function(node.value.name)(*parts)
    if node.kind == CHOICE:
        pairs = zip(parts[:-1:2], parts[1::2], strict=True)
        return sp.Piecewise(*pairs, (parts[-1], True))
    return sp.Rel(*parts, node.value) if node.kind == RELATION else getattr(sp, node.value)(*parts)
