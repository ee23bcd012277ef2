"""Stability: multipliers of gaits, growth through phases and events."""

from __future__ import annotations

from dataclasses import replace
from math import cos, radians
from pathlib import Path

import compass_gait
import contact_problems
import kneed_walker
import numpy as np
import pytest
import two_discs
from gaits import compass_map
from pytest import approx
from sympy.physics.mechanics import dynamicsymbols
from systems import block_system, bouncer_problem, landing_problem, unit_mass

import dmoc
from dmoc.base.errors import SimulationError

pytestmark = pytest.mark.slow

G = 9.81
x = dynamicsymbols("x")


def dropped(order: int, e: float, rise: float) -> dmoc.Solution:
    """A ball falls from a metre onto a table at rise t^2 / 2, and the motion ends there."""
    y, t = dynamicsymbols("y"), dynamicsymbols._t
    ball = dmoc.MechanicalSystem(
        "ball_on_table", [y], y.diff() ** 2 / 2 - G * y, cost=1,
        surfaces={"table": y - rise * t**2 / 2 >= 0},
    )  # fmt: skip
    problem = dmoc.Problem(
        dmoc.build(ball, order=order), start={y: 1.0}, sequence=["table"], durations=[None, 0],
        restitution=e, steps=10,
    )  # fmt: skip
    return dmoc.solve(problem, "ipm")


@pytest.mark.parametrize("order", [2, 4, 6])
def test_the_saltation_matrix_of_a_hit_by_a_table_that_rises(order: int) -> None:
    """By hand, with the rate gamma = s' - y' before the hit: (-e, 0; (1 + e)(g + s'')/gamma, -e)
    behind the flight (1, t; 0, 1)."""
    e, rise = 0.6, 2.0
    solution = dropped(order, e, rise)
    time = np.sqrt(2 / (G + rise))
    gamma = (G + rise) * time
    jump = np.array([[-e, 0], [(1 + e) * (G + rise) / gamma, -e]])
    made = solution.stability()
    assert made.transition == approx(jump @ [[1, time], [0, 1]], rel=1e-7, abs=1e-7)
    assert made.monodromy is None and made.stable is None and not len(made.multipliers)
    sizes = np.diag(made.sizes)
    singular_values = np.linalg.svd(np.linalg.inv(sizes) @ jump @ sizes)[1]
    assert [growth.part for growth in made.parts] == ["phase 1, free", "table"]
    assert made.parts[1].factors == approx(singular_values, rel=1e-6)
    assert made.parts[1].time == approx(time)


@pytest.mark.parametrize("order", [4, 6])
def test_the_rimless_wheel_loses_deviations_at_its_landings(order: int) -> None:
    """The square of its rate is lessened by k^2 = ((I + cos 2a)/(I + 1))^2 at each landing, so that
    the return map has the slope k^2; beside it the wheel may stand elsewhere on the slope."""
    made = dmoc.solve(contact_problems.rimless(20, order), "ipm", starts=1).stability()
    kept = (contact_problems.INERTIA + cos(2 * contact_problems.HALF_ANGLE)) / (
        contact_problems.INERTIA + 1
    )
    assert made.multipliers == approx([1, kept**2], abs=2e-6)
    assert made.stable and not made.notes


def test_the_multipliers_of_the_compass_gait_are_those_of_its_return_map() -> None:
    """Of a map by SciPy's integrator, by central differences at its fixed point."""
    solution = dmoc.solve(compass_gait.problem(30), "ipm", starts=1)
    event, after = solution.collisions[0], solution.phases[1].v[0]
    fixed = np.array([radians(3) - event.position[3], -after[3], -after[2]])
    assert compass_map(fixed) == approx(fixed, abs=2e-5)
    steps = 1e-5 * np.eye(3)
    slopes = np.array([(compass_map(fixed + s) - compass_map(fixed - s)) / 2e-5 for s in steps]).T
    eigenvalues = np.linalg.eigvals(slopes)
    made = solution.stability()
    assert made.multipliers[0] == approx(1, abs=1e-5)  # the floor is the same everywhere
    assert np.sort_complex(made.multipliers[1:]) == approx(np.sort_complex(eigenvalues), abs=2e-4)


def test_a_knee_that_the_next_period_opens_has_the_multipliers_of_its_return_map() -> None:
    """It holds through the last landing, so that the accelerations after that are not those with
    which the period goes on.  The numbers are those of an event-driven integration with 1e-12."""
    solution = dmoc.solve(kneed_walker.problem(20), "ipm", guess=kneed_walker.guess())
    made = solution.stability()
    pair = 0.35257374 + 0.55221146j
    expected = np.array([1, pair, pair.conjugate(), 0.14382266, 0, 0])
    assert np.sort_complex(made.multipliers) == approx(np.sort_complex(expected), abs=1e-5)
    assert solution.cost == approx(0.564328166, abs=1e-6) and not made.notes


def test_a_bouncer_that_repeats_keeps_the_square_of_its_restitution() -> None:
    """The inputs go on as they are: areas of the plane of states shrink by e^2 in each period."""
    problem, _ = bouncer_problem(0.7, 20, 4)
    solution = dmoc.solve(problem, "ipm")
    made = solution.stability()
    assert np.prod(made.multipliers) == approx(0.49, rel=1e-6)
    assert made.stable and "depends on the time" in made.notes[0]
    assert "multiplier" in str(made)


def test_multipliers_stay_with_a_file(tmp_path: Path) -> None:
    problem, _ = bouncer_problem(0.7, 20, 4)
    solution = dmoc.solve(problem, "ipm", starts=1)
    again = dmoc.Solution.load(solution.save(tmp_path / "bouncer.npz"))
    assert again.periodic == solution.periodic == {"y": {"y": 1.0}, "y_dot": {"y_dot": 1.0}}
    kept = again.stability(problem.kernels)
    assert kept.multipliers == approx(solution.stability().multipliers, rel=1e-9)


def violin() -> dmoc.MechanicalSystem:
    """A block on a belt of 1 m/s, held by a spring, with 2 N of static and 1 N of kinetic
    friction: it breaks away at 0.5 m."""
    return dmoc.MechanicalSystem(
        "violin", [x], x.diff() ** 2 / 2 - 2 * x**2, tangents={"belt": x - dynamicsymbols._t},
        friction={"belt": (2, 1)}, cost=1,
    )  # fmt: skip


@pytest.mark.parametrize("order", [4, 6])
def test_what_breaks_away_sooner_is_further_on(order: int) -> None:
    """Whatever the start, the block breaks away at 0.5 m with 1 m/s, the sooner the further on it
    starts: all later deviations lie along the motion, (v, a) dx."""
    problem = dmoc.Problem(
        dmoc.build(violin(), order=order), start={x: 0, "x_dot": 1}, contacts=["belt:stick"],
        sequence=["belt:slip-"], steps=30, final_time=1.5,
    )  # fmt: skip
    solution = dmoc.solve(problem, "ipm", starts=1)
    end = solution.phases[-1]
    along = [end.v[-1, 0], 1 - 4 * end.q[-1, 0]]
    made = solution.stability()
    assert made.transition[:, 0] == approx(along, rel=1e-4)
    assert made.transition[:, 1] == approx([0, 0], abs=1e-9)  # the belt sets the speed


@pytest.mark.parametrize("order", [2, 4])
def test_what_slides_until_it_sticks_ends_at_rest(order: int) -> None:
    """A unit mass under 1 N of friction comes to rest after v^2/2: dx = v dv, dv = 0."""
    system = contact_problems.rail(0)
    problem = dmoc.Problem(
        dmoc.build(system, order=order), start={x: 0, "x_dot": 1.5}, contacts=["rail:slip+"],
        sequence=["rail:stick"], steps=20, final_time=2.0, bounds={"u": (0, 0)},
    )  # fmt: skip
    made = dmoc.solve(problem, "ipm", starts=1).stability()
    assert made.transition == approx(np.array([[1, 1.5], [0, 0]]), abs=1e-6)


def test_a_landing_with_friction_agrees_with_simulations() -> None:
    """A puck lands sliding, and sticks: differences of simulations from starts beside its own."""
    problem = landing_problem()
    solution = dmoc.solve(problem, "ipm", starts=1)
    made, near = solution.stability(), 1e-5
    for name, column in zip(made.states, made.transition.T, strict=True):
        ends = [
            dmoc.simulate(solution, disturb={"start": {name: sign * near}, "sampling": 2e-3})
            for sign in (1, -1)
        ]
        first, second = (np.concatenate([run.q[-1], run.v[-1]]) for run in ends)
        assert (first - second) / (2 * near) == approx(column, abs=2e-3), name


def test_a_hit_at_which_the_inputs_jump_agrees_with_simulations() -> None:
    """Two discs: early, the inputs before the planned time act on both sides, late, those after;
    differences of simulations to both sides, whose hits are many samples off."""
    solution = dmoc.solve(two_discs.problem(50, 4), "ipm", starts=1)
    made, near = solution.stability(), 4e-3
    for name in ("x1", "x1_dot"):
        ends = [
            dmoc.simulate(solution, disturb={"start": {name: sign * near}, "sampling": 4e-4})
            for sign in (1, -1)
        ]
        first, second = (np.concatenate([run.q[-1], run.v[-1]]) for run in ends)
        column = made.transition[:, made.states.index(name)]
        assert (first - second) / (2 * near) == approx(column, abs=4e-3), name


def test_what_is_asked_of_a_motion_that_has_none() -> None:
    touch = replace(block_system("touching"), cost=dynamicsymbols("u") ** 2)
    problem = dmoc.Problem(touch, start={x: 0}, goal={x: 0.5, "x_dot": 0}, final_time=1, steps=20)
    solution = dmoc.solve(problem, "ipm")
    lost = replace(solution, status=dmoc.solvers.outcome.Status.INFEASIBLE)
    with pytest.raises(SimulationError, match="the status of the solution is 'infeasible': its"):
        lost.stability()
    half = replace(solution, periodic={"x": {"x": 1.0}})
    assert "periodic leaves states out" in half.stability().notes[0]
    other = replace(solution, periodic={"height": {"height": 1.0}})
    assert "names 'height', which is no state" in str(other.stability())


def test_a_motion_that_touches_a_surface_has_no_linearised_motion() -> None:
    """A unit mass touches the wall at 1 without a speed."""
    u = dynamicsymbols("u")
    system = replace(unit_mass("toucher", surfaces={"wall": x <= 1}), cost=u**2)
    problem = dmoc.Problem(
        system, start={x: 0, "x_dot": 2.0}, goal={x: 0, "x_dot": -2.0}, sequence=["wall"],
        final_time=2.0, steps=20,
    )  # fmt: skip
    solution = dmoc.solve(problem, "ipm")
    if solution.collisions[0].grazes:
        with pytest.raises(SimulationError, match="touches 'wall' at 1 s without an impulse"):
            solution.stability()
    grazing = replace(solution.collisions[0], grazes=True)
    motion = replace(solution.trajectory, collisions=(grazing,))
    with pytest.raises(SimulationError, match="a small deviation decides whether it hits"):
        replace(solution, trajectory=motion).stability()


def test_a_report_tells_the_stability(tmp_path: Path) -> None:
    problem, _ = bouncer_problem(0.7, 20, 4)
    solution = dmoc.solve(problem, "ipm", starts=1)
    text = solution.report(tmp_path / "bouncer.html").read_text(encoding="utf-8")
    assert "Stability" in text and "multiplier" in text
