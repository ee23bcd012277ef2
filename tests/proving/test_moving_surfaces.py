"""Proofs beside surfaces that move: hits at places and speeds that depend on when they are."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import sympy as sp
from scipy.optimize import minimize
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.codegen.kernels import Array, Kernels
from dmoc.proving.branch import Branch
from dmoc.proving.global_proof import Claim
from dmoc.proving.linear import LinearProblem
from dmoc.proving.linear_problem import linear_problem
from dmoc.proving.proof_journal import digest
from dmoc.proving.surface_shifts import Term, TermFunctions, check_bounded, shifts_of

t = dynamicsymbols._t
x, u = dynamicsymbols("x u")
E = 0.7
PLACES = {"wall": 1 - t / 2 + sp.Rational(9, 10) * t**2, "floor": -1 - t / 3, "home": 0 * t}
MOVED = {
    name: [sp.lambdify(t, part) for part in (place, sp.diff(place, t))]
    for name, place in PLACES.items()
}


@pytest.fixture(scope="module")
def kernels() -> dict[int, Kernels]:
    system = dmoc.MechanicalSystem(
        "accelerated_wall", [x], x.diff(t) ** 2 / 2, inputs=[u], forces={x: u}, cost=u**2 / 2,
        surfaces={"wall": x <= PLACES["wall"], "floor": x >= PLACES["floor"]},
    )  # fmt: skip
    return {order: dmoc.build(system, order=order) for order in (4, 6)}


def and_back(kernels: Kernels, hits: list[str], **more: Any) -> dmoc.Problem:
    fields = {"final_time": 1, "steps": 4, "goal": {"x": 0, "x_dot": 0}, **more}
    return dmoc.Problem(kernels, start={"x": 0}, sequence=hits, restitution=E, **fields)


def cost_of(hits: list[str], times: Array, speeds: Array) -> float:
    """What it costs to hit at these times with these speeds, and to be back after a second. Phases
    cost 2 (a^2 + a b + b^2)/t, a and b the speeds at both ends, less d/t."""
    at, v, total = 0.0, 0.0, 0.0
    for before, until, hit, arrives in zip(
        [0.0, *times], [*times, 1.0], [*hits, "home"], [*speeds, 0.0], strict=True
    ):
        h, (to, rate) = until - before, (float(f(until)) for f in MOVED[hit])
        if h < 0.01 or (arrives - rate) * (-1 if hit == "floor" else 1) < 0:
            return 1e9
        a, b = v - (to - at) / h, arrives - (to - at) / h
        total += 2 * (a * a + a * b + b * b) / h
        at, v = to, (1 + E) * rate - E * arrives
    return total


@pytest.mark.parametrize("order", [4, 6])
def test_the_best_hit_of_an_accelerated_wall(kernels: dict[int, Kernels], order: int) -> None:
    proof = dmoc.prove(and_back(kernels[order], ["wall"]))
    expected = minimize(
        lambda z: cost_of(["wall"], z[:1], z[1:]), [0.5, 3.0], method="Nelder-Mead",
        options={"xatol": 1e-9, "fatol": 1e-11},
    ).fun  # fmt: skip
    assert proof.claim is Claim.OPTIMAL
    assert proof.cost == pytest.approx(expected, rel=1e-9)


def test_motions_through_two_hits_cost_no_less_than_bounds_of_their_boxes(
    kernels: dict[int, Kernels],
) -> None:
    hits, rng = ["wall", "floor"], np.random.default_rng(0)
    linear = linear_problem(and_back(kernels[4], hits).in_rates())
    for width in (1e-9, 0.01, 0.1):
        times = np.sort(rng.uniform(0.2, 0.8, 2)) + np.array([-0.1, 0.1])
        durations = np.diff([0, *times, 1])
        sides = np.stack([durations * (1 - width), durations * (1 + width)], axis=1)
        branch = Branch(replace(linear, durations=sides), np.inf, 1e6, 1e-9, 1e-9, 100.0)
        branch.run(20)
        best = minimize(
            lambda z, times=times: cost_of(hits, times, z), [4.0, -9.0], method="Nelder-Mead",
            options={"xatol": 1e-9, "fatol": 1e-11},
        ).fun  # fmt: skip
        assert best < 1e9 and branch.bound <= best * (1 + 1e-9)
        if width == 1e-9:
            assert branch.bound == pytest.approx(best, rel=1e-6)


HARMONIC = 1 + sp.Rational(3, 10) * sp.sin(2 * sp.pi * t)


@pytest.fixture(scope="module")
def shaken() -> Kernels:
    system = dmoc.MechanicalSystem(
        "shaken_wall", [x], x.diff(t) ** 2 / 2, inputs=[u], forces={x: u}, cost=u**2 / 2,
        surfaces={"wall": x <= HARMONIC},
    )  # fmt: skip
    return dmoc.build(system, order=4)


def without_gaps(linear: LinearProblem) -> LinearProblem:
    """A problem in which surfaces are passed through along phases."""
    phases = (replace(phase, most=phase.most + 99) for phase in linear.phases)
    return replace(linear, phases=tuple(phases))


def shaken_costs(first: Array, second: Array, speed: Array) -> Array:
    """What it costs to hit the shaken wall after a first duration with some speed, and to be back
    after a second one; infinite where that is no hit."""
    place, rate = 1 + 0.3 * np.sin(2 * np.pi * first), 0.6 * np.pi * np.cos(2 * np.pi * first)
    after = (1 + E) * rate - E * speed
    total = 0.0
    for a, b, h in (
        (-place / first, speed - place / first, first),
        (after + place / second, place / second, second),
    ):
        total += 2 * (a * a + a * b + b * b) / h
    return np.where(speed >= rate, total, np.inf)


def test_the_best_hit_of_a_shaken_wall_when_both_durations_are_free(shaken: Kernels) -> None:
    problem = dmoc.Problem(
        shaken, start={"x": 0}, goal={"x": 0, "x_dot": 0}, sequence=["wall"], restitution=E,
        final_time=(0.5, 2), steps=4,
    )  # fmt: skip
    proof = dmoc.prove(problem)
    first, share = np.meshgrid(np.linspace(0.1, 1.9, 91), np.linspace(0.05, 0.95, 91))
    second = (2 - first) * share
    speeds = np.linspace(-2, 6, 81)[:, None, None]
    costs = shaken_costs(first, second, speeds)
    at = np.unravel_index(int(np.argmin(costs)), costs.shape)
    near = [first[at[1:]], second[at[1:]], speeds[at[0], 0, 0]]

    def cost(z: Array) -> float:
        return float(shaken_costs(*z)) if min(z[:2]) > 0 and 0.5 <= z[0] + z[1] <= 2 else 1e9

    best = minimize(
        cost, near, method="Nelder-Mead", options={"xatol": 1e-10, "fatol": 1e-12, "maxiter": 2000}
    ).fun
    assert proof.claim is Claim.OPTIMAL and proof.boxes < 400
    assert proof.cost == pytest.approx(best, rel=1e-6)
    assert best * (1 - 1e-4) <= proof.bound <= best * (1 + 1e-9)


@pytest.mark.parametrize("width", [1e-9, 0.01, 0.1])
def test_hits_of_a_shaken_wall_cost_no_less_than_bounds_of_their_boxes(
    shaken: Kernels, width: float
) -> None:
    problem = dmoc.Problem(
        shaken, start={"x": 0}, goal={"x": 0, "x_dot": 0}, sequence=["wall"], restitution=E,
        final_time=(0.1, 3), steps=3,
    )  # fmt: skip
    linear, rng = without_gaps(linear_problem(problem.in_rates())), np.random.default_rng(0)
    for middle in rng.uniform(0.1, 1.4, (4, 2)):
        sides = np.stack([middle * (1 - width), middle * (1 + width)], axis=1)
        branch = Branch(replace(linear, durations=sides), np.inf, 1e9, 1e-9, 1e-9, 100.0)
        branch.run(1)
        first, second = rng.uniform(*sides.T, (1000, 2)).T
        costs = shaken_costs(first, second, np.linspace(-20, 40, 301)[:, None])
        assert branch.bound <= costs.min() * (1 + 1e-9)
        if width == 1e-9:
            assert branch.bound == pytest.approx(costs.min(), rel=1e-2)


RISING = 2 * sp.sin(3 * t) - sp.Rational(11, 10)


def rising_floor(order: int, **fields: Any) -> dmoc.Problem:
    """To a wall that goes away, above a floor that rises on the way."""
    system = dmoc.MechanicalSystem(
        "rising_floor", [x], x.diff(t) ** 2 / 2, inputs=[u], forces={x: u}, cost=u**2 / 2,
        surfaces={"floor": x >= RISING, "wall": x <= 1 + t / 5},
    )  # fmt: skip
    return dmoc.Problem(
        dmoc.build(system, order=order), start={"x": 0}, goal={"x": 0.2, "x_dot": 0},
        sequence=["wall"], restitution=0.5, final_time=(0.4, 1.6), **fields,
    )  # fmt: skip


def above_rising_floor(durations: Array, steps: int) -> float:
    """Least cost of the steps of order 2 for durations, by a quadratic program by hand; infinite
    where there is none."""
    n, time = 2 * steps, 0.0
    one = np.eye(n + 1)[n]
    q, p, H, zero, least = 0 * one, 0 * one, np.zeros(n), [], []
    for k in range(n):
        h = durations[k // steps] / steps
        unit = np.eye(n + 1)[k]
        q, p, time = q + h * p + h * h / 2 * unit, p + h * unit, time + h
        H[k] = h
        least.append(q - (2 * np.sin(3 * time) - 1.1) * one)
        if k == steps - 1:
            zero.append(q - (1 + time / 5) * one)
            least.append(p - one / 5)
            p = 1.5 / 5 * one - 0.5 * p
        elif k != steps:
            least.append((1 + time / 5) * one - q)
    A, G = np.array([*zero, q - 0.2 * one, p]), np.array(least)
    found = minimize(
        lambda z: float(H @ z**2 / 2), np.zeros(n), jac=lambda z: H * z, method="SLSQP",
        constraints=[
            {"type": "eq", "fun": lambda z: A @ np.append(z, 1), "jac": lambda _: A[:, :n]},
            {"type": "ineq", "fun": lambda z: G @ np.append(z, 1), "jac": lambda _: G[:, :n]},
        ],
        options={"ftol": 1e-13, "maxiter": 200},
    )  # fmt: skip
    return float(found.fun) if found.success else np.inf


def test_gaps_to_what_moves_hold_along_phases() -> None:
    problem = rising_floor(2, steps=4, controls="constant")
    proof = dmoc.prove(problem, 1e-3, None)  # however slow a machine is
    best = [phase.duration for phase in proof.solution.phases]
    assert proof.claim is Claim.OPTIMAL and proof.left_out == () and proof.boxes < 300
    assert proof.cost == pytest.approx(above_rising_floor(np.array(best), 4), rel=1e-8)
    linear, rng = linear_problem(problem.in_rates()), np.random.default_rng(0)
    for width in (1e-8, 1e-3, 0.1):
        for middle in rng.uniform([0.5, 0.3], [1, 0.6], (3, 2)):
            sides = np.stack([middle * (1 - width), middle * (1 + width)], axis=1)
            part = replace(linear, durations=sides, final_time=(0.1, 3.0))
            branch = Branch(part, np.inf, 1e9, 1e-9, 1e-9, 100.0)
            branch.run(1)
            cost = min(above_rising_floor(rng.uniform(*sides.T), 4) for _ in range(3))
            assert branch.bound <= cost * (1 + 1e-6)
            if width == 1e-8:
                assert branch.bound == pytest.approx(cost, rel=1e-5)


def test_the_ends_of_steps_alone_keep_away_from_what_moves() -> None:
    problem = rising_floor(4, steps=2)
    proof = dmoc.prove(problem, 1e-3)
    assert proof.claim is Claim.OPTIMAL and proof.left_out == ()
    linear = linear_problem(problem.in_rates())
    best = np.array([phase.duration for phase in proof.solution.phases])[:, None]
    there = replace(linear, durations=best * np.array([1 - 1e-9, 1 + 1e-9]), final_time=(0.1, 3.0))
    branch = Branch(there, np.inf, 1e9, 1e-9, 1e-9, 100.0)
    branch.run(20)
    assert branch.bound == pytest.approx(proof.cost, rel=1e-6)
    branch = Branch(without_gaps(linear), np.inf, 1e9, 1e-4, 1e-9, 100.0)
    branch.run(2000)
    assert branch.bound < 0.9 * proof.bound  # the floor is in the way


def refusal(place: Any, name: str) -> str:
    """What is said of a table that moves."""
    system = dmoc.MechanicalSystem(
        name, [x], x.diff(t) ** 2 / 2, inputs=[u], forces={x: u}, cost=u**2,
        surfaces={"table": x >= place},
    )  # fmt: skip
    kernels = dmoc.build(system, order=2, backend="numpy")
    problem = dmoc.Problem(kernels, start={"x": 3}, sequence=["table"], final_time=2)
    with pytest.raises(dmoc.DmocError) as error:
        linear_problem(problem)
    return str(error.value)


def test_what_has_no_bounds_is_refused_by_name() -> None:
    said = refusal(sp.Abs(t - 1) / 9, "kinked_table")
    assert said.startswith("the gap to table changes with the time by a function that proofs have")
    said = refusal(1 / (t - 1), "lost_table")
    assert said.startswith("the motion of table has no bounds from 0.9922 to 1 s")
    said = refusal(x * t / 9, "turned_table")
    assert said.startswith("the gap to table is no affine function of x and the time together")
    busy = time = Term("time")
    for _ in range(256):
        busy = TermFunctions.sin(busy + time)
    with pytest.raises(
        dmoc.DmocError, match=r"table takes 513 operations: proofs take at most 512"
    ):
        check_bounded(shifts_of([busy]), "table", 1.0)


def test_a_journal_is_one_of_what_moves(shaken: Kernels) -> None:
    problem = dmoc.Problem(shaken, start={"x": 0}, sequence=["wall"], final_time=2)
    linear = linear_problem(problem.in_rates())
    slower = replace(linear, shifts=replace(linear.shifts, constants=linear.shifts.constants / 2))
    assert digest(linear, 1.0, 1e-4) != digest(slower, 1.0, 1e-4)
