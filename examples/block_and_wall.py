"""A block and a wall
==================

A block is pushed against a wall and back; impacts are elastic, lossy and plastic.

Unfolding the wall makes the motion a free one, so that the least cost has a closed form: before the
impact at time t with speed w the block covers the distance 1, after it with the speed e w the
distance 1 again, and t and w minimise

    J(t, w) = (6 - 6 w t + 2 w^2 t^2) / t^3 + (6 - 6 e w s + 2 e^2 w^2 s^2) / s^3,    s = 1 - t.

Run:  ``python examples/block_and_wall.py [FOLDER]``
"""

import sympy as sp
from scipy.optimize import minimize
from showing import show
from sympy.physics.mechanics import dynamicsymbols

import dmoc

KNOWN = {
    1.0: (24.0, 0.5, 3.0),
    0.8: (24.58630915, 0.48174700, 3.30175954),
    0.0: (50.95584412, 2**0.5 - 1, 3.62132035),
}


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


def known(e: float) -> tuple[float, float, float]:
    """Cost, time and speed of the impact, from the closed form."""

    def cost(z):
        t, w = z
        s = 1 - t
        return (6 - 6 * w * t + 2 * w**2 * t**2) / t**3 + (
            6 - 6 * e * w * s + 2 * (e * w * s) ** 2
        ) / s**3

    found = minimize(
        cost,
        (0.45, 3.4),
        method="Nelder-Mead",
        options={"xatol": 1e-12, "fatol": 1e-14, "maxiter": 4000},
    )
    return float(found.fun), *map(float, found.x)


def main() -> None:
    rows = []
    for e in (1.0, 0.8, 0.5, 0.0):
        for order in (2, 4):
            solution = dmoc.solve(problem(e, order=order), "ipm")
            collision = solution.collisions[0]
            for what, found, exact in zip(
                ("cost", "time", "speed"),
                (solution.cost, collision.time, collision.momentum_before[0]),
                known(e),
                strict=True,
            ):
                rows.append((f"{what}, e = {e:g}, order {order}", found, exact))
    show("block_and_wall", rows, solution)


if __name__ == "__main__":
    main()
