"""Friction that depends on place, time and inputs, in solves, simulations and checks."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import quad, solve_bvp, solve_ivp
from sliding import G, block, u, x, y
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.errors import ModelError, ProblemError, SimulationError

pytestmark = pytest.mark.slow

B = dynamicsymbols("B")
# From 0.45 on the street to 0.05 on the ice, beyond x = 1.
ICY = 0.25 - sp.tanh(5 * (x - 1)) / 5


def decelerates(at: Any) -> Any:
    """What the friction of the block takes off its speed in a second."""
    return G * (0.25 - np.tanh(5 * (at - 1)) / 5)


def braked(**fields: Any) -> dmoc.MechanicalSystem:
    """A unit mass with a brake that is squeezed with B and holds 0.4 B."""
    return dmoc.MechanicalSystem(
        "braked", [x], x.diff() ** 2 / 2, inputs=[B], tangents={"rail": x},
        friction={"rail": 2 * B / 5}, **fields,
    )  # fmt: skip


@pytest.fixture(scope="module")
def icy() -> dmoc.MechanicalSystem:
    return block(ICY)


@pytest.mark.parametrize("order", [2, 4, 6])
def test_the_shortest_way_to_rest_is_that_of_a_squeezed_brake(order: int) -> None:
    """v^2 / (2 * 0.4 * 5) = 1 m from 2 m/s, in a second."""
    problem = dmoc.Problem(
        dmoc.build(braked(objective=dmoc.final_time), order=order), start={x: 0, "x_dot": 2},
        goal={"x_dot": 0}, contacts=["rail:slip+"], bounds={B: (0, 5)}, steps=16,
    )  # fmt: skip
    solution = dmoc.solve(problem, starts=1)
    assert solution.verification.passed
    assert solution.final_time == pytest.approx(1.0, abs=1e-6)
    phase = solution.phases[0]
    assert phase.q[-1] == pytest.approx(1.0, abs=1e-6)
    assert phase.u == pytest.approx(5.0, abs=1e-5)
    assert phase.tangential == pytest.approx(-2.0, abs=1e-5)
    assert phase.coefficients == pytest.approx(2.0, abs=1e-5)


@pytest.mark.parametrize(("order", "controls"), [(2, "constant"), (2, "linear"), (4, "stages")])
def test_a_brake_is_squeezed_where_it_costs_least(order: int, controls: str) -> None:
    """From 2 m/s to rest in 2 s and 1.8 m with the least integral of B^2/2: 0.4 B = a + b t, where
    rest asks for 2 a + 2 b = 2, and the way for 4 - 2 a - 4/3 b = 1.8."""
    problem = dmoc.Problem(
        dmoc.build(braked(cost=B**2 / 2), order=order), start={x: 0, "x_dot": 2},
        goal={x: 1.8, "x_dot": 0}, contacts=["rail:slip+"], bounds={B: (0, 50)}, steps=40,
        final_time=2, controls=controls,
    )  # fmt: skip
    solution = dmoc.solve(problem, starts=1)
    assert solution.verification.passed, solution.message
    a, b = np.linalg.solve([[2.0, 2.0], [2.0, 4 / 3]], [2.0, 2.2])
    cost = quad(lambda t: (a + b * t) ** 2 / 0.32, 0, 2)[0]
    assert solution.cost == pytest.approx(cost, rel=1e-3 if order == 2 else 1e-8)


def test_a_simulated_brake_stops_and_holds() -> None:
    """It stops after 1 m; then 0.4 B holds nothing, since nothing pushes."""
    run = dmoc.simulate(
        braked(), {x: 0}, {x: 2}, step_size=0.01, steps=150, inputs=lambda t: [5 if t < 1.2 else 0]
    )
    assert run.q[-1] == pytest.approx(1.0, abs=1e-9)
    assert [(s.friction, round(s.end, 8)) for s in run.rubbing] == [(1, 1.0), (0, 1.5)]


def test_a_block_slides_from_the_street_onto_the_ice(icy: dmoc.MechanicalSystem) -> None:
    """The energy is what friction takes: v_0^2 / 2 is its integral over the way to rest."""
    v_0 = 3.5
    run = dmoc.simulate(icy, {x: 0}, {x: v_0}, step_size=0.01, steps=400)
    far = float(run.q[-1, 0])
    assert quad(decelerates, 0, far, epsabs=1e-11)[0] == pytest.approx(v_0**2 / 2, abs=1e-8)
    assert run.rubbing[0].friction == 1
    slide = solve_ivp(
        lambda t, s: [s[1], -decelerates(s[0])], (0, 2), [0, v_0], rtol=1e-11, atol=1e-11
    )
    assert run.q[200, 0] == pytest.approx(slide.y[0, -1], abs=1e-8)
    phase = run.trajectory.phases[0]
    assert phase.coefficients[:, 0] * G == pytest.approx(decelerates(phase.q[:, 0]))
    assert run.trajectory.friction == {"floor": None}


def across_the_ice(time: float) -> float:
    """The least integral of u^2 / 2 from rest at 0 to rest at 2, sliding ahead: the necessary
    conditions x'' = p_v - f(x), p_x' = f'(x) p_v, p_v' = -p_x as a boundary value problem."""

    def slope(t: Any, s: Any) -> Any:
        steep = -G / np.cosh(5 * (s[0] - 1)) ** 2
        return np.array([s[1], s[3] - decelerates(s[0]), steep * s[3], -s[2]])

    def ends(a: Any, b: Any) -> Any:
        return np.array([a[0], a[1], b[0] - 2, b[1]])

    t = np.linspace(0, time, 200)
    way = 2 * (3 * (t / time) ** 2 - 2 * (t / time) ** 3)
    first = np.array([way, np.gradient(way, t), 0 * t, decelerates(way)])
    curve = solve_bvp(slope, ends, t, first, tol=1e-9, max_nodes=100_000)
    assert curve.status == 0
    assert curve.sol(t)[1].min() > -1e-12
    return float(quad(lambda at: curve.sol(at)[3] ** 2 / 2, 0, time, limit=500, epsabs=1e-10)[0])


@pytest.mark.parametrize(("order", "steps", "error"), [(2, 80, 5e-3), (4, 40, 1e-7), (6, 40, 2e-7)])
def test_a_block_is_pushed_over_the_ice(
    icy: dmoc.MechanicalSystem, order: int, steps: int, error: float
) -> None:
    problem = dmoc.Problem(
        dmoc.build(icy, order=order), start={x: 0, y: 0, "x_dot": 0}, goal={x: 2, "x_dot": 0},
        contacts=["floor:slip+"], steps=steps, final_time=1.5,
    )  # fmt: skip
    solution = dmoc.solve(problem, starts=1)
    assert solution.verification.passed
    assert solution.cost == pytest.approx(across_the_ice(1.5), abs=error)


@pytest.mark.parametrize(("order", "error"), [(2, 4e-3), (4, 1e-6)])
def test_a_belt_gets_dry(order: int, error: float) -> None:
    """mu = (1 + sin 2 t)/5 under a block on a belt of 3 m/s: x' = G (t + (1 - cos 2 t)/2)/5 until
    it is as fast as the belt."""
    t = dynamicsymbols._t
    system = dmoc.MechanicalSystem(
        "belt", [x, y], (x.diff() ** 2 + y.diff() ** 2) / 2 - 10 * y, inputs=[u], forces={x: u},
        surfaces={"floor": y >= 0}, tangents={"floor": x - 3 * t},
        friction={"floor": (1 + sp.sin(2 * t)) / 5},
    )  # fmt: skip
    at = 0.8
    rate = G / 5 * (at + (1 - np.cos(2 * at)) / 2)
    place = G / 5 * (at**2 / 2 + at / 2 - np.sin(2 * at) / 4)
    assert rate < 3
    run = dmoc.simulate(system, {x: 0}, {x: 0}, step_size=0.01, steps=80)
    assert [run.q[-1, 0], run.v[-1, 0]] == pytest.approx([place, rate], abs=1e-9)
    problem = dmoc.Problem(
        dmoc.build(system, order=order), start={x: 0, y: 0, "x_dot": 0}, goal={},
        contacts=["floor:slip-"], steps=10, final_time=at, bounds={u: (0, 0)},
    )  # fmt: skip
    solution = dmoc.solve(problem, starts=1)
    assert solution.verification.passed
    assert solution.phases[0].q[-1, 0] == pytest.approx(place, abs=error)
    assert solution.phases[0].v[-1, 0] == pytest.approx(rate, abs=20 * error)


@pytest.mark.parametrize(
    ("word", "impulse", "way"),
    [("+floor:slip+", 2.0, 0.8), ("floor:slip+", 3.0, 0.8), ("floor:stick", 3.0, 0.0)],
)
def test_an_impact_has_the_friction_of_its_place(
    icy: dmoc.MechanicalSystem, word: str, impulse: float, way: float
) -> None:
    """A fall from 0.2 m, with 2 N s, and half of that back: T = -mu(x_c) P while it slides."""
    problem = dmoc.Problem(
        icy, start={x: 0, y: 0.2, "x_dot": 4 if way else 0, "y_dot": 0}, goal={}, sequence=[word],
        steps=6, final_time=0.3, bounds={u: (0, 0)}, restitution=0.5,
    )  # fmt: skip
    solution = dmoc.solve(problem, starts=1)
    assert solution.verification.passed, solution.message
    event = solution.collisions[0]
    assert event.impulses["floor"] == pytest.approx(impulse)
    mu = decelerates(way) / G
    assert event.tractions["floor"] == pytest.approx(-mu * impulse if way else 0.0, abs=1e-9)


def test_a_simulated_hit_has_the_friction_of_its_place(icy: dmoc.MechanicalSystem) -> None:
    run = dmoc.simulate(icy, {x: 0, y: 0.2}, {x: 4}, step_size=0.01, steps=30, restitution=0.5)
    assert run.collisions[0].tractions["floor"] == pytest.approx(-0.3 * decelerates(0.8))


@pytest.mark.parametrize("order", [2, 4])
def test_coefficients_that_only_look_as_if_they_varied_change_nothing(order: int) -> None:
    """mu = 0.1 and mu = 0.1 + (x - x_0) 1e-12, which has kernels."""
    costs = []
    for mu in (0.1, 0.1 + x * 1e-12):
        problem = dmoc.Problem(
            dmoc.build(block(mu), order=order), start={x: 0, y: 0, "x_dot": 0},
            goal={x: 1, "x_dot": 0}, contacts=["floor:stick"], sequence=["floor:slip+"], steps=10,
            final_time=1.5,
        )  # fmt: skip
        costs.append(dmoc.solve(problem, starts=1).cost)
    assert costs[0] == pytest.approx(costs[1], rel=1e-8)


def test_a_search_over_the_ice_proposes_the_slide(icy: dmoc.MechanicalSystem) -> None:
    problem = dmoc.Problem(
        icy, start={x: 0, y: 0, "x_dot": 0}, goal={x: 2, "x_dot": 0}, contacts=["floor"], steps=30,
        final_time=1.5,
    )  # fmt: skip
    result = dmoc.search(problem, strategy="propose", seconds=60)
    assert result.best.sequence == ("floor:slip+",)
    assert result.best.cost == pytest.approx(across_the_ice(1.5), rel=0.02)


def test_files_keep_coefficients(icy: dmoc.MechanicalSystem, tmp_path: Path) -> None:
    run = dmoc.simulate(icy, {x: 0}, {x: 1}, step_size=0.01, steps=60)
    run.save(tmp_path / "run.npz")
    again = dmoc.Simulation.load(tmp_path / "run.npz")
    for a, b in zip(run.trajectory.phases, again.trajectory.phases, strict=True):
        assert a.coefficients.shape == (len(a.t), 1)
        assert np.array_equal(a.coefficients, b.coefficients)
        limits = run.trajectory.friction_limits(a)
        assert limits == pytest.approx(a.coefficients * a.normal)


# What is refused ----------------------------------------------------------------------------------


@pytest.mark.parametrize("bounds", [{u: (-1, 5)}, {}])
def test_a_brake_is_not_squeezed_with_less_than_nothing(bounds: Any) -> None:
    with pytest.raises(ProblemError, match=r"friction of 'floor' is -.* where the input u is"):
        dmoc.Problem(block(u), {x: 0, y: 0}, {}, contacts=["floor"], bounds=bounds)


def test_an_impact_has_no_friction_that_depends_on_inputs() -> None:
    with pytest.raises(ProblemError, match=r"depends on inputs, .*event 1 \(\+floor\)"):
        dmoc.Problem(block(u), {x: 0, y: 1}, {}, sequence=["+floor"], bounds={u: (0, 5)})
    with pytest.raises(SimulationError, match=r"depends on inputs, .* there is one at t = "):
        dmoc.simulate(block(u), {x: 0, y: 0.1}, step_size=0.01, steps=20, inputs=[0.5])


@pytest.mark.parametrize(
    ("mu", "inputs", "where"),
    [(sp.S(2) / 5 - x / 2, None, "x = 0.8"), (u, lambda t: [0.5 - t], "t = 0.5 s")],
)
def test_a_simulation_stops_where_friction_would_push(mu: Any, inputs: Any, where: str) -> None:
    with pytest.raises(SimulationError, match=rf"friction of 'floor' is -.*{where}"):
        dmoc.simulate(block(mu), {x: 0}, {x: 4}, step_size=0.01, steps=200, inputs=inputs)


def test_the_check_refuses_friction_that_pushes() -> None:
    problem = dmoc.Problem(
        block(sp.S(2) / 5 - x / 2), {x: 0, y: 0, "x_dot": 2}, {x: 1.5}, contacts=["floor:slip+"],
        steps=10, final_time=(0.1, 3),
    )  # fmt: skip
    solution = dmoc.solve(problem, starts=1)
    assert not solution.verification.passed
    assert "the friction of floor is -0.35 at" in solution.message
    assert "x = 1.5" in solution.message


@pytest.mark.parametrize(
    ("mu", "says"),
    [
        (sp.Piecewise((0.4, x < 1), (0.1, True)), "whose kink no method"),
        (sp.Abs(x), "whose kink no method"),
        (0.3 + x.diff() ** 2, "one of the velocities: expected coordinates, the time, parameters"),
        (0.3 + x.diff().diff(), "not the first derivative of a coordinate"),
        (sp.Symbol("k") + x, "the symbol k, which is unknown"),
        (-0.1, "expected 0 or a positive number"),
        (sp.I * x, "imaginary unit"),
        ("x", "is not a scalar SymPy expression: got 'x'"),
    ],
)
def test_what_is_no_friction_is_refused(mu: Any, says: str) -> None:
    with pytest.raises(ModelError, match=says):
        block(mu)
