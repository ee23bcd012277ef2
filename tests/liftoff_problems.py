"""Motions whose contacts leave where no input changes their force, with the times at which they
do."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import sympy as sp
from scipy.integrate import quad, solve_ivp
from sympy.physics.mechanics import dynamicsymbols

import dmoc

G, RAMP = 9.81, 30.0
A, B, F, S, X, Y, Z = dynamicsymbols("a b F s x y z")
T = dynamicsymbols._t
# A problem without its kernels, and when its contacts leave.
Stated = tuple[dmoc.MechanicalSystem, dict[str, Any], float]


def _of(rates: list[sp.Expr], potential: sp.Expr) -> sp.Expr:
    return sum(rate.diff(T) ** 2 for rate in rates) / 2 - potential


def loop() -> Stated:
    """A ball in a loop of radius 1, which at the bottom has the square of a velocity of 3.5 g: it
    leaves where v^2 = g y, at y = 1/2."""
    fast = 3.5 * G
    system = dmoc.MechanicalSystem(
        "loop", [X, Y], _of([X, Y], G * Y), surfaces={"loop": X**2 + Y**2 <= 1}
    )
    when = quad(
        lambda a: 1 / np.sqrt(fast - 2 * G * (1 - np.cos(a))), 0, np.pi / 2 + np.pi / 6,
        epsabs=1e-13,
    )[0]  # fmt: skip
    start = {X: 0, Y: -1, "x_dot": fast**0.5, "y_dot": 0}
    return system, {"start": start, "contacts": ["loop"], "sequence": ["-loop"]}, when


def joined_loop() -> Stated:
    """Two balls of which a constraint each makes the coordinates the same."""
    _, problem, when = loop()
    joints = {"along": sp.Eq(A, X), "up": sp.Eq(B, Y)}
    system = dmoc.MechanicalSystem(
        "joined_loop", [X, Y, A, B], _of([X, Y, A, B], G * (Y + B)),
        surfaces={"loop": X**2 + Y**2 <= 1}, constraints=joints,
    )  # fmt: skip
    start = problem["start"]
    second = {A: start[X], B: start[Y], "a_dot": start["x_dot"], "b_dot": start["y_dot"]}
    return system, problem | {"start": start | second}, when


def ramp() -> Stated:
    """A force that grows lifts a block."""
    system = dmoc.MechanicalSystem(
        "ramp", [Y], _of([Y], G * Y), forces={Y: RAMP * T}, surfaces={"floor": Y >= 0}
    )
    problem = {"start": {Y: 0, "y_dot": 0}, "contacts": ["floor"], "sequence": ["-floor"]}
    return system, problem, G / RAMP


def sliding_ramp() -> Stated:
    """One that slides on the floor with friction."""
    system = dmoc.MechanicalSystem(
        "sliding_ramp", [X, Y], _of([X, Y], G * Y), forces={Y: RAMP * T},
        surfaces={"floor": Y >= 0}, tangents={"floor": X}, friction={"floor": 0.3},
    )  # fmt: skip
    start = {X: 0, Y: 0, "x_dot": 3, "y_dot": 0}
    problem = {"start": start, "contacts": ["floor:slip+"], "sequence": ["-floor"]}
    return system, problem, G / RAMP


def corners() -> Stated:
    """A box on two corners, which leave at once."""
    system = dmoc.MechanicalSystem(
        "corners", [Y, A], _of([Y, A], G * Y), forces={Y: RAMP * T},
        surfaces={"left": Y - sp.sin(A) >= 0, "right": Y + sp.sin(A) >= 0},
    )  # fmt: skip
    start = {Y: 0, A: 0, "y_dot": 0, "a_dot": 0}
    both = {"contacts": ["left", "right"], "sequence": ["-left -right"]}
    return system, {"start": start, **both}, G / RAMP


def shaken() -> Stated:
    """A block on a floor that moves as 0.1 sin 14 t."""
    system = dmoc.MechanicalSystem(
        "shaken", [Y], _of([Y], G * Y), surfaces={"floor": 0.1 * sp.sin(14 * T) <= Y}
    )
    problem = {"start": {Y: 0, "y_dot": 1.4}, "contacts": ["floor"], "sequence": ["-floor"]}
    return system, problem, float(np.arcsin(G / 19.6)) / 14


def road() -> Stated:
    """A road that falls off as 5 x^3, and a lifting force that grows less than the road falls: with
    order 2 the first gap after the event has the sign of the error of the step."""
    lift, fades = 9.6, 24.0
    system = dmoc.MechanicalSystem(
        "road", [X, Y], _of([X, Y], G * Y), forces={Y: lift - fades * T},
        surfaces={"road": Y >= -5 * X**3},
    )  # fmt: skip

    def force(t: float, state: np.ndarray) -> float:
        x, v = state
        return float((G - lift + fades * t - 30 * x * v**2) / (1 + (15 * x**2) ** 2))

    force.terminal = True  # type: ignore[attr-defined]
    run = solve_ivp(
        lambda t, state: [state[1], 15 * state[0] ** 2 * force(t, state)], (0, 1), [0, 1],
        events=force, rtol=1e-12, atol=1e-14,
    )  # fmt: skip
    start = {X: 0, Y: 0, "x_dot": 1, "y_dot": 0}
    problem = {"start": start, "contacts": ["road"], "sequence": ["-road"]}
    return system, problem, float(run.t_events[0][0])


def two_blocks() -> Stated:
    """Of two blocks the second one is lifted sooner."""
    system = dmoc.MechanicalSystem(
        "two_blocks", [Y, B], _of([Y, B], G * (Y + B)), forces={Y: RAMP * T, B: 1.5 * RAMP * T},
        surfaces={"one": Y >= 0, "two": B >= 0},
    )  # fmt: skip
    start = {Y: 0, B: 0, "y_dot": 0, "b_dot": 0}
    return system, {"start": start, "contacts": ["one", "two"], "sequence": ["-one -two"]}, 0.4


def twice() -> Stated:
    """A block on two surfaces that are the same: the motion determines the sum of their forces."""
    system = dmoc.MechanicalSystem(
        "twice", [Y], _of([Y], G * Y), forces={Y: RAMP * T},
        surfaces={"one": Y >= 0, "two": 2 * Y >= 0},
    )  # fmt: skip
    both = {"contacts": ["one", "two"], "sequence": ["-one -two"]}
    return system, {"start": {Y: 0, "y_dot": 0}, **both}, G / RAMP


def idle() -> Stated:
    """A puck along a wall that it never presses."""
    system = dmoc.MechanicalSystem(
        "idle", [X, Y], _of([X, Y], sp.S.Zero), surfaces={"wall": Y >= 0}
    )
    start = {X: 0, Y: 0, "x_dot": 1, "y_dot": 0}
    return system, {"start": start, "contacts": ["wall"], "sequence": ["-wall"]}, 0.5


def stopped_ramp() -> Stated:
    """A block that slides on a floor, which it leaves where it hits a wall."""
    _, problem, _ = sliding_ramp()
    system = dmoc.MechanicalSystem(
        "stopped_ramp", [X, Y], _of([X, Y], G * Y), forces={Y: RAMP * T},
        surfaces={"floor": Y >= 0, "wall": X <= 1}, tangents={"floor": X}, friction={"floor": 0.3},
    )  # fmt: skip
    return system, problem | {"sequence": ["wall -floor"]}, 0.4


def problem_of(
    stated: Callable[[], Stated], steps: int, order: int, **more: Any
) -> tuple[dmoc.Problem, float]:
    """A problem that ends 0.2 s after the event, and when that is."""
    system, problem, when = stated()
    own = {"goal": {}, "final_time": when + 0.2, **problem, **more}
    return dmoc.Problem(dmoc.build(system, order=order), steps=steps, **own), when


def spring_lift(steps: int, order: int) -> dmoc.Problem:
    """A carriage that an input drives lifts a block by a spring of 200 N/m."""
    system = dmoc.MechanicalSystem(
        "spring_lift", [Y, Z], _of([Y, Z], G * Y + 100 * (Z - Y) ** 2), inputs=[F],
        forces={Z: F}, surfaces={"floor": Y >= 0}, cost=F**2 / 2,
    )  # fmt: skip
    return dmoc.Problem(
        dmoc.build(system, order=order), {Y: 0, Z: 0, "y_dot": 0, "z_dot": 0}, {Y: 0.05},
        ["-floor"], contacts=["floor"], steps=steps, final_time=1,
    )  # fmt: skip


def pulled(**more: Any) -> dmoc.Problem:
    """A block that an input lifts."""
    system = dmoc.MechanicalSystem(
        "pulled", [Y], _of([Y], G * Y), inputs=[F], forces={Y: F + RAMP * T},
        surfaces={"floor": Y >= 0}, cost=F**2 / 2,
    )  # fmt: skip
    own = {"goal": {Y: 0.1}, "final_time": 0.5, "steps": 10, **more}
    return dmoc.Problem(
        dmoc.build(system), {Y: 0, "y_dot": 0}, contacts=["floor"], sequence=["-floor"], **own
    )


def everything(order: int) -> dmoc.Problem:
    """Friction, a moving and a curved floor, a constraint, a drive behind a spring, and two
    contacts that leave at once."""
    l, mu, amplitude = sp.symbols("l mu amplitude")
    floor = amplitude * sp.sin(3 * T) + X**2 / 5 <= Y
    lagrangian = _of([X, Y, Z, B, S], G * (Y + B) + 20 * (S - Y - B) ** 2)
    system = dmoc.MechanicalSystem(
        "everything_lifts", [X, Y, Z, B, S], lagrangian + X.diff(T) * Y.diff(T) * sp.cos(X) / 5,
        inputs=[F], forces={S: F, X: -(X.diff(T) ** 3)}, tangents={"floor": X},
        surfaces={"floor": floor, "beam": B >= 0}, friction={"floor": mu * (1 + X**2)},
        constraints={"rod": sp.Eq(Z, l * X + X**2)}, cost=F**2 / 2,
        parameters={l: 1.0, mu: 0.2, amplitude: 0.1},
    )  # fmt: skip
    return dmoc.Problem(
        dmoc.build(system, order=order),
        {X: 0, Y: 0, Z: 0, B: 0, S: 0, "x_dot": (0.5, 1.5)}, {Y: (0.1, None)}, ["-floor -beam"],
        contacts=["floor:slip+", "beam"], steps=[3, 2], final_time=(0.1, 1.0),
    )  # fmt: skip
