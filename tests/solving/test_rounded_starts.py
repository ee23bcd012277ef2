"""Starts that users compute: 1e-16 instead of 0 changes nothing."""

from __future__ import annotations

from math import pi

import pytest
import sympy as sp
from contact_problems import sliding
from sympy.physics.mechanics import dynamicsymbols
from systems import block_system, there_and_back

import dmoc

X, Y, A, U = dynamicsymbols("x y a u")
COMPUTED = [1.2e-16, -1e-15]


@pytest.mark.slow
@pytest.mark.parametrize("start", [*COMPUTED, 1e-9, -1e-6])
def test_a_way_to_a_wall_is_that_to_the_wall(start: float) -> None:
    """There and back, to a wall at 1 m, in a second: 24."""
    problem = there_and_back(dmoc.build(block_system(), order=4), steps=20)
    solution = dmoc.solve(problem.but(start={"x": start}, goal={"x": 0, "x_dot": start}))
    assert solution.solved and solution.cost == pytest.approx(24, rel=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("start", [*COMPUTED, 1e-6, 1e-4])
def test_who_jumps_lands_beside(start: float) -> None:
    """A body on a leg, at rest in the same place before and after, whose forces move it much
    further in a second than from its start to its goal."""
    system = dmoc.MechanicalSystem(
        "jumper", [Y, X], (Y.diff() ** 2 + X.diff() ** 2) / 2 - 9.81 * (X + Y), inputs=[U],
        forces={X: U, Y: -U}, surfaces={"floor": Y >= 0}, cost=U**2 / 2,
    )  # fmt: skip
    problem = dmoc.Problem(
        dmoc.build(system, order=4), {"x": 0, "y": 0},
        {"x": 0, "y": 0, "x_dot": 0, "y_dot": 0}, contacts=["floor"],
        sequence=["-floor", "+floor"], steps=12, final_time=1,
    )  # fmt: skip
    exact = dmoc.solve(problem, verify=False)
    moved = dmoc.solve(problem.but(start={"x": start, "y": start if start < 1e-9 else 0}))
    assert exact.minimum and moved.solved
    assert moved.cost == pytest.approx(exact.cost, rel=1e-6 + 10 * start**2)


@pytest.mark.slow
@pytest.mark.parametrize("angle", COMPUTED)
def test_a_box_that_is_hardly_turned_stands_on_both_feet(angle: float) -> None:
    """From rest to rest over 1 m in 1 s, without friction: 6."""
    feet = {
        name: (X + s * sp.cos(A) / 5 + 0.3 * sp.sin(A), Y + s * sp.sin(A) / 5 - 0.3 * sp.cos(A))
        for name, s in (("left", -1), ("right", 1))
    }
    system = dmoc.MechanicalSystem(
        "footed", [X, Y, A], (X.diff() ** 2 + Y.diff() ** 2 + A.diff() ** 2 / 20) / 2 - 9.81 * Y,
        inputs=[U], forces={X: U}, surfaces={name: y >= 0 for name, (_, y) in feet.items()},
        cost=U**2 / 2,
    )  # fmt: skip
    problem = dmoc.Problem(
        dmoc.build(system, order=4), {"x": 0, "y": 0.3, "a": angle}, {"x": 1, "x_dot": 0},
        contacts=["left", "right"], steps=10, final_time=1,
    )  # fmt: skip
    solution = dmoc.solve(problem)
    assert solution.solved and solution.cost == pytest.approx(6)


@pytest.mark.slow
@pytest.mark.parametrize("speed", [*COMPUTED, 1e-9])
def test_what_stands_has_a_speed_of_rounding_errors(speed: float) -> None:
    """The rail holds the block at the end; a rod keeps a bob at its length."""
    problem = sliding(20).but(sequence=["rail:stick"], goal={"x": 1, "x_dot": speed})
    solution = dmoc.solve(problem)
    assert solution.solved and solution.cost == pytest.approx(2 / 3 * 6**0.5, rel=2e-3)
    bob = dmoc.MechanicalSystem(
        "computed_bob", [X, Y], (X.diff() ** 2 + Y.diff() ** 2) / 2, inputs=[U],
        forces={X: -U * Y, Y: U * X}, constraints={"rod": sp.Eq(X**2 + Y**2, 1)}, cost=U**2 / 2,
    )  # fmt: skip
    start, goal = {"x": 1, "y": speed}, {"x": 0, "y": 1, "x_dot": 0, "y_dot": speed}
    turned = dmoc.solve(dmoc.Problem(dmoc.build(bob, order=4), start, goal, steps=20, final_time=1))
    assert turned.solved and turned.cost == pytest.approx(1.5 * pi**2, rel=1e-4)
