"""Planners in C: the plans are those of dmoc.Planner from the same states, and its closed forms."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from carried_problems import linkage
from planner_driver import Planned, Step, folder_of, planned
from sympy.physics.mechanics import dynamicsymbols
from systems import block_on_floor, landing_problem, unit_mass

import dmoc
from dmoc.base.errors import ProblemError
from dmoc.solvers.outcome import Status

pytestmark = pytest.mark.slow

X, U = dynamicsymbols("x u")
SOLVED, INFEASIBLE, ITERATIONS, TIME, BAD, OUTSIDE = 0, 1, 2, 3, 7, 8
NO_REST, BEHIND, NEARLY, AGAINST = 10, 11, 12, 13


def are_those_of_python(planner: dmoc.Planner, steps: list[Step], plans: list[Planned]) -> None:
    """Phases, times, costs and inputs of plans; where there is none, the last one."""
    planner = planner.begin()
    for step, there in zip(steps, plans, strict=True):
        here = planner.replan(step.time, step.state, phase=step.phase)
        assert (there.new, there.phase) == (here.new, here.phase), (step, there, here)
        assert there.origin == pytest.approx(here.origin, abs=1e-12)
        assert there.end == pytest.approx(here.final_time, abs=1e-6)
        if here.new:
            assert there.status == SOLVED
        if here.origin:
            assert there.cost == pytest.approx(here.cost, rel=1e-6)
        size = max(abs(there.inputs[0]), 1.0)
        for i, u in enumerate(there.inputs):
            at = step.time + 0.23 * i * (there.end - step.time)
            assert u == pytest.approx(here.input(at)[0], abs=1e-5 * size), (step, i)


def least(place: float, rate: float, goal: float, left: float) -> float:
    """The least integral of u^2/2 of a unit mass that comes to rest at a goal in the time left."""
    d, T = goal - place, left
    return float(6 * d**2 / T**3 - 6 * d * rate / T**2 + 2 * rate**2 / T)


@pytest.fixture(scope="module")
def bounced() -> dmoc.Planner:
    """From rest at 0 by way of an elastic wall at 1 to rest at 0.5 in 2 s."""
    wall = unit_mass("planned_wall", cost=U**2 / 2, surfaces={"wall": X <= 1})
    return dmoc.Planner(
        dmoc.Problem(
            dmoc.build(wall, order=4), {"x": 0.0}, {"x": 0.5, "x_dot": 0.0}, sequence=["wall"],
            steps=10, final_time=2.0, bounds={"u": (-20, 20)},
        )
    )  # fmt: skip


@pytest.fixture(scope="module")
def program(bounced: dmoc.Planner, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Path]:
    folder = tmp_path_factory.mktemp("planner") / "bounced"
    return folder_of(bounced, folder), folder


HIT = 1.0  # about when it is


def test_plans_are_those_of_python(bounced: dmoc.Planner, program: tuple[str, Path]) -> None:
    """On the way; a hit that comes early, seen in the rate, or late; a state just behind the wall,
    far behind it, one that is about to hit; what cannot be reached; the end."""
    hit = bounced.plan.trajectory.collisions[0].time
    there = bounced.plan.at(hit - 0.06)
    x, v = float(there["x"]), float(there["x_dot"])
    courses = [
        [Step(0.0, (0.0, 0.0))],
        [Step(0.2, (0.05, 0.4)), Step(0.4, (0.2, 0.8)), Step(0.9, (0.8, 1.3))],
        [Step(hit - 0.06, (x, v)), Step(hit - 0.05, (0.995, -0.6 * v)), Step(1.4, (0.8, -0.4))],
        [Step(hit, (0.6, 1.5)), Step(hit + 0.02, (0.95, 1.0)), Step(hit + 0.04, (0.97, 1.0))],
        [Step(0.1, (0.999, -0.5)), Step(0.5, (1.4, 0.0)), Step(0.6, (0.4, 0.9))],
        [Step(0.5, (0.4, -0.5), 1), Step(1.0, (0.5, -0.1)), Step(1.5, (0.55, 0.1))],
        [Step(hit, (1.001, 1.2)), Step(hit + 0.001, (1.0002, -1.2)), Step(1.3, (0.7, -0.9))],
        [Step(1.9, (0.0, 0.0), 1), Step(1.92, (0.5, 0.0)), Step(2.5, (0.5, 0.0))],
    ]  # fmt: skip
    statuses = []
    for steps in courses:
        plans = planned(*program, steps)
        are_those_of_python(bounced, steps, plans)
        statuses += [plan.status for plan in plans]
    assert {SOLVED, INFEASIBLE, NO_REST, BEHIND, NEARLY} == set(statuses)


def test_costs_are_those_of_closed_forms(program: tuple[str, Path]) -> None:
    """Mirrored at the wall before the hit."""
    (plan,) = planned(*program, [Step(0.4, (0.25, 0.7))])
    assert plan.cost == pytest.approx(least(0.25, 0.7, 1.5, 1.6), rel=2e-5)
    (plan,) = planned(*program, [Step(0.5, (0.4, -0.5), 1)])
    assert plan.cost == pytest.approx(least(0.4, -0.5, 0.5, 1.5), rel=2e-5)


def test_another_goal_is_that_of_later_phases_too(program: tuple[str, Path]) -> None:
    """Also after a state from which there is no plan."""
    steps = [Step(0.4, (0.25, 0.7)), Step(0.5, (1.4, 0.0)), Step(1.4, (0.8, -0.4), 1)]
    plans = planned(*program, steps, "goal.x", "0.4")
    assert [plan.new for plan in plans] == [True, False, True]
    assert plans[0].cost == pytest.approx(least(0.25, 0.7, 1.6, 1.6), rel=2e-5)
    assert plans[2].cost == pytest.approx(least(0.8, -0.4, 0.4, 0.6), rel=2e-5)


def test_limits_keep_the_last_plan(program: tuple[str, Path]) -> None:
    """Where they leave no plan; the next state has one, from the last one that there is."""
    steps = [
        Step(0.2, (0.05, 0.4)), Step(0.3, (0.9, -3.0), None, 1),
        Step(0.3, (0.9, -3.0), None, 9, True),
        Step(0.4, (0.25, 0.7)), Step(1.1, (0.9, -1.0), 1, 9, True), Step(1.2, (0.8, -0.9)),
    ]  # fmt: skip
    plans = planned(*program, steps)
    assert [plan.status for plan in plans] == [SOLVED, ITERATIONS, TIME, SOLVED, TIME, SOLVED]
    assert [plan.new for plan in plans] == [True, False, False, True, False, True]
    assert [plan.origin for plan in plans] == [0.2, 0.2, 0.2, 0.4, 0.4, 1.2]
    assert [plan.phase for plan in plans] == [0, 0, 0, 0, 1, 1]
    assert plans[3].cost == pytest.approx(least(0.25, 0.7, 1.5, 1.6), rel=2e-5)
    assert plans[5].cost == pytest.approx(least(0.8, -0.9, 0.5, 0.8), rel=2e-5)


def test_what_is_no_state_changes_nothing(program: tuple[str, Path]) -> None:
    nan = float("nan")
    steps = [
        Step(0.4, (0.25, 0.7)), Step(0.3, (0.25, 0.7)), Step(nan, (0.25, 0.7)),
        Step(0.5, (nan, 0.7)), Step(0.5, (0.3, 0.7), 2), Step(0.5, (0.4, -0.5), 1),
        Step(0.6, (0.4, -0.5), 0),
    ]  # fmt: skip
    plans = planned(*program, steps)
    assert [plan.status for plan in plans] == [SOLVED, *[BAD] * 4, SOLVED, BAD]
    assert [plan.origin for plan in plans] == [*[0.4] * 5, 0.5, 0.5]
    assert plans[1].sentence.startswith("a number does not fit")


@pytest.mark.parametrize("order", [2, 4])
def test_what_stays_closed(order: int, tmp_path: Path) -> None:
    """A block slides on a floor; a state off it is moved onto it, and one that slides back a little
    stands still."""
    system = block_on_floor("planned_block", 1.0, 10.0, 0.1, cost=U**2 / 2)
    problem = dmoc.Problem(
        dmoc.build(system, order=order), {"x": 0.0, "y": 0.0}, {"x": 1.0, "x_dot": 0.0},
        contacts=["floor:slip+"], steps=20, final_time=2.0,
    )  # fmt: skip
    planner = dmoc.Planner(problem, horizon="recedes")
    steps = [
        Step(0.5, (0.2, 1e-4, 0.8, -1e-3)), Step(0.7, (0.4, 0.0, 0.9, 0.0)),
        Step(0.8, (0.4, 0.0, -0.1, 0.0)),
    ]  # fmt: skip
    program, folder = folder_of(planner, tmp_path / "slid"), tmp_path / "slid"
    plans = planned(program, folder, steps)
    are_those_of_python(planner, steps, plans)
    assert [plan.status for plan in plans] == [SOLVED] * 3
    assert plans[-1].end == pytest.approx(2.8)
    back = [Step(0.5, (0.2, 0.0, -2.0, 0.0)), steps[1]]
    plans = planned(program, folder, back)
    assert [plan.status for plan in plans] == [AGAINST, SOLVED]
    assert not planner.begin().replan(0.5, {"x": 0.2, "y": 0, "x_dot": -2}).new
    for speed, status in ((0.1, SOLVED), (-0.1, OUTSIDE)):
        (plan,) = planned(program, folder, steps[1:2], "goal.x_dot", str(speed))
        assert (plan.status, plan.new) == (status, status == SOLVED)


def test_a_state_is_moved_the_shortest_way_in_reaches(tmp_path: Path) -> None:
    """From 0.01 above a slope of 1 in 2, on which a block goes to (1, 0.5): the squares of dx/1 and
    of dy/0.5 are least for dx = 0.01, dy = -0.005.  Along it the block weighs nothing and has the
    mass 1.25."""
    y = dynamicsymbols("y")
    system = dmoc.MechanicalSystem(
        "planned_slope", [X, y], (X.diff() ** 2 + y.diff() ** 2) / 2 - 9 * (y - X / 2), inputs=[U],
        forces={X: U}, cost=U**2 / 2, surfaces={"slope": y >= X / 2},
    )  # fmt: skip
    problem = dmoc.Problem(
        dmoc.build(system, order=4), {"x": 0.0, "y": 0.0}, {"x": 1.0, "y": 0.5, "x_dot": 0.0},
        contacts=["slope"], steps=10, final_time=2.0,
    )  # fmt: skip
    planner = dmoc.Planner(problem)
    np.testing.assert_allclose(problem.reach, [1.0, 0.5])
    steps = [Step(0.5, (0.2, 0.11, 0.0, 0.0))]
    plans = planned(folder_of(planner, tmp_path / "slope"), tmp_path / "slope", steps)
    are_those_of_python(planner, steps, plans)
    assert plans[0].cost == pytest.approx(1.25**2 * least(0.21, 0.0, 1.0, 1.5), rel=1e-6)


def test_what_sticks_does_not_move(tmp_path: Path) -> None:
    """The ball has landed and sticks: from another place its goal is not to be reached."""
    planner = dmoc.Planner(landing_problem(8))
    state = planner.plan.at(1.2)
    here, off = ((*map(float, q), 0.0, 0.0) for q in (state.q, state.q + np.array([0.01, 0.0])))
    steps = [Step(1.2, here), Step(1.21, off), Step(1.22, here)]
    plans = planned(folder_of(planner, tmp_path / "landed"), tmp_path / "landed", steps)
    are_those_of_python(planner, steps, plans)
    assert [plan.new for plan in plans] == [True, False, True]


@pytest.mark.parametrize("order", [2, 4])
def test_constraints_and_ranges_of_the_final_time(order: int, tmp_path: Path) -> None:
    """A state off the rod is moved onto it, its velocity along it, also where the rod is stated
    twice; a horizon of at most 1.1 s that recedes."""
    problem = linkage(order, twice=order == 4).but(steps=48 // order, final_time=(0.0, 1.1))
    planner = dmoc.Planner(problem, horizon="recedes")
    steps = [Step(0.1, (0.05, -0.99, 0.5, 0.1)), Step(0.3, (0.2, -0.97, 0.9, 0.0))]
    plans = planned(folder_of(planner, tmp_path / "swung"), tmp_path / "swung", steps)
    are_those_of_python(planner, steps, plans)
    assert plans[-1].end <= 1.4 + 1e-9


def test_states_beyond_bounds_and_a_tolerance_of_the_end(tmp_path: Path) -> None:
    """They are moved to the bounds; where the end may be missed, its place is a range."""
    mass = unit_mass("planned_mass", cost=U**2 / 2)
    problem = dmoc.Problem(
        dmoc.build(mass, order=4), {"x": 0.0}, {"x": 1.0, "x_dot": 0.0}, steps=10, final_time=2.0,
        bounds={"x": (-0.1, 2), "x_dot": (-0.5, 0.8)},
    )  # fmt: skip
    planner = dmoc.Planner(problem, tolerance=0.05)
    steps = [Step(0.1, (-0.2, 0.1)), Step(0.5, (0.2, 0.9)), Step(1.0, (0.5, 0.5))]
    plans = planned(folder_of(planner, tmp_path / "within"), tmp_path / "within", steps)
    are_those_of_python(planner, steps, plans)
    assert all(plan.new for plan in plans)


def test_durations_of_a_horizon_that_recedes(tmp_path: Path) -> None:
    """They are those of the beginning: to the wall and back in at most 3 s, with at most 1.4 s on
    the way there, as long as the first phase goes on."""
    wall = unit_mass("planned_wall", cost=U**2 / 2, surfaces={"wall": X <= 1})
    problem = dmoc.Problem(
        dmoc.build(wall, order=4), {"x": 0.0}, {"x": 0.5, "x_dot": 0.0}, sequence=["wall"],
        steps=10, final_time=(1.0, 3.0), durations=[(0.5, 1.4), (0.3, None)],
    )  # fmt: skip
    planner = dmoc.Planner(problem, dmoc.solve(problem, "ipm"), horizon="recedes")
    steps = [Step(0.24, (0.05, 0.41)), Step(0.5, (0.2, 0.6)), Step(0.7, (0.35, 0.7))]
    plans = planned(folder_of(planner, tmp_path / "later"), tmp_path / "later", steps)
    are_those_of_python(planner, steps, plans)
    assert all(plan.new for plan in plans)


def test_how_far_behind_a_surface_is_measured_by_the_coordinates(tmp_path: Path) -> None:
    """A mass hops 2 cm high and flies 1 m far: 1 cm below the floor is near it for both planners,
    10 cm are not."""
    y = dynamicsymbols("y")
    system = dmoc.MechanicalSystem(
        "planned_hop", [X, y], (X.diff() ** 2 + y.diff() ** 2) / 2 - y, inputs=[U],
        forces={X: U}, cost=U**2 / 2, surfaces={"floor": y >= 0},
    )  # fmt: skip
    problem = dmoc.Problem(
        dmoc.build(system, order=4), {"x": 0.0, "y": 0.0, "y_dot": 0.2},
        {"x": 1.0, "x_dot": 0.0, "y": 0.0}, steps=10, final_time=0.4,
    )  # fmt: skip
    planner = dmoc.Planner(problem, dmoc.solve(problem, "ipm"), tolerance=0.05)
    steps = [Step(0.1, (0.1, -0.01, 2.0, 0.15)), Step(0.2, (0.5, -0.1, 3.0, 0.0))]
    plans = planned(folder_of(planner, tmp_path / "hop"), tmp_path / "hop", steps)
    assert [plan.status for plan in plans] == [SOLVED, BEHIND]
    are_those_of_python(planner, steps, plans)


def test_what_is_far_behind_is_so_in_later_phases_too(
    bounced: dmoc.Planner, program: tuple[str, Path]
) -> None:
    """3 cm behind the wall, by the half metre of the whole motion; the rest begins a metre away."""
    steps = [Step(1.2, (1.03, -0.5), phase=1), Step(1.2, (1.02, -0.5), phase=1)]
    plans = planned(*program, steps)
    assert [plan.status for plan in plans] == [BEHIND, SOLVED]
    are_those_of_python(bounced, steps, plans)


def test_what_is_refused(bounced: dmoc.Planner, tmp_path: Path) -> None:
    with pytest.raises(ProblemError, match="a guess beside a Planner"):
        dmoc.generate_solver(bounced, tmp_path / "a", guess="random")
    with pytest.raises(ProblemError, match="bytes of memory"):
        dmoc.generate_solver(bounced, tmp_path / "a", most_bytes=100_000)
    doubted = replace(bounced.solution, status=Status.NOT_VERIFIED)
    unsure = dmoc.Planner(bounced.problem, doubted)
    with pytest.raises(ProblemError, match="the solution is not verified"):
        dmoc.generate_solver(unsure, tmp_path / "unsure")
    with pytest.raises(ProblemError, match="the solution is not verified"):
        dmoc.generate_solver(bounced.problem, tmp_path / "unsure", guess=doubted)
