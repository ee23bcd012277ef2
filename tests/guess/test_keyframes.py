"""A user's own guess by name: courses where they were asked for, the automatic guess elsewhere, and
one sentence for what does not fit."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp
from answers import answer_of
from sympy.physics.mechanics import dynamicsymbols
from systems import driven_system, landing_problem

import dmoc
from dmoc.base.errors import ProblemError
from dmoc.codegen.kernels import Array
from dmoc.guess.automatic import initial_guesses
from dmoc.guess.keyframes import along, courses_of, with_design
from dmoc.program.layout import Layout


@pytest.fixture
def small(seed: dmoc.Problem) -> dmoc.Problem:
    return seed.but(steps=(8, 12))


def unknowns(problem: dmoc.Problem, guess: Any) -> tuple[Layout, Array, Array]:
    """The layout, the unknowns along a guess by name, and those of the automatic guess."""
    automatic = initial_guesses(problem)[0].x
    return Layout.of(problem), along(problem, courses_of(problem, guess), automatic), automatic


def test_keyframes_are_spread_evenly_over_the_whole_motion(small: dmoc.Problem) -> None:
    frames, durations = [0.4, 1.0, 0.2, 0.7], [0.6, 0.3]
    guess = {"x": frames, "F": [3.0, -3.0, 0.0], "durations": durations}
    lay, x, _ = unknowns(small, guess)
    t, q, u = lay.times(x), x[lay.index_q], x[lay.index_u][:, 0]
    assert t[[8, -1]] == pytest.approx([0.6, 0.9])
    assert q[[0, 4, 8, -1], 1] == pytest.approx(frames)  # nodes at 0, 0.3, 0.6 and 0.9 s
    # Cubics that do not overshoot.
    assert (np.diff(q[:5, 1]) > 0).all()
    assert (np.diff(q[4:9, 1]) < 0).all()
    middles = (t[:-1] + t[1:]) / 2
    np.testing.assert_allclose(u, np.interp(middles, [0, 0.45, 0.9], [3.0, -3.0, 0.0]))


def test_what_is_not_named_is_that_of_the_automatic_guess(small: dmoc.Problem) -> None:
    lay, x, automatic = unknowns(small, {"F": 2.5})
    np.testing.assert_array_equal(x[lay.index_u], 2.5)
    for index in (lay.index_h, lay.index_q):
        np.testing.assert_array_equal(x[index], automatic[index])


def test_functions_get_the_times_of_the_motion(small: dmoc.Problem) -> None:
    guess = [{"F": lambda t: 10 * t}, {"alpha": lambda t: np.sin(t), "durations": 0.4}]
    lay, x, automatic = unknowns(small, guess)
    t, q = lay.times(x), x[lay.index_q]
    assert t[-1] - t[8] == pytest.approx(0.4)
    np.testing.assert_allclose(q[8:, 0], np.sin(t[8:]))
    np.testing.assert_array_equal(q[:8, 0], automatic[lay.index_q][:8, 0])
    u = x[lay.index_u][:, 0]
    np.testing.assert_allclose(u[:8], 10 * (t[:8] + t[1:9]) / 2)
    np.testing.assert_array_equal(u[8:], automatic[lay.index_u][8:, 0])


def test_where_two_phases_meet_the_earlier_one_that_names_a_coordinate_counts(
    small: dmoc.Problem,
) -> None:
    lay, x, _ = unknowns(small, [{"x": [0.0, 1.0]}, {"x": [2.0, 3.0]}])
    q = x[lay.index_q][:, 1]
    assert q[[0, 8, -1]] == pytest.approx([0.0, 1.0, 3.0])
    assert q[9] == pytest.approx(2.0 + 1 / 12)


def test_velocities_and_impulses_follow_from_the_motion(small: dmoc.Problem) -> None:
    """The law of impact, n = (1, 0) at a limiter: M (v_c - v_a) is along the gradient of the
    gap, and the rates of the angle are opposite."""
    guess = {"alpha": [0.47, 0.3, 1.57], "x": [0.0, 0.2, 0.1], "durations": [0.2, 0.2]}
    lay, x, _ = unknowns(small, guess)
    q, h = x[lay.index_q], x[lay.index_h]
    v_a, v_c, impulse = x[lay.impact.v_a][0], x[lay.impact.v_c][0], x[lay.impact.lam][0]
    np.testing.assert_allclose(v_a, (q[8] - q[7]) / h[0])
    assert v_c[0] == pytest.approx(-v_a[0])
    jump = small.model.mass(q[8]) @ (v_c - v_a)
    assert jump == pytest.approx([impulse, 0.0], abs=1e-12)
    assert impulse > 0
    assert x[lay.index_p_B] == pytest.approx(small.model.mass(q[0]) @ ((q[1] - q[0]) / h[0]))


@pytest.mark.parametrize("order", [2, 4])
def test_times_and_inner_nodes_of_a_driven_model_follow(order: int) -> None:
    problem = dmoc.Problem(
        dmoc.build(driven_system(), order=order, backend="numpy"), start={"a": 0.2, "z": 0.0},
        goal={"a": 1.0}, steps=6, final_time=(0.5, 2.0),
    )  # fmt: skip
    lay, x, _ = unknowns(problem, {"a": [0.2, 1.0], "durations": 1.5, sp.Symbol("u"): [1, 2]})
    np.testing.assert_allclose(x[lay.index_t], np.linspace(0, 1.5, 7))
    if lay.inside:
        nodes = x[lay.index_q][:, 0]
        np.testing.assert_allclose(x[lay.index_q_i][:, 0], (nodes[:-1] + nodes[1:]) / 2)
    times = lay.form.times(np.linspace(0, 1.5, 7))
    np.testing.assert_allclose(x[lay.index_u][:, 0], 1 + times / 1.5, atol=1e-5)


def test_a_solve_starts_from_names_and_from_a_file(small: dmoc.Problem, tmp_path: Path) -> None:
    guess = {"x": [0.0, 0.5, 0.3], "F": lambda t: 0 * t}
    named = answer_of(small, "ipm", guess=guess, verify=False)
    path = named.save(tmp_path / "known.npz")
    for file in (path, str(path)):
        again = answer_of(small, "ipm", guess=file, verify=False)
        assert again.cost == pytest.approx(named.cost, rel=1e-8)
        assert again.iterations < named.iterations


@pytest.mark.slow
def test_keyframes_come_down_on_contacts_that_last() -> None:
    """From the landing on the puck stays on the floor, pushed with 10 N times the step; what
    sticks does not slide."""
    problem = landing_problem()
    lay, x, _ = unknowns(problem, {"x": [0.0, 0.5], "y": [0.2, 0.1], "durations": [0.2, 0.8, 0.5]})
    q, landing, sticking = x[lay.index_q], *lay.collision_nodes
    assert np.abs(q[landing:, 1]).max() < 1e-12
    assert np.ptp(q[sticking:-1, 0]) < 1e-12  # the goal is fixed
    pushed = x[lay.reactions(2)[0].unknowns[:, 0]]
    assert pushed[2:-2] == pytest.approx(10.0 * 0.5 / 8)
    # The landing takes the rate of the way to it, and keeps nothing of it.
    assert x[lay.impact.lam[0]] == pytest.approx(-x[lay.impact.v_a[0, 1]])
    assert x[lay.impact.v_c[0, 1]] == pytest.approx(0.0, abs=1e-12)
    assert x[lay.impact.lam[1]] == 0.0


def test_a_guess_of_a_design_alone_leaves_the_automatic_motion() -> None:
    """Values at both ends of a range are within; what else is named goes on."""
    x, k = dynamicsymbols("x"), sp.Symbol("k")
    spring = dmoc.MechanicalSystem("spring", [x], x.diff() ** 2 / 2 - k * x**2 / 2, {k: 2.0})
    problem = dmoc.Problem(
        spring, start={"x": 1.0}, goal={"x": 0.0}, design={"k": (1.0, 4.0)}, steps=4,
        final_time=1.0,
    )  # fmt: skip
    for value in (1.0, 3.0, 4.0):
        guess = {"k": value}
        chosen, rest = with_design(problem, guess)
        assert chosen.design_values.tolist() == [value] and rest is None and guess
    chosen, rest = with_design(problem, {"x": [1.0, 0.5], "k": 3.0})
    assert chosen.design_values.tolist() == [3.0] and rest == {"x": [1.0, 0.5]}
    for guess in ({"x": [1.0, 0.5]}, None):
        assert with_design(problem, guess) == (problem, guess)
    for value in (0.99, 4.01):
        with pytest.raises(ProblemError, match=r"k = .* lies outside its range 1 to 4"):
            with_design(problem, {"k": value})
