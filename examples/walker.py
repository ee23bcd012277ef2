r"""A step of a walker with five links
==================================

What is the gait of a robot, if nobody shows it one?

RABBIT has a torso, two thighs and two shins, with motors in hips and knees (C. Chevallereau et al.,
*RABBIT: A Testbed for Advanced Control Theory*, IEEE Control Systems Magazine 23 (2003) 57-79). The
length of the step and its time are given, and the least effort is asked for:

.. math::

   J = \int_0^T \left( u_1^2 + u_2^2 + u_3^2 + u_4^2 \right) dt, \qquad
   q(T) = P\, q(0) + (d, 0, \ldots, 0), \quad \dot q(T) = P\, \dot q(0)

with the permutation :math:`P` of left and right. The floor and friction hold the stance foot; the
other foot lands plastically while that one leaves.

Run:  ``python examples/walker.py [FOLDER]``
"""

import numpy as np
import sympy as sp
from example_report import show
from sympy.physics.mechanics import dynamicsymbols

import dmoc

STEP, TIME = 0.5, 0.7
# Mass, inertia, length and distance of the centre from hip or knee: shin, thigh, torso.
SHIN, THIGH, TORSO = (3.2, 0.93, 0.4, 0.128), (6.8, 1.08, 0.4, 0.163), (20.0, 2.22, 0.625, 0.2)


# %%
# The model
# ---------
# Five bodies; the floor is one surface for each foot, knees bend one way.


def system() -> dmoc.MechanicalSystem:
    q = dynamicsymbols("x y torso thigh_l shin_l thigh_r shin_r")
    u = dynamicsymbols("hip_l knee_l hip_r knee_r")
    (x, y, torso, thigh_l, shin_l, thigh_r, shin_r), (hip_l, knee_l, hip_r, knee_r) = q, u
    g, mu, t = *sp.symbols("g mu"), dynamicsymbols._t
    hip = sp.Matrix([x, y])

    def below(angle, length):
        return length * sp.Matrix([sp.sin(angle), -sp.cos(angle)])

    bodies, feet, lagrangian = [(TORSO, hip - below(torso, TORSO[3]), torso)], {}, 0
    drawing = [dmoc.Wall((-0.5, 0), (1, 0)), dmoc.Link(hip, hip - below(torso, TORSO[2]))]
    for name, thigh, shin in (("left", thigh_l, shin_l), ("right", thigh_r, shin_r)):
        knee = hip + below(thigh, THIGH[2])
        bodies += [(THIGH, hip + below(thigh, THIGH[3]), thigh)]
        bodies += [(SHIN, knee + below(shin, SHIN[3]), shin)]
        feet[name] = knee + below(shin, SHIN[2])
        drawing += [dmoc.Link(hip, knee, feet[name]), dmoc.Contact(name, feet[name])]
    torques = (-hip_l - hip_r, hip_l - knee_l, knee_l, hip_r - knee_r, knee_r)
    for (mass, inertia, _, _), centre, angle in bodies:
        speed = centre.diff(t)
        lagrangian += mass * (speed.dot(speed) / 2 - g * centre[1])
        lagrangian += inertia * angle.diff(t) ** 2 / 2
    stated = ("walker", q, lagrangian, {g: 9.81, mu: 0.7}, u)
    return dmoc.MechanicalSystem(
        *stated,
        forces=dict(zip(q[2:], torques, strict=True)),
        surfaces={name: foot[1] >= 0 for name, foot in feet.items()},
        tangents={name: foot[0] for name, foot in feet.items()},
        friction=dict.fromkeys(feet, mu),
        path_constraints={"knee_left": thigh_l >= shin_l, "knee_right": thigh_r >= shin_r},
        cost=sum(torque**2 for torque in u),
        units={x: "m", y: "m"} | dict.fromkeys(q[2:], "rad") | dict.fromkeys(u, "N m"),
        drawing=drawing,
    )


# %%
# The problem
# -----------
# One phase, and the exchange of the feet with which it ends: the last duration is 0.


LEGS = {"thigh_l": "thigh_r", "shin_l": "shin_r", "thigh_r": "thigh_l", "shin_r": "shin_l"}
SAME = {"y": "y", "torso": "torso"} | LEGS
RATES = {f"{end}_dot": f"{start}_dot" for end, start in ({"x": "x"} | SAME).items()}
STEPPING = {
    "contacts": ["left"],
    "sequence": ["+right -left"],
    "bounds": {"torso": (-0.6, 0.6)} | dict.fromkeys(LEGS, (-1.8, 1.2)),
}


def problem(steps: int = 20, order: int = 4) -> dmoc.Problem:
    return dmoc.Problem(
        dmoc.build(system(), order=order),
        {"x": 0.0},
        periodic={"x": ("x", STEP)} | SAME | RATES,
        steps=steps,
        durations=[TIME, 0],
        **STEPPING,
    )


# %%
# The answer
# ----------
# The mean force of the floor must be the weight; the rest of the table is what the gait is like.


def main() -> None:
    solution = dmoc.solve(problem())
    stance, landing = solution.phases[0], solution.collisions[0].impulse
    mean = (np.trapezoid(stance.normal[:, 0], stance.t) + landing) / TIME
    rows = [
        ("cost", solution.cost, 390.7905),  # as steps get smaller, also from mid-stance on
        ("mean vertical force, in weights", mean / 40.0 / 9.81, 1.0),
        ("most friction to contact force", abs(stance.tangential / stance.normal).max(), None),
        ("impulse of the landing, N s", landing, None),
    ]
    show("walker", rows, solution)


if __name__ == "__main__":
    main()

# %%
# How to read it
# --------------
# The mean vertical force is the weight to 3e-4. Friction stays far within its cone: the ratio would
# have to exceed 0.7. Nothing in the problem says what a gait looks like; it is what least effort,
# the floor and the exchange of the legs leave.
