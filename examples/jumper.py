r"""A leg that jumps
================

How does a leg with a knee jump, with the least torques?

A trunk on a vertical rail stands on a thigh and a shank. It shall rise from a crouch, fly for a
quarter of a second, land, and be back at rest in its crouch. Floor and friction hold the foot while
it stands; at the landing they take its speed,

.. math::

   p^- - p^+ = P \, \nabla g + \mathcal{T} \, \nabla \tau, \qquad |\mathcal{T}| \le \mu P .

The machine is built body by body, as in R. Featherstone, *Rigid Body Dynamics Algorithms*, Springer
2008. In the air nothing but its weight acts along the rail: the vertical momentum falls by
:math:`m g T`.

Run:  ``python examples/jumper.py [FOLDER]``
"""

from math import cos

import sympy as sp
from example_report import show
from sympy.physics.mechanics import dynamicsymbols

import dmoc

LINK, CROUCH, FLIGHT, GRAVITY = 0.25, 0.8, 0.25, 9.81
MASSES = {"trunk": 4.0, "thigh": 0.5, "shank": 0.3}


# %%
# The model
# ---------
# The leg is five lines; the rest says where the floor is, and what effort costs.


def system() -> dmoc.MechanicalSystem:
    y, hip, knee, u, w = dynamicsymbols("y hip knee u w")
    world = dmoc.planar.World(gravity=GRAVITY)
    trunk = world.slide(y, direction=(0, 1), mass=MASSES["trunk"], box=(0.2, 0.1))
    thigh = trunk.hinge(hip, length=LINK, mass=MASSES["thigh"], torque=u, zero=-sp.pi / 2)
    shank = thigh.hinge(knee, length=LINK, mass=MASSES["shank"], torque=w)
    foot = shank.tip
    return world.system(
        "jumper",
        inputs=[u, w],
        surfaces={"floor": foot[1] >= 0},
        tangents={"floor": foot[0]},
        friction={"floor": 0.8},
        cost=u**2 + w**2,
        units={u: "N m", w: "N m"},
        drawing=[dmoc.Wall((-0.3, 0), (0.3, 0)), dmoc.Contact("floor", foot)],
    )


# %%
# The problem
# -----------
# It stands, leaves (``-floor``), flies, and lands (``+floor``).


def problem(steps: int = 60) -> dmoc.Problem:
    crouch = {"y": 2 * LINK * cos(CROUCH), "hip": CROUCH, "knee": -2 * CROUCH}
    at_rest = crouch | {f"{name}_dot": 0.0 for name in crouch}
    return dmoc.Problem(
        dmoc.build(system()),
        start=at_rest,
        goal=at_rest,
        contacts=["floor"],
        sequence=["-floor", "+floor"],
        steps=steps,
        final_time=(0.4, 1.5),
        durations=[None, (FLIGHT, FLIGHT), None],
        bounds={"knee": (-2.5, -0.1), "hip": (-0.5, 2.0)},
    )


# %%
# The answer
# ----------
# The momentum of the trunk's coordinate is that of all three bodies along the rail.


def main() -> None:
    solution = dmoc.solve(problem())
    stance, flight, _ = solution.phases
    lost = flight.p[0, 0] - flight.p[-1, 0]
    weight = sum(MASSES.values()) * GRAVITY
    rows = [
        ("momentum lost in the air, N s", lost, weight * FLIGHT),
        ("largest contact force, in weights", stance.normal.max() / weight, None),
        ("impulse of the landing, N s", solution.collisions[1].impulse, None),
        ("cost", solution.cost, None),
    ]
    show("jumper", rows, solution)


if __name__ == "__main__":
    main()

# %%
# How to read it
# --------------
# The leg is folded in the air and lands nearly straight, its knee at the bound of 0.1 rad. So the
# floor takes most of the momentum in the landing itself, which costs no torque.
# Page :doc:`/stating/linkages` has the joints; ``world.system`` takes what every model takes.
