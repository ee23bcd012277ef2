"""States at the end that are sums of states at the start."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import sympy as sp
from scipy.special import ellipk
from sympy.physics.mechanics import dynamicsymbols

import dmoc

A, X, Y, U, W = dynamicsymbols("a x y u w")


@pytest.fixture(scope="module")
def pendulum() -> dmoc.Kernels:
    return dmoc.build(
        dmoc.MechanicalSystem(
            "swing",
            coordinates=[A],
            inputs=[U],
            lagrangian=A.diff() ** 2 / 2 + 9.81 * sp.cos(A),
            forces={A: U},
            cost=U**2 / 2,
        ),
        order=4,
    )


@pytest.fixture(scope="module")
def plane() -> dmoc.Kernels:
    """A unit mass above a floor that it may lie on."""
    return dmoc.build(
        dmoc.MechanicalSystem(
            "sled",
            coordinates=[X, Y],
            inputs=[U],
            lagrangian=(X.diff() ** 2 + Y.diff() ** 2) / 2 - 9.81 * Y,
            forces={X: U},
            surfaces={"floor": Y >= 0},
            cost=U**2 / 2,
        ),
        order=4,
    )


@pytest.mark.parametrize(
    "opposite",
    [
        {A: -A, A.diff(): -A.diff()},
        {"a": "-a", "a_dot": "-a_dot"},
        {"a": {"a": -1}, "p_a": {"p_a": -1.0}},
    ],
)
def test_half_a_swing_takes_half_the_period(pendulum: dmoc.Kernels, opposite: Any) -> None:
    """The period of a pendulum of amplitude 1 rad is 4 sqrt(l/g) K(sin 0.5)."""
    half = 2 / np.sqrt(9.81) * ellipk(np.sin(0.5) ** 2)
    problem = dmoc.Problem(
        pendulum, start={A: 1.0, "a_dot": 0.0}, periodic=opposite, bounds={U: (0, 0)}, steps=40,
        final_time=(0.5, 1.5),
    )  # fmt: skip
    solution = dmoc.solve(problem, starts=1)
    assert solution.status == "solved" and solution.verification.passed
    assert solution.final_time == pytest.approx(half, rel=1e-6)


@pytest.mark.parametrize(
    ("start", "relation", "distance"),
    [
        ({"x": (-0.5, 1.0)}, 2 * X + 1, 0.5),  # x_0 + 1, least at x_0 = -0.5
        ({"x": (-0.5, 1.0)}, ({"x": 2.0}, 1.0), 0.5),
        ({"x": 1.0}, (-X, (0.1, 0.4)), 1.6),  # to -0.6, the nearest end of the range
        ({"x": 1.0}, (-X + 0.2, (-0.1, 0.2)), 1.6),
        ({"x": 1.0, "y": 0.0, "x_dot": None}, X + X.diff(), 0.0),  # carried on for one second
        ({"x": (1.0, 2.0)}, "-x", 2.0),
    ],
)
def test_the_effort_of_the_way_to_a_sum_of_states(
    plane: dmoc.Kernels, start: dict[str, Any], relation: Any, distance: float
) -> None:
    """From rest to rest over d in one second costs 6 d^2."""
    moving = {"x_dot": "x_dot"} if "x_dot" in start else {"x_dot": {"x_dot": -1}}
    problem = dmoc.Problem(
        plane, start={"y": 0.0, "x_dot": 0.0} | start, periodic={"x": relation, "y": -Y} | moving,
        contacts=["floor"], final_time=1.0, steps=10,
    )  # fmt: skip
    solution = dmoc.solve(problem, starts=1)
    assert solution.status == "solved" and solution.verification.passed
    assert solution.cost == pytest.approx(6 * distance**2, rel=1e-8, abs=1e-10)


def test_relations_are_told_in_words(plane: dmoc.Kernels) -> None:
    relations = {X: -X + 2 * X.diff() + 0.5, "y": "y", "x_dot": {"y_dot": 1, "x_dot": -3}}
    problem = dmoc.Problem(
        plane, start={"x": 0.0, "y": 1.0, "x_dot": None, "y_dot": None}, periodic=relations,
        final_time=1.0,
    )  # fmt: skip
    text = dict(problem.summary().rows)["periodic"]
    assert "x_dot ends as y_dot - 3 x_dot" in text and "y ends as y" in text
    assert {r.end: dict(r.terms) for r in problem.relations} == {
        "x": {"x": -1.0, "x_dot": 2.0}, "y": {"y": 1.0}, "x_dot": {"y_dot": 1.0, "x_dot": -3.0},
    }  # fmt: skip
    assert "+ 0.5" in text


def test_a_sum_that_the_goal_contradicts_is_named(pendulum: dmoc.Kernels) -> None:
    problem = dmoc.Problem(
        pendulum, start={A: 1.0}, goal={A: 0.5}, periodic={A: -A}, bounds={U: (-1, 1)}, steps=10,
        final_time=1.0,
    )  # fmt: skip
    solution = dmoc.solve(problem, starts=1)
    assert solution.status == "infeasible"
    assert "a at the end misses the value of -a at the start" in solution.message
