"""Costs and path constraints with kinks: answers in closed form, and what is refused."""

from __future__ import annotations

from math import sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp
from answers import answer_of
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.discretisation import DISCRETISATIONS
from dmoc.base.errors import ProblemError
from dmoc.inspection.kernel_check import kernel_errors
from dmoc.symbolic.kinks import split

pytestmark = pytest.mark.slow

X, U = dynamicsymbols("x u")
v = X.diff()
K = sp.Symbol("k", positive=True)
FORMS = [(order, form) for order, d in DISCRETISATIONS.items() for form in d.controls]
# Of a motion of 1 m from rest to rest in 4 s with forces of 1 N: it is pushed for tau, coasts and
# is braked for tau, tau (4 - tau) = 1.
TAU = 2 - sqrt(3)


def system(**fields: Any) -> dmoc.MechanicalSystem:
    statement: dict[str, Any] = {
        "name": "kinked", "coordinates": [X], "lagrangian": v**2 / 2, "parameters": {},
        "inputs": [U], "forces": {X: U},
    }  # fmt: skip
    return dmoc.MechanicalSystem(**(statement | fields))


def across(order: int = 2, form: str | None = None, steps: int = 40, **fields: Any) -> dmoc.Problem:
    kernels = dmoc.build(system(**fields), order=order)
    return dmoc.Problem(
        kernels, {"x": 0.0}, {"x": 1.0, "x_dot": 0.0}, final_time=4.0, steps=steps, controls=form,
        bounds={"u": (-1.0, 1.0)},
    )  # fmt: skip


COSTS = {
    "fuel": (sp.Abs(U), {}, 2 * TAU),
    "square root": (sp.sqrt(U**2), {}, 2 * TAU),
    "pushing alone": (sp.Max(U, 0), {}, TAU),
    "by Min": (-sp.Min(U, 0), {}, TAU),
    "nested": (sp.Max(sp.Abs(U), U / 2, 0), {}, 2 * TAU),
    "with a price": (K * sp.Abs(U), {K: 3.0}, 6 * TAU),
    # Work of pushing and of braking, half the square of the largest speed each.
    "work": (sp.Abs(U) * sp.Abs(v), {}, TAU**2),
}


@pytest.mark.parametrize("name", COSTS)
def test_a_cost_with_a_kink_is_minimised(name: str) -> None:
    cost, parameters, exact = COSTS[name]
    solution = answer_of(across(cost=cost, parameters=parameters, steps=80), "ipm", starts=1)
    assert solution.cost == pytest.approx(exact, rel=5e-3)


@pytest.mark.parametrize(("order", "form"), [*FORMS, (2, "linear")])
def test_fuel_in_all_discretisations(order: int, form: str) -> None:
    """T - sqrt(T^2 - 4 d)."""
    solution = answer_of(across(order, form, cost=sp.Abs(U)), "ipm", starts=1)
    assert solution.cost == pytest.approx(2 * TAU, rel=3e-3)


def test_fuel_with_other_methods_and_from_many_starts() -> None:
    for method in ("slsqp", "ipm"):
        solution = answer_of(across(cost=sp.Abs(U), steps=20), method)
        assert solution.cost == pytest.approx(2 * TAU, rel=0.015)


def test_the_hidden_unknown_is_nowhere_to_be_seen(tmp_path: Path) -> None:
    problem = across(cost=sp.Abs(U))
    solution = dmoc.solve(problem, "ipm", starts=1)
    assert problem.kernels.inputs == ["u"] == list(solution.trajectory.inputs)
    assert solution.trajectory.phases[0].u.shape == (40, 1)
    assert set(solution.scale) == {"time", "cost", "x", "x_dot", "p_x", "u"}
    assert all(bound.startswith("u ") for bound in solution.active_bounds)
    assert "s_0" not in str(solution) and "hidden" not in str(solution)
    again = dmoc.Solution.load(solution.save(tmp_path / "fuel.dmoc"))
    assert dmoc.solve(problem, "ipm", guess=again).iterations <= 10
    with pytest.raises(dmoc.DmocError):
        problem.but(bounds={"s_0": (0, 1)})


def test_a_wall_and_fuel() -> None:
    """To the wall at 1 m and back in 6 s: v (3 - v/2) = 1, and v is paid for twice."""
    walled = system(cost=sp.Abs(U), surfaces={"wall": X <= 1})
    problem = dmoc.Problem(
        walled, {"x": 0.0}, {"x": 0.0, "x_dot": 0.0}, sequence=["wall"], steps=60, final_time=6.0,
        bounds={"u": (-1.0, 1.0)}, restitution=1.0,
    )  # fmt: skip
    solution = answer_of(problem, "ipm", starts=1)
    assert solution.cost == pytest.approx(2 * (3 - sqrt(7)), rel=2e-3)


@pytest.mark.parametrize(
    "limit",
    [sp.Abs(U) <= 1, sp.Max(U, -U) <= 1, sp.Min(-U, U) >= -1, sp.Abs(U) + sp.Abs(U) <= 2],
)
def test_a_limit_with_a_kink_is_two_limits(limit: Any) -> None:
    """|u| <= 1 for 1 s from rest: v = 1."""
    pushed = system(path_constraints={"most": limit}, terminal_cost=-v)
    problem = dmoc.Problem(pushed, {"x": 0.0}, steps=10, final_time=1.0)
    solution = answer_of(problem, "ipm", starts=1)
    assert solution.cost == pytest.approx(-1, rel=1e-9)
    assert np.abs(solution.trajectory.phases[0].u).max() <= 1 + 1e-9
    assert solution.active_bounds == ("path constraint most in 10 steps",)


@pytest.mark.parametrize("order", [2, 4])
def test_all_kernels_are_those_of_the_formulas(order: int) -> None:
    made = system(
        cost=sp.Abs(U * v) + sp.Max(X, 0) ** 2,
        path_constraints={"most": sp.Abs(U) + v**2 <= 9 + X},
    )
    errors = kernel_errors(made, dmoc.build(made, order=order))
    names = {c.kernel for c in errors}
    assert {"step_hess", "path_point_hess", "path_limit_jac", "hidden"} <= names
    assert max(c.error for c in errors) < 1e-9


C = sp.Symbol("c", nonnegative=True)
N = sp.Symbol("n", negative=True)
SIGNED = {  # cost, path constraint: the signs that the values of the parameters need
    "price": (K * sp.Abs(U), None, {"k": 1}),
    "dearer to push": (-N * sp.Max(U, 0) - K * sp.Min(U, 0), None, {"k": 1, "n": -1}),
    "two factors": ((1 + C) * sp.Abs(U) / K, None, {"k": 1, "c": 1}),
    "square of a price": (K**2 * sp.Abs(U), None, {}),
    "at least": (sp.Max(C, sp.Abs(U)) ** 2, None, {}),
    "beyond a dead band": (sp.Max(C, U) ** 2, None, {"c": 1}),
    "nested": (sp.Max(sp.Abs(U), K * sp.Abs(v), U / 2), None, {"k": 1}),
    "limit": (U**2, K * sp.Abs(U) + C * sp.Max(v, 0) <= 4, {"k": 1, "c": 1}),
    "limit of any sign": (U**2, sp.Abs(U) <= K, {}),
}


@pytest.mark.parametrize("name", SIGNED)
def test_a_split_knows_the_signs_that_it_needs(name: str) -> None:
    cost, limit, signs = SIGNED[name]
    used = [s for s in (K, C, N) if cost.has(s) or (limit is not None and limit.has(s))]
    made = system(
        cost=cost, parameters={s: -1.0 if s is N else 1.0 for s in used},
        path_constraints={"most": limit} if limit is not None else {},
    )  # fmt: skip
    assert {str(s): sign for s, sign in split(made).signs.items()} == signs


def test_a_price_of_the_other_sign_is_refused() -> None:
    """With a negative price effort would have to be as large as it can: no split says so."""
    text = r"^parameter k = -2: expected 0 or a positive number, the sign that its symbol is made"
    problem = across(cost=K * sp.Abs(U), parameters={K: 3.0}, steps=10)
    with pytest.raises(ProblemError, match=text):
        problem.but(parameters={"k": -2.0})
    free = answer_of(problem.but(parameters={"k": 0.0}), "ipm", starts=1)
    assert free.cost == pytest.approx(0, abs=1e-9)
    table = dmoc.sweep(problem, {"k": [3.0, -2.0]}, method="ipm", starts=1)
    assert table.status == ("solved", "refused") and "parameter k = -2" in table.message[1]


def test_a_negative_symbol_takes_no_positive_value() -> None:
    problem = across(cost=-N * sp.Abs(U), parameters={N: -3.0}, steps=10)
    with pytest.raises(ProblemError, match=r"^parameter n = 2: expected 0 or a negative number"):
        problem.but(parameters={N: 2.0})


def test_drag_is_no_kink_that_matters() -> None:
    """x'' = u - v |v|: a body held at 1 m/s for 1 s with u = 1."""
    made = system(forces={X: U - v * sp.Abs(v)}, cost=(U - 1) ** 2)
    problem = dmoc.Problem(made, {"x": 0.0, "x_dot": 1.0}, steps=20, final_time=1.0)
    solution = answer_of(problem, "ipm", starts=1)
    assert abs(solution.cost) < 1e-9
    assert solution.trajectory.phases[0].q[-1, 0] == pytest.approx(1.0, abs=1e-6)
