"""Searches for motions to an attitude, which either sign of its quaternion says."""

from __future__ import annotations

import numpy as np
import pytest
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.codegen.kernels import Kernels

T, SPIN, ANGLE = 2.0, -3.0, np.deg2rad(150)


@pytest.fixture(scope="module")
def spinner() -> Kernels:
    """A ball that turns about a fixed point, and a cart that comes to a wall."""
    (x, F), torque = dynamicsymbols("x F"), dynamicsymbols("T_x T_y T_z")
    world = dmoc.spatial.World()
    world.ball("q", inertia=(1, 1, 1), torque=torque)
    world.slide(x, "x", mass=1, inertia=(0, 0, 0), force=F)
    cost = sum(t**2 for t in torque) + F**2
    return dmoc.build(
        world.system("spinner", inputs=[*torque, F], surfaces={"wall": x <= 1}, cost=cost)
    )


def effort(angle: float) -> float:
    """The least integral of the square of the torque that turns by an angle, to rest."""
    left = angle - SPIN * T
    return 12 * left**2 / T**3 + 12 * left * SPIN / T**2 + 4 * SPIN**2 / T


@pytest.mark.parametrize("sign", [1, -1])
def test_a_search_goes_the_long_way_where_that_costs_less(spinner: Kernels, sign: int) -> None:
    """A body that spins the other way goes on; no other sequence than that of the cart is best."""
    goal = sign * np.array(dmoc.attitude(axis=(0, 1, 0), angle=ANGLE).quaternion)
    problem = dmoc.Problem(
        spinner, {"q": (1, 0, 0, 0), "q_omega_y": SPIN, "x": 0, "x_dot": 1},
        {"q": goal, **{f"q_omega_{axis}": 0 for axis in "xyz"}, "x": 0, "x_dot": -1},
        steps=20, final_time=T, restitution=1.0,
    )  # fmt: skip
    result = dmoc.search(problem, max_collisions=1, starts=2, workers=1)
    assert result.best is not None and result.best.sequence == ("wall",)
    assert result.best.cost == pytest.approx(effort(ANGLE - 2 * np.pi), rel=5e-3)
    for node in result.nodes:
        short = [cost for cost in node.minima if cost > 50]
        assert node.cost < 8 and short and short[0] == pytest.approx(effort(ANGLE), rel=5e-2)
        (said,) = (e for e in node.evidence if "the other sign of a quaternion" in e)
        assert f"{short[0]:.6g}" in said
