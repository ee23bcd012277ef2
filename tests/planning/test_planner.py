"""Plans of the rest of a motion: against the closed forms of cubics, mirrored at walls."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from joint_problems import bob
from sympy.physics.mechanics import dynamicsymbols
from systems import block_on_floor, unit_mass

import dmoc
from dmoc.base.errors import MotionError, ProblemError
from dmoc.mechanics.contact_mode import Mode
from dmoc.planning.measured_state import consistent
from dmoc.solvers.outcome import Status

X, U = dynamicsymbols("x u")


def least(place: float, rate: float, goal: float, left: float) -> float:
    """The least integral of u^2/2 of a unit mass that comes to rest at a goal in the time left."""
    d, T = goal - place, left
    return float(6 * d**2 / T**3 - 6 * d * rate / T**2 + 2 * rate**2 / T)


@pytest.fixture(scope="module")
def wall() -> dmoc.MechanicalSystem:
    return unit_mass("planned_wall", cost=U**2 / 2, surfaces={"wall": X <= 1})


@pytest.fixture(scope="module")
def bounced(wall: dmoc.MechanicalSystem) -> tuple[dmoc.Problem, dmoc.Solution]:
    """From rest at 0 by way of an elastic wall at 1 to rest at 0.5 in 2 s: mirrored, to 1.5."""
    problem = dmoc.Problem(
        dmoc.build(wall, order=4), {"x": 0.0}, {"x": 0.5, "x_dot": 0.0}, sequence=["wall"],
        steps=10, final_time=2.0, bounds={"u": (-20, 20)},
    )  # fmt: skip
    solution = dmoc.solve(problem)
    assert solution.cost == pytest.approx(least(0, 0, 1.5, 2.0), rel=1e-5)
    return problem, solution


Bounced = tuple[dmoc.Problem, dmoc.Solution]


@pytest.mark.parametrize("lean", [0.1, 0.3, 0.7])
def test_what_a_contact_leaves_of_a_velocity_towards_it_is_nothing(lean: float) -> None:
    """A mass on a ramp: rounding errors are no velocity, of which sizes would be read."""
    y = dynamicsymbols("y")
    ramp = dmoc.MechanicalSystem(
        "ramp", [X, y], (X.diff() ** 2 + y.diff() ** 2) / 2, inputs=[U], forces={X: U}, cost=U**2,
        surfaces={"ramp": y >= lean * X},
    )  # fmt: skip
    problem = dmoc.Problem(
        ramp, {"x": 0.0, "y": 0.0}, {"x": 1.0, "x_dot": 0.0}, contacts=["ramp"], final_time=1.0
    )
    into = np.array([lean, -1.0])
    for speed in (0.3, 1.0, 7.0):
        _, v = consistent(problem, Mode((0,)), (np.zeros(2), speed * into))
        np.testing.assert_array_equal(v, 0.0)


def test_a_plan_is_the_best_rest_from_what_is_measured(bounced: Bounced) -> None:
    planner = dmoc.Planner(*bounced)
    hit = planner.plan.trajectory.collisions[0].time
    for time, off in ((0.2, 0.01), (0.4, -0.02), (0.9, 0.03)):
        assert time < hit
        there = planner.plan.at(time)
        x, v = float(there["x"]) + off, float(there["x_dot"]) - off
        plan = planner.replan(time, {"x": x, "x_dot": v})
        assert plan.new and plan.phase == 0 and plan.status is Status.SOLVED
        assert plan.cost == pytest.approx(least(x, v, 1.5, 2.0 - time), rel=2e-5)
        assert plan.final_time == pytest.approx(2.0)
        first = 6 * (1.5 - x) / (2.0 - time) ** 2 - 4 * v / (2.0 - time)
        assert plan.input(time) == pytest.approx(first, rel=1e-3)


def test_a_hit_that_came_early_is_over(bounced: Bounced) -> None:
    """It is seen in the rate of the gap, near the wall."""
    planner = dmoc.Planner(*bounced)
    hit = planner.plan.trajectory.collisions[0].time
    before = planner.plan.at(hit - 0.06)
    planner.replan(hit - 0.06, {"x": before["x"], "x_dot": before["x_dot"]})
    v = -0.6 * float(before["x_dot"])  # by a wall that takes more than was planned
    plan = planner.replan(hit - 0.05, {"x": 0.995, "x_dot": v})
    assert plan.phase == 1 and not plan.trajectory.collisions
    assert plan.cost == pytest.approx(least(0.995, v, 0.5, 2.05 - hit), rel=2e-5)


def test_a_hit_that_is_late_is_still_met(bounced: Bounced) -> None:
    planner = dmoc.Planner(*bounced)
    hit = planner.plan.trajectory.collisions[0].time
    for late, x, v in ((0.0, 0.6, 1.5), (0.02, 0.95, 1.0), (0.04, 0.97, 1.0)):
        plan = planner.replan(hit + late, {"x": x, "x_dot": v})
        assert plan.new and plan.phase == 0 and plan.trajectory.collisions[0].surface == "wall"
        assert plan.cost == pytest.approx(least(x, v, 1.5, 2.0 - hit - late), rel=2e-5)
        assert plan.iterations < 20


def test_what_has_left_the_wall_before_is_no_hit(bounced: Bounced) -> None:
    """A mass that is pushed away from the wall long before its hit has not hit it."""
    planner = dmoc.Planner(*bounced)
    plan = planner.replan(0.1, {"x": 0.999, "x_dot": -0.5})
    assert plan.phase == 0 and plan.trajectory.collisions


def test_the_phase_may_be_said(bounced: Bounced) -> None:
    planner = dmoc.Planner(*bounced)
    plan = planner.replan(0.5, {"x": 0.4, "x_dot": -0.5}, phase=1)
    assert plan.phase == 1
    assert plan.cost == pytest.approx(least(0.4, -0.5, 0.5, 1.5), rel=2e-5)
    with pytest.raises(ProblemError, match="phase = 0: expected a whole number"):
        planner.replan(0.6, {"x": 0.4}, phase=0)


def test_a_horizon_that_recedes_is_as_long_as_at_the_beginning(bounced: Bounced) -> None:
    planner = dmoc.Planner(*bounced, horizon="recedes")
    plan = planner.replan(0.3, {"x": 0.2, "x_dot": 0.1})
    assert plan.cost == pytest.approx(least(0.2, 0.1, 1.5, 2.0), rel=2e-5)
    assert plan.final_time == pytest.approx(2.3)
    fixed = bounced[0].but(durations=[(1.1, 1.1), (0.9, 0.9)])
    with pytest.raises(ProblemError, match=r"the phases after the first last 0\.9 s at most"):
        dmoc.Planner(fixed, horizon="recedes")


def test_a_phase_that_has_a_duration_keeps_it(wall: dmoc.MechanicalSystem) -> None:
    problem = dmoc.Problem(
        dmoc.build(wall, order=4), {"x": 0.0}, {"x": 0.5, "x_dot": 0.0}, sequence=["wall"],
        steps=10, final_time=2.0, durations=[(1.1, 1.1), None],
    )  # fmt: skip
    plan = dmoc.Planner(problem).replan(0.5, {"x": 0.3, "x_dot": 1.0})
    assert plan.new and plan.trajectory.phases[0].duration == pytest.approx(0.6)


def test_where_there_is_no_motion_the_last_plan_goes_on(bounced: Bounced) -> None:
    planner = dmoc.Planner(*bounced)
    first = planner.plan
    plan = planner.replan(1.9, {"x": 0.0, "x_dot": 0.0}, phase=1)  # 0.5 m in 0.1 s needs 300 N
    assert (
        not plan.new and plan.status is Status.INFEASIBLE and "no feasible motion" in plan.message
    )
    assert plan.input(1.95) == pytest.approx(first.input(1.95))
    assert "that of 0 s goes on" in repr(plan)
    late = planner.replan(2.5, {"x": 0.5, "x_dot": 0.0})
    assert not late.new and "was to end 0.5 s ago" in late.message
    behind = planner.replan(2.6, {"x": 1.4, "x_dot": 0.0})
    assert not behind.new


def test_a_state_far_behind_a_surface_is_told(bounced: Bounced) -> None:
    planner = dmoc.Planner(*bounced)
    for time in (0.0, 0.5):
        plan = planner.replan(time, {"x": 1.4, "x_dot": 0.0})
        assert not plan.new and "0.4 behind surface 'wall'" in plan.message


def test_a_state_just_behind_a_surface_is_moved_before_it(bounced: Bounced) -> None:
    planner = dmoc.Planner(*bounced)
    hit = planner.plan.trajectory.collisions[0].time
    plan = planner.replan(hit, {"x": 1.001, "x_dot": 1.2})  # the hit is happening
    assert not plan.new and plan.phase == 0 and "less than a phase may last" in plan.message
    plan = planner.replan(hit + 0.001, {"x": 1.0002, "x_dot": -1.2})
    assert plan.new and plan.phase == 1
    assert plan.cost == pytest.approx(least(1.0, -1.2, 0.5, 2.0 - hit - 0.001), rel=2e-5)


def test_what_has_just_left_a_floor_at_zero_is_before_it() -> None:
    """A mass of the weight 1 leaves; at zero its gap has no size but the reach of the mass.  With
    u = a + 1 the cost is that of a, the change of the velocity and half the time more."""
    system = replace(
        unit_mass("planned_lift", cost=U**2 / 2, surfaces={"floor": X >= 0}),
        lagrangian=X.diff() ** 2 / 2 - X,
    )
    problem = dmoc.Problem(
        dmoc.build(system, order=4), {"x": 0.0}, {"x": 0.3, "x_dot": 0.0}, contacts=["floor"],
        sequence=["-floor"], durations=[(0.2, None), None], steps=10, final_time=1.5,
    )  # fmt: skip
    planner = dmoc.Planner(problem, dmoc.solve(problem, "ipm"))
    for down in (0.0, -1e-9):
        plan = planner.replan(0.5, {"x": down, "x_dot": down}, phase=1)
        assert plan.new, plan.message
        assert plan.cost == pytest.approx(least(0.0, 0.0, 0.3, 1.0) + 0.5, rel=1e-4)


@pytest.mark.slow
def test_what_a_constraint_moves_into_a_surface_is_moved_before_it() -> None:
    """The bob on its rod of 1 m beside a wall at 0.5 m, measured a hundredth inside: the shortest
    way onto the rod ends behind the wall."""
    system = replace(bob(), name="bob_at_wall", surfaces={"wall": X <= 0.5})
    problem = dmoc.Problem(
        system, {"x": 0, "y": -1}, {"x": 0.3, "y": -(0.91**0.5)}, steps=6, final_time=1.0
    )
    planner = dmoc.Planner(problem, dmoc.solve(problem, "ipm"))
    plan = planner.replan(0.2, {"x": 0.4998, "y": -0.857})
    assert plan.new, plan.message
    begin = plan.trajectory.phases[0].q[0]
    assert np.hypot(*begin) == pytest.approx(1.0, abs=1e-9)
    assert 0.4999 < begin[0] < 0.5


@pytest.mark.slow
def test_what_constraints_and_friction_hold_is_at_rest() -> None:
    """A bob that rubs forwards is measured 0.1 mm/s backwards: of its velocity nothing is left, not
    even rounding errors, with which it would contradict its rod."""
    system = replace(bob(), name="rubbing_bob", tangents={"rail": X}, friction={"rail": 0.5})
    problem = dmoc.Problem(
        dmoc.build(system, order=4), {"x": 0, "y": -1}, {"x": 0.8, "y": -0.6, "x_dot": 0},
        contacts=["rail:slip+"], steps=8, final_time=1.2,
    )  # fmt: skip
    planner = dmoc.Planner(problem, dmoc.solve(problem, "ipm"))
    for x, y in ((-0.0128, -0.9791), (0.0018, -1.0255), (-0.0007, -1.0), (0.0013, -1.0085)):
        plan = planner.begin().replan(0.05, {"x": x, "y": y, "x_dot": -1e-4, "y_dot": 2e-3})
        assert plan.new, plan.message
        assert np.abs(plan.trajectory.phases[0].v[0]).max() < 1e-15


def test_a_measured_state_may_exceed_the_bound_of_a_quantity() -> None:
    """A speed beyond its bound is within it from the next node on; the rest costs more than without
    the bound."""
    mass = unit_mass("planned_speed", cost=U**2 / 2, quantities={"rate": X.diff()})
    problem = dmoc.Problem(
        dmoc.build(mass, order=4), {"x": 0.0}, {"x": 1.0, "x_dot": 0.0}, steps=20, final_time=1.0,
        bounds={"rate": (None, 1.2)},
    )  # fmt: skip
    planner = dmoc.Planner(problem, dmoc.solve(problem, "ipm"))
    plan = planner.replan(0.5, {"x": 0.5, "x_dot": 1.21})
    assert plan.new, plan.message
    speeds = plan.trajectory.phases[0].v[:, 0]
    assert speeds[0] == pytest.approx(1.21) and speeds[1:].max() <= 1.2 + 1e-9
    assert plan.cost > 1.05 * least(0.5, 1.21, 1.0, 0.5)


def test_a_limit_of_time_keeps_the_last_plan(bounced: Bounced) -> None:
    planner = dmoc.Planner(*bounced)
    plan = planner.replan(0.3, {"x": 0.9, "x_dot": -3.0}, seconds=1e-9)
    assert not plan.new and plan.status is Status.TIME_LIMIT


@pytest.mark.slow
@pytest.mark.parametrize("order", [2, 4])
def test_a_landing_and_what_stays_closed(order: int) -> None:
    """A block slides to rest on a floor: a state off it is moved onto it, friction is what is left
    of f = 1: the rest of 1 m in 4 s from (x, v) with u >= f held by a constant force."""
    system = block_on_floor("planned_block", 1.0, 10.0, 0.1, cost=U**2 / 2)
    problem = dmoc.Problem(
        dmoc.build(system, order=order), {"x": 0.0, "y": 0.0}, {"x": 1.0, "x_dot": 0.0},
        contacts=["floor:slip+"], steps=20, final_time=2.0,
    )  # fmt: skip
    planner = dmoc.Planner(problem)
    plan = planner.replan(0.5, {"x": 0.2, "y": 1e-4, "x_dot": 0.8, "y_dot": -1e-3})
    assert plan.new
    # The force is the friction and what a free mass needs; int (1 + a)^2/2 = T/2 + v_end - v + ...
    expected = 1.5 / 2 - 0.8 + least(0.2, 0.8, 1.0, 1.5)
    assert plan.cost == pytest.approx(expected, rel=2e-3 if order == 2 else 1e-6)
    assert abs(plan.trajectory.phases[0].q[:, 1]).max() < 1e-9
    back = planner.replan(0.6, {"x": 0.2, "y": 0, "x_dot": -2})
    assert not back.new and "against its contact 'floor:slip+'" in back.message
    assert planner.replan(0.7, {"x": 0.2, "y": 0, "x_dot": -1e-2}).new  # that was an error


def test_chosen_parameters_stay_and_what_is_periodic_ends_where_it_was_to() -> None:
    w = sp.Symbol("w")
    system = unit_mass(
        "planned_design", parameters={w: 0.9}, cost=U**2 / 2 + (w - 1) ** 2,
        surfaces={"wall": w >= X},
    )  # fmt: skip
    problem = dmoc.Problem(
        system, {"x": 0.5}, {}, sequence=["wall"], steps=20, final_time=2.0,
        design={"w": (0.5, 1.5)}, periodic={"x": "x", "x_dot": ("x_dot", (-5, 5))},
    )  # fmt: skip
    planner = dmoc.Planner(problem)
    w0 = planner.problem.parameters["w"]
    assert 0.5 < w0 < 1.5 and w0 != 0.9 and planner.problem.goal["x"] == 0.5
    there = planner.plan.at(0.2)
    plan = planner.replan(0.2, (there.q, there.v))
    assert plan.new and plan.trajectory.parameters["w"] == w0
    assert plan.trajectory.phases[-1].q[-1, 0] == pytest.approx(0.5)


def test_what_no_input_reaches_may_be_missed_by_a_tolerance() -> None:
    """A second mass flies on by itself: measured 1 cm off, it ends 1 cm off."""
    y, t = dynamicsymbols("y"), dynamicsymbols._t
    system = dmoc.MechanicalSystem(
        "planned_flight", [X, y], (X.diff(t) ** 2 + y.diff(t) ** 2) / 2, inputs=[U], forces={X: U},
        cost=U**2 / 2,
    )  # fmt: skip
    problem = dmoc.Problem(
        system, {"x": 0, "y": 0, "y_dot": 1}, {"x": 1, "x_dot": 0, "y": 1}, steps=10,
        final_time=1.0, bounds={"x": (0, 1)},
    )  # fmt: skip
    solution = dmoc.solve(problem)
    state = {"x": 0.3, "x_dot": 1.2, "y": 0.21, "y_dot": 1.0}
    assert not dmoc.Planner(problem, solution).replan(0.2, state).new
    planner = dmoc.Planner(problem, solution, tolerance=0.02)
    plan = planner.replan(0.2, state)
    assert plan.new and plan.trajectory.phases[-1].q[-1] == pytest.approx([1.0, 1.01], abs=0.03)
    assert planner.replan(0.9, state | {"x": 1.001, "x_dot": 0.2, "y": 0.91}).new  # beyond a bound
    with pytest.raises(ProblemError, match="tolerance = 2: expected a share"):
        dmoc.Planner(problem, solution, tolerance=2)


@pytest.mark.slow
@pytest.mark.parametrize("order", [2, 4])
def test_an_end_at_rest_may_be_missed_where_no_velocity_is_bounded(order: int) -> None:
    """Velocities at the end are unknowns of plans then, and none of the solution.  Moments
    a, b of the input of 1 to 1 - d, v = d' in 1 s cost as cubics do; the best is at an edge."""
    mass = unit_mass("planned_alone", cost=U**2 / 2)
    problem = dmoc.Problem(
        dmoc.build(mass, order=order), {"x": 0.0}, {"x": 1.0, "x_dot": 0.0}, steps=40,
        final_time=1.0,
    )  # fmt: skip
    planner = dmoc.Planner(problem, dmoc.solve(problem, "ipm"), tolerance=0.01)
    low = {name: planner.problem.goal[name][0] for name in ("x", "x_dot")}
    plan = planner.replan(0.0, {"x": 0.0})
    end = plan.trajectory.phases[-1]
    missed = 1 - low["x"], -low["x_dot"]
    assert plan.new and 0 < missed[0] < 0.05 and 0 < missed[1] < 0.1
    assert (1 - end.q[-1, 0], abs(end.v[-1, 0])) == pytest.approx(missed)
    d, v = float(end.q[-1, 0]), float(end.v[-1, 0])
    assert plan.cost == pytest.approx(6 * d**2 - 6 * d * v + 2 * v**2, rel=1e-3)


@pytest.mark.slow
def test_a_simulation_that_plans_arrives_where_the_inputs_alone_do_not(
    bounced: Bounced, tmp_path: Path
) -> None:
    """A wall that takes a fifth of the speed, measured with noise: 0.3 m off without plans."""
    problem, solution = bounced
    planner = dmoc.Planner(
        problem, dmoc.Solution.load(solution.save(tmp_path / "s.npz")), every=0.02
    )
    assert planner.solution is not solution  # a copy is the same motion
    disturb = {"noise": {"x": 1e-4, "x_dot": 1e-3}, "sampling": 0.005, "delay": 0.005}
    ends = {
        name: dmoc.simulate(solution, feedback=f, disturb=disturb, restitution=0.8)
        for name, f in (("open", None), ("planned", planner), ("again", planner))
    }
    assert abs(ends["open"].q[-1, 0] - 0.5) > 0.1
    assert abs(ends["planned"].q[-1, 0] - 0.5) < 2e-3 and abs(ends["planned"].v[-1, 0]) < 0.05
    assert (ends["again"].q == ends["planned"].q).all()  # each run begins at the beginning
    with pytest.raises(dmoc.DmocError, match="that of another motion"):
        dmoc.simulate(dmoc.solve(problem.but(final_time=2.1)), feedback=planner)


def test_bad_input_is_one_sentence(bounced: Bounced, wall: dmoc.MechanicalSystem) -> None:
    problem, solution = bounced
    planner = dmoc.Planner(problem, solution)
    t = dynamicsymbols._t
    for state, words in (
        ({"y": 1.0}, "unknown"), ({}, "leaves x out"), ([1.0], "2 finite numbers: x, x_dot"),
        ({"x": np.nan}, "x in the state"), ("x", "expected a mapping by name"),
        ([[1.0, 2.0], [3.0]], "2 finite numbers"), ([[1.0], "x"], "2 finite numbers"),
        ([[1.0], [[2.0], [3.0, 4.0]]], "2 finite numbers"), (memoryview(b"ab"), "2 finite numb"),
    ):  # fmt: skip
        with pytest.raises(ProblemError, match=words):
            planner.replan(0.1, state)
    for time in ("x", None, np.nan, [0.1], memoryview(b"a")):
        for asked in (planner.plan.at, planner.plan.input):
            with pytest.raises(MotionError, match=r"^time = .*: expected a (finite )?number"):
                asked(time)  # type: ignore[arg-type]
    planner.replan(0.2, {"x": 0.1, "x_dot": 0.5})
    with pytest.raises(ProblemError, match=r"expected a time from 0\.2 s on"):
        planner.replan(0.1, {"x": 0.1})
    with pytest.raises(ProblemError, match="horizon = 'grows'"):
        dmoc.Planner(problem, solution, horizon="grows")
    with pytest.raises(ProblemError, match="expected a Solution"):
        dmoc.Planner(problem, 3)  # type: ignore[arg-type]
    with pytest.raises(ProblemError, match="is no minimum of this problem"):
        dmoc.Planner(problem.but(final_time=2.1), solution)
    timed = unit_mass("planned_timed", cost=U**2 * (1 + t))
    with pytest.raises(ProblemError, match="depends on the time"):
        dmoc.Planner(dmoc.Problem(timed, {"x": 0}, {"x": 1}, steps=5, final_time=1.0))
    mean = unit_mass(
        "planned_mean", integrals={"effort": U**2}, objective=dmoc.total("effort") / dmoc.final_time
    )
    with pytest.raises(ProblemError, match="look at the whole motion"):
        dmoc.Planner(dmoc.Problem(mean, {"x": 0}, {"x": 1}, steps=5, final_time=(1.0, 2.0)))
    nowhere = replace(problem, final_time=0.02)
    with pytest.raises(ProblemError, match="has no solution to begin with"):
        dmoc.Planner(nowhere)
