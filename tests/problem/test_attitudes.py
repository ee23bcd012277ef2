"""Attitudes in the statement of a problem."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.errors import DmocError, ProblemError
from dmoc.codegen.kernels import Kernels
from dmoc.motion.attitude import rates
from dmoc.problem.attitudes import STEEPEST, with_goal_of

UPRIGHT = dmoc.attitude((1, 0, 0, 0))
TURNED = dmoc.attitude(axis=(0, 1, 0), angle=2.0)
REST = {f"q_omega_{axis}": 0 for axis in "xyz"}
Mesh: dict[str, Any] = {"steps": 4, "final_time": 1.0}
STEPS: dict[str, Any] = {"step_size": 0.1, "steps": 2}


@pytest.mark.parametrize("sign", [1, -1])
def test_a_goal_has_the_sign_that_is_nearer_to_the_start(satellite: Kernels, sign: int) -> None:
    goal = {"q": sign * np.array(TURNED.quaternion), **REST}
    problem = dmoc.Problem(satellite, {"q": UPRIGHT}, goal, **Mesh)
    assert problem.goal_position.tolist() == list(TURNED.quaternion)
    assert problem.goal_bounds.momentum.tolist() == [[0, 0]] * 4
    other = with_goal_of(problem, -problem.goal_position)
    assert other.goal_position.tolist() == [-x for x in TURNED.quaternion]
    assert with_goal_of(other, problem.goal_position) is other


def test_angular_velocities_that_are_numbers_are_rates(satellite: Kernels) -> None:
    start = {"q": TURNED, "q_omega_x": 0.3, "q_omega_z": -1.0}
    problem = dmoc.Problem(satellite, start, {"q": UPRIGHT, **REST}, **Mesh)
    v = problem.model.velocity(problem.start_position, problem.start_bounds.momentum[:, 0])
    omega = 2 * np.array(rates(TURNED.quaternion)) @ v
    np.testing.assert_allclose(omega, [0.3, 0, -1], atol=1e-14)


def test_ranges_of_angular_velocities_leave_the_rates_free(satellite: Kernels) -> None:
    start = {"q": TURNED, "q_omega_x": (0.1, None)}
    problem = dmoc.Problem(satellite, start, {"q": UPRIGHT, "q_omega_y": (None, 1)}, **Mesh)
    assert np.isinf(problem.start_bounds.velocity).all()
    assert problem.quantity_ranges.start.tolist() == [[0.1, np.inf], [0, 0], [0, 0]]
    assert problem.quantity_ranges.goal[1].tolist() == [-np.inf, 1]


def test_a_start_may_leave_its_attitude_free(satellite: Kernels) -> None:
    problem = dmoc.Problem(satellite, {"q": None}, {"q": TURNED}, **Mesh)
    assert np.isinf(problem.start_bounds.position).all()
    assert problem.start_bounds.momentum.tolist() == [[0, 0]] * 4


def test_attitudes_are_named_in_periodic_and_via(satellite: Kernels) -> None:
    problem = dmoc.Problem(satellite, {"q": None}, periodic=["q"], **Mesh)
    assert problem.periodic == ("q0", "q1", "q2", "q3")
    assert "q = (1, 0, 0, 0)" in str(dmoc.Problem(satellite, {"q": UPRIGHT}, **Mesh))


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"start": {"q": "up"}}, "start of q = 'up': expected an attitude such as dmoc.attitude"),
        ({"start": {"q": (1, 1, 0, 0)}}, "start of q: quaternion = .* has the length 1.41421"),
        ({"start": {"q": UPRIGHT, "q1": 0}}, "start gives 'q1' twice, also as 'q': give it once"),
        ({"start": {"r": UPRIGHT}}, "unknown state or quantity 'r' at the start"),
        (
            {"start": {"q": UPRIGHT, "q_omega_x": 1, "q2_dot": 0}},
            "start gives 'q2_dot' and 'q_omega_x': give one of them",
        ),
        ({"goal": {"q": 3}}, "goal of q = 3: expected an attitude"),
        ({"goal": {"q1": 2, "q0": 0}}, "constraint 'q_unit' does not hold at the goal|q1"),
        ({}, "the start of q is not given: give an attitude, or None to leave it free"),
        ({"start": {"q0": 1}}, "the start of q1 is not given: give a number, a range, or None"),
    ],
)
def test_a_wrong_attitude_is_one_sentence(
    satellite: Kernels, fields: dict[str, Any], message: str
) -> None:
    stated = {"start": {"q": UPRIGHT}} | fields if fields else {}
    if "q1" in stated.get("goal", {}):
        stated["goal"] |= {"q2": 0, "q3": 0}
    with pytest.raises(ProblemError, match=message):
        dmoc.Problem(satellite, **stated, **Mesh)


def test_messages_list_attitudes_and_no_coordinates_of_quaternions(satellite: Kernels) -> None:
    """Nor rates and momenta of these."""
    spins = "q_omega_x, q_omega_y, q_omega_z"
    stated: dict[str, Any] = {"start": {"q": UPRIGHT}, **Mesh}
    still = dmoc.Problem(satellite, **stated)
    for call, message in (
        (lambda: still.but(goal={"r": 0}), f"'r' at the goal: expected one of q, {spins}."),
        (lambda: still.but(start={"q": None}, periodic=["r"]), f"in periodic: .* of q, {spins}."),
        (lambda: dmoc.simulate(satellite, {"r": 0}, **STEPS), "in position: expected one of q."),
        (lambda: dmoc.simulate(satellite, {}, {"q1_do": 0}, **STEPS),
         f"in velocity: expected one of {spins}."),
        (lambda: dmoc.solve(still, guess={"r": 0}), "expected one of q, .*, durations"),
    ):  # fmt: skip
        with pytest.raises(DmocError, match=message):
            call()


# Euler angles -------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def by_angles() -> Kernels:
    place, angles = dynamicsymbols("x y z"), dynamicsymbols("yaw pitch roll")
    torque = dynamicsymbols("T")
    world = dmoc.spatial.World()
    world.free(place, angles, mass=1, inertia=(1, 2, 3))
    return dmoc.build(
        world.system("angles", inputs=[torque], forces={angles[1]: torque}, cost=torque**2)
    )


HERE = dict.fromkeys(("x", "y", "z", "yaw", "pitch", "roll"), 0.0)


def test_the_pitch_of_euler_angles_has_bounds(by_angles: Kernels) -> None:
    problem = dmoc.Problem(by_angles, HERE, **Mesh)
    assert problem.coordinate_bounds[4].tolist() == [-STEEPEST, STEEPEST]
    assert np.isinf(problem.coordinate_bounds[[0, 1, 2, 3, 5]]).all()
    over = dmoc.Problem(by_angles, HERE | {"pitch": 3.0}, bounds={"pitch": (1.6, 4.5)}, **Mesh)
    assert over.coordinate_bounds[4].tolist() == [1.6, 4.5]


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"start": HERE | {"pitch": 1.5708}}, "the start has the pitch pitch = 1.5708, within 5 d"),
        ({"goal": {"pitch": -1.5}}, "the goal has the pitch pitch = -1.5, within 5 degrees of a q"),
        ({"bounds": {"pitch": (-2, 1)}}, r"the bounds of the pitch pitch \(-2 to 1\) hold a quart"),
        ({"bounds": {"pitch": (0, None)}}, r"\(0 to inf\) hold a quarter of a turn, where yaw and"),
    ],
)
def test_a_pitch_of_a_quarter_of_a_turn_is_one_sentence(
    by_angles: Kernels, fields: dict[str, Any], message: str
) -> None:
    with pytest.raises(ProblemError, match=message) as error:
        dmoc.Problem(by_angles, **({"start": HERE} | fields), **Mesh)
    assert "world.free(place, attitude='q')" in str(error.value)
