r"""A block and a wall
==================

How hard does it push a block against a wall and back, if the wall takes a part of the speed?

A block of 1 kg rests at :math:`x = 0`; the wall is 1 m away, and after one second the block shall
rest where it was. Before the impact at the time :math:`t` with the speed :math:`w` it covers the
distance 1, after it with the speed :math:`e w` the distance 1 again. The least effort
:math:`\int u^2/2 \, dt` is the minimum over :math:`t` and :math:`w` of

.. math::

   J = \frac{6 - 6 w t + 2 w^2 t^2}{t^3} + \frac{6 - 6 e w s + 2 e^2 w^2 s^2}{s^3},
   \qquad s = 1 - t .

The impact obeys Newton's law, :eq:`newton` of the :doc:`theory </theory>`.

Run:  ``python examples/block_and_wall.py [FOLDER]``
"""

import sympy as sp
from example_report import show
from scipy.optimize import minimize
from sympy.physics.mechanics import dynamicsymbols

import dmoc

EXACT = {
    1.0: (24.0, 0.5, 3.0),
    0.8: (24.58630915, 0.48174700, 3.30175954),
    0.0: (50.95584412, 2**0.5 - 1, 3.62132035),
}


# %%
# The model
# ---------
# A mass, a force, a surface. The drawing changes no solution.


def system() -> dmoc.MechanicalSystem:
    x, u = dynamicsymbols("x u")
    m, wall = sp.symbols("m wall")
    speed = x.diff(dynamicsymbols._t)
    return dmoc.MechanicalSystem(
        "block",
        coordinates=[x],
        inputs=[u],
        lagrangian=m * speed**2 / 2,
        forces={x: u},
        surfaces={"wall": x <= wall},
        parameters={m: 1.0, wall: 1.0},
        cost=u**2 / 2,
        units={x: "m", u: "N"},
        drawing=[
            dmoc.Wall((-0.4, 0), (wall, 0)),
            dmoc.Wall((wall, 0), (wall, 0.4)),
            dmoc.Box((x - 0.1, 0.1), 0.2, 0.2),
            dmoc.Contact("wall", (x, 0.1), normal=(-1, 0)),
        ],
    )


# %%
# The problem
# -----------
# Where it begins, where it ends, what happens between, how long it takes.


def problem(restitution: float, steps: int = 50, order: int = 2) -> dmoc.Problem:
    return dmoc.Problem(
        dmoc.build(system(), order=order),
        start={"x": 0.0},
        goal={"x": 0.0, "x_dot": 0.0},
        sequence=["wall"],
        steps=steps,
        final_time=1.0,
        restitution=restitution,
    )


def closed_form(e: float) -> tuple[float, float, float]:
    """Cost, time and speed of the impact, from the closed form."""

    def cost(z):
        t, w = z
        s = 1 - t
        return (6 - 6 * w * t + 2 * w**2 * t**2) / t**3 + (
            6 - 6 * e * w * s + 2 * (e * w * s) ** 2
        ) / s**3

    minimum = minimize(
        cost,
        (0.45, 3.4),
        method="Nelder-Mead",
        options={"xatol": 1e-12, "fatol": 1e-14, "maxiter": 4000},
    )
    return float(minimum.fun), *map(float, minimum.x)


# %%
# The answer
# ----------
# Four coefficients of restitution, each with the midpoint rule and with steps of order 4, against
# the minimum of the closed form.


def main() -> None:
    rows = []
    for e in (1.0, 0.8, 0.5, 0.0):
        for order in (2, 4):
            solution = dmoc.solve(problem(e, order=order), "ipm")
            collision = solution.collisions[0]
            for what, value, exact in zip(
                ("cost", "time", "speed"),
                (solution.cost, collision.time, collision.momentum_before[0]),
                closed_form(e),
                strict=True,
            ):
                rows.append((f"{what}, e = {e:g}, order {order}", value, exact))
    show("block_and_wall", rows, solution)


if __name__ == "__main__":
    main()

# %%
# How to read it
# --------------
# The wall gives back less and less, so the block has to hit it earlier to have time for the way
# back: the time of the hit falls from 0.5 s at e = 1 to 0.414 s at e = 0, and the cost doubles. The
# last column is the error. That of the midpoint rule with 50 steps is 1e-4 of the cost; at order 4
# it is below 1e-8.
