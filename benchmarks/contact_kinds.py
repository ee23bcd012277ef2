"""The kinds of the campaign with contacts that last and friction: each draws an instance, a
description in SymPy's terms and the fields of a problem."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from math import radians
from typing import Any

import numpy as np
import sympy as sp
from campaign_kinds import Draw, G, Instance, T, drawn, instance, uniform
from equations import Description
from sympy.physics.mechanics import dynamicsymbols

X, Y, U = dynamicsymbols("x y u")
M, MU, GRAVITY = sp.symbols("m mu g")


def point(angle: Any, length: Any) -> sp.Matrix:
    """The lower end of a link that hangs from the origin."""
    return length * sp.Matrix([sp.sin(angle), -sp.cos(angle)])


def kinetic(mass: Any, place: sp.Matrix) -> Any:
    return mass * place.diff(T).dot(place.diff(T)) / 2


@cache
def block_on(speed: bool) -> Description:
    """A block on a floor, which is a belt where it has a speed."""
    belt = sp.Symbol("belt")
    along = X - belt * T if speed else X
    return Description(
        "belt" if speed else "floor", [X, Y], [U], kinetic(M, sp.Matrix([X, Y])) - M * GRAVITY * Y,
        {X: U}, {"floor": Y >= 0}, {M: 1.0, GRAVITY: G, MU: 0.2} | ({belt: 1.0} if speed else {}),
        {"floor": along}, {"floor": MU},
    )  # fmt: skip


def pushed(rng: Draw) -> Instance:
    """A block sticks, slides to a place and sticks, or slides all the way."""
    mu, time = uniform(rng, 0.05, 0.4), uniform(rng, 1.0, 4.0)
    waits = bool(rng.integers(2))
    return instance(
        block_on(False), start={"x": 0.0, "y": 0.0},
        goal={"x": uniform(rng, 0.3, 2.0), "x_dot": 0.0},
        contacts=["floor"] if waits else ["floor:slip+"],
        sequence=["floor:slip+", "floor:stick"] if waits else [], final_time=time,
        parameters={"m": uniform(rng, 0.5, 3.0), "mu": mu},
    )  # fmt: skip


def belts(rng: Draw) -> Instance:
    """A block that rests is taken along by a belt, and rides on it."""
    speed = uniform(rng, 0.5, 1.5)
    return instance(
        block_on(True), start={"x": 0.0, "y": 0.0},
        goal={"x": uniform(rng, 0.5, 2.0), "x_dot": speed}, contacts=["floor:slip-"],
        sequence=["floor:stick"], final_time=uniform(rng, 1.5, 3.0),
        parameters={"m": uniform(rng, 0.5, 3.0), "mu": uniform(rng, 0.1, 0.5), "belt": speed},
    )  # fmt: skip


@cache
def two_blocks() -> Description:
    """A block on a carriage, which is pushed."""
    low, high = dynamicsymbols("low high")
    m_low, m_high, grip = sp.symbols("m_low m_high grip")
    return Description(
        "stacked", [low, high], [U], (m_low * low.diff(T) ** 2 + m_high * high.diff(T) ** 2) / 2,
        {low: U}, {}, {m_low: 2.0, m_high: 1.0, grip: 1.0}, {"top": high - low}, {"top": grip},
    )  # fmt: skip


def stacked(rng: Draw) -> Instance:
    """The upper block slides back and rides on, or rides all the way."""
    words = [["top"], ["top:slip-", "top:stick"], ["top:slip-", "top:slip+", "top:stick"]]
    first, *rest = words[int(rng.integers(3))]
    goal = {"low": uniform(rng, 0.5, 1.5), "low_dot": 0.0, "high_dot": 0.0}
    return instance(
        two_blocks(), start={"low": 0.0, "high": 0.0}, goal=goal, contacts=[first], sequence=rest,
        final_time=uniform(rng, 0.8, 2.0), parameters=drawn(rng, grip=(0.5, 2.0), m_low=(1.0, 3.0)),
    )  # fmt: skip


@cache
def leaning_rod() -> Description:
    """A rod that leans at a smooth wall, its foot on a floor with friction; a force pulls at the
    foot."""
    a = dynamicsymbols("a")
    half, inertia = sp.symbols("half inertia")
    along = sp.Matrix([sp.sin(a), -sp.cos(a)]) * half
    foot, top = sp.Matrix([X, Y]) + along, sp.Matrix([X, Y]) - along
    energy = kinetic(M, sp.Matrix([X, Y])) + inertia * a.diff(T) ** 2 / 2
    return Description(
        "ladder", [X, Y, a], [U], energy - M * GRAVITY * Y,
        {q: U * foot[0].diff(q) for q in (X, Y, a)}, {"wall": top[0] >= 0, "floor": foot[1] >= 0},
        {M: 1.0, half: 0.5, inertia: 1 / 12, GRAVITY: G, MU: 0.2}, {"floor": foot[0]},
        {"floor": MU},
    )  # fmt: skip


def ladders(rng: Draw) -> Instance:
    """The foot is pulled out, or pushed in, from rest to rest; both ends stay."""
    start, goal = uniform(rng, 0.2, 0.8), uniform(rng, 0.2, 0.8)
    goal = start + 0.15 if abs(goal - start) < 0.15 else goal
    way = "+" if goal > start else "-"
    return instance(
        leaning_rod(), start={"a": start, "x": 0.5 * np.sin(start), "y": 0.5 * np.cos(start)},
        goal={"a": goal, "a_dot": 0.0}, contacts=["wall", f"floor:slip{way}"], sequence=[],
        final_time=uniform(rng, 0.6, 1.2), parameters={"mu": uniform(rng, 0.05, 0.3)},
    )  # fmt: skip


@cache
def leg() -> Description:
    z, f = dynamicsymbols("z f")
    foot, k, rest = sp.symbols("foot k rest")
    energy = (M * z.diff(T) ** 2 + foot * f.diff(T) ** 2) / 2
    potential = GRAVITY * (M * z + foot * f) + k * (z - f - rest) ** 2 / 2
    return Description(
        "leg", [z, f], [U], energy - potential, {z: U, f: -U}, {"floor": f >= 0},
        {M: 3.0, foot: 0.3, k: 300.0, rest: 0.6, GRAVITY: G},
    )  # fmt: skip


def hoppers(rng: Draw) -> Instance:
    """Stands, flies for a given time, stands."""
    mass, k = uniform(rng, 2.0, 4.0), uniform(rng, 200.0, 500.0)
    standing, flight = 0.6 - mass * G / k, uniform(rng, 0.2, 0.4)
    return instance(
        leg(), start={"z": standing, "f": 0.0}, goal={"z": standing, "z_dot": 0.0, "f_dot": 0.0},
        contacts=["floor"], sequence=["-floor", "+floor"], final_time=(0.5, 3.0),
        durations=[None, (flight, flight), None], bounds={"z": (0.2, 2.0)},
        parameters={"m": mass, "k": k, "foot": uniform(rng, 0.2, 0.5)},
    )  # fmt: skip


@cache
def ball() -> Description:
    a = dynamicsymbols("a")
    r, share = sp.symbols("r share")
    energy = kinetic(M, sp.Matrix([X, Y])) + M * share * r**2 * a.diff(T) ** 2 / 2
    return Description(
        "spinning_ball", [X, Y, a], [U], energy - M * GRAVITY * Y, {a: U}, {"floor": Y - r >= 0},
        {M: 1.0, r: 0.1, share: 0.4, GRAVITY: G, MU: 0.3}, {"floor": X + r * a}, {"floor": MU},
    )  # fmt: skip


def balls(rng: Draw) -> Instance:
    """A thrown ball whose spin makes it come to a place after it has bounced."""
    return instance(
        ball(),
        start={"x": 0.0, "y": uniform(rng, 0.6, 1.2), "a": 0.0, "x_dot": uniform(rng, 0.2, 1)},
        goal={"x": uniform(rng, 0.2, 0.9), "y": (0.2, None)}, sequence=["floor"],
        restitution=float(rng.choice([0.9, 0.7, 0.5])), final_time=(0.5, 1.0),
        parameters={"mu": uniform(rng, 0.1, 0.6)},
    )  # fmt: skip


@cache
def bar() -> Description:
    a = dynamicsymbols("a")
    half, inertia = sp.symbols("half inertia")
    end = sp.Matrix([X, Y]) - half * sp.Matrix([sp.cos(a), sp.sin(a)])
    energy = kinetic(M, sp.Matrix([X, Y])) + inertia * a.diff(T) ** 2 / 2
    return Description(
        "thrown_rod", [X, Y, a], [U], energy - M * GRAVITY * Y, {a: U}, {"floor": end[1] >= 0},
        {M: 1.0, half: 0.5, inertia: 1 / 12, GRAVITY: G, MU: 0.3}, {"floor": end[0]}, {"floor": MU},
    )  # fmt: skip


def bars(rng: Draw) -> Instance:
    """A rod falls on one end and is to have another angle after it."""
    angle = uniform(rng, 0.5, 1.2)
    return instance(
        bar(),
        start={"x": 0.0, "y": uniform(rng, 0.8, 1.2), "a": angle, "x_dot": uniform(rng, -0.5, 0.5)},
        goal={"a": angle + uniform(rng, -0.6, 0.2)}, sequence=["floor"],
        restitution=float(rng.choice([0.8, 0.5, 0.2])), final_time=(0.4, 0.9),
        parameters={"mu": uniform(rng, 0.1, 0.6)},
    )  # fmt: skip


@cache
def cart_pole() -> Description:
    a = dynamicsymbols("a")
    pole, length, drag = sp.symbols("pole length drag")
    tip = sp.Matrix([X, 0]) + point(a, length)
    energy = M * X.diff(T) ** 2 / 2 + kinetic(pole, tip)
    return Description(
        "cart_pole_on_a_rail", [X, a], [U], energy - pole * GRAVITY * tip[1], {X: U}, {},
        {M: 1.0, pole: 0.1, length: 1.0, GRAVITY: G, drag: 1.0}, {"rail": X}, {"rail": drag},
    )  # fmt: skip


def cart_poles(rng: Draw) -> Instance:
    """A cart with a hanging load is brought to a place, where both are at rest."""
    words = [["rail:slip+"], ["rail:slip+", "rail:slip-"], ["rail", "rail:slip+", "rail:stick"]]
    first, *rest = words[int(rng.integers(3))]
    return instance(
        cart_pole(), start={"x": 0.0, "a": 0.0},
        goal={"x": uniform(rng, 0.5, 1.5), "a": 0.0, "x_dot": 0.0, "a_dot": 0.0}, contacts=[first],
        sequence=rest, final_time=uniform(rng, 1.5, 3.0),
        parameters=drawn(rng, drag=(0.3, 2.0), pole=(0.1, 0.5)),
    )  # fmt: skip


def exchanged(pairs: dict[str, str], step: Any) -> dict[str, Any]:
    """Periodic states of a gait whose legs are exchanged."""
    rates = {f"{a}_dot": f"{b}_dot" for a, b in ({"x": "x"} | pairs).items()}
    return {"x": ("x", step)} | pairs | rates


@cache
def compass() -> Description:
    a, b = dynamicsymbols("a b")
    hip_mass, length, slope = sp.symbols("hip_mass length slope")
    hip = sp.Matrix([X, Y])
    gravity = GRAVITY * sp.Matrix([sp.sin(slope), -sp.cos(slope)])
    bodies = ((hip_mass, hip), (M, hip + point(a, length / 2)), (M, hip + point(b, length / 2)))
    lagrangian = sum(kinetic(mass, place) + mass * gravity.dot(place) for mass, place in bodies)
    left, right = hip + point(a, length), hip + point(b, length)
    return Description(
        "compass", [X, Y, a, b], [], lagrangian, {}, {"left": left[1] >= 0, "right": right[1] >= 0},
        {M: 5.0, hip_mass: 10.0, length: 1.0, GRAVITY: G, slope: radians(3), MU: 1.0},
        {"left": left[0], "right": right[0]}, {"left": MU, "right": MU},
    )  # fmt: skip


def compasses(rng: Draw) -> Instance:
    """The passive gait down a slope."""
    return instance(
        compass(), start={"x": 0.0, "a": 0.0}, goal={}, contacts=["left"],
        sequence=["+right -left"], via=[{"a": (-0.5, -0.05)}], ignored=["left", "right"],
        periodic=exchanged({"y": "y", "a": "b", "b": "a"}, None), final_time=(0.65, 0.9),
        durations=[(0.05, None)] * 2,
        parameters={"slope": radians(uniform(rng, 2.0, 4.0)), "hip_mass": uniform(rng, 8.0, 12.0)},
    )  # fmt: skip


@cache
def five_links() -> Description:
    names = "x y torso thigh_l shin_l thigh_r shin_r"
    q, u = dynamicsymbols(names), dynamicsymbols("hip_l knee_l hip_r knee_r")
    x, y, torso, thigh_l, shin_l, thigh_r, shin_r = q
    hip, feet = sp.Matrix([x, y]), {}
    bodies = [(20.0, 2.22, hip - point(torso, 0.2), torso)]
    for name, thigh, shin in (("left", thigh_l, shin_l), ("right", thigh_r, shin_r)):
        knee = hip + point(thigh, 0.4)
        bodies.append((6.8, 1.08, hip + point(thigh, 0.163), thigh))
        bodies.append((3.2, 0.93, knee + point(shin, 0.128), shin))
        feet[name] = knee + point(shin, 0.4)
    lagrangian = sum(
        kinetic(m, place) - m * GRAVITY * place[1] + inertia * angle.diff(T) ** 2 / 2
        for m, inertia, place, angle in bodies
    )
    hip_l, knee_l, hip_r, knee_r = u
    torques = (-hip_l - hip_r, hip_l - knee_l, knee_l, hip_r - knee_r, knee_r)
    return Description(
        "five_links", q, u, lagrangian, dict(zip(q[2:], torques, strict=True)),
        {name: foot[1] >= 0 for name, foot in feet.items()}, {GRAVITY: G, MU: 0.7},
        {name: foot[0] for name, foot in feet.items()}, dict.fromkeys(feet, MU),
        {"knee_left": thigh_l >= shin_l, "knee_right": thigh_r >= shin_r},
    )  # fmt: skip


def walkers(rng: Draw) -> Instance:
    """A step of a walker with five links."""
    pairs = {"thigh_l": "thigh_r", "shin_l": "shin_r", "thigh_r": "thigh_l", "shin_r": "shin_l"}
    time = uniform(rng, 0.6, 0.9)
    return instance(
        five_links(), start={"x": 0.0}, goal={}, contacts=["left"], sequence=["+right -left"],
        periodic=exchanged({"y": "y", "torso": "torso"} | pairs, uniform(rng, 0.35, 0.55)),
        durations=[(time / 2, time / 2)] * 2,
        bounds={"torso": (-0.6, 0.6)} | dict.fromkeys(pairs, (-1.8, 1.2)),
        parameters={"mu": uniform(rng, 0.5, 0.9)},
    )  # fmt: skip


KINDS: dict[str, Callable[[Draw], Instance]] = {
    "pushed": pushed, "belt": belts, "stacked": stacked, "ladder": ladders, "hopper": hoppers,
    "spinning ball": balls, "rod": bars, "cart-pole on a rail": cart_poles, "compass": compasses,
    "five links": walkers,
}  # fmt: skip
