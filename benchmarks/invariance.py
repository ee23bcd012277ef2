"""One problem told in other units and at another place: whether the answer is the same.

python benchmarks/invariance.py block ladder    every answer of the systems with these words
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import sympy as sp
from common import Section
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.models.registry import find

SHIFTS = (0.0, 3.0, -0.7, 1e3)  # of the places of surfaces, start and goal, in metres
POWERS = (-6, -3, 3, 6)  # of ten: how many new units are an old one
QUICK = (-6, 6)

X, Y, A, B, U, W = dynamicsymbols("x y a b u w")
M, LENGTH, G, MU, C, PUSH = sp.symbols("m l g mu c push")
T = dynamicsymbols._t


@dataclass(frozen=True)
class Frame:
    """What a metre, a kilogram and a second are in the units that a problem is told in, and where
    its origin is, in metres."""

    metre: float = 1.0
    kilogram: float = 1.0
    second: float = 1.0
    shift: float = 0.0

    def length(self, value: float) -> float:
        return value * self.metre

    def place(self, value: float) -> float:
        return (value + self.shift) * self.metre

    def time(self, value: float) -> float:
        return value * self.second

    def speed(self, value: float) -> float:
        return value * self.metre / self.second

    def acceleration(self, value: float) -> float:
        return value * self.metre / self.second**2

    def mass(self, value: float) -> float:
        return value * self.kilogram

    def force(self, value: float) -> float:
        return self.mass(self.acceleration(value))

    def torque(self, value: float) -> float:
        return self.length(self.force(value))

    def __str__(self) -> str:
        return (
            f"metre {self.metre:g}, kilogram {self.kilogram:g}, second {self.second:g}, "
            f"shifted by {self.shift:g} m"
        )


def free_system() -> dmoc.MechanicalSystem:
    """A mass on a line, and a wall."""
    return dmoc.MechanicalSystem(
        "line", [X], M * X.diff(T) ** 2 / 2, {M: 1.0, C: 1.0}, inputs=[U], forces={X: U},
        surfaces={"wall": X <= C}, cost=U**2,
    )  # fmt: skip


def floor_system() -> dmoc.MechanicalSystem:
    """A block on a floor with friction at y = c."""
    return dmoc.MechanicalSystem(
        "floor", [X, Y], M * (X.diff(T) ** 2 + Y.diff(T) ** 2) / 2 - M * G * Y,
        {M: 1.0, G: 9.81, MU: 0.3, C: 0.0}, inputs=[U], forces={X: U},
        surfaces={"floor": Y >= C}, tangents={"floor": X}, friction={"floor": MU}, cost=U**2,
    )  # fmt: skip


def hopper_system() -> dmoc.MechanicalSystem:
    """A body on a leg with a foot, moved up and down by the force of the leg."""
    kinetic = M * X.diff(T) ** 2 / 2 + M / 5 * Y.diff(T) ** 2 / 2
    return dmoc.MechanicalSystem(
        "vertical_hopper", [X, Y], kinetic - M * G * X - M / 5 * G * Y,
        {M: 1.0, G: 9.81, C: 0.0}, inputs=[U], forces={X: U, Y: -U},
        surfaces={"ground": Y >= C}, cost=U**2,
    )  # fmt: skip


def pendulum_system() -> dmoc.MechanicalSystem:
    return dmoc.MechanicalSystem(
        "held", [A], M * LENGTH**2 * A.diff(T) ** 2 / 2 + M * G * LENGTH * sp.cos(A - C),
        {M: 1.0, G: 9.81, LENGTH: 0.7, C: 0.0}, inputs=[U], forces={A: U}, cost=U**2,
    )  # fmt: skip


def ball_system() -> dmoc.MechanicalSystem:
    return dmoc.MechanicalSystem(
        "ball", [X, Y], M * (X.diff(T) ** 2 + Y.diff(T) ** 2) / 2 - M * G * Y,
        {M: 1.0, G: 9.81, C: 0.0}, inputs=[U, W], forces={X: U, Y: W},
        surfaces={"floor": Y >= C}, cost=U**2 + W**2,
    )  # fmt: skip


def finger_system() -> dmoc.MechanicalSystem:
    """A block on a floor, and a light finger that leans against its side."""
    return dmoc.MechanicalSystem(
        "finger", [X, Y, B],
        M * (X.diff(T) ** 2 + Y.diff(T) ** 2) / 2 + M / 50 * B.diff(T) ** 2 / 2 - M * G * Y,
        {M: 1.0, G: 9.81, MU: 0.3, C: 0.0, PUSH: 0.024}, inputs=[U], forces={B: PUSH + U},
        surfaces={"floor": Y >= C, "side": X - B >= 0}, tangents={"floor": X},
        friction={"floor": MU}, cost=U**2,
    )  # fmt: skip


def pole_system() -> dmoc.MechanicalSystem:
    """A pole on a cart whose rail rubs."""
    tip = sp.Matrix([X + LENGTH * sp.sin(A), -LENGTH * sp.cos(A)])
    kinetic = M * X.diff(T) ** 2 / 2 + M / 3 * tip.diff(T).dot(tip.diff(T)) / 2
    return dmoc.MechanicalSystem(
        "railed_pole", [X, A], kinetic - M / 3 * G * tip[1],
        {M: 1.0, G: 9.81, LENGTH: 0.5, PUSH: 0.5}, inputs=[U], forces={X: U},
        tangents={"rail": X}, friction={"rail": PUSH}, cost=U**2,
    )  # fmt: skip


def ladder_system() -> dmoc.MechanicalSystem:
    """A ladder that slides down a smooth wall on a smooth floor."""
    ends = {"floor": Y - LENGTH * sp.sin(A) >= C, "wall": X - LENGTH * sp.cos(A) >= C}
    kinetic = X.diff(T) ** 2 + Y.diff(T) ** 2 + LENGTH**2 * A.diff(T) ** 2 / 3
    return dmoc.MechanicalSystem(
        "ladder", [X, Y, A], M * kinetic / 2 - M * G * Y, {M: 1.0, G: 9.81, LENGTH: 1.0, C: 0.0},
        inputs=[U], forces={X: U}, surfaces=ends, cost=U**2,
    )  # fmt: skip


def cart_system() -> dmoc.MechanicalSystem:
    return find("cart_pendulum").system()


@dataclass(frozen=True)
class FramedProblem:
    """A system, and a problem of it in any units and at any place."""

    system: Callable[[], dmoc.MechanicalSystem]
    problem: Callable[[Frame], dict[str, Any]]


def parameters(frame: Frame, **more: float) -> dict[str, float]:
    return {"m": frame.mass(1.0), "g": frame.acceleration(9.81), **more}


def at_rest(frame: Frame) -> dict[str, Any]:
    here = {"x": frame.place(0), "y": frame.place(0)}
    return {
        "start": here, "contacts": ["floor:stick"], "steps": 10, "final_time": frame.time(1),
        "parameters": parameters(frame, c=frame.place(0)),
    }  # fmt: skip


def hopper_at_rest(frame: Frame) -> dict[str, Any]:
    return {
        "start": {"x": frame.place(0.5), "y": frame.place(0)},
        "goal": {"x": frame.place(0.5), "x_dot": 0.0}, "contacts": ["ground"], "steps": 12,
        "final_time": frame.time(0.8), "parameters": parameters(frame, c=frame.place(0)),
    }  # fmt: skip


def held(frame: Frame) -> dict[str, Any]:
    angle = {"a": 1.0 + frame.shift}
    return {
        "start": angle, "goal": {**angle, "a_dot": 0.0}, "steps": 20, "final_time": frame.time(1),
        "parameters": parameters(frame, l=frame.length(0.7), c=frame.shift),
    }  # fmt: skip


def idle(frame: Frame) -> dict[str, Any]:
    here = {"x": frame.place(0.4)}
    return {
        "start": here, "goal": {**here, "x_dot": 0.0}, "steps": 10, "final_time": frame.time(1),
        "parameters": {"m": frame.mass(1), "c": frame.place(1)},
    }  # fmt: skip


def there_and_back(frame: Frame) -> dict[str, Any]:
    return {
        "start": {"x": frame.place(0)}, "goal": {"x": frame.place(0), "x_dot": 0.0},
        "sequence": ["wall"], "steps": 20, "final_time": frame.time(1), "restitution": 0.7,
        "parameters": {"m": frame.mass(1), "c": frame.place(1)},
    }  # fmt: skip


def bounce(frame: Frame) -> dict[str, Any]:
    return {
        "start": {"x": frame.place(0), "y": frame.place(1), "x_dot": frame.speed(1)},
        "goal": {"x": frame.place(1), "y": frame.place(0.6)}, "sequence": ["floor"], "steps": 20,
        "final_time": (frame.time(0.2), frame.time(2)), "restitution": 0.8,
        "parameters": parameters(frame, c=frame.place(0)),
    }  # fmt: skip


def pushed(frame: Frame) -> dict[str, Any]:
    return {
        "start": {"x": frame.place(0), "y": frame.place(0)},
        "goal": {"x": frame.place(0.4), "x_dot": 0.0}, "contacts": ["floor:stick"],
        "sequence": ["floor:slip+", "floor:stick"], "steps": 16, "final_time": frame.time(1),
        "parameters": parameters(frame, c=frame.place(0)),
    }  # fmt: skip


def leaning(frame: Frame) -> dict[str, Any]:
    here = {"x": frame.place(0), "y": frame.place(0), "b": frame.place(0)}
    return {
        "start": here, "contacts": ["floor:stick", "side"], "steps": 10,
        "final_time": frame.time(1),
        "parameters": parameters(frame, c=frame.place(0), push=frame.force(0.024)),
    }  # fmt: skip


def shoved(frame: Frame) -> dict[str, Any]:
    """The finger, whose own mass changes its force, pushes the block along."""
    return {
        "start": {"x": frame.place(0), "y": frame.place(0), "b": frame.place(0)},
        "goal": {"x": frame.place(0.2), "x_dot": 0.0}, "contacts": ["floor:slip+", "side"],
        "steps": 20, "final_time": frame.time(1),
        "parameters": parameters(frame, c=frame.place(0), push=frame.force(0.024)),
    }  # fmt: skip


def swung(frame: Frame) -> dict[str, Any]:
    return {
        "start": {"x": frame.place(0), "a": 0.0},
        "goal": {"x": frame.place(0.5), "x_dot": 0.0, "a": 0.0, "a_dot": 0.0},
        "contacts": ["rail:slip+"], "steps": 40, "final_time": frame.time(1.5),
        "parameters": parameters(frame, l=frame.length(0.5), push=frame.force(0.5)),
    }  # fmt: skip


def slides_down(frame: Frame) -> dict[str, Any]:
    """From 60 degrees, at rest."""
    angle = float(sp.pi / 3)
    place = {"x": frame.place(float(sp.cos(angle))), "y": frame.place(float(sp.sin(angle)))}
    return {
        "start": {**place, "a": angle}, "contacts": ["floor", "wall"], "steps": 30,
        "goal": {"a": angle - 0.3}, "final_time": frame.time(0.6),
        "parameters": parameters(frame, l=frame.length(1), c=frame.place(0)),
    }  # fmt: skip


def seed(frame: Frame) -> dict[str, Any]:
    force = frame.force(200)
    return {
        "start": {"alpha": 0.471, "x": frame.place(0)},
        "goal": {"alpha": 1.5707, "p_alpha": 0.0, "p_x": 0.0}, "sequence": ["lower"], "steps": 100,
        "final_time": (None, frame.time(1)), "bounds": {"F": (-force, force)},
        "parameters": {
            "m_p": frame.mass(1), "m_c": frame.mass(1), "l": frame.length(0.5),
            "g": frame.acceleration(10),
        },
    }  # fmt: skip


KINDS = {
    "block at rest": FramedProblem(floor_system, at_rest),
    "hopper at rest": FramedProblem(hopper_system, hopper_at_rest),
    "held pendulum": FramedProblem(pendulum_system, held),
    "mass at rest": FramedProblem(free_system, idle),
    "block and wall": FramedProblem(free_system, there_and_back),
    "ball": FramedProblem(ball_system, bounce),
    "block that sticks and slides": FramedProblem(floor_system, pushed),
    "finger that leans": FramedProblem(finger_system, leaning),
    "finger that pushes": FramedProblem(finger_system, shoved),
    "pole on a rail": FramedProblem(pole_system, swung),
    "ladder": FramedProblem(ladder_system, slides_down),
    "seed": FramedProblem(cart_system, seed),
}


def tellings(quick: bool = False) -> list[Frame]:
    """The same problem otherwise: shifted, in other units of one kind, and of all."""
    powers = [10.0**k for k in (QUICK if quick else POWERS)]
    frames = [Frame(shift=shift) for shift in SHIFTS]
    frames += [Frame(**{unit: p}) for unit in ("metre", "kilogram", "second") for p in powers]
    return [*frames, Frame(1e3, 1e-6, 1e4), Frame(1e-3, 1e6, 1e-2, 3.0)]


def solutions(kind: FramedProblem, frames: list[Frame]) -> list[tuple[Frame, dmoc.Solution]]:
    """The solutions of a problem in all its tellings."""
    kernels = dmoc.build(kind.system())
    problems = [dmoc.Problem(kernels, **kind.problem(t)) for t in frames]
    return [(t, dmoc.solve(p, "ipm", starts=1)) for t, p in zip(frames, problems, strict=True)]


def invariance(quick: bool) -> Section:
    """A row for each system: its status as it is, and in how many tellings it is the same."""
    section = Section(
        "Other units, other places",
        f"Each problem as it is, and told with a metre, a kilogram or a second of 1e{POWERS[0]} to "
        f"1e{POWERS[-1]} units, all of them changed, and surfaces, start and goal shifted by up to "
        f"{SHIFTS[-1]:g} m (`python benchmarks/invariance.py`).",
        ("problem", "status", "same elsewhere"),
    )
    for name, kind in KINDS.items():
        (_, plain), *others = solutions(kind, tellings(quick))
        same = sum(other.status == plain.status for _, other in others)
        section.row(name, str(plain.status), f"{same} of {len(others)}")
    return section


def main(words: list[str]) -> int:
    """Print every answer of systems whose names have one of these words; 1 where they differ."""
    differ = 0
    for name, kind in KINDS.items():
        if words and not any(word in name for word in words):
            continue
        for frame, solution in solutions(kind, tellings()):
            differ += not solution.solved
            print(f"{name}: {frame}: {solution.status}: {solution.message[:300]}")
    return int(differ > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
