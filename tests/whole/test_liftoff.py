"""When contacts leave, beside closed forms, a quadrature and SciPy."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from answers import answer_of
from liftoff_problems import (
    G,
    Stated,
    corners,
    joined_loop,
    loop,
    problem_of,
    ramp,
    road,
    shaken,
    sliding_ramp,
    spring_lift,
    two_blocks,
)

import dmoc


def late(solution: dmoc.Solution, when: float) -> float:
    return solution.collisions[0].time - when


@pytest.mark.parametrize(("order", "finest"), [(2, 5e-5), (4, 1e-9), (6, 1e-13)])
def test_a_ball_leaves_a_loop_with_the_order_of_the_steps(order: int, finest: float) -> None:
    meshes = (20, 40, 80) if order < 6 else (5, 10, 20)
    errors = [
        abs(late(answer_of(problem, "ipm", starts=1), when))
        for problem, when in (problem_of(loop, steps, order) for steps in meshes)
    ]
    rates = [np.log2(a / b) for a, b in pairwise(errors)]
    assert np.allclose(rates, order, atol=0.1), errors
    assert errors[-1] < finest or order == 6


@pytest.mark.slow
@pytest.mark.parametrize("order", [2, 4])
def test_joined_balls_leave_as_one(order: int) -> None:
    times = [
        answer_of(problem_of(stated, 40, order)[0], "ipm").collisions[0].time
        for stated in (loop, joined_loop)
    ]
    assert times[0] == pytest.approx(times[1], abs=1e-9)


@pytest.mark.parametrize(
    ("stated", "order"), [(ramp, 2), (sliding_ramp, 4), (corners, 2), (corners, 4), (shaken, 4)]
)
def test_what_the_time_alone_lifts_leaves_at_its_time(
    stated: Callable[[], Stated], order: int
) -> None:
    problem, when = problem_of(stated, 20, order)
    assert late(answer_of(problem, "ipm"), when) == pytest.approx(0, abs=1e-9)


def test_the_first_gap_after_the_event_may_have_the_sign_of_an_error() -> None:
    errors, gaps = [], []
    for steps in (20, 40, 80):
        problem, when = problem_of(road, steps, 2)
        solution = answer_of(problem, "ipm")
        errors.append(abs(late(solution, when)))
        x, y = solution.phases[1].q[1]
        gaps.append(float(y + 5 * x**3))
    assert max(gaps) < 0
    assert all(3.7 < a / b < 4.3 for a, b in pairwise(errors)), errors
    assert all(7 < a / b < 9 for a, b in pairwise(gaps)), gaps


@pytest.mark.parametrize("order", [2, 4])
def test_a_spring_that_a_drive_pulls_lifts_with_the_weight(order: int) -> None:
    solution = answer_of(spring_lift(80, order), "ipm")
    assert solution.collisions[0].position[1] == pytest.approx(G / 200, abs=1e-10)


def test_contacts_that_cannot_leave_at_once_say_how_they_would_pull() -> None:
    solution = dmoc.solve(problem_of(two_blocks, 20, 2)[0], "ipm", starts=1)
    assert solution.status == "infeasible"
    assert "two would have to pull with" in solution.message
