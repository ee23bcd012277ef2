"""Published problems for `twenty.py`, with their data: of NOSBENCH (A. Nurkanovic, A. Pozharskiy,
M. Diehl: Solving mathematical programs with complementarity constraints arising in nonsmooth
optimal control, 2024) and of CRISP (Y. Li and others, Robotics: Science and Systems 2025)."""

from __future__ import annotations

from collections.abc import Sequence
from math import pi
from typing import Any

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import dmoc

U, W = dynamicsymbols("u w")
T = dynamicsymbols._t
FALL = 9.81


def kinetic(mass: Any, *places: Any) -> Any:
    return mass * sum(place.diff(T) ** 2 for place in places) / 2


def tracked(states: Sequence[Any], target: Sequence[Any], weights: Sequence[float]) -> Any:
    """A weighted sum of squares of differences, without those of no weight."""
    return sum(w * (x - y) ** 2 for x, y, w in zip(states, target, weights, strict=True) if w)


def with_rates(coordinates: Sequence[Any]) -> list[Any]:
    return [*coordinates, *(q.diff(T) for q in coordinates)]


def slower(**limits: float) -> dict[str, Any]:
    """Limits of velocities, by the names of their coordinates."""
    return {
        f"speed_{name}": dynamicsymbols(name).diff(T) ** 2 <= limit**2
        for name, limit in limits.items()
    }


def rest(**place: float) -> dict[str, float]:
    """A place at which everything is at rest."""
    return place | {f"{name}_dot": 0.0 for name in place}


def pole_system(cost: Any, terminal: Any, drag: float, name: str) -> dmoc.MechanicalSystem:
    """A cart of 1 kg with a pole of 0.1 kg at 1 m on a rail with dry friction."""
    x, a = dynamicsymbols("x a")
    f = sp.Symbol("f")
    tip = (x + sp.sin(a), -sp.cos(a))
    return dmoc.MechanicalSystem(
        name, [x, a], kinetic(1, x) + kinetic(0.1, *tip) - 0.1 * FALL * tip[1], {f: drag},
        inputs=[U], forces={x: U}, cost=cost, terminal_cost=terminal, tangents={"rail": x},
        friction={"rail": f},
    )  # fmt: skip


def swing_up() -> dmoc.MechanicalSystem:
    return pole_system(U**2, 0, 2.0, "railed_swing_up")


def swing_up_problem() -> dmoc.Problem:
    """Swing-up in 3 s with 2 N of friction."""
    return dmoc.Problem(
        swing_up(), start=rest(x=0, a=0), goal=rest(x=0, a=pi), steps=40, final_time=3,
        bounds={U: (-30, 30)},
    )  # fmt: skip


def cpwf() -> dmoc.MechanicalSystem:
    x, a = dynamicsymbols("x a")
    states, target = with_rates([x, a]), (0, pi, 0, 0)
    cost = tracked(states, target, (1, 100, 1, 1)) + U**2
    return pole_system(cost, tracked(states, target, (100, 100, 10, 10)), 5.0, "nosbench_cpwf")


def cpwf_problem() -> dmoc.Problem:
    """NOSBENCH CPWF, F = 5: a swing-up that is wanted, not demanded."""
    return dmoc.Problem(
        cpwf(), start=rest(x=1, a=0), steps=40, final_time=4,
        bounds={U: (-30, 30), "x": (0, 5), "a": (-4 * pi / 3, 4 * pi / 3)},
    )  # fmt: skip


def discs() -> dmoc.MechanicalSystem:
    q = dynamicsymbols("x1 y1 x2 y2")
    x1, y1, x2, y2 = q
    deviation = tracked(q, (-1, 1, 0, 0), (5, 5, 10, 10))
    return dmoc.MechanicalSystem(
        "nosbench_discm", q, kinetic(2, x1, y1) + kinetic(1, x2, y2), {}, inputs=[U, W],
        forces={x1: U, y1: W}, surfaces={"discs": sp.sqrt((x1 - x2) ** 2 + (y1 - y2) ** 2) >= 0.5},
        cost=deviation + (U**2 + W**2) / 10, terminal_cost=100 * deviation,
    )  # fmt: skip


def discs_problem() -> dmoc.Problem:
    """NOSBENCH DISCM: a disc knocks another one into the origin."""
    return dmoc.Problem(
        discs(), start=rest(x1=-1, y1=-2, x2=-1, y2=-1), steps=30, final_time=2, restitution=0.0,
        bounds={U: (-20, 20), W: (-20, 20)} | dict.fromkeys(("x1", "y1", "x2", "y2"), (-10, 10)),
    )  # fmt: skip


def carts() -> dmoc.MechanicalSystem:
    q = dynamicsymbols("x1 x2 x3")
    x1, x2, x3 = q
    deviation = tracked(with_rates(q), (-5, 0, 5, 0, 0, 0), (10, 1, 10, 0.1, 0.1, 0.1))
    return dmoc.MechanicalSystem(
        "nosbench_3cptf", q, kinetic(1, *q), {}, inputs=[U], forces={x2: U},
        dissipation=sum(x.diff(T) ** 2 for x in q),
        surfaces={"left": x2 - x1 >= 2, "right": x3 - x2 >= 2}, cost=deviation + U**2 / 10,
        terminal_cost=100 * deviation, path_constraints=slower(x1=5, x2=5, x3=5),
    )  # fmt: skip


def carts_problem() -> dmoc.Problem:
    """NOSBENCH 3CPTF, mass 1: the cart in the middle pushes the others apart."""
    return dmoc.Problem(
        carts(), start=rest(x1=-3, x2=0, x3=3), steps=30, final_time=4, restitution=0.0,
        bounds={U: (-20, 20), "x1": (-15, 10), "x2": (-15, 15), "x3": (-10, 15)},
    )  # fmt: skip


def rough_carts() -> dmoc.MechanicalSystem:
    q = dynamicsymbols("x1 x2 x3")
    x1, x2, x3 = q
    f = sp.Symbol("f")
    deviation = tracked(with_rates(q), (-7, 0, 5, 0, 0, 0), (10, 1, 10, 0.1, 0.1, 0.1))
    names = ("floor1", "floor2", "floor3")
    return dmoc.MechanicalSystem(
        "nosbench_3cpcls", q, kinetic(1, *q), {f: 0.2 * FALL}, inputs=[U], forces={x2: U},
        surfaces={"left": x2 - x1 >= 2, "right": x3 - x2 >= 2},
        tangents=dict(zip(names, q, strict=True)), friction=dict.fromkeys(names, f),
        cost=deviation + U**2 / 10, terminal_cost=100 * deviation,
    )  # fmt: skip


def rough_carts_problem() -> dmoc.Problem:
    """NOSBENCH 3CPCLS, mass 1: with friction on the floor."""
    return dmoc.Problem(
        rough_carts(), start=rest(x1=-3, x2=0, x3=3), steps=20, final_time=6,
        restitution={"left": 0.0, "right": 0.5},
        bounds={U: (-30, 30)} | dict.fromkeys(("x1", "x2", "x3"), (-10, 10)),
    )  # fmt: skip


def drone() -> dmoc.MechanicalSystem:
    y, z, a = dynamicsymbols("y z a")
    t = T / 2  # share of the final time
    path = (-1 + 3 * t, 3 - 3 * t, pi / 8 * (1 - t), 0, 0, 0)
    weights, states = (10, 10, 10, 0.1, 0.1, 0.1), with_rates((y, z, a))
    return dmoc.MechanicalSystem(
        "nosbench_drnlnd", [y, z, a], kinetic(1, y, z, a) - FALL * z, {}, inputs=[U, W],
        forces={y: -sp.sin(a) * (U + W), z: sp.cos(a) * (U + W), a: (W - U) / 4},
        surfaces={"left": z - sp.sin(a) / 4 >= 0, "right": z + sp.sin(a) / 4 >= 0},
        cost=tracked(states, path, weights) + (U**2 + W**2) / 10,
        terminal_cost=50 * tracked(states, (2, 0, 0, 0, 0, 0), weights),
    )  # fmt: skip


def drone_problem() -> dmoc.Problem:
    """NOSBENCH DRNLND on flat ground: a planar drone lands where it is wanted."""
    return dmoc.Problem(
        drone(), start=rest(y=-1, z=3, a=pi / 8), steps=20, final_time=2, restitution=0.0,
        bounds={U: (-30, 30), W: (-30, 30)},
    )  # fmt: skip


def motor() -> dmoc.MechanicalSystem:
    """The current is the rate of a charge."""
    x1, x2, charge = dynamicsymbols("x1 x2 charge")
    f = sp.Symbol("f")
    energy = kinetic(1.03, x1) + kinetic(0.56, x2) - 2.4e3 * (x2 - x1) ** 2 / 2
    coil = 2e-3 * charge.diff(T) ** 2 / 2 + 12 * x1 * charge.diff(T)
    return dmoc.MechanicalSystem(
        "nosbench_mwfocp", [x1, x2, charge], energy + coil, {f: 2.1}, inputs=[U],
        forces={charge: U}, dissipation=charge.diff(T) ** 2,
        tangents={"guide": x1}, friction={"guide": f}, cost=U**2,
    )  # fmt: skip


def motor_problem() -> dmoc.Problem:
    """NOSBENCH MWFOCP: a motor moves a load on a spring along a guide with friction."""
    goal = rest(x1=0.01, x2=0.01) | {"charge_dot": 0.0}
    return dmoc.Problem(
        motor(), start=rest(x1=0, x2=0, charge=0), goal=goal, steps=80, final_time=0.08,
        bounds={U: (-5, 5)},
    )  # fmt: skip


def hopper() -> dmoc.MechanicalSystem:
    x, y, a, r = q = dynamicsymbols("x y a r")
    t = T
    ends = ((0.1, 0.4, 0.7), (0.5, 0.8, 0.5), (0, 0, 0), (0.5, 0.1, 0.5))
    path = [  # through three places at 0, 0.5 and 1 s
        b + (4 * m - 3 * b - e) * t + (2 * b - 4 * m + 2 * e) * t**2 for b, m, e in ends
    ] + [0] * 4
    weights = (50, 50, 20, 50, 0.1, 0.1, 0.1, 0.1)
    foot = (x + r * sp.sin(a), y - r * sp.cos(a))
    mu = sp.Symbol("mu")
    return dmoc.MechanicalSystem(
        "nosbench_hopocp", q,
        kinetic(1.1, x, y) + kinetic(0.275, a) + kinetic(0.1, r) - 1.1 * FALL * y, {mu: 0.45},
        inputs=[U, W], forces={x: -sp.sin(a) * W, y: sp.cos(a) * W, a: U, r: W},
        surfaces={"ground": foot[1] >= 0}, tangents={"ground": foot[0]}, friction={"ground": mu},
        cost=tracked(with_rates(q), path, weights) + (U**2 + W**2) / 100,
        terminal_cost=tracked(
            with_rates(q), (0.7, 0.5, 0, 0.5, 0, 0, 0, 0), (300,) * 4 + (0.1,) * 4
        ),
        path_constraints=slower(x=10, y=10, a=5, r=5),
    )  # fmt: skip


def hopper_problem() -> dmoc.Problem:
    """NOSBENCH HOPOCP: a hopper follows a leap."""
    bounds = {U: (-50, 50), W: (-50, 50), "x": (0, 0.8), "y": (0, 1.5), "a": (-pi, pi)}
    return dmoc.Problem(
        hopper(), start=rest(x=0.1, y=0.5, a=0, r=0.5), contacts=["ground"], steps=20,
        final_time=1, restitution=0.0, bounds=bounds | {"r": (0.1, 0.5)},
    )  # fmt: skip


def transport() -> dmoc.MechanicalSystem:
    load, cart = dynamicsymbols("load cart")
    f = sp.Symbol("f")
    states = with_rates((load, cart))
    return dmoc.MechanicalSystem(
        "crisp_transport", [load, cart], kinetic(1, load) + kinetic(2, cart), {f: 0.2 * FALL},
        inputs=[U], forces={cart: U}, tangents={"top": load - cart}, friction={"top": f},
        path_constraints={"ahead": load - cart <= 1, "behind": load - cart >= -1},
        cost=U**2 * 1e-4 / 0.02,
        terminal_cost=tracked(states, (-0.5, 0, -2, -2), (1e5, 1e5, 10, 10)),
    )  # fmt: skip


def transport_problem() -> dmoc.Problem:
    """CRISP's transport without its cost of the friction: a cart brings a load, which must slide
    from one end to the other."""
    return dmoc.Problem(
        transport(), start={"load": 3.5, "cart": 3.0, "load_dot": -4.0, "cart_dot": -4.0},
        steps=100, final_time=4,
    )  # fmt: skip
