r"""A four-bar hammer
=================

How should the motor of a linkage push to strike an anvil and come back?

A crank of length :math:`r` drives a coupler :math:`c`, which a rocker :math:`s` holds at its other
end; the head of the hammer sits on the extension of the coupler. With one angle for each of the
three, the loop is closed by two equations,

.. math::

   r \cos \alpha + c \cos \beta = d + s \cos \gamma, \qquad
   r \sin \alpha + c \sin \beta = s \sin \gamma ,

which are stated as they are: two coordinates too many, and two forces that hold the loop together.
Without :math:`\beta` they are the equation of F. Freudenstein, *An Analytical Approach to the
Design of Four-Link Mechanisms*, Transactions of the ASME 76 (1954) 483-492.
The hammer begins and ends at rest in the same place, strikes once with a coefficient of restitution
of 0.3, and takes as little effort as it can, :math:`J = \int u^2 dt`.

The known value is that of the same machine with the loop solved by hand: :math:`\beta` and
:math:`\gamma` as functions of :math:`\alpha` (the intersection of two circles), one coordinate, one
gap, no constraint.

Run:  ``python examples/four_bar.py [FOLDER]``
"""

import sympy as sp
from example_report import show
from sympy.physics.mechanics import dynamicsymbols

import dmoc

CRANK, COUPLER, ROCKER, BASE = 0.1, 0.3, 0.25, 0.3  # lengths in m
HAMMER = {"length": 0.45, "mass": 1.5, "centre": 0.35, "inertia": 0.02}  # coupler with head
ANVIL, TIME = 0.3, 0.5

EFFORT, BLOW, IMPULSE = 0.8356290, 0.23244627, 5.885965  # of the machine with one coordinate


# %%
# The model
# ---------
# Three links; that of the crank carries the coupler, which meets the tip of the rocker.


def system() -> dmoc.MechanicalSystem:
    alpha, beta, gamma, u = dynamicsymbols("alpha beta gamma u")
    world = dmoc.planar.World(gravity=9.81)
    crank = world.hinge(alpha, length=CRANK, mass=0.5, torque=u)
    coupler = crank.hinge(beta, absolute=True, **HAMMER)
    rocker = world.hinge(gamma, at=(BASE, 0), length=ROCKER, mass=0.8)
    joint, head = coupler.point(COUPLER, 0), coupler.tip
    return world.system(
        "four_bar",
        inputs=[u],
        constraints={
            "loop_x": sp.Eq(joint[0], rocker.tip[0]),
            "loop_y": sp.Eq(joint[1], rocker.tip[1]),
        },
        surfaces={"anvil": head[1] >= ANVIL},
        cost=u**2,
        units={alpha: "rad", beta: "rad", gamma: "rad", u: "N m"},
        drawing=[
            dmoc.Wall((0.1, ANVIL), (0.25, ANVIL)),
            dmoc.Contact("anvil", head),
        ],
    )


# %%
# The problem
# -----------
# Of the start the angle of the crank is given: the loop decides the other two, and their bounds say
# in which of its two shapes. Those of the crank let it strike on one of the two ways down.


def problem(steps: int = 40) -> dmoc.Problem:
    return dmoc.Problem(
        dmoc.build(system(), order=4),
        start={"alpha": 0},
        goal={"alpha": 0, "alpha_dot": 0},
        sequence=["anvil"],
        restitution=0.3,
        bounds={"alpha": (-2.2, 0.6), "beta": (0, 1.5), "gamma": (1, 3)},
        final_time=TIME,
        steps=steps,
    )


# %%
# The answer
# ----------
# Beside the effort the force of the loop in the blow, an impulse as that of the anvil.


def main() -> None:
    solution = dmoc.solve(problem(), "ipm", starts=20)
    blow = solution.collisions[0]
    rows = [
        ("effort", solution.cost, EFFORT),
        ("moment of the blow in s", blow.time, BLOW),
        ("impulse of the anvil in N s", blow.impulse, IMPULSE),
        *((f"impulse of {name} in N s", R, None) for name, R in blow.reactions.items()),
    ]
    show("four_bar", rows, solution)


if __name__ == "__main__":
    main()

# %%
# How to read it
# --------------
# The motor drives the head down with 2.2 N m and less, and brings back what the blow leaves, with
# 2.9 N m at first. The loop passes the blow on: its impulses are in the table. Differences to the
# machine with one coordinate are those of 40 steps. A crank that swings once more before the blow
# costs more, and most starts lead nowhere or there, hence 20 of them.
