"""Functions of their own, which code calls instead of writing them out again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

from dmoc.symbolic.graph import GraphNode, reverse


@dataclass(frozen=True)
class Scalar:
    """A function of its own: a scalar expression in symbols; code calls it for its value and its
    derivatives by the symbols.  What it contains beside them are ``constants`` for it."""

    name: str
    symbols: tuple[GraphNode, ...]
    body: GraphNode
    constants: tuple[GraphNode, ...] = ()
    _weighted: dict[tuple[int, ...], Scalar] = field(default_factory=dict, compare=False)

    def __call__(self, arguments: Sequence[GraphNode]) -> GraphNode:
        return self.body.graph.result(self, (), tuple(arguments))

    @cached_property
    def slopes(self) -> list[GraphNode]:
        return reverse(self.body, self.symbols)

    def weighted(self, places: tuple[int, ...]) -> Scalar:
        """The sum of some of its value (0) and its slopes (1, ...), each times a weight, which are
        more arguments."""
        if places not in self._weighted:
            g, values = self.body.graph, [self.body, *self.slopes]
            weights = [g.symbol(f"{self.name}_w{i}") for i in places]
            body = g.sum((w * values[i], 1.0) for w, i in zip(weights, places, strict=True))
            name = f"{self.name}_w{len(self._weighted) or ''}"
            self._weighted[places] = Scalar(name, (*self.symbols, *weights), body, self.constants)
        return self._weighted[places]

    def derivative(self, path: tuple[int, ...]) -> GraphNode:
        """Its derivative by the symbols of these numbers."""
        if not path:
            return self.body
        node = self.slopes[path[0]]
        for i in path[1:]:
            node = node.diff(self.symbols[i])
        return node


@dataclass(frozen=True)
class Stationary(Scalar):
    """A function whose value does not change where a node of it does, as the angle at which it is
    least: its slopes are those at that angle."""

    at: GraphNode = field(kw_only=True)

    @cached_property
    def slopes(self) -> list[GraphNode]:
        g = self.body.graph
        still = g.symbol(f"{self.name}_at")
        slopes = reverse(self.body.subs({self.at: still}), self.symbols)
        return [slope.subs({still: self.at}) for slope in slopes]
