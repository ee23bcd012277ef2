"""Proofs of costs of positions and velocities, beside quadratic programs of the steps of order 2 by
hand: q_kp1 = q_k + h p_k + h^2 u/2, p_kp1 = p_k + h u, and what the middle of a step costs."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import sympy as sp
from scipy.optimize import minimize_scalar
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.deadline import Deadline
from dmoc.codegen.kernels import Kernels
from dmoc.proving.engine import branch_of, check_size
from dmoc.proving.global_proof import Claim
from dmoc.proving.linear_problem import linear_problem
from dmoc.proving.prove import _largest_cost, lower_bound

t = dynamicsymbols._t
x, u = dynamicsymbols("x u")
a, b, c = sp.symbols("a b c")
N, PLACE, SPEED, MEAN = 3, 20.0, 2.0, 0.5
VALUES = {a: PLACE, b: SPEED, c: MEAN}
RUNNING = u**2 / 2 + u / 4 + a * (x - c) ** 2 / 2 + b * (x.diff(t) - 1) ** 2 / 2


def system(name: str, cost: Any, end: Any = 0) -> dmoc.MechanicalSystem:
    return dmoc.MechanicalSystem(
        name, [x], x.diff(t) ** 2 / 2, inputs=[u], forces={x: u}, cost=cost,
        terminal_cost=end, surfaces={"right": x <= 1},
        parameters={s: v for s, v in VALUES.items() if cost.has(s)},
    )  # fmt: skip


@pytest.fixture(scope="module")
def weighed() -> Kernels:
    return dmoc.build(system("weighed", RUNNING), order=2)


def problem_of(kernels: Kernels, **more: Any) -> dmoc.Problem:
    """From rest at 0.3 to the wall, and to rest at 0.6."""
    return dmoc.Problem(
        kernels, start={"x": 0.3}, sequence=["right"],
        **{"goal": {"x": 0.6, "x_dot": 0}, "restitution": 0.8, "final_time": 1.0, "steps": N,
           "controls": "constant", **more},
    )  # fmt: skip


def by_hand(first: float, end: bool = False) -> float:
    """Least cost where the hit is at a time: the solution of the conditions of optimality; with a
    goal, or with a cost of the end."""
    n = 2 * N
    q, p = np.append(np.zeros(n), 0.3), np.zeros(n + 1)  # functions of (u, 1)
    H, g, rest, rows = np.zeros((n, n)), np.zeros(n), 0.0, []
    for k in range(n):
        h = (first if k < N else 1 - first) / N
        unit = np.eye(n + 1)[k]
        then = q + h * p + h * h / 2 * unit
        squares = [(1.0, unit), (PLACE, (q + then) / 2 - MEAN * np.eye(n + 1)[n])]
        squares.append((SPEED, (then - q) / h - np.eye(n + 1)[n]))
        for weight, row in squares:
            H += h * weight * np.outer(row[:n], row[:n])
            g += h * weight * row[:n] * row[n]
            rest += h * weight * row[n] ** 2 / 2
        g[k] += h / 4
        q, p = then, p + h * unit
        if k == N - 1:
            rows.append(q - np.eye(n + 1)[n])
            p = -0.8 * p
    goal = [q - 0.6 * np.eye(n + 1)[n], p]
    for weight, row in zip((30.0, 4.0), goal if end else (), strict=False):
        H += weight * np.outer(row[:n], row[:n])
        g += weight * row[:n] * row[n]
        rest += weight * row[n] ** 2 / 2
    A = np.array([*rows, *([] if end else goal)])
    K = np.block([[H, A[:, :n].T], [A[:, :n], np.zeros((len(A), len(A)))]])
    best = np.linalg.solve(K, np.concatenate([-g, -A[:, n]]))[:n]
    return float(best @ H @ best / 2 + g @ best + rest)


def least(**end: bool) -> float:
    """The least cost of all times of the hit."""
    times = np.linspace(0.1, 0.95, 18)
    near = times[int(np.argmin([by_hand(first, **end) for first in times]))]
    found = minimize_scalar(
        lambda first: by_hand(first, **end), bounds=(near - 0.09, near + 0.049), method="bounded"
    )
    return float(found.fun)


def bound(problem: dmoc.Problem, low: Any, high: Any) -> float:
    linear = replace(linear_problem(problem.in_rates()), durations=np.stack([low, high], axis=1))
    branch = branch_of(linear)(linear, np.inf, 1e5, 1e-9, 1e-9, 10.0)
    branch.run(1)
    return float(branch.bound)


def test_the_best_motion_is_proved(weighed: Kernels) -> None:
    proof = dmoc.prove(problem_of(weighed), 1e-3)
    cost = least()
    assert proof.claim is Claim.OPTIMAL and proof.boxes < 300 and proof.left_out == ()
    assert proof.cost == pytest.approx(cost, rel=1e-6)
    assert cost * (1 - 1.1e-3) <= proof.bound <= cost * (1 + 1e-9)


def test_costs_of_the_end() -> None:
    """The constant 1 beside the squares is there, whatever the motion is."""
    ended = system("ended", RUNNING, 15 * (x - sp.Rational(3, 5)) ** 2 + 2 * x.diff(t) ** 2 + 1)
    problem = problem_of(dmoc.build(ended, order=2), goal={})
    cost = least(end=True) + 1
    proof = dmoc.prove(problem, 1e-3)
    assert proof.claim is Claim.OPTIMAL and proof.boxes < 300
    assert proof.cost == pytest.approx(cost, rel=1e-6)
    assert cost * (1 - 1.1e-3) <= proof.bound <= cost * (1 + 1e-9)
    assert lower_bound(problem, 1.0, Deadline.after(9), growing=True)[0] == -np.inf


def test_what_is_linear_at_the_end() -> None:
    """It earns to end far back, and fast forth: u = 1 - 20 (T - t) after the hit."""
    ended = system("ended_far", u**2 / 2, 20 * x - x.diff(t) - 7)
    problem = problem_of(dmoc.build(ended, order=4, backend="numpy"), goal={}, controls="stages")
    first, hit = np.meshgrid(np.linspace(0.2, 0.5, 301), np.linspace(2, 8, 601))
    then = 1 - first
    to = hit - 0.7 / first, -0.7 / first  # speeds at both ends beside the mean one
    cost = 2 * (to[0] ** 2 + to[0] * to[1] + to[1] ** 2) / first
    cost += 20 * (1 - 0.8 * hit * then) + 0.8 * hit - 7
    cost -= (400 * then**3 / 3 - 20 * then**2 + then) / 2
    proof = dmoc.prove(problem, 1e-3)
    assert proof.claim is Claim.OPTIMAL and proof.boxes < 300
    assert proof.cost == pytest.approx(cost.min(), rel=1e-4)
    assert proof.bound <= cost.min() + 1e-9


def test_bounds_of_inputs_do_not_bound_what_the_end_costs() -> None:
    for name, end in (("only_end", x**2), ("linear_end", x)):
        kernels = dmoc.build(system(name, u**2, end), order=2, backend="numpy")
        problem = problem_of(kernels, bounds={"u": (-9, 9)}, steps=2)
        assert _largest_cost(linear_problem(problem)) == np.inf
        growing = lower_bound(problem, 1.0, Deadline.after(9.0), growing=True)
        assert growing == (-np.inf, np.inf, False)


@pytest.mark.parametrize("width", [1e-9, 0.01, 0.05, 0.2])
@pytest.mark.parametrize("first", [0.3, 0.5, 0.7])
def test_bounds_of_boxes_are_below_what_is_in_them(
    weighed: Kernels, first: float, width: float
) -> None:
    low, high = first - width * 0.2, first + width * 0.2
    least = min(map(by_hand, np.linspace(low, high, 21)))
    found = bound(problem_of(weighed), [low, 1 - high], [high, 1 - low])
    assert found <= least * (1 + 1e-9)
    if width < 1e-2:
        assert found >= least * (1 - 1e-6)


def test_what_contacts_hold_costs_something(weighed: Kernels) -> None:
    """At rest at the wall: (20/2) (1 - 0.5)^2 and 2/2 in each second, less what an input of -1/4
    brings; it would pull, so that it is none."""
    problem = dmoc.Problem(
        weighed, start={"x": 1.0}, sequence=[], contacts=["right"], final_time=1.0, steps=N,
        controls="constant",
    )  # fmt: skip
    around = np.array([1e-9])
    assert bound(problem, 1 - around, 1 + around) == pytest.approx(2.5 + 1, rel=1e-6)


@pytest.mark.parametrize(
    ("name", "cost", "end", "sentence"),
    [
        ("repelled", u**2 - x**2, 0, "the cost is not convex in positions and velocities"),
        ("mixed", u**2 + u * x, 0, "the cost is not convex in x and u together"),
        (
            "crossed",
            u**2 + x**2 + 3 * u * x,
            0,
            "is not convex in positions, velocities and inputs",
        ),
        ("tied", (u + x) ** 2, 0, "the input u has neither a cost of its own nor bounds"),
        ("steep", u**2 + x**4, 0, "the cost is no quadratic function of positions, velocities and"),
        ("far", u**2, -(x**2), "the cost of the end is not convex"),
        ("ends_steep", u**2, x**4, "the cost of the end is no quadratic function"),
        ("later", u**2, t * x**2, "the cost of the end depends on the time"),
    ],
)
def test_other_costs_are_refused_by_name(name: str, cost: Any, end: Any, sentence: str) -> None:
    kernels = dmoc.build(system(name, cost, end), order=2, backend="numpy")
    with pytest.raises(dmoc.DmocError, match=sentence):
        linear_problem(problem_of(kernels))


def test_too_many_steps_are_refused(weighed: Kernels) -> None:
    check_size(linear_problem(problem_of(weighed, steps=38)))
    with pytest.raises(dmoc.DmocError, match=r"156 squares .* at most 152; give fewer steps"):
        check_size(linear_problem(problem_of(weighed, steps=39)))
