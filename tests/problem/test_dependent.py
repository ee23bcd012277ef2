"""Starts of models with constraints that leave out what follows."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import sympy as sp
from answers import answer_of
from joint_problems import T, U, X, Y, bob, double_pendulum, places
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.errors import ProblemError


def stated(start: dict[Any, Any], steps: int = 20, **fields: Any) -> dmoc.Problem:
    return dmoc.Problem(dmoc.build(bob()), start=start, steps=steps, final_time=1.0, **fields)


@pytest.mark.parametrize(
    ("start", "rate"),
    [
        ({X: 0.6, Y: -0.8, "x_dot": 1.0}, 0.75),  # x x' + y y' = 0
        ({X: 0.6, Y: -0.8, "y_dot": 0.75}, 1.0),
        ({X: 0.0, Y: -1.0, "x_dot": 2.0}, 0.0),
    ],
)
def test_a_rate_that_is_left_out_follows(start: dict[Any, Any], rate: float) -> None:
    (left,) = {"x_dot", "y_dot"} - set(start)
    problem = stated(start)
    assert problem.start_bounds.is_state
    v = problem.model.velocity(problem.start_position, problem.start_bounds.momentum[:, 0])
    assert v["xy".index(left[0])] == pytest.approx(rate, abs=1e-15)


@pytest.mark.slow
def test_rest_and_what_the_constraints_leave_open_stay_zero() -> None:
    for start in ({X: 0.6, Y: -0.8}, {X: 0.6, Y: -0.8, "x_dot": 0}, {X: 0.0, Y: -1.0, "y_dot": 0}):
        assert not stated(start).start_bounds.momentum.any()
    redundant, _ = double_pendulum()
    with pytest.raises(ProblemError, match="'first' does not allow the velocity at the start"):
        dmoc.Problem(dmoc.build(redundant), start=places(0.3, 0.2) | {"x1_dot": 1.0})


def test_a_coordinate_that_is_left_out_follows() -> None:
    problem = stated(
        {X: 0.6, "x_dot": 0.8}, steps=40, bounds={Y: (-2, 0)}, goal={X: 0.0, "x_dot": 0.0}
    )
    solution = answer_of(problem, "ipm", starts=4)
    first = solution.phases[0]
    np.testing.assert_allclose(first.q[0], [0.6, -0.8], atol=1e-12)
    np.testing.assert_allclose(first.v[0], [0.8, 0.6], atol=1e-12)


def test_a_place_that_is_prescribed_needs_no_start() -> None:
    """Position and velocity at the start are those of the drive, x = sin(2 t)/5."""
    lagrangian = X.diff(T) ** 2 / 2 + Y.diff(T) ** 2 / 2 + X.diff(T) * Y.diff(T) / 2
    driven = dmoc.MechanicalSystem(
        "driven", [X, Y], lagrangian, {}, [U], {Y: U}, cost=U**2,
        constraints={"drive": sp.Eq(X, sp.sin(2 * T) / 5)},
    )  # fmt: skip
    problem = dmoc.Problem(
        dmoc.build(driven), start={Y: 0}, goal={Y: 1, "y_dot": 0}, steps=10, final_time=1.0
    )
    first = answer_of(problem, "ipm", starts=1).phases[0]
    np.testing.assert_allclose([first.q[0], first.v[0]], [[0, 0], [0.4, 0]], atol=1e-12)


def test_no_more_may_be_left_out_than_constraints_decide() -> None:
    redundant, _ = double_pendulum()
    kernels, at = dmoc.build(redundant), places(0.3, 0.2)
    for names, refused in (("y1 y2", False), ("x1 y2", False), ("x2 y2", True), ("x1 y1 y2", True)):
        start = {name: value for name, value in at.items() if name not in names.split()}
        if refused:
            with pytest.raises(ProblemError, match="is not given: give a number, a range"):
                dmoc.Problem(kernels, start=start)
        else:
            assert np.isinf(dmoc.Problem(kernels, start=start).start_bounds.position).any()


A, B = dynamicsymbols("a b")


def driven(constraints: dict[str, Any], *angles: Any) -> Any:
    """A mass that a force pushes, and angles that move as constraints say."""
    moving = [X, *angles]
    lagrangian = sum(q.diff(T) ** 2 for q in moving) / 2
    return dmoc.build(
        dmoc.MechanicalSystem(
            "driven", moving, lagrangian, {}, [U], {X: U}, cost=U**2, constraints=constraints
        )
    )


@pytest.mark.parametrize(
    ("constraints", "start", "rates"),
    [
        ({"drive": sp.Eq(A, 3 * T)}, {X: 0, A: 0}, [0, 3]),
        ({"drive": sp.Eq(A, T**2)}, {X: 0, A: 0}, [0, 0]),
        ({"drive": sp.Eq(A, 3 * T + 2 * X)}, {X: 0, A: 0, "x_dot": 1}, [1, 5]),
        ({"drive": sp.Eq(A**2 + A, 3 * T)}, {X: 0, A: 0}, [0, 3]),
        ({"drive": sp.Eq(A, 3 * T), "gear": sp.Eq(B, 2 * A)}, {X: 0, A: 0, B: 0}, [0, 3, 6]),
        ({"gear": sp.Eq(A, 2 * B), "drive": sp.Eq(A, 3 * T)}, {X: 0, A: 0, B: 0}, [0, 3, 1.5]),
        ({"gear": sp.Eq(A, 2 * X)}, {X: 0, A: 0, B: 0, "x_dot": 1}, [1, 2, 0]),
    ],
)
def test_the_time_and_what_is_given_decide_rates_at_the_start(
    constraints: dict[str, Any], start: dict[Any, Any], rates: list[float]
) -> None:
    """Also beside rates that no constraint decides, which are zero."""
    kernels = driven(constraints, *[s for s in start if s in (A, B)])
    problem = dmoc.Problem(kernels, start, steps=5, final_time=1.0)
    bounds = problem.start_bounds
    if np.isfinite(bounds.momentum).all():  # masses of 1 kg
        np.testing.assert_allclose(bounds.momentum[:, 0], rates, atol=1e-14)
    else:
        np.testing.assert_allclose(bounds.velocity, np.array([rates, rates]).T, atol=1e-14)


def test_rates_that_move_with_the_time_are_free_where_the_place_is() -> None:
    problem = dmoc.Problem(driven({"drive": sp.Eq(A, 3 * T)}, A), {X: (0, 1), A: 0}, steps=5)
    np.testing.assert_allclose(problem.start_bounds.velocity, [[0, 0], [-np.inf, np.inf]])


def test_a_rate_that_the_time_leaves_open_is_not_chosen() -> None:
    """a - 2 x moves with 3 per second: neither of both rates alone."""
    kernels = driven({"drive": sp.Eq(A, 3 * T + 2 * X)}, A)
    with pytest.raises(ProblemError, match="'drive' does not allow the velocity at the start"):
        dmoc.Problem(kernels, {X: 0, A: 0}, steps=5)


@pytest.mark.slow
def test_an_angle_that_is_driven_begins_with_its_rate() -> None:
    """The mass costs 12 d^2 / T^3 from rest to rest, whatever the angle does beside it."""
    problem = dmoc.Problem(
        driven({"drive": sp.Eq(A, 3 * T)}, A), {X: 0, A: 0}, {X: 1, "x_dot": 0}, final_time=1.0
    )
    solution = answer_of(problem)
    assert solution.cost == pytest.approx(12, rel=1e-3)
    assert solution.phases[0].v[0, 1] == pytest.approx(3, abs=1e-9)
