"""True motions in which errors are planted: solved problems of several kinds."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import sympy as sp
from common import find, seed
from contact_problems import rimless
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.motion.trajectory import Trajectory

X, Y, A, U, W = dynamicsymbols("x y a u w")
T = dynamicsymbols._t
M, G, MU, K, AT, UP, R = sp.symbols("m g mu k at up r")
FALL = 9.81


def puck() -> dmoc.Problem:
    reference = find("puck_table")
    problem = dmoc.Problem(reference.kernels(), **reference.defaults)
    return problem.but(sequence=["east"])


def ball() -> dmoc.Problem:
    """A ball with a small thruster bounces once; a thin post stands far away."""
    system = dmoc.MechanicalSystem(
        "planted_ball", [X, Y], M * (X.diff(T) ** 2 + Y.diff(T) ** 2) / 2 - M * G * Y,
        {M: 2.0, G: FALL, AT: 50.0, UP: 50.0, R: 0.01}, inputs=[U, W], forces={X: U, Y: W},
        cost=U**2 + W**2,
        surfaces={"floor": Y >= 0, "post": (X - AT) ** 2 + (Y - UP) ** 2 >= R**2},
    )  # fmt: skip
    return dmoc.Problem(
        system, start={"x": 0, "y": 1, "x_dot": 1}, goal={"x": 1.5, "y": 0.8},
        sequence=["floor"], restitution=0.8, steps=40, final_time=(0.5, 2.0),
    )  # fmt: skip


def block() -> dmoc.Problem:
    """A block is pushed over a floor with friction, and sticks."""
    system = dmoc.MechanicalSystem(
        "planted_block", [X, Y], M * (X.diff(T) ** 2 + Y.diff(T) ** 2) / 2 - M * G * Y,
        {M: 2.0, G: FALL, MU: 0.1, AT: 50.0, UP: 50.0, R: 0.01}, inputs=[U], forces={X: U},
        cost=U**2 / 2, tangents={"floor": X}, friction={"floor": MU},
        surfaces={"floor": Y >= 0, "post": (X - AT) ** 2 + (Y - UP) ** 2 >= R**2},
    )  # fmt: skip
    return dmoc.Problem(
        system, start={"x": 0, "y": 0}, goal={"x": 1, "x_dot": 0}, contacts=["floor:slip+"],
        sequence=["floor:stick"], steps=30, final_time=3,
    )  # fmt: skip


def hopper() -> dmoc.Problem:
    """A hopper with a spring in its leg stands, flies for 0.35 s and lands."""
    z, f = dynamicsymbols("z f")
    foot, rest, d = sp.symbols("foot rest d")
    energy = M * z.diff(T) ** 2 / 2 + foot * f.diff(T) ** 2 / 2
    system = dmoc.MechanicalSystem(
        "planted_hopper", [z, f],
        energy - M * G * z - foot * G * f - K * (z - f - rest) ** 2 / 2,
        {M: 3.0, foot: 0.3, K: 300.0, rest: 0.6, d: 2.0, G: FALL}, inputs=[U],
        forces={z: U, f: -U}, dissipation=d * (z - f).diff(T) ** 2 / 2, cost=U**2,
        surfaces={"floor": f >= 0},
    )  # fmt: skip
    standing = 0.6 - 3.0 * FALL / 300.0
    return dmoc.Problem(
        system, start={"z": standing, "f": 0.0},
        goal={"z": standing, "z_dot": 0.0, "f_dot": 0.0}, contacts=["floor"],
        sequence=["-floor", "+floor"], steps=60, final_time=(0.5, 3.0),
        durations=[None, (0.35, 0.35), None],
    )  # fmt: skip


def pole() -> dmoc.Problem:
    """A cart with a hanging pole goes along a rail with dry friction, without turning."""
    f = sp.Symbol("f")
    tip = X + sp.sin(A) / 2
    kinetic = X.diff(T) ** 2 / 2 + M * (tip.diff(T) ** 2 + (sp.sin(A) * A.diff(T) / 2) ** 2) / 2
    system = dmoc.MechanicalSystem(
        "planted_pole", [X, A], kinetic + M * G * sp.cos(A) / 2, {M: 0.3, G: FALL, f: 0.5},
        inputs=[U], forces={X: U}, cost=U**2, tangents={"rail": X}, friction={"rail": f},
    )  # fmt: skip
    return dmoc.Problem(
        system, start={"x": 0, "a": 0}, goal={"x": 1, "a": 0, "x_dot": 0, "a_dot": 0},
        contacts=["rail:slip+"], sequence=["rail:stick"], steps=40, final_time=2.5,
    )  # fmt: skip


PROBLEMS: dict[str, Callable[[], dmoc.Problem]] = {
    "cart-pendulum": seed, "puck": puck, "ball": ball, "block": block, "hopper": hopper,
    "pole on a rail": pole, "rimless wheel": lambda: rimless(20),
}  # fmt: skip


def true_motions(names: tuple[str, ...]) -> Iterator[tuple[str, Trajectory, Kernels]]:
    """Motions that were solved and confirmed."""
    for name in names:
        problem = PROBLEMS[name]()
        solution = dmoc.solve(problem, "ipm", starts=5)
        if not solution.solved:
            raise RuntimeError(f"{name}: {solution.status}, {solution.message}")
        yield name, solution.trajectory, problem.kernels
