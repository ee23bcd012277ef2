"""A pendulum that bounces off a wall through its rest position: the classical test of energy over
many impacts.

The angle theta is measured from the downward vertical; the wall keeps theta >= 0.
"""

from __future__ import annotations

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from dmoc.symbolic.drawing import Contact, Link, Point, Wall
from dmoc.symbolic.system import MechanicalSystem


def system() -> MechanicalSystem:
    """Return the bouncing pendulum; it has no inputs."""
    theta = dynamicsymbols("theta")
    m, l, g, wall = sp.symbols("m l g theta_wall")  # kg, m, m/s2, rad
    rate = theta.diff(dynamicsymbols._t)

    def at(angle: sp.Expr, distance: sp.Expr) -> tuple[sp.Expr, sp.Expr]:
        return distance * sp.sin(angle), -distance * sp.cos(angle)

    return MechanicalSystem(
        name="bouncing_pendulum",
        title="pendulum bouncing off a wall",
        coordinates=[theta],
        lagrangian=m * l**2 * rate**2 / 2 + m * g * l * sp.cos(theta),
        surfaces={"wall": theta >= wall},
        parameters={m: 1.0, l: 1.0, g: 9.81, wall: 0.0},
        units={theta: "rad"},
        drawing=[
            Wall(at(wall, sp.Rational(7, 10) * l), at(wall, sp.Rational(23, 20) * l)),
            Link((0, 0), at(theta, l)),
            Point(at(theta, l)),
            Contact("wall", at(theta, l), (sp.cos(theta), sp.sin(theta))),
        ],
    )
