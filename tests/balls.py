"""Balls with spin that hit a rough floor in both of its directions, and what they do then."""

from __future__ import annotations

from typing import Any

import numpy as np
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.codegen.kernels import Array
from dmoc.codegen.system_kernels import kernels_of

x, y, z, a, b, c = PLACES = dynamicsymbols("x y z a b c")
r, g, mu, e_t = sp.symbols("r g mu e_t")
RADIUS, SHARE = 0.1, 2 / 5  # of m r^2, the moment of inertia
VALUES = {r: RADIUS, g: 9.81, mu: 0.2}
START = {"x": 0, "y": 0, "z": 0.3, "a": 0, "b": 0, "c": 0}
RATES = {"x_dot": 1, "y_dot": 0.5, "z_dot": -2, "a_dot": 0, "b_dot": 30, "c_dot": 10}


def spun(**more: Any) -> dmoc.MechanicalSystem:
    """A homogeneous ball of mass 1, whose angular velocity in the world is (a', b', c'); the
    directions of the floor are rates, and turn with c."""
    speeds = sum(q.diff() ** 2 for q in (x, y, z))
    turns = sum(q.diff() ** 2 for q in (a, b, c))
    s = x.diff() - r * b.diff(), y.diff() + r * a.diff()
    turned = sp.cos(c) * s[0] + sp.sin(c) * s[1], sp.cos(c) * s[1] - sp.sin(c) * s[0]
    fields: dict[str, Any] = {
        "coordinates": PLACES, "parameters": VALUES, "surfaces": {"floor": z >= r},
        "lagrangian": (speeds + sp.Rational(2, 5) * r**2 * turns) / 2 - g * z,
        "tangents": {"floor": turned}, "friction": {"floor": mu}, "cost": 1,
    }  # fmt: skip
    return dmoc.MechanicalSystem("spun_ball", **(fields | more))


def returning(**more: Any) -> dmoc.MechanicalSystem:
    """The same with tangential restitution, and tangential positions."""
    fields: dict[str, Any] = {
        "tangents": {"floor": (x - r * b, y + r * a)}, "tangential_restitution": {"floor": e_t},
        "parameters": VALUES | {e_t: 0.6},
    }  # fmt: skip
    return spun(**(fields | more))


def rolled(order: int, design: tuple[str, ...] = ()) -> dmoc.Problem:
    """A landing on the floor, rolling, and a hit of a smooth wall on the way."""
    system = spun(surfaces={"floor": z >= r, "wall": x <= 3 - r})
    return dmoc.Problem(
        kernels_of(system, order, design), start={**START, **RATES}, goal={"x": 0.4},
        sequence=["+floor", "wall"], steps=2, final_time=(0.1, 5), restitution={"wall": 0.8},
        design=dict.fromkeys(design, (0.3, 2.0)),
    )  # fmt: skip


def thrown(order: int, design: tuple[str, ...] = ()) -> dmoc.Problem:
    """Two hits on the floor and one on a wall: slides, sticks, and comes back."""
    tangents = {"wall": (y, z.diff() - r * b.diff()), "floor": spun().tangents["floor"]}
    tangents["floor"] = tangents["floor"], spun().tangents["floor_2"]
    system = spun(
        surfaces={"floor": z >= r, "wall": x <= 3 - r}, tangents=tangents,
        friction={"wall": 2 * mu, "floor": mu}, tangential_restitution={"wall": 0.6},
    )  # fmt: skip
    return dmoc.Problem(
        kernels_of(system, order, design), start={**START, **RATES, "a_dot": (-60, 60)},
        goal={"x": 0.4}, sequence=["floor:slip", "wall:stick", "floor:stick", "wall:slip"], steps=2,
        final_time=(0.1, 2), restitution=0.8, design=dict.fromkeys(design, (0.3, 2.0)),
    )  # fmt: skip


def bounced(
    v: Array, omega: Array, mu: float, e: float, e_t: float = 0.0
) -> tuple[Array, Array, Array]:
    """Velocity and angular velocity in the world after the hit of a ball of mass 1, and the
    impulses of the floor (3,)."""
    s = np.array([v[0] - RADIUS * omega[1], v[1] + RADIUS * omega[0]])
    P, size = -(1 + e) * v[2], float(np.hypot(*s))
    T = -min(mu * P, (1 + e_t) * 2 / 7 * size) * s / size
    impulse = np.array([*T, P])
    spin = np.cross([0, 0, -RADIUS], impulse) / (SHARE * RADIUS**2)
    return v + impulse, omega + spin, impulse
