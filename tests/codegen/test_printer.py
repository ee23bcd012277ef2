"""Conditions as they are printed: true and false at their edges as written."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
import sympy as sp
from systems import block_system

from dmoc.codegen.printer import CPrinter, NumPyPrinter, listing
from dmoc.codegen.schedule import schedule
from dmoc.symbolic.conversion import to_nodes
from dmoc.symbolic.families import model_spec
from dmoc.symbolic.graph import Graph

X, Y = sp.symbols("x y")


@pytest.mark.parametrize(
    ("condition", "below", "at", "above"),
    [
        (X < Y, True, False, False),
        (X <= Y, True, True, False),
        (X > Y, False, False, True),
        (X >= Y, False, True, True),
        (sp.Eq(X, Y), False, True, False),
        (sp.Ne(X, Y), True, False, True),
    ],
)
def test_a_relation_holds_where_it_is_written_to(
    condition: Any, below: bool, at: bool, above: bool
) -> None:
    graph = Graph()
    x, y = graph.symbol("x"), graph.symbol("y")
    (choice,) = to_nodes(graph, [sp.Piecewise((1, condition), (0, True))], {X: x, Y: y})
    relation = choice.parts[1]
    plan = schedule([relation], {}, ())
    for printer in (NumPyPrinter, CPrinter):
        text = printer(plan, {x: "x", y: "y"}).text(relation)
        for value, expected in ((0.9, below), (1.0, at), (1.1, above)):
            assert eval(text, {"np": np}, {"x": value, "y": 1.0}) is expected, text


def test_a_long_number_that_stands_at_several_places_has_a_name() -> None:
    """A step of order 4 takes its forces at (3 - sqrt(3))/6 of it."""
    for make in (CPrinter, NumPyPrinter):
        kernel = model_spec(block_system(), 4).kernels[0]
        code = listing(kernel, make)
        texts = [text for _, text in (*code.statements, *code.results)]
        for name, number in code.constants:
            assert len(number) >= 8
            assert sum(len(re.findall(rf"\b{name}\b", text)) for text in texts) > 1
            assert not any(number in text for text in texts)
        numbers = [float(number) for _, number in code.constants]
        assert pytest.approx((3 - 3**0.5) / 6, rel=1e-15) in numbers
