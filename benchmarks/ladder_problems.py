"""The ladder: published problems with known answers, stated as a user of dmoc states them, without
a guess, windings or shares of time.

Each function states a problem; ``RUNGS`` has them all, with what is known.  Data are those of the
sources named there; what a source leaves open is said at the function.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from math import pi

import sympy as sp
from ladder_smooth import (
    GRAVITY,
    Statement,
    around_disc,
    brachistochrone,
    container_crane,
    flying_robot,
    furthest,
    hanging_load,
    little_torque,
    quadrotor,
    robot_arm,
    stated,
    t,
    two_links,
)
from scipy.optimize import minimize_scalar
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.models.registry import find

SOLVED, BETTER, DEARER, BELOW = "solved", "better", "dearer", "below"


@dataclass(frozen=True)
class Rung:
    """A problem with its known least cost as the steps get smaller.

    tolerance is what the cost may differ from the known one by, relative to it, from 50 steps a
    phase on: the error of the discretisation, far below the distance to the next minimum.
    """

    name: str
    state: Callable[[], Statement]
    least_cost: float
    tolerance: float
    source: str

    def make(self, steps: int, order: int) -> dmoc.Problem:
        """The problem with steps of each phase."""
        statement = self.state()
        kernels = dmoc.build(statement.system, order=order)
        return dmoc.Problem(kernels, **{**statement.data, "steps": steps})

    def compared(self, cost: float, checked: bool) -> str:
        """What a minimum is worth: a cost well below the known one is an error of the
        discretisation, unless the simulation has confirmed the motion."""
        excess, allowed = cost - self.least_cost, self.tolerance * abs(self.least_cost)
        if abs(excess) <= allowed:
            return SOLVED
        if excess > 0:
            return DEARER
        return BETTER if checked else BELOW


def against_wall(wall: float = 0.5, goal: float = -pi) -> Statement:
    """A pendulum hangs at rest, bounces once off a vertical wall and is at rest at an angle at 3 s;
    -pi is upright."""
    a, u = dynamicsymbols("a u")
    distance = sp.Symbol("distance")
    return stated(
        "against_wall", [a], [u], a.diff(t) ** 2 / 2 + GRAVITY * sp.cos(a), {a: u},
        surfaces={"wall": sp.sin(a) <= distance}, parameters={distance: 0.5}, cost=u**2,
        start={"a": 0.0}, goal={"a": goal, "a_dot": 0.0}, sequence=["wall"], final_time=3.0,
        values={"distance": wall},
    )  # fmt: skip


def hammer_and_nail() -> Statement:
    """A hammer drives a nail on a spring and a damper 2 cm deep, where it is to be at rest."""
    x, s, u = dynamicsymbols("x s u")
    return stated(
        "hammer_and_nail", [x, s], [u], x.diff(t) ** 2 / 2 + 0.1 * s.diff(t) ** 2 / 2 - 250 * s**2,
        {x: u}, dissipation=5 * s.diff(t) ** 2 / 2, surfaces={"contact": x <= s}, cost=u**2,
        start={"x": -0.3, "s": 0.0}, goal={"s": 0.02, "s_dot": 0.0}, sequence=["contact"],
        final_time=(0.2, 1.0), restitution=0.3,
    )  # fmt: skip


def two_carts() -> Statement:
    """A cart from 0 knocks another one from 1, so that this rolls through 5 at 3 s."""
    a, b, u = dynamicsymbols("a b u")
    return stated(
        "two_carts", [a, b], [u], (a.diff(t) ** 2 + b.diff(t) ** 2) / 2, {a: u},
        surfaces={"contact": a <= b}, cost=u**2 / 2, start={"a": 0.0, "b": 1.0}, goal={"b": 5.0},
        sequence=["contact"], final_time=3.0, restitution=0.5,
    )  # fmt: skip


def two_carts_cost() -> float:
    """Least cost of two_carts: the first cart meets the second at a time T with the speed v that
    leaves it (1 + e) v / 2, and the input is linear in time until then and zero after."""

    def cost(T: float) -> float:
        v = 4.0 / (0.75 * (3.0 - T))
        return 6 / T**3 - 6 * v / T**2 + 2 * v**2 / T

    return float(minimize_scalar(cost, bounds=(0.1, 2.9), method="bounded").fun)


def acrobot() -> Statement:
    """Two rods, driven at the elbow alone, hang at rest; in 2 s the second one comes to rest above
    the first, and on the way the tip bounces once off a vertical wall.

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
    return stated(
        "acrobot", [a, b], [u], sp.trigsimp(sp.expand(kinetic)) - GRAVITY * height, {a: -u, b: u},
        surfaces={"wall": joint[0] + along[0] <= wall}, parameters={wall: 1.0}, cost=u**2,
        start={"a": 0.0, "b": 0.0}, goal={"a": 0.0, "b": pi, "a_dot": 0.0, "b_dot": 0.0},
        sequence=["wall"], final_time=2.0,
    )  # fmt: skip


def hanging() -> Statement:
    """The cart-pendulum from hanging at rest, through a collision with its limiter."""
    reference = find("cart_pendulum_hanging")
    return Statement(reference.system(), reference.defaults)


# Known values whose source is dmoc are limits of both discretisations as the steps get
# smaller, of motions that the simulation confirms.
RUNGS = (
    Rung(
        "pendulum with little torque, least time", little_torque, 5.7007, 1.5e-2,
        "dmoc, N = 400",
    ),
    Rung("two-link arm, least time", two_links, 2.98228, 1e-3, "PSOPT `twolinkarm`: 2.988662"),
    Rung("robot arm, least time", robot_arm, 9.14092, 1e-3, "COPS 3: 9.14138 at N = 200"),
    Rung(
        "robot arm with its Lagrangian", partial(robot_arm, lagrangian=True), 7.84472, 1e-3,
        "dmoc, N = 400",
    ),
    Rung("brachistochrone", brachistochrone, 1.8016031, 1e-3, "closed form"),
    Rung("furthest from rest to rest", furthest, -0.25, 1e-3, "closed form"),
    Rung("flying robot, least time", flying_robot, 20.0, 1e-3, "closed form; Dymos"),
    Rung("container crane", container_crane, 0.0051504, 5e-3, "PSOPT `crane`: 0.0051513"),
    Rung("crane with a hanging load", hanging_load, 5.79184, 3e-3, "opty: 5.894, of order 1"),
    Rung("planar quadrotor, least time", quadrotor, 1.49235, 1e-3, "CTDirect: 1.492"),
    Rung("around a disc", around_disc, 65.28, 2e-3, "dmoc, N = 200"),
    Rung("pendulum and wall, goal -pi", against_wall, 31.22854, 2e-3, "dmoc, N = 200"),
    Rung(
        "pendulum and wall, goal -3", partial(against_wall, goal=-3.0), 29.38332, 2e-3,
        "dmoc, N = 200",
    ),
    Rung(
        "pendulum and wall, goal -2", partial(against_wall, goal=-2.0), 18.11182, 1e-2,
        "dmoc, N = 200",
    ),
    Rung(
        "pendulum and nearer wall, goal -2.6", partial(against_wall, wall=0.4, goal=-2.6), 26.73732,
        1e-2, "dmoc, N = 200",
    ),
    Rung("hammer and nail", hammer_and_nail, 62.49558, 1e-2, "dmoc, N = 200"),
    Rung("two carts, e = 0.5", two_carts, two_carts_cost(), 1e-3, "closed form"),
    Rung("acrobot and wall", acrobot, 46.694, 5e-3, "dmoc, N = 200"),
    Rung("cart-pendulum from hanging", hanging, 37.38486, 5e-3, "dmoc, N = 200"),
)  # fmt: skip
