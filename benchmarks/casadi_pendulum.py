"""The reference problem as a user of CasADi would write it: midpoint variational integrator,
elastic collisions, IPOPT.

Written from the equations of Kern & Gross (2018), independently of dmoc's own derivation.
Durations T_i are unknowns, the limiters are bounds of the angle.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from common import clocked

HALF = 0.5


@dataclass(frozen=True)
class PendulumCase:
    """Data of one instance: parameters, start angle, bounds of force and final time, steps of
    each phase, sequence of limiters."""

    m_p: float = 1.0
    m_c: float = 1.0
    l: float = 0.5
    g: float = 10.0
    alpha: float = 0.5
    force: float = 200.0
    final_time: float = 1.0
    steps: int = 100
    sequence: tuple[str, ...] = ("lower",)
    lower: float = np.pi / 10
    upper: float = 9 * np.pi / 10


def step_function(case: PendulumCase) -> ca.Function:
    """Momenta at both ends of a step, discrete energies at both ends and cost, as functions of
    (q_k, q_kp1, u, h)."""
    a, b, u, h = ca.SX.sym("a", 2), ca.SX.sym("b", 2), ca.SX.sym("u"), ca.SX.sym("h")
    q, v = (a + b) / 2, (b - a) / h
    kinetic = HALF * (case.m_p + case.m_c) * v[1] ** 2 + HALF * case.m_p * case.l**2 * v[0] ** 2
    kinetic -= case.m_p * case.l * ca.sin(q[0]) * v[0] * v[1]
    L_d = h * (kinetic - case.m_p * case.g * case.l * ca.sin(q[0]))
    force = ca.vertcat(0, u)
    r_minus = ca.gradient(L_d, a) + h / 2 * force
    r_plus = ca.gradient(L_d, b) + h / 2 * force
    rate = ca.gradient(L_d, h)
    e_plus, e_minus = rate - h / 2 * ca.dot(force, v), rate + h / 2 * ca.dot(force, v)
    return ca.Function("step", [a, b, u, h], [r_minus, r_plus, e_plus, e_minus, h * u**2 / 2])


@dataclass
class PendulumProgram:
    """A solver for one case with the bounds it needs, and the seconds it took to build."""

    solver: Any
    bounds: dict[str, np.ndarray]
    case: PendulumCase
    seconds: float
    sizes: ProgramSizes | None = None

    def start(
        self, durations: np.ndarray, q: np.ndarray, u: np.ndarray, impulses: np.ndarray
    ) -> np.ndarray:
        return np.concatenate([durations, q.ravel(), u.ravel(), impulses])

    def solve(self, x0: np.ndarray) -> tuple[float, float, int, str, float, np.ndarray]:
        """Return seconds, cost, iterations, status, violation and unknowns."""
        s = self.sizes or ProgramSizes(np.ones(len(x0)), np.ones(len(self.bounds["lbg"])), 1.0)
        seconds, result = clocked(lambda: self.solver(x0=x0 / s.x, **self.bounds))
        stats = self.solver.stats()
        g, x = np.array(result["g"]).ravel() * s.g, np.array(result["x"]).ravel() * s.x
        b = {k: v * (s.x if k in ("lbx", "ubx") else s.g) for k, v in self.bounds.items()}
        excess = [b["lbg"] - g, g - b["ubg"], b["lbx"] - x, x - b["ubx"]]
        return (
            seconds, float(result["f"]) * s.f, int(stats["iter_count"]),
            str(stats["return_status"]), float(np.max(np.concatenate(excess))), x,
        )  # fmt: skip


@dataclass(frozen=True)
class ProgramSizes:
    """What unknowns, rows and the cost are divided by."""

    x: np.ndarray
    g: np.ndarray
    f: float

    def bounds(self, plain: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        return {k: v / (self.x if k in ("lbx", "ubx") else self.g) for k, v in plain.items()}


def program(
    case: PendulumCase,
    compiled: bool = False,
    unrolled: bool = True,
    sizes: ProgramSizes | None = None,
    **ipopt: Any,
) -> PendulumProgram:
    """Build the program; unrolled into scalar operations (fastest to evaluate), or with a map
    over the steps (fastest to build)."""
    seconds, (solver, bounds) = clocked(lambda: built(case, compiled, unrolled, sizes, **ipopt))
    return PendulumProgram(solver, bounds, case, seconds, sizes)


def built(
    case: PendulumCase, compiled: bool, unrolled: bool, sizes: ProgramSizes | None, **ipopt: Any
) -> tuple[Any, dict[str, np.ndarray]]:
    """CasADi's solver and the bounds, of the program in units of its sizes."""
    n, phases = case.steps, len(case.sequence) + 1
    total = n * phases
    step = step_function(case)
    kind = ca.SX if unrolled else ca.MX
    T, q = kind.sym("T", phases), kind.sym("q", 2, total + 1)
    u, lam = kind.sym("u", 1, total), kind.sym("lam", phases - 1)
    h = ca.horzcat(*[ca.repmat(T[i] / n, 1, n) for i in range(phases)])
    if unrolled:
        parts = [step(q[:, k], q[:, k + 1], u[k], h[k]) for k in range(total)]
        r_minus, r_plus, e_plus, e_minus, cost = (
            ca.horzcat(*column) for column in zip(*parts, strict=True)
        )
    else:
        r_minus, r_plus, e_plus, e_minus, cost = step.map(total)(q[:, :-1], q[:, 1:], u, h)
    g, low, high = [], [], []

    def demand(value: Any, lower: float = 0.0, upper: float = 0.0) -> None:
        value = ca.vec(value)
        g.append(value)
        low.extend([lower] * value.numel())
        high.extend([upper] * value.numel())

    demand(r_minus[:, 0])  # at rest
    balance = r_plus[:, :-1] + r_minus[:, 1:]
    collisions = [n * (i + 1) for i in range(phases - 1)]
    for i, c in enumerate(collisions):
        sign = -1.0 if case.sequence[i] == "lower" else 1.0  # outward normal of the limiter
        balance[0, c - 1] -= sign * lam[i]
        demand(e_plus[c - 1] - e_minus[c])
    demand(balance)
    demand(r_plus[:, -1])  # at rest
    demand(ca.sum1(T), 0.0, case.final_time)
    x = ca.vertcat(T, ca.vec(q), ca.vec(u), lam)
    wide = np.full((2, total + 1), np.inf)
    q_low, q_high = -wide, wide.copy()
    q_low[0], q_high[0] = case.lower, case.upper
    q_low[1], q_high[1] = -10.0, 10.0
    q_low[:, 0] = q_high[:, 0] = (case.alpha, 0.0)
    q_low[0, -1] = q_high[0, -1] = np.pi / 2
    for i, c in enumerate(collisions):
        q_low[0, c] = q_high[0, c] = case.lower if case.sequence[i] == "lower" else case.upper
    force = np.full(total, case.force)
    none = np.zeros(phases - 1)
    bounds = {
        "lbx": np.concatenate(
            [np.full(phases, 1e-3 * case.final_time), q_low.T.ravel(), -force, none]
        ),
        "ubx": np.concatenate([np.full(phases, np.inf), q_high.T.ravel(), force, none + np.inf]),
        "lbg": np.array(low),
        "ubg": np.array(high),
    }
    options: dict[str, Any] = {
        "ipopt": {"print_level": 0, "tol": 1e-8, **ipopt},
        "print_time": False,
    }
    if compiled:
        options |= {"jit": True, "compiler": "shell", "jit_options": {"flags": ["-O2"]}}
    nlp = {"x": x, "f": ca.sum2(cost), "g": ca.vertcat(*g)}
    if sizes is not None:
        whole = ca.Function("nlp", [x], [nlp["f"] / sizes.f, nlp["g"] / sizes.g])
        scaled = kind.sym("x", x.numel())
        nlp = dict(zip("xfg", (scaled, *whole(scaled * sizes.x)), strict=True))
        bounds = sizes.bounds(bounds)
    return ca.nlpsol("solver", "ipopt", nlp, options), bounds
