r"""How many hops?
==============

In how many hops does a one-legged hopper go one metre with the least effort?

The hopper of the example :doc:`hopper` goes twice as far, in about twice the time, and ends as it
began. Nothing says how often its foot hits the ground. Over all numbers :math:`n` of hits the
search minimises

.. math::

   \int \tfrac12 F^2 + 5\, \tau^2 \, dt , \qquad
   \sum_{i=1}^{n} \lambda_i = (M + m)\, g\, T ,

where the second one is the balance of momentum of a period :math:`T`, which no number of hits
changes. After M. H. Raibert, *Legged Robots That Balance*, MIT Press 1986.

Run:  ``python examples/hops.py [FOLDER]``
"""

import hopper
from example_report import show

import dmoc

# %%
# The problem
# -----------
# No sequence: seven hits at most are asked for below.


def problem(steps: int = 30) -> dmoc.Problem:
    return hopper.problem(steps).but(
        goal={"x": 1.0},
        sequence=(),
        final_time=(0.9, 1.2),
    )


# %%
# The answer
# ----------
# Relaxed motions say sequences; these are solved exactly and checked, with one hit more and one
# less than the best. Each number of hits has its best motion, or none.


def main() -> None:
    result = dmoc.search(problem(), max_collisions=7, strategy="propose")
    by_number = sorted(result.ranked(), key=lambda node: len(node.sequence))
    rows = [(f"{len(node.sequence)} hops", node.cost, None) for node in by_number]
    best = result.best.solution
    parameters = best.trajectory.parameters
    weight = (parameters["M"] + parameters["m"]) * hopper.G * best.final_time
    rows.append(("impulses and weight", sum(c.impulse for c in best.collisions), weight))
    for note in result.notes:
        print(note)
    show("hops", rows, best)


if __name__ == "__main__":
    main()

# %%
# How to read it
# --------------
# The first lines say what the search stands on: how many random starts led to a motion, which
# sequences these have, and which of them were not solved. Six hops cost less than five and seven,
# and four relaxed ones over a third more than six. It is no proof: numbers of hops that no start
# led to, and that are not beside the best, were not solved.
