"""Where nothing can be chosen, the guess is the simulation."""

from __future__ import annotations

import numpy as np
import pytest

import dmoc
from dmoc.guess.transfer import pieces_of
from dmoc.solving.only_motion import only_motion

START = {"q": dmoc.attitude((1, 0, 0, 0)), "q_omega_x": 0.1, "q_omega_y": 1.0, "q_omega_z": 0.1}


@pytest.fixture(scope="module")
def top() -> dmoc.Problem:
    world = dmoc.spatial.World()
    world.ball("q", inertia=(1, 2, 3))
    kernels = dmoc.build(world.system("top", cost=0), order=4)
    return dmoc.Problem(kernels, START, steps=100, final_time=10.0)


def test_a_body_that_turns_over_is_solved_from_one_start(top: dmoc.Problem) -> None:
    """From a straight way the iterations run out."""
    solution = dmoc.solve(top, "ipm", starts=1)
    assert solution.status == "solved" and solution.iterations < 10
    run = dmoc.simulate(top.kernels, START["q"].quaternion, {
        name: value for name, value in START.items() if name != "q"
    }, step_size=0.1, steps=100)  # fmt: skip
    np.testing.assert_allclose(solution.phases[0].q, run.q, atol=1e-3)
    assert len(pieces_of(solution.trajectory)) == 1


def test_there_is_one_motion_only_where_nothing_is_chosen(
    top: dmoc.Problem, block: dmoc.codegen.kernels.Kernels
) -> None:
    assert only_motion(top) is not None
    assert only_motion(top.but(final_time=(1, 10))) is None
    assert only_motion(top.but(start={"q": START["q"], "q_omega_x": (0, 1)})) is None
    pushed = dmoc.Problem(block, start={"x": 0.0}, goal={"x": 0.5}, steps=3, final_time=1.0)
    assert only_motion(pushed) is None
