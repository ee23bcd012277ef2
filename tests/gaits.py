"""The passive compass gait, by SciPy's integrator."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import sympy as sp
from motions import TIGHT, Piece, rows, trajectory
from scipy.integrate import solve_ivp
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.mechanics.model import Model
from dmoc.mechanics.model_values import parameter_row
from dmoc.motion.trajectory import Trajectory

T = dynamicsymbols._t
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


@cache
def compass_equations() -> tuple[Callable[..., np.ndarray], Callable[..., float]]:
    """Rates of (a, b, a', b') of the gait on a pivot, and what is zero where both feet are on the
    slope."""
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

    return slope, lands


def compass_step() -> tuple[float, Callable[[np.ndarray], np.ndarray]]:
    """One step on a pivot by SciPy: its time, stance and swing (angles, rates, accelerations) as
    functions of time.  The swinging foot passes the height of the ground three times before."""
    slope, lands = compass_equations()
    run = solve_ivp(slope, (0, 0.8), START, events=lands, **TIGHT)

    def motion(t: np.ndarray) -> np.ndarray:
        z = run.sol(t).T
        return np.hstack([z, np.array([slope(0.0, row)[2:] for row in z])])

    return float(run.t_events[0][-1]), motion


def compass_map(state: np.ndarray) -> np.ndarray:
    """The stance angle and both rates after the next landing, from those after one, by SciPy: the
    momenta about the foot that lands and, of the leg behind, about the hip are kept."""
    slope, lands = compass_equations()
    start = [state[0], 2 * SLOPE - state[0], *state[1:]]
    run = solve_ivp(slope, (0, 0.9), start, events=lands, **TIGHT)
    a, b, *before = run.y_events[0][-1]

    def about(legs: tuple[float, float], rates: np.ndarray, foot: np.ndarray) -> np.ndarray:
        """Momenta of all about a foot, and of each leg about the hip."""
        (a, b), (u, w) = legs, rates
        hip, turned = np.array([np.sin(a), np.cos(a)]), np.array([np.cos(a), -np.sin(a)]) * u
        leg = np.array([np.sin(b), np.cos(b)]), np.array([np.cos(b), -np.sin(b)]) * w
        bodies = [(10, hip, turned), (5, hip / 2, turned / 2),
                  (5, hip - leg[0] / 2, turned - leg[1] / 2)]  # fmt: skip
        sums = [sum(m * np.linalg.det([r - foot, v]) for m, r, v in bodies)]
        return np.array([*sums, *(m * np.linalg.det([r - hip, v]) for m, r, v in bodies[1:])])

    foot = np.array([np.sin(a) - np.sin(b), np.cos(a) - np.cos(b)])
    kept = about((a, b), np.array(before), foot)[[0, 1]]
    units = np.array([about((b, a), unit, np.zeros(2))[[0, 2]] for unit in np.eye(2)])
    return np.array([b, *np.linalg.solve(units.T, kept)])


def gait(kernels: Kernels, steps: int) -> Trajectory:
    """Two steps, on the left foot and on the right one."""
    period, motion = compass_step()
    c, s = np.cos(SLOPE), np.sin(SLOPE)

    def piece(number: int) -> Piece:
        begin, swap = number * period, number == 1
        foot = number * STEP * np.array([c, -s])

        def state(t: np.ndarray) -> tuple[np.ndarray, ...]:
            a, b, da, db, _, _ = motion(t - begin).T
            hip = foot[0] + np.sin(a), foot[1] + np.cos(a)
            rates = np.cos(a) * da, -np.sin(a) * da
            angles = [b, a, db, da] if swap else [a, b, da, db]
            return *hip, *angles[:2], *rates, *angles[2:]

        def force(t: np.ndarray) -> np.ndarray:
            """Of the ground on all bodies, along and across the slope."""
            a, b, da, db, aa, ab = motion(t - begin).T
            hip, leg = (
                np.array([np.cos(x) * ax - np.sin(x) * dx**2, -np.sin(x) * ax - np.cos(x) * dx**2])
                for x, dx, ax in ((a, da, aa), (b, db, ab))
            )
            total = 10 * hip + 5 * hip / 2 + 5 * (hip - leg / 2)
            total[1] += 20 * 9.81
            return np.stack([total[0] * c - total[1] * s, total[0] * s + total[1] * c], axis=1)

        name = "right" if swap else "left"
        return Piece(
            begin + period, state, None, (name,), {name: 0}, lambda t: force(t)[:, 1:],
            lambda t: force(t)[:, :1],
        )  # fmt: skip

    pieces = [piece(0), piece(1)]
    model = Model(kernels, parameter_row(kernels, {}))
    before, after = (np.split(rows(p.state, np.array([period]))[0], 2) for p in pieces)
    change = model.momentum(*after) - model.momentum(*before)
    impulse = float(change[0] * s + change[1] * c)
    landing = {
        "surface": "right", "lands": ("right",), "leaves": ("left",), "friction": {"right": 0},
        "impulse": impulse, "impulses": {"right": impulse},
        "tractions": {"right": float(change[0] * c - change[1] * s)},
    }  # fmt: skip
    return trajectory(kernels, pieces, [landing], steps)
