"""What a pair of limits may be: two numbers in an order, whatever holds them."""

from __future__ import annotations

from math import inf
from typing import Any

import numpy as np
import pytest

from dmoc.base.arguments import limits
from dmoc.base.errors import ProblemError


@pytest.mark.parametrize(
    ("pair", "ends"),
    [
        (None, (-inf, inf)), ((1, 2), (1.0, 2.0)), ([1, None], (1.0, inf)), ((None, 2), (-inf, 2)),
        (np.array([1.0, 2.0]), (1.0, 2.0)), (np.array([-inf, 3]), (-inf, 3.0)), ((2, 2), (2, 2)),
    ],
)  # fmt: skip
def test_two_numbers_in_an_order_are_limits(pair: Any, ends: tuple[float, float]) -> None:
    assert limits(pair, "x", "expected a pair") == ends


@pytest.mark.parametrize(
    "pair",
    [
        "12", b"12", {1, 2}, {1: 2, 3: 4}, 5, (1,), (1, 2, 3), [], iter((1, 2)), np.array(5.0),
        np.array([[1.0, 2.0], [3.0, 4.0]]), np.array([[1.0], [2.0]]), np.ones(3), object(),
    ],
)  # fmt: skip
def test_nothing_else_is(pair: Any) -> None:
    with pytest.raises(ProblemError, match=r"^x = .*: expected a pair\."):
        limits(pair, "x", "expected a pair")


def test_limits_in_the_other_order_are_refused() -> None:
    with pytest.raises(ProblemError, match="x: the lower bound 2 exceeds the upper bound 1"):
        limits((2, 1), "x", "expected a pair")
