"""Random motions through the collisions of a problem: what every one of them keeps."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

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
    assert off[(kind == DRIVEN) | (kind == IDLE)].max() < 1e-9
    assert min(np.median(off[kind == away]) for away in (LOOSE, STRAIGHT)) > 0.01
    idle = np.abs(x[:, lay.index_u]).max(axis=(1, 2)) == 0
    assert idle[(kind != DRIVEN) & (kind != SHAKEN)].all() and not idle[kind == DRIVEN].any()
    guess = initial_guesses(seed.but(steps=10))[0].x
    assert np.abs(x[kind == SHAKEN][0, lay.index_q[0]] - guess[lay.index_q[0]]).max() < 1e-12


def test_straight_ones_have_lines_through_places_beside_the_surfaces(seed: dmoc.Problem) -> None:
    """q = q0 + s (q1 - q0) in each phase, with velocities that obey the law of impact."""
    problem = seed.but(steps=10, restitution=0.7)
    lay, x = motions(problem, 200)
    x = x[kinds_of(range(200)) == STRAIGHT]
    q = x[:, lay.index_q]
    for first, last in pairwise(lay.ends):
        part = q[:, first : last + 1]
        line = part[:, :1] + np.linspace(0, 1, 11)[:, None] * (part[:, -1:] - part[:, :1])
        assert part == pytest.approx(line, abs=1e-9 * float(np.abs(q).max()))
    (node,), (j,) = lay.collision_nodes, lay.touch.surfaces
    before, after = (
        problem.model.gap_rates(q[:, node], v[:, 0])[:, j]
        for v in (x[:, lay.impact.v_a], x[:, lay.impact.v_c])
    )
    assert after == pytest.approx(-0.7 * before) and before.min() > 0


def test_light_links_swing_far_in_straight_ones() -> None:
    """A hanging arm with inertias 5 and 1 about its joints that goes 0.5 and 0.1 rad: the places of
    the second joint are spread 5^(1/2) times as far as those of the first."""
    a, b, u = dynamicsymbols("a b u")
    x, y = sp.sin(a) + sp.sin(a + b), -sp.cos(a) - sp.cos(a + b)
    T = dynamicsymbols._t
    kinetic = (a.diff(T) ** 2 + x.diff(T) ** 2 + y.diff(T) ** 2) / 2
    system = dmoc.MechanicalSystem(
        "light_link", [a, b], kinetic, inputs=[u], forces={b: u}, cost=u**2,
        surfaces={"wall": x <= 0.2},
    )  # fmt: skip
    problem = dmoc.Problem(
        system, {"a": 0.0, "b": 0.0}, {"a": -0.5, "b": 0.1}, ["wall"], 4, restitution=1.0,
        final_time=1.0,
    )  # fmt: skip
    assert problem.spread == pytest.approx([0.5, 0.5 * 5**0.5])
    lay, x = motions(problem, 800)
    q = x[kinds_of(range(800)) == STRAIGHT][:, lay.index_q]
    low, high = np.percentile(q[:, lay.collision_nodes[0]], [25, 75], axis=0)
    ways = high - low
    assert ways[1] / ways[0] == pytest.approx(5**0.5, rel=0.3)


def test_straight_ones_have_one_bump_of_a_coordinate_or_none_where_there_are_no_hits(
    seed: dmoc.Problem,
) -> None:
    """q = q0 + s (q1 - q0) + 4 a s (1 - s) sin(pi s): what is left of the line has one sign, is
    symmetric in the phase, and is as often up as down or nothing."""
    problem = seed.but(steps=10, sequence=(), restitution=None)
    lay, x = motions(problem, 200)
    q = x[kinds_of(range(200)) == STRAIGHT][:, lay.index_q]
    s = np.arange(11) / 10
    line = q[:, :1] + s[:, None] * (q[:, -1:] - q[:, :1])
    bump = 4 * s * (1 - s) * np.sin(np.pi * s)
    assert q - line == pytest.approx(
        bump[:, None] * (q - line)[:, 5:6], abs=1e-9 * float(np.abs(q).max())
    )
    high = (q - line)[:, 5]
    signs = np.where(np.abs(high) < 1e-9, 0, np.sign(high))
    shares = [np.mean(signs == sign) for sign in (-1, 0, 1)]
    assert shares == pytest.approx([1 / 3] * 3, abs=0.12)


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
