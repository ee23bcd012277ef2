"""Goals that decide durations, several at once: what no input reaches has its own times, at which
the rest of the motion has a closed cost."""

from __future__ import annotations

from typing import Any

import pytest
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.proving.global_proof import Claim

t = dynamicsymbols._t
x, y, s, u = dynamicsymbols("x y s u")


def check(problem: dmoc.Problem, cost: float, boxes: int) -> None:
    proof = dmoc.prove(problem)
    assert proof.claim is Claim.OPTIMAL and proof.boxes < boxes
    assert proof.cost == pytest.approx(cost, rel=1e-6)
    assert cost * (1 - 1e-4) <= proof.bound <= cost * (1 + 1e-7)


@pytest.fixture(scope="module")
def carried() -> Kernels:
    """What is pushed along x flies freely along y."""
    system = dmoc.MechanicalSystem(
        "carried", [x, y], (x.diff(t) ** 2 + y.diff(t) ** 2) / 2, inputs=[u], forces={x: u},
        cost=u**2 / 2, surfaces={"wall": y <= 1, "other": y >= 0},
    )  # fmt: skip
    return dmoc.build(system, order=4, backend="numpy")


def flying(kernels: Kernels, **more: Any) -> dmoc.Problem:
    """It takes 0.7 s to the wall, and comes back at 0.8 m/s."""
    fields = {"goal": {"x": 1, "x_dot": 0, "y": 0.6}, "final_time": (0.5, 5.0), **more}
    start = {"x": 0, "y": 0.3, "y_dot": 1.0}
    return dmoc.Problem(kernels, start=start, restitution=0.8, steps=3, **fields)


def test_all_durations_are_decided(carried: Kernels) -> None:
    """From rest to rest by a metre in 1.2 s, or off both walls in 2.8875 s."""
    check(flying(carried, sequence=["wall"]), 6 / 1.2**3, 500)
    there_and_back = flying(carried, sequence=["wall", "other"])
    check(there_and_back, 6 / (0.7 + 1 / 0.8 + 0.6 / 0.64) ** 3, 6000)


def test_one_of_two_is_decided(carried: Kernels) -> None:
    """Later it would have passed the other wall, where it is after 1.95 s."""
    goal = {"x": 1, "x_dot": 0}
    check(flying(carried, sequence=["wall"], goal=goal), 6 / (0.7 + 1 / 0.8) ** 3, 500)


def test_goals_that_no_duration_meets_are_impossible(carried: Kernels) -> None:
    goal = {"x": 1, "x_dot": 0, "y": 0.6, "y_dot": 0.7}
    proof = dmoc.prove(flying(carried, sequence=["wall"], goal=goal))
    assert proof.claim is Claim.IMPOSSIBLE and proof.boxes < 300


@pytest.fixture(scope="module")
def rolling() -> Kernels:
    """What is pushed hits what rolls to an end."""
    system = dmoc.MechanicalSystem(
        "rolling", [x, s], (x.diff(t) ** 2 + s.diff(t) ** 2) / 2, inputs=[u], forces={x: u},
        surfaces={"nail": x <= s, "end": s <= 6}, cost=u**2 / 2,
    )  # fmt: skip
    return dmoc.build(system, order=4, backend="numpy")


@pytest.mark.parametrize(("place", "boxes"), [(5.0, 1200), ((4.8, 5.0), 1500)])
def test_two_of_three_are_decided(rolling: Kernels, place: Any, boxes: int) -> None:
    """What is hit at v = 8/3 rolls 5 m to the end at 2 m/s and a metre back at 1 m/s, which leaves
    2.5 s of 6 s to the hit."""
    problem = dmoc.Problem(
        rolling, start={"x": 0.0, "s": 1.0}, goal={"s": place, "s_dot": -1.0}, steps=2,
        sequence=["nail", "end"], final_time=6.0, restitution=0.5,
    )  # fmt: skip
    v, T = 8 / 3, 2.5
    check(problem, 6 / T**3 - 6 * v / T**2 + 2 * v**2 / T, boxes)
