"""Bounds of functions of the time contain what mpmath gives, with three derivatives."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from typing import Any

import mpmath as mp
import numpy as np
import pytest

from dmoc.codegen.kernels import Array
from dmoc.proving.branch import OPERATIONS, enclosed
from dmoc.proving.surface_shifts import Term, TermFunctions, rates_of, shifts_of

F = TermFunctions()
# Each in terms and in numbers of mpmath, and times at which it has three derivatives.
FUNCTIONS: dict[str, tuple[Callable[[Any], Any], Callable[[Any], Any], float, float]] = {
    "sum": (lambda t: t + 0.1 - 3.0 * t, lambda t: t + mp.mpf("0.1") - 3 * t, -2, 2),
    "quotient": (lambda t: (t - 0.5) / (t * t + 1.0), lambda t: (t - 0.5) / (t * t + 1), -2, 2),
    "inverse": (lambda t: 1.0 / t, lambda t: 1 / t, 0.1, 3),
    "root": (lambda t: F.sqrt(t + 2.0), lambda t: mp.sqrt(t + 2), -1.9, 2),
    "sine": (lambda t: F.sin(t * 7.0), lambda t: mp.sin(t * 7), -40, 40),
    "cosine": (F.cos, mp.cos, -40, 40),
    "tangent": (F.tan, mp.tan, -1.5, 1.5),
    "exponential": (lambda t: F.exp(-t * t), lambda t: mp.exp(-t * t), -3, 3),
    "logarithm": (F.log, mp.log, 0.01, 9),
    "arctangent": (F.arctan, mp.atan, -9, 9),
    "arcsine": (F.arcsin, mp.asin, -0.99, 0.99),
    "arccosine": (F.arccos, mp.acos, -0.99, 0.99),
    "sinh": (F.sinh, mp.sinh, -3, 3),
    "cosh": (F.cosh, mp.cosh, -3, 3),
    "tanh": (F.tanh, mp.tanh, -3, 3),
    "arcsinh": (F.arcsinh, mp.asinh, -3, 3),
    "arccosh": (F.arccosh, mp.acosh, 1.01, 9),
    "arctanh": (F.arctanh, mp.atanh, -0.99, 0.99),
    "power": (lambda t: F.power(t, -3), lambda t: t**-3, 0.1, 2),
    "broken power": (lambda t: F.power(t, 2.5), lambda t: t ** mp.mpf(2.5), 0.1, 2),
    "falling power": (lambda t: F.power(t, -0.3), lambda t: t ** mp.mpf("-0.3"), 0.1, 2),
}


def bounds_of(function: Callable[[Any], Any], low: float, high: float) -> Array:
    shifts = shifts_of([Term.of(function(Term("time")))])
    assert shifts is not None
    return enclosed(shifts, low, high)[0]


@pytest.mark.parametrize("name", FUNCTIONS)
def test_bounds_contain_values_and_derivatives(name: str) -> None:
    ours, exact, first, last = FUNCTIONS[name]
    rng = np.random.default_rng(0)
    with mp.workdps(60):
        for width in (0.0, 1e-8, 1e-3, 0.3):
            middle = rng.uniform(first, last)
            low, high = max(first, middle * (1 - width)), min(last, middle * (1 + width))
            low, high = min(low, high), max(low, high)
            bounds = bounds_of(ours, low, high)
            places = [low + (high - low) / 2, *rng.uniform(low, high, 3), low, high]
            for number, place in enumerate(places):
                derivatives = [*mp.taylor(exact, mp.mpf(place), 3)]
                numbers = [d * mp.factorial(i) for i, d in enumerate(derivatives)]
                at = bounds[3:] if number else np.concatenate([bounds[:3], bounds[6:]])
                for (lo, hi), value in zip(at, numbers, strict=True):
                    slack = 0 if width else mp.mpf(10) ** -30 * abs(value)  # of mpmath
                    assert lo <= value + slack and value - slack <= hi
            if width <= 1e-8:  # and not by much
                spans, sizes = np.diff(bounds)[:, 0], np.abs(bounds).max(axis=1)
                assert (spans <= 1e-5 * (1 + sizes)).all()


def test_waves_reach_their_ends() -> None:
    for low, high, least, most in (
        (1.5, 1.7, 0.99, 1), (4.6, 4.8, -1, -0.99), (0.1, 9, -1, 1), (-1.7, -1.5, -1, -0.99),
        (-4.8, -4.6, 0.99, 1),
    ):  # fmt: skip
        bounds = bounds_of(F.sin, low, high)[3]
        assert bounds[0] == least if least == -1 else bounds[0] > least
        assert bounds[1] == most if most == 1 else bounds[1] < most
        moved = bounds_of(F.cos, low - np.pi / 2, high - np.pi / 2)[3]
        np.testing.assert_allclose(moved, bounds, atol=1e-12)
    assert bounds_of(F.sin, 1e9, 1e9)[3].tolist() == [-1, 1]


def test_what_has_no_bounds_has_infinite_ones() -> None:
    for function in (lambda t: 1.0 / t, F.log, lambda t: F.exp(t * 9999.0), F.sqrt):
        assert not np.isfinite(bounds_of(function, -1, 2)).all()


@pytest.mark.parametrize(("exponent", "orders"), [(0.3, 1), (1.5, 2), (3.5, 4)])
def test_broken_powers_have_bounds_from_zero_on(exponent: float, orders: int) -> None:
    """As many derivatives as the exponent has."""
    bounds = bounds_of(lambda t: F.power(0.3 * t, exponent), 0.0, 1.0)[3:]
    assert np.isfinite(bounds[:orders]).all() and not np.isfinite(bounds[orders:]).any()
    np.testing.assert_allclose(bounds[0], [0, 0.3**exponent], atol=1e-12)
    below = bounds_of(lambda t: F.power(t, exponent), -0.1, 1.0)[3]
    assert below.tolist() == [-np.inf, np.inf]


def test_rates_of_terms_are_their_derivatives() -> None:
    time = Term("time")
    for name, (ours, _, first, last) in FUNCTIONS.items():
        both = [Term.of(ours(time))]
        shifts = shifts_of([*both, *rates_of(both)])
        assert shifts is not None
        for at in np.random.default_rng(0).uniform(max(first, -5), min(last, 5), 3):
            of, rate = enclosed(shifts, at, at).mean(axis=2)
            np.testing.assert_allclose(rate[:2], of[1:3], rtol=1e-9, atol=1e-9, err_msg=name)


def test_constants_of_the_text_count_as_rounded() -> None:
    low, high = Term.of(0.1).bounds
    assert Fraction(low) < Fraction(1, 10) < Fraction(high) < Fraction(1, 10) + Fraction(1, 10**15)
    assert Term.of(0.5).bounds == (0.5, 0.5)


def test_terms_that_are_alike_are_one_operation() -> None:
    time = Term("time")
    shifts = shifts_of([F.sin(time) * F.sin(time), F.sin(time) + 0.0 * F.log(time)])
    assert shifts is not None
    assert [OPERATIONS[code] for code in shifts.operations[:, 0]].count("sine") == 1
    assert "logarithm" not in [OPERATIONS[code] for code in shifts.operations[:, 0]]
    assert shifts_of([F.where(time > 1.0, time, 0.0)]) is None


def test_a_long_chain_of_terms_is_followed() -> None:
    term = time = Term("time")
    for _ in range(3000):
        term = F.sin(term + time)
    shifts = shifts_of([term])
    assert shifts is not None and len(shifts.operations) == 6001
