"""A body that rests where it is to hit, and is to end there: the cheapest hit is none."""

from __future__ import annotations

import pytest
from sympy.physics.mechanics import dynamicsymbols

import dmoc

x, u = dynamicsymbols("x u")


@pytest.mark.slow
@pytest.mark.parametrize("order", [2, 4, 6])
@pytest.mark.parametrize("e", [1.0, 0.5, 0.0])
def test_a_hit_of_a_body_at_rest_is_none(order: int, e: float) -> None:
    system = dmoc.MechanicalSystem(
        "resting", [x], x.diff() ** 2 / 2, inputs=[u], forces={x: u}, cost=u**2,
        surfaces={"wall": x <= 1},
    )  # fmt: skip
    problem = dmoc.Problem(
        dmoc.build(system, order=order), {x: 1}, {x: 1, "x_dot": 0}, sequence=["wall"], steps=20,
        final_time=1, restitution=e,
    )  # fmt: skip
    solution = dmoc.solve(problem, "ipm")
    assert solution.status == "grazes"
    assert "the collisions have no effect: nothing moves" in solution.message
    # Back and forth to the wall at 1 m from 0.9 m something does.
    moved = dmoc.solve(problem.but(start={x: 0.9}, goal={x: 0.9}), "ipm")
    assert moved.status == "solved"
