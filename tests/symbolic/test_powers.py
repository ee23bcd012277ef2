"""Limits of high powers from below become those of their roots, which allow the same."""

from __future__ import annotations

from typing import Any

import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.errors import ModelError
from dmoc.symbolic.kinks import split
from dmoc.symbolic.powers import ROUNDED

X, Y, U = dynamicsymbols("x y u")
T = dynamicsymbols._t
R = sp.Symbol("r")
V = X.diff()


def row(limit: Any) -> Any:
    """The row of a path constraint, of numbers."""
    used = limit.free_symbols
    system = dmoc.MechanicalSystem(
        "post", [X, Y], (V**2 + Y.diff() ** 2) / 2, {R: 0.5} if R in used else {}, [U], {X: U},
        path_constraints={"post": limit},
    )  # fmt: skip
    ((_, function),) = split(system).rows
    return sp.lambdify((X, Y, V, U, T, R), function)


DISTANCES = [
    # limit, how far it is from the middle along x, along y
    (X**4 + Y**4 >= R**4, 0.5, 0.5),
    (X**4 + Y**4 >= 0.5**4, 0.5, 0.5),
    ((X / 0.1) ** 6 + (Y / 0.04) ** 6 >= 1, 0.1, 0.04),
    (sp.Abs(X) ** 3 + sp.Abs(Y) ** 3 >= R**3 * R, 0.5 ** (4 / 3), 0.5 ** (4 / 3)),
    (5 * (X**2 + Y**2) ** 2 >= 5 * R**4, 0.5, 0.5),
    (X**8 / 3 + 2 * Y**8 >= 1, 3 ** (1 / 8), 0.5 ** (1 / 8)),
]


@pytest.mark.parametrize(("limit", "along_x", "along_y"), DISTANCES)
def test_a_root_is_as_steep_everywhere(limit: Any, along_x: float, along_y: float) -> None:
    """Along each axis it grows as a straight line, but for the middle itself, and is zero where
    the limit is."""
    f = row(limit)
    for size, at in ((along_x, lambda s: (s, 0.0)), (along_y, lambda s: (0.0, s))):
        values = [f(*at(share * size), 0.0, 0.0, 0.0, 0.5) for share in (0.1, 0.5, 1.0, 2.0)]
        slope = values[3]
        expected = [-0.9 * slope, -0.5 * slope, 0.0, slope]
        assert values == pytest.approx(expected, abs=2e-3 * slope)
    middle = f(0.0, 0.0, 0.0, 0.0, 0.0, 0.5)
    assert middle == pytest.approx((float(ROUNDED) - 1) * slope, rel=2e-3)


def test_what_moves_is_a_power_too() -> None:
    """Off the centre, in the time, and of speeds and forces."""
    f = row((X - T - 1) ** 4 + (Y + R) ** 4 >= R**4)
    assert f(3.25, -0.5, 0.0, 0.0, 2.0, 0.5) == pytest.approx(-0.25, abs=1e-3)
    f = row(V**4 + U**4 >= 16)
    assert f(0.0, 0.0, 0.0, 3.0, 0.0, 0.0) == pytest.approx(1.0, abs=1e-5)


@pytest.mark.parametrize(
    "limit",
    [
        X**2 + Y**2 >= R**2, X**4 >= R, X**4 + Y**4 <= 1, X**3 + Y**4 >= 1, X**2 + Y**4 >= 1,
        R * X**4 + Y**4 >= 1, X * Y**3 >= 1, X**4 * (1 - Y**2) ** 4 >= -1,
    ],
)  # fmt: skip
def test_other_limits_stay_as_they_are(limit: Any) -> None:
    """Squares, what may be below its limit or the limit below zero, and limits from above."""
    f, state = row(limit), (0.7, -0.3, 0.0, 0.0, 0.0, 0.5)
    plain = limit.lhs - limit.rhs if limit.rel_op == ">=" else limit.rhs - limit.lhs
    at = plain.subs({X: 0.7, Y: -0.3, R: 0.5})
    assert f(*state) == float(at)


def test_a_limit_of_zero_has_a_root_with_slopes() -> None:
    """A parameter may take an obstacle away."""
    system = dmoc.MechanicalSystem(
        "post", [X, Y], (V**2 + Y.diff() ** 2) / 2, {R: 0.5}, path_constraints={
            "post": X**4 + Y**4 >= R**4
        },
    )  # fmt: skip
    ((_, function),) = split(system).rows
    by_x = [function.diff(X, n).subs({Y: 0, R: 0}) for n in (1, 2)]
    assert [float(slope.subs(X, 0)) for slope in by_x] == [0.0, 0.0]


@pytest.mark.parametrize("limit", [sp.Abs(X) ** 2 * sp.Abs(Y) >= 1, X * sp.Abs(X) >= 1])
def test_powers_with_kinks_are_refused(limit: Any) -> None:
    with pytest.raises(ModelError, match=r"path constraint .post. .*Abs"):
        row(limit)
