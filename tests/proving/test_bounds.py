"""Bounds of boxes of durations beside the least cost at durations within them, which a solve of the
program with these durations has: convex quadratic programs, whose minimum is the only one."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.proving.branch import Branch
from dmoc.proving.linear import LinearProblem
from dmoc.proving.linear_problem import linear_problem

t = dynamicsymbols._t
x, y, u, w = dynamicsymbols("x y u w")
ENDS = {"start": {"x": 0.3, "y": 0.1}, "goal": {"x": 0.4, "y": -0.2, "x_dot": 0.5}}


def carts(name: str, cost: Any) -> Kernels:
    """Two masses with a spring, a damper and a weight, between walls, one of which moves."""
    system = dmoc.MechanicalSystem(
        name, [x, y],
        x.diff(t) ** 2 + y.diff(t) ** 2 / 2 + x.diff(t) * y.diff(t) / 4 - 4 * (x - y) ** 2 - y,
        inputs=[u, w], forces={x: u, y: w - y.diff(t) / 3}, cost=cost,
        surfaces={"right": x + y / 5 <= 1, "left": x >= t / 5 - 1},
    )  # fmt: skip
    return dmoc.build(system, order=4)


@pytest.fixture(scope="module")
def curved() -> Kernels:
    return carts("curved_carts", u**2 / 2 + w**2 / 3 + u * w / 4 + u / 5 + sp.Rational(1, 3))


@pytest.fixture(scope="module")
def flat() -> Kernels:
    return carts("flat_carts", 1 + u**2 / 2)


def boxes(
    rng: np.random.Generator, problem: dmoc.Problem, widths: list[float]
) -> list[tuple[LinearProblem, list[float]]]:
    """Boxes around two points each, with the least costs there, infinite where there is no motion;
    the smallest around one alone."""
    linear, made = linear_problem(problem), []
    earliest, latest = linear.final_time
    for width in widths:
        points, costs = [], []
        middle = rng.dirichlet(np.full(len(linear.phases), 8.0))
        for _ in range(1 if width < 1e-6 else 2):
            T = middle * np.exp(rng.choice([-width, width], len(middle)))
            points.append(T / T.sum() * rng.choice([earliest, latest]))
            solution = dmoc.solve(problem.but(durations=points[-1].tolist()), starts=1)
            costs.append(solution.cost if solution.converged else np.inf)
        low, high = np.min(points, axis=0), np.max(points, axis=0)
        small = 1e-9 * high * (len(points) == 1)
        made.append((replace(linear, durations=np.stack([low - small, high + small], 1)), costs))
    return made


def bound(linear: LinearProblem, cost: float, boxes: int = 1) -> float:
    branch = Branch(linear, np.inf, 1e5 * abs(cost), 1e-9, 1e-9, abs(cost))
    branch.run(boxes)
    return float(branch.bound)


@pytest.mark.parametrize("sequence", [[], ["right"], ["right", "left"]])
def test_bounds_are_below_the_cost_at_durations_within(
    curved: Kernels, sequence: list[str]
) -> None:
    rng = np.random.default_rng(len(sequence))
    problem = dmoc.Problem(
        curved, **ENDS, sequence=sequence, steps=3, restitution=0.7, final_time=(1.2, 1.5),
    ).in_rates()  # fmt: skip
    for linear, costs in boxes(rng, problem, [1e-9, 0.003, 0.02, 0.05, 0.1, 0.2]):
        assert bound(linear, costs[0]) <= min(costs) * (1 + 1e-9)
        if len(costs) == 1:
            assert bound(linear, costs[0]) >= costs[0] * (1 - 1e-6)


def check(problem: dmoc.Problem, tight: float, seed: int) -> None:
    for linear, costs in boxes(np.random.default_rng(seed), problem, [1e-9, 0.02, 0.1]):
        assert bound(linear, costs[0], 3) <= min(costs) * (1 + 1e-9)
        if len(costs) == 1:
            assert bound(linear, costs[0], 3) >= costs[0] * (1 - tight)


def test_halves_of_boxes_are_all_of_them(curved: Kernels) -> None:
    problem = dmoc.Problem(curved, **ENDS, sequence=["right"], steps=3, final_time=(0.5, 9.0))
    linear = replace(linear_problem(problem), durations=np.array([[0.7, 0.9], [0.5, 1.1]]))
    branch = Branch(linear, np.inf, 1e9, -1e9, -1e9, 1.0)  # of interest, whatever they cost
    branch.run(40)
    waiting = branch.state()["waiting"]
    low, high = waiting[:, 1:3], waiting[:, 3:5]
    assert len(waiting) > 10
    assert np.prod(high - low, axis=1).sum() == pytest.approx(0.2 * 0.6, rel=1e-12)


def bounded(kernels: Kernels) -> dmoc.Problem:
    """Forces that reach their bounds, a start and a goal within ranges."""
    return dmoc.Problem(
        kernels, sequence=["right"], steps=4, restitution=0.7, final_time=(1.2, 1.5),
        start={"x": (0.2, 0.4), "y": 0.1}, goal={"x": (0.0, 0.2), "y": -0.2},
        bounds={"u": (-14, 9), "w": (-7, 7)},
    ).in_rates()  # fmt: skip


def test_bounds_with_inputs_at_theirs(curved: Kernels) -> None:
    check(bounded(curved), 1e-6, 0)


def test_bounds_of_periodic_motions_from_ranges(curved: Kernels) -> None:
    """Velocities of both carts make each momentum."""
    problem = bounded(curved).but(
        start={"x": (0.2, 0.4), "y": (-0.3, 0.1), "x_dot": (-3, 1), "y_dot": (0, 0.5)}, goal={},
        periodic={"x": "x", "y": ("-x", (0.1, 0.3)), "y_dot": "y_dot"},
    )  # fmt: skip
    check(problem, 1e-5, 3)


def test_bounds_of_inputs_without_a_cost(flat: Kernels) -> None:
    check(bounded(flat), 1e-2, 1)


def test_bounds_with_coordinates_at_theirs(curved: Kernels) -> None:
    problem = bounded(curved).but(bounds={"y": (-0.3, 0.15)})
    check(problem, 1e-6, 2)


def test_bounds_with_velocities_at_theirs(curved: Kernels) -> None:
    """In steps, on both sides of a hit and at the goal, whose velocities are free."""
    speeds = {"x_dot": (-1.2, 1.6), "y_dot": (-1.0, 1.8)}
    check(bounded(curved).but(bounds={"u": (-14, 9), "w": (-7, 7), **speeds}), 1e-6, 2)


def test_threads_change_no_box(curved: Kernels) -> None:
    """Conditions that are priced on the way have the same numbers for any number of threads."""
    problem = bounded(curved).but(bounds={"y": (-0.3, 0.15)})
    linear, states = linear_problem(problem), []
    for workers in (1, 3):
        branch = Branch(linear, np.inf, 1e5, 1e-4, 1e-4, 10.0, 1000, workers)
        branch.run(300)
        states.append(branch.state())
    for name, one in states[0].items():
        np.testing.assert_array_equal(states[1][name], one)
    prices = states[0]["waiting"][:, 5:-1]
    rows = len(linear.goal_zero.b) + len(linear.goal_most.b)
    rows += sum(len(e.zero.b) + len(e.most.b) for e in linear.events)
    assert (prices[:, rows + 1 :] > 0).any()  # at least two conditions are priced
