"""Contacts that last and friction: closed forms, orders, forces, what is refused."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from answers import answer_of
from contact_problems import (
    PUSHED,
    THERE_AND_BACK,
    TURNED,
    G,
    M,
    T,
    X,
    Y,
    against_wall,
    against_wall_on_floor,
    floor,
    pushed,
    pushed_together,
    pushers,
    rimless,
    rimless_rate,
    there_and_back,
    turned,
    wall_with_friction,
)
from sympy.physics.mechanics import dynamicsymbols
from systems import unit_mass

import dmoc
from dmoc.program.extraction import _continued


@pytest.mark.slow
@pytest.mark.parametrize(
    ("problem", "cost"),
    [
        (pushed, PUSHED),
        (lambda n: against_wall(n, 1.0), 24.5),
        (lambda n: against_wall(n, 0.5), 31.20551823),
        (lambda n: against_wall(n, 0.3), wall_with_friction(0.3)),
        (turned, TURNED),
        (pushers, pushed_together()),
    ],
)
def test_dry_friction_has_its_known_costs_with_order_two(
    problem: Callable[[int], dmoc.Problem], cost: float
) -> None:
    errors = []
    for steps in (20, 40, 80):
        solution = answer_of(problem(steps))
        errors.append(abs(solution.cost - cost) / cost)
    assert errors[-1] < 2e-4
    exact = max(errors) < 1e-8
    assert exact or all(3.5 < a / b < 4.5 for a, b in pairwise(errors))


@pytest.mark.slow
def test_a_block_there_and_back_in_least_time_turns_where_it_is_told_to() -> None:
    solution = answer_of(there_and_back(160))
    assert solution.cost == pytest.approx(THERE_AND_BACK, rel=1e-4)
    assert solution.collisions[0].position[0] == pytest.approx(10, abs=1e-9)


@pytest.mark.slow
def test_forces_of_a_floor_are_weight_and_coulomb_friction(tmp_path: Path) -> None:
    problem = dmoc.Problem(
        floor(), start={"x": 0, "y": 0}, goal={"x": 1, "x_dot": 0}, contacts=["floor"],
        sequence=["floor:slip+", "floor:stick"], steps=20, final_time=4,
    )  # fmt: skip
    solution = answer_of(problem)
    for phase, sign in zip(solution.phases, (0, 1, 0), strict=True):
        assert phase.closed == ("floor",) and phase.rubbing == {"floor": sign}
        np.testing.assert_allclose(phase.normal, 10.0, rtol=1e-9)
        if sign:
            np.testing.assert_allclose(phase.tangential, -1.0, rtol=1e-9)
        assert (np.abs(phase.tangential) <= 0.1 * phase.normal + 1e-9).all()
    solution.save(tmp_path / "s.npz")
    again = dmoc.Solution.load(tmp_path / "s.npz")
    np.testing.assert_array_equal(again.phases[1].tangential, solution.phases[1].tangential)
    assert [c.word for c in again.collisions] == ["floor:slip+", "floor:stick"]
    warm = answer_of(problem, guess=again)
    assert warm.cost == pytest.approx(solution.cost, rel=1e-9)
    finer = answer_of(problem.but(steps=40), guess=again)
    assert finer.cost < solution.cost * 1.01


@pytest.mark.slow
def test_a_block_slides_back_over_a_floor_after_a_hit_as_over_a_rail() -> None:
    solution = answer_of(against_wall_on_floor(20, 0.0))
    assert solution.cost == pytest.approx(dmoc.solve(against_wall(20, 0.7)).cost, rel=1e-6)
    assert solution.cost == pytest.approx(wall_with_friction(0.7), rel=5e-3)
    before, after = solution.phases
    assert after.v[0, 0] == pytest.approx(-0.7 * before.v[-1, 0], rel=1e-9)
    assert [phase.rubbing for phase in solution.phases] == [{"floor": 1}, {"floor": -1}]


@pytest.mark.slow
def test_a_hit_that_presses_a_contact_whose_sliding_turns_is_not_confirmed() -> None:
    solution = dmoc.solve(against_wall_on_floor(10, 0.25))
    assert solution.status == "not_verified"
    assert "floor turns round in the impact at" in solution.message


@pytest.mark.slow
def test_sliding_that_ends_with_the_motion_does_not_turn_in_its_last_step() -> None:
    """A ball that rolls ahead bounces off a smooth wall and may slide back until it rolls again:
    sliding stops where the motion ends."""
    (x, y, a, u), mu = dynamicsymbols("x y a u"), sp.Symbol("mu")
    ball = dmoc.MechanicalSystem(
        "ball_off_a_wall", [x, y, a],
        (x.diff() ** 2 + y.diff() ** 2 + 0.004 * a.diff() ** 2) / 2 - 9.81 * y, {mu: 0.3},
        inputs=[u], forces={a: u}, surfaces={"floor": y >= 0, "wall": x <= 2},
        tangents={"floor": x + 0.1 * a}, friction={"floor": mu}, cost=u**2 / 2,
    )  # fmt: skip
    problem = dmoc.Problem(
        ball, start={"x": 0, "y": 0, "a": 0, "x_dot": 2, "a_dot": -20}, goal={"x": 1},
        contacts=["floor:stick"], sequence=["wall floor:slip-"], steps=10, final_time=(0.3, 4),
        restitution=0.8,
    )  # fmt: skip
    solution = answer_of(problem, "ipm", starts=1)
    last = solution.phases[-1].v[-1]
    assert last[0] + 0.1 * last[2] == pytest.approx(0, abs=1e-6)
    finer = answer_of(problem.but(steps=200), "ipm", starts=1)
    assert finer.cost == pytest.approx(solution.cost, rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("steps", [10, 40])
@pytest.mark.parametrize(
    ("changes", "wanted", "end"),
    [
        ({"goal": {"low": 0.5, "high_dot": 0}, "sequence": ["top:slip+"]}, 0, -1),
        ({"start": {"low": 0, "low_dot": None, "high": 0, "gap": 0}, "goal": {"low": 1}}, 6, 0),
    ],
    ids=["end", "start"],
)
def test_sliding_has_its_direction_at_the_ends_of_the_motion_too(
    steps: int, changes: dict[str, object], wanted: float, end: int
) -> None:
    """A block lies on one that is driven, whose velocity is free where the motion begins or ends,
    and would rather be beyond that of the upper one."""
    (low, high, gap, u), mu = dynamicsymbols("low high gap u"), sp.Symbol("mu")
    speeds = 2 * low.diff() ** 2 + high.diff() ** 2 + gap.diff() ** 2
    blocks = dmoc.MechanicalSystem(
        "two_blocks", [low, high, gap], speeds / 2 - 9.81 * gap / 2, {mu: 0.1}, inputs=[u],
        forces={low: u}, surfaces={"top": gap >= 0}, tangents={"top": high - low},
        friction={"top": mu}, cost=(u - wanted) ** 2 / 2,
    )  # fmt: skip
    task = {"start": {"low": 0, "high": 0, "gap": 0}, "contacts": ["top:slip-"], "final_time": 1}
    solution = answer_of(dmoc.Problem(blocks, steps=steps, **task | changes), "ipm", starts=1)
    v = solution.phases[end].v[end]
    assert v[1] - v[0] == pytest.approx(0, abs=1e-6)


@pytest.mark.slow
def test_a_plastic_push_moves_two_masses_as_one() -> None:
    """A driven mass lands on one at rest: momentum is kept, then both share the force."""
    solution = answer_of(pushers(20))
    event, after = solution.collisions[0], solution.phases[1]
    np.testing.assert_allclose(after.v[0], event.momentum_before[0] / 4, rtol=1e-9)
    assert event.impulses["pad"] == pytest.approx(3 * after.v[0, 0], rel=1e-9)
    # Three quarters of the force go on to the second mass.
    force = np.interp(after.t, solution.trajectory.input_times(after), after.u[:, 0])
    np.testing.assert_allclose(after.normal[1:-1, 0], 0.75 * force[1:-1], atol=1e-6)


@pytest.mark.slow
def test_a_rimless_wheel_rolls_at_the_rate_at_which_steps_lose_what_they_fall() -> None:
    errors, solution = [], None
    for steps in (10, 20, 40):
        solution = answer_of(rimless(steps), guess=solution)
        errors.append(abs(abs(solution.phases[0].v[-1, 2]) - rimless_rate()))
    assert errors[-1] < 1e-3
    assert all(3.5 < a / b < 4.5 for a, b in pairwise(errors))


@pytest.mark.slow
def test_a_contact_that_would_have_to_pull_is_named_with_its_force() -> None:
    lifted = dmoc.MechanicalSystem(
        "lifted",
        [Y],
        M * Y.diff(T) ** 2 / 2 + M * G * Y,  # gravity points up
        {M: 1.0, G: 2.0},
        surfaces={"floor": Y >= 0},
        cost=1,
    )
    solution = dmoc.solve(
        dmoc.Problem(lifted, start={"y": 0}, contacts=["floor"], steps=10, final_time=1)
    )
    assert solution.status == "infeasible"
    assert "floor would have to pull with 2 N" in solution.message


@pytest.mark.slow
def test_sensitivities_equal_differences_of_solved_problems() -> None:
    problem = against_wall(40, 0.5)
    solution = dmoc.solve(problem)
    slopes = dmoc.sensitivities(problem, solution)
    step = 1e-4

    def slope(but: Callable[[float], dmoc.Problem]) -> float:
        costs = [dmoc.solve(but(s), guess=solution).cost for s in (-step, step)]
        return (costs[1] - costs[0]) / (2 * step)

    for name, but in (
        ("parameters", lambda s: problem.but(parameters={"f": 1 + s})),
        ("restitution", lambda s: problem.but(restitution=0.5 + s)),
    ):
        value = slopes[name]["f" if name == "parameters" else "wall"]
        assert value == pytest.approx(slope(but), rel=1e-5)
    assert slopes["final_time"] == pytest.approx(
        slope(lambda s: problem.but(final_time=1 + s)), rel=1e-5
    )


def test_a_rail_may_be_called_like_its_coordinate() -> None:
    assert unit_mass("named", tangents={"x": X}, friction={"x": 1.0}).tangents == {"x": X}


@pytest.mark.parametrize(
    "change",
    [
        {"bounds": {"x": (0, 1)}},  # where it sticks in the end, and in the beginning
        {"bounds": {"x": (0, None)}, "goal": {"x": (1, 2), "x_dot": 0}},
    ],
)
def test_a_bound_where_a_contact_sticks_says_nothing_new(change: dict[str, object]) -> None:
    free, bounded = (
        dmoc.solve(p, "ipm", starts=1, verify=False) for p in (pushed(20), pushed(20).but(**change))
    )
    assert bounded.solved and bounded.cost == pytest.approx(free.cost, rel=1e-9)
    assert bounded.iterations <= 2 * free.iterations
    assert max(abs(v).max() for v in bounded.multipliers.values()) < 10


def test_a_bound_on_the_surface_that_is_closed_says_nothing_new() -> None:
    problem = dmoc.Problem(
        floor(), start={"x": 0, "y": 0}, goal={"x": 1, "x_dot": 0}, contacts=["floor:slip+"],
        steps=20, final_time=1,
    )  # fmt: skip
    free, bounded = (
        dmoc.solve(p, "ipm", starts=1, verify=False)
        for p in (problem, problem.but(bounds={"y": (0, 1)}))
    )
    assert bounded.solved and bounded.cost == pytest.approx(free.cost, rel=1e-9)
    assert bounded.phases[0].q[:, 1] == pytest.approx(0.0, abs=1e-12)
    assert max(abs(v).max() for v in bounded.multipliers.values()) < 1e3


def test_what_sticks_without_friction_holds_nothing() -> None:
    """Slide by 1 m in 2 s and stand still: 6 d^2 / T^3 = 0.75, and no force at rest."""
    problem = pushed(20).but(
        parameters={"f": 0.0}, contacts=["rail:slip+"], sequence=["rail:stick"], final_time=2
    )
    solution = answer_of(problem, "ipm", starts=1, verify=False)
    assert solution.cost == pytest.approx(0.75, rel=5e-3)
    assert solution.phases[1].tangential == pytest.approx(0.0, abs=1e-15)
    assert max(abs(v).max() for v in solution.multipliers.values()) < 100


@pytest.mark.parametrize("push", [(1.5, 2.0), (-2.0, -1.5)])
def test_sticking_holds_what_the_cone_does_to_either_side(push: tuple[float, float]) -> None:
    """Friction holds 1 N."""
    block = pushed(10).but(goal={"x": 0}, contacts=["rail:stick"], sequence=[])
    held = dmoc.solve(block.but(bounds={"u": push}), "ipm", starts=1)
    assert held.status == "infeasible"
    weaker = tuple(u / 2 for u in push)
    assert dmoc.solve(block.but(bounds={"u": weaker}), "ipm", starts=1, verify=False).solved


@pytest.mark.slow
def test_momenta_at_the_nodes_go_along_the_contacts() -> None:
    """On a slope that bends, and to the last node, where the force is the weight and what the
    curve asks for: N = m (g + y'' v^2) / sqrt(1 + y'^2) at constant v."""
    x, y, u = dynamicsymbols("x y u")
    bent = dmoc.MechanicalSystem(
        "bent_slope", [x, y], (x.diff() ** 2 + y.diff() ** 2) / 2 - 9.81 * y, {}, inputs=[u],
        forces={x: u}, cost=u**2, surfaces={"slope": y >= x**2 / 2},
    )  # fmt: skip
    problem = dmoc.Problem(
        bent, start={"x": 0, "y": 0, "x_dot": 1.0}, goal={"x": 0.8}, contacts=["slope"], steps=80,
        final_time=0.8,
    )  # fmt: skip
    solution = dmoc.solve(problem, "ipm", starts=1, verify=False)
    (phase,) = solution.phases
    slope = np.stack([phase.q[:, 0], -np.ones(len(phase.t))], axis=1)
    assert np.abs((slope * phase.v).sum(axis=1)).max() < 1e-12
    # The force along -grad g = (-x, 1), by Newton: y'' = x'^2 + x x''.
    a = np.gradient(phase.v[:, 0], phase.t, edge_order=2)
    force = 9.81 + phase.v[:, 0] ** 2 + phase.q[:, 0] * a
    assert phase.normal[-1, 0] == pytest.approx(force[-1], rel=5e-3)
    assert phase.normal[0, 0] == pytest.approx(force[0], rel=5e-3)


@pytest.mark.slow
def test_a_block_that_slides_to_rest_has_its_speed_at_every_node() -> None:
    """From 1 m/s under 1 N of friction: v = 1 - t, at both ends too."""
    block = pushed(5).but(
        start={"x": 0, "x_dot": 1.0}, goal={"x": 0.5}, contacts=["rail:slip+"], sequence=[],
        final_time=1.0,
    )  # fmt: skip
    (phase,) = dmoc.solve(block, "ipm", starts=1, verify=False).phases
    np.testing.assert_allclose(phase.v[:, 0], 1 - phase.t, atol=1e-9)


@pytest.mark.parametrize(("nodes", "ends"), [(4, (9.0, 9.0)), (5, (1.0, 5.0)), (7, (1.0, 7.0))])
def test_forces_at_the_ends_of_a_phase_are_those_beside_them_continued(
    nodes: int, ends: tuple[float, float]
) -> None:
    forces = np.arange(1.0, nodes + 1)[:, None]
    forces[[0, -1]] = 9.0  # impulses by half the time
    assert tuple(_continued(forces)[[0, -1], 0]) == ends


@pytest.mark.slow
def test_the_upper_end_of_a_periodic_range_holds() -> None:
    """Further costs less: a motion at constant speed, no input, x(T) - x(0) = 0.4 at most."""
    x, u = dynamicsymbols("x u")
    system = unit_mass("further", cost=u**2 - x.diff())
    problem = dmoc.Problem(
        system, start={"x": 0}, periodic={"x": ("x", (0.1, 0.4)), "x_dot": "x_dot"}, steps=10,
        final_time=1,
    )  # fmt: skip
    solution = answer_of(problem, "ipm", starts=1)
    assert solution.phases[0].q[-1, 0] == pytest.approx(0.4, abs=1e-9)
    assert solution.cost == pytest.approx(-0.4, rel=1e-9)


@pytest.mark.parametrize("second", [1.0, 60.0])
def test_the_time_that_a_statement_says_is_one_in_any_unit(second: float) -> None:
    """A block under a constant force, at rest: sqrt(2 s / a)."""
    from dmoc.guess.automatic import natural_time

    x, g = dynamicsymbols("x"), sp.Symbol("g")
    system = dmoc.MechanicalSystem("falls_down", [x], x.diff() ** 2 / 2 + g * x, {g: 2.0})
    problem = dmoc.Problem(
        system, start={"x": 0}, goal={"x": 3}, steps=5, parameters={"g": 2.0 / second**2}
    )
    assert natural_time(problem) == pytest.approx(second * 3**0.5, rel=1e-12)
