"""Grips that let go by themselves: simulations beside closed forms, problems and the check."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import sympy as sp
from scipy.optimize import brentq
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.errors import ModelError, ProblemError, SimulationError
from dmoc.codegen.kernels import Kernels

X, Y, U = dynamicsymbols("x y u")
M1, M2, F = sp.symbols("m_1 m_2 F")
STILL = {"x_dot": 0, "y_dot": 0}


def two_carts(**fields: Any) -> dmoc.MechanicalSystem:
    """A truck of 1 kg that is driven, and a load of 3 kg that hangs on it."""
    stated = {"strength": {"hook": F}, "parameters": {M1: 1.0, M2: 3.0, F: 6.0}}
    return dmoc.MechanicalSystem(
        "hooked",
        coordinates=[X, Y],
        inputs=[U],
        lagrangian=M1 * X.diff() ** 2 / 2 + M2 * Y.diff() ** 2 / 2,
        forces={X: U},
        cost=U**2 / 2,
        grips={"hook": X - Y},
        **stated | fields,
    )


@pytest.fixture(scope="module")
def hooked() -> Kernels:
    return dmoc.build(two_carts())


@pytest.fixture(scope="module")
def pulled(hooked: Kernels) -> dmoc.Problem:
    """The truck meets the load a metre on, and both end a metre further."""
    return dmoc.Problem(
        hooked, start={"x": 0, "y": 1, **STILL}, goal={"x": 2, "y": 2, **STILL},
        sequence=["+hook"], final_time=2, parameters={"F": 3.0},
    )  # fmt: skip


@pytest.fixture(scope="module")
def solution(pulled: dmoc.Problem) -> dmoc.Solution:
    return dmoc.solve(pulled)


def words(run: dmoc.Simulation) -> list[tuple[str, float]]:
    return [(c.word, c.time) for c in run.trajectory.collisions]


def test_a_truck_that_pulls_more_and_more_loses_its_load(hooked: Kernels) -> None:
    """The load is pulled with 3/4 of the force 4 t, which is 6 N at 2 s; then it rolls on."""
    run = dmoc.simulate(
        hooked, {"x": 0, "y": 0}, step_size=0.1, steps=40, inputs=lambda t: [4 * t],
        grips={"hook": [(0, 3.0)]},
    )  # fmt: skip
    # Inputs are constant over a step: the force passes 8 N between those at 1.95 and 2.05 s.
    assert words(run) == [("-hook", pytest.approx(2.0))]
    speed = sum(4 * (k + 0.5) * 0.1 for k in range(20)) * 0.1 / 4
    assert run.v[-1] == pytest.approx([speed + 0.5 * 4 * (16 - 4), speed])


@pytest.mark.parametrize(("force", "torn"), [(8.0, 0), (8.001, 1)])
def test_a_grip_holds_its_strength_and_no_more(hooked: Kernels, force: float, torn: int) -> None:
    run = dmoc.simulate(
        hooked, {"x": 0, "y": 0}, step_size=0.1, steps=20, inputs=[force],
        grips={"hook": [(0, None)]},
    )  # fmt: skip
    assert len(run.trajectory.phases[0].closed) == 1 - torn
    assert run.v[-1] == pytest.approx([2 * force, 0.0] if torn else [4.0, 4.0], abs=1e-9)


def test_a_mass_that_swings_tears_its_pivot_where_its_force_says() -> None:
    """By hand: (m l^2 + J) a'^2 / 2 = m g l (cos a - cos a_0); what the pivot takes is that which
    accelerates the mass, less its weight."""
    a, t, J, m, length = dynamicsymbols("a"), dynamicsymbols._t, 0.05, 2.0, 1.5
    px, py = dynamicsymbols("p_x p_y")
    x, y = px + length * sp.sin(a), py - length * sp.cos(a)
    swing = dmoc.MechanicalSystem(
        "swing", [px, py, a],
        m * (x.diff(t) ** 2 + y.diff(t) ** 2) / 2 + J * a.diff() ** 2 / 2 - m * 9.81 * y,
        grips={"pivot": (px, py)}, strength={"pivot": 45},
    )  # fmt: skip
    run = dmoc.simulate(swing, {"a": 1.4}, step_size=0.01, steps=80, grips={"pivot": [(0, None)]})
    inertia = m * length**2 + J

    def force(angle: float) -> float:
        square = 2 * m * 9.81 * length * (np.cos(angle) - np.cos(1.4)) / inertia
        rate = -m * 9.81 * length * np.sin(angle) / inertia
        across = length * (rate * np.cos(angle) - square * np.sin(angle))
        along = length * (rate * np.sin(angle) + square * np.cos(angle))
        return float(m * np.hypot(across, along + 9.81))

    (torn,) = run.trajectory.collisions
    assert torn.word == "-pivot"
    assert torn.position[2] == pytest.approx(brentq(lambda s: force(s) - 45, 0.01, 1.39), abs=1e-9)
    assert dmoc.verify(run.trajectory, dmoc.build(swing)).passed


def test_a_grip_that_closes_under_too_much_load_lets_go_at_once(hooked: Kernels) -> None:
    """It takes the impulse, 3/4 of the difference of the velocities, and closes again later."""
    run = dmoc.simulate(
        hooked, {"x": 0, "y": 0.1}, {"x": 1}, step_size=0.01, steps=50, inputs=[8.1],
        grips={"hook": [(0.02, 1.0)]},
    )  # fmt: skip
    (event,) = run.trajectory.collisions
    time = (np.sqrt(1 + 2 * 8.1 * 0.1) - 1) / 8.1
    assert (event.word, event.time) == ("+hook -hook", pytest.approx(time))
    assert event.impulses["hook"] == pytest.approx(-0.75 * (1 + 8.1 * time))
    assert dmoc.verify(run.trajectory, hooked).passed


def test_a_problem_keeps_the_strength_as_it_keeps_a_bound(solution: dmoc.Solution) -> None:
    """Its cost is that of bounds of the reaction, in docs/stating/grips.md."""
    assert solution.status == "solved"
    assert solution.cost == pytest.approx(21.926, abs=1e-3)
    assert np.abs(solution.phases[1].normal).max() == pytest.approx(3.0, rel=1e-6)
    assert any("hook_load" in name for name in solution.active_bounds)


def test_a_weaker_grip_tears_in_the_simulation_and_in_the_check(
    solution: dmoc.Solution, hooked: Kernels
) -> None:
    assert dmoc.simulate(solution).q[-1] == pytest.approx([2, 2], abs=1e-3)
    run = dmoc.simulate(solution, parameters={"F": 2.5})
    assert run.trajectory.collisions[0].word == "+hook -hook" and run.q[-1][1] > 2.1
    motion = solution.trajectory
    weak = replace(motion, parameters={**motion.parameters, "F": 2.5}, limits={})
    message = dmoc.verify(weak, hooked).message
    assert "the simulation tears grip 'hook' loose at 0.49" in message


def test_a_feedback_run_tears_what_is_loaded_beyond_its_strength(pulled: dmoc.Problem) -> None:
    reserve = dmoc.solve(pulled.but(bounds={"hook_load": (None, 0.75**2)}, parameters={"F": 4.0}))
    steers, disturbed = dmoc.feedback(reserve), {"start": {"x": 0.01}, "sampling": 0.02}
    for strength, torn in ((4.0, False), (2.9, True)):
        plant = {"parameters": {"F": strength}, "feedback": steers, "disturb": disturbed}
        run = dmoc.simulate(reserve, **plant)
        assert any("-hook" in word for word, _ in words(run)) == torn


@pytest.mark.parametrize(
    ("strength", "message"),
    [
        ({"hand": 1}, "'hand' has a strength but is no grip of the model: expected one of hook"),
        ({"hook": -1}, "the strength of grip 'hook' is -1: expected a positive force"),
        ({"hook": X}, "the strength of 'hook' contains x"),
        ({"hook": "5"}, "the strength of 'hook' is not a scalar SymPy expression"),
        (5, "strength = 5: expected a mapping"),
    ],
)
def test_what_is_no_strength_is_refused(strength: Any, message: str) -> None:
    with pytest.raises(ModelError, match=message):
        two_carts(strength=strength, parameters={M1: 1.0, M2: 3.0})


def test_values_that_are_no_strength_are_refused(hooked: Kernels, pulled: dmoc.Problem) -> None:
    with pytest.raises(SimulationError, match="strength of grip 'hook' is 0: expected a positive"):
        dmoc.simulate(hooked, {"x": 0}, step_size=0.1, steps=2, parameters={"F": 0})
    with pytest.raises(ProblemError, match="strength of grip 'hook' is -1: expected a positive"):
        pulled.but(parameters={"F": -1})
    with pytest.raises(ProblemError, match="bounds of hook_load begin at 2: beyond 1 grip 'hook'"):
        pulled.but(bounds={"hook_load": (2, None)})
    with pytest.raises(ModelError, match="'hook_load' is used twice"):
        two_carts(quantities={"hook_load": X})
