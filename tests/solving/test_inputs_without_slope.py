"""Inputs at which the forces have no slope, as those of u^3 at u = 0: against closed forms."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import sympy as sp
from answers import answer_of
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.guess.automatic import initial_guesses
from dmoc.guess.inverse_dynamics import acting, inputs_for
from dmoc.guess.random_motions import random_motions
from dmoc.program.layout import Layout
from dmoc.program.scaling import scale_of
from dmoc.program.transcription import Transcription
from dmoc.solvers.inflection import falling_inputs
from dmoc.solvers.outcome import Duals
from dmoc.solving.starts import starts_of

X, Y, A, U, W = dynamicsymbols("x y a u w")
HERE, THERE = {"x": 0, "x_dot": 0}, {"x": 1, "x_dot": 0}
G = 9.81


def pushed(
    force: Any, cost: Any, inputs: tuple[Any, ...] = (U,), order: int | None = None, **fields: Any
) -> dmoc.Problem:
    """A mass of 1 kg, in 2 s from rest to rest 1 m further."""
    system = dmoc.MechanicalSystem(
        "pushed", [X], X.diff() ** 2 / 2, inputs=list(inputs), forces={X: force}, cost=cost
    )
    stated: dict[str, Any] = {"start": HERE, "goal": THERE, "final_time": 2.0} | fields
    kernels = system if order is None else dmoc.build(system, order=order)
    return dmoc.Problem(kernels, **stated)


def lifted(k: float, mass: float, height: float) -> dmoc.Problem:
    """A mass that a thrust k u^2 lifts in 2 s from rest to rest, at the least integral of its
    square."""
    system = dmoc.MechanicalSystem(
        "lifted", [Y], mass * Y.diff() ** 2 / 2 - mass * G * Y, inputs=[U], forces={Y: k * U**2},
        cost=(k * U**2) ** 2,
    )  # fmt: skip
    start, goal = ({"y": y, "y_dot": 0} for y in (0, height))
    return dmoc.Problem(system, start, goal, final_time=2.0)


# Costs are squares of the force f, whose least integral over T = 2 s is 12/T^3 from rest to rest,
# 3/T^3 where the speed at the end is free, (1 + T^2/2)^2 3/T^3 there against a constant force of 1.
EFFORTS: dict[str, tuple[Callable[[], dmoc.Problem], float]] = {
    "its cube": (lambda: pushed(U**3, U**6, bounds={"u": (-2, 2)}), 1.5),
    "its cube without bounds": (lambda: pushed(U**3, U**6), 1.5),
    "its square with a sign": (lambda: pushed(U * sp.Abs(U), U**4), 1.5),
    "at its bound": (
        lambda: pushed((U - 1) ** 3, (U - 1) ** 6, bounds={"u": (1, 3)}, goal={"x": 1}), 3 / 8),
    "a root at its bound": (
        lambda: pushed(sp.sqrt(U), U, bounds={"u": (0, 3)}, goal={"x": 1}), 3 / 8),
    "a power of 3/2": (
        lambda: pushed(U ** sp.Rational(3, 2) - 1, U**3, bounds={"u": (0, 3)}, goal={"x": 1}),
        27 / 8),
    "a square against gravity": (lambda: lifted(1.0, 1.0, 1.0), 1.5 + 2 * G**2),
    "a rotor's": (lambda: lifted(1e-6, 50.0, 5.0), 2500 * (37.5 + 2 * G**2)),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", EFFORTS)
def test_starts_find_what_inputs_without_slope_at_zero_do(name: str) -> None:
    stated, least = EFFORTS[name]
    solution = answer_of(stated())
    assert solution.cost == pytest.approx(least, rel=1e-4)
    assert solution.agreeing_starts > 1
    # ends on the coarse mesh alone are as far from the least cost as the flat beside it is wide
    for other in solution.others:
        near = other.cost == pytest.approx(least, rel=3e-3)
        assert near or (other.status == "coarse" and other.cost > least)


@pytest.mark.slow
@pytest.mark.parametrize(
    "options", [{}, {"starts": 1}, {"guess": {"u": 0}}, {"guess": {"u": 0, "x": 0}}]
)
def test_a_motion_without_inputs_is_no_trap(options: dict[str, Any]) -> None:
    """sum f^2 h = 12/(T^3 (1 - 1/N^2)) of forces that are constant in N steps."""
    problem = pushed(U**3, U**6, steps=40)
    assert answer_of(problem, **options).cost == pytest.approx(1.5 / (1 - 1 / 1600), rel=1e-6)
    unknowns = initial_guesses(problem)[0].x.copy()
    unknowns[Layout.of(problem).index_u] = 0.0
    assert answer_of(problem, guess=unknowns).cost == pytest.approx(1.5 / (1 - 1 / 1600), rel=1e-6)


@pytest.mark.slow
def test_a_slope_that_vanishes_at_the_inputs_of_a_guess_alone_is_no_trap() -> None:
    problem = pushed((U - 1) ** 3, (U - 1) ** 6)
    assert not problem.operating_inputs.any()
    assert answer_of(problem, guess={"u": 1}).cost == pytest.approx(1.5, rel=1e-4)
    solution = answer_of(problem)
    assert solution.cost == pytest.approx(1.5, rel=1e-4) and not solution.others


@pytest.mark.slow
def test_an_input_that_signs_the_square_of_another_one() -> None:
    """u^4 + w^2 >= 2 |u^2 w|, whose integral over a push and a pull of one step h each, 2 - h from
    each other, is 4 |dp| = 4/(2 - h)."""
    solution = answer_of(pushed(U**2 * W, U**4 + W**2, (U, W), order=2, steps=50))
    assert solution.cost == pytest.approx(4 / 1.96, rel=1e-6)


@pytest.mark.slow
def test_squares_of_rotors_lift_and_turn() -> None:
    """Straight up the rotors share the weight: each (f/2)^2, and sum (f/2)^2 2 = the integral of
    f^2/2."""
    system = dmoc.MechanicalSystem(
        "rotors", [X, Y, A], (X.diff() ** 2 + Y.diff() ** 2 + A.diff() ** 2 / 50) / 2 - G * Y,
        inputs=[U, W], cost=U**4 + W**4,
        forces={X: -(U**2 + W**2) * sp.sin(A), Y: (U**2 + W**2) * sp.cos(A), A: U**2 - W**2},
    )  # fmt: skip
    rest = {"x": 0, "x_dot": 0, "y_dot": 0, "a": 0, "a_dot": 0}
    up = dmoc.Problem(system, rest | {"y": 0}, rest | {"y": 1}, final_time=2.0)
    assert answer_of(up).cost == pytest.approx((1.5 + 2 * G**2) / 2, rel=1e-6)
    across = up.but(goal=rest | {"x": 1, "y": 1})
    assert answer_of(across, starts=1).cost > (1.5 + 2 * G**2) / 2


@pytest.mark.slow
def test_a_minimum_where_an_input_rests_is_one_of_many() -> None:
    """With x^2 + v^2 + u^2 and the force u^3 resting for 8 s costs 8 and is a minimum; a force f
    costs |f| at least, with which convex programs find 2.0866."""
    problem = pushed(
        U**3, X**2 + X.diff() ** 2 + U**2, start={"x": 1, "x_dot": 0}, goal={}, final_time=8.0,
        bounds={"u": (-1, 1)}, steps=40,
    )  # fmt: skip
    solution = answer_of(problem)
    assert 2.0866 < solution.cost < 2.2
    assert solution.agreeing_starts < solution.starts and solution.others


# Starts -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("force", "bounds", "operating"),
    [
        (sp.tan(U), None, 0.0),
        (sp.exp(10 * U), None, 0.0),
        (U**3, (-2, 2), 1.0),
        (U**2, (0, 4), 3.0),
        (U**2, (None, 0), -1.0),
        (U**3, None, 1.0),
        (U**3 / 1000, None, 10.0),
        ((U - 1) ** 2, (1, 3), 2.5),
    ],
)
def test_forces_are_looked_at_where_inputs_act(force: Any, bounds: Any, operating: float) -> None:
    """At zero where they do there; else at three quarters of the bounds, or where a force is as
    large as 1 kg over 1 m in 1 s^2 (within half a decade)."""
    problem = pushed(force, U**2, bounds={} if bounds is None else {"u": bounds}, final_time=1.0)
    assert problem.operating_inputs == pytest.approx([operating])


def test_inverse_dynamics_find_inputs_of_forces_that_are_not_linear() -> None:
    """u |u| = a on both sides of zero; where it hardly acts an input is moved a tenth of the way to
    where it acts most."""
    problem = pushed(U * sp.Abs(U), U**4)
    a = np.array([[4.0], [-9.0], [0.25], [0.0]])
    rest = np.zeros((4, 1))
    u = inputs_for(problem, problem.model, rest, rest, a, np.zeros(4))
    assert u[:3, 0] == pytest.approx([2.0, -3.0, 0.5], rel=1e-6)
    assert u[3, 0] == pytest.approx(-0.3, rel=1e-3)


def test_a_motion_that_needs_no_inputs_has_none() -> None:
    problem = pushed(U**3, U**6, goal=HERE, steps=40)
    x = initial_guesses(problem)[0].x
    assert not x[Layout.of(problem).index_u].any()
    solution = answer_of(problem)
    assert solution.cost == 0 and not solution.others


def test_no_start_has_inputs_that_do_nothing() -> None:
    problem = pushed(U**3, U**6, steps=24)
    lay = Layout.of(problem)
    guesses = [g.x for g in initial_guesses(problem)]
    motions = random_motions(problem, guesses, 2.0, range(8), 3)
    assert all(np.abs(x[lay.index_u]).max() > 1e-2 for x in [*guesses, *motions])
    again = random_motions(problem, guesses, 2.0, range(5, 8), 3)
    assert np.array_equal(again, motions[5:])


def test_a_motion_of_a_guess_is_kept_and_its_inputs_where_they_act() -> None:
    """1 m by a cubic in 2 s: a = 3/2 (1 - t)."""
    problem = pushed(U**3, U**6, steps=100)
    lay = Layout.of(problem)
    x = starts_of(problem, {"x": lambda t: t**2 * (3 - t) / 4, "u": 0}).points[0]
    t = (lay.times(x)[:-1] + lay.times(x)[1:]) / 2
    assert x[lay.index_u][1:-1, 0] ** 3 == pytest.approx(1.5 * (1 - t[1:-1]), abs=5e-3)
    half = {"x": lambda t: t / 2, "u": [0, 0, 1]}
    assert starts_of(problem, half).points[0][lay.index_u][:50, 0] == pytest.approx(0.0)
    linear = pushed(U, U**2)
    z = initial_guesses(linear)[0].x * 0.0
    assert acting(linear, z) is z


def test_sizes_are_those_of_inputs_that_act() -> None:
    """The force 1e-9 u^3 makes 3/2 N with u = 1145."""
    problem = pushed(U**3 / 10**9, U**6)
    size = float(scale_of(problem, initial_guesses(problem)[0].x).u[0])
    assert size == pytest.approx(1145, rel=0.2)


# Conditions of third order ------------------------------------------------------------------------


@pytest.mark.parametrize(("power", "falls"), [(3, True), (2, False)])
def test_a_cost_that_falls_in_third_order_is_found(power: int, falls: bool) -> None:
    """At u = 0 the Lagrangian of a step is p u^3 + u^6, or p u^2 + u^6."""
    problem = pushed(U**power, U**6, steps=4)
    lay = Layout.of(problem)
    x = initial_guesses(problem)[0].x.copy()
    x[lay.index_u[1, 0]] = 0.0
    nlp = Transcription(problem, scale_of(problem, x))
    duals = Duals(np.linspace(1.0, 2.0, nlp.n_eq), np.zeros(nlp.n_in), np.zeros(nlp.n))
    direction = falling_inputs(nlp, nlp.scaled(x), duals)
    assert (direction is not None) is falls
    if direction is not None:
        (at,) = np.flatnonzero(direction)
        assert at == lay.index_u[1, 0]
        slopes = nlp.lagrangian_gradient(nlp.scaled(x) + 0.03 * direction, duals.y, duals.w)
        assert slopes[at] * direction[at] < 0
