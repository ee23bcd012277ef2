"""From expressions of SymPy to nodes of a graph."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import sympy as sp
from sympy.core.evalf import PrecisionExhausted
from sympy.functions.elementary.piecewise import ExprCondPair
from sympy.logic.boolalg import Boolean

from dmoc.base.errors import GenerationError
from dmoc.symbolic.called import CalledFunction, Function
from dmoc.symbolic.graph import JUNCTION, RELATION, Graph, GraphNode
from dmoc.symbolic.pairs import with_shared_sums
from dmoc.symbolic.scalar import Scalar
from dmoc.symbolic.slopes import SLOPES

RELATIONS = {
    "StrictLessThan": "<", "LessThan": "<=", "StrictGreaterThan": ">", "GreaterThan": ">=",
    "Equality": "==", "Unequality": "!=",
}  # fmt: skip
KINKS = (sp.Abs, sp.sign, sp.Max, sp.Min, sp.Heaviside)
PLAIN = (sp.Add, sp.Mul, sp.Pow, sp.Symbol, sp.exp, sp.Piecewise, Boolean, sp.Rational, sp.Float)
FUNCTIONS = frozenset(SLOPES) - {"pow", "exp"}


def to_nodes(
    graph: Graph, expressions: Sequence[Any], table: Mapping[Any, GraphNode]
) -> list[GraphNode]:
    """Expressions of SymPy as nodes; ``table`` has the nodes of their symbols."""
    return with_shared_sums(plain_nodes(graph, expressions, table))


def plain_nodes(
    graph: Graph, expressions: Sequence[Any], table: Mapping[Any, GraphNode]
) -> list[GraphNode]:
    """Expressions as nodes of a graph, with sums as SymPy writes them."""
    made: dict[Any, GraphNode] = dict(table)

    def convert(e: Any) -> GraphNode:
        node = made.get(e)
        if node is None:
            node = made[e] = _converted(graph, e, convert)
        return node

    return [convert(_checked(e)) for e in expressions]


def _converted(g: Graph, e: Any, convert: Callable[[Any], GraphNode]) -> GraphNode:
    if isinstance(e, sp.Expr) and e.is_number:
        value = _constant(e)
        if value is not None:
            return g.node(value)
    if e.is_Add:
        return g.sum([(convert(a), 1.0) for a in e.args])
    if e.is_Mul:
        return g.product([(convert(a), 1) for a in e.args])
    if e.is_Pow:
        exponent = _constant(e.exp) if e.exp.is_number else None
        return g.power(convert(e.base), convert(e.exp) if exponent is None else exponent)
    if isinstance(e, sp.Piecewise):
        return _choice(g, e, convert)
    if isinstance(e, KINKS):
        return _kink(g, e, convert)
    if e.is_Relational:
        return g.make(RELATION, RELATIONS[type(e).__name__], (convert(e.lhs), convert(e.rhs)))
    if isinstance(e, (sp.And, sp.Or)):
        parts = sorted((convert(a) for a in e.args), key=lambda n: n.number)
        return g.make(JUNCTION, type(e).__name__, tuple(parts))
    if isinstance(e, CalledFunction):
        return _called(g, type(e))([convert(a) for a in e.args])
    if e.is_Symbol:
        raise GenerationError(f"the symbol {e} is no input of the kernel.")
    return g.apply(type(e).__name__, *(convert(a) for a in e.args))


def _called(g: Graph, kind: type[CalledFunction]) -> Function | Scalar:
    """A function that code calls, which is made once."""
    if kind not in g.called:
        g.called[kind] = kind.function(g, plain_nodes)
    made: Function | Scalar = g.called[kind]
    return made


def _constant(e: Any) -> float | None:
    """The value of a constant; None where it is made of others one of which is 0 in all digits."""
    try:
        value = e.evalf(strict=True)
    except PrecisionExhausted:
        return 0.0 if e.is_Add else None
    if not value.is_extended_real:
        raise GenerationError(f"the constant {sp.sstr(e)} is {value}: expected a real number.")
    return float(value)


def _choice(g: Graph, e: Any, convert: Callable[[Any], GraphNode]) -> GraphNode:
    parts: list[GraphNode] = []
    for value, condition in e.args:
        if condition is sp.true:
            return g.choice([*parts, convert(value)])
        if condition is not sp.false:
            parts += [convert(value), convert(condition)]
    raise GenerationError(f"the Piecewise {e} has no value elsewhere: end it with (value, True).")


def _kink(g: Graph, e: Any, convert: Callable[[Any], GraphNode]) -> GraphNode:
    """A function with a kink as a choice, which can be differentiated."""

    def relation(a: GraphNode, sign: str, b: GraphNode) -> GraphNode:
        return g.make(RELATION, sign, (a, b))

    first, *others = (convert(a) for a in e.args)
    if isinstance(e, (sp.Max, sp.Min)):
        sign = ">=" if isinstance(e, sp.Max) else "<="
        for other in others:
            first = g.choice([first, relation(first, sign, other), other])
        return first
    if isinstance(e, sp.Abs):
        return g.choice([first, relation(first, ">=", g.zero), -first])
    below, at = (-g.one, g.zero) if isinstance(e, sp.sign) else (g.zero, others[0])
    parts = [below, relation(first, "<", g.zero), at, relation(first, "==", g.zero), g.one]
    return g.choice(parts)


def _checked(expression: Any) -> Any:
    """The expression, where a printer knows all of it."""
    for node in sp.preorder_traversal(expression):
        if not _is_printable(node):
            raise GenerationError(
                f"{sp.sstr(node)} cannot be turned into C: use +, -, *, /, powers, Abs, sign, Min, "
                "Max, Piecewise and "
                f"{', '.join(sorted(FUNCTIONS))}, exp, sqrt."
            )
    return expression


def _is_printable(node: Any) -> bool:
    if isinstance(node, (*PLAIN, *KINKS, CalledFunction)):
        return not isinstance(node, (sp.Not, sp.Xor, sp.ITE))
    if isinstance(node, ExprCondPair) or node in (sp.pi, sp.E):
        return True
    return isinstance(node, sp.Function) and type(node).__name__ in FUNCTIONS
