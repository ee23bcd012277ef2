"""The judge of the campaign with contacts: it agrees with closed forms, and what is wrong with a
motion it says."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from campaign import Result, system_of
from campaign_kinds import Instance
from contact_campaign import draw, judge
from contact_driven import ContactMechanism, Run, Sizes
from contact_kinds import bar, block_on
from hit_problems import RODS

import dmoc

ONE = np.ones(1)
PAR = np.array([1.0, 10.0, 0.1])  # m, g, mu: 1 N of friction


def run(u: list[float], v: list[float], y: float = 0.0, e: float = 0.0) -> Run:
    """A block on a floor for four seconds; the force is linear between values a second apart."""
    forces = np.array(u)[:, None]
    inputs = np.linspace(0.0, 4.0, 5), forces[:-1], forces[1:]
    sizes = Sizes(ONE, ONE, ONE, 4.0)
    return ContactMechanism(block_on(False)).run(
        inputs, 0.0, 4.0, np.array([0.0, y]), np.array(v), PAR, sizes, [e], lambda j, t: False
    )


def test_a_block_slides_to_rest_and_stays() -> None:
    ended = run([0.0] * 5, [2.0, 0.0])
    np.testing.assert_allclose([*ended.q, *ended.v], [2.0, 0.0, 0.0, 0.0], atol=1e-7)


def test_a_block_sticks_until_the_force_exceeds_friction() -> None:
    ended = run([0.0, 1.0, 2.0, 3.0, 4.0], [0.0, 0.0])  # from 1 s on it accelerates by t - 1
    np.testing.assert_allclose([*ended.q, *ended.v], [4.5, 0.0, 4.5, 0.0], atol=1e-7)


def test_a_block_that_falls_plastically_slides_on() -> None:
    ended = run([0.0] * 5, [2.0, 0.0], y=0.2)  # falls for 0.2 s, loses mu times its speed of 2
    np.testing.assert_allclose(ended.v, [0.0, 0.0], atol=1e-7)
    assert ended.q[0] == pytest.approx(2.0 * 0.2 + (2.0 - 0.2) ** 2 / 2, rel=1e-6)


@pytest.mark.parametrize(("angle", "v", "mu", "after", "normal", "tangential", "course"), RODS)
def test_a_rod_is_hit_by_poissons_law(
    angle: float, v: tuple[float, ...], mu: float, after: tuple[float, ...], normal: float,
    tangential: float, course: str,
) -> None:  # fmt: skip
    mechanism = ContactMechanism(bar())
    par = np.array([1.0, 0.5, 1 / 12, 10.0, mu])
    turn = np.radians(angle) if angle > 2 * np.pi else angle
    q = np.array([0.0, 0.5 * np.sin(turn), turn])
    sizes = Sizes(ONE, ONE, ONE, 1.0)
    outcome, *_ = mechanism.impacts([0], q, np.array(v), np.zeros(1), 0.0, par, sizes, [0.5])
    np.testing.assert_allclose(outcome.motion, after, atol=1e-8)
    assert outcome.normal[0] == pytest.approx(normal, abs=1e-8)
    assert outcome.tangential[0] == pytest.approx(tangential, abs=1e-8)


@pytest.fixture(scope="module")
def pushed() -> tuple[Instance, dmoc.Solution, ContactMechanism]:
    fields = {
        "start": {"x": 0.0, "y": 0.0},
        "goal": {"x": 1.0, "x_dot": 0.0},
        "contacts": ["floor"],
        "sequence": ["floor:slip+", "floor:stick"],
        "final_time": 4.0,
        "parameters": {"mu": 0.1, "g": 10.0},
    }
    instance = Instance(block_on(False), fields)
    kernels = dmoc.build(system_of(instance))
    solution = dmoc.solve(dmoc.Problem(kernels, steps=40, **fields), "ipm")  # type: ignore[arg-type]
    assert solution.solved, solution.message
    return instance, solution, ContactMechanism(instance.description)


def judged(instance: Instance, solution: dmoc.Solution, mechanism: ContactMechanism) -> list[str]:
    result = Result("pushed", 0, 2, "ipm", solution.status)
    judge(result, instance, solution, mechanism)
    return result.against


def test_a_right_motion_is_confirmed(
    pushed: tuple[Instance, dmoc.Solution, ContactMechanism],
) -> None:
    assert judged(*pushed) == []


def with_phase(solution: dmoc.Solution, number: int, **factors: float) -> dmoc.Solution:
    """The motion with arrays of a phase multiplied by factors."""
    phases = list(solution.phases)
    changed = {name: getattr(phases[number], name) * f for name, f in factors.items()}
    phases[number] = replace(phases[number], **changed)
    return replace(solution, trajectory=replace(solution.trajectory, phases=tuple(phases)))


def with_friction(solution: dmoc.Solution, mu: float) -> dmoc.Solution:
    parameters = {**solution.trajectory.parameters, "mu": mu}
    return replace(solution, trajectory=replace(solution.trajectory, parameters=parameters))


@pytest.mark.parametrize(
    ("wrong", "reason"),
    [
        (lambda s: with_phase(s, 1, tangential=1.1), "force"),
        (lambda s: with_phase(s, 1, tangential=-1.0), "force"),
        (lambda s: with_phase(s, 0, normal=0.9), "force"),
        (lambda s: with_phase(s, 1, u=1.1), "segment"),
        (lambda s: with_phase(s, 1, p=1.3), "segment"),
        (lambda s: with_phase(s, 2, q=1.01), "boundary"),
        (lambda s: with_friction(s, 0.15), "force"),
        (lambda s: with_friction(s, 0.05), "segment"),
        (lambda s: replace(s, cost=1.001 * s.cost), "cost"),
    ],
)
def test_a_wrong_motion_is_contradicted(
    pushed: tuple[Instance, dmoc.Solution, ContactMechanism],
    wrong: Callable[[dmoc.Solution], dmoc.Solution],
    reason: str,
) -> None:
    instance, solution, mechanism = pushed
    told: list[Any] = judged(instance, wrong(solution), mechanism)
    assert any(reason in said for said in told), told


@pytest.mark.slow
@pytest.mark.parametrize("number", [8, 18])
def test_a_leg_that_hangs_still_at_the_start_has_a_size(number: int) -> None:
    """A passive gait starts where nothing is said of the free leg, whose forces balance."""
    result, instance = Result("compass", number, 2, "ipm", ""), draw(number)[1]
    problem = dmoc.Problem(dmoc.build(system_of(instance)), steps=40, **instance.problem)
    inertia = problem.inertia * problem.reach**2
    assert inertia.min() > 1e-8 * inertia.max()
    solution = dmoc.solve(problem, "ipm")
    assert solution.solved, solution.message
    judge(result, instance, solution, ContactMechanism(instance.description))
    assert result.against == []
