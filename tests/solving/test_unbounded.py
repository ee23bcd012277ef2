"""Costs without a minimum are told with what runs away, and minima that are far away are kept."""

from __future__ import annotations

from typing import Any

import pytest
from sympy.physics.mechanics import dynamicsymbols

import dmoc

x, u = dynamicsymbols("x u")


def sled(goal: dict[Any, Any], order: int = 2, **fields: Any) -> dmoc.Problem:
    """1 kg that is pushed for 1 s, or as long as it likes."""
    fields = dict(fields)
    stated = {"final_time": 1, "steps": 20} | fields.pop("problem", {})
    system = dmoc.MechanicalSystem("sled", [x], x.diff() ** 2 / 2, {}, [u], {x: u}, **fields)
    return dmoc.Problem(dmoc.build(system, order=order), {x: 0}, goal, **stated)


STOP: dict[Any, Any] = {x: 1, "x_dot": 0}
EFFORT = {"integrals": {"effort": u**2 / 2}, "objective": -dmoc.total("effort")}
FREE = {"final_time": (None, None)}
ENDLESS = {
    "an effort that is earned": (sled(STOP, **EFFORT), "u"),
    "at order 4": (sled(STOP, 4, **EFFORT), "u"),
    "a price of the end": (sled({}, terminal_cost=-x), "u"),
    "a speed at the end": (sled({}, objective=-dmoc.at_end(x.diff())), "u"),
    "a price of the place": (sled({}, cost=-x), "u"),
    "an input with a sign": (sled({}, cost=u), "u"),
    "a price of the end and time": (
        sled({}, terminal_cost=-x, problem=FREE | {"bounds": {u: (-1, 1)}}), "final_time"),
    "effort and time, on meshes": (
        sled({}, 4, terminal_cost=-x, cost=u**2, problem=FREE | {"steps": None}), "final_time"),
    "a long time": (
        sled({x: 1}, objective=-dmoc.final_time, cost=u**2, problem=FREE), "final_time"),
    "effort and time": (sled({}, terminal_cost=-x, cost=u**2, problem=FREE), "final_time"),
}  # fmt: skip


@pytest.mark.parametrize("name", ENDLESS)
def test_what_runs_away_is_named(name: str) -> None:
    problem, runs = ENDLESS[name]
    solution = dmoc.solve(problem)
    assert solution.status == "stalled" and solution.verification is None
    assert solution.message.startswith(f"the cost has no minimum, it falls as {runs} grows: -")
    assert f"; bound {runs}, or give it a price" in solution.message


@pytest.mark.parametrize("price", [1.0, 1e3, 1e6])
def test_a_minimum_that_is_far_away_is_one(price: float) -> None:
    """u = price (1 - t) costs -price^2/6, by the midpoint rule -price^2 (1/6 - h^2/24)."""
    solution = dmoc.solve(sled({}, cost=u**2 / 2, terminal_cost=-price * x))
    assert solution.solved
    assert solution.cost == pytest.approx(-(price**2) * (1 / 6 - 1 / 400 / 24), rel=1e-9)
