"""Friction that depends on the sliding speed, in solves, simulations and checks."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import quad, solve_bvp
from sliding import G, T, block, stick_and_slip, u, violin, x, y

import dmoc
from dmoc.base.errors import ModelError, ProblemError, SimulationError
from dmoc.inspection.kernel_check import kernel_errors

pytestmark = pytest.mark.slow

SPEED = dmoc.sliding_speed
# From 0.5 at rest towards 0.2, and up again.
STRIBECK = sp.Rational(1, 5) + sp.Rational(3, 10) * sp.exp(-2 * SPEED) + SPEED / 50
SQUEAL = 1 + sp.exp(-4 * SPEED)  # a force in N


def stribeck(speed: Any) -> Any:
    return 0.2 + 0.3 * np.exp(-2 * speed) + speed / 50


def squeal(speed: float) -> float:
    return float(1 + np.exp(-4 * speed))


@pytest.fixture(scope="module")
def slowed() -> dmoc.MechanicalSystem:
    return block(STRIBECK)


def stop_from(speed: float) -> tuple[float, float]:
    """Time and way to rest: dt = -dv / (mu(v) g)."""
    time = quad(lambda v: 1 / (G * stribeck(v)), 0, speed, epsabs=1e-13)[0]
    return time, quad(lambda v: v / (G * stribeck(v)), 0, speed, epsabs=1e-13)[0]


def test_a_simulated_block_slides_to_rest(slowed: dmoc.MechanicalSystem) -> None:
    time, way = stop_from(2.0)
    run = dmoc.simulate(slowed, {x: 0}, {x: 2}, step_size=0.01, steps=120)
    assert run.q[-1, 0] == pytest.approx(way, abs=1e-10)
    assert [s.friction for s in run.rubbing] == [1, 0]
    assert run.rubbing[0].end == pytest.approx(time, abs=1e-10)
    phase = run.trajectory.phases[0]
    assert phase.coefficients[:, 0] == pytest.approx(stribeck(phase.v[:, 0]))
    assert run.trajectory.phases[1].coefficients == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("order", "steps", "error"), [(2, 40, 2e-4), (4, 10, 2e-5), (4, 20, 1.5e-6), (6, 10, 5e-7)]
)
@pytest.mark.parametrize("belt", [0, 1])
def test_a_block_slides_to_rest(order: int, steps: int, error: float, belt: int) -> None:
    """On a floor, and on a belt that it is as fast as in the end; with a finer mesh at most
    2^(1 - order) of the error."""
    time, way = stop_from(2.0)
    kernels = dmoc.build(block(STRIBECK, x - belt * T), order=order)
    ends = []
    for n in (steps, 2 * steps):
        problem = dmoc.Problem(
            kernels, start={x: 0, y: 0, "x_dot": 2 + belt}, goal={"x_dot": belt},
            contacts=["floor:slip+"], bounds={u: (0, 0)}, steps=n,
        )  # fmt: skip
        solution = dmoc.solve(problem, starts=1)
        assert solution.verification.passed, solution.message
        phase = solution.phases[0]
        ends.append([solution.final_time - time, phase.q[-1, 0] - belt * solution.final_time - way])
    assert np.abs(ends[0]).max() < error
    assert np.abs(ends[1]).max() < 2.0 ** (1 - order) * error
    assert phase.coefficients[:, 0] == pytest.approx(stribeck(phase.v[:, 0] - belt))


@pytest.mark.parametrize(("order", "error"), [(2, 2e-3), (4, 1e-7), (6, 1e-10)])
def test_viscous_friction_slows_down_exponentially(order: int, error: float) -> None:
    """mu = c v: v = v_0 exp(-c g t)."""
    system = block(SPEED / 8)
    run = dmoc.simulate(system, {x: 0}, {x: -2}, step_size=0.01, steps=100)
    v = -2 * np.exp(-G / 8)
    assert run.v[-1, 0] == pytest.approx(v, abs=1e-10)
    assert [s.friction for s in run.rubbing] == [-1]
    problem = dmoc.Problem(
        dmoc.build(system, order=order), start={x: 0, y: 0, "x_dot": -2}, goal={},
        contacts=["floor:slip-"], bounds={u: (0, 0)}, steps=24, final_time=1,
    )  # fmt: skip
    solution = dmoc.solve(problem, starts=1)
    assert solution.verification.passed, solution.message
    phase = solution.phases[0]
    assert phase.q[-1, 0] == pytest.approx(8 / G * (-2 - v), abs=error)
    assert phase.v[-1, 0] == pytest.approx(v, abs=error)
    assert phase.tangential[:, 0] == pytest.approx(
        -phase.v[:, 0] * G / 8, abs=10 * G / 24**2 * (1 + (order == 2)) / order**2
    )


def test_a_block_sticks_and_slips_on_a_belt() -> None:
    run = dmoc.simulate(violin(SQUEAL), {x: 0}, {x: 1}, step_size=0.01, steps=1000)
    sticks, slips = stick_and_slip(squeal)
    assert [s.friction for s in run.rubbing[:5]] == [0, -1, 0, -1, 0]
    assert run.rubbing[0].end == pytest.approx(0.5, abs=1e-7)
    times = [s.end - s.begin for s in run.rubbing[1:5]]
    assert times == pytest.approx([slips, sticks, slips, sticks], abs=1e-6)


@pytest.mark.parametrize(
    ("order", "steps", "error"), [(2, 100, 1e-3), (4, 20, 5e-5), (6, 20, 2e-6)]
)
def test_a_motion_slips_until_it_sticks(order: int, steps: int, error: float) -> None:
    """From one breaking away until it sticks, and again: the limit cycle of the words.  When it
    breaks away, only inequalities of the nodes say."""
    sticks, slips = stick_and_slip(squeal)
    problem = dmoc.Problem(
        dmoc.build(violin(SQUEAL), order=order), start={x: 0.5, "x_dot": 1}, goal={},
        contacts=["belt:slip-"], sequence=["belt:stick", "belt:slip-"], steps=steps,
        final_time=slips + sticks + 0.5,
    )  # fmt: skip
    solution = dmoc.solve(problem, starts=2)
    assert solution.verification.passed, solution.message
    durations = [phase.duration for phase in solution.phases[:2]]
    assert durations[0] == pytest.approx(slips, abs=error)
    assert durations[1] == pytest.approx(sticks, abs=sticks / steps)


def test_the_limit_cycle_is_the_periodic_motion() -> None:
    """Whose start nobody states: x and x' return, which the time in the belt does not."""
    sticks, slips = stick_and_slip(squeal)
    problem = dmoc.Problem(
        dmoc.build(violin(SQUEAL), order=4), start={}, goal={}, contacts=["belt:slip-"],
        sequence=["belt:stick"], steps=30, periodic=["x", "x_dot"],
        final_time=(1, 6),
    )  # fmt: skip
    solution = dmoc.solve(problem, starts=4)
    assert solution.verification is not None, solution.message
    assert solution.verification.passed, solution.message
    durations = [phase.duration for phase in solution.phases]
    assert durations == pytest.approx([slips, sticks], abs=2e-2)


def pulled(time: float) -> float:
    """The least integral of u^2 / 2 from rest to rest, 1 m ahead: x'' = u - f(x'), and
    u' = p + u f'(x') with a number p."""

    def slope(_: Any, s: Any, p: Any) -> Any:
        steep = G * (-0.6 * np.exp(-2 * s[1]) + 0.02)
        return np.array([s[1], s[2] - G * stribeck(s[1]), p[0] + s[2] * steep])

    def ends(a: Any, b: Any, _: Any) -> Any:
        return np.array([a[0], a[1], b[0] - 1, b[1]])

    at = np.linspace(0, time, 200)
    way = 3 * (at / time) ** 2 - 2 * (at / time) ** 3
    first = np.array([way, np.gradient(way, at), 6 - 12 * at / time + 3])
    curve = solve_bvp(slope, ends, at, first, p=[-10], tol=1e-10, max_nodes=100_000)
    assert curve.status == 0
    assert curve.sol(at)[1].min() > -1e-9
    assert curve.sol(0)[2] > G * 0.5  # it begins to slide
    return float(quad(lambda s: curve.sol(s)[2] ** 2 / 2, 0, time, limit=500, epsabs=1e-10)[0])


@pytest.mark.parametrize(("order", "steps", "error"), [(2, 80, 2e-2), (4, 80, 3e-6), (6, 80, 2e-6)])
def test_a_block_is_pulled_over_the_floor(
    slowed: dmoc.MechanicalSystem, order: int, steps: int, error: float
) -> None:
    problem = dmoc.Problem(
        dmoc.build(slowed, order=order), start={x: 0, y: 0, "x_dot": 0}, goal={x: 1, "x_dot": 0},
        contacts=["floor:slip+"], steps=steps, final_time=1,
    )  # fmt: skip
    solution = dmoc.solve(problem, starts=1)
    assert solution.verification.passed, solution.message
    assert solution.cost == pytest.approx(pulled(1.0), abs=error)


@pytest.mark.parametrize("order", [2, 4, 6])
def test_the_kernels_agree_with_an_independent_evaluation(order: int) -> None:
    m, s = sp.symbols("m s")
    system = dmoc.MechanicalSystem(
        "bent", [x, y], m * (x.diff() ** 2 + y.diff() ** 2) / 2, {m: 1.2, s: 0.5}, [u],
        {x: u}, surfaces={"floor": y >= sp.sin(x) / 5}, tangents={"floor": x**2 + x - T * y},
        friction={"floor": (sp.S(2), u**2 + y**2 * sp.exp(-SPEED / s))},
    )  # fmt: skip
    kernels = dmoc.build(system, order=order, backend="numpy")
    errors = {c.kernel: c.error for c in kernel_errors(system, kernels)}
    assert {"bearing", "holding", "bearing_work", "dragging"} <= set(errors)
    assert max(errors.values()) < 1e-12


def test_how_quickly_friction_falls_is_chosen() -> None:
    """The block stops after 0.8 m where v_s is such that it does."""
    s = sp.Symbol("s")
    system = block(
        sp.Rational(1, 5) + sp.Rational(3, 10) * sp.exp(-SPEED / s), parameters={s: 1.0},
        objective=s,
    )  # fmt: skip
    problem = dmoc.Problem(
        dmoc.build(system, order=4), start={x: 0, y: 0, "x_dot": 2},
        goal={x: 0.8, "x_dot": 0}, contacts=["floor:slip+"], bounds={u: (0, 0)}, steps=20,
        final_time=(0.1, 2), design={s: (0.1, 3)},
    )  # fmt: skip
    solution = dmoc.solve(problem, starts=1)
    assert solution.verification.passed, solution.message
    at = solution.design["s"]
    way = quad(lambda v: v / (G * (0.2 + 0.3 * np.exp(-v / at))), 0, 2)[0]
    assert way == pytest.approx(0.8, abs=1e-5)


def test_a_pair_has_the_kinetic_coefficient_of_the_speed() -> None:
    """It breaks away at 2 N, and slides with 1 + exp(-4 |sigma|)/2 N."""
    system = violin((2, 1 + sp.exp(-4 * SPEED) / 2))
    sticks, slips = stick_and_slip(lambda speed: 1 + np.exp(-4 * speed) / 2)
    run = dmoc.simulate(system, {x: 0}, {x: 1}, step_size=0.01, steps=700)
    times = [s.end - s.begin for s in run.rubbing[:4]]
    assert times == pytest.approx([0.5, slips, sticks, slips], abs=1e-6)
    problem = dmoc.Problem(
        dmoc.build(system, order=4), start={x: 0, "x_dot": 1}, goal={}, contacts=["belt:stick"],
        sequence=["belt:slip-", "belt:stick"], steps=30, final_time=0.5 + slips + sticks / 2,
    )  # fmt: skip
    solution = dmoc.solve(problem, starts=2)
    assert solution.verification.passed, solution.message
    durations = [phase.duration for phase in solution.phases]
    assert durations == pytest.approx([0.5, slips, sticks / 2], abs=2e-5)


def test_a_search_proposes_with_the_friction_at_rest(slowed: dmoc.MechanicalSystem) -> None:
    """And solves the words with that of the speed."""
    problem = dmoc.Problem(
        slowed, start={x: 0, y: 0, "x_dot": 0}, goal={x: 1, "x_dot": 0}, contacts=["floor"],
        steps=60, final_time=1,
    )  # fmt: skip
    result = dmoc.search(problem, strategy="propose", seconds=60)
    assert result.best.sequence == ("floor:slip+",)
    assert result.best.cost == pytest.approx(pulled(1.0), rel=0.02)


def test_files_keep_the_coefficients(slowed: dmoc.MechanicalSystem, tmp_path: Path) -> None:
    run = dmoc.simulate(slowed, {x: 0}, {x: 1}, step_size=0.01, steps=60)
    run.save(tmp_path / "run.npz")
    again = dmoc.Simulation.load(tmp_path / "run.npz")
    for a, b in zip(run.trajectory.phases, again.trajectory.phases, strict=True):
        assert np.array_equal(a.coefficients, b.coefficients)


@pytest.mark.parametrize(("way", "word"), [(1, "floor:slip+"), (-1, "floor:slip-")])
def test_forces_of_what_slides_are_those_of_the_speed(way: int, word: str) -> None:
    """traction = -mu(v) N, as a quantity whose bound keeps the block from sliding too fast."""
    fields = {"quantities": {"grip": -dmoc.traction("floor")}}
    problem = dmoc.Problem(
        dmoc.build(block(SPEED / 5, **fields), order=4),
        start={x: 0, y: 0, "x_dot": 0.01 * way}, goal={x: way}, contacts=[word], steps=20,
        final_time=1.0, bounds={"grip": tuple(sorted((-0.1 * way, 2.2 * way)))},
    )  # fmt: skip
    solution = dmoc.solve(problem, starts=1)
    assert solution.verification.passed, solution.message
    phase = solution.phases[0]
    assert np.abs(phase.v[:, 0]).max() == pytest.approx(1.1, abs=1e-3)
    assert phase.quantities[::3, 0] == pytest.approx(2 * phase.v[:-1, 0], abs=1e-6)


def test_the_check_refuses_friction_that_pushes() -> None:
    """mu = 0.3 - v/4 is negative above 1.2 m/s: v = 1.2 + 0.8 exp(2.5 t) then."""
    falling = block(sp.Rational(3, 10) - SPEED / 4)
    problem = dmoc.Problem(
        falling, start={x: 0, y: 0, "x_dot": 2}, goal={}, contacts=["floor:slip+"], steps=20,
        final_time=0.2,
    )  # fmt: skip
    solution = dmoc.solve(problem, starts=1)
    assert not solution.verification.passed
    assert "the friction of floor is -0.3298 at 0.2 s" in solution.message
    with pytest.raises(SimulationError, match=r"the friction of 'floor' is -0\.2 at t = 0 s"):
        dmoc.simulate(falling, {x: 0}, {x: 2}, step_size=0.01, steps=20)


def test_an_impact_has_no_friction_of_the_speed(slowed: dmoc.MechanicalSystem) -> None:
    says = "depends on the sliding speed, which changes within an impact: "
    with pytest.raises(ProblemError, match=says + r"event 1 \(\+floor\)"):
        dmoc.Problem(slowed, {x: 0, y: 1}, {}, sequence=["+floor"])
    with pytest.raises(SimulationError, match=says + "there is one at t = "):
        dmoc.simulate(slowed, {x: 0, y: 0.1}, step_size=0.01, steps=20)


@pytest.mark.parametrize(
    ("mu", "says"),
    [
        (x.diff() ** 2, "one of the velocities: .*; the magnitude .* is dmoc.sliding_speed"),
        (dmoc.approach_speed, "dmoc.approach_speed, which is known in a hit alone"),
        ((1 + SPEED, 1), "the static friction of 'floor' contains dmoc.sliding_speed"),
        (1 / SPEED, "has no finite value at a sliding speed of 0"),
        (sp.log(SPEED), "has no finite value at a sliding speed of 0"),
        (1 + sp.sqrt(SPEED), "has no finite slope at a sliding speed of 0"),
        (sp.Abs(SPEED - 1), "whose kink no method"),
        (SPEED - 1, "is -1: expected 0 or a positive number"),
        ((1, 2 - SPEED), "is 1, below the kinetic one, 2"),
    ],
)
def test_what_is_no_friction_of_the_speed_is_refused(mu: Any, says: str) -> None:
    with pytest.raises(ModelError, match=says):
        block(mu)


@pytest.mark.parametrize(
    ("where", "fields"),
    [
        ("the Lagrangian", {"lagrangian": x.diff() ** 2 * (1 + SPEED)}),
        ("the force on x", {"forces": {x: -SPEED}}),
        ("surface 'wall'", {"surfaces": {"wall": x <= SPEED}}),
        ("the restitution of 'wall'", {"restitution": {"wall": sp.exp(-SPEED)}}),
        ("quantity 'a'", {"quantities": {"a": SPEED}}),
        ("the tangent of 'rail'", {"tangents": {"rail": x + SPEED}}),
        ("the cost", {"cost": SPEED}),
    ],
)
def test_the_sliding_speed_is_one_of_friction_alone(where: str, fields: dict[str, Any]) -> None:
    stated: dict[str, Any] = {
        "lagrangian": x.diff() ** 2, "surfaces": {"wall": x <= 1}, "tangents": {"rail": x},
        "friction": {"rail": 1 + SPEED},
    }  # fmt: skip
    with pytest.raises(ModelError, match=rf"{where} contains dmoc.sliding_speed, which is known"):
        dmoc.MechanicalSystem("refused", [x], **stated | fields)


def test_nothing_else_has_the_name_of_the_speed() -> None:
    name = sp.Symbol("sliding_speed")
    with pytest.raises(ModelError, match="'sliding_speed' has the name of the speed in friction"):
        block(name, parameters={name: 0.3})
