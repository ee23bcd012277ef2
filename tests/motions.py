"""Motions with lasting contact and friction, from closed forms and from SciPy's integrators."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import sympy as sp
from scipy.integrate import solve_ivp
from sympy.physics.mechanics import dynamicsymbols
from systems import block_on_floor, unit_mass

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.mechanics.model import Model
from dmoc.mechanics.model_values import parameter_row
from dmoc.motion.trajectory import Collision, Phase, Trajectory

T = dynamicsymbols._t
TIGHT: dict[str, Any] = {
    "method": "DOP853", "rtol": 1e-12, "atol": 1e-13, "dense_output": True,
}  # fmt: skip
# Columns at times: a function of these, or what does not change.
Function = Callable[[np.ndarray], np.ndarray | tuple[np.ndarray | float, ...]]
Values = Function | float | None


@dataclass(frozen=True)
class Piece:
    """A phase by its states (q | v), inputs, contact and friction forces; what is closed and what
    rubs.  Inputs that are not given are zero."""

    end: float
    state: Function
    u: Values = None
    closed: tuple[str, ...] = ()
    rubbing: Mapping[str, int] = field(default_factory=dict)
    normal: Values = None
    tangential: Values = None


def rows(values: Values, t: np.ndarray, size: int = 0) -> np.ndarray:
    """A row of values at each time; zeros of a size where there are none."""
    at_nodes = values(t) if callable(values) else values
    if at_nodes is None:
        return np.zeros((len(t), size))
    if isinstance(at_nodes, np.ndarray) and at_nodes.ndim == 2:
        return at_nodes
    return columns(*(at_nodes if isinstance(at_nodes, tuple) else (at_nodes,)), like=t)


def columns(*parts: np.ndarray | float, like: np.ndarray | float = 0.0) -> np.ndarray:
    return np.stack(np.broadcast_arrays(*parts, like)[:-1], axis=1).astype(float)


def trajectory(
    kernels: Kernels, pieces: Sequence[Piece], events: Sequence[Mapping[str, object]], steps: int,
    restitution: Mapping[str, float] | None = None,
) -> Trajectory:  # fmt: skip
    """Pieces sampled at the nodes of equal steps, with linear inputs, and what joins them."""
    model = Model(kernels, parameter_row(kernels, {}))
    begins = [0.0, *(piece.end for piece in pieces)]
    phases = []
    for piece, begin in zip(pieces, begins, strict=False):
        t = np.linspace(begin, piece.end, steps + 1)
        q, v = (np.ascontiguousarray(a) for a in np.split(rows(piece.state, t), 2, axis=1))
        phases.append(
            Phase(
                t, q, model.momentum(q, v, t), v, rows(piece.u, t, len(kernels.inputs)),
                piece.closed, piece.rubbing, rows(piece.normal, t), rows(piece.tangential, t),
            )
        )  # fmt: skip
    nothing = {"surface": "", "impulse": 0.0}
    collisions = [
        Collision(
            **{
                **nothing, "time": float(b.t[-1]), "position": b.q[-1],
                "momentum_before": b.p[-1], "momentum_after": a.p[0], **event,
            }  # type: ignore[arg-type]
        )
        for b, a, event in zip(phases, phases[1:], events, strict=False)
    ]  # fmt: skip
    free = np.array([[-np.inf, np.inf]])
    return Trajectory(
        kernels.name, kernels.manifest.fingerprint, tuple(kernels.coordinates),
        tuple(kernels.inputs), {k: v for k, v in kernels.parameters.items() if v is not None},
        tuple(phases), tuple(collisions), "linear", np.repeat(free, len(kernels.inputs), axis=0),
        np.repeat(free, len(kernels.coordinates), axis=0),
        dict.fromkeys(kernels.surfaces, 0.0) | dict(restitution or {}), 2,
    )  # fmt: skip


# A block pushed one metre in four seconds ---------------------------------------------------------


def rail_system() -> dmoc.MechanicalSystem:
    x, u = dynamicsymbols("x u")
    f = sp.Symbol("f")
    return unit_mass(
        "rail", parameters={f: 1.0}, cost=u**2 / 2, tangents={"rail": x}, friction={"rail": f}
    )


def pushed_block(kernels: Kernels, steps: int, on_floor: bool) -> Trajectory:
    """Sticks, slides for sqrt(6) s under a force that falls from 2 N to 0, and sticks."""
    slide, begin = np.sqrt(6.0), (4 - np.sqrt(6.0)) / 2
    name = "floor" if on_floor else "rail"

    def state(t: np.ndarray) -> tuple[np.ndarray | float, ...]:
        s = np.clip((t - begin) / slide, 0, 1)
        x, v = s**2 * (3 - 2 * s), 6 * s * (1 - s) / slide
        return (x, 0, v, 0) if on_floor else (x, v)

    def piece(end: float, sign: int) -> Piece:
        return Piece(
            end, state, lambda t: (2 * (1 - (t - begin) / slide) * abs(sign),),
            ("floor",) if on_floor else (), {name: sign}, 10.0 if on_floor else None, -sign,
        )  # fmt: skip

    pieces = [piece(begin, 0), piece(begin + slide, 1), piece(4.0, 0)]
    return trajectory(kernels, pieces, [{"friction": {name: 1}}, {"friction": {name: 0}}], steps)


# A block that is thrown on a floor ----------------------------------------------------------------


def thrown_block(kernels: Kernels, steps: int, e: float) -> Trajectory:
    """Falls from 0.8 m with 2 m/s along the floor (g = 10, mu = 0.1).  Plastic, it slides on with
    2 - mu 4 m/s and sticks; else it bounces with e 4 m/s."""
    down, along = 4.0, 2 - 0.1 * 4 * (1 + e)

    def flies(t: np.ndarray) -> tuple[np.ndarray | float, ...]:
        s = t - 0.4
        return 0.8 + along * s, e * 4 * s - 5 * s**2, along, e * 4 - 10 * s

    def slides(t: np.ndarray) -> tuple[np.ndarray | float, ...]:
        s = np.minimum(t - 0.4, along)  # it decelerates with 1 m/s^2
        return 0.8 + along * s - s**2 / 2, 0, along - s, 0

    hit = {"surface": "floor", "impulse": (1 + e) * down, "tractions": {"floor": along - 2}}
    first = Piece(0.4, lambda t: (2 * t, 0.8 - 5 * t**2, 2, -10 * t))
    if e > 0:
        return trajectory(kernels, [first, Piece(0.7, flies)], [hit], steps, {"floor": e})
    pieces = [
        Piece(end, slides, None, ("floor",), {"floor": sign}, 10.0, -sign)
        for end, sign in ((0.4 + along, 1), (0.4 + along + 0.5, 0))
    ]
    lands = {**hit, "lands": ("floor",), "friction": {"floor": 1}}
    return trajectory(kernels, [first, *pieces], [lands, {"friction": {"floor": 0}}], steps)


def lowered_block(kernels: Kernels, steps: int) -> Trajectory:
    """A mass that is let down on the floor by a force and arrives without a rate."""
    pieces = [
        Piece(
            1.0, lambda t: (t, (1 - t) ** 2 * (1 + 2 * t), 1, 6 * t * (t - 1)),
            lambda t: (0, 10 + 12 * t - 6),
        ),
        Piece(
            1.5, lambda t: (t - (t - 1) ** 2 / 2, 0, 2 - t, 0), None, ("floor",), {"floor": 1},
            10.0, -1.0,
        ),
    ]  # fmt: skip
    lands = {"surface": "floor", "lands": ("floor",), "friction": {"floor": 1}}
    return trajectory(kernels, pieces, [lands], steps)


def hoist_system() -> dmoc.MechanicalSystem:
    x, y, u, lift = dynamicsymbols("x y u lift")
    block = block_on_floor("hoist", 1.0, 10.0, 0.1)
    return replace(block, inputs=[u, lift], forces={x: u, y: lift})


# A bead that slides off a ball and falls ----------------------------------------------------------


def ball_system() -> dmoc.MechanicalSystem:
    x, y = dynamicsymbols("x y")
    g = sp.Symbol("g")
    return dmoc.MechanicalSystem(
        "bead_on_ball", [x, y], (x.diff(T) ** 2 + y.diff(T) ** 2) / 2 - g * y, {g: 9.81},
        surfaces={"ball": x**2 + y**2 >= 1},
    )  # fmt: skip


def sliding_off(kernels: Kernels, steps: int, leaves_at: float = 2 / 3 * np.cos(0.3)) -> Trajectory:
    """A bead on a ball of radius 1, which it leaves where the cosine of its angle is 2/3 of
    that where it starts; the gradient of the gap has the length 2 there."""
    start = 0.3

    def angle(t: float, z: np.ndarray) -> list[float]:
        return [z[1], 9.81 * np.sin(z[0])]

    def off(t: float, z: np.ndarray) -> float:
        return float(np.cos(z[0]) - leaves_at)

    off.terminal = True  # type: ignore[attr-defined]
    run = solve_ivp(angle, (0, 5), [start, 0.0], events=off, **TIGHT)
    end = float(run.t[-1])

    def on(t: np.ndarray) -> tuple[np.ndarray, ...]:
        a, w = run.sol(t)
        return np.sin(a), np.cos(a), w * np.cos(a), -w * np.sin(a)

    x, y, v, w = on(np.array(end))

    def falls(t: np.ndarray) -> tuple[np.ndarray | float, ...]:
        s = t - end
        return x + v * s, y + w * s - 9.81 * s**2 / 2, v, w - 9.81 * s

    def force(t: np.ndarray) -> tuple[np.ndarray, ...]:
        a, w = run.sol(t)
        return ((9.81 * np.cos(a) - w**2) / 2,)

    pieces = [Piece(end, on, None, ("ball",), {}, force), Piece(end + 0.2, falls)]
    return trajectory(kernels, pieces, [{"leaves": ("ball",)}], steps)


# A bead in a bowl ---------------------------------------------------------------------------------


def bowl_system(room_to_the_right: float = 2.0) -> dmoc.MechanicalSystem:
    x, y = dynamicsymbols("x y")
    g, room = sp.symbols("g room")
    return dmoc.MechanicalSystem(
        "bead_in_bowl", [x, y], (x.diff(T) ** 2 + y.diff(T) ** 2) / 2 - g * y,
        {g: 9.81, room: room_to_the_right},
        surfaces={"bowl": y >= x**2 / 2, "wall": x <= room},
    )  # fmt: skip


def along_bowl(t: float, z: np.ndarray) -> list[float]:
    """x'' = -x (x'^2 + g) / (1 + x^2) in the bowl y = x^2 / 2."""
    return [z[1], -z[0] * (z[1] ** 2 + 9.81) / (1 + z[0] ** 2)]


def in_bowl(end: float, run: Callable[[np.ndarray], np.ndarray]) -> Piece:
    """A part of a motion (x, x') in the bowl, whose force along -grad g is N = y'' + g."""

    def state(t: np.ndarray) -> tuple[np.ndarray, ...]:
        x, v = run(t)
        return x, x**2 / 2, v, x * v

    def force(t: np.ndarray) -> tuple[np.ndarray, ...]:
        x, v = run(t)
        return ((v**2 + 9.81) / (1 + x**2),)

    return Piece(end, state, None, ("bowl",), {}, force)


def swinging_bead(kernels: Kernels, steps: int) -> Trajectory:
    run = solve_ivp(along_bowl, (0, 1.5), [1.0, 0.0], **TIGHT)
    return trajectory(kernels, [in_bowl(1.5, run.sol)], [], steps)


def thrown_back(kernels: Kernels, steps: int, e: float) -> Trajectory:
    """A bead that comes down in the bowl against a wall, which throws it back up: the bowl, from
    which it does not lift, takes an impulse too."""

    def wall(t: float, z: np.ndarray) -> float:
        return float(z[0] + 0.5)

    wall.terminal = True  # type: ignore[attr-defined]
    down = solve_ivp(along_bowl, (0, 2), [-1.0, 0.0], events=wall, **TIGHT)
    end, v = float(down.t[-1]), float(down.y[1, -1])
    up = solve_ivp(along_bowl, (end, end + 0.3), [-0.5, -e * v], **TIGHT)
    change = -(1 + e) * v  # of x', and -0.5 times that of y'
    bowl = -0.5 * change
    impulses = {"wall": -change + 0.5 * bowl, "bowl": bowl}
    hit = {"surface": "wall", "impulse": impulses["wall"], "impulses": impulses}
    pieces = [in_bowl(end, down.sol), in_bowl(end + 0.3, up.sol)]
    return trajectory(kernels, pieces, [hit], steps, {"wall": e})
