"""Motions that are run with a feedback and disturbed: beside linear equations, and through hits
that come early, late, or not at all."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import contact_problems
import numpy as np
import pytest
from pytest import approx
from scipy.integrate import solve_ivp
from systems import bouncer_problem, double_integrator, landing_problem, landing_system, puck_system

import dmoc
from dmoc.base.errors import SimulationError
from dmoc.control.controller import Controller
from dmoc.control.disturbance import read_disturbance
from dmoc.mechanics.contact_mode import FREE, Mode
from dmoc.models.registry import find

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def swing() -> tuple[dmoc.Solution, Any]:
    """The swing-up of the source by a hit on a limiter, and its feedback."""
    reference = find("cart_pendulum")
    problem = dmoc.Problem(reference.kernels(4), **{**reference.defaults, "steps": 40})
    solution = dmoc.solve(problem, "ipm")
    return solution, dmoc.feedback(solution)


@pytest.fixture(scope="module")
def line() -> dmoc.Solution:
    return dmoc.solve(double_integrator(20, 4), "ipm", starts=1)


def test_deviations_obey_the_linear_equations(line: dmoc.Solution) -> None:
    """A unit mass, whose equations are linear: dy' = (A - B K(t)) dy by SciPy; a sample of 1 ms
    is as good as none."""
    hold = dmoc.feedback(line, Q=50.0)
    start = np.array([0.02, -0.1])
    A, B = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [1.0]])
    run = solve_ivp(lambda t, y: (A - B @ hold.at(0, t)[2]) @ y, (0, 1), start, rtol=1e-9)
    held = dmoc.simulate(
        line, feedback=hold, disturb={"start": {"x": 0.02, "x_dot": -0.1}, "sampling": 1e-3}
    )
    plan = line.phases[0]
    off = np.array([held.q[-1, 0] - plan.q[-1, 0], held.v[-1, 0] - plan.v[-1, 0]])
    assert off == approx(run.y[:, -1], abs=1e-4)  # inputs of the plan are held for an 80th of it
    assert abs(off[0]) < 0.005
    alone = dmoc.simulate(line, disturb=dmoc.Disturbance(start={"x": 0.02, "x_dot": -0.1}))
    assert alone.q[-1, 0] - plan.q[-1, 0] == approx(0.02 - 0.1, abs=1e-5)


def test_a_push_changes_the_velocity(line: dmoc.Solution) -> None:
    motion = dmoc.simulate(line, disturb={"pushes": [(0.5, {"x": 0.3})]}, parameters={"m": 2.0})
    still = dmoc.simulate(line, disturb={}, parameters={"m": 2.0})
    jump = motion.v[:, 0] - still.v[:, 0]
    assert jump[499] == approx(0) and jump[501] == approx(0.15)
    assert motion.q[-1, 0] - still.q[-1, 0] == approx(0.075, abs=1e-9)


def test_a_delay_acts_on_what_is_measured_not_on_the_plan(line: dmoc.Solution) -> None:
    """Without a deviation it changes nothing; with one the feedback begins later."""
    hold = dmoc.feedback(line, Q=50.0)
    for delay in (0.0, 0.01):
        quiet = dmoc.simulate(line, feedback=hold, disturb={"delay": delay})
        assert quiet.q[-1, 0] == approx(1.0, abs=1e-4)
    late = dmoc.simulate(line, feedback=hold, disturb={"delay": 0.01, "start": {"x": 0.1}})
    u = np.concatenate([phase.u for phase in late.trajectory.phases])[:, 0]
    plan = [line.at(t)["u"] for t in (0.0095, 0.0105)]
    assert u[9] == approx(plan[0], abs=0.05)  # held for an 80th of the motion
    assert u[10] == approx(plan[1] - 0.1 * hold.at(0, 0.01)[2][0, 0], abs=0.15)


def test_noise_repeats_with_its_seed(line: dmoc.Solution) -> None:
    hold = dmoc.feedback(line)

    def ends(seed: int) -> np.ndarray:
        noise = {"noise": {"x": 1e-3, "x_dot": 0.05}, "seed": seed}
        return dmoc.simulate(line, feedback=hold, disturb=noise).q[-1]

    assert ends(1) == approx(ends(1), abs=0) and ends(1) != approx(ends(2), abs=1e-9)


def test_inputs_stay_within_their_bounds() -> None:
    problem = double_integrator(20, 4).but(bounds={"u": (-7.0, 7.0)})
    solution = dmoc.solve(problem, "ipm", starts=1)
    hold = dmoc.feedback(solution, Q=1e4)
    run = dmoc.simulate(solution, feedback=hold, disturb={"start": {"x": -0.2}})
    u = np.concatenate([phase.u for phase in run.trajectory.phases])
    assert u.max() == 7.0 and u.min() >= -7.0


WRONG: dict[str, dict[str, Any]] = {
    "a heavier mass": {"parameters": {"m_p": 1.1}},
    "an early limiter": {"parameters": {"alpha_min": np.pi / 10 + 0.01}},
    "a late limiter": {"parameters": {"alpha_min": np.pi / 10 - 0.01}},
    "another restitution": {"restitution": 0.93},
    "another start": {"disturb": {"start": {"alpha": 0.01}}},
    "noise": {"disturb": {"noise": {"alpha": 1e-3, "x": 1e-3, "alpha_dot": 0.01, "x_dot": 0.01}}},
    "a push": {"disturb": {"pushes": [(0.5, {"x": 0.1})]}},
    "a delay": {"disturb": {"delay": 0.002}},
}


@pytest.mark.parametrize("wrong", WRONG, ids=str)
def test_the_swing_up_arrives_only_with_its_feedback(
    swing: tuple[dmoc.Solution, Any], wrong: str
) -> None:
    solution, hold = swing
    change = {"disturb": {}} | WRONG[wrong]
    runs = [dmoc.simulate(solution, feedback=f, **change) for f in (None, hold)]
    alone, held = (np.abs(np.append(run.q[-1, 0] - np.pi / 2, run.v[-1])) for run in runs)
    assert held.max() < 0.1 and alone.max() > 10 * held.max()
    assert [c.surface for c in runs[1].collisions] == ["lower"]


def test_a_hit_that_comes_early_does_not_make_the_reference_jump(
    swing: tuple[dmoc.Solution, Any],
) -> None:
    """Until the planned hit, the input of the phase after it stays near that of the plan: compared
    with the phase before it, whose speed has the other sign, it would be thousands of newtons."""
    solution, hold = swing
    planned = solution.collisions[0].time
    early = dmoc.simulate(
        solution, feedback=hold, disturb={}, parameters={"alpha_min": np.pi / 10 + 0.01}
    )
    hit = early.collisions[0].time
    assert hit < planned - 2e-3
    after = early.trajectory.phases[1]
    u = after.u[(after.t[:-1] > hit + 1e-3) & (after.t[:-1] < planned), 0]
    plan = solution.phases[1].u
    assert np.abs(u).max() < 3 * np.abs(plan).max()


def test_a_feedback_of_another_motion_of_the_same_duration_is_refused() -> None:
    """Also one that is exported; a copy from a file is the same motion."""
    problem = dmoc.Problem(
        puck_system(), {"x": 0.3, "y": 0.2, "x_dot": 1.0}, {"x": 0.5, "y": 0.4}, steps=10,
        final_time=1.0,
    )  # fmt: skip
    first, second = (
        dmoc.solve(problem.but(goal={"x": x, "y": 0.4}), "ipm", starts=1) for x in (0.5, 0.6)
    )
    hold = dmoc.feedback(first)
    assert hold.fits(first.trajectory) and not hold.fits(second.trajectory)
    with pytest.raises(SimulationError, match="that of another motion"):
        dmoc.simulate(second, feedback=hold)


@dataclass
class Expects:
    """Two events a second apart: a foot leaves, and lands."""

    events: tuple[Any, ...]

    def span(self, phase: int) -> tuple[float, float]:
        return float(phase), phase + 1.0


def test_a_foot_that_leaves_late_and_trembles_has_not_landed() -> None:
    """It leaves 50 ms late, and touches once more at once: the flight goes on until it lands."""
    model = dmoc.Problem(landing_system(), {"x": 0, "y": 0}).model
    foot = model.contacts.surfaces[0]
    nothing, disturbed = np.zeros(2), read_disturbance(None, ("x",), 3.0)
    events = [
        SimpleNamespace(surface="", lands=(), leaves=(foot,), friction={}, switch=""),
        SimpleNamespace(surface=foot, lands=(foot,), leaves=(), friction={}, switch=""),
    ]
    control = Controller(model, 0.01, disturbed, nothing, Expects(tuple(events)))  # type: ignore[arg-type]
    closed, touch = Mode((0,)), [SimpleNamespace(surface=foot)]
    phases = []
    for k in range(200):
        t = (k + 1) * 0.01
        down = t < 1.05 or 1.10 <= t < 1.12 or t >= 1.9
        felt = touch if down and (abs(t - 1.10) < 1e-6 or abs(t - 1.9) < 1e-6) else []
        control.feel(k, felt, closed if down else FREE)  # type: ignore[arg-type]
        phases.append(control.phase)
    assert phases.index(1) == 99 and phases.index(2) == 189


def test_landing_and_friction_are_felt() -> None:
    """A puck lands sliding, and sticks: from a greater height it is late, with less friction it
    comes to rest later, and the feedback brings it there."""
    solution = dmoc.solve(landing_problem(20), "ipm", starts=1)
    hold = dmoc.feedback(solution, Q={"x": 100, "x_dot": 1}, R={"u": 0.1})
    goal = solution.phases[-1].q[-1, 0]
    change = {"parameters": {"mu": 0.08}, "disturb": {"start": {"y": 0.02, "x_dot": 0.1}}}
    assert "mu" in solution.trajectory.parameters
    ends = [dmoc.simulate(solution, feedback=f, **change).q[-1, 0] for f in (None, hold)]
    assert abs(ends[1] - goal) < 0.25 * abs(ends[0] - goal)


def test_friction_that_gives_way_does_so_by_the_input() -> None:
    """A block is held by 1 N until its input passes that: whatever it is found to be, it begins to
    slide, and comes to rest at its goal."""
    solution = dmoc.solve(contact_problems.pushed(20), "ipm", starts=1)
    hold = dmoc.feedback(solution)
    run = dmoc.simulate(solution, feedback=hold, parameters={"m": 1.1}, disturb={})
    assert [c.word for c in run.trajectory.collisions] == ["rail:slip+", "rail:stick"]
    assert run.q[-1, 0] == approx(1.0, abs=0.01)


def test_a_sample_of_feedback_takes_few_calls(swing: tuple[dmoc.Solution, Any]) -> None:
    """Some 300 calls and their returns, of functions in C too, for each of 600 samples more: a
    second of feedback at 1 kHz takes well below a second."""
    solution, hold = swing
    calls = [0]

    def called(*_: object) -> None:
        calls[0] += 1

    def count(samples: int) -> int:
        calls[0] = 0
        sys.setprofile(called)
        try:
            run = dmoc.simulate(solution, feedback=hold, disturb={"sampling": 1 / samples})
        finally:
            sys.setprofile(None)
        assert len(run.t) == samples + 1
        return calls[0]

    assert (count(900) - count(300)) / 600 < 800


@pytest.mark.parametrize(("change", "words"), [
    ({"disturb": 3}, "disturb = 3: expected a dmoc.Disturbance or a mapping"),
    ({"disturb": {"mass": 1}}, "unknown field 'mass' in disturb"),
    ({"disturb": {"start": {"z": 1}}}, "unknown state 'z' in start"),
    ({"disturb": {"noise": {"x": -1}}}, r"noise\['x'\] = -1: expected a standard deviation"),
    ({"disturb": {"sampling": 2.0}}, "sampling = 2: expected seconds below the final time of 1 s"),
    ({"disturb": {"sampling": 1e-9}}, "at most 1000000 samples"),
    ({"disturb": {"delay": 0.0005}}, "delay = 0.0005: expected a whole number of samples"),
    ({"disturb": {"delay": -1}}, "delay = -1: expected a whole number of samples of 0.001 s"),
    ({"disturb": {"pushes": [3]}}, "pushes has the entry 3: expected a pair of a time"),
    ({"disturb": {"pushes": [(2, {"x": 1})]}}, "a push at 2 s: expected a time from 0"),
    ({"disturb": {"pushes": [(0.5, {"x_dot": 1})]}}, "unknown state 'x_dot' in pushes"),
    ({"disturb": {"seed": -1}}, "seed = -1"),
    ({"feedback": 3}, "feedback = 3: expected one from dmoc.feedback"),
    ({"feedback": dmoc.Planner}, "Planner'>: expected one from dmoc.feedback"),
    ({"disturb": {}, "steps": 5}, 'steps = 5: expected none beside feedback or disturb, whose "sa'),
    ({"disturb": {}, "inputs": [1.0]}, "inputs = .* expected none beside feedback"),
])  # fmt: skip
def test_disturbances_that_do_not_fit_are_refused(
    line: dmoc.Solution, change: dict[str, Any], words: str
) -> None:
    with pytest.raises(SimulationError, match=words):
        dmoc.simulate(line, **change)


def test_a_feedback_goes_with_its_solution(line: dmoc.Solution) -> None:
    other = dmoc.solve(bouncer_problem(0.7, 20, 2)[0], "ipm", starts=1)
    with pytest.raises(SimulationError, match="the feedback is that of another motion"):
        dmoc.simulate(line, feedback=dmoc.feedback(other))
    with pytest.raises(SimulationError, match="feedback and disturb go with a solution"):
        dmoc.simulate(dmoc.load("puck_table"), {"x": 0}, step_size=0.1, steps=3, disturb={})
