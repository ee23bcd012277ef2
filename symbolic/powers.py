"""Limits of high powers from below, such as x^4 + y^4 >= r^4, as those of their roots.

A power is flat in the middle of what it forbids: no slope there leads out of it, to Newton's method
least of all, which multiplies a distance by 1 - 1/n at best.  Its root is a distance, whose slope
is the same everywhere.  Both limits allow the same motions.
"""

from __future__ import annotations

from collections.abc import Set
from typing import Any

import sympy as sp

# From this power on; the slope of a square grows as fast as the distance from the middle.
FLAT = 3
# Where a sum of powers is this share of the way from the middle to its limit, its root is rounded
# off: it has a kink in the middle itself.
ROUNDED = sp.Rational(1, 32)
# What is added to a sum of powers where a parameter may make its limit zero: that has a root, too.
LEAST = sp.Float("1e-150")


def rooted(r: Any, moving: Set[Any]) -> Any:
    """A function that is >= 0 where r is, an expression of real symbols of which some move: with
    the root of a sum of high powers and of what it is at least, where r is their difference and
    parameters of any values leave it so."""
    least, powers = r.as_independent(*moving, as_Add=True)
    n = _degree(powers, moving)
    of_any_sign = {s: sp.Dummy(s.name, real=True) for s in r.free_symbols - moving}
    if n < FLAT or not all(e.xreplace(of_any_sign).is_nonnegative for e in (powers, -least)):
        return r
    rounding = LEAST - ROUNDED**n * least
    return (powers + rounding) ** (1 / n) - (rounding - least) ** (1 / n)


def _degree(e: Any, moving: Set[Any]) -> Any:
    """The lowest power in a sum of powers of what moves."""
    parts = [part for part in e.args if part.has(*moving)]
    if isinstance(e, sp.Add):
        return min(_degree(part, moving) for part in parts)
    if isinstance(e, sp.Mul):
        return sum(_degree(part, moving) for part in parts)
    if isinstance(e, sp.Pow) and e.exp.is_number and e.exp > 0:
        return sp.nsimplify(e.exp) * _degree(e.base, moving)
    return sp.S.One
