"""Chains and arms of many links: seconds from the statement to a built model, and nanoseconds of a
step's equations with first and second derivatives, beside CasADi's code for the same step."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from types import SimpleNamespace
from typing import Any

import casadi as ca
import numpy as np
import sympy as sp
from build_times import cold_and_warm
from common import Section, bytes_of_c, clocked, ratio, timed
from evaluation_times import STEPS, generated, sizes_of
from sympy.physics.mechanics import dynamicsymbols

import dmoc

AXES = "zyyxyxy"  # of an arm's joints
VALUES = {"m": 0.5, "l": 0.4, "g": 9.81, "J": 0.05}


def chain(q: Any, v: Any, par: Any, f: Any) -> Any:
    """L of a chain of point masses in the angles of its links."""
    vx = vy = y = kinetic = potential = 0
    for angle, rate in zip(q, v, strict=True):
        vx, vy = vx + par.l * f.cos(angle) * rate, vy + par.l * f.sin(angle) * rate
        y = y - par.l * f.cos(angle)
        kinetic += par.m * (vx**2 + vy**2) / 2
        potential += par.m * par.g * y
    return kinetic - potential


def arm(q: Any, v: Any, par: Any, f: Any) -> Any:
    """L of an arm in space, by the recursion of velocities in the frames of its links."""
    spin, velocity, up = [0, 0, 0], [0, 0, 0], [0, 0, 1]  # up: in the frame of the link
    height = kinetic = potential = 0
    for axis, angle, rate in zip(AXES[: len(q)], q, v, strict=True):
        c, s, k = f.cos(angle), f.sin(angle), "xyz".index(axis)
        i, j = (k + 1) % 3, (k + 2) % 3
        for vector in (spin, velocity, up):
            vector[i], vector[j] = c * vector[i] + s * vector[j], c * vector[j] - s * vector[i]
        spin[k] = spin[k] + rate
        # Mass in the middle of the link, which lies along z of its frame.
        middle = [velocity[0] + spin[1] * par.l / 2, velocity[1] - spin[0] * par.l / 2, velocity[2]]
        kinetic += par.m * sum(a**2 for a in middle) / 2 + par.J * sum(w**2 for w in spin) / 2
        potential += par.m * par.g * (height + up[2] * par.l / 2)
        height = height + up[2] * par.l
        velocity[0] = velocity[0] + spin[1] * par.l
        velocity[1] = velocity[1] - spin[0] * par.l
    return kinetic - potential


def system_of(name: str, lagrangian: Callable[..., Any], n: int) -> dmoc.MechanicalSystem:
    q, u = (dynamicsymbols(f"{letter}1:{n + 1}") for letter in "qu")
    par = SimpleNamespace(**{s: sp.Symbol(s) for s in VALUES})
    value = lagrangian(q, [s.diff() for s in q], par, sp)
    used = {s: VALUES[s.name] for s in vars(par).values() if s in value.free_symbols}
    return dmoc.MechanicalSystem(
        f"{name}_{n}", q, value, used, inputs=u, forces=dict(zip(q, u, strict=True)),
        cost=sum(s**2 for s in u) / 2,
    )  # fmt: skip


def functions(lagrangian: Callable[..., Any], n: int) -> dict[str, ca.Function]:
    """Equations of a step by the midpoint rule, their Jacobian and the Hessian of their weighted
    sum, as CasADi derives them."""
    a, b, u_k, u_kp1 = (ca.SX.sym(s, n) for s in ("a", "b", "u_k", "u_kp1"))
    h, par, w = ca.SX.sym("h"), ca.SX.sym("par", len(VALUES)), ca.SX.sym("w", 2 * n + 1)
    names = SimpleNamespace(**dict(zip(VALUES, ca.vertsplit(par), strict=True)))
    q, v = ((ca.vertsplit(e)) for e in ((a + b) / 2, (b - a) / h))
    L_d = h * lagrangian(q, v, names, ca)
    cost = h / 4 * (ca.dot(u_k, u_k) + ca.dot(u_kp1, u_kp1))
    r = ca.vertcat(ca.gradient(L_d, a) + h / 2 * u_k, ca.gradient(L_d, b) + h / 2 * u_kp1, cost)
    x = ca.vertcat(a, b, u_k, u_kp1, h)
    inputs = [a, b, u_k, u_kp1, h, par]
    return {
        "step": ca.Function("step", inputs, [r], {"cse": True}),
        "step_jac": ca.Function("step_jac", inputs, [ca.jacobian(r, x)], {"cse": True}),
        "step_hess": ca.Function(
            "step_hess", [*inputs, w], [ca.triu(ca.hessian(ca.dot(w, r), x)[0])], {"cse": True}
        ),
    }


def compare(quick: bool) -> Section:
    section = Section(
        "Chains and arms: from the statement to kernels, and nanoseconds a step",
        "Seconds of dmoc: the system, and its kernels built without a cache; CasADi: three "
        "functions derived, their C not yet compiled. Then a step's equations, first derivatives "
        "and the weighted second ones, CasADi's compiled C / dmoc's, as ratios and, of dmoc, in "
        "nanoseconds.",
        ["model", "state, s", "build, s", "CasADi derives, s", "bytes of C",
         "equations", "first", "second", "dmoc, ns"],
    )  # fmt: skip
    sizes = {"chain": (2, 4), "arm": (3,)} if quick else {"chain": (2, 4, 6, 8, 12), "arm": (3, 6)}
    for name, counts in sizes.items():
        for n in counts:
            section.row(f"{name} of {n}", *_row(name, {"chain": chain, "arm": arm}[name], n, quick))
    return section


def _row(name: str, lagrangian: Callable[..., Any], n: int, quick: bool) -> list[str]:
    stating, system = clocked(partial(system_of, name, lagrangian, n))
    cold, _ = cold_and_warm(system)
    deriving, peers = clocked(partial(functions, lagrangian, n))
    kernels = dmoc.build(system, backend="compiled")
    rng = np.random.default_rng(0)
    a, u_k, u_kp1 = (rng.uniform(0.1, 1.0, (STEPS, n)) for _ in range(3))
    h, b = np.full((STEPS, 1), 0.02), a + 0.02 * rng.normal(size=(STEPS, n))
    w, par = rng.normal(size=(STEPS, 2 * n + 1)), np.array([list(VALUES.values())])
    nothing = np.zeros((1, 0))
    own = [a, b, u_k, u_kp1, h, np.zeros((1, 1)), nothing, par[:, : len(kernels.parameters)]]
    weights = [np.ascontiguousarray(part) for part in np.split(w, [n, 2 * n], axis=1)]
    ratios, times, repeats = [], [], 20 if quick else 100
    for kernel, peer in peers.items():
        more = [*weights, nothing] if kernel == "step_hess" else []
        results = [np.empty((STEPS, size)) for size in sizes_of(kernels, kernel)]
        call = partial(kernels.functions[kernel], *own, *more, *results)
        ours = timed(call, repeats)[0]
        rows = [a, b, u_k, u_kp1, h, np.tile(par, (STEPS, 1)), w][: peer.n_in()]
        ratios.append(ratio(generated(peer, rows, repeats), ours))
        times.append(f"{1e9 * ours / STEPS:.0f}")
    return [
        f"{stating:.2f}", f"{cold:.2f}", f"{deriving:.2f}", f"{bytes_of_c(system):,}", *ratios,
        ", ".join(times),
    ]  # fmt: skip
