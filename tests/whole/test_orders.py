"""The discretisations as data: exact and floating nodes agree, and the orders are those that are
measured."""

from __future__ import annotations

import numpy as np
import pytest
import sympy as sp
from answers import answer_of
from numpy.polynomial.legendre import leggauss
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve
from sympy import symbols
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.discretisation import DISCRETISATIONS, FORMS, ORDERS
from dmoc.codegen.kernels import Kernels
from dmoc.models.registry import find
from dmoc.symbolic.quadrature import lobatto_nodes, quadrature

G = 9.81
WALL = 1.2


@pytest.fixture(scope="module", params=ORDERS)
def swinging(request: pytest.FixtureRequest) -> Kernels:
    """A pendulum with a torque and a wall."""
    a, u = dynamicsymbols("a u")
    g = symbols("g")
    system = dmoc.MechanicalSystem(
        "swinging", [a], a.diff() ** 2 / 2 + g * sp.cos(a), {g: G}, inputs=[u], forces={a: u},
        surfaces={"wall": a <= WALL}, cost=u**2 / 2,
    )  # fmt: skip
    return dmoc.build(system, order=request.param)


def bounced(q: float, v: float, time: float) -> np.ndarray:
    """State after one elastic bounce off the wall, by an integrator with events."""

    def slope(t: float, y: np.ndarray) -> list[float]:
        return [y[1], -G * np.sin(y[0])]

    def contact(t: float, y: np.ndarray) -> float:
        return float(y[0] - WALL)

    contact.terminal, contact.direction = True, 1.0  # type: ignore[attr-defined]
    settings = {"rtol": 1e-13, "atol": 1e-13, "method": "DOP853"}
    first = solve_ivp(slope, (0.0, time), [q, v], events=contact, **settings)
    (hit,) = first.t_events[0]
    state = first.y_events[0][0] * [1.0, -1.0]
    return np.asarray(solve_ivp(slope, (hit, time), state, **settings).y[:, -1])


@pytest.mark.slow
def test_the_integrator_has_its_order_through_a_collision(swinging: Kernels) -> None:
    order = swinging.manifest.order
    wanted, errors = bounced(0.3, 5.0, 1.0), []
    for steps in (10, 20, 40):
        run = dmoc.simulate(swinging, [0.3], [5.0], step_size=1 / steps, steps=steps)
        assert [c.surface for c in run.collisions] == ["wall"]
        errors.append(float(np.abs([run.q[-1, 0], run.p[-1, 0]] - wanted).max()))
    assert np.log2(errors[0] / errors[2]) / 2 > order - 0.2
    assert errors[2] < {2: 5e-3, 4: 5e-6, 6: 5e-9}[order]


@pytest.mark.slow
def test_optima_of_every_order_agree(swinging: Kernels) -> None:
    """Inputs are at most linear in a step, so that costs differ by h^2 at order 2 and h^4 above."""
    order = swinging.manifest.order
    problem = dmoc.Problem(
        swinging, start={"a": 0.3, "a_dot": 5.0}, goal={"a": -0.5, "a_dot": 0.0}, sequence=["wall"],
        steps=20, final_time=1.0,
    )  # fmt: skip
    solution = answer_of(problem, "ipm")
    assert solution.cost == pytest.approx(9.8639525, rel={2: 5e-3, 4: 5e-6, 6: 5e-7}[order])
    again = answer_of(problem.but(controls="constant"), "ipm")
    assert again.cost == pytest.approx(9.8639525, rel=5e-3)


def gauss(state: np.ndarray, h: float, order: int) -> np.ndarray:
    """A step of the Gauss-Runge-Kutta method for Hamilton's equations of the cart-pendulum, y = (q,
    p), from its tableau."""
    places = DISCRETISATIONS[order].places
    powers = np.arange(1, len(places) + 1)
    moments = np.vander(places, increasing=True).T  # exact for polynomials
    A = np.linalg.solve(moments, (places[:, None] ** powers / powers).T).T
    b = np.linalg.solve(moments, 1 / powers)

    def slope(y: np.ndarray) -> np.ndarray:
        a = y[0]
        M = np.array([[0.25, -0.5 * np.sin(a)], [-0.5 * np.sin(a), 2.0]])
        v = np.linalg.solve(M, y[2:])
        return np.array([*v, -0.5 * np.cos(a) * v[0] * v[1] - 5 * np.cos(a), 0.0])

    def stages(k: np.ndarray) -> np.ndarray:
        k = k.reshape(-1, 4)
        return np.asarray(k - [slope(state + h * row @ k) for row in A]).ravel()

    first = np.tile(slope(state), len(places))
    k = fsolve(stages, first, xtol=1e-12).reshape(-1, 4)
    return np.asarray(state + h * b @ k)


@pytest.mark.slow
@pytest.mark.parametrize("order", ORDERS)
def test_steps_are_those_of_the_gauss_methods(order: int) -> None:
    kernels, h = find("cart_pendulum").kernels(order), 0.05
    run = dmoc.simulate(kernels, [1.2, 0.1], [0.7, -0.4], step_size=h, steps=3)
    state = np.concatenate([run.q[0], run.p[0]])
    for k in range(3):
        state = gauss(state, h, order)
        np.testing.assert_allclose(np.concatenate([run.q[k + 1], run.p[k + 1]]), state, atol=1e-12)


@pytest.mark.slow
def test_optimal_states_have_the_order_of_linear_inputs(swinging: Kernels) -> None:
    """Order 4 at most, for the cost and for the states at the nodes: {order} of the theory."""
    order = swinging.manifest.order
    problem = dmoc.Problem(
        swinging, start={"a": 0.3, "a_dot": 1.0}, goal={"a": -0.5, "a_dot": 0.0}, steps=8,
        final_time=2.0,
    )  # fmt: skip
    fine, *coarse = (
        dmoc.solve(problem.but(steps=n), "ipm", starts=1, verify=False) for n in (256, 16, 32)
    )

    def states(solution: dmoc.Solution) -> np.ndarray:
        (phase,) = solution.phases
        at = slice(None, None, (len(phase.q) - 1) // 8)
        return np.concatenate([phase.q[at], phase.p[at]], axis=1)

    costs = [abs(s.cost / fine.cost - 1) for s in coarse]
    errors = [float(np.abs(states(s) - states(fine)).max()) for s in coarse]
    for values in (costs, errors):
        assert np.log2(values[0] / values[1]) == pytest.approx(min(order, 4), abs=0.2)


@pytest.mark.parametrize("order", ORDERS)
def test_nodes_and_points_are_those_of_lobatto_and_gauss(order: int) -> None:
    scheme = DISCRETISATIONS[order]
    exact = np.array([float(c) for c in lobatto_nodes(scheme.degree)])
    np.testing.assert_allclose(scheme.nodes, exact, rtol=0, atol=1e-15)
    places, weights = quadrature(scheme.degree)
    points, gauss_weights = leggauss(scheme.points)
    np.testing.assert_allclose([float(c) for c in places], (1 + points) / 2, rtol=0, atol=1e-15)
    np.testing.assert_allclose([float(b) for b in weights], gauss_weights / 2, rtol=0, atol=1e-15)
    assert len(scheme.nodes) == 2 + scheme.inside
    at_nodes = np.vander(scheme.nodes, increasing=True) @ scheme.shapes.T
    np.testing.assert_allclose(at_nodes, np.eye(len(scheme.nodes)), atol=1e-13)


@pytest.mark.parametrize(
    ("name", "times"),
    [("constant", [0.5, 2.0]), ("linear", [0.0, 1.0, 3.0]), ("stages", [0.0, 1.0, 1.0, 3.0])],
)
def test_rows_of_inputs_stand_for_their_times(name: str, times: list[float]) -> None:
    form = FORMS[name]
    assert form.rows(2) == len(times)
    assert form.times(np.array([0.0, 1.0, 3.0])).tolist() == times
