"""Motions that may begin anywhere, beside surfaces that move: their sizes are those of the surfaces
and of what gravity does in the time, in any units and anywhere."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from answers import answer_of
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.codegen.kernels import Kernels

pytestmark = pytest.mark.slow

y = dynamicsymbols("y")
t = dynamicsymbols._t
G, SIZE, RATE = 9.81, 0.02, 5 * np.pi


@pytest.fixture(scope="module")
def table() -> Kernels:
    """A ball over a table that shakes."""
    g, size, rate, height = sp.symbols("g size rate height")
    return dmoc.build(
        dmoc.MechanicalSystem(
            "shaken", coordinates=[y], lagrangian=y.diff() ** 2 / 2 - g * y,
            surfaces={"table": y >= height + size * sp.sin(rate * t)},
            parameters={g: G, size: SIZE, rate: RATE, height: 0.0}, cost=0,
        )
    )  # fmt: skip


def over(table: Kernels, period: float, hits: int, e: float, **parameters: float) -> dmoc.Problem:
    free = {"y": None, "y_dot": None}
    return dmoc.Problem(
        table, start=free, goal={"y": None}, periodic=["y", "p_y"], sequence=["table"] * hits,
        steps=40, final_time=period, restitution=e, parameters=parameters,
    )  # fmt: skip


@pytest.mark.parametrize("height", [0.0, 100.0, -100.0])
@pytest.mark.parametrize(("length", "time"), [(1.0, 1.0), (1e3, 1.0), (1e-3, 1.0), (1.0, 1e3)])
def test_a_ball_bounces_where_the_table_gives_back_what_a_hit_takes(
    table: Kernels, length: float, time: float, height: float
) -> None:
    """A flight of 0.4 s arrives with g T/2 and leaves with as much, where the table rises with
    g T/2 (1 - e)/(1 + e)."""
    units = {"g": G * length / time**2, "size": SIZE * length, "rate": RATE / time}
    problem = over(table, 0.4 * time, 1, 0.8, height=height * length, **units)
    solution = answer_of(problem, "ipm")
    (hit,) = solution.collisions
    rises = SIZE * RATE * np.cos(RATE * hit.time / time)
    assert rises == pytest.approx(G * 0.4 / 2 * 0.2 / 1.8, rel=2e-3)  # at order two
    assert hit.impulse * time / length == pytest.approx(G * 0.4, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("period", "hits", "e", "changed"),
    [
        (2 / 3, 1, 0.8, {"rate": 3 * np.pi, "size": 0.06}),
        (1.0, 1, 0.5, {"rate": 2 * np.pi, "size": 0.3}),
        (0.8, 2, 0.8, {}),
        (0.2, 1, 1.0, {"rate": 20 * np.pi, "size": 0.005}),
        (1.2, 3, 0.95, {"size": 0.05}),
    ],
)
def test_other_tables_have_their_flights(
    table: Kernels, period: float, hits: int, e: float, changed: dict[str, float]
) -> None:
    solution = answer_of(over(table, period, hits, e, **changed), "ipm")
    # what gravity gives the momentum in a period, the hits take back
    assert sum(c.impulse for c in solution.collisions) == pytest.approx(G * period, rel=1e-6)


@pytest.mark.slow
def test_what_a_table_cannot_give_is_infeasible(table: Kernels) -> None:
    """It would have to rise with 0.36 m/s and does with 0.19 m/s at most."""
    solution = dmoc.solve(over(table, 2 / 3, 1, 0.8, rate=3 * np.pi), "ipm", seconds=30)
    assert not solution.converged
