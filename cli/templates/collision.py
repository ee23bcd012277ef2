"""my_system: a block is pushed against a wall, bounces off it, and comes back to rest.

`python my_system.py` solves the problem, prints the result and draws my_system.png;
`dmoc solve my_system.py:problem --out result` does the same on the command line;
`dmoc derive my_system.py:system` shows the equations.
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc

# Coordinates and inputs are functions of the time, parameters are symbols.
x, u = dynamicsymbols("x u")
m, wall = sp.symbols("m wall")

system = dmoc.MechanicalSystem(
    "my_system",
    coordinates=[x],
    inputs=[u],
    # Kinetic minus potential energy.
    lagrangian=m * x.diff() ** 2 / 2,
    forces={x: u},  # the generalised force in each coordinate
    surfaces={"wall": x <= wall},  # what stops the motion
    # Values can be changed later without a new build.
    parameters={m: 1.0, wall: 1.0},
    cost=u**2 / 2,  # integrated over the time
    units={x: "m", u: "N"},
    drawing=[  # how it looks in figures; leave it out, and the coordinates are shown instead
        dmoc.Box((x - 0.1, 0.1), 0.2, 0.2),
        dmoc.Wall((wall, 0), (wall, 0.4)),  # solid on the right of the way upwards
        dmoc.Contact("wall", (x, 0.1), normal=(-1, 0)),  # where and how the wall pushes
    ],
)


def problem() -> dmoc.Problem:
    """State what the motion shall do: hit the wall, and be back after a second."""
    return dmoc.Problem(
        system,
        start={x: 0.0},  # at rest unless "x_dot" is given
        goal={x: 0.0, "x_dot": 0.0},  # what is not named is free
        sequence=["wall"],  # the collisions in their order
        final_time=1.0,  # a pair (shortest, longest) leaves it free
        bounds={u: (-50.0, 50.0)},
        restitution=1.0,  # of the wall: 1 is elastic, 0 plastic
    )


def main() -> None:
    """Solve the problem, check the motion by simulation, print and draw it."""
    solution = dmoc.solve(problem())
    print(solution)
    solution.save("my_system.npz")
    solution.plot("my_system.png")


if __name__ == "__main__":
    main()
