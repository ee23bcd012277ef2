"""What a number and a pair of limits may be, whatever holds them, and what is meant by a name."""

from __future__ import annotations

from fractions import Fraction
from math import inf
from typing import Any

import numpy as np
import pytest

from dmoc.base.arguments import check_known, is_number, limits
from dmoc.base.errors import ProblemError


@pytest.mark.parametrize(
    ("value", "number"),
    [
        (1, True), (1.5, True), (np.float32(1), True), (np.int8(1), True), (Fraction(1, 3), True),
        (np.array(1.5), True), (np.array(2), True), (np.ma.masked_array(1.5, mask=False), True),
        (np.ma.masked_array(1.5, mask=True), False), (np.array([1.5]), False), ("1", False),
        (np.array(True), False), (np.array(1j), False), (np.array("1"), False), (None, False),
        (True, False), (np.bool_(1), False), (1j, False), (b"1", False), ([1.0], False),
    ],
)  # fmt: skip
def test_what_counts_as_one_real_number(value: Any, number: bool) -> None:
    assert is_number(value) is number


def test_the_nearest_of_the_names_is_meant() -> None:
    names = ["alpha", "alpha_dot", "beta", "x"]
    for name, meant in (("alfa", "alpha"), ("alpha_dt", "alpha_dot"), ("bta", "beta")):
        with pytest.raises(ProblemError, match=rf" \(did you mean '{meant}'\?\)\."):
            check_known(name, names, "state")
    with pytest.raises(ProblemError, match=r"expected one of alpha, alpha_dot, beta, x\."):
        check_known("qqq", names, "state")
    check_known("beta", names, "state")


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
