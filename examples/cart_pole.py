r"""Swing-up of a cart-pole
=======================

Is the swing-up that everybody solves the cheapest one?

A pole hangs from a cart, and shall stand upright 1 m further after 2 s with the least
:math:`\int F^2 \, dt`. There is no collision. The equations are those of M. Kelly, *An Introduction
to Trajectory Optimization: How to Do Your Own Direct Collocation*, SIAM Review 59 (2017) 849-904:

.. math::

   L = \frac{m_c}{2} \dot x^2 + \frac{m_p}{2} \left( \dot x^2 + 2 l \dot x \dot \theta \cos \theta
       + l^2 \dot \theta^2 \right) + m_p g l \cos \theta .

The cost of his motion is 58.88 in Dymos' test of it.

Run:  ``python examples/cart_pole.py [FOLDER]``
"""

import numpy as np
import sympy as sp
from example_report import show
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.guess.automatic import initial_guesses
from dmoc.program.layout import Layout

DYMOS = 58.88  # of Dymos' test, on its mesh
LIMIT = 58.80767  # the same motion as the steps get smaller, from both discretisations


# %%
# The model
# ---------
# A tip in the plane, and the kinetic energy of its velocity: SymPy does the rest.


def system() -> dmoc.MechanicalSystem:
    x, theta, F = dynamicsymbols("x theta F")  # theta = 0: hanging
    m_c, m_p, l, g = sp.symbols("m_c m_p l g")
    t = dynamicsymbols._t
    tip = sp.Matrix([x + l * sp.sin(theta), -l * sp.cos(theta)])
    velocity = tip.diff(t)
    kinetic = m_c * x.diff(t) ** 2 / 2 + m_p * velocity.dot(velocity) / 2
    return dmoc.MechanicalSystem(
        "cart_pole",
        coordinates=[x, theta],
        inputs=[F],
        lagrangian=kinetic - m_p * g * tip[1],
        forces={x: F},
        parameters={m_c: 1.0, m_p: 0.3, l: 0.5, g: 9.81},
        cost=F**2,
        units={x: "m", theta: "rad", F: "N"},
        drawing=[dmoc.Box((x, 0), 0.2, 0.1), dmoc.Link((x, 0), tip), dmoc.Point(tip)],
    )


# %%
# The problem
# -----------
# The limits are Kelly's: 20 N, and 2 m to either side.


def problem(steps: int = 100, order: int = 2) -> dmoc.Problem:
    return dmoc.Problem(
        dmoc.build(system(), order=order),
        start={"x": 0.0, "theta": 0.0},
        goal={"x": 1.0, "x_dot": 0.0, "theta": np.pi, "theta_dot": 0.0},
        steps=steps,
        final_time=2.0,
        bounds={"F": (-20.0, 20.0), "x": (-2.0, 2.0)},
    )


def straight(problem: dmoc.Problem) -> np.ndarray:
    """Kelly's guess: straight lines from the start to the goal, and no force."""
    lay, x = Layout.of(problem), initial_guesses(problem)[0].x.copy()
    x[lay.index_q] = np.linspace((0.0, 0.0), (1.0, np.pi), lay.total + 1)
    x[lay.index_q_i] = np.tile((x[lay.index_q][:-1] + x[lay.index_q][1:]) / 2, lay.inside)
    x[lay.index_u] = 0.0
    return x


# %%
# The answer
# ----------
# Kelly's straight guess and the automatic starts, at orders 2 and 4.


def main() -> None:
    rows = []
    for steps, order in ((100, 2), (50, 4)):
        p = problem(steps, order)
        best = dmoc.solve(p, "ipm")
        kelly = dmoc.solve(p, "ipm", guess=straight(p))
        rows.append((f"Kelly's motion, order {order}", kelly.cost, DYMOS if order == 2 else LIMIT))
        rows.append((f"a cheaper minimum, order {order}", best.cost, None))
    show("cart_pole", rows, best)


if __name__ == "__main__":
    main()

# %%
# How to read it
# --------------
# From the straight guess the answer is Kelly's motion. The automatic starts find another one, which
# swings differently and costs less. Both are confirmed: a minimum is local, whoever finds it. How
# many starts led where is in ``solution.agreeing_starts`` and ``solution.others``.
