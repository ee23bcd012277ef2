"""Around obstacles that are thinner than the ways between nodes, or flat in the middle.

Past the top of a post at the height d, half way from rest to rest in 1 s, y is a cubic spline of
cost 192 d^2 on top of the 48 of x.  With the velocity at the end free, the cost is the largest one
of a motion through a point (X, Y) of the edge, over these, of the least over the time s at which it
is there: with the kernel G(a, b) = a b m - (a + b) m^2/2 + m^3/3, m = min(a, b), of a double
integrator from rest, (X + 1, 2) K^-1 (X + 1, 2) + (Y, 0) K^-1 (Y, 0), K that of s and 1.
"""

from __future__ import annotations

from typing import Any

import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc

pytestmark = pytest.mark.slow

X, Y, U, W = dynamicsymbols("x y u w")
REST = {"x": 1.0, "y": 0.0, "x_dot": 0.0, "y_dot": 0.0}
FREE = {"x": 1.0, "y": 0.0}


def around(limit: Any, goal: dict[str, float], **keywords: Any) -> dmoc.Solution:
    """A unit mass from (-1, 0) at rest to the goal within 1 s."""
    system = dmoc.MechanicalSystem(
        "around", [X, Y], (X.diff() ** 2 + Y.diff() ** 2) / 2, {}, [U, W], {X: U, Y: W},
        cost=U**2 + W**2, path_constraints={"post": limit},
    )  # fmt: skip
    steps = keywords.pop("steps", None)
    problem = dmoc.Problem(system, {"x": -1.0, "y": 0.0}, goal, final_time=1.0, steps=steps)
    return dmoc.solve(problem, **keywords)


POSTS = [
    (X**4 + Y**4 >= 0.03**4, FREE, 12.096443),
    (X**6 + Y**6 >= 0.05**6, FREE, 12.269995),
    (sp.Abs(X) ** 3 + sp.Abs(Y) ** 3 >= 0.05**3, FREE, 12.267767),
    (X**4 + Y**4 >= 0.03**4, REST, 48 + 192 * 0.03**2),
    (X**6 + Y**6 >= 0.05**6, REST, 48 + 192 * 0.05**2),
    ((X / 0.02) ** 6 + (Y / 0.2) ** 6 >= 1, REST, 48 + 192 * 0.2**2),
]


@pytest.mark.parametrize(("limit", "goal", "cost"), POSTS)
def test_a_way_around_is_found_without_steps(limit: Any, goal: Any, cost: float) -> None:
    solution = around(limit, goal)
    assert solution.status == "solved", solution.message
    assert solution.cost == pytest.approx(cost, rel=2e-5)


def test_starts_go_on_to_a_mesh_whose_ways_are_shorter_than_the_obstacle() -> None:
    """From 24 steps all go through; on the 60 steps of the problem there are ways around."""
    solution = around(X**4 + Y**4 >= 0.02**4, FREE, steps=60)
    assert solution.status == "solved", solution.message
    assert solution.cost == pytest.approx(12.042817, rel=3e-5)


@pytest.mark.parametrize("steps", [20, 41])
def test_a_thin_wall_is_no_reason_to_say_that_there_is_no_way(steps: int) -> None:
    """Its middle is flat: what ends there has no slope that leads out."""
    solution = around((X / 0.02) ** 6 + (Y / 0.2) ** 6 >= 1, REST, steps=steps)
    assert solution.status in ("solved", "not_verified")


@pytest.mark.parametrize("power", [2, 4, 6])
@pytest.mark.parametrize("size", [0.03, 0.05])
def test_of_ways_that_cost_the_same_one_is_taken_that_goes_around(power: int, size: float) -> None:
    """With 20 steps and a node in the middle, to wait there before the post and to hurry past costs
    as much as to go around it: each half is N/2 steps from rest to rest along x or y, and a
    straight way of n steps from rest to rest within T costs 12/T^3/(1 - 1/n^2)."""
    solution = around(X**power + Y**power >= size**power, REST, steps=20)
    assert solution.status == "solved", solution.message
    expected = 48 / (1 - 1 / 20**2) + 192 * size**2 / (1 - 1 / 10**2)
    assert solution.cost == pytest.approx(expected, rel=1e-8)


def test_a_tolerance_holds_between_nodes_too() -> None:
    """Two discs, rest to rest: the cost is resolved to 2e-5 where they are entered by 3e-4."""
    discs = ((X + 0.3) ** 2 + (Y - 0.02) ** 2 - 0.05**2) * (
        (X - 0.3) ** 2 + (Y + 0.02) ** 2 - 0.08**2
    )
    solution = around(discs >= 0, REST, tolerance=1e-4)
    assert solution.status == "solved", solution.message
    assert solution.verification is not None and solution.verification.path_excess <= 1e-4
