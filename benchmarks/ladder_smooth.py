"""Published problems without collisions, stated as a user of dmoc states them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from math import pi
from typing import Any

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc

t = dynamicsymbols._t
GRAVITY = 9.81  # m/s2, where the source says nothing else


@dataclass(frozen=True)
class Statement:
    """A system, and the fields of a problem of it but for the kernels and the steps."""

    system: dmoc.MechanicalSystem
    data: Mapping[str, Any]


PARTS = {f.name for f in fields(dmoc.MechanicalSystem)} - {"restitution"}


def stated(
    name: str, coordinates: Sequence[Any], inputs: Sequence[Any], lagrangian: Any,
    forces: Mapping[Any, Any], values: Mapping[str, float] | None = None, **more: Any,
) -> Statement:  # fmt: skip
    """A statement; ``values`` of its parameters may be others than those of the system, which is
    in a hurry where nothing is said of its cost."""
    parts = {"parameters": {}, "cost": 1} | {k: v for k, v in more.items() if k in PARTS}
    system = dmoc.MechanicalSystem(
        name, coordinates, lagrangian, inputs=inputs, forces=forces, **parts
    )
    data = {k: v for k, v in more.items() if k not in PARTS}
    return Statement(system, data | ({"parameters": values} if values else {}))


def little_torque() -> Statement:
    """A pendulum is swung up in minimum time by a torque that cannot hold it up."""
    a, u = dynamicsymbols("a u")
    return stated(
        "little_torque", [a], [u], a.diff(t) ** 2 / 2 + GRAVITY * sp.cos(a), {a: u},
        start={"a": 0.0}, goal={"a": pi, "a_dot": 0.0}, final_time=(0.5, 10.0),
        bounds={"u": (-2.0, 2.0)},
    )  # fmt: skip


def two_links() -> Statement:
    """A planar arm of two links, both driven, in minimum time."""
    a, b, u1, u2 = dynamicsymbols("a b u1 u2")
    v, w = a.diff(t), b.diff(t)
    inertias = sp.Rational(7, 3) * v**2 + sp.Rational(4, 3) * w**2
    return stated(
        "two_links", [a, b], [u1, u2], (inertias + 3 * sp.cos(b - a) * v * w) / 2,
        {a: u1 - u2, b: u2}, start={"a": 0.0, "b": 0.5},
        goal={"a": 0.522, "b": 1.022, "a_dot": 0.0, "b_dot": 0.0}, final_time=(1.0, 10.0),
        bounds={"u1": (-1.0, 1.0), "u2": (-1.0, 1.0)},
    )  # fmt: skip


def robot_arm(lagrangian: bool = False) -> Statement:
    """An arm that turns about two angles and slides along itself, in minimum time.

    The source takes inertias that change with the motion without the terms by which they change the
    motion: unit masses with forces u / I(q). With ``lagrangian`` those terms are there.
    """
    rho, theta, phi = dynamicsymbols("rho theta phi")
    u_rho, u_theta, u_phi = dynamicsymbols("u_rho u_theta u_phi")
    length = 5
    I_phi = ((length - rho) ** 3 + rho**3) / 3
    inertias = {rho: sp.Integer(length), theta: I_phi * sp.sin(phi) ** 2, phi: I_phi}
    inputs = {rho: u_rho, theta: u_theta, phi: u_phi}
    if lagrangian:
        name, masses, forces = "robot_arm_lagrangian", inertias, inputs
    else:
        name, masses = "robot_arm", dict.fromkeys(inputs, 1)
        forces = {q: inputs[q] / inertias[q] for q in inputs}
    ends = {"rho": 4.5, "phi": pi / 4}
    return stated(
        name, list(inputs), list(inputs.values()),
        sum(masses[q] * q.diff(t) ** 2 for q in inputs) / 2, forces, start={**ends, "theta": 0.0},
        goal={**ends, "theta": 2 * pi / 3, "rho_dot": 0.0, "theta_dot": 0.0, "phi_dot": 0.0},
        final_time=(0.1, 100.0),
        bounds={
            **{f"u_{q}": (-1.0, 1.0) for q in ("rho", "theta", "phi")}, "rho": (0.0, 5.0),
            "theta": (-pi, pi), "phi": (0.0, pi),
        },
    )  # fmt: skip


def brachistochrone() -> Statement:
    """A bead falls from rest along a wire to be found: the wire's force is normal to the velocity.

    The input is the rate at which the velocity turns.
    """
    x, y, u = dynamicsymbols("x y u")
    v, w = x.diff(t), y.diff(t)
    return stated(
        "brachistochrone", [x, y], [u], (v**2 + w**2) / 2 - 9.80665 * y, {x: -u * w, y: u * v},
        start={"x": 0.0, "y": 10.0}, goal={"x": 10.0, "y": 5.0}, final_time=(0.5, 10.0),
    )  # fmt: skip


def furthest() -> Statement:
    """How far a unit mass can get in a second from rest to rest, with a limited force."""
    x, u = dynamicsymbols("x u")
    return stated(
        "furthest", [x], [u], x.diff(t) ** 2 / 2, {x: u}, cost=0, terminal_cost=-x,
        start={"x": 0.0}, goal={"x_dot": 0.0}, final_time=1.0, bounds={"u": (-1.0, 1.0)},
    )  # fmt: skip


def flying_robot() -> Statement:
    """Two double integrators, both limited, to a corner of a square in minimum time."""
    x, y, u, w = dynamicsymbols("x y u w")
    return stated(
        "flying_robot", [x, y], [u, w], (x.diff(t) ** 2 + y.diff(t) ** 2) / 2, {x: u, y: w},
        start={"x": 0.0, "y": 0.0}, goal={"x": -100.0, "y": 100.0, "x_dot": 0.0, "y_dot": 0.0},
        final_time=(0.1, 1e4), bounds={"u": (-1.0, 1.0), "w": (-1.0, 1.0)},
    )  # fmt: skip


def container_crane() -> Statement:
    """A trolley and a hoist move a container in 9 s with the least swing.

    The source gives accelerations, here forces on unit masses, and limits of both speeds.
    """
    x, l, a, u1, u2 = dynamicsymbols("x l a u1 u2")
    speed, hoist, swing = (q.diff(t) for q in (x, l, a))
    return stated(
        "container_crane", [x, l, a], [u1, u2], (speed**2 + hoist**2 + swing**2) / 2,
        {x: u1 + 17.2656 * a, l: u2, a: -(u1 + 27.0756 * a + 2 * hoist * swing) / l},
        path_constraints={
            "forward": speed <= 2.5, "back": speed >= -2.5, "down": hoist <= 1, "up": hoist >= -1,
        },
        cost=(a**2 + swing**2) / 2, start={"x": 0.0, "l": 22.0, "a": 0.0, "l_dot": -1.0},
        goal={"x": 10.0, "l": 14.0, "a": 0.0, "x_dot": 2.5, "l_dot": 0.0, "a_dot": 0.0},
        final_time=9.0, bounds={"u1": (-2.83374, 2.83374), "u2": (-0.80865, 0.71265)},
    )  # fmt: skip


def hanging_load() -> Statement:
    """A cart moves a load that hangs on it, from rest to rest in minimum time, and stays on its
    way. The load does so by itself; the source demands it."""
    x, a, F = dynamicsymbols("x a F")
    rope, cart, load = 5, 1, 10
    speed = (x + rope * sp.sin(a)).diff(t) ** 2 + (rope * sp.cos(a)).diff(t) ** 2
    return stated(
        "hanging_load", [x, a], [F],
        (cart * x.diff(t) ** 2 + load * speed) / 2 + load * GRAVITY * rope * sp.cos(a), {x: F},
        start={"x": 0.0, "a": 0.0}, goal={"x": 15.0, "a": 0.0, "x_dot": 0.0, "a_dot": 0.0},
        final_time=(0.1, 100.0), bounds={"F": (-20.0, 20.0), "x": (0.0, 15.0)},
    )  # fmt: skip


def quadrotor() -> Statement:
    """A planar quadrotor moves 5 m aside in minimum time, from rest to rest.

    The source commands the rate of tilt; here a torque does, which has no limit, on a unit inertia,
    and the rate has the limit; like the source, the cost has a trace of what else is commanded. The
    source's second tilt serves a motion of 1 cm across the plane.
    """
    y, z, tilt, thrust, torque = dynamicsymbols("y z tilt thrust torque")
    rate = tilt.diff(t)
    return stated(
        "quadrotor", [y, z, tilt], [thrust, torque],
        (y.diff(t) ** 2 + z.diff(t) ** 2 + rate**2) / 2 - GRAVITY * z,
        {y: thrust * sp.sin(tilt), z: thrust * sp.cos(tilt), tilt: torque},
        path_constraints={
            "rate_up": rate <= 3, "rate_down": rate >= -3, "upright": sp.cos(tilt) >= sp.cos(0.55),
        },
        cost=1 + 1e-8 * (thrust**2 + torque**2),
        start={"y": 0.0, "z": 2.5, "tilt": 0.0, "tilt_dot": (-3.0, 3.0)},
        goal={"y": 5.0, "z": 2.5, "y_dot": 0.0, "z_dot": 0.0}, final_time=(0.1, 20.0),
        bounds={"thrust": (0.0, 45.9)},
    )  # fmt: skip


def around_disc() -> Statement:
    """A point mass around a disc that stands in the middle of its straight way."""
    x, y, f_x, f_y = dynamicsymbols("x y f_x f_y")
    return stated(
        "around_disc", [x, y], [f_x, f_y], (x.diff(t) ** 2 + y.diff(t) ** 2) / 2, {x: f_x, y: f_y},
        surfaces={"disc": x**2 + y**2 >= 0.09}, cost=f_x**2 + f_y**2, start={"x": -1.0, "y": 0.0},
        goal={"x": 1.0, "y": 0.0, "x_dot": 0.0, "y_dot": 0.0}, final_time=1.0,
    )  # fmt: skip
