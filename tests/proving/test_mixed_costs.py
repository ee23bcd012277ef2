"""Proofs of costs that are linear in positions and velocities, or have products of them and inputs,
beside quadratic programs of the steps of order 2 by hand."""

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
from dmoc.codegen.kernels import Array
from dmoc.proving.convexity import is_positive_definite
from dmoc.proving.engine import branch_of
from dmoc.proving.global_proof import Claim
from dmoc.proving.linear_problem import linear_problem
from dmoc.proving.prove import _largest_cost, lower_bound

x, u = dynamicsymbols("x u")
v = x.diff()
N = 3
# z Q z/2 + g z + c of z = (x, x_dot, u)
COSTS = {
    "uphill": (np.diag([0, 0, 1.0]), np.array([2, -1 / 3, 0]), 1.0),
    "mixed": (
        np.array([[10, 1, 1], [1, 2, -0.5], [1, -0.5, 1]]), np.array([3.0, -2, 0.2]), 0.0
    ),
    "tied": (np.array([[1.0, 0, 2], [0, 0, 0], [2, 0, 5]]), np.array([0.0, 1, 0]), 0.0),
}  # fmt: skip


def problem_of(name: str, order: int = 2, **fields: Any) -> dmoc.Problem:
    """From rest at 0.3 to the wall, and to rest at 0.6."""
    Q, g, c = COSTS[name]
    z = sp.Matrix([x, v, u])
    cost = (z.T * sp.Matrix(Q) * z)[0] / 2 + (sp.Matrix(g).T * z)[0] + c
    system = dmoc.MechanicalSystem(
        f"costs_{name}", [x], v**2 / 2, inputs=[u], forces={x: u}, cost=sp.nsimplify(cost),
        surfaces={"right": x <= 1},
    )  # fmt: skip
    return dmoc.Problem(
        dmoc.build(system, order=order), start={"x": 0.3}, sequence=["right"],
        goal={"x": 0.6, "x_dot": 0}, restitution=0.8, final_time=1.0, steps=N, **fields,
    )  # fmt: skip


def by_hand(name: str, first: float, width: int = 1) -> float:
    """Least cost where the hit is at a time, with an input of each step or two, for its halves."""
    Q, g, c = COSTS[name]
    n = 2 * N * width
    one = np.eye(n + 1)[n]
    q, p, H, rows = 0.3 * one, 0 * one, np.zeros((n + 1, n + 1)), []
    for k in range(2 * N):
        h = (first if k < N else 1 - first) / N
        inputs = np.eye(n + 1)[k * width : (k + 1) * width]
        then = q + h * (p + h / 2 * inputs[0])
        for own in inputs:
            z = np.array([(q + then) / 2, (then - q) / h, own])
            H += h / width * (z.T @ Q @ z + np.outer(one, g @ z) + np.outer(g @ z, one))
            H[n, n] += h / width * 2 * c
        q, p = then, p + h * inputs.mean(axis=0)
        if k == N - 1:
            rows.append(q - one)
            p = -0.8 * p
    A = np.array([*rows, q - 0.6 * one, p])
    K = np.block([[H[:n, :n], A[:, :n].T], [A[:, :n], np.zeros((3, 3))]])
    best = np.linalg.lstsq(K, np.concatenate([-H[:n, n], -A[:, n]]), rcond=None)[0][:n]
    z = np.append(best, 1)
    return float(z @ H @ z / 2)


@pytest.mark.parametrize("name", COSTS)
def test_bounds_are_below_what_is_in_their_boxes(name: str) -> None:
    for form, width in (("constant", 1), ("linear", 2)):
        linear = linear_problem(problem_of(name, controls=form).in_rates())
        for spread in (1e-9, 0.01, 0.1):
            for first in (0.3, 0.6):
                low, high = first - spread * 0.2, first + spread * 0.2
                part = replace(linear, durations=np.array([[low, high], [1 - high, 1 - low]]))
                branch = branch_of(part)(part, np.inf, 1e5, 1e-9, 1e-9, 10.0)
                branch.run(1)
                cost = min(by_hand(name, at, width) for at in np.linspace(low, high, 11))
                assert branch.bound <= cost + 1e-9 * abs(cost)
                if spread == 1e-9:
                    assert branch.bound == pytest.approx(cost, rel=1e-7)


@pytest.mark.parametrize("name", COSTS)
def test_the_best_motion_is_proved(name: str) -> None:
    problem = problem_of(name, controls="constant")
    proof = dmoc.prove(problem, 1e-3)
    times = np.linspace(0.1, 0.95, 30)
    near = times[int(np.argmin([by_hand(name, at) for at in times]))]
    found = minimize_scalar(
        lambda at: by_hand(name, at), bounds=(near - 0.05, near + 0.04), method="bounded"
    ).fun
    assert proof.claim is Claim.OPTIMAL and proof.boxes < 200 and proof.left_out == ()
    assert proof.cost == pytest.approx(found, rel=1e-6)
    assert found - 1.1e-3 * abs(found) <= proof.bound <= found * (1 + 1e-9)


@pytest.mark.parametrize("order", [4, 6])
def test_steps_of_higher_orders(order: int) -> None:
    problem = problem_of("mixed", order)
    assert dmoc.prove(problem.but(controls="stages"), 1e-3).claim is Claim.OPTIMAL


def test_inputs_that_steps_share_are_named() -> None:
    shared = linear_problem(problem_of("tied", controls="linear"))
    assert shared.left_out == ("that steps share inputs where they meet",)


def test_what_is_linear_has_no_bounds_of_its_own() -> None:
    bounded = problem_of("uphill", bounds={"u": (-90, 90)})
    assert _largest_cost(linear_problem(bounded)) == np.inf
    problem = problem_of("tied")
    assert lower_bound(problem, 1.0, Deadline.after(9), growing=True)[0] == -np.inf


def test_a_place_may_bring_something_all_the_time() -> None:
    """At rest at -2 for a second: 2 (-2) + 1, and less where the input goes further down."""
    rest = {"x": -2, "x_dot": 0}
    problem = problem_of("uphill", controls="constant").but(sequence=[], start=rest, goal=rest)
    proof = dmoc.prove(problem, 1e-3)
    assert proof.claim is Claim.OPTIMAL and -3.1 < proof.bound <= proof.cost < -3


def test_exact_factors_tell_the_sign_of_a_matrix() -> None:
    def matrix(corner: float) -> Array:
        return np.array([[1.0, 2.0], [2.0, corner]])

    assert is_positive_definite(matrix(4 + 2.0**-50))
    assert not is_positive_definite(matrix(4.0))
    assert not is_positive_definite(matrix(4 - 2.0**-50))
    assert not is_positive_definite(np.array([[0.0]]))
