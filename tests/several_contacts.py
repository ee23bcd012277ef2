"""Bodies with several contacts at once, and what is known of them."""

from __future__ import annotations

from math import acosh, atan2, cos, hypot, sin, sqrt

import numpy as np
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc

X, Y, A, U, W = dynamicsymbols("x y a u w")
M, G, B, H, MU = sp.symbols("m g b h mu")
T = dynamicsymbols._t
MASS, GRAVITY, HALF_WIDTH, HALF_HEIGHT = 2.0, 9.81, 0.2, 0.5


def box(name: str = "several_box", corners: int = 2) -> dmoc.MechanicalSystem:
    """A box on a rough floor, with contacts along its lower side, pushed at its middle and
    turned."""
    places = {"left": -1, "right": 1, "middle": 0}
    points = {
        name: (X + s * B * sp.cos(A) + H * sp.sin(A), Y + s * B * sp.sin(A) - H * sp.cos(A))
        for name, s in list(places.items())[:corners]
    }
    inertia = M * (B**2 + H**2) / 3
    return dmoc.MechanicalSystem(
        name, [X, Y, A],
        (M * (X.diff(T) ** 2 + Y.diff(T) ** 2) + inertia * A.diff(T) ** 2) / 2 - M * G * Y,
        {M: MASS, G: GRAVITY, B: HALF_WIDTH, H: HALF_HEIGHT, MU: 0.6},
        inputs=[U, W], forces={X: U, A: W}, cost=(U**2 + W**2) / 2,
        surfaces={name: point[1] >= 0 for name, point in points.items()},
        tangents={name: point[0] for name, point in points.items()},
        friction=dict.fromkeys(points, MU),
    )  # fmt: skip


def gripper() -> dmoc.MechanicalSystem:
    """A disc between two fingers that open and rise together."""
    w, z, s, f = dynamicsymbols("w z s f")
    r = sp.Symbol("r")
    disc = M * (X.diff(T) ** 2 + Y.diff(T) ** 2) + M * r**2 / 2 * A.diff(T) ** 2
    return dmoc.MechanicalSystem(
        "gripper", [X, Y, A, w, z],
        (disc + w.diff(T) ** 2 + z.diff(T) ** 2) / 2 - M * G * Y - G * z,
        {M: 0.5, G: GRAVITY, r: 0.05, MU: 0.5}, inputs=[s, f], forces={w: -s, z: f},
        cost=(s**2 + f**2) / 2, surfaces={"one": X - r + w >= 0, "two": w - X - r >= 0},
        tangents={"one": Y - z - r * A, "two": Y - z + r * A}, friction={"one": MU, "two": MU},
    )  # fmt: skip


def flat_foot() -> dmoc.MechanicalSystem:
    """A body on a leg with an ankle and a foot that has a heel and a toe."""
    leg, lean, thrust, turn = dynamicsymbols("l th thrust turn")
    ends = {
        name: (X + s * sp.cos(A) / 10, Y + s * sp.sin(A) / 10)
        for name, s in (("heel", -1), ("toe", 1))
    }
    body = X + leg * sp.sin(lean), Y + leg * sp.cos(lean)
    foot = M * (X.diff(T) ** 2 + Y.diff(T) ** 2) + M / 150 * A.diff(T) ** 2
    return dmoc.MechanicalSystem(
        "flat_foot", [X, Y, A, leg, lean],
        (foot + 2 * (body[0].diff(T) ** 2 + body[1].diff(T) ** 2)) / 2 - G * (M * Y + 2 * body[1]),
        {M: 0.3, G: GRAVITY, MU: 0.8}, inputs=[thrust, turn],
        forces={leg: thrust, lean: turn, A: -turn}, cost=(thrust**2 + 20 * turn**2) / 2,
        surfaces={name: end[1] >= 0 for name, end in ends.items()},
        tangents={name: end[0] for name, end in ends.items()}, friction=dict.fromkeys(ends, MU),
    )  # fmt: skip


STANDING = {"x": 0, "y": HALF_HEIGHT, "a": 0}
LET_GO = {"u": (0, 0), "w": (0, 0)}


def falling_flat(mu: float, words: str, steps: int = 8) -> dmoc.Problem:
    """The box falls half a metre while it moves ahead with 0.5 m/s."""
    return dmoc.Problem(
        box(), start={"x": 0, "y": 2 * HALF_HEIGHT, "a": 0, "x_dot": 0.5}, sequence=[words],
        parameters={"mu": mu}, bounds=LET_GO, steps=steps, final_time=0.5,
    )  # fmt: skip


FALL = sqrt(2 * HALF_HEIGHT / GRAVITY)


def rocking(tilt: float, steps: int = 40) -> dmoc.Problem:
    """The box is let go on its left corner, and goes over to the right one."""
    place = np.array([[cos(tilt), -sin(tilt)], [sin(tilt), cos(tilt)]]) @ [HALF_WIDTH, HALF_HEIGHT]
    return dmoc.Problem(
        box(), start={"x": place[0], "y": place[1], "a": tilt, "x_dot": 0, "y_dot": 0, "a_dot": 0},
        contacts=["left"], sequence=["+right -left"], bounds=LET_GO, steps=steps,
        final_time=(0.1, 2), durations=[(None, None), (0.1, 0.1)],
    )  # fmt: skip


SLENDER, RADIUS = atan2(HALF_WIDTH, HALF_HEIGHT), hypot(HALF_WIDTH, HALF_HEIGHT)
HOUSNER = 1 - 1.5 * sin(SLENDER) ** 2  # rate after over rate before


def time_to_land(tilt: float) -> float:
    """A quarter of the period of the rocking box, by quadrature; with tilt = t (1 - s^2) the rate
    vanishes with s."""
    from scipy.integrate import quad

    def slowness(s: float) -> float:
        at = tilt * (1 - s * s)
        fallen = cos(SLENDER - tilt) - cos(SLENDER - at)
        return 2 * tilt * s / sqrt(1.5 * GRAVITY / RADIUS * fallen)

    return float(quad(slowness, 0, 1, epsabs=1e-13)[0])


def time_of_slender(tilt: float) -> float:
    """The same for a slender box (Housner 1963)."""
    return acosh(1 / (1 - tilt / SLENDER)) / sqrt(0.75 * GRAVITY / RADIUS)


def pushed(steps: int = 20) -> dmoc.Problem:
    """The box is pushed by a metre, without a torque: it stands, slides and stands."""
    return dmoc.Problem(
        box(), start=STANDING, goal={"x": 1, "x_dot": 0}, contacts=["left", "right"],
        sequence=["left:slip+ right:slip+", "left:stick right:stick"], parameters={"mu": 0.2},
        bounds={"w": (0, 0)}, steps=steps, final_time=5,
    )  # fmt: skip


PUSHED = 2 / 3 * sqrt(6 * MASS * (0.2 * MASS * GRAVITY) ** 3)
