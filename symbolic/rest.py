"""Powers that are 0 where nothing moves, such as the speed sqrt(vx**2 + vy**2) in a drag.

Derivatives of (vx**2 + vy**2)**(3/2) are 0/0 at rest, with the limit 0 up to the second one.  A
power of a sum of squares, or of what velocities alone make quadratic, is therefore taken of 1 where
its base is 0, times 0: so are its derivatives, of whatever order.  Where they have no limit, that
is the middle of those on all sides.  What would be a jump of a force at rest is refused.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import Any

import sympy as sp

from dmoc.base.errors import ModelError
from dmoc.symbolic.graph import RELATION, GraphNode
from dmoc.symbolic.kinks import plain


def powers_at_rest(
    expressions: Iterable[Any], velocities: Collection[Any], inputs: Collection[Any]
) -> list[Any]:
    """Powers with derivatives 0/0 where velocities or inputs are 0, those inside others first."""
    powers = set().union(*(e.atoms(sp.Pow) for e in expressions))
    chosen = [
        power
        for power in powers
        if _is_broken(power) and power.exp > 0 and _vanishes(power.base, velocities, inputs)
    ]
    return sorted(chosen, key=lambda power: (power.count_ops(), sp.srepr(power)))


def with_limits(base: GraphNode, exponent: float) -> GraphNode:
    """A power whose derivatives are 0 where its base is."""
    g = base.graph
    rests = g.make(RELATION, "==", (base, g.zero))
    moves = g.choice([g.zero, rests, g.one])
    return moves * g.choice([g.one, rests, base]) ** exponent


def check_damping(dissipation: Any, velocities: Collection[Any]) -> None:
    """Refuse a dissipation whose force jumps at rest, or has no slope there."""
    at_rest = dict.fromkeys(velocities, 0)
    for term in sp.Add.make_args(sp.expand_mul(dissipation)):
        factors = [factor.as_base_exp() for factor in sp.Mul.make_args(term)]
        orders = [_order(base, velocities, at_rest) for base, _ in factors]
        broken = [
            base**e
            for (base, e), order in zip(factors, orders, strict=True)
            if order and (isinstance(base, sp.Abs) or _is_broken(base**e))
        ]
        degree = sum(order * e for (_, e), order in zip(factors, orders, strict=True) if order)
        if broken and (degree < 2) == sp.true:
            raise ModelError(
                f"the dissipation contains {plain(broken[0])}, whose force jumps or has no slope "
                "at rest: state dry friction by tangents and friction, or use a smooth function, "
                "such as sqrt(v**2 + e**2) for abs(v)."
            )


def has_roots(e: Any) -> bool:
    """Whether an expression contains powers that are broken, or absolute values."""
    return e.has(sp.Abs) or any(map(_is_broken, e.atoms(sp.Pow)))


def _is_broken(power: Any) -> bool:
    return power.is_Pow and bool(power.exp.is_number) and power.exp.is_integer is False


def _vanishes(base: Any, velocities: Collection[Any], inputs: Collection[Any]) -> bool:
    """Whether a base is 0 with all its slopes where its velocities, or its inputs, are 0, or is a
    sum of squares with some of them."""
    for symbols in (velocities, inputs):
        own = base.free_symbols & {*symbols}
        if own and (_is_sum_of_squares(base) or _order(base, own, dict.fromkeys(own, 0)) == 2):
            return True
    return False


def _order(e: Any, symbols: Collection[Any], zero: dict[Any, Any]) -> int:
    """The order in which an expression falls to 0 where symbols are 0: 1 with a slope, 2 without
    one."""
    e = e.args[0] if isinstance(e, sp.Abs) else e
    if not e.free_symbols & {*symbols} or not (e.is_polynomial(*symbols) and _zero(e, zero)):
        return 0
    return 2 if all(_zero(e.diff(s), zero) for s in symbols) else 1


def _zero(e: Any, zero: dict[Any, Any]) -> bool:
    return bool(sp.expand(e.xreplace(zero)) == 0)


def _is_sum_of_squares(e: Any) -> bool:
    if e.is_Add:
        return all(map(_is_sum_of_squares, e.args))
    if e.is_Mul:
        return all(part.is_positive or _is_sum_of_squares(part) for part in e.args)
    return bool(e.is_Pow and e.exp.is_even and e.exp > 0)
