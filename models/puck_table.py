"""A puck on an air table with four walls: the simplest system in which the best sequence of
collisions is worth a search.

Unfolding the walls makes every sequence a free motion, so that its cost is known in closed form.
"""

from __future__ import annotations

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from dmoc.symbolic.drawing import Contact, Point, Wall
from dmoc.symbolic.system import MechanicalSystem


def system() -> MechanicalSystem:
    """Return the puck; the inputs are the forces in both directions."""
    x, y = dynamicsymbols("x y")
    f_x, f_y = dynamicsymbols("f_x f_y")
    m, a, b = sp.symbols("m a b")  # kg, m, m: mass, width and height of the table
    t = dynamicsymbols._t
    return MechanicalSystem(
        name="puck_table",
        title="puck on an air table",
        coordinates=[x, y],
        inputs=[f_x, f_y],
        lagrangian=m * (x.diff(t) ** 2 + y.diff(t) ** 2) / 2,
        forces={x: f_x, y: f_y},
        surfaces={"west": x >= 0, "east": x <= a, "south": y >= 0, "north": y <= b},
        parameters={m: 1.0, a: 1.0, b: 1.0},
        cost=(f_x**2 + f_y**2) / 2,
        units={x: "m", y: "m", f_x: "N", f_y: "N"},
        drawing=[
            Wall((0, 0), (a, 0)),
            Wall((a, 0), (a, b)),
            Wall((a, b), (0, b)),
            Wall((0, b), (0, 0)),
            Point((x, y)),
            Contact("west", (x, y), (1, 0)),
            Contact("east", (x, y), (-1, 0)),
            Contact("south", (x, y), (0, 1)),
            Contact("north", (x, y), (0, -1)),
        ],
    )
