r"""The passive compass gait
========================

Can two legs walk without motors?

On a slope they can: what the steps lose at each landing, gravity gives back. Hip and legs float
freely; the foot of the stance leg is held by the floor and by friction, the other foot lands while
it leaves. The motion ends with this landing, as it began with the legs exchanged:

.. math::

   a(T) = b(0), \quad b(T) = a(0), \qquad p^- - p^+ = P \, \nabla g - \mathcal{T} \, \nabla \tau .

Legs without knees scuff the floor as they swing, which is ignored, as usual. The gait is that of A.
Goswami, B. Thuilot and B. Espiau, *A Study of the Passive Gait of a Compass-Like Biped Robot*,
International Journal of Robotics Research 17 (1998) 1282-1301. Its long one has the period
0.734346391 s by an event-driven simulation with 1e-12.

Run:  ``python examples/compass_gait.py [FOLDER]``
"""

from math import radians

import sympy as sp
from example_report import show
from sympy.physics.mechanics import dynamicsymbols

import dmoc

PERIOD = 0.734346391  # of the long gait


# %%
# The model
# ---------
# Gravity is turned by the slope, so that the floor is level.


def system() -> dmoc.MechanicalSystem:
    x, y, a, b = dynamicsymbols("x y a b")
    m, M, l, g, slope, mu = sp.symbols("m M l g slope mu")
    t = dynamicsymbols._t
    hip = sp.Matrix([x, y])
    gravity = sp.Matrix([g * sp.sin(slope), -g * sp.cos(slope)])

    def leg(angle, length):
        return hip + length * sp.Matrix([sp.sin(angle), -sp.cos(angle)])

    lagrangian = 0
    for mass, place in ((M, hip), (m, leg(a, l / 2)), (m, leg(b, l / 2))):
        speed = place.diff(t)
        lagrangian += mass * (speed.dot(speed) / 2 + gravity.dot(place))
    left, right = leg(a, l), leg(b, l)
    return dmoc.MechanicalSystem(
        "compass_gait",
        coordinates=[x, y, a, b],
        lagrangian=lagrangian,
        surfaces={"left": left[1] >= 0, "right": right[1] >= 0},
        tangents={"left": left[0], "right": right[0]},
        friction={"left": mu, "right": mu},
        parameters={m: 5.0, M: 10.0, l: 1.0, g: 9.81, slope: radians(3), mu: 1.0},
        cost=1,
        units={x: "m", y: "m", a: "rad", b: "rad"},
        drawing=[
            dmoc.Wall((-0.5, 0), (1, 0)),
            dmoc.Link(left, hip, right),
            *map(dmoc.Point, (hip, leg(a, l / 2), leg(b, l / 2))),
            dmoc.Contact("left", left),
            dmoc.Contact("right", right),
        ],
    )


# %%
# The problem
# -----------
# No input and no cost but the time; the legs are exchanged by ``periodic``. The last duration is 0:
# the motion ends with its event, and the states that are exchanged are those after it.


def problem(steps: int = 40, shortest: float = 0.65, order: int = 4) -> dmoc.Problem:
    return dmoc.Problem(
        dmoc.build(system(), order=order),
        start={"x": 0.0},
        contacts=["left"],
        sequence=["+right -left"],
        via=[{"a": (-0.5, -0.05)}],
        ignored=["left", "right"],
        periodic={
            "x": ("x", None),
            "y": "y",
            "a": "b",
            "b": "a",
            "x_dot": "x_dot",
            "y_dot": "y_dot",
            "a_dot": "b_dot",
            "b_dot": "a_dot",
        },
        steps=steps,
        final_time=(shortest, 0.9),
        durations=[None, 0],
    )


# %%
# The answer
# ----------
# Period and states of the long gait against the event-driven simulation.


def main() -> None:
    solution = dmoc.solve(problem())
    event = solution.collisions[0]
    after = solution.phases[1].v[0]
    rows = [
        ("period", solution.cost, PERIOD),
        ("angle of the landing leg to the plumb line", event.position[3] - radians(3), 0.2186688),
        ("rate of the stance leg after the event", -after[3], 1.09238359),
        ("rate of the swing leg after the event", -after[2], 0.37737395),
    ]
    show("compass_gait", rows, solution)


if __name__ == "__main__":
    main()

# %%
# How to read it
# --------------
# There are two gaits, a short and a long one; the shortest duration chooses the long one. The
# differences are those of 40 steps. That a cost of time alone finds a gait is no accident: nothing
# is left to choose but which of the two.
