"""Balls contain what mpmath gives for numbers in them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mpmath as mp
import numpy as np
import pytest

from dmoc.proving.balls import Ball, BallFunctions

Function = Callable[..., Any]
COUNT = 60
# Functions of one number: the range of the middles, balls' and mpmath's.
OF_ONE: dict[str, tuple[float, float, Function, Function]] = {
    "sin": (-50, 50, BallFunctions.sin, mp.sin),
    "cos": (-50, 50, BallFunctions.cos, mp.cos),
    "tan": (-1.4, 1.4, BallFunctions.tan, mp.tan),
    "asin": (-0.9, 0.9, BallFunctions.arcsin, mp.asin),
    "acos": (-0.9, 0.9, BallFunctions.arccos, mp.acos),
    "atan": (-9, 9, BallFunctions.arctan, mp.atan),
    "sinh": (-3, 3, BallFunctions.sinh, mp.sinh),
    "cosh": (-3, 3, BallFunctions.cosh, mp.cosh),
    "tanh": (-3, 3, BallFunctions.tanh, mp.tanh),
    "asinh": (-9, 9, BallFunctions.arcsinh, mp.asinh),
    "acosh": (1.1, 9, BallFunctions.arccosh, mp.acosh),
    "atanh": (-0.9, 0.9, BallFunctions.arctanh, mp.atanh),
    "exp": (-20, 20, BallFunctions.exp, mp.exp),
    "log": (0.1, 9, BallFunctions.log, mp.log),
    "sqrt": (0.1, 9, BallFunctions.sqrt, mp.sqrt),
    "1 / x": (0.1, 9, lambda x: 1.0 / x, lambda x: 1 / x),
    "x ** 7": (-2, 2, lambda x: BallFunctions.power(x, 7.0), lambda x: x**7),
    "x ** -5": (0.5, 2, lambda x: BallFunctions.power(x, -5.0), lambda x: x**-5),
    "x ** 1.7": (0.5, 2, lambda x: BallFunctions.power(x, 1.7), lambda x: x ** mp.mpf(1.7)),
    "|x|": (-1e-3, 1e-3, lambda x: BallFunctions.where(x >= 0.0, x, -x), abs),
    "min(x, 2 x)": (
        -1e-3, 1e-3, lambda x: BallFunctions.where((x < 2.0 * x) | (x == 2.0 * x), x, 2.0 * x),
        lambda x: min(x, 2 * x),
    ),
}  # fmt: skip
OF_TWO: dict[str, tuple[Function, Function]] = {
    "x + y": (lambda x, y: x + y, lambda x, y: x + y),
    "x - y": (lambda x, y: x - y, lambda x, y: x - y),
    "x y": (lambda x, y: x * y, lambda x, y: x * y),
    "x / (y^2 + 0.5)": (lambda x, y: x / (y * y + 0.5), lambda x, y: x / (y * y + mp.mpf(0.5))),
    "3 - 0.1 x": (lambda x, y: 3.0 - 0.1 * x + 0.0 * y, lambda x, y: 3 - x / 10),
    "atan2": (BallFunctions.arctan2, mp.atan2),
}


def drawn(rng: np.random.Generator, low: float, high: float) -> Ball:
    r = rng.choice([0.0, 1e-15, 1e-9, 1e-4], COUNT)
    return Ball(rng.uniform(low, high, COUNT), r)


def points(rng: np.random.Generator, x: Ball) -> list[list[Any]]:
    """Some numbers in each ball, its ends among them."""
    shares = [-1.0, 1.0, *rng.uniform(-1, 1, 2)]
    return [[mp.mpf(m) + mp.mpf(r) * s for s in shares] for m, r in zip(x.m, x.r, strict=True)]


def assert_contains(ball: Ball, values: list[list[Any]]) -> None:
    for m, r, numbers in zip(ball.m, ball.r, values, strict=True):
        assert np.isfinite(r)
        for value in numbers:
            assert abs(value - mp.mpf(float(m))) <= mp.mpf(float(r))
            assert float(ball.low.min()) < float(ball.high.max())


@pytest.mark.parametrize("name", OF_ONE)
def test_functions_of_one_number_contain_it(name: str) -> None:
    low, high, of_balls, exact = OF_ONE[name]
    rng = np.random.default_rng(1)
    x = drawn(rng, low, high)
    with mp.workdps(60):
        assert_contains(of_balls(x), [[exact(p) for p in own] for own in points(rng, x)])


@pytest.mark.parametrize("name", OF_TWO)
def test_functions_of_two_numbers_contain_it(name: str) -> None:
    of_balls, exact = OF_TWO[name]
    rng = np.random.default_rng(2)
    x, y = drawn(rng, 0.2, 3), drawn(rng, -2, 2)
    with mp.workdps(60):
        pairs = zip(points(rng, x), points(rng, y), strict=True)
        values = [[exact(a, b) for a in own for b in other] for own, other in pairs]
        assert_contains(of_balls(x, y), values)


def test_results_are_not_much_wider_than_their_arguments() -> None:
    """A ball of radius r about 1 in x^2 has the radius 2 r, and rounding little."""
    x = Ball(np.array([1.0, 1.0]), np.array([0.0, 1e-6]))
    assert (x * x).r == pytest.approx([2.3e-16, 2e-6], rel=0.1)
    assert BallFunctions.sqrt(x).r[1] < 1.01e-6
    assert BallFunctions.sin(x).r[0] < 3e-15


@pytest.mark.parametrize("off", [0.0, 1e-3])
def test_what_has_no_bounds_has_an_infinite_radius(off: float) -> None:
    f, zero = BallFunctions, Ball(np.array([off]), np.array([1e-2]))
    one, minus = 1.0 + zero, Ball(np.array([-1.0]), np.array([0.0]))
    wide = Ball(np.array([1.5]), np.array([3.0]))  # the slope of arccosh has numbers at both ends
    with np.errstate(all="ignore"):
        results = [
            1.0 / zero, f.sqrt(zero), f.log(zero), f.power(zero, 0.5), f.arcsin(one), f.arccos(one),
            f.arccosh(one), f.arccosh(wide), f.arctanh(one), f.arctan2(zero, minus),
            f.arctan2(zero, zero),
        ]  # fmt: skip
        for result in results:
            assert not result.r[0] < np.inf
        assert not (result + one).r[0] < np.inf  # and so has what is made of it


def test_conditions_hold_for_all_numbers_or_for_none() -> None:
    x = Ball(np.array([-1.0, 0.0, 1.0, 0.0]), np.array([0.5, 0.5, 0.5, 0.0]))
    for condition, always, never in (
        (x < 0.0, [1, 0, 0, 0], [0, 0, 1, 1]), (x <= 0.0, [1, 0, 0, 1], [0, 0, 1, 0]),
        (x > 0.0, [0, 0, 1, 0], [1, 0, 0, 1]), (x == 0.0, [0, 0, 0, 1], [1, 0, 1, 0]),
        (x != 0.0, [1, 0, 1, 0], [0, 0, 0, 1]),
        ((x > 0.0) & (x < 9.0), [0, 0, 1, 0], [1, 0, 0, 1]),
    ):  # fmt: skip
        assert condition.always.tolist() == [bool(a) for a in always]
        assert condition.never.tolist() == [bool(n) for n in never]
    # Where nobody knows, both values are in the result; what is not chosen has no say.
    wide = BallFunctions.where(x >= 0.0, Ball(np.full(4, 2.0), np.zeros(4)), 5.0 / (x + 3.0))
    assert wide.low[1] < 2 and wide.high[1] >= 5 / 2.5 and wide.r[2] < 1e-9


def test_constants_with_many_digits_were_rounded() -> None:
    x = Ball(np.array([1.0]), np.array([0.0]))
    for short in (0.5, 3.0, -1024.25):
        assert Ball.of(short).r == 0
    third = x * (1 / 3)
    with mp.workdps(40):
        assert abs(mp.mpf(1) / 3 - mp.mpf(float(third.m[0]))) <= float(third.r[0]) < 1e-15
