"""Proofs of contacts that last with what moves: lifts and belts, landings on them, and tables that
are left when they fall faster."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import sympy as sp
from scipy.optimize import minimize_scalar
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.proving.engine import branch_of, check_size
from dmoc.proving.global_proof import Claim
from dmoc.proving.linear_problem import linear_problem
from dmoc.proving.movers import Movers
from dmoc.proving.surface_shifts import Term, TermFunctions

t = dynamicsymbols._t
x, y, u, w = dynamicsymbols("x y u w")
LIFT, BELT = sp.Rational(3, 10) * sp.sin(4 * t), t / 2 + t**2 / 4


def bound_of(problem: dmoc.Problem, low: Any, high: Any, boxes: int = 40) -> float:
    """A bound for durations from ``low`` to ``high``, whatever the final time is."""
    sides = np.stack([np.atleast_1d(low), np.atleast_1d(high)], axis=1).astype(float)
    linear = linear_problem(problem.in_rates()).without_sums
    part = replace(linear, durations=sides, final_time=(0.0, 99.0))
    check_size(part)
    branch = branch_of(part)(part, np.inf, 1e9, 1e-9, 1e-9, 100.0)
    branch.run(boxes)
    return float(branch.bound)


def effort(d: Any, v: Any, then: Any, T: Any) -> Any:
    """Least integral of u^2/2 over a time T of 1 kg that goes from a speed v to another one by
    d."""
    a, b = v - d / T, then - d / T
    return 2 * (a * a + a * b + b * b) / T


@pytest.fixture(scope="module")
def ride() -> dmoc.Problem:
    """From rest to rest on a lift y = s(t), with the momentum p_x = x' + y'/3. The input acts on z
    = x + s/3 as on a mass of 1 kg, in the continuous problem and in steps of order 4 alike."""
    system = dmoc.MechanicalSystem(
        "coupled_lift", [x, y],
        (x.diff(t) ** 2 + y.diff(t) ** 2) / 2 + x.diff(t) * y.diff(t) / 3 - 90 * y,
        inputs=[u], forces={x: u}, cost=u**2 / 2 + 1, surfaces={"floor": y >= LIFT},
    )  # fmt: skip
    return dmoc.Problem(
        dmoc.build(system, order=4, backend="numpy"),
        start={"x": 0, "x_dot": 0, "y": 0, "y_dot": 1.2},
        goal={"x": 1, "x_dot": 0}, contacts=["floor"], sequence=[], steps=3,
        final_time=(0.3, 1.6),
    )  # fmt: skip


def ridden(T: Any) -> Any:
    """What the ride costs, with 1 for each second."""
    return T + effort(1 + 0.1 * np.sin(4 * T), 0.4, 0.4 * np.cos(4 * T), T)


def test_the_best_ride_on_a_lift(ride: dmoc.Problem) -> None:
    best = minimize_scalar(ridden, bounds=(0.3, 1.6), method="bounded").fun
    proof = dmoc.prove(ride)
    assert proof.claim is Claim.OPTIMAL and proof.boxes < 100 and proof.left_out == ()
    assert proof.cost == pytest.approx(best, rel=1e-7)


@pytest.mark.parametrize("width", [1e-9, 1e-3, 1e-2, 0.1, 0.3])
def test_bounds_of_rides_are_below_what_is_in_their_boxes(ride: dmoc.Problem, width: float) -> None:
    for middle in np.linspace(0.4, 1.3, 6):
        low, high = middle * (1 - width), middle * (1 + width)
        least = ridden(np.linspace(low, high, 200)).min()
        found = bound_of(ride, low, high, 1)
        assert found <= least * (1 + 1e-9)
        if width <= 1e-3:
            assert found == pytest.approx(least, rel=width + 1e-6)


def test_the_place_at_the_goal_decides_the_final_time(ride: dmoc.Problem) -> None:
    """The lift is at 0.2 m after asin(2/3)/4 s, and again after the rest of half a period."""
    proof = dmoc.prove(ride.but(goal={"x": 1, "x_dot": 0, "y": 0.2}))
    times = np.arcsin(2 / 3) / 4, (np.pi - np.arcsin(2 / 3)) / 4
    assert proof.claim is Claim.OPTIMAL and proof.boxes < 30
    assert proof.cost == pytest.approx(float(ridden(times[1])), rel=1e-7)
    assert bound_of(ride.but(goal={"y": 0.31}), 0.3, 1.6) == np.inf


def table(name: str, order: int, upward: Any, **more: Any) -> dmoc.Problem:
    """A block on a table that falls faster than it after a while, and a push along it."""
    system = dmoc.MechanicalSystem(
        name, [x, y], (x.diff(t) ** 2 + y.diff(t) ** 2) / 2 - sp.Rational(981, 100) * y,
        inputs=[u], forces={x: u, y: upward}, cost=u**2 / 2,
        surfaces={"table": y >= sp.Rational(3, 10) * sp.sin(7 * t)},
    )  # fmt: skip
    return dmoc.Problem(
        dmoc.build(system, order=order, backend="numpy"),
        start={"x": 0, "x_dot": 0, "y": 0, "y_dot": 2.1}, contacts=["table"], steps=3,
        **{"goal": {"x": 1}, "sequence": ["-table"], "final_time": 0.6, **more},
    )  # fmt: skip


def test_a_table_is_left_when_it_falls_faster() -> None:
    """0.3 7^2 sin(7 t) = g; 1 m in 0.6 s from rest costs 3/(2 0.6^3)."""
    proof = dmoc.prove(table("falling_table", 4, 0))
    assert proof.claim is Claim.OPTIMAL and proof.boxes < 30 and proof.left_out == ()
    assert proof.cost == pytest.approx(1.5 / 0.6**3, rel=1e-9)
    leaves = np.arcsin(9.81 / 0.3 / 49) / 7
    assert proof.solution is not None
    assert proof.solution.phases[0].duration == pytest.approx(leaves, rel=1e-9)
    again = np.pi / 7 - leaves
    for low, high in ((0.5, 0.99), (1.01, 1.5)):
        found = bound_of(table("falling_table", 4, 0), [low * leaves, 0.1], [high * leaves, 0.5])
        assert (found == np.inf) == (not low * leaves < again < high * leaves)


def test_the_force_at_which_it_leaves_depends_on_the_motion() -> None:
    """A spring and a damper press too."""
    problem = table("pressed_table", 2, -3 * (y - x) - y.diff(t), final_time=0.7).in_rates()
    solution = dmoc.solve(problem)
    d = np.array([phase.duration for phase in solution.phases])
    assert bound_of(problem, d * (1 - 1e-9), d * (1 + 1e-9)) == pytest.approx(
        solution.cost, rel=1e-6
    )
    later = d + np.array([0.05, -0.05])
    assert bound_of(problem, later * (1 - 1e-9), later * (1 + 1e-9)) > 1.2 * solution.cost


def refusal(name: str, start: dict[str, float], contacts: list[str], **surfaces: Any) -> str:
    system = dmoc.MechanicalSystem(
        name, [x, y], (x.diff(t) ** 2 + y.diff(t) ** 2) / 2 - 9.81 * y, inputs=[u], forces={x: u},
        cost=u**2, surfaces=surfaces,
    )  # fmt: skip
    problem = dmoc.Problem(
        dmoc.build(system, order=2), start={"x": 0, "x_dot": 0, **start},
        contacts=contacts, sequence=["-a"], final_time=1, steps=2,
    )  # fmt: skip
    with pytest.raises(dmoc.DmocError) as error:
        check_size(linear_problem(problem))
    return str(error.value)


def test_what_cannot_be_carried_is_refused_by_name() -> None:
    still = {"y": 0.0, "y_dot": 0.0}
    said = refusal("apart", still, ["a", "b"], a=y >= t**2, b=y >= t**2 / 2)
    assert said.startswith("the contacts a b move apart: proofs cover those that keep their")
    root = TermFunctions.sqrt(Term("time"))
    with pytest.raises(dmoc.DmocError, match="what is closed at the start moves at a speed witho"):
        Movers((0,), (), ((root, 0.5 / root),), 1.0, False).at_start(np.arange(2))


def carried(name: str, cost: Any, end: Any) -> dmoc.MechanicalSystem:
    """A block with coupled momenta and forces, on a rising slope with a belt."""
    return dmoc.MechanicalSystem(
        name, [x, y],
        (x.diff(t) ** 2 + y.diff(t) ** 2) / 2 + x.diff(t) * y.diff(t) / 3 - 9.81 * y
        - 2 * (x - y) ** 2,
        inputs=[u, w],
        forces={x: u - x.diff(t) / 5 + y.diff(t) / 3, y: w + u / 4 - x / 3},
        surfaces={"floor": y >= LIFT + x / 5 + sp.Rational(1, 10)}, tangents={"floor": x - BELT},
        friction={"floor": sp.Rational(1, 2)}, cost=cost, terminal_cost=end,
    )  # fmt: skip


def both(system: dmoc.MechanicalSystem, order: int) -> list[Kernels]:
    """Kernels that are quick to solve with, and those that are quick to read as numbers."""
    return [dmoc.build(system, order=order, backend=how) for how in ("auto", "numpy")]


@pytest.fixture(scope="module", params=[2, 4])
def belt(request: Any) -> list[Kernels]:
    system = carried(f"carried_{request.param}", (u**2 + w**2) / 2, 3 * x - y + x**2 - 5)
    return both(system, request.param)


def check_bounds(kernels: list[Kernels], sequence: list[str], **more: Any) -> None:
    """At the durations of a motion the bound is what it costs; around them it is no more."""
    start = {"x": 0, "x_dot": 0, "y": 1, "y_dot": 0}
    fields = {"start": start, "final_time": 1.5, "steps": 3, "controls": "constant", **more}
    compiled, problem = (
        dmoc.Problem(own, sequence=sequence, **fields).in_rates() for own in kernels
    )
    solution = dmoc.solve(compiled, starts=1)
    durations = np.array([phase.duration for phase in solution.phases])
    assert solution.converged
    for width in (1e-9, 0.02):
        found = bound_of(problem, durations * (1 - width), durations * (1 + width), 10)
        assert found <= solution.cost + 1e-7 * abs(solution.cost)
        if width == 1e-9:
            assert found == pytest.approx(solution.cost, rel=1e-6)


BOUNDED = {"bounds": {"x_dot": (-2, 1.6), "y_dot": (-3, 1.5)}, "final_time": 2.0}


@pytest.mark.parametrize(
    ("sequence", "more"),
    [
        (["+floor:slip+"], {"goal": {"x": 1.2}}),
        (["+floor:slip+"], {"goal": {"x": 1.2}, **BOUNDED}),
        (["+floor:slip-"], {"goal": {"x": 0.2, "x_dot": 0.3}}),
        (["+floor:stick"], {}),
        (["+floor:slip+", "floor:slip-"], {"goal": {"x": 0.9}, "via": [None, {"x": 0.8}]}),
        (["+floor:stick", "floor:slip-"], {"goal": {"x": -0.1}}),
        (["+floor:slip+", "-floor"], {"goal": {"x": 1.3, "y": 0.9}}),
        (
            ["floor:slip-"],
            {
                "start": {"x": 0, "x_dot": 0.5, "y": 0.1, "y_dot": 1.3},
                "contacts": ["floor:stick"],
                "goal": {"x": 0.2},
            },
        ),
    ],
)
def test_bounds_at_the_durations_of_a_motion_are_what_it_costs(
    belt: list[Kernels], sequence: list[str], more: dict[str, Any]
) -> None:
    check_bounds(belt, sequence, **more)


def test_costs_of_states_that_are_carried() -> None:
    cost = (u**2 + w**2) / 2 + 3 * (x - 1) ** 2 + (y.diff(t) - u) ** 2 / 5 + x.diff(t)
    check_bounds(both(carried("carried_states", cost, 0), 2), ["+floor:slip-"], goal={"x": 0.2})
