"""Published problems with known answers, stated as a user of dmoc states them: no guess, no
windings, no shares of time.

Each function returns the problem for a number of steps of every phase and an order.  Data are those
of the sources named in ``RUNGS``; what a source leaves open is said at the function.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from math import pi
from typing import Any

import sympy as sp
from scipy.optimize import minimize_scalar
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.registry import find

t = dynamicsymbols._t
GRAVITY = 9.81  # m/s2, where the source says nothing else


@dataclass(frozen=True)
class Rung:
    """A problem with its known least cost as the steps get smaller.

    tolerance is what the cost may exceed the known one by, relative to it, at 50 steps a phase: the
    error of the discretisation, far below the distance to the next minimum.
    """

    name: str
    make: Callable[[int, int], dmoc.Problem]
    known: float
    tolerance: float
    source: str


def stated(system: dmoc.MechanicalSystem, order: int, **data: Any) -> dmoc.Problem:
    return dmoc.Problem(dmoc.build(system, order=order), **data)


# Smooth motions -----------------------------------------------------------------------------------


def little_torque(steps: int, order: int) -> dmoc.Problem:
    """A pendulum is swung up in minimum time by a torque that cannot hold it up."""
    a, u = dynamicsymbols("a u")
    system = dmoc.MechanicalSystem(
        "little_torque",
        coordinates=[a],
        inputs=[u],
        lagrangian=a.diff(t) ** 2 / 2 + GRAVITY * sp.cos(a),
        forces={a: u},
        parameters={},
        cost=1,
    )
    return stated(
        system,
        order,
        start={"a": 0.0},
        goal={"a": pi, "a_dot": 0.0},
        steps=steps,
        final_time=(0.5, 10.0),
        bounds={"u": (-2.0, 2.0)},
    )


def two_links(steps: int, order: int) -> dmoc.Problem:
    """A planar arm of two links, both driven, in minimum time."""
    a, b, u1, u2 = dynamicsymbols("a b u1 u2")
    v, w = a.diff(t), b.diff(t)
    inertias = sp.Rational(7, 3) * v**2 + sp.Rational(4, 3) * w**2
    system = dmoc.MechanicalSystem(
        "two_links",
        coordinates=[a, b],
        inputs=[u1, u2],
        lagrangian=(inertias + 3 * sp.cos(b - a) * v * w) / 2,
        forces={a: u1 - u2, b: u2},
        parameters={},
        cost=1,
    )
    return stated(
        system,
        order,
        start={"a": 0.0, "b": 0.5},
        goal={"a": 0.522, "b": 1.022, "a_dot": 0.0, "b_dot": 0.0},
        steps=steps,
        final_time=(1.0, 10.0),
        bounds={"u1": (-1.0, 1.0), "u2": (-1.0, 1.0)},
    )


def robot_arm(steps: int, order: int, lagrangian: bool = False) -> dmoc.Problem:
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
    system = dmoc.MechanicalSystem(
        name,
        coordinates=list(inputs),
        inputs=list(inputs.values()),
        lagrangian=sum(masses[q] * q.diff(t) ** 2 for q in inputs) / 2,
        forces=forces,
        parameters={},
        cost=1,
    )
    ends = {"rho": 4.5, "phi": pi / 4}
    return stated(
        system,
        order,
        start={**ends, "theta": 0.0},
        goal={**ends, "theta": 2 * pi / 3, "rho_dot": 0.0, "theta_dot": 0.0, "phi_dot": 0.0},
        steps=steps,
        final_time=(0.1, 100.0),
        bounds={
            **{f"u_{q}": (-1.0, 1.0) for q in ("rho", "theta", "phi")},
            "rho": (0.0, 5.0),
            "theta": (-pi, pi),
            "phi": (0.0, pi),
        },
    )


def robot_arm_lagrangian(steps: int, order: int) -> dmoc.Problem:
    """The same arm with all terms of its Lagrangian."""
    return robot_arm(steps, order, lagrangian=True)


def brachistochrone(steps: int, order: int) -> dmoc.Problem:
    """A bead falls from rest along a wire to be found: the wire's force is normal to the velocity.

    The input is the rate at which the velocity turns.
    """
    x, y, u = dynamicsymbols("x y u")
    v, w = x.diff(t), y.diff(t)
    system = dmoc.MechanicalSystem(
        "brachistochrone",
        coordinates=[x, y],
        inputs=[u],
        lagrangian=(v**2 + w**2) / 2 - 9.80665 * y,
        forces={x: -u * w, y: u * v},
        parameters={},
        cost=1,
    )
    return stated(
        system,
        order,
        start={"x": 0.0, "y": 10.0},
        goal={"x": 10.0, "y": 5.0},
        steps=steps,
        final_time=(0.5, 10.0),
    )


def furthest(steps: int, order: int) -> dmoc.Problem:
    """How far a unit mass can get in a second from rest to rest, with a limited force."""
    x, u = dynamicsymbols("x u")
    system = dmoc.MechanicalSystem(
        "furthest",
        coordinates=[x],
        inputs=[u],
        lagrangian=x.diff(t) ** 2 / 2,
        forces={x: u},
        parameters={},
        cost=0,
        terminal_cost=-x,
    )
    return stated(
        system,
        order,
        start={"x": 0.0},
        goal={"x_dot": 0.0},
        steps=steps,
        final_time=1.0,
        bounds={"u": (-1.0, 1.0)},
    )


def flying_robot(steps: int, order: int) -> dmoc.Problem:
    """Two double integrators, both limited, to a corner of a square in minimum time."""
    x, y, u, w = dynamicsymbols("x y u w")
    system = dmoc.MechanicalSystem(
        "flying_robot",
        coordinates=[x, y],
        inputs=[u, w],
        lagrangian=(x.diff(t) ** 2 + y.diff(t) ** 2) / 2,
        forces={x: u, y: w},
        parameters={},
        cost=1,
    )
    return stated(
        system,
        order,
        start={"x": 0.0, "y": 0.0},
        goal={"x": -100.0, "y": 100.0, "x_dot": 0.0, "y_dot": 0.0},
        steps=steps,
        final_time=(0.1, 1e4),
        bounds={"u": (-1.0, 1.0), "w": (-1.0, 1.0)},
    )


def container_crane(steps: int, order: int) -> dmoc.Problem:
    """A trolley and a hoist move a container in 9 s with the least swing.

    The source gives accelerations, here forces on unit masses, and limits of both speeds.
    """
    x, l, a, u1, u2 = dynamicsymbols("x l a u1 u2")
    speed, hoist, swing = (q.diff(t) for q in (x, l, a))
    system = dmoc.MechanicalSystem(
        "container_crane",
        coordinates=[x, l, a],
        inputs=[u1, u2],
        lagrangian=(speed**2 + hoist**2 + swing**2) / 2,
        forces={
            x: u1 + 17.2656 * a,
            l: u2,
            a: -(u1 + 27.0756 * a + 2 * hoist * swing) / l,
        },
        path_constraints={
            "forward": speed <= 2.5,
            "back": speed >= -2.5,
            "down": hoist <= 1,
            "up": hoist >= -1,
        },
        parameters={},
        cost=(a**2 + swing**2) / 2,
    )
    return stated(
        system,
        order,
        start={"x": 0.0, "l": 22.0, "a": 0.0, "l_dot": -1.0},
        goal={"x": 10.0, "l": 14.0, "a": 0.0, "x_dot": 2.5, "l_dot": 0.0, "a_dot": 0.0},
        steps=steps,
        final_time=9.0,
        bounds={"u1": (-2.83374, 2.83374), "u2": (-0.80865, 0.71265)},
    )


def hanging_load(steps: int, order: int) -> dmoc.Problem:
    """A cart moves a load that hangs on it, from rest to rest in minimum time, and stays on its
    way. The load does so by itself; the source demands it."""
    x, a, F = dynamicsymbols("x a F")
    rope, cart, load = 5, 1, 10
    speed = (x + rope * sp.sin(a)).diff(t) ** 2 + (rope * sp.cos(a)).diff(t) ** 2
    system = dmoc.MechanicalSystem(
        "hanging_load",
        coordinates=[x, a],
        inputs=[F],
        lagrangian=(cart * x.diff(t) ** 2 + load * speed) / 2 + load * GRAVITY * rope * sp.cos(a),
        forces={x: F},
        parameters={},
        cost=1,
    )
    return stated(
        system,
        order,
        start={"x": 0.0, "a": 0.0},
        goal={"x": 15.0, "a": 0.0, "x_dot": 0.0, "a_dot": 0.0},
        steps=steps,
        final_time=(0.1, 100.0),
        bounds={"F": (-20.0, 20.0), "x": (0.0, 15.0)},
    )


def quadrotor(steps: int, order: int) -> dmoc.Problem:
    """A planar quadrotor moves 5 m aside in minimum time, from rest to rest.

    The source commands the rate of tilt; here a torque does, which has no limit, on a unit inertia,
    and the rate has the limit; like the source, the cost has a trace of what else is commanded. The
    source's second tilt serves a motion of 1 cm across the plane.
    """
    y, z, tilt, thrust, torque = dynamicsymbols("y z tilt thrust torque")
    rate = tilt.diff(t)
    system = dmoc.MechanicalSystem(
        "quadrotor",
        coordinates=[y, z, tilt],
        inputs=[thrust, torque],
        lagrangian=(y.diff(t) ** 2 + z.diff(t) ** 2 + rate**2) / 2 - GRAVITY * z,
        forces={y: thrust * sp.sin(tilt), z: thrust * sp.cos(tilt), tilt: torque},
        path_constraints={
            "rate_up": rate <= 3,
            "rate_down": rate >= -3,
            "upright": sp.cos(tilt) >= sp.cos(0.55),
        },
        parameters={},
        cost=1 + 1e-8 * (thrust**2 + torque**2),
    )
    return stated(
        system,
        order,
        start={"y": 0.0, "z": 2.5, "tilt": 0.0, "tilt_dot": (-3.0, 3.0)},
        goal={"y": 5.0, "z": 2.5, "y_dot": 0.0, "z_dot": 0.0},
        steps=steps,
        final_time=(0.1, 20.0),
        bounds={"thrust": (0.0, 45.9)},
    )


def around_disc(steps: int, order: int) -> dmoc.Problem:
    """A point mass around a disc that stands in the middle of its straight way."""
    x, y, f_x, f_y = dynamicsymbols("x y f_x f_y")
    system = dmoc.MechanicalSystem(
        "around_disc",
        coordinates=[x, y],
        inputs=[f_x, f_y],
        lagrangian=(x.diff(t) ** 2 + y.diff(t) ** 2) / 2,
        forces={x: f_x, y: f_y},
        surfaces={"disc": x**2 + y**2 >= 0.09},
        parameters={},
        cost=f_x**2 + f_y**2,
    )
    return stated(
        system,
        order,
        start={"x": -1.0, "y": 0.0},
        goal={"x": 1.0, "y": 0.0, "x_dot": 0.0, "y_dot": 0.0},
        steps=steps,
        final_time=1.0,
    )


# Motions through collisions -----------------------------------------------------------------------


def against_wall(steps: int, order: int, wall: float = 0.5, goal: float = -pi) -> dmoc.Problem:
    """A pendulum hangs at rest, bounces once off a vertical wall and is at rest at an angle at 3 s;
    -pi is upright."""
    a, u = dynamicsymbols("a u")
    distance = sp.Symbol("distance")
    system = dmoc.MechanicalSystem(
        "against_wall",
        coordinates=[a],
        inputs=[u],
        lagrangian=a.diff(t) ** 2 / 2 + GRAVITY * sp.cos(a),
        forces={a: u},
        surfaces={"wall": sp.sin(a) <= distance},
        parameters={distance: 0.5},
        cost=u**2,
    )
    return stated(
        system,
        order,
        start={"a": 0.0},
        goal={"a": goal, "a_dot": 0.0},
        sequence=["wall"],
        steps=steps,
        final_time=3.0,
        parameters={"distance": wall},
    )


def hammer_and_nail(steps: int, order: int) -> dmoc.Problem:
    """A hammer drives a nail on a spring and a damper 2 cm deep, where it is to be at rest."""
    x, s, u = dynamicsymbols("x s u")
    system = dmoc.MechanicalSystem(
        "hammer_and_nail",
        coordinates=[x, s],
        inputs=[u],
        lagrangian=x.diff(t) ** 2 / 2 + 0.1 * s.diff(t) ** 2 / 2 - 250 * s**2,
        forces={x: u},
        dissipation=5 * s.diff(t) ** 2 / 2,
        surfaces={"contact": x <= s},
        parameters={},
        cost=u**2,
    )
    return stated(
        system,
        order,
        start={"x": -0.3, "s": 0.0},
        goal={"s": 0.02, "s_dot": 0.0},
        sequence=["contact"],
        steps=steps,
        final_time=(0.2, 1.0),
        restitution=0.3,
    )


def two_carts(steps: int, order: int) -> dmoc.Problem:
    """A cart from 0 knocks another one from 1, so that this rolls through 5 at 3 s."""
    a, b, u = dynamicsymbols("a b u")
    system = dmoc.MechanicalSystem(
        "two_carts",
        coordinates=[a, b],
        inputs=[u],
        lagrangian=(a.diff(t) ** 2 + b.diff(t) ** 2) / 2,
        forces={a: u},
        surfaces={"contact": a <= b},
        parameters={},
        cost=u**2 / 2,
    )
    return stated(
        system,
        order,
        start={"a": 0.0, "b": 1.0},
        goal={"b": 5.0},
        sequence=["contact"],
        steps=steps,
        final_time=3.0,
        restitution=0.5,
    )


def two_carts_cost() -> float:
    """Least cost of two_carts: the first cart meets the second at a time T with the speed v that
    leaves it (1 + e) v / 2, and the input is linear in time until then and zero after."""

    def cost(T: float) -> float:
        v = 4.0 / (0.75 * (3.0 - T))
        return 6 / T**3 - 6 * v / T**2 + 2 * v**2 / T

    return float(minimize_scalar(cost, bounds=(0.1, 2.9), method="bounded").fun)


def acrobot(steps: int, order: int) -> dmoc.Problem:
    """Two rods, driven at the elbow alone, swing up from hanging at rest; the tip bounces once off
    a vertical wall on the way.

    Each rod has mass 1 kg and length 1 m, and the angles are measured from the hanging posture.
    """
    a, b, u = dynamicsymbols("a b u")
    wall = sp.Symbol("wall")
    joint = sp.Matrix([sp.sin(a), -sp.cos(a)])
    along = sp.Matrix([sp.sin(b), -sp.cos(b)])
    inertia = sp.Rational(1, 12)
    kinetic = inertia * (a.diff(t) ** 2 + b.diff(t) ** 2) / 2
    height = 0
    for centre in (joint / 2, joint + along / 2):
        velocity = centre.diff(t)
        kinetic += velocity.dot(velocity) / 2
        height += centre[1]
    system = dmoc.MechanicalSystem(
        "acrobot",
        coordinates=[a, b],
        inputs=[u],
        lagrangian=sp.trigsimp(sp.expand(kinetic)) - GRAVITY * height,
        forces={a: -u, b: u},
        surfaces={"wall": joint[0] + along[0] <= wall},
        parameters={wall: 0.5},
        cost=u**2,
    )
    return stated(
        system,
        order,
        start={"a": 0.0, "b": 0.0},
        goal={"a": pi, "b": pi, "a_dot": 0.0, "b_dot": 0.0},
        sequence=["wall"],
        steps=steps,
        final_time=3.0,
    )


def hanging(steps: int, order: int) -> dmoc.Problem:
    """The cart-pendulum from hanging at rest, through a collision with its limiter."""
    reference = find("cart_pendulum_hanging")
    return dmoc.Problem(reference.kernels(order), **{**reference.defaults, "steps": steps})


# Known values without a source beside them are limits of both discretisations as the steps get
# smaller, of motions that the simulation confirms.
RUNGS = (
    Rung("pendulum with little torque, least time", little_torque, 5.7007, 1.5e-2, "N = 400"),
    Rung("two-link arm, least time", two_links, 2.98228, 1e-3, "PSOPT `twolinkarm`: 2.988662"),
    Rung("robot arm, least time", robot_arm, 9.14092, 1e-3, "COPS 3: 9.14138 at N = 200"),
    Rung("robot arm with its Lagrangian", robot_arm_lagrangian, 7.84472, 1e-3, "N = 400"),
    Rung("brachistochrone", brachistochrone, 1.8016031, 1e-3, "closed form"),
    Rung("furthest from rest to rest", furthest, -0.25, 1e-3, "closed form"),
    Rung("flying robot, least time", flying_robot, 20.0, 1e-3, "closed form; Dymos"),
    Rung("container crane", container_crane, 0.0051504, 2e-3, "PSOPT `crane`: 0.0051513"),
    Rung("crane with a hanging load", hanging_load, 5.79184, 3e-3, "opty: 5.894, of order 1"),
    Rung("planar quadrotor, least time", quadrotor, 1.49235, 1e-3, "CTDirect: 1.492"),
    Rung("around a disc", around_disc, 65.28, 2e-3, "N = 200"),
    Rung("pendulum and wall, goal -pi", against_wall, 31.22854, 2e-3, "N = 200"),
    Rung("pendulum and wall, goal -3", partial(against_wall, goal=-3.0), 29.38332, 2e-3, "N = 200"),
    Rung("pendulum and wall, goal -2", partial(against_wall, goal=-2.0), 18.11182, 1e-2, "N = 200"),
    Rung(
        "pendulum and nearer wall, goal -2.6",
        partial(against_wall, wall=0.4, goal=-2.6),
        26.73732,
        1e-2,
        "N = 200",
    ),
    Rung("hammer and nail", hammer_and_nail, 62.49558, 1e-2, "N = 200"),
    Rung("two carts, e = 0.5", two_carts, two_carts_cost(), 1e-3, "closed form"),
    Rung("acrobot and wall", acrobot, 65.611, 1e-2, "N = 200"),
    Rung("cart-pendulum from hanging", hanging, 37.38486, 5e-3, "N = 200"),
)
