r"""A finger flicks a puck
======================

How does a finger flick a puck so that it stops at a mark?

A finger of two links hits a puck (:math:`e = 0.5`), which sticks to the table until then, slides,
and is stopped by friction at the distance :math:`d`. How fast it has to leave follows from the
distance alone,

.. math::

   v = \sqrt{2 \mu g d}, \qquad t = \sqrt{\frac{2 d}{\mu g}}, \qquad \lambda = m_{puck}\, v .

When and how the finger swings is what is looked for. The laws are :eq:`newton` and :eq:`coulomb` of
the :doc:`theory </theory>`.

Run:  ``python examples/finger_puck.py [FOLDER]``
"""

from math import sin

import numpy as np
import sympy as sp
from example_report import show
from sympy.physics.mechanics import dynamicsymbols

import dmoc

MARK, PUCK = 0.5, 0.05


# %%
# The model
# ---------
# Two links with torques, one built after the other, and a puck with friction. A path constraint
# keeps the fingertip in its lane.


def system() -> dmoc.MechanicalSystem:
    a, b, s, u, w = dynamicsymbols("a b s u w")
    m, l, puck, mu, g = sp.symbols("m l puck mu g")
    world = dmoc.planar.World()
    finger = world.hinge(a, length=l, mass=m, torque=u)
    tip = finger.hinge(b, length=l, mass=m, torque=w, absolute=True).tip
    world.slide(s, at=(0.02, 0.1), mass=puck, box=(0.04, 0.04))
    return world.system(
        "finger_puck",
        inputs=[u, w],
        surfaces={"tip": s - tip[0] >= 0},
        path_constraints={"lane": (tip[1] - 0.1) ** 2 <= 0.02**2},
        tangents={"table": s},
        friction={"table": mu * puck * g},
        parameters={m: 0.1, l: 0.15, puck: PUCK, mu: 0.2, g: 9.81},
        cost=u**2 + w**2,
        units={u: "N m", w: "N m"},
        drawing=[
            dmoc.Point(finger.tip),
            dmoc.Contact("tip", (s, tip[1]), normal=(1, 0)),
            dmoc.Contact("table", (s + 0.02, 0.1)),
        ],
    )


# %%
# The problem
# -----------
# One event: the tip hits, and the puck begins to slide.


def problem(steps: int = 100) -> dmoc.Problem:
    start = {"a": 1.9, "b": 0.0, "s": 0.12}
    # The tip begins in its lane.
    start["b"] = float(np.arcsin(0.1 / 0.15 - sin(start["a"])))
    return dmoc.Problem(
        dmoc.build(system()),
        start=start,
        goal={"s": start["s"] + MARK, "s_dot": 0.0, "a_dot": 0.0, "b_dot": 0.0},
        sequence=["tip table:slip+"],
        steps=steps,
        restitution=0.5,
        final_time=(0.3, 2.0),
        bounds={"a": (-0.5, 3.2), "b": (-2.0, 2.0)},
    )


# %%
# The answer
# ----------
# Speed, duration and impulse against what the distance demands.


def main() -> None:
    solution = dmoc.solve(problem())
    leaves, needed = solution.phases[1].v[0, 2], (2 * 0.2 * 9.81 * MARK) ** 0.5
    rows = [
        ("speed of the puck after the flick", leaves, needed),
        ("duration of its slide", solution.phases[1].duration, (2 * MARK / 0.2 / 9.81) ** 0.5),
        (
            "impulse of the flick",
            solution.collisions[0].impulse,
            PUCK * (2 * 0.2 * 9.81 * MARK) ** 0.5,
        ),
    ]
    show("finger_puck", rows, solution)


if __name__ == "__main__":
    main()

# %%
# How to read it
# --------------
# The finger swings back first, to have way for the flick. All three rows agree to rounding: the
# friction on the puck is constant, for which the midpoint rule is exact. The word ``tip
# table:slip+`` is one event with two parts, the hit and the beginning of the slide.
