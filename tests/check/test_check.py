"""The independent check: it confirms what is right, contradicts what is wrong, and its errors
fall as h^2."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import block_and_wall
import numpy as np
import pytest
from answers import answer_of
from systems import there_and_back

import dmoc
from dmoc.base.errors import SimulationError
from dmoc.codegen.kernels import Kernels
from dmoc.motion.trajectory import Trajectory

pytestmark = pytest.mark.slow


def test_errors_fall_as_the_square_of_the_step(seed: dmoc.Problem) -> None:
    """Terminal error, segments, energy: order 2; a single step: order 3."""
    checks = [dmoc.solve(seed.but(steps=n), "ipm", verify=False).verify() for n in (100, 200, 400)]
    for value, order, slack in (
        (lambda c: c.terminal_error, 2, 0.35),
        (lambda c: c.segment_defects.max(), 2, 0.1),
        (lambda c: np.median(c.segment_defects), 2, 0.1),
        (lambda c: c.energy_error, 2, 0.3),
        (lambda c: c.max_defect, 3, 0.1),
    ):
        rates = np.log2([value(a) / value(b) for a, b in pairwise(checks)])
        assert rates == pytest.approx([order] * 2, abs=slack)


def test_a_planned_collision_is_met(solution: dmoc.Solution) -> None:
    check = solution.verify()
    assert check.passed and not check.message
    (contact,) = check.contacts
    assert contact.surface == "lower" and contact.time == pytest.approx(
        solution.collisions[0].time, abs=1e-5
    )
    assert check.penetration < 1e-6


def changed(trajectory: Trajectory, phase: int, **arrays: np.ndarray) -> Trajectory:
    phases = list(trajectory.phases)
    phases[phase] = replace(phases[phase], **arrays)
    return replace(trajectory, phases=tuple(phases))


def test_wrong_motions_are_contradicted(solution: dmoc.Solution, pendulum: Kernels) -> None:
    good = solution.trajectory
    _, after = good.phases
    cases = {
        "weaker inputs": changed(good, 1, u=0.9 * after.u),
        "a node moved": changed(good, 1, q=after.q + 0.05 * (np.arange(101) == 50)[:, None]),
        "another mass": replace(good, parameters={**good.parameters, "m_c": 1.2}),
        "no impulse": changed(
            good,
            1,
            p=after.p - (good.collisions[0].momentum_after - good.collisions[0].momentum_before),
        ),
        "another goal": changed(good, 1, q=after.q + np.linspace(0, 1, 101)[:, None]),
    }
    assert dmoc.verify(good, pendulum).passed
    for what, wrong in cases.items():
        check = dmoc.verify(wrong, pendulum)
        assert not check.passed and check.message, what


def test_missed_and_extra_contacts_are_named(
    solution: dmoc.Solution, pendulum: Kernels, seed: dmoc.Problem
) -> None:
    good = solution.trajectory
    missing = dmoc.verify(
        replace(good, collisions=(replace(good.collisions[0], surface="upper"),)), pendulum
    )
    assert (
        "the collision with 'upper'" in missing.missed_contacts[0]
        and "a contact with 'lower'" in missing.extra_contacts[0]
    )
    coarse = dmoc.solve(seed.but(steps=10), verify=False).verify()
    assert coarse.extra_contacts and not coarse.passed


def test_penetration_between_nodes_is_seen(puck: Kernels) -> None:
    """One long step over the edge of the post: both nodes are free, the way between them is not."""
    solution = dmoc.solve(
        dmoc.Problem(
            puck, start={"x": 0.0, "y": 0.0}, goal={"x": 2.0, "y": 0.0}, steps=2, final_time=1.0
        ),
        verify=False,
    )
    check = solution.verify()
    assert check.penetration > 1e-3 and not check.passed
    assert len(check.extra_contacts) == 1 and "a contact with 'post'" in check.extra_contacts[0]


def test_a_collision_exactly_at_a_node_is_met(block: Kernels) -> None:
    solution = answer_of(there_and_back(block, steps=50))
    assert solution.verification is not None
    assert solution.verification.terminal_error < 1e-9
    again = dmoc.Solution.from_bytes(solution.to_bytes()).verification
    assert again is not None and again.to_dict() == solution.verification.to_dict()
    assert again.contacts == solution.verification.contacts


@pytest.mark.parametrize("order", [2, 4])
def test_a_wrong_law_of_restitution_is_found(order: int) -> None:
    """The motion of a block that bounces with e = 0.8 does not pass as one of e = 0.7 or of an
    elastic one."""
    solution = answer_of(block_and_wall.problem(0.8, 50, order), "ipm")
    for e in (1.0, 0.7, 0.0):
        wrong = replace(solution.trajectory, restitution={"wall": e})
        assert not dmoc.verify(wrong, dmoc.build(block_and_wall.system(), order=order)).passed


def test_contact_that_lasts_after_a_plastic_impact() -> None:
    """The simulation meets the wall a little early and is pushed into it until the inputs turn:
    it rests there instead of bouncing for ever."""
    problem = block_and_wall.problem(0.0, 7)
    solution = dmoc.solve(problem, "ipm")
    late = solution.phases[0]
    pushed = replace(late, u=late.u + 0.2)
    check = dmoc.verify(
        replace(solution.trajectory, phases=(pushed, *solution.phases[1:])), problem.kernels
    )
    assert len(check.contacts) == 1 and np.isfinite(check.terminal_error)


def test_a_graze_is_no_contact_and_a_knock_is(block: Kernels) -> None:
    """A motion that would pass the wall by a hair touches it in the simulation; one that passes
    it clearly collides."""
    problem = dmoc.Problem(
        block, start={"x": 0.0}, goal={"x": 0.0, "x_dot": 0.0}, steps=40, final_time=2.0,
        parameters={"wall": 2.0},
    )  # fmt: skip
    solution = answer_of(
        problem.but(bounds={"x": (None, 1.0)}, goal={"x": 0.0, "x_dot": -2.0}, steps=400), "ipm"
    )
    top = max(float(p.q.max()) for p in solution.phases)
    for wall, passed in ((top - 1e-7, True), (top - 0.05, False)):
        nearer = replace(
            solution.trajectory, parameters=dict(solution.trajectory.parameters) | {"wall": wall}
        )
        assert (not dmoc.verify(nearer, block).extra_contacts) is passed


def test_kernels_of_another_model_are_refused(block: Kernels, puck: Kernels) -> None:
    solution = dmoc.solve(block_and_wall.problem(0.8, 10), "ipm")
    with pytest.raises(SimulationError, match="give those it was made with"):
        dmoc.verify(solution.trajectory, puck)


def test_a_collision_beside_its_surface_is_found() -> None:
    """A wall that stands 1 % nearer than planned: the motion cannot have collided where it says."""
    problem = block_and_wall.problem(0.8, 50)
    solution = dmoc.solve(problem, "ipm")
    nearer = replace(
        solution.trajectory, parameters=dict(solution.trajectory.parameters) | {"wall": 0.99}
    )
    check = dmoc.verify(nearer, problem.kernels)
    assert not check.passed and "the collision with 'wall' is 0.01 off it" in check.message


@pytest.mark.parametrize("name", ["q", "v", "u"])
@pytest.mark.parametrize("value", [np.nan, np.inf, 1e300])
def test_a_motion_with_a_number_that_is_none_is_refused(name: str, value: float) -> None:
    """An infinite amplification explains nothing."""
    problem = block_and_wall.problem(0.0, 50)
    solution = dmoc.solve(problem, "ipm")
    for row in (0, 10, -1):
        array = getattr(solution.phases[0], name).copy()
        array[row] = value
        wrong = changed(solution.trajectory, 0, **{name: array})
        assert not dmoc.verify(wrong, problem.kernels).passed
