"""Derivatives of functions by their arguments."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

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
