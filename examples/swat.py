r"""A ball that flies by is swatted
===============================

How does an arm hit a ball that flies by, so that it flies to a target?

The arm is that of ``arm.urdf``: three hinges, and a racket that is fixed to its last link. The ball
is a point with a radius, three slides in the world of the robot. It is hit once where the distance
of both spheres vanishes, and keeps :math:`e = 0.8` of the speed at which they meet; the least
:math:`\int \sum_i u_i^2 \, dt` decides where and when. With the mass matrix :math:`M` of the arm
and the Jacobian :math:`J` of the racket the impulse along the normal :math:`n` is

.. math::

   P = \frac{(1 + e) \, v_n}{n^T J M^{-1} J^T n + 1/m} .

MuJoCo (E. Todorov, T. Erez, Y. Tassa, IROS 2012), which has read the same file, computes :math:`M`
and :math:`J` independently. How robots are read from files: :doc:`/stating/robots`.

Run:  ``python examples/swat.py [FOLDER]``; it needs ``pip install "dmoc[robots]"``.
"""

from pathlib import Path

import example_report
import mujoco
import numpy as np
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc

FILE = Path(example_report.__file__).with_name("arm.urdf")
MASS, RADIUS, RACKET, E = 0.06, 0.03, 0.1, 0.8  # of the ball in kg and m, of the racket in m
JOINTS = ("turn", "shoulder", "elbow")
PLACE = x, y, z = dynamicsymbols("x y z")


# %%
# The model
# ---------
# What hangs in the world of the robot is part of its system.


def system() -> dmoc.MechanicalSystem:
    robot = dmoc.read_robot(FILE)
    ball = robot.world.slide(x, "x").slide(y, "y")
    ball = ball.slide(z, "z", mass=MASS, inertia=(0, 0, 0), name="ball")
    ball.draw(dmoc.spatial.Sphere(RADIUS))
    distance = sp.sqrt(sum((a - b) ** 2 for a, b in zip(robot.point("racket"), PLACE, strict=True)))
    return robot.system(
        "swat",
        surfaces={"racket": distance >= RACKET + RADIUS},
        cost=sum(u**2 for u in robot.inputs.values()),
    )


# %%
# The problem
# -----------
# The arm begins and ends at rest; the ball comes from 2 m away, and flies back there, a metre
# aside.


def problem(steps: int = 20) -> dmoc.Problem:
    return dmoc.Problem(
        dmoc.build(system(), order=4),
        start={
            "turn": 0, "shoulder": 0, "elbow": 1.5,
            x: 2, y: -0.5, z: 0.8, "x_dot": -3, "y_dot": 0.7, "z_dot": 2.2,
        },
        goal={x: 2, y: 0.5, z: 0.8, **{f"{joint}_dot": 0 for joint in JOINTS}},
        bounds=dmoc.read_robot(FILE).bounds,
        sequence=["racket"],
        restitution=E,
        steps=steps,
        final_time=(0.8, 1.5),
    )  # fmt: skip


# %%
# The impulse by MuJoCo
# ---------------------


def impulse(phase: dmoc.motion.trajectory.Phase) -> float:
    """Of the hit at the end of a phase."""
    model = mujoco.MjModel.from_xml_path(str(FILE))
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = phase.q[-1][:3], phase.v[-1][:3]
    mujoco.mj_forward(model, data)
    M, J = np.zeros((3, 3)), np.zeros((3, 3))
    mujoco.mj_fullM(model, data, M)
    hand = data.geom_xpos[0]
    mujoco.mj_jac(model, data, J, None, hand, model.geom_bodyid[0])
    n = (phase.q[-1][3:] - hand) / np.linalg.norm(phase.q[-1][3:] - hand)
    speed = n @ (J @ data.qvel - phase.v[-1][3:])
    return float((1 + E) * speed / (n @ J @ np.linalg.solve(M, J.T @ n) + 1 / MASS))


# %%
# The answer
# ----------


def main() -> None:
    solution = dmoc.solve(problem(), "ipm")
    hit = solution.collisions[0]
    rows = [
        ("impulse of the hit in N s", hit.impulse, impulse(solution.phases[0])),
        ("speed that is left, of that before", -hit.rate_after / hit.rate_before, E),
        ("cost", solution.cost, None),
    ]
    example_report.show("swat", rows, solution)


if __name__ == "__main__":
    main()

# %%
# How to read it
# --------------
# The ball weighs 60 g, and 0.5 N s turn it round. The arm goes along with the ball before the hit,
# and meets it with the elbow bent; most of its torque stops it again. The differences are those of
# 20 steps a phase. Other minima, with the arm on the other side of the ball, cost more.
