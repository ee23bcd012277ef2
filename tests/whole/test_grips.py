"""Grips: closed and opened by a sequence, held both ways; beside closed forms and a simulation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp
from scipy.optimize import minimize
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.errors import ModelError, ProblemError, SimulationError
from dmoc.codegen.kernels import Kernels
from dmoc.motion.motion_tables import columns, units
from dmoc.motion.trajectory import Phase
from dmoc.report.curves import panels_of

X, Y, U = dynamicsymbols("x y u")
M1, M2 = sp.symbols("m_1 m_2")
STILL = {"x_dot": 0, "y_dot": 0}
MOVING = {"x_dot": 1, "y_dot": 0}


def two_carts(name: str, **fields: Any) -> dmoc.MechanicalSystem:
    """A cart that is driven, and one that only a grip moves."""
    return dmoc.MechanicalSystem(
        name,
        coordinates=[X, Y],
        inputs=[U],
        lagrangian=M1 * X.diff() ** 2 / 2 + M2 * Y.diff() ** 2 / 2,
        forces={X: U},
        parameters={M1: 1.0, M2: 3.0},
        cost=U**2 / 2,
        **fields,
    )


@pytest.fixture(scope="module")
def coupled() -> Kernels:
    return dmoc.build(
        two_carts(
            "coupled",
            grips={"hand": X - Y, "clutch": X.diff() - Y.diff()},
            quantities={"pull": dmoc.reaction("hand")},
        ),
        order=4,
    )


@pytest.fixture(scope="module")
def caught(coupled: Kernels) -> dmoc.Problem:
    """The driven cart meets the other one a metre on, and both end a metre further."""
    start = {"x": 0, "y": 1, **STILL}
    goal = {"x": 2, "y": 2, **STILL}
    return dmoc.Problem(coupled, start=start, goal=goal, sequence=["+hand"], final_time=2)


def effort(m: float, d: float, v: float, T: float) -> float:
    """Least int u^2/2 dt of a mass from rest over d in T, with the velocity v at the end."""
    return 2 * m**2 * (3 * d**2 - 3 * d * v * T + v**2 * T**2) / T**3


def test_a_cart_that_is_met_and_brought_along_costs_what_cubics_cost(caught: dmoc.Problem) -> None:
    def cost(p: np.ndarray) -> float:
        v, T = p
        return effort(1, 1, v, T) + effort(4, 1, v / 4, 2 - T)

    least = minimize(cost, [2.0, 0.6], method="Nelder-Mead", options={"xatol": 1e-9, "fatol": 1e-9})
    solution = dmoc.solve(caught)
    (closes,) = solution.collisions
    assert solution.status == "solved" and closes.word == "+hand"
    assert solution.cost == pytest.approx(least.fun, rel=1e-6)
    v, T = least.x
    assert closes.time == pytest.approx(T, rel=1e-3)
    assert closes.impulses["hand"] == pytest.approx(-0.75 * v, rel=1e-3)  # x gets R grad(x - y)
    force = solution.phases[1].normal[:, 0]
    assert force.min() < 0 < force.max()


def test_forces_of_grips_are_shown_as_no_normal_forces(caught: dmoc.Problem) -> None:
    """Their places may be angles: a table has no unit for them."""
    motion = dmoc.solve(caught, starts=1).trajectory
    assert "N_hand" in columns(motion) and "N_hand" not in units(motion)
    panel = panels_of(motion)[-1]
    assert (panel.title, panel.unit) == ("forces of grips", "")
    assert "R" in panel.curves[0].label.tex


def test_the_force_of_a_grip_has_bounds_of_both_signs(caught: dmoc.Problem) -> None:
    solution = dmoc.solve(caught.but(bounds={"pull": (-2.5, 3)}))
    force = solution.phases[1].normal[:, 0]
    assert solution.status == "solved"
    assert (force.min(), force.max()) == pytest.approx((-2.5, 3.0), abs=1e-3)


def test_a_stage_that_is_dropped_costs_what_its_masses_cost(coupled: Kernels) -> None:
    problem = dmoc.Problem(
        coupled, start={"x": 0, "y": 0, **STILL}, goal={"x": 2}, sequence=["-hand"],
        contacts=["hand"], via=[{"y": 1}], final_time=2,
    )  # fmt: skip

    def cost(p: np.ndarray) -> float:
        v, T = p
        left = 2 - T
        return effort(4, 1, v, T) + 1.5 * (1 - v * left) ** 2 / left**3

    least = minimize(cost, [1.2, 1.2], method="Nelder-Mead", options={"xatol": 1e-9, "fatol": 1e-9})
    solution = dmoc.solve(problem)
    assert solution.status == "solved"
    assert solution.cost == pytest.approx(least.fun, rel=1e-5)
    assert solution.collisions[0].time == pytest.approx(least.x[1], rel=1e-3)


@pytest.mark.parametrize("order", [2, 4])
def test_a_clutch_closes_wherever_it_is(order: int) -> None:
    system = two_carts("clutched", grips={"clutch": X.diff() - Y.diff()})
    problem = dmoc.Problem(
        dmoc.build(system, order=order), start={"x": 0, "y": 0, **STILL},
        goal={"y": 2, "y_dot": 1}, sequence=["+clutch"], final_time=3, durations=[1, 2],
    )  # fmt: skip
    solution = dmoc.solve(problem)

    def cost(v: float) -> float:
        """To the velocity 4 v in 1 s, wherever; then 4 kg from v to 1 m/s over 2 m in 2 s."""
        mean = (1 - v) / 2
        left = 2 - 2 * v - 2 * mean
        return 8 * v**2 + 8 * (2 * mean**2 + 12 * left**2 / 8)

    v = np.linspace(0, 2, 20001)
    assert solution.cost == pytest.approx(min(map(cost, v)), rel=1e-4)
    assert solution.status == "solved"
    apart = solution.phases[1].q @ [1, -1]
    assert apart[0] > 0.1 and np.ptp(apart) < 1e-9


def test_a_clutch_of_flywheels_keeps_momentum_and_loses_energy(coupled: Kernels) -> None:
    motion = dmoc.simulate(
        coupled, {"x": 0, "y": 0}, {"x": 4}, step_size=0.01, steps=200,
        grips={"clutch": [(0.503, 1.0)]},
    )  # fmt: skip
    assert motion.v[-1] == pytest.approx([1.0, 1.0], abs=1e-12)
    assert motion.energy[0] - motion.energy[-1] == pytest.approx(1 * 3 * 4**2 / (2 * 4), rel=1e-12)
    (closes,) = motion.collisions
    assert (closes.time, closes.impulses["clutch"]) == pytest.approx((0.503, -3.0))
    assert closes.momentum_after == pytest.approx([1.0, 3.0])
    assert [c.word for c in motion.trajectory.collisions] == ["+clutch", "-clutch"]


def test_a_clutch_that_is_closed_at_both_ends_keeps_its_place(coupled: Kernels) -> None:
    problem = dmoc.Problem(
        coupled, start={"x": 0, "y": 0.3, **STILL}, goal={"x": 1, "y": 1.3, **STILL},
        contacts=["clutch"], final_time=2, steps=20,
    )  # fmt: skip
    solution = dmoc.solve(problem)
    assert solution.status == "solved" and solution.cost == pytest.approx(6 * 4**2 / 2**3)


def test_grips_close_together_one_of_them_wherever_it_is() -> None:
    system = two_carts("geared", grips={"pin": X - 1, "gear": X.diff() - 2 * Y.diff()})
    problem = dmoc.Problem(
        system, start={"x": 0, "y": 0.2, "x_dot": 0}, goal={"x": 1}, sequence=["+pin +gear"],
        final_time=2, steps=20,
    )  # fmt: skip
    solution = dmoc.solve(problem)
    assert solution.status == "solved"
    assert solution.phases[1].v == pytest.approx(0, abs=1e-9)
    assert solution.collisions[0].word == "+pin +gear"


def test_what_is_let_go_under_load_falls() -> None:
    """Its force, m g, depends on no input and never vanishes; it takes sqrt(2 d/g) to fall by d."""
    system = dmoc.MechanicalSystem(
        "dropped", [X, Y], (X.diff() ** 2 + Y.diff() ** 2) / 2 - 9.81 * Y, inputs=[U],
        forces={X: U}, grips={"hook": Y}, cost=U**2 / 2,
    )  # fmt: skip
    problem = dmoc.Problem(
        system, start={"x": 0, "y": 0, **STILL}, goal={"x": 1, "y": -1}, sequence=["-hook"],
        contacts=["hook"], final_time=2, steps=20,
    )  # fmt: skip
    solution = dmoc.solve(problem)
    assert solution.status == "solved"
    assert solution.phases[1].duration == pytest.approx(np.sqrt(2 / 9.81), rel=1e-6)


def test_a_plan_with_a_grip_is_simulated_and_held_by_a_feedback(caught: dmoc.Problem) -> None:
    solution = dmoc.solve(caught)
    assert dmoc.simulate(solution).q[-1] == pytest.approx([2, 2], abs=1e-3)
    disturbed = {"start": {"x": 0.02}, "sampling": 0.02}
    for steers in (dmoc.feedback(solution), dmoc.Planner(caught, solution)):
        held = dmoc.simulate(solution, feedback=steers, disturb=disturbed)
        assert held.q[-1] == pytest.approx([2, 2], abs=0.02)


def test_a_search_closes_and_opens_grips(caught: dmoc.Problem) -> None:
    found = dmoc.search(caught.but(sequence=[]), surfaces=["hand"], max_collisions=1)
    verdicts = {node.sequence: node.verdict for node in found.nodes}
    assert verdicts == {(): "infeasible", ("+hand",): "optimal"}


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (lambda a, b, e: ((a, replace(b, normal=1.1 * b.normal)), e), "error of a contact force"),
        (lambda a, b, e: ((a, _beside(b)), e), "'hand' is off its place by 0.05"),
        (lambda a, b, e: ((a, b), replace(e, impulses={"hand": -1.0})), "the law of impact"),
        (lambda a, b, e: ((a, _opened(b)), replace(e, lands=())), "energy error"),
    ],
)
def test_wrong_grips_are_noticed(
    caught: dmoc.Problem, wrong: Callable[..., Any], message: str
) -> None:
    """A force that is another one, a place that is missed, an impulse that does not stop what it
    has to, a hand that is said to be open while it holds."""
    motion = dmoc.solve(caught, starts=1).trajectory
    phases, event = wrong(*motion.phases, motion.collisions[0])
    verdict = dmoc.verify(replace(motion, phases=phases, collisions=(event,)), caught.kernels)
    assert not verdict.passed and message in verdict.message


def _beside(phase: Phase) -> Phase:
    off = np.array([0, 0.05])
    return replace(phase, q=phase.q + off, q_inside=phase.q_inside + off)


def _opened(phase: Phase) -> Phase:
    none = {name: getattr(phase, name)[:, :0] for name in ("normal", "normal_inside")}
    return replace(phase, closed=(), **none)


def test_a_generated_solver_has_grips(caught: dmoc.Problem, tmp_path: Path) -> None:
    dmoc.generate_solver(caught, tmp_path / "catch")
    answer = dmoc.load_solver(tmp_path / "catch").solve()
    assert answer.status == "solved" and answer.cost == pytest.approx(18.75, rel=1e-6)


@pytest.mark.parametrize(
    ("stated", "message"),
    [
        ({"sequence": ["hand"]}, "hand is a grip, which is not hit"),
        ({"sequence": ["-hand"]}, r"hand lets go, but is not closed then: close it before"),
        ({"sequence": ["+hand", "+hand"]}, "hand is closed already: let it go"),
        (
            {"contacts": ["hand"], "sequence": []},
            "grip 'hand' is closed at the start, which is -1 off its place: move the start onto",
        ),
        (
            {"contacts": ["hand"], "sequence": [], "start": {"x": 1, "y": 1, **MOVING}},
            "whose velocity moves it off its place",
        ),
        ({"sequence": ["+hnd"]}, "unknown surface or grip '\\+hnd'"),
        ({"restitution": {"hand": 0.5}}, "a grip closes without rebound"),
    ],
)
def test_what_no_grip_does_is_refused(
    caught: dmoc.Problem, stated: dict[str, Any], message: str
) -> None:
    with pytest.raises(ProblemError, match=message):
        caught.but(**stated)


@pytest.mark.parametrize(
    ("grip", "message"),
    [
        ((), "has no place"),
        (X.diff() * Y.diff(), "contains velocities: expected the rate of a place"),
        ((X, 1), "grip 'hand_2' contains no coordinate"),
        (X <= 1, "is not an equation"),
        (X - U, "grip 'hand' contains u"),
    ],
)
def test_what_is_no_grip_is_refused(grip: Any, message: str) -> None:
    with pytest.raises(ModelError, match=message):
        two_carts("wrong", grips={"hand": grip})


@pytest.mark.parametrize(
    ("grips", "message"),
    [
        ({"clutch": [(1, 0.5)]}, "expected times that go on"),
        ({"clutch": 3}, "expected pairs of times"),
        ({"foot": []}, "unknown grip 'foot'"),
    ],
)
def test_times_of_grips_that_are_none_are_refused(
    coupled: Kernels, grips: Any, message: str
) -> None:
    with pytest.raises(SimulationError, match=message):
        dmoc.simulate(coupled, {"x": 0}, step_size=0.1, steps=2, grips=grips)


def test_a_hand_that_misses_its_bar_is_told() -> None:
    system = two_carts("reaching", grips={"hand": (X - 1, Y - 2)})
    with pytest.raises(SimulationError, match=r"grip 'hand_2' closes .* misses zero"):
        dmoc.simulate(
            system, {"x": 1, "y": 1}, step_size=0.1, steps=9, grips={"hand": [(0.5, None)]}
        )


def test_an_impulse_that_is_recorded_otherwise_is_noticed(caught: dmoc.Problem) -> None:
    solution = dmoc.solve(caught)
    (closes,) = solution.collisions
    wrong = replace(closes, impulse=1.1 * closes.impulse)
    verdict = dmoc.verify(replace(solution.trajectory, collisions=(wrong,)), caught.kernels)
    assert not verdict.passed and "has the impulse" in verdict.message


def test_a_derivation_shows_grips_by_themselves() -> None:
    system = two_carts("shown", grips={"hand": X - Y}, surfaces={"wall": Y <= 2})
    sections = {section.title: section for section in dmoc.derive(system).sections}
    surfaces, grips = (
        [equation.name for equation in sections[title].equations]
        for title in ("Unilateral constraints", "Grips")
    )
    assert not any("hand" in text for text in surfaces)
    assert any("hand" in text for text in grips) and not any("wall" in text for text in grips)
