r"""Two bounces
===========

How fast must a ball leave the floor to be half a metre high after two bounces?

Each bounce keeps :math:`e = 0.9` of the speed, so that the last flight begins with
:math:`e^2 v_0` and ends at the height :math:`h`:

.. math::

   v_0 = \frac{\sqrt{2 g h}}{e^2}, \qquad
   T_0 = \frac{2 v_0}{g}, \quad T_1 = \frac{2 e v_0}{g}, \quad T_2 = \frac{e^2 v_0}{g} .

There is no input and no cost: three durations and a speed follow from the laws of motion and of
impact alone (:eq:`impact` and :eq:`newton` of the :doc:`theory </theory>`).

Run:  ``python examples/two_bounces.py [FOLDER]``
"""

import sympy as sp
from example_report import show
from sympy.physics.mechanics import dynamicsymbols

import dmoc

E, PEAK, GRAVITY = 0.9, 0.5, 9.81
V0 = (2 * GRAVITY * PEAK) ** 0.5 / E**2
EXACT = {"v0": V0, "phases": (2 * V0 / GRAVITY, 2 * E * V0 / GRAVITY, E**2 * V0 / GRAVITY)}


# %%
# The model
# ---------
# A coordinate and gravity. A model needs no input.


def system() -> dmoc.MechanicalSystem:
    y = dynamicsymbols("y")
    g = sp.Symbol("g")
    return dmoc.MechanicalSystem(
        "ball",
        coordinates=[y],
        lagrangian=y.diff(dynamicsymbols._t) ** 2 / 2 - g * y,
        surfaces={"floor": y >= 0},
        parameters={g: GRAVITY},
        units={y: "m"},
        drawing=[
            dmoc.Wall((-0.3, 0), (0.3, 0)),
            dmoc.Disc((0, y + 0.05), 0.05),
            dmoc.Contact("floor", (0, y)),
        ],
    )


# %%
# The problem
# -----------
# The speed at the start is a range: it is what is looked for.


def problem(steps: int = 50, order: int = 2) -> dmoc.Problem:
    return dmoc.Problem(
        dmoc.build(system(), order=order),
        start={"y": 0.0, "y_dot": (0.1, 20.0)},
        goal={"y": PEAK, "y_dot": 0.0},
        sequence=["floor", "floor"],
        steps=steps,
        final_time=(0.1, 5.0),
        restitution=E,
    )


# %%
# The answer
# ----------
# One solve gives the speed and the durations of the three flights.


def main() -> None:
    solution = dmoc.solve(problem(), "ipm")
    rows = [("speed at the start", solution.phases[0].v[0, 0], EXACT["v0"])]
    for i, (phase, exact) in enumerate(zip(solution.phases, EXACT["phases"], strict=True)):
        rows.append((f"duration of phase {i}", phase.duration, exact))
    rows.append(("final time", solution.final_time, sum(EXACT["phases"])))
    show("two_bounces", rows, solution)


if __name__ == "__main__":
    main()

# %%
# How to read it
# --------------
# The last flight is exact, because the midpoint rule is exact in free fall. The others are off by
# 2e-4: the law of impact takes the energies of the steps beside a bounce, whose error falls with
# the square of their size. At order 4, ``problem(10, 4)``, all of it is exact to rounding.
