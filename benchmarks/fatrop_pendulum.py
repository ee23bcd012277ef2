"""The reference problem in stages, as FATROP takes it through CasADi: the transcription of
:mod:`casadi_pendulum` with states (q, p, both step sizes, energy) and inputs (force, velocity of
the step, and at the collision its impulse)."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np
from casadi_pendulum import PendulumCase, step_function

STATES = 7


def solver(case: PendulumCase, **options: Any) -> tuple[Any, dict[str, np.ndarray]]:
    """CasADi's solver, and bounds of unknowns and rows."""
    n, step = case.steps, step_function(case)
    w, g, low, high, w_low, w_high = [], [], [], [], [], []
    cost: Any = 0
    nx, nu, ng = [], [], []

    def rows(value: Any, lower: Any, upper: Any) -> None:
        g.append(value)
        low.extend(np.broadcast_to(lower, value.numel()))
        high.extend(np.broadcast_to(upper, value.numel()))

    x = ca.SX.sym("x_0", STATES)
    least, no = 1e-3 * case.final_time / n, np.inf
    for k in range(2 * n + 1):
        q, p, h, e = x[:2], x[2:4], x[4 + (k >= n)], x[6]
        w.append(x)
        w_low += [
            -no if k == n else case.lower,
            -10.0,  # there it is fixed
            -no,
            -no,
            least,
            least,
            -no,
        ]
        w_high += [case.upper, 10.0, no, no, no, no, no]
        before = len(low)
        nx.append(STATES)
        if k == 2 * n:
            rows(ca.vertcat(q[0], p), [np.pi / 2, 0, 0], [np.pi / 2, 0, 0])
            nu.append(0)
            ng.append(len(low) - before)
            break
        u = ca.SX.sym(f"u_{k}", 4 if k == n else 3)
        w.append(u)
        w_low += [-case.force, -no, -no, *([0.0] if k == n else [])]
        w_high += [case.force, no, no, *([no] if k == n else [])]
        after = q + h * u[1:3]
        r_minus, r_plus, e_plus, e_minus, spent = step(q, after, u[0], h)
        cost += spent
        x = ca.SX.sym(f"x_{k + 1}", STATES)
        rows(x - ca.vertcat(after, r_plus, w[-2][4:6], e_plus), 0.0, 0.0)
        before = len(low)
        impulse = ca.vertcat(-u[3], 0) if k == n else ca.SX.zeros(2)
        if k == 0:
            rows(q, [case.alpha, 0.0], [case.alpha, 0.0])
            rows(p, 0.0, 0.0)
            rows(n * ca.sum1(w[0][4:6]), -no, case.final_time)
        rows(p + r_minus - impulse, 0.0, 0.0)
        if k == n:
            rows(ca.vertcat(q[0] - case.lower, e - e_minus), 0.0, 0.0)
        nu.append(u.numel())
        ng.append(len(low) - before)
    settings = {
        "structure_detection": "manual", "nx": nx, "nu": nu, "ng": ng, "N": 2 * n,
        "print_time": False, "fatrop": {"print_level": 0, "tol": 1e-8, **options},
        "equality": [a == b for a, b in zip(low, high, strict=True)],
    }  # fmt: skip
    program = {"x": ca.vertcat(*w), "f": cost, "g": ca.vertcat(*g)}
    bounds = {"lbx": w_low, "ubx": w_high, "lbg": low, "ubg": high}
    arrays = {key: np.array(value, dtype=float) for key, value in bounds.items()}
    return ca.nlpsol("solver", "fatrop", program, settings), arrays


def start_of(durations: np.ndarray, q: np.ndarray, u: np.ndarray, impulses: np.ndarray) -> Any:
    """Unknowns of a guess, with momenta and energies of zero."""
    n = len(u) // 2
    h = durations / n
    parts = list[Any]()
    for k in range(2 * n):
        parts += [q[k], [0.0, 0.0], h, [0.0], u[k], (q[k + 1] - q[k]) / h[k // n]]
        parts += [impulses] if k == n else []
    return np.concatenate([*parts, q[-1], [0.0, 0.0], h, [0.0]])
