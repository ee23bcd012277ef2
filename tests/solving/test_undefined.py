"""Masses that vanish and costs that are no numbers end in a status and are told."""

from __future__ import annotations

from typing import Any

import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols
from systems import unit_mass

import dmoc
from dmoc.base.errors import ProblemError
from dmoc.codegen.kernels import Kernels

X, U = dynamicsymbols("x u")


@pytest.fixture(scope="module")
def losing() -> Kernels:
    """A mass that falls along the way, is nothing at x = 1 and negative behind it."""
    m = sp.Symbol("m")
    return dmoc.build(
        dmoc.MechanicalSystem(
            "losing", [X], m * (1 - X) * X.diff() ** 2 / 2, {m: 1.0}, inputs=[U], forces={X: U},
            surfaces={"wall": X <= 3}, cost=U**2 / 2,
        )
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("method", ["slsqp", "ipm"])
@pytest.mark.parametrize(
    "changes",
    [
        {"goal": {"x": 2.0}},
        {"goal": {"x": 1.0, "x_dot": 0.0}},
        {"goal": {"x": 2.0, "x_dot": 0.0}, "bounds": {"u": (-1.0, 1.0)}},
        {"start": {"x": 0.999999}, "goal": {"x": 1.5}},
        {"start": {"x": 0.0, "x_dot": 5.0}, "goal": {"x": 3.0}, "sequence": ["wall"]},
        {"start": {"x": 0.0, "x_dot": 5.0}, "sequence": ["wall"], "restitution": 0.0},
    ],
)
def test_a_mass_that_vanishes_on_the_way_is_no_solution_and_is_told(
    losing: Kernels, method: str, changes: dict[str, Any]
) -> None:
    problem = dmoc.Problem(losing, **{"start": {"x": 0.0}, "steps": 6, "final_time": 1.0} | changes)
    solution = dmoc.solve(problem, method, iterations=60, starts=4)
    assert solution.status in {"not_verified", "infeasible", "iteration_limit"}
    assert "the mass matrix is singular or negative" in solution.message


@pytest.mark.slow
def test_a_cost_that_is_no_number_is_told() -> None:
    system = unit_mass("undefined", cost=U**2 + sp.sqrt(-1 - X**2))
    problem = dmoc.Problem(system, start={X: 0.0}, final_time=1.0, steps=5)
    solution = dmoc.solve(problem, "ipm", starts=1)
    assert not solution.solved and "the cost is not a finite number" in solution.message


@pytest.mark.slow
@pytest.mark.parametrize("method", ["slsqp", "ipm"])
@pytest.mark.parametrize(("m", "status"), [(1e-300, "solved"), (1e100, "solved")])
def test_masses_at_the_ends_of_the_numbers_end_in_a_status(
    losing: Kernels, method: str, m: float, status: str
) -> None:
    problem = dmoc.Problem(
        losing, start={"x": 0.0}, goal={"x": 0.5}, steps=6, final_time=1.0, parameters={"m": m}
    )
    assert dmoc.solve(problem, method, iterations=60).status == status


def test_a_mass_that_is_nothing_at_the_start_is_refused(losing: Kernels) -> None:
    for x in (1.0, 2.0):
        with pytest.raises(ProblemError, match="mass matrix is not positive definite at the start"):
            dmoc.Problem(losing, start={"x": x})
