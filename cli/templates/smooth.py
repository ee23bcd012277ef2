"""my_system: a pendulum is swung up by a torque that is too weak to lift it at once.

`python my_system.py` solves the problem, prints the result and draws my_system.png;
`dmoc solve my_system.py:problem --out result` does the same on the command line;
`dmoc derive my_system.py:system` shows the equations.
"""

from math import pi

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc

# Coordinates and inputs are functions of the time, parameters are symbols.
phi, torque = dynamicsymbols("phi torque")
m, g, length, damping = sp.symbols("m g length damping")

system = dmoc.MechanicalSystem(
    "my_system",
    coordinates=[phi],  # from hanging down
    inputs=[torque],
    # Kinetic minus potential energy.
    lagrangian=m * length**2 * phi.diff() ** 2 / 2 + m * g * length * sp.cos(phi),
    forces={phi: torque},  # the generalised force in each coordinate
    dissipation=damping * phi.diff() ** 2 / 2,  # Rayleigh's function
    # Values can be changed later without a new build.
    parameters={m: 1.0, g: 9.81, length: 0.5, damping: 0.01},
    cost=torque**2 / 2,  # integrated over the time
    units={phi: "rad", torque: "N m"},
    drawing=[  # how it looks in figures; leave it out, and the coordinates are shown instead
        dmoc.Link((0, 0), (length * sp.sin(phi), -length * sp.cos(phi))),
        dmoc.Point((length * sp.sin(phi), -length * sp.cos(phi))),
    ],
)


def problem() -> dmoc.Problem:
    """State what the motion shall do: go from hanging at rest to standing at rest."""
    return dmoc.Problem(
        system,
        start={phi: 0.0},  # at rest unless "phi_dot" is given
        goal={phi: pi, "phi_dot": 0.0},  # what is not named is free
        final_time=(1.0, 4.0),  # one number fixes it
        bounds={torque: (-2.0, 2.0)},
    )


def main() -> None:
    """Solve the problem, check the motion by simulation, print and draw it."""
    solution = dmoc.solve(problem())
    print(solution)
    solution.save("my_system.npz")
    solution.plot("my_system.png")


if __name__ == "__main__":
    main()
