r"""A satellite turned about
========================

How does a satellite turn by 150 degrees about its axis of largest inertia in the shortest time?

Its attitude is a unit quaternion :math:`p`, and its torques :math:`\tau` act in its own axes, which
are those of its moments of inertia :math:`J_i`,

.. math::

   J \dot\omega + \omega \times J \omega = \tau, \qquad
   \omega = 2\, G(p)\, \dot p, \qquad |p|^2 = 1, \qquad |\tau_i| \le 50 .

The turn of least time is no turn about one axis: the other two torques bring the body to where the
axis of largest inertia is not the one that it turns about. The known time is that of J. T. Betts,
*Practical Methods for Optimal Control and Estimation Using Nonlinear Programming*, second edition,
SIAM, 2010.

Run:  ``python examples/satellite.py [FOLDER]``
"""

import numpy as np
from example_report import show
from sympy.physics.mechanics import dynamicsymbols

import dmoc

INERTIA, TORQUE = (5621.0, 4547.0, 2364.0), 50.0  # kg m^2, N m
ANGLE, TIME = np.deg2rad(150), 28.63041
NAMES = ("T_x", "T_y", "T_z")


# %%
# The model
# ---------
# One ball joint holds it in the world, since where it is does not matter. It is drawn as a box with
# two panels.


def system() -> dmoc.MechanicalSystem:
    torque = dynamicsymbols(" ".join(NAMES))
    world = dmoc.spatial.World()
    body = world.ball("q", inertia=INERTIA, torque=torque)
    panels = (dmoc.spatial.Box((0.03, 1.1, 1.6), at=(0, 0, z)) for z in (-1.8, 1.8))
    boom = dmoc.Link((0, 0, -1), (0, 0, 1))
    body.draw(dmoc.spatial.Box((1, 0.9, 1.2)), boom, *panels)
    return world.system("satellite", inputs=torque, cost=1, units=dict.fromkeys(torque, "N m"))


# %%
# The problem
# -----------
# From rest to rest; start and goal are attitudes, and rest is no angular velocity.


def problem(steps: int = 40) -> dmoc.Problem:
    return dmoc.Problem(
        dmoc.build(system(), order=4),
        start={"q": dmoc.attitude((1, 0, 0, 0))},
        goal={
            "q": dmoc.attitude(axis=(1, 0, 0), angle=ANGLE),
            **{f"q_omega_{axis}": 0 for axis in "xyz"},
        },
        bounds=dict.fromkeys(NAMES, (-TORQUE, TORQUE)),
        final_time=(20, 60),
        steps=steps,
    )


# %%
# The answer
# ----------
# The turn about one axis alone takes :math:`2 \sqrt{\varphi J_1 / \tau}`.


def main() -> None:
    solution = dmoc.solve(problem(), "ipm", starts=24)
    about_one_axis = 2 * np.sqrt(ANGLE * INERTIA[0] / TORQUE)
    rows = [
        ("time in s", solution.cost, TIME),
        ("saved against a turn about one axis in s", about_one_axis - solution.cost, None),
    ]
    show("satellite", rows, solution)


if __name__ == "__main__":
    main()

# %%
# How to read it
# --------------
# All three torques are at a limit at nearly all times and change sides a few times. The difference
# to the known time is that of 40 steps, in which torques change sides at nodes alone. The long way,
# by 210 degrees, is among the other minima of the solution.
