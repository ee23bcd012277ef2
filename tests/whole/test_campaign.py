"""The judge of the campaigns: it agrees with closed forms, and what is wrong with a motion it
says."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import sqrt
from typing import Any

import numpy as np
import pytest
from answers import answer_of
from campaign import HELD, system_of
from campaign_judge import JudgedSolve, judge
from campaign_kinds import Instance, block, block_cost
from contact_equations import ContactSizes
from contact_kinds import bar, block_on
from event_simulation import ContactMechanism, ContactRun
from hit_problems import RODS

import dmoc

ONE = np.ones(1)
G = 10.0
PAR = np.array([1.0, G, 0.1])  # m, g, mu: 1 N of friction
Solved = tuple[Instance, dmoc.Solution, ContactMechanism]
Wrong = Callable[[dmoc.Solution], dmoc.Solution]


def run(
    u: list[float], v: list[float], y: float = 0.0, e: float = 0.0, end: float = 4.0
) -> ContactRun:
    """A block on a floor; the force is linear between values at equal times."""
    forces = np.array(u)[:, None]
    inputs = np.linspace(0.0, end, len(u)), forces[:-1], forces[1:]
    sizes = ContactSizes(ONE, ONE, ONE, end)
    return ContactMechanism(block_on(False)).run(
        inputs, 0.0, end, np.array([0.0, y]), np.array(v), PAR, sizes, [e], lambda j, t: False
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


@pytest.mark.parametrize("e", [1.0, 0.5])
def test_a_dropped_block_bounces_when_and_as_hard_as_it_must(e: float) -> None:
    end = 1.2  # before the bounces of e = 0.5 accumulate
    ended = run([0.0] * 4, [0.0, 0.0], y=1.0, e=e, end=end)
    first, speed = sqrt(2 / G), sqrt(2 * G)
    times = [first + 2 * speed * sum(e ** (j + 1) for j in range(i)) / G for i in range(20)]
    times = [t for t in times if t < end]
    assert [t for _, t in ended.impacts] == pytest.approx(times, rel=1e-6)
    assert ended.v[1] == pytest.approx(speed * e ** len(times) - G * (end - times[-1]), rel=1e-5)


@pytest.mark.parametrize(("angle", "v", "mu", "after", "normal", "tangential", "course"), RODS)
def test_a_rod_is_hit_by_poissons_law(
    angle: float, v: tuple[float, ...], mu: float, after: tuple[float, ...], normal: float,
    tangential: float, course: str,
) -> None:  # fmt: skip
    mechanism = ContactMechanism(bar())
    par = np.array([1.0, 0.5, 1 / 12, 10.0, mu])
    turn = np.radians(angle) if angle > 2 * np.pi else angle
    q = np.array([0.0, 0.5 * np.sin(turn), turn])
    sizes = ContactSizes(ONE, ONE, ONE, 1.0)
    outcome, *_ = mechanism.impacts([0], q, np.array(v), np.zeros(1), 0.0, par, sizes, [0.5])
    np.testing.assert_allclose(outcome.motion, after, atol=1e-8)
    assert outcome.normal[0] == pytest.approx(normal, abs=1e-8)
    assert outcome.tangential[0] == pytest.approx(tangential, abs=1e-8)


def solved(instance: Instance, steps: int) -> Solved:
    kernels = dmoc.build(system_of(instance))
    solution = answer_of(dmoc.Problem(kernels, steps=steps, **instance.problem), "ipm", starts=4)
    return instance, solution, ContactMechanism(instance.description)


@pytest.fixture(scope="module")
def bounced() -> Solved:
    fields = {
        "start": {"x": 0.0}, "goal": {"x": 0.0, "x_dot": 0.0}, "sequence": ["wall"],
        "final_time": 1.0, "restitution": 0.5, "parameters": {"wall": 1.0},
        "bounds": {"u": (-40.0, 40.0)},
    }  # fmt: skip
    return solved(Instance(block(), fields, block_cost(1.0, 1.0, 0.0, 1.0, 0.5)), 16)


@pytest.fixture(scope="module")
def pushed() -> Solved:
    fields = {
        "start": {"x": 0.0, "y": 0.0}, "goal": {"x": 1.0, "x_dot": 0.0}, "contacts": ["floor"],
        "sequence": ["floor:slip+", "floor:stick"], "final_time": 4.0,
        "parameters": {"mu": 0.1, "g": 10.0},
    }  # fmt: skip
    return solved(Instance(block_on(False), fields), 12)


def judged(instance: Instance, solution: dmoc.Solution, mechanism: ContactMechanism) -> list[str]:
    result = JudgedSolve("a kind", 0, 2, "ipm", solution.status)
    judge(result, instance, solution, mechanism)
    return result.against


def with_motion(solution: dmoc.Solution, **changes: Any) -> dmoc.Solution:
    return replace(solution, trajectory=replace(solution.trajectory, **changes))


def with_phase(solution: dmoc.Solution, number: int, **factors: float) -> dmoc.Solution:
    """The motion with arrays of a phase multiplied by factors."""
    phases = list(solution.phases)
    changed = {name: getattr(phases[number], name) * f for name, f in factors.items()}
    phases[number] = replace(phases[number], **changed)
    return with_motion(solution, phases=tuple(phases))


def with_impulse(solution: dmoc.Solution, factor: float) -> dmoc.Solution:
    hit = solution.collisions[0]
    changed = {name: value * factor for name, value in hit.impulses.items()}
    return with_motion(
        solution, collisions=(replace(hit, impulse=hit.impulse * factor, impulses=changed),)
    )


def with_values(solution: dmoc.Solution, **values: float) -> dmoc.Solution:
    return with_motion(solution, parameters={**solution.trajectory.parameters, **values})


@pytest.mark.slow
@pytest.mark.parametrize("motion", ["bounced", "pushed"])
def test_a_right_motion_is_confirmed(request: pytest.FixtureRequest, motion: str) -> None:
    assert judged(*request.getfixturevalue(motion)) == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("motion", "wrong", "reason"),
    [
        ("bounced", lambda s: with_motion(s, restitution={"wall": 0.8}), "law"),
        ("bounced", lambda s: with_motion(s, restitution={"wall": 0.8}), "event"),
        ("bounced", lambda s: with_phase(s, 0, p=-1.0), "departs before it hits"),
        ("bounced", lambda s: with_impulse(s, 1.1), "impulse"),
        ("bounced", lambda s: with_impulse(s, 0.0), "impulse"),
        ("bounced", lambda s: with_phase(s, 1, p=0.9), "segment"),
        ("bounced", lambda s: with_phase(s, 1, u=1.2), "segment"),
        ("bounced", lambda s: with_phase(s, 1, p=-1.0), "law"),
        ("bounced", lambda s: with_values(s, m=1.3), "segment"),
        ("bounced", lambda s: with_values(s, wall=0.9), "was not planned"),
        ("bounced", lambda s: with_values(s, wall=0.5), "was not planned"),
        ("bounced", lambda s: with_values(s, wall=1.1), "gap"),
        ("bounced", lambda s: with_motion(s, cost=1.001 * s.cost), "cost"),
        ("bounced", lambda s: with_motion(s, cost=1.1 * s.cost), "excess"),
        ("pushed", lambda s: with_phase(s, 1, tangential=1.1), "force"),
        ("pushed", lambda s: with_phase(s, 1, tangential=-1.0), "force"),
        ("pushed", lambda s: with_phase(s, 0, normal=0.9), "force"),
        ("pushed", lambda s: with_phase(s, 1, u=1.1), "segment"),
        ("pushed", lambda s: with_phase(s, 1, p=1.3), "segment"),
        ("pushed", lambda s: with_phase(s, 2, q=1.01), "boundary"),
        ("pushed", lambda s: with_values(s, mu=0.15), "force"),
        ("pushed", lambda s: with_values(s, mu=0.05), "segment"),
        ("pushed", lambda s: with_motion(s, cost=1.001 * s.cost), "cost"),
    ],
)
def test_a_wrong_motion_is_contradicted(
    request: pytest.FixtureRequest, motion: str, wrong: Wrong, reason: str
) -> None:
    instance, solution, mechanism = request.getfixturevalue(motion)
    reasons = judged(instance, wrong(solution), mechanism)
    assert any(reason in sentence for sentence in reasons), reasons


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fields", "reason"),
    [
        ({"bounds": {"u": (-1.0, 1.0)}}, "limit"),
        ({"goal": {"x": 0.1}}, "boundary"),
        ({"start": {"x": 0.1}}, "boundary"),
    ],
)
def test_a_motion_of_another_problem_is_contradicted(
    bounced: Solved, fields: dict[str, Any], reason: str
) -> None:
    instance, solution, mechanism = bounced
    other = replace(instance, problem={**instance.problem, **fields})
    assert any(reason in sentence for sentence in judged(other, solution, mechanism))


@pytest.mark.slow
def test_a_leg_that_hangs_still_at_the_start_has_a_size() -> None:
    """A passive gait starts where nothing is said of the free leg, whose forces balance."""
    for number in (18, 8):
        instance = HELD.draw(number)[2]
        problem = dmoc.Problem(dmoc.build(system_of(instance)), steps=40, **instance.problem)
        inertia = problem.inertia * problem.reach**2
        assert inertia.min() > 1e-8 * inertia.max()
    assert judged(*solved(instance, 40)) == []
