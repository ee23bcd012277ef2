"""Derivatives of SymPy's expressions term by term are SymPy's own, and what is too wide to be
printed in two dimensions is known before it is."""

from __future__ import annotations

from typing import Any

import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from dmoc.symbolic.derivation.document import _least_width
from dmoc.symbolic.graph import Graph
from dmoc.symbolic.slopes import slope

x, y = sp.symbols("x y", real=True)
a = dynamicsymbols("a")
FORMS = [
    sp.Integer(3), x, y, x + y, 3 * x * y - x / y, (x + y) ** 2 * (x - y) * sp.sin(x * y),
    x * (x + 1) * (x + 2) * (y - x), sp.Piecewise((x * y, x < y), (y**2, True)) * x,
    sp.sqrt(x**2 + y**2) / (1 + x * sp.exp(-x * y)), sp.Abs(x) * x + sp.Function("f")(x, y) * x,
    sp.Derivative(sp.Function("f")(x), x) * x + a.diff() * x, 2.5 * x * (x * y + 0.5),
]  # fmt: skip


@pytest.mark.parametrize("form", FORMS, ids=str)
def test_a_slope_is_the_derivative_of_sympy(form: Any) -> None:
    for symbol in (x, y):
        assert slope(form, symbol) == form.diff(symbol)
        assert slope(slope(form, x), symbol) == form.diff(x).diff(symbol)


def test_a_slope_by_a_rate_is_one_too() -> None:
    lagrangian = x * a.diff() ** 2 / 2 - y * sp.cos(a) * a.diff()
    for symbol in (a, a.diff()):
        assert slope(lagrangian, symbol) == lagrangian.diff(symbol)


def test_a_slope_of_a_node_is_that_of_its_graph() -> None:
    g = Graph()
    p, q = g.symbol("p"), g.symbol("q")
    assert slope(p * q * q, q) is (p * q * q).diff(q)


@pytest.mark.parametrize("form", FORMS, ids=str)
def test_no_expression_is_printed_narrower_than_it_is_said_to_be(form: Any) -> None:
    for e in (form, form**2, 1 / form, sp.expand(form), form.diff(x) + 1):
        lines = sp.pretty(e, use_unicode=False, wrap_line=False, num_columns=10_000).split("\n")
        assert _least_width(e) <= max(map(len, lines))


def test_a_sum_is_at_least_as_wide_as_its_terms_and_signs() -> None:
    terms = sp.symbols("a:9")
    assert _least_width(sum(terms)) == 9 + 8 * 3 == _least_width(x / sum(terms) ** 2)
