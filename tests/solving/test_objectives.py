"""Integrals with bounds, and objectives of totals, ends, final time and peaks: closed forms, and
what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.errors import ModelError, ProblemError

pytestmark = pytest.mark.slow

x, u, F = dynamicsymbols("x u F")
c, k = sp.symbols("c k")
ORDERS = (2, 4)


def mass(**fields: Any) -> dmoc.MechanicalSystem:
    """1 kg on a line."""
    return dmoc.MechanicalSystem(
        "mass", [x], x.diff() ** 2 / 2, inputs=[u], forces={x: u}, **fields
    )


def across(system: Any, order: int, goal: dict[Any, Any] | None = None, **changes: Any) -> Any:
    """From rest to rest, 1 m further; the solution."""
    kernels = dmoc.build(system, order=order)
    problem = dmoc.Problem(
        kernels, {x: 0}, {x: 1, "x_dot": 0} | (goal or {}), steps=200 // order, **changes
    )
    return dmoc.solve(problem, "ipm", starts=3)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("E", [12.0, 96.0])
def test_least_time_with_a_bounded_effort(order, E):
    """12/T^3 is the least effort: T = (12/E)^(1/3)."""
    system = mass(integrals={"effort": u**2}, objective=dmoc.final_time)
    solution = across(system, order, {"effort": (None, E)})
    assert solution.verification.passed
    np.testing.assert_allclose(
        solution.cost, (12 / E) ** (1 / 3), rtol=1e-4 if order == 2 else 1e-8
    )
    np.testing.assert_allclose(solution.trajectory.totals["effort"], E, rtol=1e-8)


@pytest.mark.parametrize("order", ORDERS)
def test_smallest_peak_of_a_force(order):
    """As much forth as back: 4 d/T^2; with two forces that are scaled, the same."""
    solution = across(
        mass(quantities={"push": u}, objective=dmoc.largest("push")), order, final_time=1
    )
    np.testing.assert_allclose(solution.cost, 4, rtol=1e-6)
    assert solution.active_bounds[0].startswith("peak of push in")
    assert solution.verification.passed
    scaled = mass(
        quantities={"back": -u, "push": u}, parameters={k: 3.0},
        objective=k * (dmoc.peak("back") + dmoc.peak("push")) + dmoc.largest("push") / 1000,
    )  # fmt: skip
    both = across(scaled, order, final_time=2)
    np.testing.assert_allclose(both.cost, 3 * 2 + 1e-3, rtol=1e-5)
    np.testing.assert_allclose(list(both.trajectory.totals.values()), [1, 1, 1], rtol=1e-3)


@pytest.mark.parametrize("order", ORDERS)
def test_effort_and_time_per_distance(order):
    """(6 d^2/T^3 + c T)/d is least at T^4 = 18 d^2/c: 4/3 (18 c^3)^(1/4)/sqrt(d), at the largest
    distance."""
    system = mass(
        integrals={"effort": u**2 / 2}, parameters={c: 1.5},
        objective=(dmoc.total("effort") + c * dmoc.final_time)
        / (dmoc.at_end(x) - dmoc.at_start(x)),
    )  # fmt: skip
    problem = dmoc.Problem(
        dmoc.build(system, order=order), {x: 0.5}, {x: (1.5, 4.5), "x_dot": 0}, steps=200 // order
    )
    solution = dmoc.solve(problem, "ipm", starts=3)
    wanted = 4 / 3 * (18 * 1.5**3) ** 0.25 / 2
    np.testing.assert_allclose(solution.cost, wanted, rtol=1e-4 if order == 2 else 1e-8)
    # dJ/dc = T/d, dJ/dd = -J/(2 d)
    slopes = dmoc.sensitivities(problem, solution)
    np.testing.assert_allclose(slopes["parameters"]["c"], solution.final_time / 4, rtol=1e-6)
    np.testing.assert_allclose(slopes["goal"]["x"], -wanted / 8, rtol=1e-3)


def test_a_price_of_the_start_and_of_a_total_at_the_goal():
    """v_0^2 + int u^2: 1 m in 1 s, coasting to the end costs 12 (1 - v_0)^2 ... with the end's
    velocity free 3 (1 - v_0)^2, least at v_0 = 3/4."""
    system = mass(
        integrals={"effort": u**2}, objective=dmoc.at_start(x.diff()) ** 2 + dmoc.total("effort")
    )
    for order in ORDERS:
        problem = dmoc.Problem(
            dmoc.build(system, order=order), {x: 0, "x_dot": None}, {x: 1}, steps=200 // order,
            final_time=1,
        )  # fmt: skip
        solution = dmoc.solve(problem, "ipm", starts=3)
        np.testing.assert_allclose(solution.cost, 0.75, rtol=1e-4)
        np.testing.assert_allclose(solution.phases[0].v[0], 0.75, rtol=1e-3)
        bounded = problem.but(goal={x: 1, "effort": (None, 0.03)})  # 3 (1 - v_0)^2 = 0.03
        kept = dmoc.solve(bounded, "ipm", starts=3)
        np.testing.assert_allclose(kept.cost, 0.9**2 + 0.03, rtol=1e-3)
        slope = dmoc.sensitivities(bounded, kept)["goal"]["effort"]
        np.testing.assert_allclose(slope, 1 - 0.9 / (3 * 0.1), rtol=1e-2)  # 1 + 2 v_0 dv_0/dE


@pytest.mark.parametrize("order", ORDERS)
def test_peaks_and_totals_through_a_hit(order):
    """To the wall and back in 2 s at least peak: the wall turns the motion, and nothing pushes."""
    system = mass(
        surfaces={"wall": x <= 1}, quantities={"push": u}, integrals={"effort": u**2},
        objective=dmoc.largest("push") + dmoc.total("effort"),
    )  # fmt: skip
    problem = dmoc.Problem(
        dmoc.build(system, order=order), {x: 0}, {x: 0}, ["wall"], steps=100 // order, final_time=2
    )
    solution = dmoc.solve(problem, "ipm", starts=6)
    assert solution.verification.passed
    push = np.abs(np.concatenate([phase.u for phase in solution.phases])).max()
    np.testing.assert_allclose(solution.trajectory.totals["largest push"], push, rtol=1e-6)
    np.testing.assert_allclose(
        solution.cost, push + solution.trajectory.totals["effort"], rtol=1e-8
    )
    plain = mass(surfaces={"wall": x <= 1}, cost=u**2)
    other = dmoc.solve(problem.but(kernels=dmoc.build(plain, order=order)), "ipm", starts=6)
    assert other.cost <= solution.trajectory.totals["effort"] * (1 + 1e-9)


@pytest.mark.parametrize("order", ORDERS)
def test_totals_that_vanish(order):
    """The work from rest to rest is none, in first motions too: int u^2 = 12.  With v at the end a
    work of v^2/2: 4 (3 - 3 v + v^2)."""
    kernels = dmoc.build(mass(integrals={"work": u * x.diff()}, cost=u**2), order=order)
    problem = dmoc.Problem(kernels, {x: 0}, {x: 1, "x_dot": 0}, steps=40, final_time=1)
    solution = dmoc.solve(problem, starts=1)
    np.testing.assert_allclose(solution.cost, 12, rtol=1e-2)
    assert abs(solution.trajectory.totals["work"]) < 1e-9
    faster = dmoc.solve(problem.but(goal={x: 1, "x_dot": (0.4, None), "work": 0.125}))
    np.testing.assert_allclose(faster.cost, 4 * (3 - 1.5 + 0.25), rtol=1e-2)


def test_peaks_without_a_price_and_with_a_negative_one():
    """int u^2 = 12 alone has the largest force 6; a price that falls without end is no minimum."""
    system = mass(
        quantities={"push": u}, parameters={k: 0.0}, cost=u**2, objective=k * dmoc.largest("push")
    )
    kernels = dmoc.build(system, order=4)
    problem = dmoc.Problem(kernels, {x: 0}, {x: 1, "x_dot": 0}, steps=20, final_time=1)
    free = dmoc.solve(problem, starts=1)
    np.testing.assert_allclose(free.trajectory.totals["largest push"], 6, rtol=1e-6)
    falling = dmoc.solve(problem.but(parameters={k: -1.0}), starts=1)
    assert falling.status == "stalled"
    assert "it falls as largest push rises" in falling.message


def test_peaks_are_solved_by_ipm_by_default():
    """The condensed slsqp stalls here after 260 iterations; its full form comes to the same."""
    system = mass(
        quantities={"push": u, "power": u * x.diff()}, objective=dmoc.peak("push"), cost=u**2
    )
    problem = dmoc.Problem(
        dmoc.build(system, order=2), {x: 0}, {x: 1, "x_dot": 0}, steps=20, final_time=1,
        bounds={"x_dot": (None, 1.2), "power": (-4, 4)},
    )  # fmt: skip
    first, again = (dmoc.solve(problem, verify=False, **keywords) for keywords in (
        {"starts": 1}, {"method": "slsqp", "form": "full", "starts": 1},
    ))  # fmt: skip
    assert first.method == "ipm" and first.minimum
    assert first.iterations < 40
    np.testing.assert_allclose(first.cost, again.cost, rtol=1e-7)


def test_bounds_of_integrals_are_named():
    """int u^2 is 12 at least from rest to rest in 1 s; the work of v^2/2 <= 0.02 is v <= 0.2."""
    kernels = dmoc.build(mass(integrals={"effort": u**2, "work": u * x.diff()}, cost=u**2), order=4)
    problem = dmoc.Problem(kernels, {x: 0}, {x: 1}, steps=20, final_time=1)
    little = dmoc.solve(problem.but(goal={x: 1, "x_dot": 0, "effort": (None, 5)}))
    assert little.status == "infeasible"
    assert little.conflicts[0] == "the goal of effort is missed by 7"
    slow = dmoc.solve(problem.but(goal={x: 1, "work": (None, 0.02)}))
    np.testing.assert_allclose(slow.cost, 4 * (3 - 3 * 0.2 + 0.2**2), rtol=1e-6)
    assert "work <= 0.02" in slow.active_bounds


def test_bounds_of_velocities_at_ends_and_events_are_named():
    """1 m forth and 0.25 m back in 2 s, at 0.3 m/s at most: 1.17 s for 1 m, 0.6 m/s at the wall."""
    kernels = dmoc.build(mass(surfaces={"wall": x <= 1}, cost=u**2), order=4)
    problem = dmoc.Problem(
        kernels, {x: 0, "x_dot": (None, 0.5)}, {x: 0.75}, ["wall"], steps=20,
        final_time=2, restitution=0.5, bounds={"x_dot": (-0.3, None)},
    )  # fmt: skip
    solution = dmoc.solve(problem)
    assert solution.verification.passed
    assert "x_dot at the start <= 0.5" in solution.active_bounds
    assert "x_dot after collision 1 (wall) >= -0.3" in solution.active_bounds


def test_sweeps_over_all_that_problems_state():
    """The speed that a mass keeps: v^2/2 from rest to a kinetic energy costs 4 (3 - 3 v + v^2)."""
    system = mass(integrals={"effort": u**2}, quantities={"kinetic": x.diff() ** 2 / 2}, cost=u**2)
    kernels = dmoc.build(system, order=4)
    problem = dmoc.Problem(kernels, {x: 0}, {x: 1, "x_dot": (0, None)}, steps=20, final_time=1)
    batch = dmoc.sweep(
        problem, goal={"kinetic": [0.5, 2.0], "effort": [(None, 3.9), (None, 20.0)]},
        bounds={"x_dot": [(None, 3.0)], "kinetic": [(None, 4.0)]},
    )  # fmt: skip
    assert [str(status) for status in batch.status] == ["infeasible", "solved"] * 2
    np.testing.assert_allclose(batch.cost[[1, 3]], [4, 4], rtol=1e-6)


def test_totals_are_kept_in_files(tmp_path: Path):
    solution = across(mass(integrals={"effort": u**2}, cost=u**2), 2, final_time=1)
    solution.save(tmp_path / "s.npz")
    kept = dmoc.Solution.load(tmp_path / "s.npz").trajectory.totals
    assert kept == solution.trajectory.totals
    np.testing.assert_allclose(kept["effort"], solution.cost, rtol=1e-12)
    assert "effort" in str(solution)
    assert solution.to_dict()["totals"] == kept


REFUSED = {
    "an unknown integral": ({"objective": dmoc.total("effrt")}, "expected the name of an integral"),
    "an unknown quantity": ({"objective": dmoc.peak("push")}, "expected the name of a quantity"),
    "no time": ({"objective": x**2}, "whose time is not said"),
    "an input at the end": ({"objective": dmoc.at_end(u)}, r"contains u\(t\) at the end"),
    "a kink": ({"objective": abs(dmoc.at_end(x))}, "the objective contains"),
    "a falling peak": ({"quantities": {"push": u}, "objective": -dmoc.peak("push")},
                       "falls with peak"),
    "an unknown parameter": ({"objective": k * dmoc.final_time}, "objective contains k"),
    "an integral named like the final time": (
        {"integrals": {"final_time": u**2}}, "has the name of the final time"
    ),
    "an integrand with a name of its own": ({"integrals": {"u": u**2}}, "'u' is used twice"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_no_objective_is_refused(case):
    fields, message = REFUSED[case]
    with pytest.raises(ModelError, match=message):
        mass(**fields)


def test_a_total_has_a_name():
    with pytest.raises(ModelError, match="expected the name of an integral"):
        dmoc.total(x)


def test_integrals_are_bounded_at_the_goal_alone():
    system = mass(integrals={"effort": u**2})
    with pytest.raises(ProblemError, match="unknown state 'effort' at the start"):
        dmoc.Problem(system, {x: 0, "effort": 1}, {x: 1}, steps=4, final_time=1)
    with pytest.raises(ProblemError, match="goal of effort"):
        dmoc.Problem(system, {x: 0}, {x: 1, "effort": (2, 1)}, steps=4, final_time=1)
    with pytest.raises(ProblemError, match="did you mean 'effort'"):
        dmoc.Problem(system, {x: 0}, {x: 1, "efort": 1}, steps=4, final_time=1)


@pytest.mark.parametrize("fields", [{"cost": 1}, {"objective": dmoc.final_time}])
def test_least_time_within_bounds_of_a_quantity(fields):
    """Up with 1 N, down with 2 N: sqrt(2 d (1 + 1/2)); nothing else says how long it takes."""
    system = mass(quantities={"push": u}, **fields)
    problem = dmoc.Problem(system, {x: 0}, {x: 1, "x_dot": 0}, bounds={"push": (-2, 1)}, steps=200)
    solution = dmoc.solve(problem)
    assert solution.solved
    np.testing.assert_allclose(solution.final_time, np.sqrt(3), rtol=1e-4)
