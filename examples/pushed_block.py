"""A block on a rail with friction
===============================

A block pushed over a rail with dry friction: it sticks, slides and sticks again.

The push costs int u^2/2 dt, so that it pays to slide for a part of the time only.  While the block
slides for the time s over the distance d against the friction f, the least cost is
6 d^2/s^3 + f^2 s/2, which is least at s = sqrt(6 d/f): J = (2/3) sqrt(6 d f^3).  When the slide
begins is free, as long as there is time for it.

Run:  ``python examples/pushed_block.py [FOLDER]``
"""

import sympy as sp
from showing import show
from sympy.physics.mechanics import dynamicsymbols

import dmoc


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


def problem(steps: int = 50) -> dmoc.Problem:
    return dmoc.Problem(
        dmoc.build(system()),
        start={"x": 0.0},
        goal={"x": 1.0, "x_dot": 0.0},
        sequence=["rail:slip+", "rail:stick"],
        steps=steps,
        final_time=4.0,
    )


def main() -> None:
    solution = dmoc.solve(problem())
    rows = [
        ("cost", solution.cost, 2 / 3 * 6**0.5),
        ("duration of the slide", solution.phases[1].duration, 6**0.5),
    ]
    show("pushed_block", rows, solution)


if __name__ == "__main__":
    main()
