r"""A passive walker with knees
===========================

Can legs with knees walk without motors, and clear the floor?

Hip, two thighs and two shanks float freely on a slope. The stance leg is straight: a grip locks its
knee. The other leg swings with an open knee until that is straight again and locks, which costs
energy; then its foot lands, while the foot behind leaves:

.. math::

   \theta_t = \theta_s, \quad \dot \theta_t^+ = \dot \theta_s^+, \qquad
   p^+ - p^- = \Lambda_1 \nabla (a - c) + \Lambda_2 \nabla (b - d) - P \, \nabla g + \ldots .

Both knees hold through the landing, and the one behind is open from then on. Nothing in the
sequence says so: the motion ends with the landing, and the next one begins with one closed knee.

Masses and lengths are those of V. F. H. Chen, *Passive Dynamic Walking with Knees: A Point Foot
Model*, Massachusetts Institute of Technology (2007). Times, state and multipliers of the gait are
those of an event-driven Runge-Kutta integration of order 8 with 1e-12.

Run:  ``python examples/kneed_walker.py [FOLDER]``
"""

import sympy as sp
from example_report import show
from sympy.physics.mechanics import dynamicsymbols

import dmoc

SLOPE = 0.0504  # rad


# %%
# The model
# ---------
# Thighs and shanks of 0.5 m have the angles a, c (left) and b, d (right) to the normal of the
# slope. A knee is a grip: the difference of its two angles.


def system() -> dmoc.MechanicalSystem:
    x, y, a, c, b, d = dynamicsymbols("x y a c b d")
    m_hip, m_thigh, m_shank, g, slope, mu = sp.symbols("m_hip m_thigh m_shank g slope mu")
    hip = sp.Matrix([x, y])
    gravity = sp.Matrix([g * sp.sin(slope), -g * sp.cos(slope)])

    def along(angle, length):
        return length * sp.Matrix([sp.sin(angle), -sp.cos(angle)])

    masses, knees, feet = [(m_hip, hip)], [], []
    for thigh, shank in ((a, c), (b, d)):
        knees.append(hip + along(thigh, 0.5))
        feet.append(knees[-1] + along(shank, 0.5))
        masses += [(m_thigh, hip + along(thigh, 0.325)), (m_shank, knees[-1] + along(shank, 0.125))]
    speeds = [(m, place, place.diff(dynamicsymbols._t)) for m, place in masses]
    left, right = feet
    return dmoc.MechanicalSystem(
        "kneed_walker",
        coordinates=[x, y, a, c, b, d],
        lagrangian=sum(m * (v.dot(v) / 2 + gravity.dot(place)) for m, place, v in speeds),
        surfaces={"left": left[1] >= 0, "right": right[1] >= 0},
        tangents={"left": left[0], "right": right[0]},
        friction={"left": mu, "right": mu},
        grips={"left_knee": a - c, "right_knee": b - d},
        parameters={m_hip: 0.5, m_thigh: 0.5, m_shank: 0.05, g: 9.81, slope: SLOPE, mu: 1.0},
        cost=1,
        units={x: "m", y: "m", **dict.fromkeys((a, b, c, d), "rad")},
        drawing=[
            dmoc.Wall((-0.5, 0), (1, 0)),
            dmoc.Link(left, knees[0], hip, knees[1], right),
            *map(dmoc.Point, (hip, *knees)),
            dmoc.Contact("left", left),
            dmoc.Contact("right", right),
        ],
    )


# %%
# The problem
# -----------
# The states after the landing are those at the start with the legs exchanged. The right foot begins
# on the floor, which it leaves; a step has some length, since standing still is periodic too.


def problem(steps: int = 30, order: int = 4) -> dmoc.Problem:
    mirrored = {"a": "b", "b": "a", "c": "d", "d": "c"}
    rates = {f"{end}_dot": f"{start}_dot" for end, start in mirrored.items()}
    return dmoc.Problem(
        dmoc.build(system(), order=order),
        start={"x": 0.0},
        contacts=["left", "left_knee"],
        sequence=["+right_knee", "+right -left"],
        via=[{}, {"a": (-0.4, -0.1)}],
        ignored=["left", "right"],
        periodic={"x": ("x", None), "y": "y", "x_dot": "x_dot", "y_dot": "y_dot"}
        | mirrored | rates,
        steps=steps,
        final_time=(0.45, 0.8),
        durations=[None, None, 0],
    )  # fmt: skip


# %%
# The answer
# ----------
# Some places on the way are guess enough.


def guess() -> list[dict[str, list[float]]]:
    early, late = {"x": [0, 0.24], "y": [0.97, 1]}, {"x": [0.24, 0.47], "y": [1, 0.97]}
    early |= {"a": [0.24, -0.09], "c": [0.24, -0.09], "b": [-0.24, 0.3], "d": [-0.24, -0.4, 0.3]}
    late |= {"a": [-0.09, -0.24], "c": [-0.09, -0.24], "b": [0.3, 0.24], "d": [0.3, 0.24]}
    return [early, late]


def main() -> None:
    solution = dmoc.solve(problem(), guess=guess())
    knee, landing = solution.collisions
    after, stability = solution.phases[-1].v[0], solution.stability()
    rows = [
        ("the knee locks", knee.time, 0.348612000),
        ("period", solution.cost, 0.564328166),
        ("angle of the landing leg to the plumb line", landing.position[4] - SLOPE, 0.18818546),
        ("rate of the stance leg after the landing", -after[4], 1.10958733),
        ("rate of the swing leg after the landing", -after[2], 0.05714811),
        ("impulse in the knee that locks", knee.impulses["right_knee"], 0.00424915),
        ("size of the largest multiplier", abs(stability.multipliers[1]), 0.65516848),
    ]
    show("kneed_walker", rows, solution)


if __name__ == "__main__":
    main()

# %%
# How to read it
# --------------
# The largest multiplier, beside the 1 of walking on from another place, is smaller than 1: the gait
# is stable. Its swinging foot passes 17 mm above the floor, where legs without knees scuff. What
# the knee and the floor take from the energy in a step, the slope gives back.
