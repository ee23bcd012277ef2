"""Sensitivities of the optimal cost against solving again with a changed value."""

from __future__ import annotations

from typing import Any

import block_and_wall
import pytest
import sympy as sp
from answers import answer_of
from contact_problems import floor
from several_contacts import PUSHED, pushed
from sympy.physics.mechanics import dynamicsymbols
from systems import driven_system

import dmoc
from dmoc.base.errors import ProblemError
from dmoc.models.registry import find

pytestmark = pytest.mark.slow

STEP = 1e-4


def best(problem: dmoc.Problem, near: dmoc.Solution) -> float:
    solution = answer_of(problem, "ipm", guess=near, optimality=1e-8, verify=False)
    return solution.cost


def slope(
    problem: dmoc.Problem, near: dmoc.Solution, change: Any, low: float = -STEP, high: float = STEP
) -> float:
    """Difference of the optimal costs; ``change(d)`` returns the fields of the problem changed
    by d."""
    return (best(problem.but(**change(high)), near) - best(problem.but(**change(low)), near)) / (
        high - low
    )


@pytest.mark.parametrize("order", [2, 4])
def test_block_and_wall(order: int) -> None:
    problem = block_and_wall.problem(0.8, 40, order)
    solution = dmoc.solve(problem, "ipm", optimality=1e-8)
    slopes = dmoc.sensitivities(problem, solution)
    assert slopes["restitution"]["wall"] == pytest.approx(
        slope(problem, solution, lambda d: {"restitution": 0.8 + d}), rel=1e-6
    )
    for name in ("m", "wall"):
        assert slopes["parameters"][name] == pytest.approx(
            slope(problem, solution, lambda d, n=name: {"parameters": {n: 1 + d}}), rel=1e-6
        )
    assert slopes["surfaces"]["wall"] == pytest.approx(slopes["parameters"]["wall"], rel=1e-9)
    assert slopes["final_time"] == pytest.approx(
        slope(problem, solution, lambda d: {"final_time": 1 + d}), rel=1e-6
    )
    assert slopes["start"]["x"] == pytest.approx(
        slope(problem, solution, lambda d: {"start": {"x": d}}), rel=1e-6
    )
    again = slope(problem, solution, lambda d: {"goal": {"x": 0, "x_dot": d}})
    assert slopes["goal"]["x_dot"] == pytest.approx(again, rel=1e-6)
    assert set(slopes["goal"]) == {"x", "x_dot"}


def test_each_of_the_surfaces_that_are_landed_on_at_once_has_its_slope() -> None:
    """Two masses fall from rest for one second, from 1 m each to floors at 0 and -1/2 m, under a
    gravity of 1: each force costs 3/2 (1/2 - way)^2."""
    y, z, u, w, low = (*dynamicsymbols("y z u w"), sp.Symbol("low"))
    system = dmoc.MechanicalSystem(
        "two_landings", [y, z], (y.diff() ** 2 + z.diff() ** 2) / 2 - y - z, {low: 0.5}, [u, w],
        {y: u, z: w}, surfaces={"left": y >= 0, "right": z >= -low}, cost=(u**2 + w**2) / 2,
    )  # fmt: skip
    problem = dmoc.Problem(
        dmoc.build(system, order=4), {"y": 1.0, "z": 1.0}, {}, sequence=["+left +right"], steps=4,
        durations=[1.0, 0.25], final_time=1.25,
    )  # fmt: skip
    solution = answer_of(problem, "ipm", starts=1, optimality=1e-8)
    slopes = dmoc.sensitivities(problem, solution)
    assert solution.cost == pytest.approx(1.5 * (0.5**2 + 1.0**2))
    assert slopes["surfaces"] == pytest.approx({"left": 1.5, "right": 3.0}, rel=1e-6)
    assert slopes["parameters"]["low"] == pytest.approx(3.0, rel=1e-6)


@pytest.mark.parametrize("end", ["start", "goal"])
def test_states_are_told_as_they_were_given(end: str) -> None:
    """The mass matrix of the cart-pendulum couples both velocities and depends on the angle."""
    reference = find("cart_pendulum")
    moving = {"alpha_dot": 0.4, "x_dot": -0.7}
    problem = dmoc.Problem(
        reference.kernels(), start={"alpha": 0.5, "x": 0.0, **moving}, sequence=["lower"], steps=30,
        final_time=1.0, goal={"alpha": 1.2, "x": 0.3, **moving},
    )  # fmt: skip
    solution = dmoc.solve(problem, "ipm", optimality=1e-9, verify=False)
    slopes = dmoc.sensitivities(problem, solution)[end]
    states = dict(getattr(problem, end))
    assert set(slopes) == set(states)
    for name, value in states.items():
        again = slope(problem, solution, lambda d, n=name, v=value: {end: {**states, n: v + d}})
        assert slopes[name] == pytest.approx(again, rel=1e-4, abs=1e-4)


@pytest.mark.parametrize("e", [1.0, 0.0])
def test_ends_of_the_range_of_restitution(e: float) -> None:
    problem = block_and_wall.problem(e, 40)
    solution = dmoc.solve(problem, "ipm", optimality=1e-8)
    inwards = (-2 * STEP, 0.0) if e == 1 else (0.0, 2 * STEP)
    slopes = dmoc.sensitivities(problem, solution)["restitution"]["wall"]
    # One-sided.
    assert slopes == pytest.approx(
        slope(problem, solution, lambda d: {"restitution": e + d}, *inwards), rel=2e-3, abs=5e-3
    )


@pytest.mark.parametrize("method", ["ipm", "slsqp"])
def test_pendulum_with_active_bounds(method: str) -> None:
    reference = find("cart_pendulum")
    problem = dmoc.Problem(
        reference.kernels(), **{**reference.defaults, "steps": 40, "bounds": {"F": (-26, 26)}}
    )
    solution = dmoc.solve(problem, method, verify=False)
    slopes = dmoc.sensitivities(problem, solution)
    values = reference.kernels().parameters
    for name in ("m_p", "l", "g", "alpha_min"):
        value = values[name]
        assert value is not None
        again = slope(problem, solution, lambda d, n=name, v=value: {"parameters": {n: v + d}})
        assert slopes["parameters"][name] == pytest.approx(again, rel=1e-4)
    assert slopes["bounds"]["F <="] == pytest.approx(
        slope(problem, solution, lambda d: {"bounds": {"F": (-26, 26 + d)}}), rel=1e-4
    )
    assert slopes["final_time"] == pytest.approx(
        slope(problem, solution, lambda d: {"final_time": (None, 1 + d)}), rel=1e-4
    )


def test_everything_that_depends_on_the_time() -> None:
    problem = dmoc.Problem(
        dmoc.build(driven_system()), start={"a": 0.0, "z": -0.5, "a_dot": 0.3}, goal={"a": 0.4},
        sequence=["floor"], steps=20, final_time=1.5, restitution={"floor": 0.6},
    )  # fmt: skip
    solution = answer_of(problem, "ipm", optimality=1e-8)
    slopes = dmoc.sensitivities(problem, solution)
    for name, value in problem.kernels.parameters.items():
        assert value is not None
        again = slope(problem, solution, lambda d, n=name, v=value: {"parameters": {n: v + d}})
        assert slopes["parameters"][name] == pytest.approx(again, rel=1e-5, abs=1e-7)
    assert slopes["restitution"]["floor"] == pytest.approx(
        slope(problem, solution, lambda d: {"restitution": {"floor": 0.6 + d}}), rel=1e-5
    )


@pytest.mark.parametrize("steps", [None, 6])
def test_a_mesh_that_the_solve_has_chosen_or_refined_is_taken(steps: int | None) -> None:
    """J = 24 m^2 w^2 with a lossless wall at w = 1, so that dJ/dw = 2 J."""
    problem = block_and_wall.problem(1.0, 6).but(steps=steps)
    solution = dmoc.solve(problem, "ipm", tolerance=1e-4, starts=1)
    assert solution.steps != problem.phase_steps
    slopes = dmoc.sensitivities(problem, solution)
    assert slopes["parameters"]["wall"] == pytest.approx(2 * solution.cost, rel=1e-6)


def test_friction_of_a_contact_that_lasts() -> None:
    """J = 6 m^2 d^2/T^3 + f^2 T/2 with f = mu m g, so that dJ/dmu = f m g T = 40, whatever the
    steps."""
    for steps in (10, 40):
        problem = dmoc.Problem(
            floor(), start={"x": 0, "y": 0}, goal={"x": 1, "x_dot": 0}, contacts=["floor:slip+"],
            steps=steps, final_time=4,
        )  # fmt: skip
        change = dmoc.sensitivities(problem, answer_of(problem, starts=1))
        assert change["parameters"]["mu"] == pytest.approx(40, rel=1e-6)


def test_friction_that_several_contacts_share() -> None:
    """The cost of the pushed box is as mu^1.5, apart from the error of the steps."""
    change = dmoc.sensitivities(pushed(), answer_of(pushed(), starts=4))
    assert change["parameters"]["mu"] == pytest.approx(1.5 * PUSHED / 0.2, rel=2e-3)


def test_a_solution_of_another_problem_is_refused() -> None:
    problem = block_and_wall.problem(0.8, 10)
    solution = dmoc.solve(problem, "ipm")
    with pytest.raises(ProblemError, match="give the problem that was solved"):
        dmoc.sensitivities(problem.but(steps=12), solution)
    for other in (
        problem.but(restitution=0.5),
        problem.but(parameters={"wall": 2.0}),
        problem.but(goal={"x": -1.0}),
        problem.but(final_time=2.0),
    ):
        with pytest.raises(ProblemError, match="is no minimum of this problem"):
            dmoc.sensitivities(other, solution)
    with pytest.raises(ProblemError, match="sensitivities need a minimum"):
        dmoc.sensitivities(problem, dmoc.solve(problem.but(bounds={"u": (-1, 1)}), "ipm"))
