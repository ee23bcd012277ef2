"""The kinds of the campaign: each draws an instance, a description in SymPy's terms and the
fields of a problem."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
import sympy as sp
from equations import Description
from scipy.optimize import minimize
from sympy.physics.mechanics import dynamicsymbols

T = dynamicsymbols._t
G = 9.81
Draw = np.random.Generator


@dataclass(frozen=True)
class Instance:
    """A problem of the campaign; ``known_cost`` where its optimum is known."""

    description: Description
    problem: Mapping[str, Any]
    known_cost: float | None = None


def instance(description: Description, known_cost: float | None = None, **problem: Any) -> Instance:
    return Instance(description, problem, known_cost)


def restitution(rng: Draw) -> float:
    return float(rng.choice([1.0, 0.8, 0.5, 0.0]))


def uniform(rng: Draw, low: float, high: float) -> float:
    return float(rng.uniform(low, high))


def drawn(rng: Draw, **ranges: tuple[float, float]) -> dict[str, float]:
    """Values by name, each from its range."""
    return {name: uniform(rng, *limits) for name, limits in ranges.items()}


@cache
def arm(links: int) -> Description:
    """Point masses on massless links; relative angles, torques in the joints, gravity, a stop of
    the second joint."""
    angles = dynamicsymbols(f"a1:{links + 1}")
    torques = dynamicsymbols(f"u1:{links + 1}")
    m, l, g, stop = sp.symbols("m l g stop")
    tip, kinetic, potential, absolute = sp.Matrix([0, 0]), sp.S.Zero, sp.S.Zero, sp.S.Zero
    for a in angles:
        absolute = absolute + a
        tip = tip + l * sp.Matrix([sp.sin(absolute), -sp.cos(absolute)])
        kinetic += m * tip.diff(T).dot(tip.diff(T)) / 2
        potential += m * g * tip[1]
    return Description(
        f"arm_{links}", angles, torques, sp.expand(kinetic) - potential,
        dict(zip(angles, torques, strict=True)), {"stop": angles[1] <= stop},
        {m: 1.0, l: 0.5, g: G, stop: 1.0},
    )  # fmt: skip


def arms(rng: Draw) -> Instance:
    links = int(rng.choice([2, 3]))
    names = [f"a{i + 1}" for i in range(links)]
    stop = uniform(rng, 0.5, 1.5)
    start = {n: uniform(rng, -0.6, 0.6) for n in names} | {"a2": uniform(rng, -0.5, stop - 0.3)}
    goal = {n: uniform(rng, -1.5, 1.5) for n in names} | {"a2": uniform(rng, -0.5, stop - 0.2)}
    limit = uniform(rng, 20.0, 60.0) * (1 if links == 2 else 2)
    return instance(
        arm(links), start=start, goal=goal | {f"{n}_dot": 0.0 for n in names}, sequence=["stop"],
        final_time=uniform(rng, 0.8, 1.6),
        bounds={f"u{i + 1}": (-limit, limit) for i in range(links)}, restitution=restitution(rng),
        parameters={"m": uniform(rng, 0.5, 1.5), "l": uniform(rng, 0.3, 0.6), "stop": stop},
    )  # fmt: skip


@cache
def two_discs() -> Description:
    x1, y1, x2, y2, f_x, f_y = dynamicsymbols("x1 y1 x2 y2 f_x f_y")
    m1, m2, r = sp.symbols("m1 m2 r")
    kinetic = (
        m1 * (x1.diff(T) ** 2 + y1.diff(T) ** 2) / 2 + m2 * (x2.diff(T) ** 2 + y2.diff(T) ** 2) / 2
    )
    gap = sp.sqrt((x1 - x2) ** 2 + (y1 - y2) ** 2) >= 2 * r
    return Description(
        "discs", [x1, y1, x2, y2], [f_x, f_y], kinetic, {x1: f_x, y1: f_y}, {"contact": gap},
        {m1: 1.0, m2: 1.0, r: 0.2},
    )  # fmt: skip


def discs(rng: Draw) -> Instance:
    """The first disc, which is pushed, must bring the second one to the origin."""
    place = rng.uniform(-1.5, -0.7, 2)
    behind = place + rng.uniform(-1.2, -0.6, 2)
    start = dict(zip(("x1", "y1", "x2", "y2"), [*behind.tolist(), *place.tolist()], strict=True))
    return instance(
        two_discs(), start=start, goal={"x2": 0.0, "y2": 0.0}, sequence=["contact"],
        final_time=uniform(rng, 0.8, 2.0), bounds={"f_x": (-60.0, 60.0), "f_y": (-60.0, 60.0)},
        restitution=restitution(rng),
        parameters=drawn(rng, m1=(0.5, 2.0), m2=(0.5, 2.0), r=(0.1, 0.25)),
    )  # fmt: skip


@cache
def moving_block() -> Description:
    x, u = dynamicsymbols("x u")
    m, wall, swing, omega = sp.symbols("m wall swing omega")
    surface = x <= wall + swing * sp.sin(omega * T)
    return Description(
        "moving_wall", [x], [u], m * x.diff(T) ** 2 / 2, {x: u}, {"wall": surface},
        {m: 1.0, wall: 1.0, swing: 0.1, omega: 3.0},
    )  # fmt: skip


def moving_walls(rng: Draw) -> Instance:
    final = uniform(rng, 1.0, 2.0)
    return instance(
        moving_block(), start={"x": 0.0, "x_dot": uniform(rng, -0.5, 1.0)},
        goal={"x": uniform(rng, -0.5, 0.5), "x_dot": 0.0}, sequence=["wall"], final_time=final,
        restitution=restitution(rng), bounds={"u": (-80.0, 80.0)},
        parameters=drawn(rng, m=(0.5, 2.0), wall=(0.9, 1.5), swing=(0.0, 0.3), omega=(1.0, 8.0)),
    )  # fmt: skip


@cache
def rod() -> Description:
    x, y, th, f_x, f_y, tau = dynamicsymbols("x y th f_x f_y tau")
    m, J, l, g = sp.symbols("m J l g")
    kinetic = m * (x.diff(T) ** 2 + y.diff(T) ** 2) / 2 + J * th.diff(T) ** 2 / 2
    floor = {"left": y - l * sp.sin(th) >= 0, "right": y + l * sp.sin(th) >= 0}
    return Description(
        "rod", [x, y, th], [f_x, f_y, tau], kinetic - m * g * y, {x: f_x, y: f_y, th: tau}, floor,
        {m: 1.0, J: 0.05, l: 0.4, g: G},
    )  # fmt: skip


def rods(rng: Draw) -> Instance:
    """A thrown rod hits the floor with one end, or with both in turn, and ends at rest in the
    air."""
    sequence = [["left"], ["right"], ["left", "right"]][int(rng.integers(3))]
    return instance(
        rod(),
        start={
            "x": 0.0, "y": uniform(rng, 0.7, 1.2), "th": uniform(rng, -0.6, 0.6),
            "y_dot": uniform(rng, -2.0, 0.0),
        },
        goal={
            "x": uniform(rng, 0.0, 1.0), "y": uniform(rng, 0.6, 1.2), "th": uniform(rng, -0.5, 0.5),
            "x_dot": 0.0, "y_dot": 0.0, "th_dot": 0.0,
        },
        sequence=sequence, final_time=uniform(rng, 0.9, 1.5), restitution=restitution(rng),
        bounds={"f_x": (-60.0, 60.0), "f_y": (-60.0, 60.0), "tau": (-20.0, 20.0)},
        parameters=drawn(rng, m=(0.5, 2.0), J=(0.02, 0.1), l=(0.2, 0.5)),
    )  # fmt: skip


@cache
def hopper() -> Description:
    y, r, F = dynamicsymbols("y r F")
    M, m, k, r_0, g = sp.symbols("M m k r_0 g")
    foot = y - r
    kinetic = M * y.diff(T) ** 2 / 2 + m * foot.diff(T) ** 2 / 2
    potential = M * g * y + m * g * foot + k * (r - r_0) ** 2 / 2
    parameters = {M: 1.0, m: 0.3, k: 60.0, r_0: 0.5, g: G}
    return Description(
        "hop", [y, r], [F], kinetic - potential, {r: F}, {"ground": foot >= 0}, parameters
    )


def hoppers(rng: Draw) -> Instance:
    """A body on a springy leg falls, hits the ground, and must reach a height with the leg at
    rest."""
    height = uniform(rng, 0.7, 1.0)
    return instance(
        hopper(), start={"y": height, "r": 0.5},
        goal={"y": height + uniform(rng, -0.1, 0.1), "y_dot": 0.0}, sequence=["ground"],
        final_time=(0.4, 1.2), restitution=restitution(rng),
        bounds={"F": (-150.0, 150.0), "r": (0.25, 0.75)},
        parameters=drawn(rng, M=(0.8, 1.5), m=(0.2, 0.6), k=(30.0, 120.0)),
    )  # fmt: skip


@cache
def block() -> Description:
    x, u = dynamicsymbols("x u")
    m, wall = sp.symbols("m wall")
    return Description(
        "wall_mm", [x], [u], m * x.diff(T) ** 2 / 2, {x: u}, {"wall": x <= wall},
        {m: 1.0, wall: 1000.0},
    )  # fmt: skip


def block_cost(mass: float, wall: float, goal: float, final: float, e: float) -> float:
    """Least int u^2 / 2 from rest at 0 through one hit to rest at the goal: the best time of the
    hit and speed at it."""

    def half(d: float, v: float, w: float, t: float) -> float:
        return 6 * d * d / t**3 - 6 * d * (v + w) / t**2 + 2 * (v * v + v * w + w * w) / t

    def cost(z: np.ndarray) -> float:
        share, speed = z
        if not (0 < share < 1 and speed >= 0):
            return np.inf
        v, t = speed * wall / final, share * final
        return half(wall, 0.0, v, t) + half(goal - wall, -e * v, 0.0, final - t)

    starts = [(s, v) for s in (0.2, 0.4, 0.6, 0.8) for v in (0.5, 2.0, 5.0)]
    tight = {"xatol": 1e-10, "fatol": 1e-14 * cost(np.array([0.5, 2.0])), "maxiter": 2000}
    return mass**2 * min(
        float(minimize(cost, s, method="Nelder-Mead", options=tight).fun) for s in starts
    )


def walls_in_mm(rng: Draw) -> Instance:
    """A block in kg, mm and s, without limits: its optimum is known."""
    mass, wall, final, e = (
        uniform(rng, 0.2, 5.0),
        uniform(rng, 300.0, 3000.0),
        uniform(rng, 0.5, 3.0),
        restitution(rng),
    )
    goal = uniform(rng, -0.3, 0.3) * wall
    return instance(
        block(), known_cost=block_cost(mass, wall, goal, final, e), start={"x": 0.0},
        goal={"x": goal, "x_dot": 0.0}, sequence=["wall"], final_time=final, restitution=e,
        parameters={"m": mass, "wall": wall},
    )  # fmt: skip


@cache
def cart() -> Description:
    alpha, x, F = dynamicsymbols("alpha x F")
    m_p, m_c, l, g, low, high = sp.symbols("m_p m_c l g low high")
    place = sp.Matrix([x + l * sp.cos(alpha), l * sp.sin(alpha)])
    kinetic = m_c * x.diff(T) ** 2 / 2 + m_p * place.diff(T).dot(place.diff(T)) / 2
    parameters = {m_p: 1.0, m_c: 1.0, l: 0.5, g: 10.0, low: np.pi / 10, high: 9 * np.pi / 10}
    stops = {"left": alpha >= low, "right": alpha <= high}
    return Description(
        "cart", [alpha, x], [F], sp.expand(kinetic) - m_p * g * place[1], {x: F}, stops, parameters
    )


def cart_pendulums(rng: Draw) -> Instance:
    force = uniform(rng, 60.0, 200.0)
    return instance(
        cart(), start={"alpha": uniform(rng, 0.4, 1.2), "x": 0.0},
        goal={"alpha": np.pi / 2, "alpha_dot": 0.0, "x": uniform(rng, -0.5, 0.5), "x_dot": 0.0},
        sequence=[str(rng.choice(["left", "right"]))], final_time=(None, uniform(rng, 0.7, 1.2)),
        bounds={"F": (-force, force)}, restitution=restitution(rng),
        parameters=drawn(rng, m_p=(0.5, 2.0), m_c=(0.5, 2.0), l=(0.4, 0.8)),
    )  # fmt: skip


@cache
def pendulum() -> Description:
    a, u = dynamicsymbols("a u")
    m, l, g, reach = sp.symbols("m l g reach")
    lagrangian = m * l**2 * a.diff(T) ** 2 / 2 + m * g * l * sp.cos(a)
    return Description(
        "curved", [a], [u], lagrangian, {a: u}, {"wall": sp.sin(a) <= reach},
        {m: 1.0, l: 1.0, g: G, reach: 0.5},
    )  # fmt: skip


def curved_walls(rng: Draw) -> Instance:
    """A pendulum against a wall that is a function of its angle; goals beyond the point where
    its gradient vanishes."""
    reach = uniform(rng, 0.3, 0.9)
    return instance(
        pendulum(), start={"a": 0.0}, goal={"a": uniform(rng, -np.pi, 0.2), "a_dot": 0.0},
        sequence=["wall"], final_time=uniform(rng, 1.5, 3.5), restitution=restitution(rng),
        bounds={"u": (-40.0, 40.0)},
        parameters={"m": uniform(rng, 0.5, 2.0), "l": uniform(rng, 0.5, 1.2), "reach": reach},
    )  # fmt: skip


@cache
def chain() -> Description:
    masses = dynamicsymbols("x1:4")
    u = dynamicsymbols("u")
    m, k, wall = sp.symbols("m k wall")
    kinetic = m * sum(x.diff(T) ** 2 for x in masses) / 2
    springs = k * sum((b - a) ** 2 for a, b in pairwise(masses)) / 2
    return Description(
        "chain", masses, [u], kinetic - springs, {masses[0]: u}, {"wall": masses[-1] <= wall},
        {m: 1.0, k: 20.0, wall: 0.5},
    )  # fmt: skip


def chains(rng: Draw) -> Instance:
    """Displacements of three masses in a row, the first one pushed, the last one in front of a
    wall."""
    names = ("x1", "x2", "x3")
    goal = uniform(rng, -0.3, 0.2)
    return instance(
        chain(), start=dict.fromkeys(names, 0.0),
        goal=dict.fromkeys(names, goal) | {f"{n}_dot": 0.0 for n in names}, sequence=["wall"],
        final_time=uniform(rng, 2.0, 4.0), restitution=restitution(rng),
        bounds={"u": (-60.0, 60.0)},
        parameters=drawn(rng, m=(0.5, 1.5), k=(10.0, 60.0), wall=(0.3, 0.8)),
    )  # fmt: skip


KINDS: Mapping[str, Callable[[Draw], Instance]] = {
    "arms": arms, "discs": discs, "moving walls": moving_walls, "rods": rods, "hoppers": hoppers,
    "walls in mm": walls_in_mm, "cart-pendulums": cart_pendulums, "curved walls": curved_walls,
    "chains": chains,
}  # fmt: skip
