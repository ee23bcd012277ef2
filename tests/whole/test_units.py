"""Units decide nothing: a model in other units of length, mass and time has the answer of the
same one in m, kg, s."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import sympy as sp
from answers import answer_of
from hypothesis import given, settings
from hypothesis import strategies as st
from invariance import KINDS, Frame
from methods import INSTALLED, OWN
from sympy.physics.mechanics import dynamicsymbols
from systems import block_system, there_and_back

import dmoc
from dmoc.codegen.kernels import Kernels

pytestmark = pytest.mark.slow

DECADES = st.integers(-6, 6)


def smaller_units(length: int, mass: int = 0, time: int = 0) -> Frame:
    """Units that are smaller by powers of ten."""
    return Frame(10.0**length, 10.0**mass, 10.0**time)


def effort(units: Frame) -> float:
    """The unit of a cost int u^2 dt."""
    return units.time(units.force(1.0) ** 2)


ORDERS = pytest.mark.parametrize("order", [2, 4])
# Methods see sizes that are scaled before: others than the own ones need not see both orders.
METHODS = pytest.mark.parametrize(
    ("method", "order"), [(m, o) for o in (2, 4) for m in INSTALLED if o == 2 or m in OWN]
)


@cache
def block(order: int) -> Kernels:
    return dmoc.build(block_system(), order=order)


@cache
def answer(order: int, method: str, units: Frame, e: float | None = None) -> dmoc.Solution:
    """Of the block and its wall, or where no restitution is said of the pendulum on its cart: the
    best of a few starts."""
    if e is None:
        return dmoc.solve(cart_problem(order, units), method, starts=4)
    return dmoc.solve(block_problem(block(order), units, e), method, starts=4)


def block_problem(kernels: Kernels, units: Frame, e: float) -> dmoc.Problem:
    """Back from the wall in T = 1 s: J = 24 m^2 L^2 / T^3 for e = 1 (the block of the README,
    limits and a terminal speed beside it)."""
    force = units.force(40)
    return dmoc.Problem(
        kernels, start={"x": 0.0}, goal={"x": 0.0, "x_dot": (-units.speed(1), 0.0)},
        sequence=["wall"], steps=12, final_time=units.time(1), restitution=e,
        parameters={"m": units.mass(1), "wall": units.length(1)}, bounds={"u": (-force, force)},
    )  # fmt: skip


@METHODS
@settings(max_examples=8)
@given(length=DECADES, mass=DECADES, time=DECADES, e=st.sampled_from([1.0, 0.6, 0.0]))
def test_a_block_and_its_wall(
    order: int, method: str, length: int, mass: int, time: int, e: float
) -> None:
    units = smaller_units(length, mass, time)
    plain, other = (answer(order, method, t, e) for t in (Frame(), units))
    assert (plain.status, other.status) == ("solved", "solved"), (plain.message, other.message)
    assert other.cost / effort(units) == pytest.approx(plain.cost, rel=1e-6)
    a, b = plain.collisions[0], other.collisions[0]
    momentum = units.mass(units.speed(1))
    assert (b.time / units.time(1), b.impulse / momentum) == pytest.approx(
        (a.time, a.impulse), rel=1e-5
    )


def cart_problem(order: int, units: Frame) -> dmoc.Problem:
    """The reference problem with fewer steps: an angle, which has no unit, beside a length."""
    fields = KINDS["seed"].problem(units)
    fields["bounds"]["x"] = (-units.length(10), units.length(10))
    fields["steps"] = 30 if order == 2 else 16
    return dmoc.Problem(dmoc.load("cart_pendulum", order=order), **fields)


@METHODS
@settings(max_examples=3)
@given(length=DECADES, mass=DECADES, time=DECADES)
def test_the_pendulum_on_its_cart(
    order: int, method: str, length: int, mass: int, time: int
) -> None:
    units = smaller_units(length, mass, time)
    plain, other = (answer(order, method, t) for t in (Frame(), units))
    # A minimum, which 30 steps are too few for.
    status = "not_verified" if order == 2 else "solved"
    assert (plain.status, other.status) == (status, status), (plain.message, other.message)
    assert other.cost / effort(units) == pytest.approx(plain.cost, rel=1e-6)
    assert plain.verification is not None and other.verification is not None
    for name in ("terminal_error", "amplification", "energy_error", "impact_error"):
        expected = getattr(plain.verification, name)
        assert getattr(other.verification, name) == pytest.approx(expected, rel=1e-2, abs=1e-6)


@ORDERS
@pytest.mark.parametrize("length", [-12, -7, 8, 12])
def test_a_mass_matrix_is_judged_whatever_its_units(order: int, length: int) -> None:
    """Its entries are a mass, a mass times a length, and a mass times its square."""
    units = smaller_units(length)
    plain, other = (answer(order, "ipm", t) for t in (Frame(), units))
    assert other.status == plain.status
    assert other.cost / effort(units) == pytest.approx(plain.cost, rel=1e-6)


@pytest.mark.parametrize(
    ("mass", "wall", "time"),
    [
        (1e-6, 1, 1), (1e-9, 1, 1), (1e5, 1, 1), (1e12, 1, 1), (1, 1e3, 1), (1, 1e5, 1),
        (1, 1, 1e3), (1, 1, 1e4),
    ],
)  # fmt: skip
@pytest.mark.parametrize("method", ["ipm", "slsqp"])
def test_the_block_of_the_readme_costs_the_same_in_every_unit(
    method: str, mass: float, wall: float, time: float
) -> None:
    """N = 20 + 20: 24.015 m^0 L^2 / T^3 with J = int u^2 / 2 and u of a mass m."""
    problem = there_and_back(
        dmoc.build(block_system()), steps=20, final_time=time, parameters={"m": mass, "wall": wall}
    )
    solution = answer_of(problem, method)
    assert solution.cost / (mass**2 * wall**2 / time**3) == pytest.approx(24.015009380863, rel=1e-8)


def test_minimum_time_and_an_unbounded_final_time_know_no_second() -> None:
    """Time and effort, from rest to rest: the guess of the final time comes from the problem,
    not from a number of seconds."""
    x, u = dynamicsymbols("x u")
    m, weight, push = sp.symbols("m weight push")
    system = dmoc.MechanicalSystem(
        "hurried", [x], m * x.diff(dynamicsymbols._t) ** 2 / 2, {m: 1.0, weight: 1.0, push: 1.0},
        [u], {x: u}, cost=weight + push * u**2,
    )  # fmt: skip
    costs = []
    for second in (1.0, 1e-6, 1e6):
        problem = dmoc.Problem(
            dmoc.build(system), start={"x": 0.0}, goal={"x": 1.0, "x_dot": 0.0}, steps=20,
            parameters={"weight": 1 / second, "push": second**3},
        )  # fmt: skip
        solution = answer_of(problem, "ipm")
        costs.append(solution.cost)
    assert costs[1:] == pytest.approx([costs[0]] * 2, rel=1e-6)


@ORDERS
def test_on_the_surface_is_relative_to_the_gap(order: int) -> None:
    """A start that lies on the wall up to rounding is admissible, whatever the unit; one that
    lies behind it is not."""
    for wall in (1e-9, 0.3, 1e9):
        here = wall * (1 + 2e-16)
        fields = {"goal": {"x": 0.0}, "final_time": 1.0, "steps": 4, "parameters": {"wall": wall}}
        assert dmoc.Problem(block(order), start={"x": here}, **fields).start["x"] == here
        with pytest.raises(dmoc.DmocError, match="lies behind surface 'wall'"):
            dmoc.Problem(block(order), start={"x": wall * (1 + 1e-9)}, **fields)
        model = dmoc.Problem(block(order), start={"x": 0.0}, **fields).model
        assert model.gap_sizes(np.array([wall]))[0] == pytest.approx(2 * wall)


@ORDERS
def test_the_result_shows_its_scale(order: int) -> None:
    solution = answer(order, "ipm", Frame(), 1.0)
    assert {"time", "cost", "x", "x_dot", "p_x", "u", "gap to wall"} <= set(solution.scale)
    assert all(size > 0 for size in solution.scale.values())
