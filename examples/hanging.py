r"""Swing-up from hanging
=====================

Can the cart swing up its pendulum from rest, through a collision and past the horizontal?

At :math:`\alpha = 0` the cart cannot turn the pendulum: a force along :math:`x` has no lever on a
mass that lies on the :math:`x` axis,

.. math::

   l\, \ddot \alpha = \ddot x \sin \alpha - g \cos \alpha .

So the pendulum must pass there with speed. The problem is one of D. Kern and M. Groß (2018), who
give no value; the midpoint rule is compared with steps of order 4.

Run:  ``python examples/hanging.py [FOLDER]``
"""

from example_report import show

import dmoc
from dmoc.models.registry import find

# %%
# The problem
# -----------
# The model is that of the swing-up, with a wider limiter, and 2 s.


def problem(steps: int = 100, order: int = 2) -> dmoc.Problem:
    reference = find("cart_pendulum_hanging")
    return dmoc.Problem(reference.kernels(order), **{**reference.defaults, "steps": steps})


# %%
# The answer
# ----------
# The best of many starts at order 2, and the same motion at order 4.


def main() -> None:
    solution = dmoc.solve(problem())
    fine = dmoc.solve(problem(50, 4), "ipm", guess=solution)
    hit, fine_hit = solution.collisions[0], fine.collisions[0]
    rows = [
        ("cost, order 2 against 4", solution.cost, fine.cost),
        ("time of the hit", hit.time, fine_hit.time),
    ]
    rows.append(("impulse", hit.impulse, fine_hit.impulse))
    show("hanging", rows, solution)


if __name__ == "__main__":
    main()

# %%
# How to read it
# --------------
# The two discretisations have no quadrature in common, and their costs agree to 4e-4: that is how
# far off 100 steps are. The cart swings the pendulum to the limiter and uses the rebound. Most
# starts end in dearer minima, which are in ``solution.others``.
