r"""A hopper with impacts
=====================

How little effort keeps a one-legged hopper going?

A body on a springy leg, with a motor in the leg and one in the hip, hops half a metre further each
time, each hop like the one before. The foot hits the ground with restitution 0.5 and leaves at
once. In a period :math:`T` the ground's only impulse must carry the weight,

.. math::

   \lambda = (M + m)\, g\, T ,

and the forward momentum stays, since the impulse is normal to the ground: both are known without
solving anything. After M. H. Raibert, *Legged Robots That Balance*, MIT Press 1986.

Run:  ``python examples/hopper.py [FOLDER]``
"""

import sympy as sp
from example_report import show
from sympy.physics.mechanics import dynamicsymbols

import dmoc

G = 9.81


# %%
# The model
# ---------
# The foot is a point in the plane; its height is the gap.


def system() -> dmoc.MechanicalSystem:
    # Body, angle and length of the leg; force along it, torque of the hip.
    x, y, phi, r, F, tau = dynamicsymbols("x y phi r F tau")
    M, m, J, k, r_0, g = sp.symbols("M m J k r_0 g")
    t = dynamicsymbols._t
    foot = sp.Matrix([x + r * sp.sin(phi), y - r * sp.cos(phi)])
    kinetic = (
        M * (x.diff(t) ** 2 + y.diff(t) ** 2) / 2
        + m * foot.diff(t).dot(foot.diff(t)) / 2
        + J * phi.diff(t) ** 2 / 2
    )
    potential = M * g * y + m * g * foot[1] + k * (r - r_0) ** 2 / 2
    return dmoc.MechanicalSystem(
        "hopper",
        coordinates=[x, y, phi, r],
        inputs=[F, tau],
        lagrangian=kinetic - potential,
        forces={r: F, phi: tau},
        surfaces={"ground": foot[1] >= 0},
        parameters={M: 1.0, m: 0.3, J: 0.05, k: 60.0, r_0: 0.5, g: G},
        cost=(F**2 + 10 * tau**2) / 2,
        dissipation=0.2 * r.diff(t) ** 2 / 2,
        units={x: "m", y: "m", phi: "rad", r: "m", F: "N", tau: "N m"},
        drawing=[
            dmoc.Wall((-0.3, 0), (0.9, 0)),
            dmoc.Spring(foot, (x, y)),
            dmoc.Disc((x, y), 0.06, phi),
            dmoc.Point(foot),
            dmoc.Contact("ground", foot),
        ],
    )


# %%
# The problem
# -----------
# What repeats is named by ``periodic``; the forward speed and the period are ranges.


def problem(steps: int = 60, order: int = 2) -> dmoc.Problem:
    states = ("y", "phi", "r")
    return dmoc.Problem(
        dmoc.build(system(), order=order),
        start={"x": 0.0, "p_x": (0.1, 10.0), "phi": 0.3},
        goal={"x": 0.5},
        periodic=[*states, "p_x", *(f"p_{s}" for s in states)],
        sequence=["ground"],
        steps=steps,
        final_time=(0.45, 0.6),
        bounds={
            "F": (-100.0, 100.0),
            "tau": (-10.0, 10.0),
            "r": (0.3, 0.7),
            "phi": (-0.6, 0.6),
            "y": (0.3, 1.5),
        },
        restitution=0.5,
    )


# %%
# The answer
# ----------
# The impulse against the weight, and each state at the end against its start.


def main() -> None:
    solution = dmoc.solve(problem(), "ipm")
    first, last, hit = solution.phases[0], solution.phases[-1], solution.collisions[0]
    parameters = solution.trajectory.parameters
    weight = (parameters["M"] + parameters["m"]) * G * solution.final_time
    rows = [
        ("impulse of the ground and weight", hit.impulse, weight),
        ("cost", solution.cost, None),
        ("period", solution.final_time, None),
    ]
    rows += [
        (f"{name} at the end and start", last.q[-1, i], first.q[0, i])
        for i, name in enumerate(("x", "y", "phi", "r"))
        if i
    ]
    show("hopper", rows, solution)


if __name__ == "__main__":
    main()

# %%
# How to read it
# --------------
# The impulse is the weight times the period to rounding, because the discrete motion keeps the
# balance of momentum exactly: that is what a variational integrator is for. The states at the end
# are those at the start. The period is at its lower limit, so hops that follow faster would cost
# less.
