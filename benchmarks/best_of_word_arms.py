"""Arms of two and three links with one fixed sequence each: hits of the tip on a wall or a floor,
bounds of torque and of power, goals of the tip and of the angles, given and free final times."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache
from math import cos, pi, sin
from typing import Any

import sympy as sp
from ladder_smooth import GRAVITY, Statement, stated, t
from sympy.physics.mechanics import dynamicsymbols

NAMES = "abc"
MASS, LENGTH = sp.symbols("m l")
SWINGING = (0.5, 4.0)  # final times, where one is free


@cache
def hanging_links(links: int) -> tuple[sp.ImmutableMatrix, sp.Expr]:
    """The place of the tip and the Lagrangian of an arm that hangs: the speeds of a mass are those
    of the links before it, whose products have the cosine of the angle between them."""
    place, turned, lagrangian = sp.Matrix([0, 0]), list[sp.Expr](), sp.S.Zero
    for angle in map(dynamicsymbols, NAMES[:links]):
        turned.append(sum(turned[-1:], angle))
        place += LENGTH * sp.Matrix([sp.sin(turned[-1]), -sp.cos(turned[-1])])
        square = sum(a.diff(t) * b.diff(t) * sp.cos(a - b) for a in turned for b in turned)
        lagrangian += MASS * (LENGTH**2 * square / 2 - GRAVITY * place[1])
    return place.as_immutable(), lagrangian


@cache
def arm(
    links: int, driven: str, obstacle: str = "", limited: bool = False, hurried: bool = False
) -> Statement:
    """A hanging arm of massless links with a point mass at the end of each.

    Angles are relative to the link before, the first one to the plumb line.  The joints that are
    ``driven`` have torques; ``obstacle`` is a wall or a floor that the tip may not pass.  Where it
    is ``limited``, path constraints hold the power of each motor below P; where it is ``hurried``,
    its cost is the time.
    """
    angles = {name: dynamicsymbols(name) for name in NAMES[:links]}
    torques = {name: dynamicsymbols(f"u_{name}") for name in driven}
    reach, P = sp.symbols("reach P")
    place, lagrangian = hanging_links(links)
    surfaces = {"wall": place[0] <= reach, "floor": place[1] >= -reach}
    powers = {name: u * angles[name].diff(t) for name, u in torques.items()} if limited else {}
    traits = [obstacle, "power" * limited, "time" * hurried]
    return stated(
        "_".join([f"arm_{links}_{driven}", *filter(None, traits)]),
        list(angles.values()), list(torques.values()), lagrangian,
        {angles[name]: u for name, u in torques.items()},
        surfaces={obstacle: surfaces[obstacle]} if obstacle else {},
        path_constraints={f"power_{name}": (p >= -P) & (p <= P) for name, p in powers.items()},
        quantities={"tip_x": place[0], "tip_y": place[1]},
        parameters={MASS: 1.0, LENGTH: 1.0} | ({reach: 1.0} if obstacle else {})
        | ({P: 10.0} if limited else {}),
        cost=1 if hurried else sum(u**2 for u in torques.values()),
    )  # fmt: skip


def moved(
    model: Statement, start: tuple[float, ...], goal: tuple[float, ...] | Mapping[str, float],
    **data: Any,
) -> Statement:  # fmt: skip
    """An arm that goes from rest in angles to rest in others, or at a place of the tip."""
    names = NAMES[: len(start)]
    end = goal if isinstance(goal, Mapping) else dict(zip(names, goal, strict=True))
    rest = {f"{name}_dot": 0.0 for name in names}
    stated_ends = {"start": dict(zip(names, start, strict=True)), "goal": {**end, **rest}}
    return Statement(model.system, {**model.data, "steps": None, **stated_ends, **data})


def acrobot(goal: tuple[float, float], e: float, hits: int = 1, **data: Any) -> Statement:
    """Two links, driven at the elbow alone, hang at rest; the tip bounces off a vertical wall."""
    return moved(
        arm(2, "b", "wall"), (0.0, 0.0), goal, sequence=["wall"] * hits, restitution=e,
        **{"final_time": SWINGING, "parameters": {"reach": 0.8}, **data},
    )  # fmt: skip


def nearly_straight(bend: float, **data: Any) -> Statement:
    """The tip of an arm of two driven links goes to a place that it reaches nearly straight."""
    a, b = 1.1, bend
    tip = {"tip_x": sin(a) + sin(a + b), "tip_y": -cos(a) - cos(a + b)}
    hits = "sequence" in data
    return moved(arm(2, "ab", "wall" if hits else ""), (-0.4, 0.5), tip, **data)


def limits(driven: str, torque: float) -> dict[str, tuple[float, float]]:
    return {f"u_{name}": (-torque, torque) for name in driven}


# Each arm's name and statement.
ARMS: Mapping[str, Callable[[], Statement]] = {
    "acrobot": lambda: acrobot((-pi, 0.0), 1.0),
    "acrobot, e = 0.5": lambda: acrobot((-pi, 0.0), 0.5),
    "acrobot, plastic hit, to the side": lambda: acrobot((-2.2, 0.6), 0.0, final_time=2.0),
    "acrobot, two hits": lambda: acrobot((-pi, 0.0), 0.8, hits=2),
    "acrobot, limited torque, in 2.5 s": lambda: acrobot(
        (-pi, 0.0), 0.7, final_time=2.5, bounds=limits("b", 12.0)
    ),
    "arm, elastic wall": lambda: moved(
        arm(2, "ab", "wall"), (0.2, -0.4), (-1.2, 0.8), sequence=["wall"], final_time=1.2,
        restitution=1.0, bounds=limits("ab", 60.0), parameters={"reach": 0.9},
    ),
    "arm, wall, free time": lambda: moved(
        arm(2, "ab", "wall"), (-0.3, -0.5), (2.2, 0.9), sequence=["wall"], final_time=SWINGING,
        restitution=0.3, parameters={"reach": 1.4},
    ),
    "arm, floor": lambda: moved(
        arm(2, "ab", "floor"), (0.9, 0.6), (-0.9, -0.6), sequence=["floor"], final_time=1.5,
        restitution=0.5, parameters={"reach": 1.7},
    ),
    "arm, two hits on the floor": lambda: moved(
        arm(2, "ab", "floor"), (1.2, 0.4), (-1.2, 1.0), sequence=["floor", "floor"],
        final_time=SWINGING, restitution=0.8, bounds=limits("ab", 50.0), parameters={"reach": 1.6},
    ),
    "arm, bound of power, wall": lambda: moved(
        arm(2, "ab", "wall", limited=True), (0.3, -0.5), (-0.9, 0.7), sequence=["wall"],
        final_time=1.2, restitution=0.8, parameters={"reach": 0.8, "P": 12.0},
    ),
    "arm, bound of power, far wall": lambda: moved(
        arm(2, "ab", "wall", limited=True), (-0.5, 0.3), (-1.1, -0.8), sequence=["wall"],
        final_time=1.6, restitution=0.5, parameters={"reach": 1.2, "P": 20.0},
    ),
    "arm, bound of power, plastic wall, free time": lambda: moved(
        arm(2, "ab", "wall", limited=True), (0.1, 0.1), (-1.5, 1.2), sequence=["wall"],
        final_time=(0.8, 2.5), restitution=0.0, parameters={"reach": 1.1, "P": 15.0},
    ),
    "arm, bound of power, least time": lambda: moved(
        arm(2, "ab", limited=True, hurried=True), (0.0, 0.0), (1.6, 0.8), final_time=(0.2, 5.0),
        bounds=limits("ab", 25.0), parameters={"P": 30.0},
    ),
    "arm, bound of power, wall, least time": lambda: moved(
        arm(2, "ab", "wall", limited=True, hurried=True), (-0.6, 0.2), (-0.4, -0.3),
        sequence=["wall"], final_time=(0.2, 5.0), restitution=0.6, bounds=limits("ab", 25.0),
        parameters={"reach": 0.8, "P": 15.0},
    ),
    "arm's tip, nearly straight": lambda: nearly_straight(0.1, final_time=1.5),
    "arm's tip, straighter, free time": lambda: nearly_straight(
        0.03, final_time=(0.5, 3.0), bounds=limits("ab", 60.0)
    ),
    "arm's tip, nearly straight, wall": lambda: nearly_straight(
        0.1, final_time=1.5, sequence=["wall"], restitution=0.8, parameters={"reach": 1.85},
    ),
    "three links, wall": lambda: moved(
        arm(3, "abc", "wall"), (0.2, -0.3, -0.3), (-0.9, 0.4, 0.5), sequence=["wall"],
        final_time=1.5, restitution=0.9, parameters={"reach": 1.3},
    ),
    "three links, floor, free time": lambda: moved(
        arm(3, "abc", "floor"), (0.9, 0.4, 0.3), (-0.7, -0.6, -0.2), sequence=["floor"],
        final_time=(0.8, 2.5), restitution=0.4, bounds=limits("abc", 90.0),
        parameters={"reach": 2.4},
    ),
    "three links, shoulder free": lambda: moved(
        arm(3, "bc", "wall"), (0.0, 0.0, 0.0), (-1.0, 0.3, 0.2), sequence=["wall"], final_time=2.0,
        restitution=0.7, parameters={"reach": 1.0},
    ),
}  # fmt: skip
