"""What an infeasible problem is told, and what only looks like one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from answers import answer_of
from sympy.physics.mechanics import dynamicsymbols
from systems import block_on_floor, block_system, there_and_back, unit_mass

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.guess.automatic import initial_guesses
from dmoc.program.blocks import NOWHERE
from dmoc.program.scale import Scale
from dmoc.program.transcription import Transcription
from dmoc.solvers.ipm import least_violation
from dmoc.solvers.outcome import Options, Status


@pytest.mark.slow
@pytest.mark.parametrize("method", ["ipm", "slsqp"])
def test_a_weak_force_misses_the_goal(seed: dmoc.Problem, method: str) -> None:
    solution = dmoc.solve(seed.but(bounds={"F": (-1, 1)}, steps=40), method=method, starts=1)
    assert solution.status == "infeasible" and not solution.solved
    assert (
        solution.conflicts[0].startswith("the goal of alpha is missed by 1.0")
        and " rad" in solution.conflicts[0]
    )
    assert any("F >= -1 in" in c for c in solution.conflicts)
    assert [c for c in solution.conflicts if c not in solution.message] == []
    assert solution.max_violation > 1e-3
    assert solution.to_dict()["conflicts"] == list(solution.conflicts)


def test_a_phase_shorter_than_the_shortest_time_is_named(seed: dmoc.Problem) -> None:
    problem = seed.but(durations=[(None, 0.05), (None, None)])
    solution = dmoc.solve(problem, method="ipm", starts=1)
    assert solution.status == "infeasible"
    text = " | ".join(solution.conflicts)
    assert "collision 1 misses 'lower' by 0.0144 rad" in text
    assert (
        "phase 0 -> 'lower': the shortest time at full input is estimated at 0.0549 s, the bounds "
        "allow 0.05 s" in text
    )
    assert "duration of phase 0 <= 0.05 s" in text


def test_the_miss_of_a_block_has_the_amount_of_the_closed_form(block: Kernels) -> None:
    """A unit mass from rest under |u| <= 1 comes to 1/2 in 1 s: half the way to the wall."""
    problem = dmoc.Problem(
        block, start={"x": 0.0}, sequence=["wall"], steps=50, bounds={"u": (-1, 1)},
        durations=[(None, 1.0), (None, None)], final_time=(None, 2.0),
    )  # fmt: skip
    solution = dmoc.solve(problem, method="ipm", starts=1)
    assert solution.status == "infeasible"
    assert solution.conflicts[0] == "collision 1 misses 'wall' by 0.5"
    assert "estimated at 1.41 s, the bounds allow 1 s" in solution.conflicts[1]


@pytest.mark.parametrize("goal", [0.7, (0.7, 0.8), (0.7, None)])
def test_a_goal_is_missed_by_what_is_lacking(block: Kernels, goal: object) -> None:
    """The same block comes to 1/2 in 1 s at most."""
    problem = dmoc.Problem(
        block, start={"x": 0.0}, goal={"x": goal}, steps=50, bounds={"u": (-1, 1)}, final_time=1.0
    )
    solution = dmoc.solve(problem, method="ipm", starts=1)
    assert solution.status == "infeasible"
    assert solution.conflicts[0] == "the goal of x is missed by 0.2"
    assert "u <= 1 in 50 steps" in solution.conflicts[-1]


def test_what_sticks_is_told_where_it_holds_the_motion() -> None:
    """A block on a floor gets nowhere while it sticks, and 0.5 m in 1 s if it slides."""
    kernels = dmoc.build(block_on_floor("held", 1.0, 10.0, 0.4))
    problem = dmoc.Problem(
        kernels, start={"x": 0.0, "y": 0.0}, goal={"x": 0.5}, contacts=["floor"], steps=20,
        bounds={"u": (-5, 5)}, final_time=1.0,
    )  # fmt: skip
    solution = dmoc.solve(problem, method="ipm", starts=1)
    assert solution.status == "infeasible"
    assert solution.conflicts[0] == "the goal of x is missed by 0.5"
    assert "floor sticks (it may slide by floor:slip+ or floor:slip-)" in solution.conflicts[-1]
    slides = dmoc.solve(problem.but(contacts=["floor:slip+"]), method="ipm", starts=1)
    assert slides.solved and "sticks" not in slides.message


def test_least_violation_of_a_feasible_problem_is_none(seed: dmoc.Problem) -> None:
    nlp = Transcription(seed.but(steps=40))
    x = initial_guesses(nlp.problem)[0].x
    outcome = least_violation(nlp, x, Options(), np.ones(nlp.n_eq + nlp.n_in))
    assert outcome.status is Status.SOLVED
    assert max(np.abs(nlp.equality(outcome.x)).max(), -nlp.inequality(outcome.x).min()) < 1e-6


@pytest.mark.parametrize(("price", "place"), [(1 / 300, 1.0), (1 / 3000, 0.0)])
def test_a_violation_has_its_price_in_units_of_its_row(price: float, place: float) -> None:
    """x <= 0 and x >= 1 in thousandths: 1 of |x| against 10/3 or 1/3 of |x - 1|, though rows so
    steep are scaled."""
    x = dynamicsymbols("x")
    system = unit_mass("torn", path_constraints={"low": x <= 0, "high": x >= 1}, cost=1)
    free = {"x": (-5.0, 5.0), "x_dot": (-5.0, 5.0)}
    problem = dmoc.Problem(system, free, free, steps=2, final_time=1.0)
    scale = replace(Scale.none(problem), path=np.array([1.0, 1e-3]))
    nlp = Transcription(problem, scale)
    prices = np.ones(nlp.n_eq + nlp.n_in)
    for block in (nlp.laws.path.at_nodes, nlp.laws.path.at_ends_of_phases):
        high = block.index[..., 1]
        prices[high[high != NOWHERE]] = price
    start = nlp.scaled(initial_guesses(problem)[0].x)
    outcome = least_violation(nlp, start, Options(), prices)
    q = nlp.physical(outcome.x)[nlp.layout.index_q]
    np.testing.assert_allclose(q, place, atol=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("e", [0.0, 0.3])
def test_a_goal_on_the_surface_that_is_hit(block: Kernels, e: float) -> None:
    """The gap of a fixed goal is no constraint: it has no interior, and its multiplier would
    hide that the motion is no minimum."""
    problem = there_and_back(block, goal={"x": 1.0, "x_dot": 0.0}, steps=20, restitution=e)
    one, other = (dmoc.solve(problem, method, starts=1) for method in ("ipm", "slsqp"))
    assert one.status == other.status == "solved"
    assert one.cost == pytest.approx(other.cost, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("order", [2, 4])
def test_a_limit_at_the_surface_itself(order: int) -> None:
    """A bound that a contact implies leaves no interior at the collision; one in front of the
    surface makes the problem infeasible."""
    problem = dmoc.Problem(
        dmoc.build(block_system(), order=order), start={"x": 0.0}, goal={"x": 0.0, "x_dot": 0.0},
        sequence=["wall"], steps=20, final_time=1.0, restitution=0.5,
    )  # fmt: skip
    free = dmoc.solve(problem, "ipm", starts=1)
    for method in ("ipm", "slsqp"):
        held = answer_of(problem.but(bounds={"x": (None, 1.0)}), method, starts=1)
        assert held.cost == pytest.approx(free.cost, rel=1e-6)
    beyond = problem.but(bounds={"x": (None, 0.9)})
    assert dmoc.solve(beyond, "ipm", starts=1).status == "infeasible"


@pytest.mark.slow
def test_the_motion_of_an_infeasible_problem_is_that_of_its_conflicts() -> None:
    """A ball that falls 1 m, loses a fifth of its speed, and is to rest after a second: the time is
    kept, and the speed is what the law of falling bodies says."""
    y, t = dynamicsymbols("y"), dynamicsymbols._t
    system = dmoc.MechanicalSystem(
        "missed_rest", [y], y.diff(t) ** 2 / 2 - 9.81 * y, surfaces={"floor": y >= 0}, cost=1
    )
    problem = dmoc.Problem(
        system, {y: 1}, {"y_dot": 0}, sequence=["floor"], restitution=0.8, final_time=1, steps=20
    )
    solution = dmoc.solve(problem, "ipm", starts=2)
    fall = np.sqrt(2 / 9.81)
    speed = 0.8 * 9.81 * fall - 9.81 * (1 - fall)
    assert solution.status == "infeasible" and solution.final_time == pytest.approx(1.0)
    assert solution.phases[-1].v[-1, 0] == pytest.approx(speed, rel=1e-3)
    assert f"the goal of p_y is missed by {abs(speed):.3g}" in solution.conflicts
