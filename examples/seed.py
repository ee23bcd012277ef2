"""Swing-up through a collision
============================

Swing up the pendulum of Kern & Gross (2018) by bouncing it off the left limiter.

The reference value is that of an independent transcription of the same discrete problem; as the
steps get smaller the cost tends to 129.9843.

Run:  ``python examples/seed.py [FOLDER]``
"""

from showing import show

import dmoc
from dmoc.models.registry import find

KNOWN = {"cost": 129.6024, "phases": (0.09640, 0.90360)}
LIMIT = 129.98434  # as the steps get smaller, from both discretisations


def problem(steps: int = 100, order: int = 2) -> dmoc.Problem:
    reference = find("cart_pendulum")
    return dmoc.Problem(reference.kernels(order), **{**reference.defaults, "steps": steps})


def main() -> None:
    solution = dmoc.solve(problem())
    fine = dmoc.solve(problem(10, 4), tolerance=1e-6)
    rows = [("cost, N = 100", solution.cost, KNOWN["cost"])]
    rows += [
        (f"duration of phase {i}", p.duration, exact)
        for i, (p, exact) in enumerate(zip(solution.phases, KNOWN["phases"], strict=True))
    ]
    rows += [
        ("impulse", solution.collisions[0].impulse, None),
        ("cost, order 4, refined to 1e-6", fine.cost, LIMIT),
    ]
    show("seed", rows, solution)


if __name__ == "__main__":
    main()
