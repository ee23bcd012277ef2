"""Two bounces
===========

A ball is shot up from the floor so that its peak after two lossy bounces is half a metre high:
how fast?

Each bounce keeps 0.9 of the speed, so that v0 = sqrt(2 g 0.5) / 0.81; there is no input, and the
three durations are free.

Run:  ``python examples/two_bounces.py [FOLDER]``
"""

import sympy as sp
from showing import show
from sympy.physics.mechanics import dynamicsymbols

import dmoc

E, PEAK, GRAVITY = 0.9, 0.5, 9.81
V0 = (2 * GRAVITY * PEAK) ** 0.5 / E**2
KNOWN = {"v0": V0, "phases": (2 * V0 / GRAVITY, 2 * E * V0 / GRAVITY, E**2 * V0 / GRAVITY)}


def system() -> dmoc.MechanicalSystem:
    y = dynamicsymbols("y")
    g = sp.Symbol("g")
    return dmoc.MechanicalSystem(
        "ball",
        coordinates=[y],
        lagrangian=y.diff(dynamicsymbols._t) ** 2 / 2 - g * y,
        surfaces={"floor": y >= 0},
        parameters={g: GRAVITY},
        units={y: "m"},
        drawing=[
            dmoc.Wall((-0.3, 0), (0.3, 0)),
            dmoc.Disc((0, y + 0.05), 0.05),
            dmoc.Contact("floor", (0, y)),
        ],
    )


def problem(steps: int = 50, order: int = 2) -> dmoc.Problem:
    return dmoc.Problem(
        dmoc.build(system(), order=order),
        start={"y": 0.0, "y_dot": (0.1, 20.0)},
        goal={"y": PEAK, "y_dot": 0.0},
        sequence=["floor", "floor"],
        steps=steps,
        final_time=(0.1, 5.0),
        restitution=E,
    )


def main() -> None:
    solution = dmoc.solve(problem(), "ipm")
    rows = [("speed at the start", solution.phases[0].v[0, 0], KNOWN["v0"])]
    for i, (phase, exact) in enumerate(zip(solution.phases, KNOWN["phases"], strict=True)):
        rows.append((f"duration of phase {i}", phase.duration, exact))
    rows.append(("final time", solution.final_time, sum(KNOWN["phases"])))
    show("two_bounces", rows, solution)


if __name__ == "__main__":
    main()
