r"""Two discs
=========

How is a disc pushed so that it knocks another one into the origin?

The gap is that between two bodies, so that its normal turns with them, and the cost has a part at
the end:

.. math::

   g = 2 r - \left| q_1 - q_2 \right| \le 0, \qquad
   J = \int_0^1 \frac{f_x^2 + f_y^2}{10} \, dt + \left| q_2(1) \right|^2 .

It is task 3 of Y. D. Zhong, J. Han and G. O. Brikis, *Differentiable Physics Simulations with
Contacts: Do They Have Correct Gradients w.r.t. Position, Velocity and Control?* (2022), where
several differentiable simulators miss the optimum, :math:`J = 1.39654216`.

Run:  ``python examples/two_discs.py [FOLDER]``
"""

import numpy as np
import sympy as sp
from example_report import show
from sympy.physics.mechanics import dynamicsymbols

import dmoc

EXACT = {"cost": 1.39654216, "time": 0.683220, "speed": 2.554109}
RADIUS = 0.2


# %%
# The model
# ---------
# Two discs of 1 kg, of which one is pushed.


def system() -> dmoc.MechanicalSystem:
    x1, y1, x2, y2, f_x, f_y = dynamicsymbols("x1 y1 x2 y2 f_x f_y")
    r = sp.Symbol("r")
    t = dynamicsymbols._t
    return dmoc.MechanicalSystem(
        "two_discs",
        coordinates=[x1, y1, x2, y2],
        inputs=[f_x, f_y],
        lagrangian=sum(q.diff(t) ** 2 for q in (x1, y1, x2, y2)) / 2,
        forces={x1: f_x, y1: f_y},
        surfaces={"contact": sp.sqrt((x1 - x2) ** 2 + (y1 - y2) ** 2) >= 2 * r},
        parameters={r: RADIUS},
        cost=(f_x**2 + f_y**2) / 10,
        terminal_cost=x2**2 + y2**2,
        units=dict.fromkeys((x1, y1, x2, y2), "m") | {f_x: "N", f_y: "N"},
        drawing=[
            dmoc.Disc((x1, y1), r),
            dmoc.Disc((x2, y2), r),
            dmoc.Link((-0.1, 0), (0.1, 0)),
            dmoc.Link((0, -0.1), (0, 0.1)),
            dmoc.Contact("contact", ((x1 + x2) / 2, (y1 + y2) / 2), (x2 - x1, y2 - y1)),
        ],
    )


# %%
# The problem
# -----------
# Where the discs stand; nothing is asked of the end, its cost counts.


def problem(steps: int = 50, order: int = 2) -> dmoc.Problem:
    return dmoc.Problem(
        dmoc.build(system(), order=order),
        start={"x1": -2.0, "y1": -2.0, "x2": -1.0, "y2": -1.0},
        sequence=["contact"],
        steps=steps,
        final_time=1.0,
    )


# %%
# The answer
# ----------
# The cost, the time of the hit, and the speed with which the discs meet.


def main() -> None:
    solution = dmoc.solve(problem(), "ipm")
    collision = solution.collisions[0]
    normal = collision.position[2:] - collision.position[:2]
    speed = float(
        normal
        @ (collision.momentum_before[:2] - collision.momentum_before[2:])
        / np.linalg.norm(normal)
    )
    rows = [
        ("cost", solution.cost, EXACT["cost"]),
        ("time of the hit", collision.time, EXACT["time"]),
        ("normal speed", speed, EXACT["speed"]),
    ]
    show("two_discs", rows, solution)


if __name__ == "__main__":
    main()

# %%
# How to read it
# --------------
# The second disc does not reach the origin: a harder push would cost more than the rest of the way.
# The force acts before the hit only. The errors are those of 50 steps of the midpoint rule.
