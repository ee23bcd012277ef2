"""Drag that is a power of the speed, whose derivatives are 0/0 where nothing moves."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.errors import ModelError, SimulationError

x, y, u, w = dynamicsymbols("x y u w")
t = dynamicsymbols._t
VX, VY = x.diff(t), y.diff(t)
SPEED = sp.sqrt(VX**2 + VY**2)
MASS = (VX**2 + VY**2) / 2
CUBIC = (VX**2 + VY**2) ** sp.Rational(3, 2) / 3
WIND = ((VX - 1) ** 2 + VY**2) ** sp.Rational(3, 2) / 3
# The same speed, written out in velocities that are not at right angles.
SKEW = sp.sqrt(sp.expand((VX + VY * sp.cos(x)) ** 2 + VY**2 * sp.sin(x) ** 2))


@pytest.mark.parametrize(
    ("terms", "start", "order", "error"),
    [
        ({"dissipation": CUBIC}, {}, 2, 2e-6),
        ({"dissipation": CUBIC}, {}, 4, 1e-9),
        ({"forces": {x: -VX * SPEED, y: -VY * SPEED}}, {}, 4, 1e-9),
        ({"forces": {y: -VY * SKEW}}, {}, 2, 2e-6),
        ({"dissipation": WIND}, {x: 1}, 2, 2e-6),
        ({"forces": {y: -VY * sp.Abs(VY)}}, {}, 2, 2e-6),
        ({"dissipation": sp.sqrt(VY**2) ** 3 / 3}, {}, 4, 1e-9),
    ],
)
def test_a_body_that_is_let_go_falls_against_its_drag(
    terms: dict[str, Any], start: dict[Any, float], order: int, error: float
) -> None:
    """v' = -1 + v^2, so that y = -ln cosh t."""
    system = dmoc.MechanicalSystem("falls", [x, y], MASS - y, {}, **terms)
    run = dmoc.simulate(dmoc.build(system, order=order), {}, start, step_size=0.01, steps=100)
    assert run.q[:, 1] == pytest.approx(-np.log(np.cosh(run.t)), abs=error)


@pytest.mark.parametrize(
    ("power", "order"), [(SPEED, 2), (SPEED, 4), (SPEED**3, 2), (sp.sqrt(VY**2) ** 3, 4)]
)
def test_what_grows_with_the_speed_is_nothing_at_rest(power: Any, order: int) -> None:
    """A lift of 5 times a power of the speed leaves what rests where it is."""
    system = dmoc.MechanicalSystem("lifts", [x, y], MASS, {}, forces={y: 5 * power})
    run = dmoc.simulate(dmoc.build(system, order=order), {y: 0.3}, {}, step_size=0.1, steps=5)
    np.testing.assert_allclose(run.q, np.tile([0.0, 0.3], (6, 1)), atol=1e-12)
    np.testing.assert_allclose(run.v, 0.0, atol=1e-12)


def test_a_drag_that_depends_on_places_of_bodies() -> None:
    """The same fall with the point of a definition in the dissipation."""
    a = dynamicsymbols("a")
    drag = (a.diff(t) ** 2 + VY**2) ** sp.Rational(3, 2) / 3
    system = dmoc.MechanicalSystem(
        "defined", [x, y], MASS - y, {}, definitions={a: x}, dissipation=drag
    )
    run = dmoc.simulate(system, {}, {}, step_size=0.01, steps=100)
    assert run.q[-1] == pytest.approx([0, -np.log(np.cosh(1))], abs=2e-6)


@pytest.mark.parametrize("order", [2, 4])
def test_a_plan_begins_turns_and_ends_at_rest(order: int) -> None:
    """Up and down again: by the symmetry of the way it rests at its top, half way."""
    system = dmoc.MechanicalSystem(
        "lifted", [x, y], MASS, {}, inputs=[u, w], forces={x: u, y: w}, dissipation=CUBIC,
        cost=u**2 + w**2,
    )  # fmt: skip
    rest = {x: 0, y: 0, "x_dot": 0, "y_dot": 0}
    problem = dmoc.Problem(
        dmoc.build(system, order=order), start=rest, goal={x: 0, y: 1, "x_dot": 0, "y_dot": 0},
        final_time=2, steps=20,
    )  # fmt: skip
    there = dmoc.solve(problem, starts=1)
    assert there.status == "solved", there.message
    still = dmoc.solve(problem.but(goal=rest), starts=1)
    assert still.status == "solved" and still.cost == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize(
    ("dissipation", "shown"),
    [
        (SPEED / 10, "sqrt"),
        (sp.sqrt(VY**2), "Abs"),
        (sp.Abs(VX) * x**2 + VY**2, "Abs"),
        ((VX**2 + VY**2) ** sp.Rational(3, 4), r"\*\*\(3/4\)"),
    ],
)
def test_damping_that_jumps_at_rest_is_refused(dissipation: Any, shown: str) -> None:
    with pytest.raises(ModelError, match=shown + ".*jumps or has no slope at rest"):
        dmoc.MechanicalSystem("dry", [x, y], MASS - y, {}, dissipation=dissipation)


@pytest.mark.parametrize(
    "dissipation",
    [
        VX**2 + CUBIC,
        sp.Abs(VX) ** 3,
        sp.Abs(VX) * VX**2,
        sp.sqrt(VX**2 + 1e-4),
        VX**2 * sp.sqrt(x**2 + 1),
        VX**2 * SPEED,
    ],
)
def test_damping_with_a_slope_at_rest_is_taken(dissipation: Any) -> None:
    system = dmoc.MechanicalSystem("damped", [x, y], MASS - y, {}, dissipation=dissipation)
    run = dmoc.simulate(system, {}, {}, step_size=0.01, steps=10)
    assert run.energy[-1] <= run.energy[0] + 1e-12


def test_a_force_along_the_velocity_has_none_at_rest() -> None:
    """It is told in words where the motion begins at rest, and is a force as any other elsewhere:
    1 N along the velocity."""
    system = dmoc.MechanicalSystem("ahead", [x, y], MASS, {}, forces={x: VX / SPEED, y: VY / SPEED})
    with pytest.raises(SimulationError, match="forces at the start are not numbers"):
        dmoc.simulate(system, {}, {}, step_size=0.01, steps=10)
    run = dmoc.simulate(system, {}, {x: 0.6, y: 0.8}, step_size=0.01, steps=100)
    assert run.v[-1] == pytest.approx([1.2, 1.6], abs=1e-9)
