"""Random motions through the collisions of a problem: what every one of them keeps."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.guess.automatic import initial_guesses
from dmoc.guess.random_motions import (
    DRIVEN,
    IDLE,
    LOOSE,
    SHAKEN,
    STRAIGHT,
    kinds_of,
    random_motions,
)
from dmoc.problem.problem import Problem
from dmoc.program.layout import Layout


def motions(problem: Problem, count: int = 40, seed: int = 0) -> tuple[Layout, np.ndarray]:
    guesses = [g.x for g in initial_guesses(problem)]
    return Layout.of(problem), random_motions(problem, guesses, 1.0, range(count), seed)


def test_they_lie_on_their_surfaces_and_obey_the_law_of_impact(seed: dmoc.Problem) -> None:
    problem = seed.but(sequence=("lower", "upper", "lower"), restitution=0.7, steps=8)
    lay, x = motions(problem)
    kind = kinds_of(range(len(x)))
    x = x[(kind == DRIVEN) | (kind == IDLE)]
    for i, node in enumerate(lay.collision_nodes):
        j = int(lay.touch.surfaces[i])
        q, before, after = x[:, lay.index_q[node]], x[:, lay.impact.v_a[i]], x[:, lay.impact.v_c[i]]
        assert np.abs(problem.model.gaps(q)[:, j]).max() < 1e-9
        rates = [problem.model.gap_rates(q, v)[:, j] for v in (before, after)]
        assert (rates[0] > 0).all()
        assert rates[1] == pytest.approx(-0.7 * rates[0])
        jump = problem.model.momentum(q, after) - problem.model.momentum(q, before)
        slope = problem.model.gap_slopes(q)[:, j, :-1]
        assert jump == pytest.approx(-x[:, lay.impact.lam[i], None] * slope, abs=1e-9)


def test_they_keep_ends_times_and_inputs(seed: dmoc.Problem) -> None:
    lay, x = motions(seed.but(steps=(6, 9)))
    start, goal = seed.start_bounds.position, seed.goal_bounds.position
    assert x[:, lay.index_q[0]] == pytest.approx(np.tile(start[:, 0], (len(x), 1)))
    fixed = goal[:, 0] == goal[:, 1]
    assert x[:, lay.index_q[-1][fixed]] == pytest.approx(np.tile(goal[fixed, 0], (len(x), 1)))
    assert ((x[:, lay.index_h] @ np.array(lay.steps)) <= 1.0 + 1e-12).all()
    assert (np.abs(x[:, lay.index_u]) <= 200.0).all()
    assert np.isfinite(x).all()


def test_a_number_is_a_motion_however_many_there_are(seed: dmoc.Problem) -> None:
    few = random_motions(seed, [], 1.0, range(3, 5), 7)
    assert (few == random_motions(seed, [], 1.0, range(8), 7)[3:5]).all()
    assert not np.allclose(few, random_motions(seed, [], 1.0, range(3, 5), 8))


def test_the_kinds_differ_in_what_they_keep(seed: dmoc.Problem) -> None:
    lay, x = motions(seed.but(steps=10))
    kind = kinds_of(range(len(x)))
    (node,), (j,) = lay.collision_nodes, lay.touch.surfaces
    off = np.abs(seed.model.gaps(x[:, lay.index_q[node]])[:, j])
    assert off[(kind == DRIVEN) | (kind == IDLE) | (kind == STRAIGHT)].max() < 1e-9
    assert np.median(off[kind == LOOSE]) > 0.01
    idle = np.abs(x[:, lay.index_u]).max(axis=(1, 2)) == 0
    assert idle[(kind != DRIVEN) & (kind != SHAKEN)].all() and not idle[kind == DRIVEN].any()
    guess = initial_guesses(seed.but(steps=10))[0].x
    assert np.abs(x[kind == SHAKEN][0, lay.index_q[0]] - guess[lay.index_q[0]]).max() < 1e-12


def test_straight_ones_have_one_bump_of_a_coordinate_in_a_phase_or_none(
    seed: dmoc.Problem,
) -> None:
    """q = q0 + s (q1 - q0) + 4 a s (1 - s) sin(pi s): what is left of the line has one sign, is
    symmetric in the phase, and is as often up as down or nothing."""
    problem = seed.but(steps=10)
    lay, x = motions(problem, 200)
    q = x[kinds_of(range(200)) == STRAIGHT][:, lay.index_q]
    s = np.arange(11) / 10
    signs = []
    for first, last in pairwise(lay.ends):
        part = q[:, first : last + 1]
        line = part[:, :1] + s[:, None] * (part[:, -1:] - part[:, :1])
        bump = 4 * s * (1 - s) * np.sin(np.pi * s)
        assert part - line == pytest.approx(
            bump[:, None] * (part - line)[:, 5:6], abs=1e-9 * float(np.abs(q).max())
        )
        high = (part - line)[:, 5]
        signs.append(np.where(np.abs(high) < 1e-9, 0, np.sign(high)))
    shares = [np.mean(np.array(signs) == sign) for sign in (-1, 0, 1)]
    assert shares == pytest.approx([1 / 3] * 3, abs=0.08)


def test_inputs_are_those_of_the_equations_of_motion(block: Kernels) -> None:
    """A block that is pushed along a line: u = m q''."""
    problem = dmoc.Problem(block, start={"x": 0.0}, goal={"x": 0.5, "x_dot": 0.0}, steps=200)
    lay, x = motions(problem, 20)
    x = x[kinds_of(range(20)) == DRIVEN]
    h = x[:, lay.index_h]
    q = x[:, lay.index_q[:, 0]]
    bend = (q[:, 2:] - 2 * q[:, 1:-1] + q[:, :-2]) / h**2
    mass = float(problem.model.mass(problem.start_position)[0, 0])
    u = x[:, lay.index_u[:, 0]]
    middle = (u[:, 1:] + u[:, :-1]) / 2
    assert middle == pytest.approx(mass * bend, rel=2e-2, abs=2e-2 * np.abs(mass * bend).max())


@pytest.mark.slow
@pytest.mark.parametrize("order", [4, 6])
def test_inner_nodes_lie_on_the_way(order: int) -> None:
    kernels = dmoc.load("cart_pendulum", order=order)
    problem = dmoc.Problem(
        kernels, start={"alpha": 0.5, "x": 0.0}, goal={"alpha": 1.5}, steps=40, final_time=1.0,
    )  # fmt: skip
    lay, x = motions(problem, 10)
    q = x[:, lay.index_q]
    inside = x[:, lay.index_q_i].reshape(len(x), 40, -1, 2)
    straight = (q[:, :-1] + q[:, 1:]) / 2
    assert np.abs(inside.mean(axis=2) - straight).max() < 0.05
