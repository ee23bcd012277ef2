"""Bounds of boxes in which an input, or the start, leaves its own bound: at the longest durations
it is free, and what that costs is known."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.proving.branch import Branch
from dmoc.proving.linear_problem import linear_problem

x, u = dynamicsymbols("x u")


@pytest.fixture(scope="module")
def block() -> Kernels:
    system = dmoc.MechanicalSystem(
        "plain_block", [x], x.diff() ** 2 / 2, inputs=[u], forces={x: u}, cost=u**2 / 2
    )
    return dmoc.build(system, order=4, backend="numpy")


def missed(problem: dmoc.Problem, leaves: float, cost: Any) -> np.ndarray:
    """By what share bounds of boxes miss their least cost, and the widths of these; ``leaves`` is
    the duration from which on the bound is left, in these boxes."""
    linear, shares = linear_problem(problem.in_rates()), []
    for centre in leaves * np.array([0.99, 0.999]):
        for width in (0.002, 0.01, 0.02, 0.05):
            low, high = centre * (1 - width), centre * (1 + width)
            if high >= leaves:
                one = replace(linear, durations=np.array([[low, high]]))
                branch = Branch(one, np.inf, 1e3, 1e-12, 1e-12, 10.0)
                branch.run(1)
                shares.append([1 - branch.bound / cost(high), width])
    return np.transpose(shares)


@pytest.mark.parametrize(("sign", "bounds"), [(1, (-1e3, 6)), (-1, (-6, 1e3)), (1, (-6, 6))])
def test_an_input_leaves_its_bound(block: Kernels, sign: int, bounds: Any) -> None:
    """From rest to rest it begins with 6/T^2 and costs 6/T^3. With a centre at the bound, the price
    of that leaves a rest of second order."""
    problem = dmoc.Problem(
        block, start={"x": 0}, goal={"x": sign, "x_dot": 0}, sequence=[], final_time=(0.3, 3),
        steps=4, bounds={"u": bounds},
    )  # fmt: skip
    shares, widths = missed(problem, 1.0, lambda T: 6 / T**3)
    assert -1e-12 <= shares.min() < 1e-5 and (shares < widths**2).all()


def test_a_start_leaves_its_bound(block: Kernels) -> None:
    """With the speed 1 it is best to begin T/2 before the goal, for 1/(2 T)."""
    problem = dmoc.Problem(
        block, start={"x": (0, 0.3), "x_dot": 1}, goal={"x": 1, "x_dot": 0}, sequence=[],
        final_time=(0.3, 3), steps=4,
    )  # fmt: skip
    shares, _ = missed(problem, 1.4, lambda T: 1 / (2 * T))
    assert -1e-12 <= shares.min() < 1e-5
