"""A block that slides on a floor, and one that a belt takes along and a spring pulls back."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from scipy.integrate import solve_ivp
from sympy.physics.mechanics import dynamicsymbols

import dmoc

x, y, u = dynamicsymbols("x y u")
T, G = dynamicsymbols._t, 10.0


def block(mu: Any, along: Any = x, **fields: Any) -> dmoc.MechanicalSystem:
    """A unit mass on a floor, pushed along it."""
    kinetic = (x.diff() ** 2 + y.diff() ** 2) / 2
    stated = {"inputs": [u], "forces": {x: u}, "cost": u**2 / 2} | fields
    return dmoc.MechanicalSystem(
        "sliding_block", [x, y], kinetic - 10 * y, surfaces={"floor": y >= 0},
        tangents={"floor": along}, friction={"floor": mu}, **stated,
    )  # fmt: skip


def violin(force: Any) -> dmoc.MechanicalSystem:
    """A unit mass on a belt of 1 m/s, whose friction is the force, on a spring of 4 N/m."""
    return dmoc.MechanicalSystem(
        "violin", [x], x.diff() ** 2 / 2 - 2 * x**2, tangents={"belt": x - T},
        friction={"belt": force},
    )  # fmt: skip


def stick_and_slip(force: Callable[[float], float]) -> tuple[float, float]:
    """How long the violin, which 2 N hold, sticks and slips in its limit cycle, with the friction
    of a sliding speed: it breaks away at 4 x = 2, and slips until it is as fast as the belt."""

    def slope(_: float, s: Any) -> list[float]:
        return [s[1], -4 * s[0] + force(1 - s[1])]

    def caught(_: float, s: Any) -> float:
        return float(s[1] - 1)

    caught.direction, caught.terminal = 1, True  # type: ignore[attr-defined]
    way = solve_ivp(slope, (0, 10), [0.5, 1 - 1e-9], events=caught, rtol=1e-12, atol=1e-13,
                    first_step=1e-4)  # fmt: skip
    return 0.5 - float(way.y[0, -1]), float(way.t[-1])
