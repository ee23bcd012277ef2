"""Bounds of velocities and of named quantities, and quantities at both ends and at events: known
answers, the same problems stated otherwise, derivatives, and what is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.errors import ModelError, ProblemError

pytestmark = pytest.mark.slow

t = dynamicsymbols._t
x, y, u, w, a, b = dynamicsymbols("x y u w a b")
m, l = sp.symbols("m l")
REST = {"a_dot": 0, "b_dot": 0}


def mass(**fields: Any) -> dmoc.MechanicalSystem:
    """1 kg on a line."""
    return dmoc.MechanicalSystem(
        "mass", [x], m * x.diff() ** 2 / 2, {m: 1.0}, [u], {x: u}, cost=u**2 / 2, **fields
    )


def arm(**fields: Any) -> dmoc.MechanicalSystem:
    """Two links with a mass of 1 kg at the end of each, without weight."""
    tip = l * (sp.sin(a) + sp.sin(b)), -l * (sp.cos(a) + sp.cos(b))
    squares = 2 * a.diff() ** 2 + b.diff() ** 2 + 2 * sp.cos(a - b) * a.diff() * b.diff()
    return dmoc.MechanicalSystem(
        "arm", [a, b], m * l**2 * squares / 2, {m: 1.0, l: 1.0}, [u, w], {a: u - w, b: w},
        cost=u**2 + w**2, units={"tip_x": "m", "power": "W"},
        quantities={"tip_x": tip[0], "tip_y": tip[1], "power": u * a.diff()}, **fields
    )  # fmt: skip


@pytest.fixture(scope="module")
def arms() -> dict[int, Any]:
    return {order: dmoc.build(arm(), order=order) for order in (2, 4)}


def reaching(kernels: Any, **changes: Any) -> dmoc.Problem:
    stated: dict[str, Any] = {
        "start": {"a": 0.9, "b": 0.3}, "goal": {"tip_x": 1.0, "tip_y": -0.5, **REST},
        "final_time": 1, "steps": 30,
    }  # fmt: skip
    return dmoc.Problem(kernels, **(stated | changes))


def test_a_speed_is_bounded_without_a_new_build():
    """A ramp to v within 1.5 (1 - 1/v) s, as much down: 4 v^2/(3 t_1) = 7.68 at v = 1.2."""
    kernels = {order: dmoc.build(mass(), order=order) for order in (2, 4, 6)}
    for order, steps, near in ((2, 400, 3e-5), (4, 100, 3e-5), (6, 60, 3e-5)):
        problem = dmoc.Problem(
            kernels[order], {"x": 0}, {"x": 1, "x_dot": 0}, steps=steps, final_time=1,
            bounds={"x_dot": (-1.2, 1.2)},
        )  # fmt: skip
        solution = dmoc.solve(problem, "ipm", starts=1)
        assert solution.verification.passed
        np.testing.assert_allclose(solution.cost, 7.68, rtol=near)
        assert solution.active_bounds[0].startswith("bound of x_dot in")
        v = 1.3  # 4 v^2/(3 t_1) with t_1 = 1.5 (1 - 1/v)
        wider = dmoc.solve(problem.but(bounds={"x_dot": (None, v)}), "ipm", starts=1)
        np.testing.assert_allclose(wider.cost, 8 / 9 * v**3 / (v - 1), rtol=near)


@pytest.mark.parametrize("order", [2, 4])
def test_a_speed_is_bounded_on_both_sides_of_a_hit(order):
    """To the wall in x = 1 and back within 2 s: |v| is 1 all along, where it may not be more."""
    kernels = dmoc.build(mass(surfaces={"wall": x <= 1}), order=order)
    problem = dmoc.Problem(
        kernels, {"x": 0, "x_dot": None}, {"x": 0}, ["wall"], steps=20, final_time=2,
        bounds={"x_dot": (-1.0, 1.25)}, restitution=0.8,
    )  # fmt: skip
    solution = dmoc.solve(problem, "ipm", starts=4)
    assert solution.verification.passed
    first, last = solution.phases
    assert first.v.max() <= 1.25 + 1e-9 and last.v.min() >= -1 - 1e-9
    # 0.8 s there at 1.25 m/s and, after the hit, 1 s back at 1 m/s: in time, and for nought.
    np.testing.assert_allclose(solution.cost, 0, atol=1e-3)


@pytest.mark.parametrize("order", [2, 4])
def test_a_speed_that_would_rather_be_more_is_bounded_at_the_hit(order):
    """From rest to the wall in x = 1 and back within 2 s: 1.25 m/s and more cost less."""
    kernels = dmoc.build(mass(surfaces={"wall": x <= 1}), order=order)
    problem = dmoc.Problem(
        kernels, {"x": 0, "x_dot": 0}, {"x": 0}, ["wall"], steps=10, final_time=2,
        bounds={"x_dot": (-1.2, 1.2)}, restitution=0.8,
    )  # fmt: skip
    solution = dmoc.solve(problem, "ipm", starts=2)
    assert solution.solved
    np.testing.assert_allclose(solution.phases[0].v.max(), 1.2, rtol=1e-8)


@pytest.mark.parametrize("order", [2, 4, 6])
def test_a_speed_holds_in_the_first_and_in_the_last_step_too(order):
    """To the wall in x = 1 and half the way back in 2 s, from rest to rest: 1.5 m, which take 2.5 s
    with 0.6 m/s.  With V it is 4 V^2/(3 t_1) with t_1 = 1.5 (2 - 1.5/V)."""
    kernels = dmoc.build(mass(surfaces={"wall": x <= 1}), order=order)
    problem = dmoc.Problem(
        kernels, {"x": 0}, {"x": 0.5, "x_dot": 0}, ["wall"], steps=40, final_time=2,
        bounds={"x_dot": (-0.9, 0.9)},
    )  # fmt: skip
    assert dmoc.solve(problem, "ipm").cost == pytest.approx(2.16, rel=1e-3)
    slow = problem.but(bounds={"x_dot": (-0.6, 0.6)}, steps=10)
    assert dmoc.solve(slow, "ipm").status == "infeasible"


@pytest.mark.parametrize("limits", [{"bounds": {"push": (0, 0)}}, {}])
def test_rounding_errors_of_what_is_nothing_exceed_no_bound(limits):
    """A mass that coasts: its force is nothing up to rounding errors."""
    path = {} if limits else {"path_constraints": {"none": (u <= 0) & (u >= 0)}}
    system = mass(quantities={"push": u}, **path)
    problem = dmoc.Problem(system, {x: 0, "x_dot": 1}, {x: 1}, final_time=1, steps=20, **limits)
    assert dmoc.solve(problem, "ipm", starts=1).solved


@pytest.mark.parametrize("order", [2, 4])
def test_the_tip_of_an_arm_goes_to_the_better_of_two_elbows(arms, order):
    free = dmoc.solve(reaching(arms[order]), "ipm", starts=24)
    far, phi = np.hypot(1.0, 0.5), np.arctan2(1.0, 0.5)
    bend = np.arccos(far / 2)
    elbows = []
    for side in (1, -1):
        goal = {"a": phi + side * bend, "b": phi - side * bend, **REST}
        elbows.append(dmoc.solve(reaching(arms[order], goal=goal), "ipm", starts=8).cost)
    assert free.verification.passed
    np.testing.assert_allclose(free.cost, min(elbows), rtol=1e-7)
    end = free.phases[-1].q[-1]
    np.testing.assert_allclose([np.sin(end).sum(), -np.cos(end).sum()], [1.0, -0.5], atol=1e-9)


@pytest.mark.parametrize(
    ("order", "form"), [(2, "constant"), (2, "linear"), (4, "stages"), (4, "constant")]
)
def test_bounds_of_a_quantity_are_path_constraints(arms, order, form):
    """|power| <= 2 W, once as two path constraints of another model."""
    limits = {"most": u * a.diff() <= 2, "least": u * a.diff() >= -2}
    stated = dmoc.build(arm(path_constraints=limits), order=order)
    problem = reaching(stated, controls=form, steps=120 // order)
    one = dmoc.solve(problem, "ipm")
    other = problem.but(kernels=arms[order], bounds={"power": (-2, 2)})
    two = dmoc.solve(other, "ipm", starts=1, guess=one)
    assert one.verification.passed and two.verification.passed
    np.testing.assert_allclose(two.cost, one.cost, rtol=1e-8)
    np.testing.assert_allclose(two.phases[0].q, one.phases[0].q, atol=1e-6)
    # Problems that differ in these numbers share what their programs have in common.
    wide = dmoc.solve(other.but(bounds={"power": (-4, 3)}), "ipm", starts=1, guess=one)
    again = dmoc.solve(other, "ipm", starts=1, guess=wide)
    assert wide.cost < 0.999 * two.cost
    np.testing.assert_allclose(again.cost, two.cost, rtol=1e-8)


def test_derivatives_of_the_cost_by_what_is_said_of_quantities(arms):
    def problem(power: float, tip: float, speed: float) -> dmoc.Problem:
        bounds = {"power": (-power, power), "b_dot": (None, speed)}
        goal = {"tip_x": tip, "tip_y": -0.5, **REST}
        return reaching(arms[2], bounds=bounds, goal=goal, steps=60)

    at = np.array([2.0, 1.0, 3.0])
    solution = dmoc.solve(problem(*at), "ipm")
    slopes_by_name = dmoc.sensitivities(problem(*at), solution)
    slopes = []
    for way in np.eye(3) * 1e-3:
        ends = [dmoc.solve(problem(*(at + s * way)), starts=1, guess=solution) for s in (1, -1)]
        slopes.append((ends[0].cost - ends[1].cost) / 2e-3)
    power = slopes_by_name["bounds"]["power <="] - slopes_by_name["bounds"]["power >="]
    wanted = [power, slopes_by_name["goal"]["tip_x"], slopes_by_name["bounds"]["b_dot <="]]
    np.testing.assert_allclose(slopes, wanted, rtol=2e-4)
    assert slopes_by_name["goal"]["b_dot"] < -1  # beside a bound of the same velocity


def plane() -> dmoc.MechanicalSystem:
    """1 kg in a plane with a wall."""
    return dmoc.MechanicalSystem(
        "plane", [x, y], m * (x.diff() ** 2 + y.diff() ** 2) / 2, {m: 1.0}, [u, w],
        {x: u, y: w}, {"wall": x <= 1}, cost=u**2 + w**2,
        quantities={"height": y, "turn": x * y.diff() - y * x.diff(), "level": y - 0.1},
    )  # fmt: skip


@pytest.mark.parametrize("order", [2, 4])
def test_quantities_at_the_start_and_at_events(order):
    kernels = dmoc.build(plane(), order=order)
    base: dict[str, Any] = {"sequence": ["wall"], "steps": 20, "final_time": 1}
    goal = {"x": 0, "y": 0.5, "x_dot": 0, "y_dot": 0}
    places = dmoc.Problem(kernels, {"x": 0, "y": 0.1}, goal, **base, via=[{"y": 0.7}])
    named = dmoc.Problem(
        kernels, {"x": 0, "y": None, "level": 0.0}, goal, **base, via=[{"height": 0.7}]
    )
    costs = [dmoc.solve(p, "ipm", starts=4).cost for p in (places, named)]
    np.testing.assert_allclose(*costs, rtol=1e-9)
    within = dmoc.solve(named.but(via=[{"height": (0.65, None)}]), "ipm", starts=4)
    best = dmoc.solve(places.but(via=[{"y": (0.65, None)}]), "ipm", starts=4)
    np.testing.assert_allclose(within.cost, best.cost, rtol=1e-8)
    # A quantity of velocities at the start: what turns round the origin.
    turning = named.but(start={"x": 0.5, "y": 0.1, "x_dot": None, "y_dot": 0.0, "turn": -0.2})
    solution = dmoc.solve(turning, "ipm", starts=4)
    np.testing.assert_allclose(solution.phases[0].v[0], [2.0, 0.0], atol=1e-8)
    assert solution.verification.passed


@pytest.mark.parametrize("order", [2, 4])
def test_quantities_end_as_they_start_and_further(arms, order):
    """The tip 0.2 m to the left of where it was, at the height of its first x less 1.5 m."""
    x_0 = float(np.sin(0.9) + np.sin(0.3))
    goal = {"tip_x": x_0 - 0.2, "tip_y": x_0 - 1.5, **REST}
    stated = dmoc.solve(reaching(arms[order], goal=goal), "ipm", starts=12)
    related = reaching(
        arms[order], goal=REST, periodic={"tip_x": ("tip_x", -0.2), "tip_y": ("tip_x", -1.5)}
    )
    solution = dmoc.solve(related, "ipm", starts=1, guess=stated)
    np.testing.assert_allclose(solution.cost, stated.cost, rtol=1e-8)
    wide = related.but(periodic={"tip_x": ("tip_x", (-0.3, 0.3)), "tip_y": ("tip_x", -1.5)})
    less = dmoc.solve(wide, "ipm", starts=1, guess=stated)
    assert less.cost < stated.cost and less.verification.passed
    spinning = related.but(start={"a": 0.9, "b": None, "power": 0.5, "a_dot": 1.0, "b_dot": 0.0})
    spinning = spinning.but(periodic={"power": "power", "b": "b"}, goal={"a": 1.5})
    turned = dmoc.solve(spinning, "ipm", starts=6)
    ends = turned.phases[0].quantities[[0, -1], 2]
    np.testing.assert_allclose(ends, [0.5, 0.5], atol=0.02)


def test_quantities_of_motions_and_files(arms, tmp_path: Path):
    solution = dmoc.solve(reaching(arms[4], bounds={"power": (-2, 2)}), "ipm")
    state = solution.at(0.37)
    np.testing.assert_allclose(state["tip_x"], np.sin(state.q).sum(), rtol=1e-5)
    np.testing.assert_allclose(state["power"], state["u"] * state["a_dot"], rtol=1e-3)
    assert solution.trajectory.limits == {"power": (-2.0, 2.0)}
    solution.save(tmp_path / "arm.npz")
    kept = dmoc.Solution.load(tmp_path / "arm.npz")
    assert kept.at(0.37)["tip_y"] == state["tip_y"] and kept.trajectory.limits["power"][0] == -2
    header = (solution.to_csv(tmp_path / "arm.csv")).read_text().splitlines()[0]
    assert header.endswith("u,w,tip_x [m],tip_y,power [W]")
    run = dmoc.simulate(arm(), [0.9, 0.3], [0.5, -0.2], step_size=0.01, steps=50)
    np.testing.assert_allclose(run.at(0.255)["tip_y"], -np.cos(run.at(0.255).q).sum(), atol=1e-6)
    run.save(tmp_path / "run.npz")
    assert dmoc.Simulation.load(tmp_path / "run.npz").at(0.2)["tip_y"] == run.at(0.2)["tip_y"]
    # A motion that leaves its bounds is found out.
    narrow = replace(solution.trajectory, limits={"power": (-1.5, 2.0), "a_dot": (-1.9, 9.0)})
    check = dmoc.verify(narrow, arms[4])
    assert not check.passed and "the bound of power is exceeded by 14." in check.message


REFUSED = {
    "its own name": (lambda: mass(quantities={"far": sp.Symbol("far") + x}), "name of a quantity"),
    "a coordinate": (lambda: mass(quantities={"x": 2 * x}), "'x' is used twice"),
    "a velocity": (lambda: mass(quantities={"x_dot": 2 * x}), "'x_dot' is used twice"),
    "a kink": (lambda: mass(quantities={"size": abs(x)}), "quantity 'size' contains Abs"),
    "text": (lambda: mass(quantities={"size": "x**2"}), "quantity 'size'"),
    "an unknown symbol": (lambda: mass(quantities={"k": sp.Symbol("s") * x}), "unknown"),
    "no mapping": (lambda: mass(quantities=[x]), "expected a mapping such as"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_no_quantity_is_refused(case):
    make, message = REFUSED[case]
    with pytest.raises(ModelError, match=message):
        make()


CONTRADICTIONS: dict[str, tuple[dict[str, Any], str]] = {
    "contradiction": ({"start": {"a": 0.9, "b": 0.3, "tip_x": 2.0}}, "is 1.07885 at the start"),
    "start beyond a bound": ({"bounds": {"tip_y": (-1, None)}}, "is bounded to -1 to inf"),
    "goal beyond a bound": ({"bounds": {"tip_x": (None, 0.5)}, "start": {"a": 0, "b": 0}},
                            r"the goal of tip_x \(1 to 1\) lies outside its bounds"),
    "goal": ({"goal": {"a": 0.5, "b": 2}, "bounds": {"tip_x": (None, 1.2)}},
             "is 1.38872 at the goal, which the coordinates and velocities decide"),
    "momentum": ({"start": {"a": 0, "b": 0, "p_a": 3.0}, "bounds": {"p_a": (0, 1)}},
                 r"the start of p_a \(3 to 3\) lies outside its bounds 0 to 1"),
    "reversed": ({"bounds": {"power": (3, 1)}}, "bounds of power"),
    "unknown": ({"bounds": {"powre": (3, 1)}}, "did you mean 'power'"),
    "speed": ({"bounds": {"a_dot": (1, 2)}}, "the start of a_dot"),
}  # fmt: skip


@pytest.mark.parametrize("case", CONTRADICTIONS)
def test_what_cannot_be_said_of_quantities_is_refused(arms, case):
    changes, message = CONTRADICTIONS[case]
    with pytest.raises(ProblemError, match=message):
        reaching(arms[2], **changes)


def test_kernels_without_their_system_have_no_momenta_to_bound(arms):
    alone = replace(arms[2], system=None)
    with pytest.raises(ProblemError, match="the bounds of p_a need kernels with these momenta"):
        reaching(alone, bounds={"p_a": (0, 1)})


def test_a_small_unit_excuses_no_bound():
    named = {"tiny": 1e-9 * x}
    with pytest.raises(ProblemError, match="is bounded to -inf to 1e-09"):
        dmoc.Problem(mass(quantities=named), {x: 2}, {x: 0}, bounds={"tiny": (None, 1e-9)})


def test_a_quantity_of_velocities_is_none_of_an_event():
    with pytest.raises(
        ProblemError, match="contains velocities, inputs or forces, which jump there"
    ):
        dmoc.Problem(
            plane(), {"x": 0, "y": 0}, {}, ["wall"], steps=4, final_time=1, via=[{"turn": 0}]
        )


def test_a_first_position_where_a_quantity_is_not_defined():
    """Nothing says where the circle begins but its angle; in the middle it has none."""
    ball = dmoc.MechanicalSystem(
        "ball", [x, y], (x.diff() ** 2 + y.diff() ** 2) / 2, inputs=[u, w], forces={x: u, y: w},
        cost=u**2 + w**2, quantities={"angle": sp.atan2(y, x), "radius": sp.sqrt(x**2 + y**2)},
    )  # fmt: skip
    start = {x: (-1, 1), y: (-1, 1), "angle": 0.5, "radius": 1}
    problem = dmoc.Problem(ball, start, {x: 1, y: 0}, steps=20, final_time=1)
    solution = dmoc.solve(problem)
    np.testing.assert_allclose(solution.phases[0].q[0], [np.cos(0.5), np.sin(0.5)], rtol=1e-8)
    # from rest to a velocity that is free, over 2 sin(1/4): 3 d^2
    np.testing.assert_allclose(solution.cost, 12 * np.sin(0.25) ** 2, rtol=1e-2)


def test_first_positions_at_the_goal_follow_time_and_what_is_periodic():
    """x - 2 t is 0.5: x = 6.5 after 3 s, and open where the time is; one ends as minus the other
    began, a step of 0.2 to 0.8 further."""
    y = dynamicsymbols("y")
    ahead = {"ahead": x - 2 * dynamicsymbols._t}
    system = dmoc.MechanicalSystem(
        "runners", [x, y], (x.diff() ** 2 + y.diff() ** 2) / 2, inputs=[u], forces={x: u},
        quantities=ahead,
    )  # fmt: skip
    problem = dmoc.Problem(dmoc.build(system), {x: 1, y: None}, {"ahead": 0.5}, steps=4)
    np.testing.assert_allclose(problem.but(final_time=3).goal_position, [6.5, 0])
    np.testing.assert_allclose(problem.goal_position, [1, 0])
    closed = problem.but(start={x: 1, y: 0}, goal={x: 6.5, y: 0, "ahead": 0.5}, final_time=3)
    np.testing.assert_allclose(closed.goal_position, [6.5, 0])  # said twice, and not refused
    gait = problem.but(goal={}, periodic={x: (x, (0.2, 0.8)), y: (-x, (3, None))})
    np.testing.assert_allclose(gait.goal_position, [1.5, 2])


def test_first_positions_at_the_goal_are_the_nearest_by_whole_turns():
    """Newton's first step from x = 1.52, where sin is flat, to sin x = 0.1 goes 17.7 rad far; the
    place that it leads to is moved by turns of 2 pi, and not where a bound forbids it."""
    system = dmoc.MechanicalSystem(
        "turner", [x], x.diff() ** 2 / 2, inputs=[u], forces={x: u}, quantities={"high": sp.sin(x)}
    )
    problem = dmoc.Problem(dmoc.build(system), {x: 1.52}, {"high": 0.1}, steps=4)
    (goal,) = problem.goal_position
    np.testing.assert_allclose(np.sin(goal), 0.1)
    assert abs(goal - 1.52) <= np.pi
    bounded = problem.but(start={x: np.pi - 1.52}, goal={"high": 0.1, x: (1.5, None)})
    np.testing.assert_allclose(bounded.goal_position, 6 * np.pi + np.arcsin(0.1))
