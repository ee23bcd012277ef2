"""An event-driven simulation that shares no code with dmoc: equations of motion by SymPy, events by
SciPy's DOP853, an own law of impact.

M q'' = F(q, q', u, t) with M = d^2 L/dq'^2 and F = Q + dL/dq - (d^2 L/dq' dq) q' - d^2 L/dq' dt.  A
surface is a gap g(q, t) <= 0 with the normal n = dg/dq and the speed of approach w = n . q' +
dg/dt; an impact is the impulse -lam n with lam = (1 + e) w / (n . M^-1 n), so that w becomes -e w.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import sympy as sp
from scipy.integrate import solve_ivp
from sympy.physics.mechanics import dynamicsymbols

RELATIVE, ABSOLUTE = 1e-9, 1e-11  # far below the errors of the discretisation
BETWEEN = np.linspace(0.0, 1.0, 9)  # where in a step penetration is looked for
MOST_IMPACTS = 50

Inputs = tuple[
    np.ndarray, np.ndarray, np.ndarray
]  # times of the nodes, inputs at the start and at the end of each step: linear in between


@dataclass(frozen=True)
class Description:
    """A mechanical system in SymPy's terms alone: what dmoc and the simulation are given."""

    name: str
    coordinates: Sequence[Any]
    inputs: Sequence[Any]
    lagrangian: Any
    forces: Mapping[Any, Any]
    surfaces: Mapping[str, Any]
    parameters: Mapping[Any, float]
    tangents: Mapping[str, Any] = field(default_factory=dict)
    friction: Mapping[str, Any] = field(default_factory=dict)
    path_constraints: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Impact:
    surface: str
    time: float
    approach: float
    impulse: float


@dataclass
class Flight:
    """What a simulation met: the state at its end, impacts, and the largest gap of each surface
    on the way."""

    q: np.ndarray
    v: np.ndarray
    impacts: list[Impact] = field(default_factory=list)
    deepest: float = -np.inf


class Mechanism:
    """Numeric equations of motion and gaps of a description; ``par`` is the row of parameter
    values in its order."""

    def __init__(self, given: Description) -> None:
        t = dynamicsymbols._t
        rates = [c.diff(t) for c in given.coordinates]
        q, v, u = (
            sp.symbols(f"{letter}:{n}")
            for letter, n in (("q_", len(rates)), ("v_", len(rates)), ("u_", len(given.inputs)))
        )
        tau = sp.Symbol("tau_time")

        def plain(expression: Any) -> Any:
            e = sp.sympify(expression).subs(dict(zip(rates, v, strict=True)))
            return e.subs(
                dict(zip([*given.coordinates, *given.inputs], [*q, *u], strict=True))
            ).subs(t, tau)

        lagrangian = plain(given.lagrangian)
        momenta = sp.Matrix([lagrangian.diff(s) for s in v])
        Q = sp.Matrix([plain(given.forces.get(c, 0)) for c in given.coordinates])
        force = (
            Q
            + sp.Matrix([lagrangian.diff(s) for s in q])
            - momenta.jacobian(q) * sp.Matrix(v)
            - momenta.diff(tau)
        )
        self.surfaces = list(given.surfaces)
        gaps = [plain(r.lts - r.gts) for r in given.surfaces.values()]
        slopes = [g.diff(s) for g in gaps for s in q]
        par = list(given.parameters)
        state = [*q, *v, *u, tau, *par]
        self.nq = len(rates)
        self._motion = _numeric(state, [*momenta.jacobian(v), *force])
        self._momenta = _numeric(state, list(momenta))
        self._gaps = _numeric([*q, tau, *par], gaps)
        self._slopes = _numeric([*q, tau, *par], [*slopes, *(g.diff(tau) for g in gaps)])

    def motion(
        self, q: np.ndarray, v: np.ndarray, u: np.ndarray, t: float, par: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Mass matrix and force."""
        values = np.array(self._motion(*q, *v, *u, t, *par), dtype=float)
        return values[: self.nq**2].reshape(self.nq, self.nq), values[self.nq**2 :]

    def velocity(
        self, q: np.ndarray, p: np.ndarray, u: np.ndarray, t: float, par: np.ndarray
    ) -> np.ndarray:
        """Velocity of a momentum; p = M v + what the Lagrangian has linear in v."""
        rest = np.zeros(self.nq)
        offset = np.array(self._momenta(*q, *rest, *u, t, *par), dtype=float)
        return np.linalg.solve(self.motion(q, rest, u, t, par)[0], p - offset)

    def gaps(self, q: np.ndarray, t: float, par: np.ndarray) -> np.ndarray:
        return np.array(self._gaps(*q, t, *par), dtype=float)

    def approach(
        self, j: int, q: np.ndarray, v: np.ndarray, t: float, par: np.ndarray
    ) -> tuple[np.ndarray, float]:
        """Normal of a surface and speed of approach to it."""
        values = np.array(self._slopes(*q, t, *par), dtype=float)
        n = values[: len(self.surfaces) * self.nq].reshape(-1, self.nq)[j]
        return n, float(n @ v + values[len(self.surfaces) * self.nq + j])

    def impact(
        self,
        j: int,
        q: np.ndarray,
        v: np.ndarray,
        u: np.ndarray,
        t: float,
        par: np.ndarray,
        e: float,
    ) -> tuple[np.ndarray, Impact]:
        """Velocity after an impact."""
        n, w = self.approach(j, q, v, t, par)
        back = np.linalg.solve(self.motion(q, v, u, t, par)[0], n)
        lam = (1 + e) * w / float(n @ back)
        return v - lam * back, Impact(self.surfaces[j], t, w, lam)

    def fly(
        self,
        inputs: Inputs,
        begin: float,
        end: float,
        q: np.ndarray,
        v: np.ndarray,
        par: np.ndarray,
        restitution: Sequence[float] | None = None,
        least: float = 0.0,
    ) -> Flight:
        """Simulate from one time to another, through the impacts that approach faster than
        ``least``, a speed in the metric of M.

        Without coefficients of restitution nothing is hit: the motion passes through the surfaces,
        and the largest gap shows how far.
        """
        flight = Flight(np.array(q, dtype=float), np.array(v, dtype=float))
        nodes, first, last = inputs
        for k in range(len(first)):
            a, b = max(nodes[k], begin), min(nodes[k + 1], end)
            while b - a > 1e-12 * max(abs(end), 1.0):

                def u(t: float, k: int = k) -> np.ndarray:
                    s = (t - nodes[k]) / (nodes[k + 1] - nodes[k])
                    return (1 - s) * first[k] + s * last[k]

                a = self._step(u, a, b, flight, par, restitution, least)
        return flight

    def _step(
        self,
        u: Callable[[float], np.ndarray],
        a: float,
        b: float,
        flight: Flight,
        par: np.ndarray,
        restitution: Sequence[float] | None,
        least: float,
    ) -> float:
        """Simulate smooth inputs from a to b, or to the first impact; return the time that is
        reached."""

        def rate(t: float, y: np.ndarray) -> np.ndarray:
            M, F = self.motion(y[: self.nq], y[self.nq :], u(t), t, par)
            return np.concatenate([y[self.nq :], np.linalg.solve(M, F)])

        def gap(j: int) -> Callable[[float, np.ndarray], float]:
            def event(t: float, y: np.ndarray) -> float:
                return float(self.gaps(y[: self.nq], t, par)[j])

            event.direction = 1.0  # type: ignore[attr-defined]
            return event

        start = np.concatenate([flight.q, flight.v])
        events = [] if restitution is None else [gap(j) for j in range(len(self.surfaces))]
        atol = ABSOLUTE * max(1.0, float(np.abs(start).max()))
        run = solve_ivp(
            rate,
            (a, b),
            start,
            method="DOP853",
            rtol=RELATIVE,
            atol=atol,
            events=events,
            dense_output=True,
        )
        if not run.success:
            raise ArithmeticError(run.message)
        met = sorted((t, j) for j in range(len(events)) for t in run.t_events[j])
        stop, hit = b, None
        for t, j in met:
            y = run.sol(t)
            n, w = self.approach(j, y[: self.nq], y[self.nq :], t, par)
            if w > least * np.sqrt(
                float(
                    n @ np.linalg.solve(self.motion(y[: self.nq], y[self.nq :], u(t), t, par)[0], n)
                )
            ):
                stop, hit = t, j
                break
        for t in a + (stop - a) * BETWEEN:
            flight.deepest = max(
                flight.deepest, float(self.gaps(run.sol(t)[: self.nq], t, par).max())
            )
        y = run.sol(stop)
        flight.q, flight.v = y[: self.nq], y[self.nq :]
        if hit is not None and restitution is not None:
            flight.v, impact = self.impact(
                hit, flight.q, flight.v, u(stop), stop, par, restitution[hit]
            )
            flight.impacts.append(impact)
            if len(flight.impacts) > MOST_IMPACTS:
                raise ArithmeticError("impacts accumulate")
        return float(stop)


def _numeric(arguments: list[Any], results: list[Any]) -> Callable[..., list[float]]:
    function: Callable[..., list[float]] = sp.lambdify(arguments, results, modules="math", cse=True)
    return function
