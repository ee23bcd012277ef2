"""Forces that several contacts share: what a motion tells of them, beside linear programs, and what
motions cost whose contacts bear no more than all of them together."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import sympy as sp
from scipy.optimize import linprog
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.base.errors import ProblemError
from dmoc.codegen.kernels import Array, Kernels
from dmoc.proving import shared_forces
from dmoc.proving.global_proof import Claim
from dmoc.proving.shared_forces import forces_of, told_of

t = dynamicsymbols._t
x, y, u, w = dynamicsymbols("x y u w")
mu, nu, f, g, a, b = sp.symbols("mu nu f g a b")
T = 1 - 1e-3  # all but the shortest phase


# What is told ------------------------------------------------------------------------------------


def cone(friction: list[float], rails: list[float]) -> tuple[Array, Array]:
    """Conditions C lam <= c of contacts with (normal, tangent) each, and of rails."""
    rows, limits, count = list[Array](), list[float](), 2 * len(friction) + len(rails)
    unit = np.eye(count)
    for i, share in enumerate(friction):
        rows += [unit[2 * i]] + [s * unit[2 * i + 1] + share * unit[2 * i] for s in (1, -1)]
        limits += [0.0] * 3
    for i, most in enumerate(rails, 2 * len(friction)):
        rows += [unit[i], -unit[i]]
        limits += [most] * 2
    return np.array(rows), np.array(limits)


@pytest.mark.parametrize(
    ("pushes", "friction", "rails"),
    [
        ([[0, 1], [1, 0], [0, 2], [1, 0]], [0.3, 0.5], []),
        ([[0, 1], [1, 0], [0, 1]], [0.5], [2.0]),
        ([[0, 0, 1], [1, 0, 0], [0, 0, 3], [0, 1, 0], [1, 1, 0]], [0.5, 0.7], [1.0]),
        ([[0, 1, 0.1], [1, 0, 0], [0, 1, 0.3], [1, 0, 0], [0, 2, 0.4], [1, 0, 0]], [1, 2, 3], []),
    ],
)  # fmt: skip
def test_what_is_told_is_all_that_there_is(
    pushes: list[list[float]], friction: list[float], rails: list[float]
) -> None:
    """Forces w fit all sums if and only if a linear program finds shares."""
    D, (C, c) = np.array(pushes, dtype=float), cone(friction, rails)
    told, inverse = told_of(D, zip(C, c.tolist(), strict=True)), forces_of(D)
    rng, seen = np.random.default_rng(0), set[bool]()
    for _ in range(60):
        lam = rng.normal(size=len(D)) - 0.4 * (C < 0).any(axis=0)
        force = D.T @ lam
        fits = linprog(0 * lam, C, c, D.T, force, (None, None)).status == 0
        excess = max(float(row @ inverse @ force) - limit for row, limit in told)
        assert (excess <= 0) == fits or abs(excess) < 1e-8
        np.testing.assert_allclose(D.T @ inverse @ force, force, atol=1e-12)
        seen.add(fits)
    assert seen == {True, False}


def test_too_many_sums_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shared_forces, "MOST_SUMS", 2)
    C, c = cone([0.5, 0.4], [])
    with pytest.raises(ProblemError, match="proofs take at most 2; give fewer contacts"):
        told_of(np.array([[0.0, 1], [1, 0], [0, 1], [1, 0]]), zip(C, c.tolist(), strict=True))


# Motions -----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def feet() -> Kernels:
    """A block of 1 kg on two feet that rub, whose cost asks for two forces."""
    system = dmoc.MechanicalSystem(
        "two_feet", [x, y], (x.diff(t) ** 2 + y.diff(t) ** 2) / 2 - g * y, inputs=[u, w],
        forces={x: u, y: w}, cost=((u - a) ** 2 + (w - b) ** 2) / 2,
        surfaces={"left": y >= 0, "right": 2 * y >= 0}, friction={"left": mu, "right": nu},
        tangents={"left": x, "right": x}, parameters={mu: 0.5, nu: 0.6, g: 0.0, a: 0.0, b: 0.0},
    )  # fmt: skip
    return dmoc.build(system, order=4, backend="numpy")


def check(
    kernels: Kernels, cost: float, contacts: list[str], gap: float = 1e-6, **more: Any
) -> None:
    fields = {"start": {"x": 0, "y": 0}, "sequence": [], "final_time": 1, "steps": 2, **more}
    proof = dmoc.prove(dmoc.Problem(kernels, contacts=contacts, **fields), gap)
    assert proof.claim is Claim.OPTIMAL and proof.left_out == ()
    assert proof.cost == pytest.approx(cost, rel=1e-5)


@pytest.mark.parametrize(("left", "right", "friction"), [(0.5, 0.6, 0.5), (0.2, 0.9, 0.45)])
def test_feet_hold_what_the_better_one_holds(
    feet: Kernels, left: float, right: float, friction: float
) -> None:
    """The force of the right foot counts twice: (u - a)^2/2 + w^2/2 where u = friction (g - w)."""
    check(
        feet, (9 - friction * 10) ** 2 / 2 / (1 + friction**2), ["left", "right"],
        parameters={"mu": left, "nu": right, "g": 10.0, "a": 9.0},
    )  # fmt: skip


@pytest.mark.parametrize("limit", [0.0, 1.0])
def test_a_rail_holds_what_a_floor_does_not(limit: float) -> None:
    system = dmoc.MechanicalSystem(
        "held", [y], y.diff(t) ** 2 / 2 - 10 * y, inputs=[w], forces={y: w}, cost=(w - 13) ** 2 / 2,
        surfaces={"floor": y >= 0}, tangents={"rail": y}, friction={"rail": f},
        parameters={f: limit},
    )  # fmt: skip
    kernels = dmoc.build(system, order=2, backend="numpy")
    check(kernels, (13 - 10 - limit) ** 2 / 2, ["floor", "rail"], start={"y": 0})


def test_what_slides_ends_in_its_direction(feet: Kernels) -> None:
    """From rest it would go forward: it stays for 3^2/2, and what does not lift it costs that."""
    parameters = {"mu": 0.2, "nu": 0.4, "g": 10.0, "a": 3.0, "b": 13.0}
    check(feet, 9.0, ["left:slip-", "right:slip-"], parameters=parameters)


def test_feet_that_land_together_share_the_impulse(feet: Kernels) -> None:
    """The impulse along the floor is at most 0.4 of that against it, the better foot's."""

    def effort(d: float, then: Array) -> Array:
        """Least integral of u^2/2 from rest to a speed, by a distance."""
        c, e = -d / T, then - d / T
        return np.asarray(2 * (c * c + c * e + e * e) / T)

    v = np.linspace(0, 5, 5001)
    cost = (effort(0.5, v) + effort(0.4, np.maximum(v / 0.4, 3 * 0.4 / 2 / T))).min()
    check(
        feet, cost, [], gap=1e-2, start={"x": 0, "y": 0.4}, sequence=["+left +right"],
        goal={"x": 0.5}, parameters={"mu": 0.2, "nu": 0.8},
    )  # fmt: skip
