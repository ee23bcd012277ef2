"""Planners in C on events that are switches, ends of surfaces and grips: plans of dmoc.Planner."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import sympy as sp
from planner_driver import Planned, Step, folder_of, planned
from sympy.physics.mechanics import dynamicsymbols

import dmoc

pytestmark = pytest.mark.slow

X, Y, U, W = dynamicsymbols("x y u w")
REST = {"x_dot": 0, "y_dot": 0}
SOLVED, NEARLY = 0, 12
# Of times and costs, whose plans are solved alike.
SAME = 1e-9


def compare(planner: dmoc.Planner, folder: Path, steps: list[Step]) -> list[Planned]:
    """Plans of C, which are those of Python."""
    plans = planned(folder_of(planner, folder), folder, steps)
    own = planner.begin()
    for step, there in zip(steps, plans, strict=True):
        here = own.replan(step.time, step.state, phase=step.phase)
        assert (there.new, there.phase) == (here.new, here.phase), (step, there, here)
        assert there.origin == pytest.approx(here.origin, abs=1e-12)
        assert there.end == pytest.approx(here.final_time, rel=SAME)
        if here.origin:
            assert there.cost == pytest.approx(here.cost, rel=SAME)
        for i, u in enumerate(there.inputs):
            at = step.time + 0.23 * i * (there.end - step.time)
            assert u == pytest.approx(here.input(at)[0], abs=1e-6 * max(map(abs, there.inputs)))
    return plans


def plane(name: str, **stated: Any) -> dmoc.MechanicalSystem:
    """A unit mass in the plane, with a force."""
    return dmoc.MechanicalSystem(
        name, [X, Y], (X.diff() ** 2 + Y.diff() ** 2) / 2, inputs=[U, W], forces={X: U, Y: W},
        cost=(U**2 + W**2) / 2, **stated,
    )  # fmt: skip


def test_a_gate_is_passed_where_its_switch_says(tmp_path: Path) -> None:
    """A switch of place and speed, which has a parameter; early, late, and passed unseen."""
    c = sp.Symbol("c")
    switches = {"other": Y - 5, "gate": X - c + X.diff() ** 2 / 10}
    system = plane("c_gated", switches=switches, parameters={c: 1.0})
    problem = dmoc.Problem(
        dmoc.build(system, order=4), {"x": 0, "y": 0}, {"x": 2, "y": 0, **REST}, ["gate"],
        steps=10, final_time=2, via=[{"y": 1}],
    )  # fmt: skip
    steps = [
        Step(0.3, (0.1, 0.2, 0.6, 0.9)), Step(0.7, (0.6, 0.8, 1.4, 0.3)),
        Step(0.85, (0.8, 0.98, 1.5, 0.1)), Step(1.3, (1.5, 0.7, 1.2, -1.0)),
    ]  # fmt: skip
    plans = compare(dmoc.Planner(problem), tmp_path / "gated", steps)
    assert [plan.phase for plan in plans] == [0, 0, 1, 1]
    late = [Step(1.1, (0.7, 0.99, 1.2, 0.1)), Step(1.12, (0.8555, 1.0, 1.2, 0.0))]
    plans = compare(dmoc.Planner(problem), tmp_path / "late", late)
    assert [plan.status for plan in plans] == [SOLVED, NEARLY]


def test_a_contact_slips_off_its_end(tmp_path: Path) -> None:
    """Off a table at 1 m, past which nothing is behind it; and down to the floor."""
    g = 9.81
    table = dmoc.MechanicalSystem(
        "c_table", [X, Y], (X.diff() ** 2 + Y.diff() ** 2) / 2 - g * Y, inputs=[U], forces={X: U},
        surfaces={"table": Y >= 1, "floor": Y >= 0}, within={"table": X <= 0}, cost=U**2 / 2,
    )  # fmt: skip
    problem = dmoc.Problem(
        dmoc.build(table, order=4), {"x": -1, "y": 1, **REST}, {"x": 0.8}, ["~table"],
        contacts=["table"], steps=10, final_time=1.4,
    )  # fmt: skip
    steps = [
        Step(0.3, (-0.9, 1.0, 0.6, 0.0)), Step(0.8, (-0.3, 1.001, 1.5, 0.0)),
        Step(1.15, (0.1, 0.97, 1.9, -0.4)), Step(1.25, (0.3, 0.6, 1.9, -1.2)),
    ]  # fmt: skip
    plans = compare(dmoc.Planner(problem), tmp_path / "table", steps)
    assert [plan.phase for plan in plans] == [0, 0, 1, 1]
    assert [plan.status for plan in plans] == [SOLVED] * 4


def test_a_grip_is_come_to_from_either_side(tmp_path: Path) -> None:
    """On the way, where time is left for a plan of the phase after it."""
    system = plane("c_coupled", grips={"hand": X - Y})
    problem = dmoc.Problem(
        dmoc.build(system, order=4), {"x": 0, "y": 1, **REST}, {"x": 2, "y": 2, **REST}, ["+hand"],
        steps=10, final_time=2,
    )  # fmt: skip
    for name, turned in (("ahead", 1.0), ("behind", -1.0)):
        ends = {"start": {"x": 0, "y": turned, **REST}, "goal": {"x": 2 * turned, "y": 2 * turned}}
        planner = dmoc.Planner(problem.but(**ends, via=[{"x": 1.1 * turned}]))
        closes = planner.plan.trajectory.collisions[0].time
        before = (0.4 * turned, 1.02 * turned, 0.9 * turned, 0.0)
        after = (1.3 * turned, 1.3 * turned, 0.8 * turned, 0.8 * turned)
        steps = [Step(0.8 * closes, before), Step(closes + 0.05, after)]
        plans = compare(planner, tmp_path / name, steps)
        assert [(plan.new, plan.phase) for plan in plans] == [(True, 0), (True, 1)]


def test_below_a_shelf_past_its_end(tmp_path: Path) -> None:
    """Nothing is entered there, so that a measured position stays what it is."""
    system = plane("c_shelf", surfaces={"shelf": Y >= 1}, within={"shelf": X <= 0})
    problem = dmoc.Problem(
        dmoc.build(system, order=4), {"x": 0.5, "y": 0.5, **REST}, {"x": 1.5, "y": 0.2, **REST},
        steps=10, final_time=1.4,
    )  # fmt: skip
    (plan,) = compare(dmoc.Planner(problem), tmp_path / "shelf", [Step(0.3, (0.6, 0.45, 0.6, 0.0))])
    assert plan.status == SOLVED
