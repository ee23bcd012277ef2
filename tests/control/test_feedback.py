"""Gains along motions, beside Riccati equations that SciPy solves."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import contact_problems
import numpy as np
import pytest
import sympy as sp
from joint_problems import bob
from pytest import approx
from scipy.integrate import solve_ivp
from scipy.linalg import solve_continuous_are
from sympy.physics.mechanics import dynamicsymbols
from systems import block_system, bouncer_problem, double_integrator, landing_problem

import dmoc
from dmoc.base.errors import SimulationError
from dmoc.models.registry import find

pytestmark = pytest.mark.slow

G = 9.81
LINE = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [1.0]])  # A and B of a unit mass


def backwards(
    A: Any, B: Any, Q: np.ndarray, R: np.ndarray, P: np.ndarray, span: tuple[float, float],
    rtol: float = 1e-11,
) -> np.ndarray:  # fmt: skip
    """P at the begin of a span from the one at its end, by SciPy; A and B are functions of time."""
    n = len(P)

    def rate(t: float, p: np.ndarray) -> np.ndarray:
        p, a, b = p.reshape(n, n), A(t), B(t)
        return -(a.T @ p + p @ a - p @ b @ np.linalg.solve(R, b.T @ p) + Q).ravel()

    run = solve_ivp(rate, span[::-1], P.ravel(), method="DOP853", rtol=rtol, atol=rtol / 10)
    return np.asarray(run.y[:, -1].reshape(n, n))


def constant(x: np.ndarray) -> Any:
    return lambda t: x


@pytest.mark.parametrize("order", [2, 4, 6])
def test_gains_of_a_long_motion_are_those_of_the_algebraic_equation(order: int) -> None:
    Q, R = np.array([[3.0, 0.5], [0.5, 1.0]]), np.array([[2.0]])
    problem = double_integrator(20, order).but(final_time=30.0)
    made = dmoc.feedback(dmoc.solve(problem, "ipm", starts=1), Q=Q, R=R)
    P = solve_continuous_are(*LINE, Q, R)
    assert approx(P, rel=1e-9) == made.P
    assert made.at(0, 1.0)[2] == approx(np.linalg.solve(R, LINE[1].T @ P), rel=1e-6)


def test_gains_near_the_end_are_those_of_the_differential_equation() -> None:
    Q, R = np.diag([3.0, 1.0]), np.array([[2.0]])
    solution = dmoc.solve(double_integrator(20, 4), "ipm", starts=1)
    made = dmoc.feedback(solution, Q={"x": 3, "x_dot": 1}, R={"u": 2})
    A, B = map(constant, LINE)
    for t in (0.0, 0.5, 0.75, 1.0):
        P = backwards(A, B, Q, R, Q, (t, 1.0)) if t < 1 else Q
        assert made.at(0, t)[2] == approx(LINE[1].T @ P / 2, rel=1e-7), t
    assert approx(backwards(A, B, Q, R, Q, (0.0, 1.0)), rel=1e-8) == made.P
    weighed = dmoc.feedback(solution, Q=2.0, R=2.0)
    assert weighed.at(0, 0.3)[2] == approx(dmoc.feedback(solution).at(0, 0.3)[2])


def test_gains_of_a_motion_that_changes_with_the_time() -> None:
    """A pendulum on a cart without a hit: A by central differences of equations written here."""
    reference = find("cart_pendulum")
    problem = dmoc.Problem(
        reference.kernels(4), start={"alpha": 1.2, "x": 0}, goal={"alpha": 1.9, "x": 0.1},
        steps=20, final_time=0.6,
    )  # fmt: skip
    solution = dmoc.solve(problem, "ipm", starts=1)
    made = dmoc.feedback(solution, Q={"alpha": 5, "x": 1, "x_dot": 0.5}, R={"F": 0.1})

    def rate(y: np.ndarray, F: float) -> np.ndarray:
        alpha, _, w, v = y
        s, c, length = np.sin(alpha), np.cos(alpha), 0.5
        M = np.array([[length**2, -length * s], [-length * s, 2.0]])
        f = np.array([-10 * length * c, F + length * c * w**2])
        return np.concatenate([[w, v], np.linalg.solve(M, f)])

    @cache
    def at(t: float) -> tuple[np.ndarray, float]:
        state = solution.at(min(t, solution.final_time))
        return np.concatenate([state.q, state.v]), float(state.u[0])

    def A(t: float) -> np.ndarray:
        y, F = at(t)
        steps = 1e-6 * np.eye(4)
        return np.array([(rate(y + s, F) - rate(y - s, F)) / 2e-6 for s in steps]).T

    def B(t: float) -> np.ndarray:
        y, F = at(t)
        return ((rate(y, F + 1) - rate(y, F - 1)) / 2)[:, None]

    Q, R = np.diag([5, 1, 0, 0.5]), np.array([[0.1]])
    P = backwards(A, B, Q, R, 0.6 * Q, (0.0, 0.6), 1e-7)
    assert approx(P, rel=1e-4) == made.P
    assert made.at(0, 0.0)[2] == approx(B(0.0).T @ P / 0.1, rel=1e-4)


def bounced(P: np.ndarray, solution: dmoc.Solution, Q: np.ndarray, R: np.ndarray) -> np.ndarray:
    """P at the start of a bouncer, from the one at its end, by hand through its hit."""
    hit, (before, after) = solution.collisions[0], solution.phases
    e, fall, u = 0.7, -before.v[-1, 0], solution.trajectory
    accelerations = [
        sides[k][0] - G
        for sides, k in ((u.input_ends(before)[1][-1:], 0), (u.input_ends(after)[0][:1], 0))
    ]
    rise = after.v[0, 0]  # by the law in energies e times the fall only to the order of the steps
    jump = np.array([[-rise / fall, 0], [-(accelerations[1] + e * accelerations[0]) / fall, -e]])
    A, B = map(constant, LINE)
    P = backwards(A, B, Q, R, P, (hit.time, solution.final_time))
    return backwards(A, B, Q, R, jump.T @ P @ jump, (0.0, hit.time))


@pytest.mark.parametrize("order", [2, 4])
def test_gains_go_through_a_hit(order: int) -> None:
    """One period, and as many as it takes until they repeat."""
    problem, _ = bouncer_problem(0.7, 30, order)
    solution = dmoc.solve(problem, "ipm", starts=1)
    Q, R = np.diag([4.0, 1.0]), np.array([[0.5]])
    once = dmoc.feedback(replace(solution, periodic={}), Q=Q, R=R)
    assert approx(bounced(0.5 * Q, solution, Q, R), rel=1e-5) == once.P
    P = Q
    for _ in range(40):
        P = bounced(P, solution, Q, R)
    again = dmoc.feedback(solution, Q=Q, R=R)
    assert approx(P, rel=1e-5) == again.P
    assert again.P[0, 0] > 1.01 * once.P[0, 0]


def test_gains_of_a_motion_that_repeats_with_parts_exchanged() -> None:
    """Two pendulums, each of which ends as the other began: P is swept by SciPy until it repeats,
    with rows and columns exchanged after each period."""
    x, y, u, w = dynamicsymbols("x y u w")
    system = dmoc.MechanicalSystem(
        "exchanged", [x, y], (x.diff() ** 2 + y.diff() ** 2) / 2 + 9 * (sp.cos(x) + sp.cos(y)),
        inputs=[u, w], forces={x: u, y: w}, cost=u**2 + w**2,
    )  # fmt: skip
    problem = dmoc.Problem(
        dmoc.build(system, order=4), start={x: 1.2, "x_dot": 0.0, y: None, "y_dot": None},
        periodic={"x": "y", "y": "x", "x_dot": "y_dot", "y_dot": "x_dot"}, final_time=0.7, steps=20,
    )  # fmt: skip
    solution = dmoc.solve(problem, "ipm", starts=1)
    Q, R = np.diag([20.0, 20.0, 1.0, 1.0]), np.eye(2)
    made = dmoc.feedback(solution, Q=Q, R=R)

    def A(t: float) -> np.ndarray:
        q = solution.at(min(max(t, 0.0), solution.final_time)).q
        return np.block(
            [[np.zeros((2, 2)), np.eye(2)], [-9 * np.diag(np.cos(q)), np.zeros((2, 2))]]
        )

    B, swap = constant(np.vstack([np.zeros((2, 2)), R])), np.eye(4)[[1, 0, 3, 2]]
    P = Q
    for _ in range(8):
        P = backwards(A, B, Q, R, swap.T @ P @ swap, (0.0, 0.7), 1e-8)
    assert approx(P, rel=1e-4, abs=1e-4) == made.P
    assert abs(P[0, 0] - P[1, 1]) > 0.1  # they are not at the same place


def test_a_motion_goes_on_past_its_hit_without_it() -> None:
    """A fifth of each phase: a parabola through the floor, with the inputs at the hit."""
    problem, _ = bouncer_problem(0.7, 20, 4)
    solution = dmoc.solve(problem, "ipm", starts=1)
    made, hit = dmoc.feedback(solution), solution.collisions[0]
    before, after = made.phases
    for guide, way, k in ((before, solution.phases[0], -1), (after, solution.phases[1], 0)):
        u = solution.trajectory.input_sides(way)[1 if k == 0 else 0][k, 0]
        beyond = guide.t > hit.time if k else guide.t < hit.time
        s = guide.t[beyond] - hit.time
        assert len(s) > 3 and abs(s).max() == approx(0.2 * way.duration)
        position = way.q[k, 0] + way.v[k, 0] * s + (u - G) * s**2 / 2
        assert guide.y[beyond, 0] == approx(position, abs=1e-9)
        assert guide.u[beyond][:-1] == approx(u, rel=1e-9)
        assert guide.K[beyond] == approx(np.repeat(guide.K[~beyond][[k]], beyond.sum(), axis=0))
    late = made.at(0, hit.time + 0.01)[0]
    assert late[0] < 0 and late[1] < 0  # through the floor, still falling
    assert made.at(1, hit.time - 0.01)[0][1] > 0


def test_gains_ignore_what_a_closed_contact_does_not_allow() -> None:
    """A puck that slides on its floor: neither its height nor its speed away from it counts."""
    solution = dmoc.solve(landing_problem(), "ipm", starts=1)
    made = dmoc.feedback(solution)
    middle = 0.5 * (made.phases[1].begin + made.phases[1].end)
    gains = dict(zip(made.states, made.at(1, middle)[2][0], strict=True))
    assert abs(gains["y"]) + abs(gains["y_dot"]) < 1e-9 * abs(gains["x_dot"])
    sticks = made.phases[2]
    assert np.abs(sticks.K).max() < 1e-9  # friction holds it, whatever is pushed a little


def test_gains_ignore_what_a_constraint_does_not_allow() -> None:
    """A mass on a rod about the origin: neither places nor speeds along the rod count."""
    problem = dmoc.Problem(
        bob(), start={"x": 0.0, "y": -1.0}, goal={"x": 0.8, "y": -0.6}, steps=20, final_time=1.0
    )
    made = dmoc.feedback(dmoc.solve(problem, "ipm", starts=1))
    for t in (0.0, 0.4, 0.9):
        y, _, K = made.at(0, t)
        along = np.array([-y[1], y[0]])
        size = abs(float((K[:, 2:] @ along)[0]))
        assert size > 0.1 and np.abs(K[:, :2] @ y[:2]).max() < 1e-5 * size
        assert np.abs(K[:, 2:] @ y[:2]).max() < 1e-5 * size


def test_tables_hold_what_the_gains_are(tmp_path: Path) -> None:
    problem, _ = bouncer_problem(0.7, 20, 2)
    made = dmoc.feedback(dmoc.solve(problem, "ipm", starts=1))
    tables = made.to_arrays()
    head, *rows = made.to_csv(tmp_path / "gains.csv").read_text().splitlines()
    assert head == "t,phase,y,y_dot,u,K[u;y],K[u;y_dot]"
    numbers = np.array([[float(x) for x in row.split(",")] for row in rows])
    assert (numbers[:, 0] == tables["t"]).all() and (numbers[:, 1] == tables["phase"]).all()
    assert (numbers[:, 5:] == tables["K"][:, 0]).all() and (numbers[:, 2:4] == tables["y"]).all()
    k = int(np.flatnonzero(tables["phase"] == 1)[5])
    y, u, K = made.at(1, tables["t"][k])
    assert (y == tables["y"][k]).all() and (u == tables["u"][k]).all()
    assert (tables["K"][k] == K).all()
    half = made.at(1, (tables["t"][k] + tables["t"][k + 1]) / 2)
    assert half[2] == approx((tables["K"][k] + tables["K"][k + 1]) / 2)
    assert "ends with" in str(made) and "2 phases" in repr(made)


@pytest.mark.parametrize(("weights", "words"), [
    ({"Q": -1}, "Q = -1: expected a positive factor"),
    ({"Q": {"z": 1}}, "unknown state 'z' in Q"),
    ({"Q": {"x": -1}}, r"Q\['x'\] = -1: expected a number that is not negative"),
    ({"Q": np.eye(3)}, r"finite numbers of shape \(2, 2\) \(x, x_dot\)"),
    ({"Q": [[1, 2], [0, 1]]}, "Q is not symmetric"),
    ({"Q": [[1, 2], [2, 1]]}, "eigenvalues that are not negative"),
    ({"Q": "x"}, "Q = 'x'"),
    ({"R": {"u": 0}}, r"R\['u'\] = 0: expected a number that is positive"),
    ({"R": {}}, r"R\['u'\] = 0: expected a number that is positive"),
    ({"R": {"x": 1}}, "unknown input 'x' in R"),
    ({"R": [[0]]}, "eigenvalues that are positive"),
    ({"R": np.nan}, "R = nan"),
])  # fmt: skip
def test_weights_that_do_not_fit_are_refused(weights: dict[str, Any], words: str) -> None:
    problem = dmoc.Problem(
        block_system(), start={"x": 0}, goal={"x": 0.5, "x_dot": 0}, steps=6, final_time=1.0
    )
    solution = dmoc.solve(problem, "ipm", starts=1)
    with pytest.raises(SimulationError, match=words):
        dmoc.feedback(solution, **weights)


def test_what_has_no_gains_is_refused() -> None:
    with pytest.raises(SimulationError, match="solution = 3: expected a Solution"):
        dmoc.feedback(3)  # type: ignore[arg-type]
    wheel = dmoc.solve(contact_problems.rimless(10), "ipm", starts=1)
    with pytest.raises(SimulationError, match="'rimless' has no inputs: there is nothing to feed"):
        dmoc.feedback(wheel)


def beside(factor: float) -> dmoc.Solution:
    """A driven oscillator that repeats, beside a mass at rest that no input moves, under a force
    of `factor` times its way."""
    x, y, u = dynamicsymbols("x y u")
    system = dmoc.MechanicalSystem(
        "half_driven", [x, y],
        (x.diff() ** 2 + y.diff() ** 2 + factor * y**2) / 2 - 2 * sp.pi**2 * x**2,
        inputs=[u], forces={x: u}, cost=u**2,
    )  # fmt: skip
    problem = dmoc.Problem(
        system, start={x: 0.1, y: 0.0, "x_dot": None, "y_dot": None}, final_time=1.0, steps=20,
        periodic=["x", "y", "x_dot", "y_dot"],
    )  # fmt: skip
    return dmoc.solve(problem, "ipm", starts=1)


def test_what_the_inputs_cannot_move_has_no_gains() -> None:
    """A mass that goes on for ever is left alone; one that runs away is refused."""
    made = dmoc.feedback(beside(0.0))
    K = dict(zip(made.states, made.at(0, 0.3)[2][0], strict=True))
    assert abs(K["y"]) + abs(K["y_dot"]) < 1e-6 * abs(K["x_dot"])
    with pytest.raises(SimulationError, match=r"cannot be held: a deviation grows 2\.72 times in"):
        dmoc.feedback(beside(1.0))
