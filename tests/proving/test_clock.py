"""Proofs beside surfaces that move with a constant acceleration: hits at places and speeds that
depend on when they are."""

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
from dmoc.proving.linear_problem import linear_problem

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


def test_what_moves_otherwise_is_refused_by_name() -> None:
    shaken = dmoc.MechanicalSystem(
        "shaken_table", [x], x.diff(t) ** 2 / 2, inputs=[u], forces={x: u}, cost=u**2,
        surfaces={"table": x >= sp.sin(3 * t) / 9},
    )  # fmt: skip
    kernels = dmoc.build(shaken, order=2, backend="numpy")
    problem = dmoc.Problem(kernels, start={"x": 1}, sequence=["table"], final_time=2)
    with pytest.raises(dmoc.DmocError, match=r"the gap to table is .* constant acceleration"):
        dmoc.prove(problem)
