"""Expressions as a graph in which equal ones are one node, and their derivatives.

A sum holds a constant and its terms with coefficients, a product its factors with exponents; both
merge equal parts when they are made, so that what cancels is gone.  A sum inside a sum stays what
it is, because others may use it.  Nodes are numbered in the order in which they are made, so that
an expression comes after its parts.  :func:`reverse` differentiates one expression by all symbols
at once, at a few times its own size; :meth:`GraphNode.diff` differentiates by one symbol, and
whoever asks again finds what was there.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from operator import attrgetter
from typing import TYPE_CHECKING, Any, TypeAlias

from dmoc.base.errors import GenerationError
from dmoc.symbolic.slopes import SLOPES, slope

if TYPE_CHECKING:
    from dmoc.symbolic.scalar import Scalar

Operand: TypeAlias = "GraphNode | float"

NUMBER, SYMBOL, SUM, PRODUCT, CALL, CHOICE, RELATION, JUNCTION, RESULT, CALLED = range(10)
NUMBER_OF = attrgetter("number")


class GraphNode:
    """An expression.

    ``kind`` says what ``parts`` are: of a sum (node, coefficient), of a product (node, exponent),
    of a call its arguments, of a choice values and conditions in turn and the value otherwise, of
    a relation its sides, of a junction conditions, of a result the arguments of its function, as of
    a function that is called (:mod:`dmoc.symbolic.called`).  ``value`` is the number, the constant
    of a sum, the name of a symbol, function, relation or junction, which derivative of which
    function a result is, or the function that is called.
    """

    __slots__ = (
        "_partials", "_slopes", "children", "graph", "kind", "number", "parts", "symbols", "value",
    )  # fmt: skip

    def __init__(self, graph: Graph, number: int, kind: int, value: Any, parts: Any) -> None:
        self.graph, self.number, self.kind = graph, number, kind
        self.value, self.parts = value, parts
        self.children: Sequence[GraphNode] = (
            [node for node, _ in parts] if kind in (SUM, PRODUCT) else parts
        )
        self.symbols = _bits(self.children)  # bits of the symbols that it depends on
        self._slopes: dict[GraphNode, GraphNode] = {}  # derivatives by symbols
        self._partials: list[tuple[GraphNode, GraphNode]] | None = None  # and by children

    def __add__(self, other: Operand) -> GraphNode:
        return self.graph.sum([(self, 1.0), (self.graph.node(other), 1.0)])

    def __sub__(self, other: Operand) -> GraphNode:
        return self.graph.sum([(self, 1.0), (self.graph.node(other), -1.0)])

    def __rsub__(self, other: Operand) -> GraphNode:
        return self.graph.sum([(self.graph.node(other), 1.0), (self, -1.0)])

    def __neg__(self) -> GraphNode:
        return self.graph.sum([(self, -1.0)])

    def __mul__(self, other: Operand) -> GraphNode:
        g, other = self.graph, self.graph.node(other)
        if self is g.one or other is g.zero:
            return other
        if other is g.one or self is g.zero:
            return self
        return g.product([(self, 1), (other, 1)])

    def __truediv__(self, other: Operand) -> GraphNode:
        return self.graph.product([(self, 1), (self.graph.node(other), -1)])

    def __rtruediv__(self, other: Operand) -> GraphNode:
        return self.graph.product([(self.graph.node(other), 1), (self, -1)])

    def __pow__(self, exponent: Operand) -> GraphNode:
        return self.graph.power(self, exponent)

    __radd__, __rmul__ = __add__, __mul__

    def __repr__(self) -> str:
        if self.kind == SYMBOL:
            return str(self.value)
        return f"<GraphNode {self.number}: {self.value} of {len(self.parts)} parts>"

    @property
    def free_symbols(self) -> set[GraphNode]:
        return {s for i, s in enumerate(self.graph.symbols) if self.symbols >> i & 1}

    def subs(self, new: Mapping[GraphNode, GraphNode]) -> GraphNode:
        """The same expression of other nodes in the place of symbols, or of some nodes."""
        made = dict(new)
        for node in _below(self, _bits(new), lambda n: n in made):
            made[node] = node.rebuilt(made)
        return made.get(self, self)

    def rebuilt(self, new: Mapping[GraphNode, GraphNode]) -> GraphNode:
        """The same expression of other parts, where there are others."""
        g = self.graph
        if all(new.get(n, n) is n for n in self.children):
            return self
        if self.kind == SUM:
            return g.sum([(new.get(n, n), c) for n, c in self.parts], self.value)
        if self.kind == PRODUCT:
            return g.product([(new.get(n, n), e) for n, e in self.parts])
        parts = [new.get(n, n) for n in self.parts]
        if self.kind == CALL:
            return g.apply(self.value, *parts)
        if self.kind == CHOICE:
            return g.choice(parts)
        return g.make(self.kind, self.value, tuple(parts))

    def diff(self, symbol: GraphNode) -> GraphNode:
        """Partial derivative by a symbol."""
        for node in _below(self, symbol.symbols, lambda n: symbol in n._slopes):
            node._slopes[symbol] = node._slope(symbol)
        return self._slopes.get(symbol, self.graph.zero)

    def _slope(self, symbol: GraphNode) -> GraphNode:
        g, bit = self.graph, symbol.symbols
        if self is symbol:
            return g.one
        if self.kind == SUM:
            return g.sum((n._slopes[symbol], c) for n, c in self.parts if n.symbols & bit)
        return g.sum((p * n._slopes[symbol], 1.0) for n, p in self.partials() if n.symbols & bit)

    def partials(self) -> list[tuple[GraphNode, GraphNode]]:
        """The partial derivatives of the node by its children."""
        if self._partials is None:
            self._partials = list(self._by_children())
        return self._partials

    def _by_children(self) -> Iterator[tuple[GraphNode, GraphNode]]:
        g = self.graph
        if self.kind == SUM:
            for child, coefficient in self.parts:
                yield child, g.node(coefficient)
        elif self.kind == PRODUCT:
            for i, (child, e) in enumerate(self.parts):
                rest = [*self.parts[:i], (child, e - 1), *self.parts[i + 1 :]]
                yield child, g.product(rest) * e
        elif self.kind == CALL:
            yield from zip(self.parts, SLOPES[self.value](g, *self.parts), strict=True)
        elif self.kind == RESULT:
            function, path = self.value
            for i, argument in enumerate(self.parts):
                yield argument, g.result(function, tuple(sorted((*path, i))), self.parts)
        elif self.kind == CALLED:
            yield from zip(self.parts, self.value.slopes(self), strict=True)
        elif self.kind == CHOICE:
            for i in range(0, len(self.parts), 2):
                picked = [part if j % 2 else g.zero for j, part in enumerate(self.parts)]
                picked[i] = g.one
                yield self.parts[i], g.choice(picked)


@dataclass
class Graph:
    """The nodes of expressions that belong together."""

    symbols: list[GraphNode] = field(default_factory=list)
    called: dict[Any, Any] = field(default_factory=dict)  # functions by what they are made of
    _nodes: dict[tuple[Any, ...], GraphNode] = field(default_factory=dict)
    forms: dict[tuple[Any, ...], list[GraphNode]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.zero, self.one = self.node(0.0), self.node(1.0)

    def make(self, kind: int, value: Any, parts: tuple[Any, ...] = ()) -> GraphNode:
        key = (kind, value, parts)
        node = self._nodes.get(key)
        if node is None:
            if kind == SUM:
                _check_finite(value, *[coefficient for _, coefficient in parts])
            node = self._nodes[key] = GraphNode(self, len(self._nodes), kind, value, parts)
        return node

    def node(self, value: Operand) -> GraphNode:
        """A number as a node; a node as it is."""
        if isinstance(value, GraphNode):
            return value
        _check_finite(value)
        return self.make(NUMBER, float(value) + 0.0)

    def symbol(self, name: str) -> GraphNode:
        node = self.make(SYMBOL, name)
        if not node.symbols:
            node.symbols = 1 << len(self.symbols)
            self.symbols.append(node)
        return node

    def sum(self, terms: Iterable[tuple[GraphNode, float]], constant: float = 0.0) -> GraphNode:
        """The sum of nodes times coefficients."""
        merged: dict[GraphNode, float] = {}
        for node, coefficient in terms:
            if node.kind == NUMBER:
                constant += coefficient * node.value
                continue
            if node.kind == SUM and len(node.parts) == 1:  # a multiple
                constant += coefficient * node.value
                ((node, factor),) = node.parts
                coefficient *= factor
            merged[node] = merged.get(node, 0.0) + coefficient
        if len(merged) > 1:
            constant += _cancel(merged)
        parts = _parts(merged)
        if not parts:
            return self.node(constant)
        if len(parts) == 1:
            alone = not constant and parts[0][1] == 1
            return parts[0][0] if alone else self.make(SUM, constant + 0.0, parts)
        first = parts[0][1]  # a sum and its multiple share what they have in common
        size = abs(first)
        alike = is_normal(constant / first) and all(abs(c) == size for _, c in parts)
        common = first if alike else math.copysign(1.0, first)
        if common == 1:
            return self.make(SUM, constant + 0.0, parts)
        plain = self.make(SUM, constant / common + 0.0, tuple([(n, c / common) for n, c in parts]))
        return self.make(SUM, 0.0, ((plain, common),))

    def product(self, factors: Iterable[tuple[GraphNode, float]]) -> GraphNode:
        """The product of nodes with numbers as exponents."""
        coefficient = 1.0
        merged: dict[GraphNode, float] = {}
        waiting = list(factors)[::-1]
        while waiting:
            node, e = waiting.pop()
            if not e:
                continue
            kind, once, whole = node.kind, e == 1, e == int(e)
            if whole and kind == SUM and len(node.parts) == 1 and not node.value:
                ((inner, factor),) = node.parts
                coefficient *= factor if once else _power(factor, e)
                waiting.append((inner, e))
            elif once and kind == PRODUCT:  # its parts are none of those above or below
                for n, other in node.parts:
                    merged[n] = merged.get(n, 0) + other
            elif whole and kind == PRODUCT:
                waiting += [(n, other * e) for n, other in node.parts]
            elif kind == NUMBER and (whole or node.value >= 0):
                coefficient *= _power(node.value, e)
            else:
                merged[node] = merged.get(node, 0) + e
        parts = _parts(merged)
        if not parts or not coefficient:
            return self.node(coefficient)
        plain = len(parts) == 1 and parts[0][1] == 1
        node = parts[0][0] if plain else self.make(PRODUCT, None, parts)
        if node.kind == PRODUCT and coefficient != 1:
            return self.make(SUM, 0.0, ((node, coefficient),))
        return node if coefficient == 1 else self.sum([(node, coefficient)])

    def divided(self, product: GraphNode, factor: GraphNode, power: int) -> GraphNode:
        """A product without one of its factors, to a power that it has at least."""
        parts = tuple(
            (n, e - power if n is factor else e)
            for n, e in product.parts
            if n is not factor or e != power
        )
        alone = len(parts) == 1 and parts[0][1] == 1
        return parts[0][0] if alone else self.make(PRODUCT, None, parts) if parts else self.one

    def power(self, base: GraphNode, exponent: Operand) -> GraphNode:
        if isinstance(exponent, GraphNode) and exponent.kind != NUMBER:
            return self.apply("pow", base, exponent)
        e = exponent.value if isinstance(exponent, GraphNode) else float(exponent)
        return self.product([(base, int(e) if e == int(e) else e)])

    def apply(self, function: str, *arguments: GraphNode) -> GraphNode:
        """A function of nodes; of numbers it is a number."""
        if function not in SLOPES:
            raise GenerationError(f"the function {function} has no derivative here.")
        if all(a.kind == NUMBER for a in arguments):
            values = [a.value for a in arguments]
            try:
                return self.node(getattr(math, function)(*values))
            except (ValueError, OverflowError):
                listed = ", ".join(f"{value:g}" for value in values)
                raise GenerationError(
                    f"{function}({listed}), or a derivative that contains it, is no real number of "
                    "C: expected expressions that are real and below 1.8e308; use other units."
                ) from None
        return self.make(CALL, function, arguments)

    def choice(self, parts: Sequence[GraphNode]) -> GraphNode:
        """The first value whose condition holds, or the last one."""
        same = all(value is parts[-1] for value in parts[::2])
        return parts[-1] if same else self.make(CHOICE, None, tuple(parts))

    def result(
        self, function: Scalar, path: tuple[int, ...], arguments: tuple[GraphNode, ...]
    ) -> GraphNode:
        """A function, or a derivative of it, at arguments."""
        if function.derivative(path) is self.zero:
            return self.zero
        return self.make(RESULT, (function, path), arguments)


def _cancel(terms: dict[GraphNode, float]) -> float:
    """Open the sums among terms of which a part cancels another term, or a part of another one;
    return their constants."""
    sums = [n for n in terms if n.kind == SUM]
    if not sums:
        return 0.0
    seen: dict[GraphNode, float] = dict(terms)
    opened: dict[GraphNode, None] = {}
    sources: dict[GraphNode, list[GraphNode]] = {}
    for node in sums:
        for part, c in node.parts:
            value = terms[node] * c
            if part in seen and seen[part] == -value:
                opened.update(dict.fromkeys([node, *sources.get(part, [])]))
            else:
                seen[part] = value
                sources[part] = [node]
    constant = 0.0
    for node in opened:
        c = terms.pop(node)
        constant += c * node.value
        for part, factor in node.parts:
            terms[part] = terms.get(part, 0.0) + c * factor
    return constant


def _parts(merged: Mapping[GraphNode, float]) -> tuple[tuple[GraphNode, float], ...]:
    """Nodes and their weights but for those without any, in the order of the nodes."""
    if len(merged) == 1:
        return tuple([part for part in merged.items() if part[1]])
    return tuple([(n, c) for n in sorted(merged, key=NUMBER_OF) if (c := merged[n])])


def _power(base: float, exponent: float) -> float:
    if not base and exponent < 0:
        raise GenerationError("an expression divides by a constant that is 0: remove it.")
    try:
        return float(base**exponent)
    except OverflowError:
        return math.inf  # which no node takes


def is_normal(value: float) -> bool:
    """Whether a float is zero, or has all its digits."""
    return not value or sys.float_info.min <= abs(value) <= sys.float_info.max


def _check_finite(*constants: float) -> None:
    for value in constants:
        if not math.isfinite(value):
            raise GenerationError(
                f"a constant of an expression or of its derivatives is {value}: expected "
                "magnitudes below 1.8e308; use other units."
            )


def _bits(symbols: Iterable[GraphNode]) -> int:
    bits = 0
    for s in symbols:
        bits |= s.symbols
    return bits


def _below(root: GraphNode, bits: int, done: Callable[[GraphNode], bool]) -> list[GraphNode]:
    """Nodes below a root that depend on symbols and are not done, parts first."""
    open_nodes: set[GraphNode] = set()
    waiting = [root]
    while waiting:
        node = waiting.pop()
        if node.symbols & bits and node not in open_nodes and not done(node):
            open_nodes.add(node)
            waiting += node.children
    return sorted(open_nodes, key=NUMBER_OF)


def reverse(expression: GraphNode, symbols: Sequence[GraphNode]) -> list[GraphNode]:
    """Partial derivatives of an expression by symbols, or by other nodes that no other of them
    contains, from its end to its beginning."""
    g, variables, bits = expression.graph, set(symbols), _bits(symbols)
    adjoints: dict[GraphNode, list[tuple[GraphNode, float]]] = {expression: [(g.one, 1.0)]}
    totals: dict[GraphNode, GraphNode] = {}
    for node in reversed(_below(expression, bits, lambda n: False)):
        total = totals[node] = g.sum(adjoints.pop(node, []))
        if node not in variables:
            for child, slope in node.partials():
                if child.symbols & bits:
                    adjoints.setdefault(child, []).append((total * slope, 1.0))
    return [totals.get(s, g.zero) for s in symbols]


def gradient(expression: Any, symbols: Sequence[Any]) -> list[Any]:
    """Partial derivatives of a node, or of an expression of SymPy."""
    if isinstance(expression, GraphNode):
        return reverse(expression, symbols)
    return [slope(expression, s) for s in symbols]
