r"""A puck among four walls
=======================

Which walls, and in which order, turn a moving puck most cheaply?

Unfolding the walls makes every sequence a free motion: a hit mirrors the table, as in a billiard
(S. Tabachnikov, *Geometry and Billiards*, American Mathematical Society 2005). With the distance
:math:`d` beyond :math:`v_0 T` and the change :math:`w` of the velocity each direction costs

.. math::

   J = \frac{6 d^2}{T^3} - \frac{6 d w}{T^2} + \frac{2 w^2}{T} .

Run:  ``python examples/puck.py [FOLDER]``
"""

from example_report import show

import dmoc
from dmoc.models.registry import find

SEQUENCE = ("east", "north", "west")


def least_cost(start: dict, goal: dict, T: float) -> float:
    """The least cost of the sequence east, north, west on a table of 1 by 1: x unfolds to x + 2,
    y to 2 - y."""
    unfolded = (
        (start["x"], start["x_dot"], goal["x"] + 2, goal["x_dot"]),
        (start["y"], start["y_dot"], 2 - goal["y"], -goal["y_dot"]),
    )
    cost = 0.0
    for q, v, q_E, v_E in unfolded:
        d, w = q_E - q - v * T, v_E - v
        cost += 6 * d**2 / T**3 - 6 * d * w / T**2 + 2 * w**2 / T
    return cost


# %%
# The problem
# -----------
# The shipped problem ``puck_table``: the goal is a moving state.


def problem(steps: int = 40, order: int = 2) -> dmoc.Problem:
    reference = find("puck_table")
    return dmoc.Problem(
        reference.kernels(order), **{**reference.defaults, "sequence": SEQUENCE, "steps": steps}
    )


# %%
# The answer
# ----------
# A search over all sequences of at most three hits, and the best one at order 4.


def main() -> None:
    p = problem(20)
    exact = least_cost(p.start, p.goal, 2.0)
    tree = dmoc.search(p.but(sequence=()), max_collisions=3)
    print(f"best of {len(tree.nodes)} sequences: {', '.join(tree.best.sequence)}")
    fine = dmoc.solve(problem(20, 4), "ipm")
    show(
        "puck",
        [("cost, order 2", tree.best.cost, exact), ("cost, order 4", fine.cost, exact)],
        tree.best.solution,
    )


if __name__ == "__main__":
    main()

# %%
# How to read it
# --------------
# The search is told nothing of the order. Of 85 sequences east, north, west costs least, a
# thirteenth of a motion without hits: walls turn velocities for nothing. The known value is that of
# the unfolded motion.
