"""Bodies that are turned: closed forms, published values, and either sign of a quaternion."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from sympy.physics.mechanics import dynamicsymbols
from systems import satellite_system

import dmoc
from dmoc.base.errors import ProblemError
from dmoc.codegen.kernels import Kernels
from dmoc.guess.automatic import initial_guesses
from dmoc.guess.random_motions import random_motions
from dmoc.motion.attitude import rates
from dmoc.program.layout import Layout
from dmoc.solving.either_sign import ways_of

UPRIGHT = dmoc.attitude((1, 0, 0, 0))
REST = {f"q_omega_{axis}": 0 for axis in "xyz"}
J, T = 0.4547, 2.0


def effort(angle: float) -> float:
    """Half the square of the torque of the turn of least effort from rest to rest."""
    return 6 * angle**2 * J**2 / T**3


def turn(kernels: Kernels, angle: float, sign: int = 1, **fields: Any) -> dmoc.Problem:
    p = dmoc.attitude(axis=(0, 1, 0), angle=angle).quaternion
    goal = {"q": sign * np.array(p), **REST}
    return dmoc.Problem(kernels, {"q": UPRIGHT}, goal, **({"steps": 30, "final_time": T} | fields))


@pytest.mark.parametrize("sign", [1, -1])
def test_a_sphere_turns_the_short_way_and_knows_the_long_one(satellite: Kernels, sign: int) -> None:
    """1.0627924 for 150 degrees, 2.0830730 for 210 degrees."""
    solution = dmoc.solve(turn(satellite, np.deg2rad(150), sign), "ipm", starts=4)
    assert solution.status == "solved"
    assert solution.cost == pytest.approx(1.0627924, rel=5e-6)
    assert min(m.cost for m in solution.others) == pytest.approx(2.0830730, rel=5e-6)
    assert "with the other sign of a quaternion at the goal it costs 2.08307" in solution.message
    assert np.abs((solution.phases[0].q ** 2).sum(axis=1) - 1).max() < 1e-12


def test_a_sphere_turns_by_nearly_half_a_turn(satellite: Kernels) -> None:
    angle = np.pi - 1e-3
    solution = dmoc.solve(turn(satellite, angle), "ipm", starts=4)
    assert solution.cost == pytest.approx(effort(angle), rel=5e-6)
    longer = min(m.cost for m in solution.others)
    assert longer == pytest.approx(effort(2 * np.pi - angle), rel=5e-6)


def test_what_keeps_the_length_of_a_quaternion_is_no_force(satellite: Kernels) -> None:
    solution = dmoc.solve(turn(satellite, 1.0, steps=10), "ipm", starts=1)
    (phase,) = solution.phases
    other = replace(phase, reaction=2 * phase.reaction, reaction_inside=2 * phase.reaction_inside)
    assert np.abs(phase.reaction).max() > 0
    assert dmoc.verify(replace(solution.trajectory, phases=(other,)), satellite).passed
    assert "q_unit" not in str(solution)


def test_a_guess_keeps_its_sign(satellite: Kernels) -> None:
    problem = turn(satellite, np.deg2rad(150))
    long = dmoc.solve(ways_of(problem)[1], "ipm", starts=1)
    assert long.cost == pytest.approx(2.0830730, rel=5e-6)
    again = dmoc.solve(problem.but(final_time=2.2), "ipm", guess=long)
    assert again.cost == pytest.approx(2.0830730 / 1.1**3, rel=5e-6)
    change = dmoc.sensitivities(problem, long)
    assert change["final_time"] == pytest.approx(-3 * 2.0830730 / T, rel=1e-3)


@pytest.mark.parametrize("measured", [1, -1])
@pytest.mark.parametrize("way", [0, 1])
def test_a_planner_goes_on_as_its_plan_from_a_state_of_either_sign(
    satellite: Kernels, way: int, measured: int
) -> None:
    """Half of the effort is left in the middle of a turn from rest to rest."""
    problem = turn(satellite, np.deg2rad(150))
    solution = dmoc.solve(ways_of(problem)[way], "ipm", starts=1)
    half = solution.at(T / 2)
    omega = 2 * np.array(rates(half.q)) @ half.v
    state = {"q": measured * half.q} | dict(zip(REST, omega, strict=True))
    plan = dmoc.Planner(problem, solution).replan(T / 2, state)
    assert plan.status == "solved" and plan.cost == pytest.approx(solution.cost / 2, rel=1e-3)


def test_a_solver_in_c_has_the_coordinates_of_attitudes(satellite: Kernels, tmp_path: Any) -> None:
    problem = turn(satellite, np.deg2rad(150), steps=12)
    solution = dmoc.solve(problem, "ipm", starts=1)
    dmoc.generate_solver(problem, tmp_path / "turn", guess=solution)
    carried = dmoc.load_solver(tmp_path / "turn")
    assert carried.solve().cost == pytest.approx(solution.cost, rel=1e-9)


@pytest.mark.parametrize(("by", "cost"), [(75, 1.0627924), (-105, 2.0830730)])
def test_keyframes_are_attitudes_that_say_the_way(
    satellite: Kernels, by: float, cost: float
) -> None:
    """Each is reached the short way from the one before."""
    problem = turn(satellite, np.deg2rad(150))
    half = dmoc.attitude(axis=(0, 1, 0), angle=np.deg2rad(by))
    guess = {"q": [UPRIGHT, half, problem.goal["q"]]}
    solution = dmoc.solve(problem, "ipm", guess=guess)
    assert solution.status == "solved" and solution.cost == pytest.approx(cost, rel=5e-6)


@pytest.mark.parametrize(
    ("course", "message"),
    [
        ([], r"guess: q = \[\]: expected an attitude such as"),
        ([UPRIGHT, 3], "guess: q, keyframe 1 = 3: expected an attitude such as"),
        (lambda t: t, "guess: q = .*: expected a list of attitudes"),
    ],
)
def test_a_course_of_no_attitudes_is_one_sentence(
    satellite: Kernels, course: Any, message: str
) -> None:
    with pytest.raises(ProblemError, match=message):
        dmoc.solve(turn(satellite, 1.0), "ipm", guess={"q": course})


def test_first_guesses_turn_along_the_sphere(satellite: Kernels) -> None:
    """At one speed, where chords would be quicker in the middle; also where the way is a whole
    turn, and chords lead through the middle of the sphere."""
    way = ways_of(turn(satellite, np.deg2rad(30)))[1]
    for problem in (way, ways_of(turn(satellite, 0.0))[1]):
        q = initial_guesses(problem)[0].x[Layout.of(problem).index_q]
        steps = np.arccos(np.clip((q[1:] * q[:-1]).sum(axis=1), -1, 1))
        assert np.isfinite(q).all() and np.ptp(steps) < 1e-6
        x = random_motions(problem, [], 1.0, range(8))[:, Layout.of(problem).index_q]
        assert np.abs((x**2).sum(axis=2) - 1).max() < 1e-6


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        ("q", {(1,), (-1,)}),
        ("qr", {(1, 1), (1, -1), (-1, 1), (-1, -1)}),
        ("qrs", {(1, 1, 1), (-1, 1, 1), (1, -1, 1), (1, 1, -1)}),
    ],
)
def test_two_attitudes_have_four_ways_and_three_have_a_flip_each(
    names: str, expected: set[tuple[int, ...]]
) -> None:
    attitudes = {name: dynamicsymbols(f"{name}0:4") for name in names}
    q = [p for own in attitudes.values() for p in own]
    system = dmoc.MechanicalSystem(
        "turns", q, sum(p.diff() ** 2 for p in q), attitudes=attitudes, cost=1
    )
    upright = dict.fromkeys(names, UPRIGHT)
    problem = dmoc.Problem(
        dmoc.build(system, backend="numpy"), upright, upright, steps=2, final_time=1.0
    )
    assert {tuple(way.goal_position[::4].tolist()) for way in ways_of(problem)} == expected


def test_a_goal_that_the_start_has_already_costs_nothing(satellite: Kernels) -> None:
    """At rest without forces there is nothing that forces of constraints are compared with."""
    goal = {"q1": 0, "q2": 0, **REST}
    problem = dmoc.Problem(satellite, {"q": UPRIGHT}, goal, steps=30, final_time=2.0)
    solution = dmoc.solve(problem, "ipm", starts=1)
    assert solution.status == "solved" and solution.cost == 0


@pytest.mark.slow
def test_a_sphere_turns_by_half_a_turn_in_the_shortest_time() -> None:
    """3.2430 of Bilimoria and Wie (1993); about one axis it takes 3.5449."""
    kernels = dmoc.build(satellite_system(1.0, 1), order=4)
    goal = {"q": dmoc.attitude(axis=(0, 0, 1), angle=np.pi), **REST}
    torques = dict.fromkeys(("T_x", "T_y", "T_z"), (-1, 1))
    problem = dmoc.Problem(
        kernels, {"q": UPRIGHT}, goal, bounds=torques, steps=40, final_time=(1, 10)
    )
    assert dmoc.solve(problem, "ipm", seed=1).cost == pytest.approx(3.2430, abs=1e-3)
