"""Derivatives of functions by their arguments, and of expressions of SymPy."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import sympy as sp

if TYPE_CHECKING:
    from dmoc.symbolic.graph import Graph, GraphNode


def _of_power(g: Graph, b: GraphNode, e: GraphNode) -> tuple[GraphNode, GraphNode]:
    return e * g.apply("pow", b, e - 1), g.apply("pow", b, e) * g.apply("log", b)


# By the names that they have in C.
SLOPES: dict[str, Callable[..., tuple[GraphNode, ...]]] = {
    "sin": lambda g, x: (g.apply("cos", x),),
    "cos": lambda g, x: (-g.apply("sin", x),),
    "tan": lambda g, x: (1 + g.apply("tan", x) ** 2,),
    "asin": lambda g, x: ((1 - x**2) ** -0.5,),
    "acos": lambda g, x: (-((1 - x**2) ** -0.5),),
    "atan": lambda g, x: (1 / (1 + x**2),),
    "atan2": lambda g, y, x: (x / (x**2 + y**2), -y / (x**2 + y**2)),
    "sinh": lambda g, x: (g.apply("cosh", x),),
    "cosh": lambda g, x: (g.apply("sinh", x),),
    "tanh": lambda g, x: (1 - g.apply("tanh", x) ** 2,),
    "asinh": lambda g, x: ((1 + x**2) ** -0.5,),
    "acosh": lambda g, x: ((x - 1) ** -0.5 * (x + 1) ** -0.5,),
    "atanh": lambda g, x: (1 / (1 - x**2),),
    "log": lambda g, x: (1 / x,),
    "exp": lambda g, x: (g.apply("exp", x),),
    "pow": _of_power,
}


def slope(expression: Any, symbol: Any) -> Any:
    """What ``expression.diff(symbol)`` is.  SymPy asks every factor of a product for its derivative
    once for each other factor, and every part for all symbols in it."""
    if isinstance(expression, sp.Basic) and isinstance(symbol, sp.Symbol):
        return _slope(expression, symbol)
    return expression.diff(symbol)  # of a node, which knows what it was asked


@lru_cache(maxsize=20_000)
def _slope(expression: Any, symbol: Any) -> Any:
    if isinstance(expression, sp.Add):
        return sp.Add(*(_slope(e, symbol) for e in expression.args if symbol in _symbols(e)))
    if isinstance(expression, sp.Mul):
        parts = expression.args
        holding = [i for i, e in enumerate(parts) if symbol in _symbols(e)]
        return sp.Add(
            *(sp.Mul(*parts[:i], _slope(parts[i], symbol), *parts[i + 1 :]) for i in holding)
        )
    return expression.diff(symbol)


@lru_cache(maxsize=20_000)
def _symbols(expression: Any) -> frozenset[Any]:
    parts = expression.args
    return frozenset().union(*map(_symbols, parts)) if parts else frozenset(expression.free_symbols)
