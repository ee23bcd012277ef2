"""Pendulum on a cart with limiters (Kern & Gross 2018): the pendulum's angle is stopped on both
sides.

The angle alpha is measured from the horizontal, so that alpha = pi/2 is upright.  The point mass is
at (x + l cos(alpha), l sin(alpha)); the input is the horizontal force on the cart.  The limiters
have the names of the ends of the angle's range, which say nothing of the side where they are seen.
"""

from __future__ import annotations

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from dmoc.symbolic.drawing import Box, Contact, Link, Point, Wall
from dmoc.symbolic.system import MechanicalSystem


def system() -> MechanicalSystem:
    """Return the cart-pendulum with the parameters of the source."""
    alpha, x = dynamicsymbols("alpha x")
    force = dynamicsymbols("F")
    m_p, m_c, l, g = sp.symbols("m_p m_c l g", positive=True)  # kg, kg, m, m/s2
    a_min, a_max = sp.symbols("alpha_min alpha_max")  # rad
    t = dynamicsymbols._t

    x_p = x + l * sp.cos(alpha)
    y_p = l * sp.sin(alpha)
    kinetic = m_c * x.diff(t) ** 2 / 2 + m_p * (x_p.diff(t) ** 2 + y_p.diff(t) ** 2) / 2
    potential = m_p * g * y_p

    upwards = (-sp.sin(alpha), sp.cos(alpha))  # where alpha grows

    def limiter(angle: sp.Symbol) -> list[tuple[sp.Expr, sp.Expr]]:
        reach = (sp.Rational(3, 4) * l, sp.Rational(11, 10) * l)
        return [(x + r * sp.cos(angle), r * sp.sin(angle)) for r in reach]

    return MechanicalSystem(
        name="cart_pendulum",
        title="pendulum on a cart with limiters",
        coordinates=[alpha, x],
        inputs=[force],
        lagrangian=sp.trigsimp(sp.expand(kinetic - potential)),
        forces={x: force},
        surfaces={"lower": alpha >= a_min, "upper": alpha <= a_max},
        parameters={
            m_p: 1.0,
            m_c: 1.0,
            l: 0.5,
            g: 10.0,
            a_min: float(sp.pi / 10),
            a_max: float(9 * sp.pi / 10),
        },
        cost=force**2 / 2,
        units={alpha: "rad", x: "m", force: "N"},
        drawing=[
            Wall(*limiter(a_min)),
            Wall(*reversed(limiter(a_max))),
            Box((x, 0), l / 2, l / 4),
            Link((x, 0), (x_p, y_p)),
            Point((x_p, y_p)),
            Contact("lower", (x_p, y_p), upwards),
            Contact("upper", (x_p, y_p), (sp.sin(alpha), -sp.cos(alpha))),
        ],
    )
