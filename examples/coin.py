r"""A coin that bounces and is caught
==================================

How is a coin thrown with the least energy so that it bounces off the floor and is caught with the
other side up?

The coin has a round edge: it is an ellipsoid of the half axes :math:`r, r, h`. Its middle touches
the floor from a height that depends on how it is turned, with :math:`n` the vertical part of its
axis,

.. math::

   z \ge \sqrt{r^2 (1 - n^2) + h^2 n^2}, \qquad n = 1 - 2 (q_1^2 + q_2^2) .

The floor pushes beside the middle and so turns the coin, too. No input acts: what is sought is the
throw. How bodies turn is told in :doc:`/stating/linkages`.

Run:  ``python examples/coin.py [FOLDER]``
"""

import numpy as np
import sympy as sp
from example_report import show
from sympy.physics.mechanics import dynamicsymbols

import dmoc

MASS, RADIUS, HALF, GRAVITY = 0.05, 0.15, 0.015, 9.81  # kg, m, m, m/s^2
ACROSS, ABOUT = MASS * (RADIUS**2 + HALF**2) / 5, 2 * MASS * RADIUS**2 / 5  # moments of inertia
HEIGHT, FAR, ASIDE = 0.8, 1.2, 0.3  # m: of both hands, and from one to the other


# %%
# The model
# ---------
# A body that nothing holds, drawn as a cylinder. Where it touches is told to the drawing: the place
# of an ellipsoid where the floor is its tangent plane.


def system() -> dmoc.MechanicalSystem:
    x, y, z = dynamicsymbols("x y z")
    p = a, b, c, d = dynamicsymbols("q0:4")
    world = dmoc.spatial.World(GRAVITY)
    coin = world.free((x, y, z), mass=MASS, inertia=(ACROSS, ACROSS, ABOUT))
    coin.draw(dmoc.spatial.Cylinder(RADIUS, 2 * HALF))
    n = 2 * (b * d + a * c), 2 * (c * d - a * b), 1 - 2 * (b**2 + c**2)
    high = sp.sqrt(RADIUS**2 * (1 - n[2] ** 2) + HALF**2 * n[2] ** 2)
    low = [
        q - (RADIUS**2 * (up - n[2] * along) + HALF**2 * n[2] * along) / high
        for q, up, along in zip((x, y, z), (0, 0, 1), n, strict=True)
    ]
    spin = 2 * (a * d.diff() - d * a.diff() + c * b.diff() - b * c.diff())  # about its axis
    energy = MASS * sum(q.diff() ** 2 for q in (x, y, z)) / 2
    energy += 2 * ACROSS * sum(e.diff() ** 2 for e in p) + (ABOUT - ACROSS) * spin**2 / 2
    return world.system(
        "coin",
        surfaces={"floor": z >= high},
        objective=dmoc.at_start(energy),
        units=dict.fromkeys((x, y, z), "m"),
        drawing=[dmoc.Contact("floor", low, (0, 0, 1)), dmoc.spatial.Plane()],
    )


# %%
# The problem
# -----------
# All velocities are free at the start. At the goal the coin has made half a turn.


def problem(steps: int = 30) -> dmoc.Problem:
    free = [f"{name}_dot" for name in "xyz"] + [f"q_omega_{axis}" for axis in "xyz"]
    return dmoc.Problem(
        dmoc.build(system(), order=4),
        start={
            "x": 0,
            "y": 0,
            "z": HEIGHT,
            "q": dmoc.attitude(euler=(0, 0.25, 0)),
            **dict.fromkeys(free),
        },
        goal={"x": FAR, "y": ASIDE, "z": HEIGHT, "q": dmoc.attitude(euler=(0, 0, np.pi))},
        sequence=["floor"],
        restitution=0.7,
        final_time=(0.3, 3),
        steps=steps,
    )


# %%
# The answer
# ----------
# The energy with which it is thrown, and how fast it turns before and after the floor.


def main() -> None:
    solution = dmoc.solve(problem(), "ipm", starts=16)
    before, after = (phase.quantities for phase in solution.phases)
    rows = [
        ("energy of the throw in J", solution.cost, None),
        ("turns by, before the floor, in rad/s", float(np.linalg.norm(before[-1])), None),
        ("turns by, after the floor, in rad/s", float(np.linalg.norm(after[0])), None),
    ]
    show("coin", rows, solution)


if __name__ == "__main__":
    main()

# %%
# How to read it
# --------------
# The coin is thrown upwards with hardly any turn and lands on its edge, which turns it faster. It
# comes to the hand at the top of its way, with no more energy than it takes to get there.
