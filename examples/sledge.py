r"""A sledge off the boards
=======================

How does somebody on a sledge get to the side of where they stand, off the boards of the rink?

A sledge runs on a blade: at :math:`(x, y)` with the heading :math:`a` it does not slip sideways,

.. math:: \dot x \sin a - \dot y \cos a = 0 .

This constraint of velocities follows from no place: with enough turns the sledge gets anywhere (S.
A. Chaplygin, *On the theory of motion of nonholonomic systems*, Matematicheskii Sbornik 28 (1911)
303-314). It is pushed along its blade by :math:`u` and turned by :math:`w`. From rest its front, at
the distance :math:`b` from the blade, hits the boards, which give back 0.6 of its speed, and it
comes to rest a metre to the side, with its heading of the start, in 4 s, with as little effort
:math:`J = \int (u^2 + w^2)\, dt` as that takes.

The known values are those of Hermite and Simpson's rule in CasADi with IPOPT, in :math:`(x, y, a)`,
the speed :math:`v` along the blade and the turning rate :math:`\omega`, which has no constraint.
The front approaches with :math:`\gamma = v \cos a - b\, \omega \sin a`, and the hit changes

.. math::

   v \to v - \frac{\lambda}{m} \cos a, \qquad
   \omega \to \omega + \frac{\lambda b}{I} \sin a, \qquad
   \lambda = \frac{1.6\, \gamma}{\cos^2 a / m + b^2 \sin^2 a / I} .

Run:  ``python examples/sledge.py [FOLDER]``
"""

import sympy as sp
from example_report import show
from sympy.physics.mechanics import dynamicsymbols

import dmoc

MASS, INERTIA, FRONT = 1.0, 0.2, 0.15  # kg, kg m^2, m; the blade is under the centre of mass
BOARDS, TIME = 1.0, 4.0

EFFORT, HIT = 1.3657916, 2.2698027


# %%
# The model
# ---------


def system() -> dmoc.MechanicalSystem:
    x, y, a, u, w = dynamicsymbols("x y a u w")
    along = sp.cos(a), sp.sin(a)
    speed = x.diff() ** 2 + y.diff() ** 2
    front, back = (
        [place + side * FRONT * c for place, c in zip((x, y), along, strict=True)]
        for side in (1, -1)
    )
    return dmoc.MechanicalSystem(
        "sledge",
        coordinates=[x, y, a],
        inputs=[u, w],
        lagrangian=MASS * speed / 2 + INERTIA * a.diff() ** 2 / 2,
        forces={x: u * along[0], y: u * along[1], a: w},
        constraints={"blade": x.diff() * along[1] - y.diff() * along[0]},
        surfaces={"boards": front[0] <= BOARDS},
        cost=u**2 + w**2,
        units={x: "m", y: "m", a: "rad", u: "N", w: "N m"},
        drawing=[
            dmoc.Wall((BOARDS, -0.5), (BOARDS, 1.5)),
            dmoc.Link(back, front),
            dmoc.Contact("boards", front),
        ],
    )


# %%
# The problem
# -----------


def problem(steps: int = 40) -> dmoc.Problem:
    still = {"x_dot": 0, "y_dot": 0, "a_dot": 0}
    return dmoc.Problem(
        dmoc.build(system(), order=4),
        start={"x": 0, "y": 0, "a": 0, **still},
        goal={"x": 0, "y": 1, "a": 0, **still},
        sequence=["boards"],
        restitution=0.6,
        final_time=TIME,
        steps=steps,
    )


# %%
# The answer
# ----------


def main() -> None:
    solution = dmoc.solve(problem(), "ipm")
    hit = solution.collisions[0]
    rows = [
        ("effort", solution.cost, EFFORT),
        ("moment of the hit in s", hit.time, HIT),
        ("impulse of the boards in N s", hit.impulse, None),
        ("impulse of the blade in N s", hit.reactions["blade"], None),
    ]
    show("sledge", rows, solution)


if __name__ == "__main__":
    main()

# %%
# How to read it
# --------------
# The sledge turns to the side on its way to the boards, and comes back nearly straight, since the
# way to the side costs less with the speed that it has before the hit. The blade takes what the
# boards push across it, an impulse that is in the table. From 121 starts 67 lead to this motion;
# others get to the side after the hit, which costs more.
