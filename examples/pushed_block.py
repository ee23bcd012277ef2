r"""A block on a rail with friction
===============================

When is it better to wait than to push?

A block shall move 1 m along a rail in 4 s, against the friction :math:`f`, with the least
:math:`\int u^2/2 \, dt`. While it slides for the time :math:`s` over the distance :math:`d` the
least cost is

.. math::

   J(s) = \frac{6 d^2}{s^3} + \frac{f^2 s}{2}, \qquad
   J'(s) = 0 \; \Rightarrow \; s = \sqrt{6 d / f}, \quad J = \tfrac{2}{3} \sqrt{6 d f^3} .

That is less than 4 s: for the rest of the time it sticks, which costs nothing. Modes are sequences
of words, with Coulomb's law :eq:`coulomb` of the :doc:`theory </theory>`.

Run:  ``python examples/pushed_block.py [FOLDER]``
"""

import sympy as sp
from example_report import show
from sympy.physics.mechanics import dynamicsymbols

import dmoc

# %%
# The model
# ---------
# A rail is a tangent that belongs to no surface, with its largest friction.


def system() -> dmoc.MechanicalSystem:
    x, u = dynamicsymbols("x u")
    m, f = sp.symbols("m f")
    return dmoc.MechanicalSystem(
        "pushed_block",
        coordinates=[x],
        inputs=[u],
        lagrangian=m * x.diff(dynamicsymbols._t) ** 2 / 2,
        forces={x: u},
        tangents={"rail": x},
        friction={"rail": f},
        parameters={m: 1.0, f: 1.0},
        cost=u**2 / 2,
        units={x: "m", u: "N"},
        drawing=[
            dmoc.Wall((-0.3, 0), (1.3, 0)),
            dmoc.Box((x, 0.1), 0.2, 0.2),
            dmoc.Contact("rail", (x, 0)),
        ],
    )


# %%
# The problem
# -----------
# It sticks at the start, slides, and sticks again.


def problem(steps: int = 50) -> dmoc.Problem:
    return dmoc.Problem(
        dmoc.build(system()),
        start={"x": 0.0},
        goal={"x": 1.0, "x_dot": 0.0},
        sequence=["rail:slip+", "rail:stick"],
        steps=steps,
        final_time=4.0,
    )


# %%
# The answer
# ----------
# The cost and the duration of the slide against the closed form.


def main() -> None:
    solution = dmoc.solve(problem())
    rows = [
        ("cost", solution.cost, 2 / 3 * 6**0.5),
        ("duration of the slide", solution.phases[1].duration, 6**0.5),
    ]
    show("pushed_block", rows, solution)


if __name__ == "__main__":
    main()

# %%
# How to read it
# --------------
# The block slides for 2.449 s. When it begins is open, as long as there is time for it: the message
# of the answer says that motions beside it cost the same. The friction is -1 N while it slides, and
# anything up to that while it sticks.
