"""my_system: a block is pushed against a wall; its mass, the place of the wall and the restitution
are fitted to a measured run, and a plan is made with them.

`python my_system.py` fits, plans, prints both and draws my_system.png and my_system_fit.png;
`dmoc fit my_system.py:problem my_system.csv --parameter m=0.1:10,wall=0.5:2,e=0:1` fits on the
command line; `dmoc derive my_system.py:system` shows the equations.
"""

from pathlib import Path

import numpy as np
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
    # What is known before anything is measured.
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
    """State what the motion shall do: hit the wall, and be back after two seconds."""
    return dmoc.Problem(
        system,
        start={x: 0.0},  # at rest unless "x_dot" is given
        goal={x: 0.0, "x_dot": 0.0},  # what is not named is free
        sequence=["wall"],  # the collisions in their order, in the measured run too
        final_time=2.0,
    )


def measured(path: Path) -> Path:
    """The file of the measured run: times, places, and the force that was held between them.

    Put your own in its place. Without one, a simulated run with noise is written.
    """
    if not path.exists():
        run = dmoc.simulate(
            problem().kernels, {"x": 0.0}, inputs=[2.0], parameters={"m": 1.3, "wall": 0.9},
            restitution=0.7, step_size=0.002, steps=800, every=5,
        )  # fmt: skip
        noise = 0.002 * np.random.default_rng(1).normal(size=len(run.t))
        rows = zip(run.t, run.q[:, 0] + noise, strict=True)
        lines = ["t [s],x [m],u [N]", *(f"{t:.6f},{place:.6f},2.0" for t, place in rows)]
        path.write_text("\n".join(lines) + "\n")
    return path


def main() -> None:
    """Fit, plan with the fitted values, print and draw both."""
    unknown = {m: (0.1, 10.0), wall: (0.5, 2.0), "e": (0.0, 1.0)}
    fit = dmoc.fit(problem(), measured(Path("my_system.csv")), unknown)
    print(fit)
    fit.plot("my_system_fit.png")
    solution = dmoc.solve(fit.problem)
    print(solution)
    solution.save("my_system.npz")
    solution.plot("my_system.png")


if __name__ == "__main__":
    main()
