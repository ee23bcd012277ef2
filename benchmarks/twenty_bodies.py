"""Problems of a leg, a box and bodies that are struck for `twenty.py`: a landing; a box pushed,
tipped over, or thrown; a block struck against a wall; a swing-up off a stop; a ball on a paddle."""

from __future__ import annotations

from math import pi

import stance_hopper
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc

X, Y, S, A, U, W = dynamicsymbols("x y s a u w")
M, G, MU = sp.symbols("m g mu")
T = dynamicsymbols._t
FALL = 9.81


def rest(**place: float) -> dict[str, float]:
    """A place at which everything is at rest."""
    return place | {f"{name}_dot": 0.0 for name in place}


def landing() -> dmoc.Problem:
    """The hopper with a foot of its own falls 0.4 m and comes to rest standing."""
    stated = stance_hopper.problem(30)
    standing = stated.start["z"]
    return dmoc.Problem(
        stated.kernels, start={"z": 1.0, "f": 0.4}, goal=rest(z=float(standing), f=0.0), steps=30,
        final_time=(0.3, 1.0), restitution=0.0,
    )  # fmt: skip


CORNERS = {"bl": (-1, -1), "br": (1, -1), "tr": (1, 1)}
KINDS = {  # half of its side, corners that may touch, height of the push, whether it lifts
    "pushed": (0.5, ("bl", "br"), 0, False),
    "tipped": (0.5, ("bl", "br", "tr"), 1, False),
    "thrown": (0.2, ("bl", "br"), 0, True),
}
STEP = 0.3  # that the thrown box goes up to, at 1 m


def box_system(kind: str) -> dmoc.MechanicalSystem:
    """A square box on a rough floor, pushed at its left side."""
    half, names, height, lifted = KINDS[kind]
    turn = sp.Matrix([[sp.cos(A), -sp.sin(A)], [sp.sin(A), sp.cos(A)]])

    def at(x: float, y: float) -> sp.Matrix:
        return sp.Matrix([X, Y]) + half * turn * sp.Matrix([x, y])

    points = {name: at(*CORNERS[name]) for name in names}
    pushed = at(-1, height)
    inputs = [U, W] if lifted else [U]
    forces = {
        q: sum(u * place.diff(q) for u, place in zip(inputs, pushed, strict=False))
        for q in (X, Y, A)
    }  # fmt: skip
    floor = {
        name: STEP * (1 + sp.tanh(20 * (p[0] - 1))) / 2 if kind == "thrown" else sp.S.Zero
        for name, p in points.items()
    }
    inertia = 2 * M * half**2 / 3
    return dmoc.MechanicalSystem(
        f"box_{kind}", [X, Y, A],
        (M * (X.diff(T) ** 2 + Y.diff(T) ** 2) + inertia * A.diff(T) ** 2) / 2 - M * G * Y,
        {M: 1.0, G: FALL, MU: 0.5}, inputs=inputs,
        forces={q: force for q, force in forces.items() if force != 0},
        surfaces={name: p[1] - floor[name] >= 0 for name, p in points.items()},
        tangents={name: p[0] for name, p in points.items()}, friction=dict.fromkeys(points, MU),
        cost=sum(u**2 for u in inputs),
    )  # fmt: skip


def _box(kind: str, **fields: object) -> dmoc.Problem:
    start = rest(x=0, y=KINDS[kind][0], a=0)
    stated = {"start": start, "contacts": ["bl", "br"], "steps": 20, "restitution": 0.0}
    return dmoc.Problem(box_system(kind), **stated | fields)


def box_pushed() -> dmoc.Problem:
    """By a metre in 1.5 s."""
    return _box("pushed", goal=rest(x=1, y=0.5, a=0), final_time=1.5, bounds={"u": (-40, 40)})


def box_tipped() -> dmoc.Problem:
    """On its right side, by a force at its top."""
    return _box(
        "tipped", goal=rest(y=0.5, a=-pi / 2), final_time=(0.3, 2.5),
        bounds={"u": (-40, 40), "a": (-2, 0.5)},
    )  # fmt: skip


def box_thrown() -> dmoc.Problem:
    """Up a step, on which it comes to rest."""
    return _box(
        "thrown", goal=rest(x=1.6, y=0.5, a=0), final_time=(0.5, 2.5),
        bounds={"u": (-60, 60), "w": (-60, 60)},
    )  # fmt: skip


def bank_system() -> dmoc.MechanicalSystem:
    """A driven cart beside a block, which a wall sends back."""
    return dmoc.MechanicalSystem(
        "bank_shot", [X, S], (X.diff(T) ** 2 + S.diff(T) ** 2) / 2, inputs=[U], forces={X: U},
        surfaces={"bumper": X <= S, "wall": S <= 1}, cost=U**2,
    )  # fmt: skip


def bank_shot() -> dmoc.Problem:
    """The block comes back from the wall with 1 m/s."""
    return dmoc.Problem(
        bank_system(), start=rest(x=0, s=0.5), goal={"x": -0.3, "s": 0.2, "s_dot": -1.0},
        steps=30, final_time=2.0, restitution=0.9, bounds={"u": (-20, 20)},
    )  # fmt: skip


def stop_system() -> dmoc.MechanicalSystem:
    """A pendulum whose motor cannot lift it, with a stop on one side."""
    return dmoc.MechanicalSystem(
        "stopped_swing_up", [A], A.diff(T) ** 2 / 2 + G * sp.cos(A), {G: FALL}, inputs=[U],
        forces={A: U}, surfaces={"stop": A >= -0.6}, cost=U**2,
    )  # fmt: skip


def stopped_swing_up() -> dmoc.Problem:
    """From hanging to upright in at most 4 s."""
    return dmoc.Problem(
        stop_system(), start=rest(a=0), goal=rest(a=pi), steps=30, final_time=(0.5, 4),
        restitution=0.9, bounds={"u": (-5, 5)},
    )  # fmt: skip


def paddle_system() -> dmoc.MechanicalSystem:
    """A driven paddle under a ball."""
    kinetic = (X.diff(T) ** 2 + M * S.diff(T) ** 2) / 2
    return dmoc.MechanicalSystem(
        "paddle", [X, S], kinetic - M * G * S, {M: 0.2, G: FALL}, inputs=[U], forces={X: U},
        surfaces={"ball": X <= S}, cost=U**2,
    )  # fmt: skip


def paddled() -> dmoc.Problem:
    """The ball goes from rest at 0.5 m to rest at 1 m in 1.6 s."""
    return dmoc.Problem(
        paddle_system(), start=rest(x=0, s=0.5), goal=rest(x=0, s=1.0), steps=30, final_time=1.6,
        restitution=0.8, bounds={"u": (-40, 40), "x": (-0.3, 0.3)},
    )  # fmt: skip
