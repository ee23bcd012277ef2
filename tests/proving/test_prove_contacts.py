"""dmoc.prove where contacts last: landings, sticking, sliding and hits beside them, of a block
whose best motions follow from those of a mass on a line."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.proving.global_proof import Claim

t = dynamicsymbols._t
x, y, u, w = dynamicsymbols("x y u w")
mu, g, f = sp.symbols("mu g f")
SHORT = 1e-3  # the shortest phase in a second
T = np.linspace(0.01, 1 - SHORT, 990)


def effort(d: Any, v: Any, then: Any, T: Any, c: float = 0.0) -> Any:
    """Least integral of u^2/2 over a time T of 1 kg that goes from a speed v to another one by d
    against a force c."""
    a, b = v - d / T, then - d / T
    return 2 * (a * a + a * b + b * b) / T + c * (then - v) + c * c * T / 2


@pytest.fixture(scope="module")
def block() -> Kernels:
    """A block of 1 kg between a floor with friction and a wall, pushed in both directions."""
    system = dmoc.MechanicalSystem(
        "rough_block", [x, y], (x.diff(t) ** 2 + y.diff(t) ** 2) / 2 - g * y, inputs=[u, w],
        forces={x: u, y: w}, cost=(u**2 + w**2) / 2,
        surfaces={"floor": y >= 0, "wall": x <= 1}, tangents={"floor": x},
        friction={"floor": mu}, parameters={mu: 0.5, g: 0.0},
    )  # fmt: skip
    return dmoc.build(system, order=4)


def moved(kernels: Kernels, sequence: list[str], start: Any, goal: Any, **more: Any) -> Any:
    return dmoc.Problem(
        kernels, sequence=sequence, start=start, goal=goal,
        **{"steps": 2, "final_time": 1.0, "restitution": 0.8, **more},
    )  # fmt: skip


def check(problem: dmoc.Problem, cost: float, gap: float = 1e-3) -> None:
    proof = dmoc.prove(problem, gap)
    assert proof.claim is Claim.OPTIMAL
    assert proof.cost == pytest.approx(cost, rel=1e-4)
    assert cost * (1 - 2 * gap) <= proof.bound <= cost * (1 + 1e-5)


def test_a_corner_is_met_at_once(block: Kernels) -> None:
    """Both ways take all the time but for the shortest phase in the corner."""
    cost = 3 * (1 + 0.5**2) / 2 / (1 - SHORT) ** 3
    check(moved(block, ["+floor +wall"], {"x": 0, "y": 0.5}, {}), cost)


def test_it_sticks_where_it_lands(block: Kernels) -> None:
    """Of the way along the floor a share is made before it lands, from where it starts at rest."""
    share, first = np.meshgrid(np.linspace(0, 0.6, 241), T)
    then = 1 - SHORT - first
    cost = 3 * (share**2 + 1) / 2 / first**3
    cost += 6 * ((0.6 - share) ** 2 + 0.25**2) / np.where(then > 0, then, 1e-9) ** 3
    assert cost.min() < 0.9 * cost[:, 0].min()
    goal = {"x": 0.6, "y": 0.25, "x_dot": 0, "y_dot": 0}
    rough = {"parameters": {"mu": 2.0}}
    check(moved(block, ["+floor", "-floor"], {"x": 0, "y": 1}, goal, **rough), cost.min(), 1e-2)


def test_landings_stick_within_their_friction(block: Kernels) -> None:
    """The impulse along the floor is at most half of that against it: the speed of the way down is
    twice that of the way along it."""
    a, b = 0.5, 0.4
    v = np.linspace(0, 5, 5001)
    T = 1 - SHORT
    cost = (effort(a, 0, v, T) + effort(b, 0, np.maximum(2 * v, 3 * b / 2 / T), T)).min()
    check(moved(block, ["+floor"], {"x": 0, "y": b}, {"x": a}), cost)


@pytest.mark.parametrize(("start", "way"), [(0.0, 0.8), ((0.0, 0.2), 0.6)])
def test_it_slides_and_sticks(block: Kernels, start: Any, way: float) -> None:
    """A force that lifts lessens the friction: both inputs push with 1 + mu^2 times the square of
    what they cost."""
    cost = effort(way, 1.0, 0.0, T, 0.5 * 4.0).min() / (1 + 0.5**2)
    problem = moved(
        block, ["floor:stick"], {"x": start, "y": 0, "x_dot": 1}, {"x": 0.8},
        contacts=["floor:slip+"], parameters={"g": 4.0},
    )  # fmt: skip
    check(problem, cost)


def test_it_slides_to_a_wall_and_back(block: Kernels) -> None:
    v, first = np.meshgrid(np.linspace(0.5, 9, 851), T)
    c = 0.3 * 10.0
    cost = effort(1.0, 0.0, v, first, c) + effort(-1.0, -0.8 * v, 0.0, 1 - first, -c)
    problem = moved(
        block, ["wall floor:slip-"], {"x": 0, "y": 0}, {"x": 0, "x_dot": 0},
        contacts=["floor:slip+"], parameters={"g": 10.0, "mu": 0.3}, steps=3,
    )  # fmt: skip
    check(problem, cost.min() / (1 + 0.3**2))


def test_rails(block: Kernels) -> None:
    """It waits, and slides for as long as is best to come by at half a metre in a second."""
    system = dmoc.MechanicalSystem(
        "on_a_rail", [x], x.diff(t) ** 2 / 2, inputs=[u], forces={x: u}, cost=u**2 / 2,
        tangents={"rail": x}, friction={"rail": f}, parameters={f: 1.0},
    )  # fmt: skip
    goal = {"x": 1, "x_dot": 0.5}
    problem = moved(dmoc.build(system, order=4), ["rail:slip+"], {"x": 0}, goal, final_time=4.0)
    check(problem, effort(1.0, 0.0, 0.5, 4 * T, 1.0).min())
