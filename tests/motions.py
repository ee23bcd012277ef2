"""Motions with lasting contact and friction, from closed forms and from SciPy's integrators."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import sympy as sp
from scipy.integrate import solve_ivp
from sympy.physics.mechanics import dynamicsymbols
from systems import unit_mass

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.mechanics.model import Model
from dmoc.mechanics.model_values import parameter_row
from dmoc.motion.trajectory import Collision, Phase, Trajectory

T = dynamicsymbols._t
Function = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Piece:
    """A phase as functions of time: states (q | v), inputs, contact and friction forces, each of
    shape (n, size); what is closed and what rubs."""

    end: float
    state: Function
    u: Function
    closed: tuple[str, ...] = ()
    rubbing: Mapping[str, int] = field(default_factory=dict)
    normal: Function | None = None
    tangential: Function | None = None


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
        q, v = np.split(piece.state(t), 2, axis=1)
        none = np.zeros((steps + 1, 0))
        phases.append(
            Phase(
                t, np.ascontiguousarray(q), model.momentum(np.ascontiguousarray(q), v, t),
                np.ascontiguousarray(v), piece.u(t), piece.closed, piece.rubbing,
                none if piece.normal is None else piece.normal(t),
                none if piece.tangential is None else piece.tangential(t),
            )
        )  # fmt: skip
    collisions = [
        Collision(
            **{  # type: ignore[arg-type]
                "surface": "",
                "time": float(b.t[-1]),
                "position": b.q[-1],
                "impulse": 0.0,
                "momentum_before": b.p[-1],
                "momentum_after": a.p[0],
                **event,
            }
        )
        for b, a, event in zip(phases, phases[1:], events, strict=False)
    ]
    free = np.tile([-np.inf, np.inf], (len(kernels.coordinates), 1))
    return Trajectory(
        kernels.name, kernels.manifest["fingerprint"], tuple(kernels.coordinates),
        tuple(kernels.inputs), {k: v for k, v in kernels.parameters.items() if v is not None},
        tuple(phases), tuple(collisions), "linear",
        np.tile([-np.inf, np.inf], (len(kernels.inputs), 1)), free,
        dict.fromkeys(kernels.surfaces, 0.0) | dict(restitution or {}), 2,
    )  # fmt: skip


def columns(*parts: np.ndarray | float) -> np.ndarray:
    return np.stack(np.broadcast_arrays(*parts), axis=1).astype(float)


# A block pushed one metre in four seconds ---------------------------------------------------------


def rail_system() -> dmoc.MechanicalSystem:
    x, u = dynamicsymbols("x u")
    return unit_mass(
        "rail",
        parameters={sp.Symbol("f"): 1.0},
        cost=u**2 / 2,
        tangents={"rail": x},
        friction={"rail": sp.Symbol("f")},
    )


def floor_system() -> dmoc.MechanicalSystem:
    x, y, u = dynamicsymbols("x y u")
    g, mu = sp.symbols("g mu")
    return dmoc.MechanicalSystem(
        "floor", [x, y], (x.diff(T) ** 2 + y.diff(T) ** 2) / 2 - g * y, {g: 10.0, mu: 0.1},
        inputs=[u], forces={x: u}, surfaces={"floor": y >= 0}, tangents={"floor": x},
        friction={"floor": mu}, cost=u**2 / 2,
    )  # fmt: skip


def pushed_block(kernels: Kernels, steps: int, on_floor: bool) -> Trajectory:
    """Sticks, slides for sqrt(6) s under a force that falls from 2 N to 0, and sticks."""
    slide, begin = np.sqrt(6.0), (4 - np.sqrt(6.0)) / 2
    name = "floor" if on_floor else "rail"

    def state(t: np.ndarray) -> np.ndarray:
        s = np.clip((t - begin) / slide, 0, 1)
        x, v = s**2 * (3 - 2 * s), 6 * s * (1 - s) / slide
        return columns(x, 0, v, 0) if on_floor else columns(x, v)

    def piece(end: float, sign: int) -> Piece:
        return Piece(
            end, state, lambda t: columns(2 * (1 - (t - begin) / slide) * abs(sign)),
            ("floor",) if on_floor else (), {name: sign},
            (lambda t: np.full((len(t), 1), 10.0)) if on_floor else None,
            lambda t: np.full((len(t), 1), -float(sign)),
        )  # fmt: skip

    pieces = [piece(begin, 0), piece(begin + slide, 1), piece(4.0, 0)]
    return trajectory(kernels, pieces, [{"friction": {name: 1}}, {"friction": {name: 0}}], steps)


# A block that is thrown on a floor ----------------------------------------------------------------


def thrown_block(kernels: Kernels, steps: int, e: float) -> Trajectory:
    """Falls from 0.8 m with 2 m/s along the floor (g = 10, mu = 0.1).  Plastic, it slides on with
    2 - mu 4 m/s and sticks; else it bounces with e 4 m/s."""
    down, along = 4.0, 2 - 0.1 * 4 * (1 + e)

    def falls(t: np.ndarray) -> np.ndarray:
        return columns(2 * t, 0.8 - 5 * t**2, 2, -10 * t)

    def flies(t: np.ndarray) -> np.ndarray:
        s = t - 0.4
        return columns(0.8 + along * s, e * 4 * s - 5 * s**2, along, e * 4 - 10 * s)

    def slides(t: np.ndarray) -> np.ndarray:
        s = np.minimum(t - 0.4, along)  # it decelerates with 1 m/s^2
        return columns(0.8 + along * s - s**2 / 2, 0, along - s, 0)

    def idle(t: np.ndarray) -> np.ndarray:
        return np.zeros((len(t), 1))

    def constant(force: float) -> Function:
        return lambda t: np.full((len(t), 1), force)

    hit = {"surface": "floor", "impulse": (1 + e) * down, "tractions": {"floor": along - 2}}
    first = Piece(0.4, falls, idle)
    if e > 0:
        return trajectory(kernels, [first, Piece(0.7, flies, idle)], [hit], steps, {"floor": e})
    pieces = [
        Piece(end, slides, idle, ("floor",), {"floor": sign}, constant(10), constant(-1.0 * sign))
        for end, sign in ((0.4 + along, 1), (0.4 + along + 0.5, 0))
    ]
    lands = {**hit, "lands": ("floor",), "friction": {"floor": 1}}
    return trajectory(kernels, [first, *pieces], [lands, {"friction": {"floor": 0}}], steps)


def lowered_block(kernels: Kernels, steps: int) -> Trajectory:
    """A mass that is let down on the floor by a force and arrives without a rate."""

    def lowers(t: np.ndarray) -> np.ndarray:
        return columns(t, (1 - t) ** 2 * (1 + 2 * t), 1, 6 * t * (t - 1))

    def rests(t: np.ndarray) -> np.ndarray:
        return columns(t - (t - 1) ** 2 / 2, 0, 2 - t, 0)

    def lift(t: np.ndarray) -> np.ndarray:
        return columns(0, 10 + 12 * t - 6)

    pieces = [
        Piece(1.0, lowers, lift),
        Piece(1.5, rests, lambda t: columns(0 * t, 0), ("floor",), {"floor": 1},
              lambda t: np.full((len(t), 1), 10.0), lambda t: np.full((len(t), 1), -1.0)),
    ]  # fmt: skip
    lands = {"surface": "floor", "lands": ("floor",), "friction": {"floor": 1}}
    return trajectory(kernels, pieces, [lands], steps)


def hoist_system() -> dmoc.MechanicalSystem:
    x, y, u, lift = dynamicsymbols("x y u lift")
    g, mu = sp.symbols("g mu")
    return dmoc.MechanicalSystem(
        "hoist", [x, y], (x.diff(T) ** 2 + y.diff(T) ** 2) / 2 - g * y, {g: 10.0, mu: 0.1},
        inputs=[u, lift], forces={x: u, y: lift}, surfaces={"floor": y >= 0},
        tangents={"floor": x}, friction={"floor": mu},
    )  # fmt: skip


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
    run = solve_ivp(
        angle, (0, 5), [start, 0.0], "DOP853", events=off, rtol=1e-12, atol=1e-13,
        dense_output=True,
    )  # fmt: skip
    end = float(run.t[-1])

    def on(t: np.ndarray) -> np.ndarray:
        a, w = run.sol(t)
        return columns(np.sin(a), np.cos(a), w * np.cos(a), -w * np.sin(a))

    (x, y, v, w), fall = on(np.array([end]))[0], 9.81

    def falls(t: np.ndarray) -> np.ndarray:
        s = t - end
        return columns(x + v * s, y + w * s - fall * s**2 / 2, v, w - fall * s)

    def force(t: np.ndarray) -> np.ndarray:
        a, w = run.sol(t)
        return columns((9.81 * np.cos(a) - w**2) / 2)

    def none(t: np.ndarray) -> np.ndarray:
        return np.zeros((len(t), 0))

    pieces = [Piece(end, on, none, ("ball",), {}, force), Piece(end + 0.2, falls, none)]
    return trajectory(kernels, pieces, [{"leaves": ("ball",)}], steps)


# The passive compass gait -------------------------------------------------------------------------

SLOPE, FOOT = np.radians(3.0), 0.2186688 + np.radians(3.0)
STEP = 2 * np.sin(FOOT)
START = (-0.2186688, 0.2186688 + 2 * np.radians(3.0), 1.09238359, 0.37737395)


def compass_system() -> dmoc.MechanicalSystem:
    """Two legs of 1 m with 5 kg in their middles and 10 kg at the hip (x, y), on a slope.  Each
    foot has stepping stones of its own, for in the plane it cannot pass the other leg above the
    ground."""
    x, y, a, b = q = dynamicsymbols("x y a b")
    mu = sp.Symbol("mu")
    hip = sp.Matrix([x, y])

    def along(leg: sp.Expr, share: float) -> sp.Matrix:
        return hip - share * sp.Matrix([sp.sin(leg), sp.cos(leg)])

    bodies = [(10, hip), (5, along(a, 0.5)), (5, along(b, 0.5))]
    kinetic = sum(m * place.diff(T).dot(place.diff(T)) / 2 for m, place in bodies)
    potential = sum(m * 9.81 * place[1] for m, place in bodies)
    c, s = float(np.cos(SLOPE)), float(np.sin(SLOPE))
    places = {
        name: (along(leg, 1)[0] * c - along(leg, 1)[1] * s,
               along(leg, 1)[0] * s + along(leg, 1)[1] * c, shift)
        for name, leg, shift in (("left", a, 0), ("right", b, 1))
    }  # fmt: skip
    return dmoc.MechanicalSystem(
        "compass", q, kinetic - potential, {mu: 2.0},
        surfaces={
            name: height + sp.sin(sp.pi * (place / STEP - shift) / 2) ** 2 / 5 >= 0
            for name, (place, height, shift) in places.items()
        },
        tangents={name: place for name, (place, _, _) in places.items()},
        friction={"left": mu, "right": mu},
    )  # fmt: skip


def compass_step() -> tuple[float, Function]:
    """One step on a pivot by SciPy: its time, stance and swing (angles, rates, accelerations) as
    functions of time.  The swinging foot passes the height of the ground three times before."""
    a, b = dynamicsymbols("a b")
    hip = sp.Matrix([sp.sin(a), sp.cos(a)])
    bodies = [(10, hip), (5, hip / 2), (5, hip - sp.Matrix([sp.sin(b), sp.cos(b)]) / 2)]
    lagrangian = sum(m * (r.diff(T).dot(r.diff(T)) / 2 - 9.81 * r[1]) for m, r in bodies)
    v = [a.diff(T), b.diff(T)]
    momenta = sp.Matrix([lagrangian.diff(rate) for rate in v])
    accelerations = [rate.diff(T) for rate in v]
    balance = momenta.diff(T) - sp.Matrix([lagrangian.diff(c) for c in (a, b)])
    M = balance.jacobian(accelerations)
    rest = balance.subs(dict.fromkeys(accelerations, 0))
    at = sp.symbols("a_ b_ da_ db_")
    names = dict(zip([*v, a, b], [at[2], at[3], at[0], at[1]], strict=True))
    f = sp.lambdify(at, [M.subs(names), rest.subs(names)], "numpy")

    def slope(t: float, z: np.ndarray) -> np.ndarray:
        mass, right = f(*z)
        return np.concatenate([z[2:], -np.linalg.solve(mass, np.ravel(right))])

    def lands(t: float, z: np.ndarray) -> float:
        return float(z[0] + z[1] - 2 * SLOPE)

    run = solve_ivp(
        slope, (0, 0.8), START, "DOP853", events=lands, rtol=1e-12, atol=1e-13, dense_output=True
    )

    def motion(t: np.ndarray) -> np.ndarray:
        z = run.sol(t).T
        return np.hstack([z, np.array([slope(0.0, row)[2:] for row in z])])

    end = float(run.t_events[0][-1])
    return end, motion


def gait(kernels: Kernels, steps: int) -> Trajectory:
    """Two steps, on the left foot and on the right one."""
    period, motion = compass_step()

    def piece(number: int) -> Piece:
        begin, swap = number * period, number == 1
        foot = number * STEP * np.array([np.cos(SLOPE), -np.sin(SLOPE)])

        def state(t: np.ndarray) -> np.ndarray:
            a, b, da, db, _, _ = motion(t - begin).T
            hip = [foot[0] + np.sin(a), foot[1] + np.cos(a)]
            rates = [np.cos(a) * da, -np.sin(a) * da]
            angles = [b, a, db, da] if swap else [a, b, da, db]
            return columns(*hip, *angles[:2], *rates, *angles[2:])

        def force(t: np.ndarray) -> np.ndarray:
            """Of the ground on all bodies, along and across the slope."""
            a, b, da, db, aa, ab = motion(t - begin).T
            hip = np.array(
                [np.cos(a) * aa - np.sin(a) * da**2, -np.sin(a) * aa - np.cos(a) * da**2]
            )
            leg = np.array(
                [np.cos(b) * ab - np.sin(b) * db**2, -np.sin(b) * ab - np.cos(b) * db**2]
            )
            total = 10 * hip + 5 * hip / 2 + 5 * (hip - leg / 2)
            total[1] += 20 * 9.81
            c, s = np.cos(SLOPE), np.sin(SLOPE)
            return columns(total[0] * c - total[1] * s, total[0] * s + total[1] * c)

        name = "right" if swap else "left"
        none = np.zeros((steps + 1, 0))
        return Piece(
            begin + period, state, lambda t: none, (name,), {name: 0},
            lambda t: force(t)[:, 1:], lambda t: force(t)[:, :1],
        )  # fmt: skip

    pieces = [piece(0), piece(1)]
    model = Model(kernels, parameter_row(kernels, {}))
    at = np.array([period])
    before, after = (np.split(p.state(at)[0], 2) for p in pieces)
    change = model.momentum(*after) - model.momentum(*before)
    c, s = np.cos(SLOPE), np.sin(SLOPE)
    impulse = float(change[0] * s + change[1] * c)
    landing = {
        "surface": "right", "lands": ("right",), "leaves": ("left",), "friction": {"right": 0},
        "impulse": impulse, "impulses": {"right": impulse},
        "tractions": {"right": float(change[0] * c - change[1] * s)},
    }  # fmt: skip
    return trajectory(kernels, pieces, [landing], steps)


# A bead in a bowl ---------------------------------------------------------------------------------


def bowl_system(room_to_the_right: float = 2.0) -> dmoc.MechanicalSystem:
    x, y = dynamicsymbols("x y")
    g, room = sp.symbols("g room")
    return dmoc.MechanicalSystem(
        "bead_in_bowl", [x, y], (x.diff(T) ** 2 + y.diff(T) ** 2) / 2 - g * y,
        {g: 9.81, room: room_to_the_right},
        surfaces={"bowl": y >= x**2 / 2, "wall": x <= room},
    )  # fmt: skip


def swinging_bead(kernels: Kernels, steps: int) -> Trajectory:
    """A bead in the bowl y = x^2 / 2: x'' = -x (x'^2 + g) / (1 + x^2), and N = y'' + g."""

    def slope(t: float, z: np.ndarray) -> list[float]:
        return [z[1], -z[0] * (z[1] ** 2 + 9.81) / (1 + z[0] ** 2)]

    run = solve_ivp(
        slope, (0, 1.5), [1.0, 0.0], "DOP853", rtol=1e-12, atol=1e-13, dense_output=True
    )

    def state(t: np.ndarray) -> np.ndarray:
        x, v = run.sol(t)
        return columns(x, x**2 / 2, v, x * v)

    def force(t: np.ndarray) -> np.ndarray:
        x, v = run.sol(t)
        return columns(v**2 + 9.81 - x**2 * (v**2 + 9.81) / (1 + x**2))

    def none(t: np.ndarray) -> np.ndarray:
        return np.zeros((len(t), 0))

    return trajectory(kernels, [Piece(1.5, state, none, ("bowl",), {}, force)], [], steps)


def thrown_back(kernels: Kernels, steps: int, e: float) -> Trajectory:
    """A bead that comes down in the bowl against a wall, which throws it back up: the bowl, from
    which it does not lift, takes an impulse too."""

    def slope(t: float, z: np.ndarray) -> list[float]:
        return [z[1], -z[0] * (z[1] ** 2 + 9.81) / (1 + z[0] ** 2)]

    def wall(t: float, z: np.ndarray) -> float:
        return float(z[0] + 0.5)

    wall.terminal = True  # type: ignore[attr-defined]
    kept = {"rtol": 1e-12, "atol": 1e-13, "dense_output": True}
    down = solve_ivp(slope, (0, 2), [-1.0, 0.0], "DOP853", events=wall, **kept)
    end, v = float(down.t[-1]), float(down.y[1, -1])
    up = solve_ivp(slope, (end, end + 0.3), [-0.5, -e * v], "DOP853", **kept)

    def piece(end: float, run: Function) -> Piece:
        def state(t: np.ndarray) -> np.ndarray:
            x, v = run(t)
            return columns(x, x**2 / 2, v, x * v)

        def force(t: np.ndarray) -> np.ndarray:
            x, v = run(t)
            return columns((v**2 + 9.81) / (1 + x**2))

        return Piece(end, state, lambda t: np.zeros((len(t), 0)), ("bowl",), {}, force)

    change = -(1 + e) * v  # of x', and -0.5 times that of y'
    bowl = -0.5 * change
    impulses = {"wall": -change + 0.5 * bowl, "bowl": bowl}
    hit = {"surface": "wall", "impulse": impulses["wall"], "impulses": impulses}
    pieces = [piece(end, down.sol), piece(end + 0.3, up.sol)]
    return trajectory(kernels, pieces, [hit], steps, {"wall": e})
