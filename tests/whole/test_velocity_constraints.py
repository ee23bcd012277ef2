"""Constraints of velocities: wheels and blades, rates that are prescribed, rods by their rates;
through the whole chain beside closed forms, and beside a collocation of another program."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import LagrangesMethod, dynamicsymbols

import dmoc
from dmoc.base.errors import ModelError, ProblemError
from dmoc.codegen.kernels import Kernels
from dmoc.export.numbers import numbers_of
from dmoc.program.transcription import Transcription

X, Y, A, U, W = dynamicsymbols("x y a u w")
T = dynamicsymbols._t
V_X, V_Y, OMEGA = X.diff(), Y.diff(), A.diff()
BLADE = V_X * sp.sin(A) - V_Y * sp.cos(A)
STILL = {"x_dot": 0, "y_dot": 0, "a_dot": 0}
ORDERS = pytest.mark.parametrize("order", [2, 4, 6])


def knife(order: int) -> Kernels:
    """A blade of 1 kg on a slope of 0.4 rad down which x points; its inertia has no effect."""
    lagrangian = (V_X**2 + V_Y**2) / 2 + 0.15 * OMEGA**2 + 9.81 * np.sin(0.4) * X
    system = dmoc.MechanicalSystem("knife", [X, Y, A], lagrangian, constraints={"blade": BLADE})
    return dmoc.build(system, order=order)


def car_system(**more: Any) -> dmoc.MechanicalSystem:
    """A car of 1 kg and 0.2 kg m^2 about its rear axle, which pushes along it and turns it."""
    return dmoc.MechanicalSystem(
        "car", [X, Y, A], (V_X**2 + V_Y**2) / 2 + 0.1 * OMEGA**2, inputs=[U, W],
        forces={X: U * sp.cos(A), Y: U * sp.sin(A), A: W}, cost=U**2 + W**2,
        constraints={"axle": BLADE}, **more,
    )  # fmt: skip


def car(order: int, **more: Any) -> Kernels:
    return dmoc.build(car_system(**more), order=order)


def parking(order: int, steps: int | None = 40, **more: Any) -> dmoc.Problem:
    ends = {"start": {"x": 0, "y": 0, "a": 0, **STILL}, "goal": {"x": 0, "y": 1, "a": 0, **STILL}}
    return dmoc.Problem(car(order, **more), **ends, steps=steps, final_time=3.0)


def cycloid(w: float, t: float) -> list[float]:
    """Of the blade that turns with w, started at rest across the slope."""
    size = 9.81 * np.sin(0.4) / (2 * w**2)
    return [size * np.sin(w * t) ** 2, size * (w * t - np.sin(w * t) * np.cos(w * t)), w * t]


def test_a_blade_on_a_slope_does_not_run_down_it() -> None:
    """It goes on across the slope, along a cycloid."""
    run = dmoc.simulate(
        knife(2), {"x": 0, "y": 0, "a": 0}, {"x": 0, "y": 0, "a": 3.0}, steps=200, step_size=0.01
    )
    expected = [cycloid(3.0, t) for t in run.t]
    np.testing.assert_allclose(run.q, expected, atol=1e-9)
    energy = (run.v[:, :2] ** 2).sum(axis=1) / 2 - 9.81 * np.sin(0.4) * run.q[:, 0]
    np.testing.assert_allclose(energy, energy[0], atol=1e-9)


@ORDERS
def test_the_discrete_blade_has_the_order_of_its_steps(order: int) -> None:
    start = {"x": 0, "y": 0, "a": 0, **STILL, "a_dot": 3.0}
    errors = []
    for steps in (10, 20, 40):
        problem = dmoc.Problem(knife(order), start, steps=steps, final_time=1.0)
        solution = dmoc.solve(problem, "ipm", starts=1, verify=False)
        assert solution.minimum
        end = solution.phases[-1].q[-1]
        errors.append(float(np.abs(end - cycloid(3.0, 1.0)).max()))
    rates = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(rates, order, atol=0.1)


def test_the_sleigh_of_chaplygin() -> None:
    """With its centre at a distance a before the blade it turns until it runs straight: v = V
    tanh(k t), w = V sqrt(m/I) sech(k t) with I = J + m a^2, k = m a V / I."""
    m, J, a, V, begin = 1.3, 0.4, 0.5, 1.7, -0.8
    I = J + m * a**2
    k = m * a * V / I
    centre = X + a * sp.cos(A), Y + a * sp.sin(A)
    lagrangian = m / 2 * sum(c.diff(T) ** 2 for c in centre) + J / 2 * OMEGA**2
    system = dmoc.MechanicalSystem("sleigh", [X, Y, A], lagrangian, constraints={"blade": BLADE})
    kernels = dmoc.build(system, order=4)

    def speeds(t: Any) -> tuple[Any, Any]:
        return V * np.tanh(k * (begin + t)), V * np.sqrt(m / I) / np.cosh(k * (begin + t))

    v, w = speeds(0.0)
    start = {"x": 0, "y": 0, "a": 0.3}
    rates = {"x": v * np.cos(0.3), "y": v * np.sin(0.3), "a": w}
    run = dmoc.simulate(kernels, start, rates, steps=100, step_size=0.02)
    along = (run.v[:, 0] * np.cos(run.q[:, 2])) + run.v[:, 1] * np.sin(run.q[:, 2])
    np.testing.assert_allclose(along, speeds(run.t)[0], atol=1e-8)
    np.testing.assert_allclose(run.v[:, 2], speeds(run.t)[1], atol=1e-8)
    given = start | {f"{name}_dot": rate for name, rate in rates.items()}
    problem = dmoc.Problem(kernels, given, steps=60, final_time=2.0)
    solution = dmoc.solve(problem, "ipm", starts=1)
    assert solution.solved, solution.message
    end = solution.phases[-1]
    np.testing.assert_allclose(end.q[-1], run.q[-1], atol=1e-6)
    np.testing.assert_allclose(end.v[-1], run.v[-1], atol=1e-6)


def test_a_disc_that_rolls_by_its_rate_is_one_that_rolls_by_its_place() -> None:
    """Also off a wall, which changes its spin."""
    radius, answers = 0.5, []
    for name, constraint in (("place", X - radius * A), ("rate", V_X - radius * OMEGA)):
        system = dmoc.MechanicalSystem(
            f"disc_by_{name}", [X, A], V_X**2 / 2 + 0.125 * OMEGA**2 / 2, inputs=[U],
            forces={A: U}, cost=U**2, surfaces={"wall": X <= 1}, constraints={"rolls": constraint},
        )  # fmt: skip
        problem = dmoc.Problem(
            dmoc.build(system, order=4), {"x": 0, "a": 0, "x_dot": 0, "a_dot": 0},
            {"x": 0, "x_dot": 0}, sequence=["wall"], restitution=0.7, steps=20, final_time=2.0,
        )  # fmt: skip
        answers.append(dmoc.solve(problem, "ipm", starts=1, optimality=1e-9))
    place, rate = answers
    assert place.solved and rate.solved
    assert rate.cost == pytest.approx(place.cost, rel=1e-8)
    assert rate.collisions[0].time == pytest.approx(place.collisions[0].time, rel=1e-6)
    impulse = place.collisions[0].reactions["rolls"]
    assert rate.collisions[0].reactions["rolls"] == pytest.approx(impulse, rel=1e-6)
    for a, b in zip(place.phases, rate.phases, strict=True):
        np.testing.assert_allclose(b.q, a.q, atol=1e-7)


def test_a_car_that_parks_beside_where_it_stands() -> None:
    """The effort is that of Hermite and Simpson's rule in CasADi with IPOPT in (x, y, heading,
    speed, turning rate), 60 intervals, from five of eight random starts: 2.0420590."""
    fine = dmoc.solve(parking(4), "ipm")
    assert fine.solved, fine.message
    assert fine.cost == pytest.approx(2.0420590, rel=1e-5)
    default = dmoc.solve(parking(2, None))
    assert default.solved, default.message
    assert default.cost == pytest.approx(2.0420590, rel=1e-3)


@pytest.mark.parametrize(("price", "status"), [(0, "stalled"), (sp.Rational(1, 10), "solved")])
def test_a_car_that_has_all_the_time_it_wants(price: sp.Expr, status: str) -> None:
    """No start leads to y = 1 while its time may drift away; where time has a price, all do."""
    at_rest = {"x": 0, "y": 0, "a": 0, **STILL}
    stated = replace(car_system(), cost=U**2 + W**2 + price)
    solution = dmoc.solve(dmoc.Problem(stated, at_rest, {"y": 1}), starts=4)
    assert solution.status == status, solution.message
    assert ("it falls as final_time grows" in solution.message) == (price == 0)


def test_an_axle_holds_what_a_turn_needs() -> None:
    """m v w across the way, as the forces of the plan and as a quantity that is bounded."""
    grip = {"grip": dmoc.reaction("axle")}
    free = dmoc.solve(parking(4, quantities=grip), "ipm", starts=4)
    phase = free.phases[0]
    v = phase.v[:, 0] * np.cos(phase.q[:, 2]) + phase.v[:, 1] * np.sin(phase.q[:, 2])
    np.testing.assert_allclose(phase.reaction[:, 0], -v * phase.v[:, 2], atol=3e-3)
    most = 0.8 * np.abs(phase.reaction).max()
    bounded = parking(4, quantities=grip).but(bounds={"grip": (-most, most)})
    held = dmoc.solve(bounded, "ipm", guess=free, starts=1)
    assert held.solved, held.message
    assert np.abs(held.phases[0].reaction).max() == pytest.approx(most, rel=0.01)
    assert free.cost < held.cost < 1.1 * free.cost


@pytest.mark.parametrize("order", [2, 4])
def test_an_axle_holds_through_a_hit(order: int) -> None:
    """A car that runs askew into a wall comes back along its own way: the impulse of the wall and
    that of the axle leave -e of its speed."""
    kernels = car(order, surfaces={"wall": X <= 1})
    v = 2 * np.array([np.cos(0.5), np.sin(0.5), 0.0])
    start = {"x": 0, "y": 0, "a": 0.5} | dict(zip(STILL, v, strict=True))
    off = {"u": (0, 0), "w": (0, 0)}
    problem = dmoc.Problem(
        kernels, start, sequence=["wall"], restitution=0.5, steps=20, final_time=1.0, bounds=off
    )
    solution = dmoc.solve(problem)
    assert solution.solved, solution.message
    (hit,) = solution.collisions
    assert hit.time == pytest.approx(1 / v[0], rel=1e-9)
    np.testing.assert_allclose(solution.phases[1].v[0], -0.5 * v, atol=1e-8)
    assert hit.impulse == pytest.approx(3.0 / np.cos(0.5), rel=1e-8)
    assert hit.reactions["axle"] == pytest.approx(3.0 * np.tan(0.5), rel=1e-8)
    run = dmoc.simulate(
        kernels, {"x": 0, "y": 0, "a": 0.5}, dict(zip("xya", v, strict=True)), steps=100,
        step_size=0.01, restitution=0.5,
    )  # fmt: skip
    assert run.collisions[0].impulse == pytest.approx(hit.impulse, rel=1e-8)
    np.testing.assert_allclose(run.v[-1], -0.5 * v, atol=1e-8)


def test_a_hit_that_the_axle_takes_whole_has_no_slope() -> None:
    """Where it stands along the wall, no motion leads into it."""
    kernels = car(2, surfaces={"wall": X <= 1})
    start = {"x": 0, "y": 0, "a": 0, **STILL}
    problem = dmoc.Problem(
        kernels, start, start | {"y": 0.5}, sequence=["wall"], restitution=0.8, final_time=(1, 6)
    )
    assert dmoc.solve(problem).solved


@ORDERS
def test_a_rate_that_is_prescribed(order: int) -> None:
    """x' = 3 t, beside a mass that falls: R = x'' = 3."""
    system = dmoc.MechanicalSystem(
        "driven_rate", [X, Y], (V_X**2 + V_Y**2) / 2 - 9.81 * Y,
        constraints={"drive": sp.Eq(V_X, 3 * T)},
    )  # fmt: skip
    start = {"x": 0, "y": 0, "x_dot": 0, "y_dot": 0}
    problem = dmoc.Problem(dmoc.build(system, order=order), start, steps=20, final_time=2.0)
    solution = dmoc.solve(problem)
    assert solution.solved, solution.message
    np.testing.assert_allclose(solution.phases[0].q[-1], [6, -9.81 * 2], rtol=1e-9)
    np.testing.assert_allclose(solution.phases[0].reaction, 3.0, rtol=1e-9)


def test_a_start_may_leave_out_what_a_blade_decides() -> None:
    problem = dmoc.Problem(
        car(2), {"x": 0, "y": 0, "a": np.pi / 4, "x_dot": 1.0, "a_dot": 0}, {"x": 2}, steps=10
    )
    solution = dmoc.solve(problem, "ipm", starts=1, verify=False)
    np.testing.assert_allclose(solution.phases[0].v[0], [1, 1, 0], atol=1e-8)
    with pytest.raises(ProblemError, match="the start of y is not given"):
        dmoc.Problem(car(2), {"x": 0, "a": 0, **STILL}, {"x": 2}, steps=10)
    with pytest.raises(ProblemError, match="'axle' does not allow the velocity at the start"):
        dmoc.Problem(car(2), {"x": 0, "y": 0, "a": 0, **STILL, "y_dot": 1.0}, steps=10)


@pytest.mark.parametrize(
    ("constraint", "message"),
    [
        (V_X**2 + V_Y**2 - 1, "'c' is not linear in the velocity x_dot"),
        (V_X * V_Y, "'c' is not linear in the velocity x_dot"),
        (V_X - U, "contains u"),
        (V_X.diff() - 1, "not the first derivative"),
        (sp.Symbol("k") * T, "contains no coordinate"),
    ],
)
def test_what_is_no_constraint_of_velocities(constraint: Any, message: str) -> None:
    with pytest.raises(ModelError, match=message):
        dmoc.MechanicalSystem(
            "c", [X, Y], (V_X**2 + V_Y**2) / 2, {sp.Symbol("k"): 1.0}, inputs=[U],
            forces={X: sp.Symbol("k") * U}, constraints={"c": constraint},
        )  # fmt: skip


def test_linear_in_disguise() -> None:
    """(x'^2 - 1)/(x' - 1) = x' + 1 is linear."""
    disguised = (V_X**2 - 1) / (V_X - 1)
    system = dmoc.MechanicalSystem("d", [X, Y], (V_X**2 + V_Y**2) / 2, constraints={"c": disguised})
    assert dmoc.build(system).manifest.rate_constraints == ["c"]


def test_a_model_of_sympy_brings_its_constraints_of_velocities() -> None:
    lagrangian = (V_X**2 + V_Y**2) / 2 + 0.15 * OMEGA**2 + 9.81 * np.sin(0.4) * X
    method = LagrangesMethod(lagrangian, [X, Y, A], nonhol_coneqs=[BLADE])
    system = dmoc.MechanicalSystem.from_lagranges_method("brought", method, {})
    run = dmoc.simulate(
        dmoc.build(system), {"x": 0, "y": 0, "a": 0}, {"x": 0, "y": 0, "a": 3.0}, steps=100,
        step_size=0.01,
    )  # fmt: skip
    np.testing.assert_allclose(run.q[-1], cycloid(3.0, 1.0), atol=1e-9)


def test_the_solver_in_c_has_the_same_answers(tmp_path: Path) -> None:
    problem = parking(4, 20)
    dmoc.generate_solver(problem, tmp_path / "solver")
    solver = dmoc.load_solver(tmp_path / "solver")
    for y in (1.0, 0.9):
        solver.set(goal={"y": y})
        end = solver.solve()
        assert end.status == "solved"
        there = dmoc.solve(problem.but(goal={**problem.goal, "y": y}), "ipm", starts=4)
        assert end.cost == pytest.approx(there.cost, rel=1e-6)


def test_sensitivities_are_those_of_whole_solves() -> None:
    problem = parking(4, 20)
    solution = dmoc.solve(problem, "ipm", optimality=1e-9)
    change = dmoc.sensitivities(problem, solution)
    low, high = (
        dmoc.solve(problem.but(goal={**problem.goal, "y": 1 + d}), "ipm", optimality=1e-9).cost
        for d in (-1e-3, 1e-3)
    )
    assert change["goal"]["y"] == pytest.approx((high - low) / 2e-3, rel=1e-4)


def driven(order: int) -> dmoc.Problem:
    """A mass that moves with a prescribed speed k beside one that is pushed, cost of 12 and of how
    far k is from 0.7; the start leaves out what k decides."""
    k = sp.Symbol("k")
    system = dmoc.MechanicalSystem(
        "driven_speed", [X, Y], (V_X**2 + V_Y**2) / 2, {k: 1.0}, inputs=[U], forces={Y: U},
        cost=U**2 + (V_X - 0.7) ** 2, constraints={"drive": sp.Eq(V_X, k)},
    )  # fmt: skip
    start, goal = {"x": 0, "y": 0, "y_dot": 0}, {"y": 1, "y_dot": 0}
    return dmoc.Problem(dmoc.build(system, order=order), start, goal, steps=10, final_time=1.0)


@pytest.mark.parametrize("order", [2, 4])
def test_a_design_chooses_a_rate_that_the_start_leaves_out(order: int) -> None:
    """It begins with this rate, and needs no force."""
    solution = dmoc.solve(driven(order).but(design={"k": (0.1, 2.0)}), "ipm", starts=1)
    assert solution.solved, solution.message
    assert solution.design["k"] == pytest.approx(0.7, abs=1e-6)
    assert np.abs(solution.phases[0].reaction).max() < 1e-9


def test_a_solver_in_c_keeps_what_would_move_speeds_that_nobody_states() -> None:
    """The start's speed is what k makes it: no number of the solver is that speed."""
    problem = driven(4)
    numbers = numbers_of(Transcription(problem, Transcription(problem).scale))
    assert "parameters.k" in numbers.kept
    assert "goal.y" in {number.name for number in numbers.taken}


@pytest.mark.parametrize("other", [sp.Eq(V_X, 2), sp.Eq(X, 2 * T)])
def test_constraints_that_contradict_each_other_are_said_before_the_start(other: Any) -> None:
    system = dmoc.MechanicalSystem(
        "torn", [X, Y], (V_X**2 + V_Y**2) / 2, constraints={"one": sp.Eq(V_X, 1), "two": other}
    )
    with pytest.raises(ProblemError, match="the others; leave one out") as refused:
        dmoc.Problem(dmoc.build(system), {"x": 0, "y": 0}, steps=10, final_time=1.0)
    assert "the constraints one, two of phase 0 contradict each other" in str(refused.value)
