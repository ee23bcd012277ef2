"""What contacts that last ask along phases, where it decides what a motion costs: forces that the
cost asks for, and that the contacts do not bear."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.proving.branch import Branch
from dmoc.proving.linear_problem import linear_problem

t = dynamicsymbols._t
x, y, u, w = dynamicsymbols("x y u w")
mu, f, a, b = sp.symbols("mu f a b")
g = 10.0


@pytest.fixture(scope="module", params=[2, 4])
def asked(request: pytest.FixtureRequest) -> Kernels:
    """A block of 1 kg on a floor with friction and on a rail, whose cost asks for two forces."""
    system = dmoc.MechanicalSystem(
        "asked_block", [x, y], (x.diff(t) ** 2 + y.diff(t) ** 2) / 2 - g * y, inputs=[u, w],
        forces={x: u, y: w}, cost=((u - a) ** 2 + (w - b) ** 2) / 2, surfaces={"floor": y >= 0},
        tangents={"floor": x, "rail": x}, friction={"floor": mu, "rail": f},
        parameters={mu: 0.5, f: 0.0, a: 0.0, b: 0.0},
    )  # fmt: skip
    return dmoc.build(system, order=request.param, backend="numpy")


def least(kernels: Kernels, contacts: list[str], parameters: dict[str, float], **more: Any) -> Any:
    """The bound of a second."""
    fields = {"start": {"x": 0, "y": 0}, "sequence": [], "final_time": 1, "steps": 3, **more}
    problem = dmoc.Problem(kernels, contacts=contacts, parameters=parameters, **fields)
    linear = linear_problem(problem.in_rates())
    around = 1e-9 * np.array([[-1, 1]]) + 1
    branch = Branch(replace(linear, durations=around), np.inf, 1e6, 1e-9, 1e-9, 10.0)
    branch.run(1)
    return branch.bound, linear.left_out


def test_a_floor_only_pushes(asked: Kernels) -> None:
    bound, left_out = least(asked, ["floor:slip+", "rail:slip+"], {"b": 13.0, "mu": 0.0})
    assert bound == pytest.approx((13 - g) ** 2 / 2, rel=1e-6) and left_out == ()


@pytest.mark.parametrize("sign", [1, -1])
def test_friction_holds_what_it_can(asked: Kernels, sign: int) -> None:
    """(u - a)^2/2 + w^2/2 where u = mu (g - w)."""
    start = {"x": 0, "y": 0}
    for contacts in (["floor", "rail:slip+"], ["floor", "rail:slip-"]):
        bound, _ = least(asked, contacts, {"a": sign * 9.0}, start=start)
        assert bound == pytest.approx((9 - 0.5 * g) ** 2 / 2 / 1.25, rel=1e-6)


@pytest.mark.parametrize("sign", [1, -1])
def test_rails_hold_what_they_can(asked: Kernels, sign: int) -> None:
    start = {"x": 0, "y": 9}
    bound, _ = least(asked, ["rail"], {"a": sign * 3.0, "f": 2.0}, start=start)
    assert bound == pytest.approx(0.5, rel=1e-6)


def test_what_slides_keeps_its_direction(asked: Kernels) -> None:
    """From rest it would go back: with the force of the rail, which costs (1 + 4)^2/2, it stays,
    but for what the last nodes may do."""
    bound, _ = least(asked, ["rail:slip+"], {"a": -4.0, "f": 1.0}, start={"x": 0, "y": 9})
    assert 10 < bound < 12.5


def test_what_slides_is_no_faster_than_its_bound(asked: Kernels) -> None:
    """It would be faster by 3 m/s; from 0.5 to 1 m/s it takes 0.5 N, 2.5 less than are asked."""
    more = {"start": {"x": 0, "y": 9, "x_dot": 0.5}, "bounds": {"x_dot": (-1, 1)}}
    bound, left_out = least(asked, ["rail:slip+"], {"a": 3.0}, **more)
    assert bound == pytest.approx(2.5**2 / 2, rel=1e-6) and left_out == ()


@pytest.mark.parametrize(
    ("way", "goal", "speeds"),
    [("", 1.0, (-3, 1.2)), ("", -1.0, (-1.2, 3)), (":slip+", 0.5, ()), (":slip-", -0.5, ())],
)
def test_velocities_between_steps_keep_their_bounds_and_directions(
    way: str, goal: float, speeds: Any
) -> None:
    """On a spring and a damper the momentum between two steps is not that of their polynomials: at
    the slopes of these alone it would cost less, by a hundredth and by a fifth."""
    rough = {"tangents": {"floor": x}, "friction": {"floor": sp.Rational(1, 10)}} if way else {}
    system = dmoc.MechanicalSystem(
        f"sprung_on_a_floor{len(rough)}", [x, y],
        (x.diff(t) ** 2 + y.diff(t) ** 2) / 2 - g * y - 40 * x**2, inputs=[u], forces={x: u},
        dissipation=3 * x.diff(t) ** 2, surfaces={"floor": y >= 0}, cost=u**2 / 2, **rough,
    )  # fmt: skip
    problem = dmoc.Problem(
        dmoc.build(system, order=4, backend="numpy"), contacts=[f"floor{way}"], sequence=[],
        start={"x": 0, "y": 0}, goal={"x": goal, "x_dot": 0}, final_time=1.2, controls="stages",
        steps=2, bounds={"x_dot": speeds} if speeds else {},
    )  # fmt: skip
    linear = linear_problem(problem.in_rates())
    branch = Branch(linear, np.inf, 1e6, 1e-9, 1e-9, 10.0)
    branch.run(1)
    assert branch.bound == pytest.approx(dmoc.solve(problem, starts=1).cost, rel=1e-7)
