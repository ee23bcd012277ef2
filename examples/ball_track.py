r"""Gravity and restitution from a track
====================================

What do the heights of a bouncing ball tell of gravity and of the floor?

A ball falls from the height :math:`h`, keeps the share :math:`e` of its speed at each bounce, and a
camera measures its height :math:`y_i` every 10 ms, with errors of 3 mm. Between bounces
:math:`\ddot y = -g`, whatever the mass is. The fit

.. math::

   \min_{g, e, h} \sum_i \left( \frac{y(t_i; g, e, h) - y_i}{\sigma} \right)^2

follows the ball through its bounces, whose times :math:`\sqrt{2h/g}\,(1 + 2 e + 2 e^2 + \dots)`
move with all three (:eq:`fit` and :eq:`newton` of the :doc:`theory </theory>`).

Run:  ``python examples/ball_track.py [FOLDER]``
"""

import numpy as np
import sympy as sp
from example_report import show
from sympy.physics.mechanics import dynamicsymbols

import dmoc

GRAVITY, E, HEIGHT, NOISE = 9.81, 0.8, 1.0, 0.003


# %%
# The model
# ---------
# A ball over a floor. Its mass is stated, and nothing will depend on it.


def system() -> dmoc.MechanicalSystem:
    y = dynamicsymbols("y")
    m, g = sp.symbols("m g")
    return dmoc.MechanicalSystem(
        "ball",
        coordinates=[y],
        lagrangian=m * y.diff(dynamicsymbols._t) ** 2 / 2 - m * g * y,
        surfaces={"floor": y >= 0},
        parameters={m: 1.0, g: 9.5},
        units={y: "m"},
        drawing=[
            dmoc.Wall((-0.3, 0), (0.3, 0)),
            dmoc.Disc((0, y + 0.05), 0.05),
            dmoc.Contact("floor", (0, y)),
        ],
    )


# %%
# The track
# ---------
# A simulation with noise stands for the camera. Your own track is a CSV file with columns t and y.


def track(problem: dmoc.Problem) -> dict[str, np.ndarray]:
    motion = dmoc.simulate(
        problem.kernels,
        {"y": HEIGHT},
        parameters={"g": GRAVITY},
        restitution=E,
        step_size=0.001,
        steps=2000,
        every=10,
    )
    noise = NOISE * np.random.default_rng(1).normal(size=len(motion.t))
    return {"t": motion.t, "y": motion.q[:, 0] + noise}


# %%
# The answer
# ----------
# The height at the start is free, the ball is at rest there, and nobody says how often it bounces.


def main() -> None:
    problem = dmoc.Problem(dmoc.build(system()), start={"y": None})
    unknown = {"g": (5.0, 15.0), "e": (0.0, 1.0), "m": (0.1, 10.0)}
    fit = dmoc.fit(problem, track(problem), unknown)
    print(fit)
    truth = {"g": GRAVITY, "e": E, "start of y": HEIGHT}
    rows = [(name, fit[name], value) for name, value in truth.items()]
    rows += [("noise", fit.sensors[0].sigma, NOISE)]
    show("ball_track", rows, fit.motions[0])


if __name__ == "__main__":
    main()

# %%
# How to read it
# --------------
# Gravity is known to half a part in a thousand, the restitution to two in ten thousand: what is
# seen after three bounces has been multiplied by it three times. The word of three bounces
# was found in the track. Of the mass the fit says that nothing depends on it.
