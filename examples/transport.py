r"""The cost of transport
=====================

How long are the steps of a walker that spends the least on a metre?

RABBIT, the robot of the example :doc:`walker`, walks at :math:`v = 0.75` m/s on average, on a floor
with the friction 0.6. The length :math:`d` of its step and its time :math:`T` are free:

.. math::

   J = \frac{1}{d} \int_0^T \left( u_1^2 + u_2^2 + u_3^2 + u_4^2 \right) dt, \qquad
   d = x(T) = v\, T, \quad x(0) = 0 .

Masses, inertias and lengths are those of E. R. Westervelt, J. W. Grizzle and D. E. Koditschek,
*Hybrid Zero Dynamics of Planar Biped Walkers*, IEEE Transactions on Automatic Control 48 (2003)
42-56.

Run:  ``python examples/transport.py [FOLDER]``
"""

from dataclasses import replace

import numpy as np
import sympy as sp
import walker
from example_report import show
from sympy.physics.mechanics import dynamicsymbols

import dmoc

SPEED, FRICTION = 0.75, 0.6
LENGTHS = (0.2, 0.8)
LIMIT = 893.03  # as steps get smaller, also by a collocation that is written by hand


# %%
# The model
# ---------
# The torques are an integral now, of which the objective is made. A quantity says where the robot
# is beside a point that moves evenly.


def system() -> dmoc.MechanicalSystem:
    robot = walker.system()
    x, v = robot.coordinates[0], sp.Symbol("v")
    return replace(
        robot,
        name="transport",
        parameters=robot.parameters | {v: SPEED},
        cost=0,
        integrals={"effort": robot.cost},
        objective=dmoc.total("effort") / dmoc.at_end(x),
        quantities={"lead": x - v * dynamicsymbols._t},
        units=robot.units | {"lead": "m"},
    )


# %%
# The problem
# -----------
# The motion begins after one exchange of the feet and ends with the next one, beside the point that
# moves evenly, which says how fast. Length and time follow from the objective.


def problem(steps: int = 20, order: int = 4) -> dmoc.Problem:
    return dmoc.Problem(
        dmoc.build(system(), order=order),
        start={"x": 0.0},
        goal={"x": LENGTHS, "lead": 0.0},
        periodic=walker.SAME | walker.RATES,
        steps=steps,
        durations=[None, 0],
        parameters={"mu": FRICTION},
        **walker.STEPPING,
    )


# %%
# The answer
# ----------
# Over a step the floor must carry the weight, and may neither push nor brake on the whole.


def main() -> None:
    solution = dmoc.solve(problem())
    landing, time = solution.collisions[0], solution.final_time
    stance = solution.phases[0]
    normal = landing.impulse + np.trapezoid(stance.normal[:, 0], stance.t)
    along = landing.tractions["right"] + np.trapezoid(stance.tangential[:, 0], stance.t)
    rows = [
        ("cost of a metre", solution.cost, LIMIT),
        ("length of a step, m", solution.phases[-1].q[-1, 0], None),
        ("time of a step, s", time, None),
        ("mean vertical force, in weights", normal / time / 40.0 / 9.81, 1.0),
        ("mean horizontal force, in weights", along / time / 40.0 / 9.81, 0.0),
    ]
    show("transport", rows, solution)


if __name__ == "__main__":
    main()

# %%
# How to read it
# --------------
# The steps are 0.474 m long. With 0.4 m a metre costs 973, with 0.6 m 1084: short steps are quick
# ones, and legs that swing quickly need torque; long steps lose more at each landing. At the
# landing friction needs 0.51 of its 0.6. The mean force of the floor is the weight to 3e-4, and
# none along it. The difference of the cost is that of 20 steps: with 40 it is 893.036.
