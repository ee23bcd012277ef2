r"""The best spring for a hopper
============================

Which spring in its leg saves a hopper most of its effort?

A body :math:`m` on a leg with a spring :math:`k`, and a foot :math:`f` of its own mass that stands
on the floor, leaves and lands; each hop takes 0.6 s, of which 0.3 s are flight. The force
:math:`F` between body and foot costs :math:`\int F^2/2`. The stiffness is chosen together with the
motion. A hopper whose foot has no mass needs no force if its spring turns the body round while it
stands,

.. math::

   \frac{2}{\omega} \Bigl(\pi - \arctan \frac{v\, \omega}{g}\Bigr) = 0.3\ \mathrm{s},
   \qquad v = \frac{g}{2}\, 0.3\ \mathrm{s}, \qquad k = m\, \omega^2 .

After R. Blickhan, *The spring-mass model for running and hopping*, J. Biomechanics 22 (1989)
1217-1227.

Run:  ``python examples/hopper_spring.py [FOLDER]``
"""

from math import atan, pi

import sympy as sp
from example_report import show
from scipy.optimize import brentq
from sympy.physics.mechanics import dynamicsymbols

import dmoc

M, G = 3.0, 9.81
PERIOD, FLIGHT = 0.6, 0.3


# %%
# The model
# ---------
# The stiffness is a parameter like the others.


def system() -> dmoc.MechanicalSystem:
    z, f, F = dynamicsymbols("z f F")
    m, foot, k, rest, g = sp.symbols("m foot k rest g")
    t = dynamicsymbols._t
    kinetic = m * z.diff(t) ** 2 / 2 + foot * f.diff(t) ** 2 / 2
    potential = m * g * z + foot * g * f + k * (z - f - rest) ** 2 / 2
    return dmoc.MechanicalSystem(
        "hopper_spring",
        coordinates=[z, f],
        inputs=[F],
        lagrangian=kinetic - potential,
        forces={z: F, f: -F},
        surfaces={"floor": f >= 0},
        parameters={m: M, foot: 0.3, k: 300.0, rest: 0.6, g: G},
        cost=F**2 / 2,
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
# A hop from the lowest point to the next one; ``design`` gives the range of the stiffness.


def problem(steps: int = 40) -> dmoc.Problem:
    return dmoc.Problem(
        dmoc.build(system(), order=4),
        start={"z": (0.2, 0.8), "f": 0.0, "z_dot": 0.0},
        goal={"z_dot": 0.0},
        periodic=["z"],
        contacts=["floor"],
        sequence=["-floor", "+floor"],
        steps=steps,
        final_time=PERIOD,
        durations=[None, (FLIGHT, FLIGHT), None],
        design={"k": (50.0, 3000.0)},
    )


def without_foot() -> float:
    """The stiffness of a hopper whose foot has no mass."""
    v, stance = G * FLIGHT / 2, PERIOD - FLIGHT
    omega = brentq(lambda w: 2 / w * (pi - atan(v * w / G)) - stance, 5.0, 60.0)
    return float(M * omega**2)


# %%
# The answer
# ----------
# The stiffness, and what springs that are a fifth softer or stiffer cost.


def main() -> None:
    stated = problem()
    solution = dmoc.solve(stated, starts=30)
    best = solution.design["k"]
    rows = [
        ("stiffness, N/m", best, None),
        ("that without a foot, N/m", without_foot(), None),
        ("cost", solution.cost, None),
    ]
    for share in (0.8, 1.2):
        kept = dmoc.solve(stated.but(design={"k": share * best}), guess=solution)
        rows.append((f"cost at {share:g} of the stiffness", kept.cost, None))
    show("hopper_spring", rows, solution)


if __name__ == "__main__":
    main()

# %%
# How to read it
# --------------
# The best spring is a little stiffer than that of a hopper without a foot. In flight the foot
# swings on it, and comes down so softly that the landing takes hardly any momentum. The force works
# where the foot leaves and lands, and keeps the floor from pulling. A spring that is a fifth softer
# costs more than twice as much, one that is a fifth stiffer more than twenty times.
