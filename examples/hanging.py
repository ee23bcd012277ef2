"""Swing-up from hanging
=====================

Swing up the pendulum from hanging at rest, through a collision and past a point where the cart
cannot turn the pendulum (alpha = 0).

No value is published: the midpoint rule is compared with the discretisation of order 4 on a refined
mesh, and the simulation confirms the motion.

Run:  ``python examples/hanging.py [FOLDER]``
"""

from showing import show

import dmoc
from dmoc.models.registry import find


def problem(steps: int = 100, order: int = 2) -> dmoc.Problem:
    reference = find("cart_pendulum_hanging")
    return dmoc.Problem(reference.kernels(order), **{**reference.defaults, "steps": steps})


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
