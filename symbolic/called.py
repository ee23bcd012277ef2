"""Functions that code calls by their names: in the graph, and as functions of SymPy.

An angle at which something is least is the root of its slope: its derivatives are those of an
implicit function, of any order, and not those of the iteration that finds it.  A number that says
which of several values is the largest has none.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any, cast

import sympy as sp

from dmoc.base.angles import least_angle
from dmoc.symbolic.graph import CALLED, RELATION, Graph, GraphNode
from dmoc.symbolic.scalar import Scalar, Stationary
from dmoc.symbolic.spec import Input, KernelSpec, Output
from dmoc.symbolic.traversal import evaluated, reached

# Second derivatives below it are taken for it: where there is no angle that is nearest, as about an
# axis, none may be a divisor.
FLAT = 1e-9


@dataclass(frozen=True)
class Function(ABC):
    """A function of ``symbols``: what its code computes, and its slopes."""

    name: str
    symbols: tuple[GraphNode, ...]
    body: GraphNode

    def __call__(self, arguments: Sequence[GraphNode]) -> GraphNode:
        return self.body.graph.make(CALLED, self, tuple(arguments))

    @property
    def kernel(self) -> KernelSpec:
        """What it calls: ``values`` of symbols z."""
        inputs = (Input("z", self.arguments),)
        return KernelSpec(f"{self.name}_terms", "", inputs, (Output.vector("d", self.values),))

    @property
    def arguments(self) -> tuple[GraphNode, ...]:
        """Of its kernel."""
        return self.symbols

    @property
    @abstractmethod
    def values(self) -> list[GraphNode]:
        """What its kernel computes."""

    @abstractmethod
    def at(self, arguments: Sequence[Any]) -> float:
        """Its value at numbers."""

    @abstractmethod
    def slopes(self, node: GraphNode) -> list[GraphNode]:
        """Its derivatives by its arguments, at a node of it."""


@dataclass(frozen=True)
class Least(Function):
    """The angle at which ``body`` is least, found from so many places."""

    angle: GraphNode
    places: int

    @property
    def arguments(self) -> tuple[GraphNode, ...]:
        return (*self.symbols, self.angle)

    @cached_property
    def values(self) -> list[GraphNode]:
        slope = self.body.diff(self.angle)
        return [self.body, slope, slope.diff(self.angle)]

    def at(self, arguments: Sequence[Any]) -> float:
        def terms(z: Sequence[Any], _: Any) -> list[Any]:
            numbers = map(float, z)
            return evaluated(self.values, dict(zip(self.arguments, numbers, strict=True)), math)

        return float(least_angle(terms, arguments, self.places))

    def slopes(self, node: GraphNode) -> list[GraphNode]:
        """Of F(angle, z) = 0, the slope of ``body``: -F_z/F_angle."""
        g, (_, slope, bend) = self.body.graph, self.values
        flat = g.node(FLAT)
        steep = 1 / g.choice([bend, g.make(RELATION, ">", (bend, flat)), flat])
        here = dict(zip(self.arguments, (*node.parts, node), strict=True))
        return [(-slope.diff(s) * steep).subs(here) for s in self.symbols]


@dataclass(frozen=True)
class Number(Function):
    """A number that is one of a few, as that of the largest of several values."""

    @property
    def values(self) -> list[GraphNode]:
        return [self.body]

    def at(self, arguments: Sequence[Any]) -> float:
        numbers = map(float, arguments)
        own = dict(zip(self.symbols, numbers, strict=True))
        return float(evaluated(self.values, own, math)[0])

    def slopes(self, node: GraphNode) -> list[GraphNode]:
        return [self.body.graph.zero] * len(self.symbols)


Define = Callable[[Any], Any]  # a name for an expression
Nodes = Callable[[Graph, Sequence[Any], dict[Any, GraphNode]], list[GraphNode]]


class CalledFunction(sp.Function):  # type: ignore[misc]  # SymPy has no types
    """A function of SymPy that is a function of code; ``code`` is its name there."""

    is_extended_real = True
    code: str

    @classmethod
    def function(cls, graph: Graph, nodes: Nodes) -> Function | Scalar:
        """It in a graph, where ``nodes`` makes expressions of SymPy nodes."""
        raise NotImplementedError


class SharedExpression(CalledFunction):
    """An expression in arguments that code has once, with its derivatives."""

    @classmethod
    def value(cls, define: Define, *z: Any) -> Any:
        """The expression, with names for its parts."""
        raise NotImplementedError

    @classmethod
    def eval(cls, *z: Any) -> Any:
        return cls.value(sp.sympify, *z) if all(e.is_number for e in z) else None

    @classmethod
    def function(cls, graph: Graph, nodes: Nodes) -> Function | Scalar:
        symbols, body = cls._written(graph, nodes)
        angles = [n for n in reached([body]) if n.kind == CALLED]
        if angles:
            return Stationary(cls.code, symbols, body, at=angles[0])
        return Scalar(cls.code, symbols, body)

    @classmethod
    def _written(cls, graph: Graph, nodes: Nodes) -> tuple[tuple[GraphNode, ...], GraphNode]:
        """Its symbols and its expression in a graph."""
        own = [sp.Symbol(f"{cls.code}_{i}", real=True) for i in range(cls.nargs.args[0])]
        symbols = tuple(graph.symbol(s.name) for s in own)
        table = dict(zip(own, symbols, strict=True))

        def define(e: Any) -> Any:
            e = sp.sympify(e)
            if e.is_Atom:
                return e
            name = sp.Dummy(real=True)
            (table[name],) = nodes(graph, [e], table)
            return name

        (body,) = nodes(graph, [sp.sympify(cls.value(define, *own))], table)
        return symbols, body


class LargestOf(SharedExpression):
    """A number that says which of several values is the largest: an expression without slopes."""

    @classmethod
    def function(cls, graph: Graph, nodes: Nodes) -> Number:
        symbols, body = cls._written(graph, nodes)
        return Number(cls.code, symbols, body)


class LeastAngle(CalledFunction):
    """The angle at which a function of it and of arguments is least; subclasses say which."""

    places: int  # from which the least is found

    @classmethod
    def eval(cls, *z: Any) -> Any:
        return sp.Float(_alone(cast(Any, cls)).at(z)) if all(e.is_number for e in z) else None

    @classmethod
    def least(cls, angle: Any, *z: Any) -> Any:
        """The function that is least there."""
        raise NotImplementedError

    @classmethod
    def function(cls, graph: Graph, nodes: Nodes) -> Least:
        name, count = cls.code, cls.nargs.args[0]
        own = [sp.Symbol(f"{name}_{i}", real=True) for i in range(count + 1)]
        table = {s: graph.symbol(s.name) for s in own}
        (body,) = nodes(graph, [cls.least(own[-1], *own[:-1])], table)
        *symbols, angle = table.values()
        return Least(name, tuple(symbols), body, angle, cls.places)


@cache
def _alone(kind: Any) -> Any:
    """A function in a graph of its own."""
    from dmoc.symbolic.conversion import plain_nodes  # which converts these functions, too

    return kind.function(Graph(), plain_nodes)
