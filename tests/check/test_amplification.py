"""The linearised flow of a motion: how much it amplifies errors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import sympy as sp
from flights import flight, one
from joint_problems import bob
from sympy.physics.mechanics import dynamicsymbols
from systems import block_system

import dmoc
from dmoc.base.deadline import ENDLESS
from dmoc.check import compiled
from dmoc.check import segments as segments_module
from dmoc.check.amplification import carried
from dmoc.check.check import judged_by_steps
from dmoc.check.checked_motion import Motion
from dmoc.check.segments import segments
from dmoc.codegen.kernels import Kernels
from dmoc.models.registry import find


@pytest.mark.slow
def test_a_force_without_a_slope_where_a_motion_starts_is_differenced() -> None:
    """A spring with a force r^2 at the distance r, where a mass starts: r x is differentiated to
    0/0 there."""
    x, y, f, g = dynamicsymbols("x y f g")
    distance = sp.sqrt(x**2 + y**2)
    system = dmoc.MechanicalSystem(
        "sprung", [x, y], (x.diff() ** 2 + y.diff() ** 2) / 2, {}, [f, g],
        {x: f - distance * x, y: g - distance * y}, cost=f**2 + g**2,
    )  # fmt: skip
    problem = dmoc.Problem(
        dmoc.build(system), start={"x": 0, "y": 0}, goal={"x": 1, "y": 0.5}, steps=40,
        final_time=1.0,
    )  # fmt: skip
    solution = dmoc.solve(problem, "ipm")
    (phase,) = solution.phases
    at_rest = replace(phase, v=np.vstack([[0.0, 0.0], phase.v[1:]]))
    motion = Motion.of(replace(solution.trajectory, phases=(at_rest,)), problem.kernels, ENDLESS)
    parts = segments(motion)
    start = np.hstack([at_rest.q[:1], at_rest.v[:1], np.eye(4).reshape(1, 16)])
    motion.flow.advance(start, motion.steps[0], np.array([0]), np.array([4]))
    assert not np.isfinite(start[0, 4:]).all()
    amplified = carried(motion, parts).amplification
    assert amplified == pytest.approx(solution.verify().amplification, rel=1e-5)


def test_the_amplification_of_a_free_mass_is_known() -> None:
    """q' = v: the flow over a time s is (1, s; 0, 1) in units, whose largest norm is that of the
    whole motion."""
    kernels = dmoc.build(block_system())
    problem = dmoc.Problem(
        kernels, start={"x": 0}, goal={"x": 0.5, "x_dot": 0}, steps=30, final_time=1.0
    )
    solution = dmoc.solve(problem, "ipm")
    motion = Motion.of(solution.trajectory, kernels, ENDLESS)
    ratio = motion.sizes.v[0] / motion.sizes.q[0]
    norm = np.linalg.norm(np.array([[1, ratio], [0, 1]]), 2)
    assert solution.verify().amplification == pytest.approx(norm, rel=1e-9)


@pytest.mark.parametrize("steps", [5, 40])
def test_a_coarse_integration_of_neighbours_serves_where_it_gets_to_the_same_ends(
    steps: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neighbours in a mode are followed by the classical method, unless its steps are too long."""
    problem = dmoc.Problem(
        dmoc.build(bob()), start={"x": 0, "y": -1}, goal={"x": 0.6, "y": -0.8}, steps=steps,
        final_time=2.0,
    )  # fmt: skip
    solution = dmoc.solve(problem, "ipm", starts=1, verify=False)
    motion = Motion.of(solution.trajectory, problem.kernels, ENDLESS)

    def slopes(limit: float) -> np.ndarray:
        monkeypatch.setattr(segments_module, "COARSE", limit)
        return segments(motion).slope

    usual = segments_module.COARSE
    fine, coarse, chosen = slopes(-1.0), slopes(np.inf), slopes(usual)
    off = np.abs(coarse - fine).max() / np.abs(fine).max()
    assert (off > 1e-2) == (steps == 5)
    np.testing.assert_array_equal(chosen, fine if steps == 5 else coarse)


def test_a_hit_of_a_wall_that_speeds_up_has_its_saltation_matrix() -> None:
    """A ball on a floor at f(t): v+ = -e v- + (1 + e) f', met later by dq / (f' - v-)."""
    q, t, e, g = dynamicsymbols("q"), dynamicsymbols._t, 0.8, 9.81
    ball = dmoc.MechanicalSystem(
        "ball_on_a_lift", [q], q.diff() ** 2 / 2 - g * q, cost=1,
        surfaces={"floor": q >= t / 2 + 3 * t**2},
    )  # fmt: skip
    problem = dmoc.Problem(
        dmoc.build(ball), start={"q": 1, "q_dot": 0}, sequence=["floor"], restitution=e, steps=20,
        final_time=0.6,
    )  # fmt: skip
    solution = dmoc.solve(problem, "ipm", starts=1, verify=False)
    motion = Motion.of(solution.trajectory, problem.kernels, ENDLESS)
    (hit,), v = solution.collisions, solution.phases[0].v[-1, 0]
    rate = 0.5 + 6 * hit.time - v
    expected = np.array([[-e, 0], [((1 + e) * (6 + g)) / rate, -e]])
    passage = replace(motion.passages[0], sizes=np.ones(2))
    np.testing.assert_allclose(passage.slope, expected, rtol=1e-5, atol=1e-7)


@pytest.mark.parametrize("node", [16, 18])
def test_errors_before_a_hit_are_carried_through_it(cube: Kernels, node: int) -> None:
    """A velocity off by 0.01 at a node before a hit that leaves half of it: the segments that end
    and that begin there are off, and a second later each by half of what it is at the hit."""
    bounced = replace(flight(cube, (-0.5, 0.5, 0.5)), restitution={"wall": 0.5})
    motion = Motion.of(one(0, node, 0.01, "v")(bounced), cube, ENDLESS)
    deviations = carried(motion, segments(motion)).deviations
    before = (20 - node) * 0.05  # the time until the hit
    at_hit = [0.01 * before, 0.01 * 0.1 + 0.01 * (before - 0.1)]
    np.testing.assert_allclose(deviations[9, 0], sum(at_hit), rtol=1e-6)
    np.testing.assert_allclose(deviations[-1, 0], 0.5 * (deviations[9, 0] + 0.02), rtol=1e-6)
    np.testing.assert_allclose(deviations[-1, 1:3], 0.0, atol=1e-9)


def test_a_coarse_linearised_flow_serves_where_it_gets_to_the_same_ends(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """On a mesh of long steps it does not, and both checks see that."""
    reference = find("cart_pendulum")
    problem = dmoc.Problem(reference.kernels(6), **{**reference.defaults, "steps": 10})
    trajectory = dmoc.solve(problem, "ipm", starts=1, verify=False).trajectory
    quick = compiled.passing(trajectory, problem.kernels, ENDLESS)
    slow = judged_by_steps(trajectory, problem.kernels, ENDLESS)
    monkeypatch.setattr(segments_module, "NEAR", 0.0)
    fine = judged_by_steps(trajectory, problem.kernels, ENDLESS)
    monkeypatch.setattr(segments_module, "NEAR", 1.0)
    coarse = judged_by_steps(trajectory, problem.kernels, ENDLESS)
    assert quick is not None
    assert quick.amplification == pytest.approx(slow.amplification, rel=1e-9)
    assert slow.amplification == pytest.approx(fine.amplification, rel=1e-4)
    assert coarse.amplification != pytest.approx(fine.amplification, rel=1e-3)
