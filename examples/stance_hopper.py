r"""A hopper that stands and flies
==============================

How does a leg with a spring jump, if effort costs?

A body on a spring with a foot of its own mass: the floor holds the foot while it stands, cannot
pull it, and takes its speed when it lands. With the force :math:`F` between body and foot

.. math::

   m \ddot z = -k (z - f - r) - d (\dot z - \dot f) + F - m g, \qquad N \ge 0, \quad f \ge 0 .

The flight shall last 0.35 s. The modes and their events are :eq:`conditions` to :eq:`events` of
the :doc:`theory </theory>`; hoppers of this kind go back to M. H. Raibert, *Legged Robots That
Balance*, MIT Press 1986.

Run:  ``python examples/stance_hopper.py [FOLDER]``
"""

import sympy as sp
from example_report import show
from sympy.physics.mechanics import dynamicsymbols

import dmoc

FLIGHT = 0.35


# %%
# The model
# ---------
# Gaps are surfaces, the shortest leg is a path constraint.


def system() -> dmoc.MechanicalSystem:
    z, f, F = dynamicsymbols("z f F")
    m, foot, k, rest, d, g = sp.symbols("m foot k rest d g")
    t = dynamicsymbols._t
    kinetic = m * z.diff(t) ** 2 / 2 + foot * f.diff(t) ** 2 / 2
    potential = m * g * z + foot * g * f + k * (z - f - rest) ** 2 / 2
    return dmoc.MechanicalSystem(
        "stance_hopper",
        coordinates=[z, f],
        inputs=[F],
        lagrangian=kinetic - potential,
        forces={z: F, f: -F},
        dissipation=d * (z - f).diff(t) ** 2 / 2,
        surfaces={"floor": f >= 0},
        path_constraints={"leg": z - f >= 0.2},
        parameters={m: 3.0, foot: 0.3, k: 300.0, rest: 0.6, d: 2.0, g: 9.81},
        cost=F**2,
        units={z: "m", f: "m", F: "N"},
        drawing=[
            dmoc.Wall((-0.2, 0), (0.2, 0)),
            dmoc.Spring((0, f), (0, z)),
            dmoc.Box((0, z), 0.2, 0.1),
            dmoc.Point((0, f)),
            dmoc.Contact("floor", (0, f)),
        ],
    )


# %%
# The problem
# -----------
# It stands, leaves (``-floor``), flies for 0.35 s and lands (``+floor``).


def problem(steps: int = 80) -> dmoc.Problem:
    standing = 0.6 - 3.0 * 9.81 / 300.0
    return dmoc.Problem(
        dmoc.build(system()),
        start={"z": standing, "f": 0.0},
        goal={"z": standing, "z_dot": 0.0, "f_dot": 0.0},
        contacts=["floor"],
        sequence=["-floor", "+floor"],
        steps=steps,
        final_time=(0.5, 3.0),
        durations=[None, (FLIGHT, FLIGHT), None],
    )


# %%
# The answer
# ----------
# Contact forces in weights of the hopper, and the impulse of the landing. Few starts lead to a
# minimum here, and three hundred to none that costs less than that of fifty.


def main() -> None:
    solution = dmoc.solve(problem(), starts=50)
    stance = solution.phases[0]
    weight = 3.3 * 9.81
    rows = [
        ("cost", solution.cost, None),
        ("largest contact force, in weights", stance.normal.max() / weight, None),
        ("least contact force, in weights", stance.normal.min() / weight, None),
        ("impulse of the landing, N s", solution.collisions[1].impulse, None),
    ]
    show("stance_hopper", rows, solution)


if __name__ == "__main__":
    main()

# %%
# How to read it
# --------------
# It swings on its spring before it leaves: the contact force goes up and down, falls to zero where
# the foot leaves, and never below. The landing takes the momentum of the foot alone; the body goes
# on and is caught by the spring.
