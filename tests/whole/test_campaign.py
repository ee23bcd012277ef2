"""The judge of the campaign: it agrees with closed forms, and what is wrong with a motion it
says."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import sqrt
from typing import Any

import numpy as np
import pytest
import sympy as sp
from campaign import Result, judge, system_of
from campaign_kinds import Instance, block, block_cost
from event_driven import Description, Mechanism
from sympy.physics.mechanics import dynamicsymbols

import dmoc

G = 9.81
END = 1.2  # before the bounces of e = 0.5 accumulate


@pytest.mark.parametrize("e", [1.0, 0.5])
def test_a_dropped_ball_bounces_when_and_as_hard_as_it_must(e: float) -> None:
    y = dynamicsymbols("y")
    m, g = sp.symbols("m g")
    fall = Description(
        "ball",
        [y],
        [],
        m * y.diff(dynamicsymbols._t) ** 2 / 2 - m * g * y,
        {},
        {"floor": y >= 0},
        {m: 2.0, g: G},
    )
    nothing = (np.linspace(0.0, END, 4), np.zeros((3, 0)), np.zeros((3, 0)))
    flight = Mechanism(fall).fly(
        nothing, 0.0, END, np.array([1.0]), np.zeros(1), np.array([2.0, G]), [e]
    )
    first, speed = sqrt(2 / G), sqrt(2 * G)
    hits = [
        (first + 2 * speed * sum(e ** (j + 1) for j in range(i)) / G, speed * e**i)
        for i in range(20)
    ]
    hits = [h for h in hits if h[0] < END]
    assert [i.time for i in flight.impacts] == pytest.approx([t for t, _ in hits], rel=1e-7)
    assert [i.impulse for i in flight.impacts] == pytest.approx(
        [2.0 * (1 + e) * w for _, w in hits], rel=1e-7
    )
    time, w = hits[-1]
    assert flight.v[0] == pytest.approx(e * w - G * (END - time), rel=1e-6)


@pytest.fixture(scope="module")
def solved() -> tuple[Instance, dmoc.Solution, Mechanism]:
    fields = {
        "start": {"x": 0.0},
        "goal": {"x": 0.0, "x_dot": 0.0},
        "sequence": ["wall"],
        "final_time": 1.0,
        "restitution": 0.5,
        "parameters": {"wall": 1.0},
        "bounds": {"u": (-40.0, 40.0)},
    }
    instance = Instance(block(), fields, block_cost(1.0, 1.0, 0.0, 1.0, 0.5))
    solution = dmoc.solve(dmoc.Problem(dmoc.build(system_of(instance)), steps=40, **fields), "ipm")
    assert solution.solved
    return instance, solution, Mechanism(instance.description)


def judged(instance: Instance, solution: dmoc.Solution, mechanism: Mechanism) -> list[str]:
    result = Result("walls in mm", 0, 2, "ipm", solution.status)
    judge(result, instance, solution, mechanism)
    return result.against


def with_motion(solution: dmoc.Solution, **changes: Any) -> dmoc.Solution:
    return replace(solution, trajectory=replace(solution.trajectory, **changes))


def with_phase(solution: dmoc.Solution, **factors: float) -> dmoc.Solution:
    """The motion with arrays of its second phase multiplied by factors."""
    first, second = solution.phases
    return with_motion(
        solution,
        phases=(first, replace(second, **{n: getattr(second, n) * f for n, f in factors.items()})),
    )


def with_impulse(solution: dmoc.Solution, factor: float) -> dmoc.Solution:
    hit = solution.collisions[0]
    return with_motion(solution, collisions=(replace(hit, impulse=hit.impulse * factor),))


def test_a_right_motion_is_confirmed(solved: tuple[Instance, dmoc.Solution, Mechanism]) -> None:
    assert judged(*solved) == []


@pytest.mark.parametrize(
    ("wrong", "reason"),
    [
        (lambda s: with_motion(s, restitution={"wall": 0.8}), "law"),
        (lambda s: with_impulse(s, 1.1), "impulse"),
        (lambda s: with_impulse(s, 0.0), "impulse"),
        (lambda s: with_phase(s, p=0.9), "segment"),
        (lambda s: with_phase(s, u=1.2), "segment"),
        (lambda s: with_phase(s, p=-1.0), "law"),
        (lambda s: with_motion(s, parameters={"m": 1.3, "wall": 1.0}), "segment"),
        (lambda s: with_motion(s, parameters={"m": 1.0, "wall": 0.9}), "penetration"),
        (lambda s: with_motion(s, parameters={"m": 1.0, "wall": 0.5}), "was not planned"),
        (lambda s: with_motion(s, parameters={"m": 1.0, "wall": 1.1}), "gap"),
        (lambda s: replace(s, cost=1.001 * s.cost), "cost"),
        (lambda s: replace(s, cost=1.1 * s.cost), "excess"),
    ],
)
def test_a_wrong_motion_is_contradicted(
    solved: tuple[Instance, dmoc.Solution, Mechanism],
    wrong: Callable[[dmoc.Solution], dmoc.Solution],
    reason: str,
) -> None:
    instance, solution, mechanism = solved
    assert any(reason in said for said in judged(instance, wrong(solution), mechanism))


@pytest.mark.parametrize(
    ("fields", "reason"),
    [
        ({"bounds": {"u": (-1.0, 1.0)}}, "limit"),
        ({"goal": {"x": 0.1}}, "boundary"),
        ({"start": {"x": 0.1}}, "boundary"),
    ],
)
def test_a_motion_of_another_problem_is_contradicted(
    solved: tuple[Instance, dmoc.Solution, Mechanism], fields: dict[str, Any], reason: str
) -> None:
    instance, solution, mechanism = solved
    other = replace(instance, problem={**instance.problem, **fields})
    assert any(reason in said for said in judged(other, solution, mechanism))
