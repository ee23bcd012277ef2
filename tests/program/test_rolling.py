"""Balls that land, roll and leave, beside closed forms: Coulomb's friction in two directions holds
what rolls without slipping."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.errors import ProblemError, SimulationError
from dmoc.codegen.kernels import Kernels

x, y, z, a, b, c = PLACES = dynamicsymbols("x y z a b c")
F, G = dynamicsymbols("F G")
r, g, mu, tilt, spin = sp.symbols("r g mu tilt spin")
RADIUS, GRAVITY, SHARE = 0.1, 9.81, 2 / 5  # of m r^2, the moment of inertia
ON_FLOOR = {"x": 0.0, "y": 0.0, "z": RADIUS, "a": 0.0, "b": 0.0, "c": 0.0}
STILL = {f"{name}_dot": 0.0 for name in ON_FLOOR}


@cache
def ball(order: int, tangents: str) -> Kernels:
    """A homogeneous ball of mass 1 on a plane that is tilted along x, pushed by F and G: its
    angular velocity is (a', b', c').  The tangents are positions, rates that turn with c, or rates
    against a table that turns with the angular velocity ``spin``."""
    speeds = sum(q.diff() ** 2 for q in (x, y, z))
    turns = sum(q.diff() ** 2 for q in (a, b, c))
    s = x.diff() - r * b.diff(), y.diff() + r * a.diff()
    along = {
        "positions": (x - r * b, y + r * a),
        "rates": (sp.cos(c) * s[0] + sp.sin(c) * s[1], sp.cos(c) * s[1] - sp.sin(c) * s[0]),
        "table": (s[0] + spin * y, s[1] - spin * x),
    }
    system = dmoc.MechanicalSystem(
        f"rolling_{tangents}", PLACES, parameters={r: RADIUS, g: GRAVITY, mu: 0.5, tilt: 0.0}
        | ({spin: 3.0} if tangents == "table" else {}), inputs=[F, G],
        lagrangian=(speeds + sp.Rational(2, 5) * r**2 * turns) / 2
        - g * (z * sp.cos(tilt) - x * sp.sin(tilt)),
        forces={x: F, y: G}, surfaces={"floor": z >= r}, tangents={"floor": along[tangents]},
        friction={"floor": mu}, cost=F**2 + G**2,
    )  # fmt: skip
    return dmoc.build(system, order=order)


def rolling(tangents: str = "positions", order: int = 4, **more: Any) -> dmoc.Problem:
    fields: dict[str, Any] = {
        "start": ON_FLOOR | STILL, "goal": {"x": 0.3, "y": 0.4, "x_dot": 0, "y_dot": 0},
        "contacts": ["floor"], "steps": 6, "final_time": 1.0,
    }  # fmt: skip
    return dmoc.Problem(ball(order, tangents), **(fields | more))


@pytest.mark.parametrize("tangents", ["positions", "rates"])
def test_a_ball_that_is_pushed_from_rest_to_rest_has_the_least_cost(tangents: str) -> None:
    """It rolls with (1 + k) m x'' = F: the least integral of F^2 over a way d in T is
    (1 + k)^2 12 d^2/T^3, and friction is k m x''."""
    solution = dmoc.solve(rolling(tangents), starts=1)
    assert solution.status == "solved", solution.message
    assert solution.cost == pytest.approx((1 + SHARE) ** 2 * 12 * 0.25, rel=1e-9)
    (phase,) = solution.phases
    assert phase.mode == "floor:stick"
    held = np.hypot(*phase.tangential.T)
    assert held[[0, -1]] == pytest.approx(SHARE * 6 * 0.5, rel=1e-6)  # of x'' = 6 d/T^2 at the ends
    np.testing.assert_allclose(phase.normal, GRAVITY, rtol=1e-9)


def test_friction_below_the_cone_of_both_directions_is_no_answer() -> None:
    """At the ends each direction alone needs less than mu N, both together more."""
    needed = SHARE * 6 * 0.5 / GRAVITY
    assert 0.8 * needed < 0.9 * needed
    eager = rolling(parameters={"mu": 1.01 * needed})
    assert dmoc.solve(eager, starts=1).cost == pytest.approx(1.96 * 3, rel=1e-9)
    slower = dmoc.solve(rolling(parameters={"mu": 0.9 * needed}), starts=1)
    assert slower.status == "solved" and slower.cost > 1.001 * 1.96 * 3
    (phase,) = slower.phases
    assert np.hypot(*phase.tangential.T).max() <= 0.9 * needed * GRAVITY * (1 + 1e-6)
    assert any("friction cone of floor" in str(bound) for bound in slower.active_bounds)


def test_the_check_sees_friction_beyond_the_cone() -> None:
    solution = dmoc.solve(rolling(), starts=1)
    assert dmoc.verify(solution.trajectory, rolling().kernels).passed
    low = SHARE * 6 * 0.5 / GRAVITY * 0.9  # above what each direction needs
    slippery = replace(solution.trajectory, parameters=solution.trajectory.parameters | {"mu": low})
    message = dmoc.verify(slippery, rolling().kernels).message
    assert "floor would have to stick with 1.2 N" in message


@pytest.mark.parametrize("tangents", ["positions", "rates"])
def test_a_ball_rolls_down_with_five_sevenths(tangents: str) -> None:
    way = dmoc.simulate(
        ball(4, tangents), ON_FLOOR, {}, step_size=0.1, steps=5, parameters={"tilt": 0.3}
    )
    assert way.q[-1, 0] == pytest.approx(5 / 7 * GRAVITY * np.sin(0.3) * 0.5**2 / 2, rel=1e-9)
    assert [s.name for s in way.rubbing] == ["floor"]
    with pytest.raises(SimulationError, match="and slides, and sliding that lasts may turn"):
        dmoc.simulate(
            ball(4, tangents), ON_FLOOR, {}, step_size=0.1, steps=5,
            parameters={"tilt": 0.3, "mu": 0.99 * 2 / 7 * np.tan(0.3)},
        )  # fmt: skip


def test_a_ball_on_a_table_that_turns_goes_round() -> None:
    """By 2/7 of the angular velocity of the table (order 4 of the program, exact simulation)."""
    rate = 2 / 7 * 3.0
    start = ON_FLOOR | {"x": 0.5} | STILL | {"x_dot": 0.3, "b_dot": 3.0, "a_dot": 15.0}

    def exact(t: float) -> np.ndarray:
        v = np.array([0.3, 0.0])
        turned = np.array([[np.cos(rate * t), -np.sin(rate * t)],
                           [np.sin(rate * t), np.cos(rate * t)]]) @ v  # fmt: skip
        centre = np.array([0.5, 0.0]) + np.array([-v[1], v[0]]) / rate
        return np.asarray(centre + np.array([turned[1], -turned[0]]) / rate)

    way = dmoc.simulate(
        ball(4, "table"), {n: start[n] for n in ON_FLOOR}, {n: start[n] for n in STILL},
        step_size=0.1, steps=10,
    )  # fmt: skip
    np.testing.assert_allclose(way.q[-1, :2], exact(1.0), rtol=1e-8)
    errors = []
    for steps in (4, 8):
        motion = rolling("table", start=start, goal={}, steps=steps)
        end = dmoc.solve(motion, starts=1, verify=False).trajectory.phases[-1].q[-1, :2]
        errors.append(np.abs(end - exact(1.0)).max())
    assert errors[1] < 1e-6 and 3.7 < np.log2(errors[0] / errors[1]) < 4.3


def test_a_ball_lands_and_rolls_on_from_its_impulse() -> None:
    """T = -k/(1 + k) m of the sliding velocity before; with less friction it would slide."""
    falls = ON_FLOOR | STILL | {"z": 0.3, "x_dot": 0.5, "z_dot": -1.0, "a_dot": 3.0, "b_dot": 6.0}
    none = {"F": (0.0, 0.0), "G": (0.0, 0.0)}
    words = {"sequence": ["+floor"], "contacts": [], "steps": [2, 4], "bounds": none, "goal": {}}
    landing = rolling("rates", start=falls, **words)
    solution = dmoc.solve(landing, starts=1)
    assert solution.status == "solved", solution.message
    (event,) = solution.collisions
    assert event.word == "+floor"
    before, after = solution.phases[0].v[-1], solution.phases[1].v[0]
    slid = np.array([before[0] - RADIUS * before[4], before[1] + RADIUS * before[3]])
    np.testing.assert_allclose(
        [event.tractions[n] for n in ("floor", "floor_2")], -SHARE / (1 + SHARE) * slid, rtol=1e-8
    )
    assert event.impulse == pytest.approx(-before[2], rel=1e-9) and abs(after[2]) < 1e-12
    held = SHARE / (1 + SHARE) * np.hypot(*slid) / -before[2]
    assert dmoc.solve(landing.but(parameters={"mu": 1.01 * held}), starts=1).status == "solved"
    slippery = landing.but(parameters={"mu": 0.99 * held})
    refused = dmoc.solve(slippery, starts=1, verify=False)
    assert refused.status == "infeasible" and "friction cone of floor at event 1" in refused.message
    assert "floor sticks" in refused.message and "slip+" not in refused.message


def test_a_ball_that_rolls_may_leave() -> None:
    leaves = rolling("rates", sequence=["-floor"], steps=[4, 4], start=ON_FLOOR | STILL)
    assert [mode.sticking for mode in leaves.touch.modes] == [(0, 1), ()]
    start = ON_FLOOR, STILL | {"x_dot": 1.0, "b_dot": 10.0}
    off = dmoc.simulate(
        ball(4, "rates"), *start, step_size=0.1, steps=2, parameters={"tilt": 1.01 * np.pi / 2}
    )
    assert off.rubbing == () and off.q[-1, 2] > RADIUS


def test_proofs_do_not_cover_what_rolls() -> None:
    with pytest.raises(ProblemError, match="do not cover contacts with two tangential directions"):
        dmoc.prove(rolling())
