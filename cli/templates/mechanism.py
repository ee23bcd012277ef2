"""my_system: a hammer on a rod strikes an anvil; the spring that helps it is chosen too.

`python my_system.py` solves the problem, prints the result and draws my_system.png;
`dmoc solve my_system.py:problem --out result` does the same on the command line;
`dmoc derive my_system.py:system` shows the equations.
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc

# Coordinates and inputs are functions of the time, parameters are symbols.
x, y, u = dynamicsymbols("x y u")
m, l, g, k = sp.symbols("m l g k")
v_x, v_y = x.diff(), y.diff()
rate = (x * v_y - y * v_x) / l**2  # at which the rod turns

system = dmoc.MechanicalSystem(
    "my_system",
    coordinates=[x, y],
    inputs=[u],
    # Kinetic minus potential energy.
    lagrangian=m * (v_x**2 + v_y**2) / 2 - m * g * y - k * x**2 / 2,
    forces={x: -u * y / l**2, y: u * x / l**2},  # of a motor that turns the rod with u
    constraints={"rod": sp.Eq(x**2 + y**2, l**2)},  # holds in every phase, by a force of its own
    surfaces={"anvil": x <= 0},  # what stops the motion
    # Values can be changed later without a new build.
    parameters={m: 1.0, l: 0.5, g: 9.81, k: 10.0},
    quantities={"power": u * rate},  # has a name for bounds, tables and figures
    integrals={"effort": u**2},
    # What is least: an expression of totals, ends, peaks, the final time and parameters.
    objective=dmoc.total("effort") + 0.01 * k,
    units={x: "m", y: "m", u: "N m", "power": "W"},
    drawing=[  # how it looks in figures; leave it out, and the coordinates are shown instead
        dmoc.Link((0, 0), (x, y)),
        dmoc.Point((x, y)),
        dmoc.Wall((0, -0.6), (0, -0.4)),  # solid on the right of the way upwards
        dmoc.Contact("anvil", (x, y), normal=(-1, 0)),  # where and how the anvil pushes
    ],
)


def problem() -> dmoc.Problem:
    """State what the motion shall do: strike the anvil, and come back after half a second."""
    return dmoc.Problem(
        system,
        start={x: -0.3, y: -0.4},  # at rest unless velocities are given
        goal={x: -0.3, "x_dot": 0.0},  # what is not named is free, or decided by the rod
        sequence=["anvil"],  # the collisions in their order
        final_time=0.5,  # a pair (shortest, longest) leaves it free
        bounds={"power": (-6.0, 6.0)},  # along the whole path; other limits need no new build
        design={k: (0.0, 40.0)},  # parameters that are chosen together with the motion
        restitution=0.5,  # of the anvil: 1 is elastic, 0 plastic
    )


def main() -> None:
    """Solve the problem, check the motion by simulation, print and draw it."""
    solution = dmoc.solve(problem())
    print(solution)
    solution.save("my_system.npz")
    solution.plot("my_system.png")


if __name__ == "__main__":
    main()
