"""The simplest walker of M. Garcia, A. Chatterjee, A. Ruina and M. Coleman (1998): feet without
mass, by an integration of its own, and with feet of a hundred-thousandth of the mass."""

from __future__ import annotations

import numpy as np
import sympy as sp
from pytest import approx, mark
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve
from sympy.physics.mechanics import dynamicsymbols

import dmoc

SLOPE, FEET = 0.009, 1e-5
TIGHT = {"rtol": 1e-11, "atol": 1e-12}


def step(state: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The angle of the stance leg and its rate after the next step, from those after one; times and
    states (theta, phi and their rates) of the step, where phi is the angle between the legs."""

    def slopes(t: float, s: np.ndarray) -> list[float]:
        theta, phi, w, v = s
        a = np.sin(theta - SLOPE)
        return [w, v, a, a + w * w * np.sin(phi) - np.cos(theta - SLOPE) * np.sin(phi)]

    def lands(t: float, s: np.ndarray) -> float:
        return float(s[1] - 2 * s[0])

    theta, w = state
    first = [theta, 2 * theta, w, (1 - np.cos(2 * theta)) * w]
    run = solve_ivp(slopes, (0, 5), first, events=lands, dense_output=True, **TIGHT)
    k = next(k for k, y in enumerate(run.y_events[0]) if run.t_events[0][k] > 1 and y[0] < -0.05)
    end, (theta, _, w, _) = run.t_events[0][k], run.y_events[0][k]
    times = np.linspace(0, end, 21)
    return np.array([-theta, np.cos(2 * theta) * w]), times, run.sol(times).T


def walker() -> dmoc.MechanicalSystem:
    x, y, a, b = q = dynamicsymbols("x y a b")
    mu, t = sp.Symbol("mu"), dynamicsymbols._t
    hip = sp.Matrix([x, y])
    feet = {n: hip + sp.Matrix([sp.sin(c), -sp.cos(c)]) for n, c in (("left", a), ("right", b))}
    down = sp.Matrix([np.sin(SLOPE), -np.cos(SLOPE)])
    bodies = [(1, hip), *((FEET, foot) for foot in feet.values())]
    lagrangian = sum(m * (r.diff(t).dot(r.diff(t)) / 2 + down.dot(r)) for m, r in bodies)
    return dmoc.MechanicalSystem(
        "simplest_walker", q, lagrangian, {mu: 1.0}, cost=1,
        surfaces={name: foot[1] >= 0 for name, foot in feet.items()},
        tangents={name: foot[0] for name, foot in feet.items()},
        friction=dict.fromkeys(feet, mu),
    )  # fmt: skip


@mark.slow
def test_its_multipliers_are_those_of_its_return_map() -> None:
    fixed = fsolve(lambda z: step(z)[0] - z, [0.2, -0.2], xtol=1e-12)
    assert fixed == approx([0.200310900544287, -0.199832473004977], abs=1e-8)  # as published
    small = 1e-6 * np.eye(2)
    slopes = np.array([(step(fixed + e)[0] - step(fixed - e)[0]) / 2e-6 for e in small]).T
    _, times, states = step(fixed)
    theta, phi = states[:, 0], states[:, 1]
    guess = {
        "x": np.sin(theta[0]) - np.sin(theta), "y": np.cos(theta), "a": theta, "b": theta - phi,
        "durations": [float(times[-1])],
    }  # fmt: skip
    legs = {"a": "b", "b": "a", "a_dot": "b_dot", "b_dot": "a_dot"}
    problem = dmoc.Problem(
        dmoc.build(walker(), order=4), {"x": 0.0}, contacts=["left"], sequence=["+right -left"],
        ignored=["left", "right"], steps=20, final_time=(3.8, 4), durations=[None, 0],
        periodic={"x": ("x", None), "y": "y", "x_dot": "x_dot", "y_dot": "y_dot", **legs},
    )  # fmt: skip
    solution = dmoc.solve(problem, "ipm", guess=guess, starts=1)
    assert solution.final_time == approx(times[-1], abs=1e-4)
    multipliers = solution.stability().multipliers
    eigenvalues = np.sort_complex(np.linalg.eigvals(slopes))
    assert multipliers[0] == approx(1, abs=1e-5)  # the floor is the same everywhere
    assert np.sort_complex(multipliers[1:3]) == approx(eigenvalues, abs=5e-4)
    assert abs(multipliers[3:]) == approx(0, abs=1e-4)


@mark.slow
def test_its_shortest_gait_is_met_from_starts_of_its_own() -> None:
    """Nothing is said of angles whose feet weigh next to nothing, and nothing drives them."""
    fixed = fsolve(lambda z: step(z)[0] - z, [0.193937, -0.203867], xtol=1e-12)
    _, times, _ = step(fixed)
    legs = {"a": "b", "b": "a", "a_dot": "b_dot", "b_dot": "a_dot"}
    problem = dmoc.Problem(
        walker(), {"x": 0.0}, contacts=["left"], sequence=["+right -left"],
        ignored=["left", "right"], final_time=(3, 5), durations=[None, 0],
        via=[{"a": (-0.5, -0.05)}],
        periodic={"x": ("x", None), "y": "y", "x_dot": "x_dot", "y_dot": "y_dot", **legs},
    )  # fmt: skip
    solution = dmoc.solve(problem)
    assert solution.solved and solution.agreeing_starts > 1
    assert solution.final_time == approx(times[-1], rel=1e-3)
    (other,) = solution.others
    assert other.cost == approx(3.88246, rel=1e-3) and other.status == "solved"
