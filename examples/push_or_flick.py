r"""Push it or flick it?
====================

Is it cheaper to push a block to a mark, to hit it, or to hit it twice?

A driven mass shall bring a block, which rests on a rail with dry friction, to a mark 1 m away,
where it stays, in at most 2.5 s with the least :math:`\int u^2 \, dt`. It may hit the block
(:math:`e = 0.8`), land on it and push for a while, or push all the way; the block sticks or slides,

.. math::

   \left| T \right| \le f, \qquad T = -f\, \mathrm{sign}\, \dot s \; \text{where it slides} .

Nothing of the order is given. Verdicts of a search are on the page :doc:`/verdicts`.

Run:  ``python examples/push_or_flick.py [FOLDER]``
"""

import sympy as sp
from example_report import show
from sympy.physics.mechanics import dynamicsymbols

import dmoc

EVENTS = ["pad rail:slip+", "+pad rail:slip+", "-pad", "rail:stick", "+pad", "rail:slip+"]


# %%
# The model
# ---------
# Two bodies on a line: a surface between them, and a rail under one.


def system() -> dmoc.MechanicalSystem:
    x, s, u = dynamicsymbols("x s u")
    m, block, f = sp.symbols("m block f")
    t = dynamicsymbols._t
    return dmoc.MechanicalSystem(
        "push_or_flick",
        coordinates=[x, s],
        inputs=[u],
        lagrangian=m * x.diff(t) ** 2 / 2 + block * s.diff(t) ** 2 / 2,
        forces={x: u},
        surfaces={"pad": x <= s},
        tangents={"rail": s},
        friction={"rail": f},
        parameters={m: 1.0, block: 1.0, f: 1.0},
        cost=u**2,
        units={x: "m", s: "m", u: "N"},
        drawing=[
            dmoc.Wall((-0.8, 0), (1.4, 0)),
            dmoc.Box((x - 0.06, 0.06), 0.12, 0.12),
            dmoc.Box((s + 0.06, 0.06), 0.12, 0.12),
            dmoc.Contact("pad", (s, 0.06), normal=(1, 0)),
            dmoc.Contact("rail", (s + 0.06, 0)),
        ],
    )


# %%
# The problem
# -----------
# No sequence: the search has words to make it of.


def problem(steps: int = 20) -> dmoc.Problem:
    return dmoc.Problem(
        dmoc.build(system()),
        start={"x": -0.5, "s": 0.0},
        goal={"s": 1.0, "s_dot": 0.0, "x_dot": 0.0},
        steps=steps,
        restitution=0.8,
        final_time=(0.5, 2.5),
    )


# %%
# The answer
# ----------
# A search over all sequences of two of these events.


def main() -> None:
    result = dmoc.search(problem(), 2, events=EVENTS)
    rows = [(", then ".join(node.sequence), node.cost, None) for node in result.ranked()]
    show("push_or_flick", rows, result.best.solution)


if __name__ == "__main__":
    main()

# %%
# How to read it
# --------------
# The table has every motion that is confirmed, the cheapest first. To hit the block twice costs
# less than to hit it once, and that less than to push it: between the hits the mass gathers speed
# while friction acts on the block alone.
