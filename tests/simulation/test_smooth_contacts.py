"""Contacts that stick and whose friction is zero: they hold nothing, and nothing is needed."""

from __future__ import annotations

from functools import cache
from typing import Any

import pytest
import sympy as sp
from contact_problems import MU, G, M, T, U, X, Y
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.codegen.kernels import Kernels

W = dynamicsymbols("w")
SHAKE = sp.Symbol("shake")


@cache
def floored() -> Kernels:
    """A block on a smooth floor, pushed along it and from above, whose least cost is that of a
    push."""
    return dmoc.build(
        dmoc.MechanicalSystem(
            "smooth_floor", [X, Y], M * (X.diff(T) ** 2 + Y.diff(T) ** 2) / 2 - M * G * Y,
            {M: 1.0, G: 9.81, MU: 0.0, SHAKE: 0.0}, inputs=[U, W],
            forces={X: U + SHAKE * sp.sin(30 * T), Y: W}, surfaces={"floor": Y >= 0},
            tangents={"floor": X}, friction={"floor": MU}, cost=(U - 1) ** 2 + W**2,
        )
    )  # fmt: skip


def answer(**fields: Any) -> dmoc.Solution:
    fields = {"goal": {}, "contacts": ["floor"], "steps": 10, "final_time": 1.0} | fields
    return dmoc.solve(dmoc.Problem(floored(), start={"x": 0, "y": 0}, **fields), starts=1)


@pytest.mark.slow
@pytest.mark.parametrize("sizes", [{}, {"m": 1e3}, {"g": 1e-3}])
@pytest.mark.parametrize(
    "course",
    [
        {},
        {"goal": {"x": 1}, "sequence": ["floor:slip+"]},
        {"goal": {"x": 1}, "contacts": ["floor:slip+"], "sequence": ["floor:stick"]},
    ],
)
def test_a_smooth_contact_on_which_nothing_acts_may_stick(
    course: dict[str, Any], sizes: dict[str, float]
) -> None:
    solution = answer(**course, parameters=sizes)
    assert solution.solved, solution.message


@pytest.mark.slow
def test_a_smooth_contact_holds_no_force() -> None:
    """The inputs, linear between nodes, balance the shaking at the nodes alone."""
    solution = answer(parameters={"shake": 0.1})
    assert solution.status == "not_verified"
    assert "where it holds 0 N" in solution.message
