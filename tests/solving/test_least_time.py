"""The least time where path constraints alone limit inputs: against closed forms."""

from __future__ import annotations

from math import sqrt
from typing import Any

import pytest
import sympy as sp
from answers import answer_of
from scipy.optimize import brentq
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.guess.automatic import initial_guesses, natural_time

X, Y, U, W = dynamicsymbols("x y u w")
T = dynamicsymbols._t
HERE, THERE = {"x": 0, "x_dot": 0}, {"x": 1, "x_dot": 0}


def pushed(limits: list[Any]) -> dmoc.MechanicalSystem:
    """A mass of 1 kg that a force u pushes, as quickly as path constraints allow."""
    named = {f"limit_{i}": limit for i, limit in enumerate(limits)}
    return dmoc.MechanicalSystem(
        "pushed", [X], X.diff() ** 2 / 2, inputs=[U], forces={X: U}, cost=1, path_constraints=named
    )


def with_growing_limits() -> float:
    """From rest at 0 to rest at 1 m, forward at 1 + t until s, then backward: v(T) = 0, x(T) =
    1."""

    def way(a: float, b: float, end: float) -> float:
        """The integral of (1 + t) (end - t) from a to b."""

        def primitive(t: float) -> float:
            return end * t + (end - 1) * t**2 / 2 - t**3 / 3

        return primitive(b) - primitive(a)

    def missing(end: float) -> float:
        switch = sqrt(1 + end + end**2 / 2) - 1  # 2 s + s^2 = T + T^2/2
        return way(0, switch, end) - way(switch, end, end) - 1

    return float(brentq(missing, 0.1, 3.0))


LEAST_TIMES = [
    ([sp.Abs(U) <= 1], 2.0),
    ([U**2 <= 1], 2.0),
    ([U <= 1 + T, U >= -1 - T], with_growing_limits()),
    ([sp.Abs(U) <= 1, sp.Abs(X.diff()) <= sp.Rational(1, 2)], 2.5),
    ([U <= 2, -U <= 1], sqrt(3)),  # 1 m = T^2/2 a b/(a + b)
    ([U**2 <= 1e-12], 2000.0),
    ([U**2 <= 1e12], 2e-3),
]


@pytest.mark.slow
@pytest.mark.parametrize(("limits", "least"), LEAST_TIMES)
def test_limits_of_an_input_that_are_path_constraints_say_how_long_it_takes(
    limits: list[Any], least: float
) -> None:
    solution = answer_of(dmoc.Problem(pushed(limits), HERE, THERE))
    assert solution.final_time == pytest.approx(least, rel=1e-4)
    assert solution.agreeing_starts == solution.starts


@pytest.mark.slow
def test_a_limit_of_two_inputs_together_says_so_too() -> None:
    """sqrt(2) m at 1 m/s^2 along the diagonal."""
    system = dmoc.MechanicalSystem(
        "diagonal", [X, Y], (X.diff() ** 2 + Y.diff() ** 2) / 2, inputs=[U, W],
        forces={X: U, Y: W}, cost=1, path_constraints={"thrust": U**2 + W**2 <= 1},
    )  # fmt: skip
    here, there = ({"x": s, "y": s, "x_dot": 0, "y_dot": 0} for s in (0, 1))
    solution = answer_of(dmoc.Problem(system, here, there))
    assert solution.final_time == pytest.approx(2 * 2**0.25, rel=1e-4)


def test_a_guess_keeps_limits_that_are_path_constraints_as_it_keeps_bounds() -> None:
    """A cubic has its largest acceleration 6/T^2 at its ends; steps end at ratios of 1.2."""
    guess = initial_guesses(dmoc.Problem(pushed([sp.Abs(U) <= 1]), HERE, THERE))[0]
    assert sqrt(6) * 0.98 < guess.final_time < sqrt(6) * 1.2
    assert natural_time(dmoc.Problem(pushed([U**2 <= 1e-12]), HERE, THERE)) == 1e4
