"""my_system: a block that rests on a rough floor is pushed, slides, and sticks again.

`python my_system.py` solves the problem, prints the result and draws my_system.png;
`dmoc solve my_system.py:problem --out result` does the same on the command line;
`dmoc derive my_system.py:system` shows the equations.
"""

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc

# Coordinates and inputs are functions of the time, parameters are symbols.
x, y, u = dynamicsymbols("x y u")
m, g, mu = sp.symbols("m g mu")

system = dmoc.MechanicalSystem(
    "my_system",
    coordinates=[x, y],
    inputs=[u],
    # Kinetic minus potential energy.
    lagrangian=m * (x.diff() ** 2 + y.diff() ** 2) / 2 - m * g * y,
    forces={x: u},  # the generalised force in each coordinate
    surfaces={"floor": y >= 0},  # what carries the block, and stops it
    tangents={"floor": x},  # what rubs along the floor
    friction={"floor": mu},  # Coulomb's coefficient
    # Values can be changed later without a new build.
    parameters={m: 1.0, g: 9.81, mu: 0.3},
    cost=u**2 / 2,  # integrated over the time
    units={x: "m", y: "m", u: "N"},
    drawing=[  # how it looks in figures; leave it out, and the coordinates are shown instead
        dmoc.Wall((-0.3, 0), (1.3, 0)),  # solid on the right of the way: below
        dmoc.Box((x, y + 0.1), 0.2, 0.2),
        dmoc.Contact("floor", (x, y)),  # where the floor pushes, and rubs
    ],
)


def problem() -> dmoc.Problem:
    """State what the motion shall do: stand, slide by a metre, and stand again."""
    return dmoc.Problem(
        system,
        start={x: 0.0, y: 0.0},  # at rest unless "x_dot" is given
        goal={x: 1.0, "x_dot": 0.0},  # what is not named is free
        contacts=["floor"],  # closed at the start; it sticks
        # It slides to where x grows, and sticks again.
        sequence=["floor:slip+", "floor:stick"],
        final_time=3.0,  # a pair (shortest, longest) leaves it free
    )


def main() -> None:
    """Solve the problem, check the motion by simulation, print and draw it."""
    solution = dmoc.solve(problem())
    print(solution)
    for phase in solution.phases:
        friction = phase.tangential[:, 0].mean()
        print(f"{phase.mode}: {phase.duration:.4f} s, mean friction {friction:.4f} N")
    solution.save("my_system.npz")
    solution.plot("my_system.png")


if __name__ == "__main__":
    main()
