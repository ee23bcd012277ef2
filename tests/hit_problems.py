"""Problems with hits with friction, whose answers are known."""

from __future__ import annotations

from math import radians, sin, sqrt
from typing import Any

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc

X, Y, A, U, W = dynamicsymbols("x y a u w")
MU, R, K, G = sp.symbols("mu r k g")
M_X, M_XY, M_Y = sp.symbols("m_x m_xy m_y")
T = dynamicsymbols._t


def rod() -> dmoc.MechanicalSystem:
    """A uniform rod of length 1 whose lower left end meets a floor."""
    return dmoc.MechanicalSystem(
        "fallen_rod", [X, Y, A], (X.diff(T) ** 2 + Y.diff(T) ** 2 + A.diff(T) ** 2 / 12) / 2,
        {MU: 0.2}, surfaces={"floor": Y - sp.sin(A) / 2 >= 0},
        tangents={"floor": X - sp.cos(A) / 2}, friction={"floor": MU}, cost=1,
    )  # fmt: skip


def coupled() -> dmoc.MechanicalSystem:
    """Two coordinates whose masses couple the normal and the tangent."""
    x, y = X.diff(T), Y.diff(T)
    return dmoc.MechanicalSystem(
        "coupled_hit", [X, Y], (M_X * x**2 + 2 * M_XY * x * y + M_Y * y**2) / 2,
        {MU: 0.2, M_X: 1.0, M_XY: 0.1, M_Y: 1.0}, surfaces={"floor": Y >= 0}, tangents={"floor": X},
        friction={"floor": MU}, cost=1,
    )  # fmt: skip


def ball() -> dmoc.MechanicalSystem:
    """A ball with k = I / (m r^2), whose spin is driven."""
    speeds = X.diff(T) ** 2 + Y.diff(T) ** 2 + K * R**2 * A.diff(T) ** 2
    return dmoc.MechanicalSystem(
        "spinning_ball", [X, Y, A], speeds / 2 - G * Y, {R: 0.1, K: 0.4, G: 9.81, MU: 0.3},
        inputs=[U], forces={A: U}, surfaces={"floor": Y >= R}, tangents={"floor": X + R * A},
        friction={"floor": MU}, cost=U**2 / 2,
    )  # fmt: skip


def back(**changes: object) -> dmoc.Problem:
    """The ball is dropped while it moves ahead, and comes back to half a metre above its start."""
    statement: dict[str, object] = {
        "start": {"x": 0, "y": 1, "a": 0, "x_dot": 1.0}, "goal": {"x": 0, "y": 0.5},
        "sequence": ["floor:slip+:stick:late"], "steps": 20, "final_time": (0.2, 2),
        "restitution": 0.8,
    }  # fmt: skip
    return dmoc.Problem(ball(), **{**statement, **changes})  # type: ignore[arg-type]


def thrown(rates: tuple[float, ...], place: dict[str, float], **more: Any) -> dict[str, Any]:
    """A start from which the velocities are those of a hit after a tenth of a second."""
    names = [*place]
    start = {n: place[n] - 0.1 * v for n, v in zip(names, rates, strict=True)}
    start |= {f"{n}_dot": v for n, v in zip(names, rates, strict=True)}
    return {"start": start, "steps": 3, "durations": [(None, None), (0.02, 0.02)], **more}


RODS = (  # angle in degrees, velocities before, mu; velocities after, impulses; the way
    (45, (-0.3, -1, 0), 0.2, (-0.16363636, -0.31818182, -2.31416765), 0.681818182, 0.136363636,
     "slip-"),
    (60, (0.5, -1, 0), 0.3, (0.64219558, -0.08626835, -2.00232502), 0.913731651, 0.142195585,
     "slip+:slip-"),
    (60, (0.1, -1, 0), 0.6, (0.53689891, 0.17003607, -1.23991491), 1.170036071, 0.436898905,
     "slip+:stick"),
)  # fmt: skip


def fallen_rod(
    angle: float, v: tuple[float, ...], mu: float, course: str, steps: int = 3, order: int = 2
) -> dmoc.Problem:
    """A rod that hits the floor with e = 0.5."""
    a = radians(angle)
    place = {"x": 0.0, "y": sin(a) / 2, "a": a}
    return dmoc.Problem(
        dmoc.build(rod(), order=order),
        sequence=[f"floor:{course}"],
        restitution=0.5,
        parameters={"mu": mu},
        **(thrown(v, place) | {"steps": steps}),  # type: ignore[arg-type]
    )


def cost_back() -> float:
    """Cost of `back`: the torque is constant, and the friction sticks with -s / (1 + 1/k)."""
    down = sqrt(2 * 0.9 / 9.81)
    v_up = 0.8 * 9.81 * down
    up = (v_up + sqrt(v_up**2 - 2 * 9.81 * 0.4)) / 9.81  # the later time at half a metre
    slides = (1 + down / up) * (1 + 1 / 0.4)
    return (0.4 * 0.1 * (slides - 1) / down) ** 2 / 2 * down
