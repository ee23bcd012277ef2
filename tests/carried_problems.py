"""Problems that are carried away as solvers in C."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import sympy as sp
from contact_problems import against_wall_on_floor, rimless, two_masses
from joint_problems import bob
from sympy.physics.mechanics import dynamicsymbols
from systems import block_system

import dmoc
from dmoc.models.registry import find


def cart(order: int, steps: int) -> dmoc.Problem:
    reference = find("cart_pendulum")
    return dmoc.Problem(dmoc.load("cart_pendulum", order=order), **reference.defaults).but(
        steps=steps
    )


def linkage(order: int, twice: bool = False) -> dmoc.Problem:
    """The bob on its rod, which may be stated twice, from below to the side."""
    system = bob()
    if twice:
        (rod,) = system.constraints.values()
        system = replace(system, name="bob_twice", constraints={"rod": rod, "again": 3 * rod})
    return dmoc.Problem(
        dmoc.build(system, order=order), start={"x": 0, "y": -1}, goal={"x": 0.6, "y": -0.8},
        steps=12, final_time=1.0, bounds={"u": (-30, 30)},
    )  # fmt: skip


def design() -> dmoc.Problem:
    """The block that is thrown at a wall whose place is chosen, dearer the nearer it is."""
    system = block_system("carried_wall")
    wall = next(s for s in system.parameters if s.name == "wall")
    chosen = replace(system, terminal_cost=-40 * wall)
    return dmoc.Problem(
        dmoc.build(chosen), start={"x": 0, "x_dot": 0}, goal={"x": 0, "x_dot": 0},
        sequence=["wall"], steps=10, final_time=1.0, design={"wall": (0.5, 2)},
    )  # fmt: skip


def stride() -> dmoc.Problem:
    """A block that ends half a metre further and somewhat faster, whose first rate is limited."""
    return dmoc.Problem(
        dmoc.build(block_system("carried_stride")), start={"x": 0, "x_dot": (-1, 0.2)},
        periodic={"x": ("x", 0.5), "x_dot": ("x_dot", (0, 0.3))}, steps=10, final_time=1.0,
    )  # fmt: skip


def rolling() -> dmoc.Problem:
    """A disc that rolls from where its place and its angle are zero."""
    x, a, u = dynamicsymbols("x a u")
    disc = dmoc.MechanicalSystem(
        "carried_disc", [x, a], (x.diff() ** 2 + 0.02 * a.diff() ** 2) / 2, inputs=[u],
        forces={a: u}, constraints={"roll": sp.Eq(x, 0.2 * a)}, cost=u**2,
    )  # fmt: skip
    return dmoc.Problem(disc, {"x": 0, "a": 0}, {"x": 1, "x_dot": 0}, steps=10, final_time=2.0)


# Problems with numbers that are set at run time, as the problem has them.
CASES: dict[str, tuple[Any, dict[str, float], Any]] = {
    "cart_2": (
        lambda: cart(2, 15),
        {
            "start.alpha": 0.5, "goal.p_x": 0.1, "parameters.m_c": 1.05, "final_time.high": 1.1,
            "bounds.F.high": 60.0, "start.x_dot": 0.2, "restitution.lower": 0.95,
        },
        lambda p: p.but(
            start={**p.start, "alpha": 0.5, "x_dot": 0.2}, goal={**p.goal, "p_x": 0.1},
            parameters={"m_c": 1.05}, final_time=(None, 1.1),
            bounds={**p.bounds, "F": (-200, 60)}, restitution=0.95,
        ),
    ),
    "cart_4": (
        lambda: cart(4, 8), {"start.x": 0.1, "parameters.l": 0.52},
        lambda p: p.but(start={**p.start, "x": 0.1}, parameters={"l": 0.52}),
    ),
    "floor": (
        lambda: against_wall_on_floor(12, 0.1),
        {"goal.x": -0.1, "final_time": 1.1, "restitution.wall": 0.9},
        lambda p: p.but(goal={**p.goal, "x": -0.1}, final_time=1.1, restitution=0.9),
    ),
    "masses": (
        lambda: two_masses(10), {"bounds.u.low": -4.2, "goal.b": 1.9, "parameters.f": 0.9},
        lambda p: p.but(
            bounds={"u": (-4.2, 4), "w": (-4, 4)}, goal={**p.goal, "b": 1.9}, parameters={"f": 0.9}
        ),
    ),
    "linkage_2": (
        lambda: linkage(2), {"goal.x": 0.8, "goal.y": -0.6, "final_time": 1.2},
        lambda p: p.but(goal={"x": 0.8, "y": -0.6}, final_time=1.2),
    ),
    "linkage_4": (
        lambda: linkage(4), {"bounds.u.high": 3.7},
        lambda p: p.but(bounds={"u": (-30, 3.7)}),
    ),
    "disc": (
        rolling, {"goal.x": 0.7, "final_time": 1.5},
        lambda p: p.but(goal={**p.goal, "x": 0.7}, final_time=1.5),
    ),
    "stride": (
        stride, {"periodic.x": 0.6, "periodic.x_dot.high": 0.25, "start.x_dot.high": 0.3},
        lambda p: p.but(
            periodic={"x": ("x", 0.6), "x_dot": ("x_dot", (0, 0.25))},
            start={"x": 0, "x_dot": (-1, 0.3)},
        ),
    ),
    "wheel": (  # a gait, which ends with its landing
        lambda: rimless(8, 4).but(start={"x": 0}, durations=[None, 0]),
        {"parameters.g": 9.0, "final_time.low": 0.2},
        lambda p: p.but(parameters={"g": 9.0}, final_time=(0.2, 2)),
    ),
    "design": (
        design, {"goal.x": 0.1, "design.wall.high": 0.8},
        lambda p: p.but(goal={**p.goal, "x": 0.1}, design={"wall": (0.5, 0.8)}),
    ),
}  # fmt: skip
