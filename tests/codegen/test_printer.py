"""Conditions as they are printed: true and false at their edges as written."""

from __future__ import annotations

import numpy as np
import pytest
import symengine as se

from dmoc.codegen.printer import CPrinter, NumPyPrinter

X, Y = se.symbols("x y")


@pytest.mark.parametrize(
    ("condition", "below", "at", "above"),
    [
        (se.Lt(X, Y), True, False, False),
        (se.Le(X, Y), True, True, False),
        (se.Gt(X, Y), False, False, True),
        (se.Ge(X, Y), False, True, True),
        (se.Eq(X, Y), False, True, False),
        (se.Ne(X, Y), True, False, True),
    ],
)
def test_a_relation_holds_where_it_is_written_to(
    condition: object, below: bool, at: bool, above: bool
) -> None:
    names = {"x": "x", "y": "y"}
    for text in (NumPyPrinter(names).condition(condition), CPrinter(names).condition(condition)):
        for x, expected in ((0.9, below), (1.0, at), (1.1, above)):
            assert eval(text, {"np": np}, {"x": x, "y": 1.0}) is expected, text
