"""Gauss points and nodes of polynomials on [0, 1], exactly, and the polynomials through nodes."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import sympy as sp


@cache  # as what follows: every step of an order has the same ones
def quadrature(degree: int) -> tuple[Sequence[Any], Sequence[Any]]:
    """Exact Gauss points and weights on [0, 1], as many as the degree."""
    x = sp.Symbol("x")
    polynomial = sp.legendre(degree, x)
    roots = _roots(polynomial, x)
    slopes = [polynomial.diff(x).subs(x, r) for r in roots]
    weights = [sp.radsimp(1 / ((1 - r**2) * s**2)) for r, s in zip(roots, slopes, strict=True)]
    return tuple((1 + r) / 2 for r in roots), tuple(weights)


@cache
def lobatto_nodes(degree: int) -> Sequence[Any]:
    """Exact nodes on [0, 1] of polynomials of a degree: first, last, inside."""
    x = sp.Symbol("x")
    inside = _roots(sp.legendre(degree, x).diff(x), x)
    return (sp.S.Zero, sp.S.One, *((1 + r) / 2 for r in inside))


def _roots(polynomial: Any, x: Any) -> list[Any]:
    return sorted(map(sp.expand, sp.roots(polynomial, x)), key=float)


@cache
def shape_functions(nodes: tuple[Any, ...], c: Any, derivative: int = 0) -> Sequence[Any]:
    """Lagrange polynomials of the nodes at c, or their derivatives."""
    x = sp.Symbol("x")
    weights = []
    for a in nodes:
        polynomial = sp.prod([(x - b) / (a - b) for b in nodes if b != a])
        weights.append(sp.radsimp(sp.expand(polynomial.diff(x, derivative).subs(x, c))))
    return tuple(weights)
