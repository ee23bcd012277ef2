"""Switches: events without a contact, where an expression passes zero while it grows."""

from __future__ import annotations

from dataclasses import replace
from math import sqrt
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.errors import ModelError, ProblemError, SimulationError
from dmoc.codegen.system_kernels import kernels_of
from dmoc.motion.trajectory import Trajectory
from dmoc.program.minimal_times import WithMinimalTimes

X, Y, U, W = dynamicsymbols("x y u w")
C = sp.Symbol("c")
REST = {"x_dot": 0, "y_dot": 0}


def particle(**more: object) -> dmoc.MechanicalSystem:
    """A unit mass in the plane with a force on it, and a wall at x = 3."""
    switches = {"gate": X - C, "back": C - X, "fast": X.diff() - 1}
    return dmoc.MechanicalSystem(
        "gated", [X, Y], (X.diff() ** 2 + Y.diff() ** 2) / 2, {C: 1.0}, [U, W], {X: U, Y: W},
        surfaces={"wall": X <= 3}, cost=(U**2 + W**2) / 2, switches=switches, **more,
    )  # fmt: skip


@pytest.fixture(scope="module")
def through() -> dmoc.Problem:
    """From rest at (0, 0) to rest at (2, 0) in 2 s, through the gate x = 1 at y = 1."""
    return dmoc.Problem(
        dmoc.build(particle(), order=4), {"x": 0, "y": 0}, {"x": 2, "y": 0, **REST}, ["gate"],
        steps=10, final_time=2, via=[{"y": 1}],
    )  # fmt: skip


@pytest.fixture(scope="module")
def passed(through: dmoc.Problem) -> dmoc.Solution:
    return dmoc.solve(through, "ipm")


def test_a_particle_passes_a_gate_at_a_free_time(passed: dmoc.Solution) -> None:
    """Cubics from rest to rest over d in T cost 6 d^2/T^3: x over 2 in 2 s, y over 1 in 1 s there
    and back, by symmetry."""
    (event,) = passed.collisions
    assert passed.solved and passed.verification.passed
    assert passed.cost == pytest.approx(6 * 4 / 8 + 2 * 6, rel=1e-9)
    assert (event.word, event.time) == ("gate", pytest.approx(1.0, rel=1e-9))
    assert event.impulse == 0
    np.testing.assert_allclose(event.momentum_before, event.momentum_after, atol=1e-9)


def test_the_price_of_a_gate_is_that_of_what_passes_it(through: dmoc.Problem) -> None:
    """By its multiplier, as by solves with other gates."""
    moved = through.but(parameters={"c": 0.5})
    solution = dmoc.solve(moved, "ipm")
    price = dmoc.sensitivities(moved, solution)["parameters"]["c"]
    costs = [dmoc.solve(moved.but(parameters={"c": 0.5 + d}), "ipm").cost for d in (1e-4, -1e-4)]
    assert price == pytest.approx((costs[0] - costs[1]) / 2e-4, rel=1e-5) and abs(price) > 1


def test_a_gate_is_chosen_by_every_kind_of_start() -> None:
    """With the gate free, x = 2 c = 2 at the half of the time costs nothing more: c = 1."""
    kernels = kernels_of(particle(), 2, ("c",))
    free = dmoc.Problem(
        kernels, {"x": 0, "y": 0}, {"x": 2, "y": 0, **REST}, ["gate"], steps=10, final_time=2,
        via=[{"y": 1}], design={"c": (0.5, 1.6)},
    )  # fmt: skip
    solution = dmoc.solve(free, "ipm")
    assert solution.solved and solution.design["c"] == pytest.approx(1, abs=1e-6)


def test_a_switch_of_the_velocity(through: dmoc.Problem) -> None:
    """x' = 3 t (2 - t)/2 of the cubic is 1 at t = 1 - 1/sqrt(3) first, where it grows."""
    solution = dmoc.solve(through.but(sequence=["fast"], via=None), "ipm")
    assert solution.verification.passed
    assert solution.collisions[0].time == pytest.approx(1 - 1 / sqrt(3), rel=1e-9)


def test_minimal_times_are_those_to_surfaces(through: dmoc.Problem) -> None:
    """The phase to a gate has none; the one from it to the wall has."""
    bounds = {"u": (-9, 9), "w": (-30, 30)}
    both = through.but(sequence=["gate", "wall"], via=None, bounds=bounds, minimal_times=True)
    assert len(WithMinimalTimes(both).minimal_times) == 1
    assert dmoc.solve(both, "slsqp", starts=1).solved


def test_a_switch_is_passed_upwards_alone(through: dmoc.Problem) -> None:
    """The motion to x = 2 passes x = 1 forth; to pass it back it has to go there first."""
    solution = dmoc.solve(through.but(sequence=["back"], via=None), "ipm")
    (event,) = solution.collisions
    end = solution.trajectory.phases[0]
    assert solution.cost > 1.1 * 3 and end.v[-1, 0] <= 1e-9 and event.position[0] == 1


def test_words_of_switches_that_are_none(through: dmoc.Problem) -> None:
    for word, told in (
        ("gate fast", "'gate fast' in the sequence has the switch 'gate' beside something else"),
        ("wall gate", "has the switch 'gate' beside something else"),
        ("+gate", r"'\+gate' in the sequence: gate is a switch, which nothing lands on"),
        ("~gate", "'~gate' in the sequence: gate is a switch, which nothing lands on"),
        ("gat", r"unknown surface or switch 'gat' in the sequence: .*did you mean 'gate'"),
    ):
        with pytest.raises(ProblemError, match=told):
            through.but(sequence=[word])


def test_models_whose_switches_are_none() -> None:
    for switches, told in (
        ({"gate": U - 1}, r"switch 'gate' contains u\(t\), one of the inputs"),
        ({"gate": C - 1}, "switch 'gate' contains no coordinate, no velocity and no time"),
        ({"gate": sp.sign(X)}, "switch 'gate'"),
        ({"x": X - 1}, "the name 'x' is used twice, as coordinate and as switch"),
        ({"wall": X - 1}, "the name 'wall' is used twice, as surface and as switch"),
    ):
        with pytest.raises(ModelError, match=told):
            replace(particle(), switches=switches, parameters={C: 1.0}, cost=U**2 + W**2 + C)


def test_the_check_notices_what_is_no_passage(through: dmoc.Problem, passed: dmoc.Solution) -> None:
    def told(motion: Trajectory, switch: str) -> str:
        (event,) = motion.collisions
        wrong = replace(motion, collisions=(replace(event, switch=switch),))
        return dmoc.verify(wrong, through.kernels).message

    assert "'fast' is 0.5 at the event 'fast' at 1 s, not zero" in told(passed.trajectory, "fast")
    assert "the switch 'back' falls with 1.5" in told(passed.trajectory, "back")
    with pytest.raises(SimulationError, match="unknown switch 'gone'"):
        told(passed.trajectory, "gone")


def test_a_simulation_records_what_passes_zero(through: dmoc.Problem) -> None:
    """x = 2 t + t^2/2 meets x = 1 at sqrt(6) - 2, where nodes are not."""
    run = dmoc.simulate(
        through.kernels, {"x": 0}, {"x": 2}, step_size=0.07, steps=10, inputs=[1, 0]
    )
    (event,) = run.collisions
    assert (event.word, event.time) == ("gate", pytest.approx(sqrt(6) - 2, rel=1e-12))
    before, after = run.trajectory.phases
    assert before.t[-1] == after.t[0] == event.time and len(after.u) == after.steps
    assert before.q[-1, 0] == pytest.approx(1, rel=1e-12)
    assert before.v[-1, 0] == pytest.approx(sqrt(6), rel=1e-12)


def test_a_solution_goes_through_its_file_and_its_simulation(
    passed: dmoc.Solution, tmp_path: Path
) -> None:
    passed.save(tmp_path / "passed.npz")
    assert [c.word for c in dmoc.Solution.load(tmp_path / "passed.npz").collisions] == ["gate"]
    run = dmoc.simulate(passed)
    assert [c.word for c in run.collisions] == ["fast", "gate"]
    run.save(tmp_path / "run.npz")
    loaded = dmoc.Simulation.load(tmp_path / "run.npz")
    assert [c.switch for c in loaded.collisions] == ["fast", "gate"]
    assert "event gate" in str(loaded) and "event gate" in str(passed)


def test_a_feedback_and_a_planner_go_on_where_the_state_passes(
    through: dmoc.Problem, passed: dmoc.Solution
) -> None:
    """Begun behind, a motion passes the gate late, and is steered back to its goal."""
    for steers in (dmoc.feedback(passed), dmoc.Planner(through, passed)):
        disturb = {"start": {"x": -0.05}, "sampling": 0.02}
        run = dmoc.simulate(passed, feedback=steers, disturb=disturb)
        gates = [c for c in run.collisions if c.word == "gate"]
        assert len(gates) == 1 and gates[0].position[1] == pytest.approx(1, abs=0.02)
        assert np.abs(run.q[-1] - [2, 0]).max() < 0.02


def test_a_planner_sees_whether_the_gate_is_passed(
    through: dmoc.Problem, passed: dmoc.Solution
) -> None:
    for x, phase in ((0.99, 0), (1.01, 1)):
        plan = dmoc.Planner(through, passed).replan(0.9, {"x": x, "y": 1, "x_dot": 1.5})
        assert plan.new and plan.phase == phase


def test_a_search_tries_switches_that_it_is_given(through: dmoc.Problem) -> None:
    free = through.but(sequence=[], via=None)
    plain = dmoc.search(free, max_collisions=1)
    assert {n.sequence for n in plain.nodes} == {(), ("wall",)}
    given = dmoc.search(free, max_collisions=1, events=["gate"])
    costs = {n.sequence: n.cost for n in given.nodes}
    assert costs[("gate",)] == pytest.approx(costs[()], rel=1e-9)


def test_a_solver_in_c_passes_the_same(
    through: dmoc.Problem, passed: dmoc.Solution, tmp_path: Path
) -> None:
    dmoc.generate_solver(through, tmp_path / "solver")
    solver = dmoc.load_solver(tmp_path / "solver")
    assert solver.solve().cost == pytest.approx(passed.cost, rel=1e-9)
