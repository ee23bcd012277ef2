r"""A soft landing
==============

How little need a leg press on the floor when it lands?

A body on a leg of its own mass falls; the floor stops the foot at once and takes its momentum, an
impulse that nothing changes. From then on the leg, with the force :math:`F \ge 0`, stops the body
on the way :math:`s` by which it may bend, and the floor bears

.. math::

   N = F + m_f g \ge (m + m_f) g + \frac{m v^2}{2 s} ,

which a constant force reaches: that of an even deceleration from the speed :math:`v` of the
landing. The forces are those of :eq:`reaction` of the :doc:`theory </theory>`. Landings with an
impact of the foot and a push of the leg are the subject of A. Seyfarth, A. Friedrichs, V. Wank,
R. Blickhan, *Dynamics of the long jump*, Journal of Biomechanics 32 (1999) 1259-1267.

Run:  ``python examples/soft_landing.py [FOLDER]``
"""

import sympy as sp
from example_report import show
from sympy.physics.mechanics import dynamicsymbols

import dmoc

BODY, FOOT, G = 60.0, 6.0, 9.81
LONG, SHORT, FALL = 0.9, 0.45, 0.4


# %%
# The model
# ---------
# The load is a quantity, its peak the objective; a price of the time ends the motion where the body
# stops.


def system() -> dmoc.MechanicalSystem:
    z, f, F = dynamicsymbols("z f F")
    m, foot, g, hurry = sp.symbols("m foot g hurry")
    kinetic = m * z.diff() ** 2 / 2 + foot * f.diff() ** 2 / 2
    return dmoc.MechanicalSystem(
        "soft_landing",
        coordinates=[z, f],
        inputs=[F],
        lagrangian=kinetic - g * (m * z + foot * f),
        forces={z: F, f: -F},
        surfaces={"floor": f >= 0},
        path_constraints={"leg": (z - f >= SHORT) & (z - f <= LONG)},
        parameters={m: BODY, foot: FOOT, g: G, hurry: 100.0},
        quantities={"load": dmoc.normal("floor")},
        objective=dmoc.peak("load") + hurry * dmoc.final_time,
        units={z: "m", f: "m", F: "N", "load": "N"},
        drawing=[
            dmoc.Wall((-0.3, 0), (0.3, 0)),
            dmoc.Link((0, f), (0, z)),
            dmoc.Box((0, z), 0.3, 0.2),
            dmoc.Point((0, f)),
            dmoc.Contact("floor", (0, f)),
        ],
    )


# %%
# The problem
# -----------
# It falls from rest with its leg stretched, lands (``+floor``) and stops.


def problem(steps: int = 40) -> dmoc.Problem:
    return dmoc.Problem(
        dmoc.build(system(), order=4),
        start={"z": LONG + FALL, "f": FALL},
        goal={"z_dot": 0.0, "f_dot": 0.0},
        sequence=["+floor"],
        bounds={"F": (0, None)},
        steps=steps,
        final_time=(0.3, 1.5),
        durations=[None, (0.1, None)],
    )


# %%
# The answer
# ----------
# The peak beside the closed form, and the impulse of the landing, which is no force.


def main() -> None:
    solution = dmoc.solve(problem(), starts=30)
    speed = (2 * G * FALL) ** 0.5
    least = (BODY + FOOT) * G + BODY * speed**2 / (2 * (LONG - SHORT))
    peak = solution.trajectory.totals["peak load"]
    rows = [
        ("peak of the load, N", peak, least),
        ("in weights", peak / ((BODY + FOOT) * G), None),
        ("impulse of the landing, N s", solution.collisions[0].impulse, FOOT * speed),
        ("bends for, s", solution.phases[1].duration, 2 * (LONG - SHORT) / speed),
    ]
    show("soft_landing", rows, solution)


if __name__ == "__main__":
    main()

# %%
# How to read it
# --------------
# The load is a rectangle: any other course of the same work has a higher peak. The curve of the
# load is zero in flight; the impulse of the foot's landing stands in the events and in no curve.
