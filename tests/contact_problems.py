"""Problems with contacts that last and friction, whose answers are known."""

from __future__ import annotations

from dataclasses import replace
from math import pi, sin, sqrt

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols
from systems import block_on_floor

import dmoc

X, Y, U = dynamicsymbols("x y u")
M, F, G, MU = sp.symbols("m f g mu")
T = dynamicsymbols._t


def rail(cost: object, wall: bool = False, name: str = "railed") -> dmoc.MechanicalSystem:
    """A block on a rail with dry friction, and a wall at 1."""
    return dmoc.MechanicalSystem(
        name, [X], M * X.diff(T) ** 2 / 2, {M: 1.0, F: 1.0}, inputs=[U], forces={X: U}, cost=cost,
        tangents={"rail": X}, friction={"rail": F}, surfaces={"wall": X <= 1} if wall else {},
    )  # fmt: skip


def floor(name: str = "floored") -> dmoc.MechanicalSystem:
    return block_on_floor(name, 2.0, 5.0, 0.1)


def pushed(steps: int) -> dmoc.Problem:
    return dmoc.Problem(
        rail(U**2 / 2), start={"x": 0}, goal={"x": 1, "x_dot": 0},
        sequence=["rail:slip+", "rail:stick"], steps=steps, final_time=4,
    )  # fmt: skip


def against_wall(steps: int, e: float) -> dmoc.Problem:
    return dmoc.Problem(
        rail(U**2 / 2, wall=True, name="railed_wall"), start={"x": 0}, goal={"x": 0, "x_dot": 0},
        contacts=["rail:slip+"], sequence=["wall rail:slip-"], restitution=e, steps=steps,
        final_time=1,
    )  # fmt: skip


def against_wall_on_floor(steps: int, slope: float) -> dmoc.Problem:
    """The same on a floor that rubs with the same force; the wall leans by a slope, so that the hit
    presses the block down."""
    lean = sp.Symbol("lean")
    block = replace(
        floor("floored_wall"),
        parameters={M: 1.0, G: 5.0, MU: 0.2, lean: slope},
        surfaces={"floor": Y >= 0, "wall": X + lean * Y <= 1},
    )
    return dmoc.Problem(
        block, start={"x": 0, "y": 0}, goal={"x": 0, "x_dot": 0}, contacts=["floor:slip+"],
        sequence=["wall floor:slip-"], restitution=0.7, steps=steps, final_time=1,
    )  # fmt: skip


def there_and_back(steps: int) -> dmoc.Problem:
    return dmoc.Problem(
        rail(1, name="railed_time"), start={"x": 0}, goal={"x": 0, "x_dot": 0},
        contacts=["rail:slip+"], sequence=["rail:slip-"], via=[{"x": 10}],
        parameters={"f": 0.6 * 9.81}, bounds={"u": (-400, 400)}, controls="constant", steps=steps,
        final_time=(0.1, 2),
    )  # fmt: skip


def turned(steps: int) -> dmoc.Problem:
    return dmoc.Problem(
        rail(1, name="railed_time"), start={"x": 0, "x_dot": 1}, goal={"x": -1, "x_dot": 0},
        contacts=["rail:slip+"], sequence=["rail:slip-"], bounds={"u": (-2, 2)}, steps=steps,
        final_time=(0.1, 10),
    )  # fmt: skip


def two_masses(steps: int | None = None) -> dmoc.Problem:
    """Two masses on springs and rails with friction turn and go to their places in least time, the
    problem of Driessen and Sadegh (2000): one of them has time to spare."""
    a, b, w = dynamicsymbols("a b w")
    system = dmoc.MechanicalSystem(
        "two_masses", [a, b],
        0.55 * a.diff() ** 2 + 0.6 * b.diff() ** 2 - 0.475 * a**2 - 0.425 * (b - a) ** 2, {F: 1.0},
        inputs=[U, w], forces={a: U, b: w}, cost=sp.Integer(1), tangents={"first": a, "second": b},
        friction={"first": F, "second": F},
    )  # fmt: skip
    return dmoc.Problem(
        system, start={a: 0, b: 0, "a_dot": -1, "b_dot": -2},
        goal={a: 1, b: 2, "a_dot": 0, "b_dot": 0}, contacts=["first:slip-", "second:slip-"],
        sequence=["first:slip+", "second:slip+"], bounds={U: (-4, 4), w: (-4, 4)},
        final_time=(0.1, 10), steps=steps,
    )  # fmt: skip


PUSHED = 2 / 3 * sqrt(6)  # the slide lasts sqrt(6) of the 4 s
TURNED = 1 / 3 + 2 * sqrt(7) / 3
THERE_AND_BACK = 0.6325240163  # opty's gallery, at three events in closed form


def sliding(steps: int) -> dmoc.Problem:
    """Pushed by 1 m in 4 s, sliding all along: 6 d^2/T^3 + f^2 T/2 = 2.09375."""
    return pushed(steps).but(contacts=["rail:slip+"], sequence=[])


def wall_with_friction(e: float) -> float:
    """Least cost of `against_wall` with f = 1, over the time and the speed of the hit."""
    from scipy.optimize import minimize

    def cost(z: list[float]) -> float:
        a, w = z
        b, v = 1 - a, e * w
        return float(
            6 / a**3
            - 6 * w / a**2
            + 2 * w**2 / a
            + 6 / b**3
            - 6 * v / b**2
            + 2 * v**2 / b
            + w * (1 - e)
            + 0.5
        )

    starts = [[a, w] for a in (0.3, 0.5, 0.7) for w in (0.5, 1, 2, 4)]
    return float(min(minimize(cost, z, tol=1e-14).fun for z in starts))


def pushers(steps: int) -> dmoc.Problem:
    """A driven mass lands on one at rest and pushes it."""
    s = dynamicsymbols("s")
    system = dmoc.MechanicalSystem(
        "pushers", [X, s], (X.diff(T) ** 2 + 3 * s.diff(T) ** 2) / 2, {}, inputs=[U], forces={X: U},
        cost=U**2, surfaces={"pad": s >= X},
    )  # fmt: skip
    return dmoc.Problem(
        system, start={"x": 0, "s": 1, "x_dot": 2}, goal={"s": 2, "s_dot": 1}, sequence=["+pad"],
        steps=steps, final_time=(0.5, 4),
    )  # fmt: skip


def pushed_together() -> float:
    """Least cost of `pushers`: unit mass from 0 at speed 2 to 1 at speed w, then both masses, 4 in
    all, from 1 at w/4 to 2 at 1; each part is a cubic in time."""
    from scipy.optimize import minimize

    def effort(time: float, before: float, after: float) -> float:
        """int a^2 dt over a metre, least."""
        squares = before**2 + before * after + after**2
        return 12 / time**3 - 12 * (before + after) / time**2 + 4 * squares / time

    def cost(z: list[float]) -> float:
        return effort(z[0], 2, z[2]) + 16 * effort(z[1], z[2] / 4, 1)

    return float(minimize(cost, [0.5, 1.4, 2.0], tol=1e-14, options={"gtol": 1e-10}).fun)


HALF_ANGLE, SLOPE, INERTIA = pi / 8, 0.08, 0.1


def rimless(steps: int, order: int = 2) -> dmoc.Problem:
    """A rimless wheel of unit mass and radius rolls down a slope, from one spoke to the next."""
    x, y, c = dynamicsymbols("x y c")

    def foot(angle: object) -> sp.Matrix:
        return sp.Matrix([x + sp.sin(angle), y - sp.cos(angle)])

    this, following = foot(c), foot(c + 2 * HALF_ANGLE)
    system = dmoc.MechanicalSystem(
        "rimless",
        [x, y, c],
        (x.diff(T) ** 2 + y.diff(T) ** 2 + INERTIA * c.diff(T) ** 2) / 2
        + G * (sin(SLOPE) * x - sp.cos(SLOPE) * y),
        {MU: 2.0, G: 9.81},
        surfaces={"this": this[1] >= 0, "next": following[1] >= 0},
        tangents={"this": this[0], "next": following[0]},
        friction={"this": MU, "next": MU},
        cost=1,
    )
    return dmoc.Problem(
        dmoc.build(system, order=order), start={"x": 0, "c": 0}, contacts=["this"],
        sequence=["+next -this"],
        periodic={
            "x": ("x", None), "y": "y", "c": ("c", -2 * HALF_ANGLE), "x_dot": "x_dot",
            "y_dot": "y_dot", "c_dot": "c_dot",
        },
        steps=steps, final_time=(0.1, 2), durations=[(0.02, None)] * 2,
    )  # fmt: skip


def rimless_rate() -> float:
    """Rate of the wheel before a spoke lands: what a step loses is what it falls."""
    about = INERTIA + 1
    kept = (INERTIA + sp.cos(2 * HALF_ANGLE)) / about
    fall = 2 * sin(HALF_ANGLE) * sin(SLOPE)
    return float(sp.sqrt(2 * 9.81 * fall / (about * (1 - kept**2))))
