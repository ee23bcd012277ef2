r"""A quadrotor that bounces off a wall
===================================

How does a quadrotor turn back at a wall with the least effort: by its rotors alone, or by a bounce?

Its attitude is a unit quaternion. The thrust :math:`f` acts along its axis :math:`n`, the torques
about its own axes. A round bumper of radius :math:`r` lies in the plane of the rotors, so that the
wall at :math:`d` is touched where

.. math::

   x + r \sqrt{1 - n_x^2} = d, \qquad n_x = 2 (q_1 q_3 + q_0 q_2) .

The wall pushes beside the middle where the quadrotor is tilted, and so turns it, too. How bodies
turn is told in :doc:`/stating/linkages`.

Run:  ``python examples/quadrotor.py [FOLDER]``
"""

import numpy as np
import sympy as sp
from example_report import show
from sympy.physics.mechanics import dynamicsymbols

import dmoc

MASS, INERTIA, GRAVITY = 1.0, (0.02, 0.02, 0.03), 9.81  # kg, kg m^2, m/s^2
RADIUS, WALL, RESTITUTION = 0.3, 2.0, 0.7  # m, m
TORQUES = 50.0  # weight of the squares of torques beside that of the thrust


# %%
# The model
# ---------
# A body that nothing holds. It costs what thrust differs from the weight, and torques. The edge of
# the disc that holds the rotors touches the wall.


def system() -> dmoc.MechanicalSystem:
    x, *others = dynamicsymbols("x y z")
    place = (x, *others)
    thrust, *torques = inputs = dynamicsymbols("f T_x T_y T_z")
    world = dmoc.spatial.World(GRAVITY)
    body = world.free(place, mass=MASS, inertia=INERTIA, torque=torques)
    ends = [
        (0.65 * RADIUS * i, 0.65 * RADIUS * j, 0) for i, j in ((1, 0), (-1, 0), (0, 1), (0, -1))
    ]
    rotors = [dmoc.spatial.Cylinder(0.35 * RADIUS, 0.02, at=end) for end in ends]
    body.draw(dmoc.Link(*ends[:2]), dmoc.Link(*ends[2:]), *rotors, dmoc.spatial.Arrow(thrust))
    axis = [tip - middle for tip, middle in zip(body.point(0, 0, 1), place, strict=True)]
    flat = sp.sqrt(1 - axis[0] ** 2)
    edge = [
        q + RADIUS * (normal - axis[0] * along) / flat
        for q, normal, along in zip(place, (1, 0, 0), axis, strict=True)
    ]
    return world.system(
        "quadrotor_at_a_wall",
        inputs=inputs,
        forces={q: thrust * along for q, along in zip(place, axis, strict=True)},
        surfaces={"wall": x + RADIUS * flat <= WALL},
        cost=(thrust - MASS * GRAVITY) ** 2 / 2 + TORQUES * sum(T**2 for T in torques) / 2,
        units={thrust: "N", **dict.fromkeys(torques, "N m"), **dict.fromkeys(place, "m")},
        drawing=[
            dmoc.Contact("wall", edge, (-1, 0, 0)),
            dmoc.spatial.Plane((WALL, 0, 0), (-1, 0, 0)),
            dmoc.spatial.Plane(),
        ],
    )


# %%
# The problem
# -----------
# From rest to rest a metre aside, in a given time; the wall is hit on the way.


def problem(steps: int = 15) -> dmoc.Problem:
    level = {"q": dmoc.attitude((1, 0, 0, 0)), **{f"q_omega_{k}": 0 for k in "xyz"}}
    rest = {"x_dot": 0, "y_dot": 0, "z_dot": 0, **level}
    return dmoc.Problem(
        dmoc.build(system(), order=4),
        start={"x": 0, "y": 0, "z": 1, **rest},
        goal={"x": 0, "y": 1, "z": 1, **rest},
        sequence=["wall"],
        restitution=RESTITUTION,
        bounds={"f": (0, 25)},
        final_time=2.5,
        steps=steps,
    )


# %%
# The answer
# ----------
# At the wall the quadrotor is level, but for a degree. Another minimum has the other sign of the
# quaternion at the goal: it turns over on its way.


def main() -> None:
    solution = dmoc.solve(problem(), "ipm", starts=6)
    before, after = solution.phases
    q0, q1, q2, q3 = before.q[-1, 3:]
    rows = [
        ("cost", solution.cost, None),
        ("tilt at the wall in degrees", np.rad2deg(np.arcsin(2 * (q1 * q3 + q0 * q2))), None),
        ("speed towards the wall in m/s", before.v[-1, 0], None),
        ("speed away from it in m/s", -after.v[0, 0], None),
    ]
    show("quadrotor", rows, solution)


if __name__ == "__main__":
    main()

# %%
# How to read it
# --------------
# The wall turns it back: before it the rotors only speed the body up, after it they bring it to
# rest. Its bumper meets the wall level, where nothing of the hit is lost in a turn.
