"""Integrals of abs, Max and Min: answers in closed form at all orders, what is refused, and what
the check says of integrals and of their bounds."""

from __future__ import annotations

from dataclasses import replace
from math import sqrt
from typing import Any

import numpy as np
import pytest
import sympy as sp
from answers import answer_of
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.discretisation import DISCRETISATIONS
from dmoc.base.errors import ModelError, ProblemError
from dmoc.inspection.kernel_check import kernel_errors

pytestmark = pytest.mark.slow

x, y, u = dynamicsymbols("x y u")
v, c, k = x.diff(), *sp.symbols("c k")
FORMS = [(order, form) for order, d in DISCRETISATIONS.items() for form in d.controls]
# 1 m from rest to rest in 3 s with forces of 1 N: pushed for tau, coasting, braked for tau, with
# tau (3 - tau) = 1.
TAU = (3 - sqrt(5)) / 2


def mass(**fields: Any) -> dmoc.MechanicalSystem:
    """1 kg on a line."""
    return dmoc.MechanicalSystem("mass", [x], v**2 / 2, inputs=[u], forces={x: u}, **fields)


def across(
    system: Any, order: int = 2, goal: dict[str, Any] | None = None, **changes: Any
) -> dmoc.Problem:
    """From rest to rest, 1 m further."""
    options: dict[str, Any] = {"steps": 120 // order, "final_time": 3, "bounds": {u: (-1, 1)}}
    kernels = dmoc.build(system, order=order, backend=changes.pop("backend", "auto"))
    return dmoc.Problem(kernels, {x: 0}, {x: 1, "x_dot": 0} | (goal or {}), **options | changes)


# Integrands, the sign with which they are priced, and the integrals of the motion above.
PRICED = {
    "fuel": (sp.Abs(u), 1, 2 * TAU),
    "pushing": (sp.Max(0, u), 1, TAU),
    "braking": (sp.Min(u, 0), -1, -TAU),
    "less of it": (-sp.Abs(u), -1, -2 * TAU),
    "work": (sp.Abs(u * v), 1, TAU**2),
    "work of a motor": (sp.Max(0, u * v), 1, TAU**2 / 2),
}


@pytest.mark.parametrize("name", PRICED)
def test_integrals_with_kinks_are_minimised(name: str) -> None:
    integrand, sign, exact = PRICED[name]
    system = mass(integrals={"own": integrand}, objective=sign * dmoc.total("own"))
    solution = answer_of(across(system), "ipm", starts=1)
    np.testing.assert_allclose(solution.trajectory.totals["own"], exact, rtol=3e-3)
    np.testing.assert_allclose(solution.cost, abs(exact), rtol=3e-3)
    assert solution.verification is not None and solution.verification.passed


@pytest.mark.parametrize(("order", "form"), FORMS)
def test_in_all_discretisations(order: int, form: str) -> None:
    """T - sqrt(T^2 - 4 d), and the least time with half of the greatest fuel: that of a pulse of
    1/2 N s, tau = 1/2 s, T = 1/tau + tau."""
    objective = c * dmoc.total("fuel") + k * dmoc.final_time
    system = mass(
        integrals={"fuel": sp.Abs(u)}, objective=objective, parameters={c: 1.0, k: 0.0}
    )  # fmt: skip
    problem = across(system, order, controls=form, steps=80)
    np.testing.assert_allclose(answer_of(problem, "ipm", starts=1).cost, 2 * TAU, rtol=2e-3)
    hurried = problem.but(
        parameters={"c": 0, "k": 1}, final_time=None, goal={x: 1, "x_dot": 0, "fuel": (None, 1)}
    )
    fastest = answer_of(hurried, "ipm", starts=1)
    np.testing.assert_allclose(fastest.final_time, 2.5, rtol=2e-4)
    np.testing.assert_allclose(fastest.trajectory.totals["fuel"], 1, rtol=1e-6)
    assert "fuel <= 1" in fastest.active_bounds
    # dT/dF = (1 - 1/tau^2)/2 at tau = F/2
    slope = dmoc.sensitivities(hurried, fastest)["goal"]["fuel"]
    np.testing.assert_allclose(slope, -1.5, rtol=0.05)


@pytest.mark.parametrize("order", DISCRETISATIONS)
def test_kinks_are_met_at_the_points_of_the_steps(order: int) -> None:
    """Where no kink lies inside a step, an integral has the order of the steps: the force that
    costs least effort is 2/9 (3 - 2 t), and int |u x'| the square of the largest speed, 1/2."""
    system = mass(cost=u**2, integrals={"work": sp.Abs(u * v)}, objective=dmoc.total("work") / 1e6)
    errors = []
    for steps in (8, 16):
        solution = answer_of(across(system, order, steps=steps, bounds={}), "ipm", starts=1)
        errors.append(abs(solution.trajectory.totals["work"] - 0.25))
    assert errors[0] < (0.01 if order == 2 else 1e-6)
    assert order > 2 or 3.5 < errors[0] / errors[1] < 4.5


@pytest.mark.parametrize("order", DISCRETISATIONS)
@pytest.mark.parametrize("backend", ["auto", "numpy"])
def test_slsqp_with_both_backends(order: int, backend: str) -> None:
    """Limits of hidden unknowns are among the rows that SLSQP has from the start."""
    system = mass(integrals={"fuel": sp.Abs(u)}, objective=dmoc.total("fuel"))
    solution = answer_of(across(system, order, steps=20, backend=backend), "slsqp", starts=1)
    np.testing.assert_allclose(solution.cost, 2 * TAU, rtol=0.01)


@pytest.mark.parametrize("order", DISCRETISATIONS)
def test_a_wall_and_back(order: int) -> None:
    """In 6 s: v (3 - v/2) = 1, and v is paid for twice."""
    fields = {"surfaces": {"wall": x <= 1}, "restitution": {"wall": 1.0}}
    system = mass(integrals={"fuel": sp.Abs(u)}, objective=dmoc.total("fuel"), **fields)
    problem = across(system, order, sequence=["wall"], final_time=6)
    solution = answer_of(problem.but(goal={x: 0, "x_dot": 0}), "ipm", starts=1)
    np.testing.assert_allclose(solution.cost, 2 * (3 - sqrt(7)), rtol=2e-3)


@pytest.mark.parametrize("order", [2, 4])
def test_work_against_friction(order: int) -> None:
    """mu m g d, if the friction brakes alone."""
    floor = dmoc.MechanicalSystem(
        "sledge", [x, y], (v**2 + y.diff() ** 2) / 2 - 9.81 * y, inputs=[u], forces={x: u},
        surfaces={"floor": y >= 0}, tangents={"floor": x}, friction={"floor": 0.1},
        integrals={"work": sp.Max(u * v, 0)}, objective=dmoc.total("work"),
    )  # fmt: skip
    problem = dmoc.Problem(
        dmoc.build(floor, order=order), {x: 0, y: 0}, {x: 1, "x_dot": 0}, bounds={u: (-5, 5)},
        contacts=["floor:slip+"], steps=40, final_time=2,
    )  # fmt: skip
    solution = answer_of(problem, "ipm", starts=2)
    np.testing.assert_allclose(solution.cost, 0.981, rtol=1e-3)


def test_a_design_within_the_kinks() -> None:
    """int |u - k| is 3 k at least, since int u = 0, and int Max(k - 1, 0) = 0 below 1: k is the
    smallest one that is allowed, 1/2, with forces below it, and the cost 3/2."""
    system = mass(
        parameters={k: 1.5},
        cost=sp.Abs(u - k),
        integrals={"stiff": sp.Max(k - 1, 0)},
        objective=dmoc.total("stiff"),
    )
    problem = across(system, 4, {}, design={"k": (0.5, 3)}, bounds={})
    solution = answer_of(problem, "ipm", starts=1)
    np.testing.assert_allclose([solution.design["k"], solution.cost], [0.5, 1.5], rtol=1e-5)
    assert solution.trajectory.totals["stiff"] == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("order", DISCRETISATIONS)
def test_an_integral_that_nothing_holds_is_that_of_the_motion(order: int) -> None:
    """Of the least effort int |u| = 1, whatever stood in the place of its kinks."""
    system = mass(cost=u**2, integrals={"fuel": sp.Abs(u), "back": sp.Min(u, 0)})
    solution = answer_of(across(system, order, bounds={}), "ipm", starts=1)
    totals = solution.trajectory.totals
    np.testing.assert_allclose([totals["fuel"], totals["back"]], [1, -0.5], rtol=1e-3)
    bounded = across(system, order, {"fuel": (None, 1.5)}, bounds={})
    loose = answer_of(bounded, "ipm", starts=1)
    np.testing.assert_allclose(loose.trajectory.totals["fuel"], 1, rtol=1e-3)


@pytest.mark.parametrize("order", DISCRETISATIONS)
def test_kernels_are_those_of_the_formulas(order: int) -> None:
    made = mass(
        cost=sp.Abs(u * v) + sp.Max(x, 0) ** 2 + u**2, parameters={k: 2.0},
        integrals={"fuel": sp.Abs(u), "back": sp.Min(k * u, 0), "plain": v**2},
        objective=dmoc.total("fuel") + dmoc.final_time,
    )  # fmt: skip
    errors = kernel_errors(made, dmoc.build(made, order=order))
    names = {own.kernel for own in errors}
    assert {"lifted_hess", "integral_jac", "integral_hess", "integrand", "hidden"} <= names
    assert max(own.error for own in errors) < 1e-9


REFUSED = {
    "falls": ({"own": sp.Abs(u)}, -dmoc.total("own"), "objective falls with total"),
    "rises": ({"own": sp.Min(u, 0)}, dmoc.total("own"), "objective rises with total"),
    "both ways": (
        {"own": sp.Abs(u) - sp.Abs(v)},
        0,
        "integral 'own' contains Abs.*cannot be split",
    ),
    "a jump": ({"own": u * sp.sign(u)}, 0, "integral 'own' contains sign.*whose jump"),
    "cases": ({"own": sp.Piecewise((u, u > 0), (0, True))}, 0, "integral 'own' contains Piecewise"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_kinks_that_nothing_would_hold_are_refused(case: str) -> None:
    integrals, objective, message = REFUSED[case]
    with pytest.raises(ModelError, match=message):
        mass(integrals=integrals, objective=objective)


@pytest.mark.parametrize("bound", [(1, None), 1, (0.5, 2)])
def test_bounds_on_the_loose_side_are_refused(bound: Any) -> None:
    system = mass(integrals={"fuel": sp.Abs(u), "back": sp.Min(u, 0)})
    with pytest.raises(ProblemError, match=r"goal of fuel = .*: expected \(None, upper\)"):
        across(system, goal={"fuel": bound})
    with pytest.raises(ProblemError, match=r"goal of back = .*: expected \(lower, None\)"):
        across(system, goal={"back": (None, -1)})


@pytest.mark.parametrize("most", [5, 2])
def test_a_cost_that_falls_with_a_loose_integral_is_told(most: float) -> None:
    """The sign of a parameter is not known to the model; the bound would be used up by what stands
    in the place of kinks."""
    system = mass(
        integrals={"fuel": sp.Abs(u)}, parameters={c: -1.0},
        objective=c * dmoc.total("fuel") + dmoc.final_time,
    )  # fmt: skip
    problem = across(system, goal={"fuel": (None, most)})
    for solution in (dmoc.solve(problem), dmoc.solve(problem.but(steps=None))):
        assert solution.status == "stalled"
        assert "the cost falls as fuel rises" in solution.message


def test_the_check_has_a_quadrature_of_its_own() -> None:
    """Of a motion whose integrals, or whose bounds, are other ones than those of its states and
    inputs."""
    system = mass(cost=u**2, integrals={"fuel": sp.Abs(u), "speed": v})
    problem = across(system, 4, {"fuel": (None, 1.2), "speed": (0.5, 1)}, bounds={})
    motion = answer_of(problem, "ipm", starts=1).trajectory
    assert motion.limits["fuel"] == (-np.inf, 1.2)
    wrong = replace(motion, totals=motion.totals | {"fuel": 1.05})
    message = dmoc.verify(wrong, problem.kernels).message
    assert "error of an integral 0.05 exceeds 0.02" in message
    for limits, text in (
        ({"fuel": (-np.inf, 0.98)}, "the bound of fuel (0.99"),
        ({"speed": (1.05, np.inf)}, "the bound of speed (1) is exceeded by 2.44 %"),
    ):
        check = dmoc.verify(replace(motion, limits=limits), problem.kernels)
        assert not check.passed and text in check.message
        assert check.path_excess > 0.005
    near = dmoc.verify(replace(motion, limits={"fuel": (-np.inf, 0.995)}), problem.kernels)
    assert near.passed and near.path_excess == pytest.approx(0.005 / 1.995, rel=0.02)


def test_integrals_of_coarse_motions_are_not_confirmed() -> None:
    """int sin(20 t)^2 over 3 s is 3/2 - sin(120)/80; four steps see something else."""
    system = mass(cost=u**2, integrals={"waves": sp.sin(20 * dynamicsymbols._t) ** 2})
    fine = answer_of(across(system, 4, bounds={}), "ipm", starts=1)
    exact = 1.5 - np.sin(120) / 80
    np.testing.assert_allclose(fine.trajectory.totals["waves"], exact, rtol=1e-3)
    coarse = dmoc.solve(across(system, 2, bounds={}, steps=8), "ipm", starts=1)
    assert coarse.status == "not_verified"
    assert "error of an integral" in coarse.message


@pytest.mark.parametrize("order", [2, 4, 6])
def test_an_integral_of_what_stands_still_is_none(order: int) -> None:
    """Nothing moves y: rounding errors of an integral that vanishes are no error."""
    x, y, u = dynamicsymbols("x y u")
    system = dmoc.MechanicalSystem(
        "beside", [x, y], (x.diff() ** 2 + y.diff() ** 2) / 2, inputs=[u], forces={x: u},
        cost=u**2, integrals={"work": u * y.diff()},
    )  # fmt: skip
    rest = {"x_dot": 0, "y_dot": 0}
    problem = dmoc.Problem(
        dmoc.build(system, order=order), {"x": 0, "y": 0.3} | rest,
        {"x": 1, "x_dot": 0, "work": (None, 0.5)}, final_time=1, steps=24,
    )  # fmt: skip
    solution = dmoc.solve(problem)
    assert solution.status == "solved"
    assert solution.verification is not None and solution.verification.passed
