r"""Friction of a pushed block
==========================

How large is the friction of a block, and where did it stick?

A block rests on a rail and is pushed with a force that grows, :math:`u = r t`, for half of the
time, and then no more. It breaks away when :math:`u` comes to the friction :math:`f`, slides, and
stops:

.. math::

   m \ddot x = u - f, \qquad t_1 = \frac{f}{r}, \qquad
   \dot x(t) = \frac{r (t - t_1)^2}{2 m} \text{ until the push ends.}

Its place is measured, and the force. Mass and friction follow, and with them when it slid
(Coulomb's law :eq:`coulomb` and :eq:`fit` of the :doc:`theory </theory>`).

Run:  ``python examples/block_friction.py [FOLDER]``
"""

import numpy as np
from example_report import show
from pushed_block import system

import dmoc

MASS, FRICTION, RATE, PUSH, TIME, STEPS = 1.3, 2.5, 10.0, 0.5, 1.2, 600
NOISE = 0.001


# %%
# The run
# -------
# A simulation with noise stands for what was measured. The force is held between its samples.


def run(problem: dmoc.Problem) -> dict[str, np.ndarray]:
    t = (np.arange(STEPS) + 0.5) * TIME / STEPS
    force = np.where(t < PUSH, RATE * t, 0.0)
    motion = dmoc.simulate(
        problem.kernels,
        {"x": 0.0},
        parameters={"m": MASS, "f": FRICTION},
        inputs=force[:, None],
        step_size=TIME / STEPS,
        steps=STEPS,
    )
    noise = NOISE * np.random.default_rng(2).normal(size=len(motion.t))
    return {"t": motion.t, "x": motion.q[:, 0] + noise, "u": np.append(force, 0.0)}


# %%
# The answer
# ----------
# The word says that it sticks, slides, and sticks again; when, the fit says.


def main() -> None:
    problem = dmoc.Problem(
        dmoc.build(system()), start={"x": 0.0}, sequence=["rail:slip+", "rail:stick"]
    )
    fit = dmoc.fit(problem, run(problem), {"m": (0.1, 10.0), "f": (0.1, 10.0)})
    print(fit)
    slips, sticks = fit.event_times["run 1"]
    speed = (RATE * PUSH - FRICTION) ** 2 / (2 * RATE * MASS)
    rows = [
        ("mass", fit["m"], MASS),
        ("friction", fit["f"], FRICTION),
        ("it slips at", slips, FRICTION / RATE),
        ("it sticks at", sticks, PUSH + speed * MASS / FRICTION),
    ]
    show("block_friction", rows, fit.motions[0])


if __name__ == "__main__":
    main()

# %%
# How to read it
# --------------
# The force is a staircase, so that the block slips where a stair passes the friction: the time has
# the grain of 2 ms. The friction is known from when it slips and from how it slows down, the mass
# from how it speeds up. Without the measured force only their ratio would be known.
