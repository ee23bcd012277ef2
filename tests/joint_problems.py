"""Mechanisms in redundant coordinates, and the same ones in as many as they have degrees of
freedom."""

from __future__ import annotations

from typing import Any

import four_bar as example
import numpy as np
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc

X, Y, A, U = dynamicsymbols("x y a u")
T, G = dynamicsymbols._t, 9.81


def bob(**fields: Any) -> dmoc.MechanicalSystem:
    """A unit mass on a rod of one metre, with a moment about its end."""
    lagrangian = (X.diff(T) ** 2 + Y.diff(T) ** 2) / 2 - G * Y
    rod = {"rod": sp.Eq(X**2 + Y**2, 1)}
    return dmoc.MechanicalSystem(
        "bob", [X, Y], lagrangian, {}, [U], {X: -U * Y, Y: U * X}, cost=U**2, constraints=rod,
        **fields,
    )  # fmt: skip


def pendulum(**fields: Any) -> dmoc.MechanicalSystem:
    """The same by its angle from below."""
    lagrangian = A.diff(T) ** 2 / 2 + G * sp.cos(A)
    return dmoc.MechanicalSystem(
        "bob_by_angle", [A], lagrangian, {}, [U], {A: U}, cost=U**2, **fields
    )


def double_pendulum() -> tuple[dmoc.MechanicalSystem, dmoc.MechanicalSystem]:
    """Two masses on two rods with a moment on the first: by their places, and by angles from
    below."""
    x1, y1, x2, y2, b = dynamicsymbols("x1 y1 x2 y2 b")
    m, l = sp.symbols("m l", positive=True)
    parameters = {m: 0.7, l: 0.8}
    energies = [(x.diff(T) ** 2 + y.diff(T) ** 2) / 2 - G * y for x, y in ((x1, y1), (x2, y2))]
    rods = {"first": sp.Eq(x1**2 + y1**2, 1), "second": (x2 - x1) ** 2 + (y2 - y1) ** 2 - l**2}
    redundant = dmoc.MechanicalSystem(
        "rods", [x1, y1, x2, y2], energies[0] + m * energies[1], parameters, [U],
        {x1: -U * y1, y1: U * x1}, cost=U**2, constraints=rods,
    )  # fmt: skip
    first, second = A.diff(T), l * b.diff(T)
    upper = first**2 / 2 + G * sp.cos(A)
    lower = upper + second**2 / 2 + first * second * sp.cos(A - b) + G * l * sp.cos(b)
    minimal = dmoc.MechanicalSystem(
        "angles", [A, b], upper + m * lower, parameters, [U], {A: U}, cost=U**2
    )
    return redundant, minimal


def places(a: Any, b: Any) -> dict[str, Any]:
    """Places of the double pendulum at two angles."""
    x1, y1 = np.sin(a), -np.cos(a)
    return {"x1": x1, "y1": y1, "x2": x1 + 0.8 * np.sin(b), "y2": y1 - 0.8 * np.cos(b)}


def four_bar() -> dmoc.MechanicalSystem:
    """The hammer of examples/four_bar.py by the angle of its crank alone: the joint of coupler and
    rocker is where two circles meet."""
    r, c, s, d = example.CRANK, example.COUPLER, example.ROCKER, example.BASE
    crank, base = r * sp.Matrix([sp.cos(A), sp.sin(A)]), sp.Matrix([d, 0])
    across, hammer = base - crank, example.HAMMER
    square = across.dot(across)
    share = (c**2 - s**2 + square) / (2 * square)
    height = sp.sqrt(c**2 / square - share**2)
    coupler = share * across + height * sp.Matrix([-across[1], across[0]])
    rocker = crank + coupler - base

    def rate(arm: Any) -> Any:
        return (arm[0] * arm[1].diff(T) - arm[1] * arm[0].diff(T)) / arm.dot(arm)

    lagrangian = 0
    for mass, inertia, centre, turning in (
        (0.5, 0.5 * r**2 / 12, crank / 2, A.diff(T)),
        (hammer["mass"], hammer["inertia"], crank + hammer["centre"] / c * coupler, rate(coupler)),
        (0.8, 0.8 * s**2 / 12, base + rocker / 2, rate(rocker)),
    ):
        speed = centre.diff(T)
        lagrangian += mass * (speed.dot(speed) / 2 - G * centre[1]) + inertia * turning**2 / 2
    head = crank + hammer["length"] / c * coupler
    return dmoc.MechanicalSystem(
        "four_bar_by_crank", [A], lagrangian, {}, [U], {A: U},
        surfaces={"anvil": head[1] >= example.ANVIL}, cost=U**2,
    )  # fmt: skip
