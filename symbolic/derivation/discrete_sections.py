"""Sections of what is discrete: a step, collisions, the cost, and their derivatives."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import sympy as sp

from dmoc.base.names import name_of
from dmoc.symbolic.continuous import Continuous, dot, impact_work
from dmoc.symbolic.derivation.document import (
    LEFT,
    Equation,
    Section,
    definition,
    definitions,
    upright,
)
from dmoc.symbolic.derivation.symbols import DisplayNames, latex_symbol
from dmoc.symbolic.discrete import StepElement
from dmoc.symbolic.graph import gradient
from dmoc.symbolic.system import MechanicalSystem


def discrete_sections(
    system: MechanicalSystem, e: StepElement, own: DisplayNames
) -> Iterable[Section]:
    n = len(e.q_k)
    names = [name_of(q) for q in system.coordinates]
    tex = [latex_symbol(x) for x in names]
    middle = len(e.points) == 1
    inner = inner_nodes(e.inside)
    yield _places_of(e)
    slots = [e.D(e.L_d, i) for i in range(2 * n)]
    yield Section(
        "Discrete Lagrangian",
        "L_d, the quadrature of L over the step, with its derivatives in the first, second and "
        "third slot.",
        (
            definition(own, "L_d", "L_d", e.L_d),
            *definitions(own, "D1_Ld", names, tex, slots[:n], "D_1 L_d"),
            *definitions(own, "D2_Ld", names, tex, slots[n:], "D_2 L_d"),
            definition(own, "D3_Ld", "D_3 L_d", e.D(e.L_d, e.at_h)),
        ),
    )
    yield Section(
        "Discrete forces",
        "fd_minus = h/2 Q with the input u_k, fd_plus = h/2 Q with the input u_kp1."
        if middle
        else "The virtual work of Q at the quadrature points on the first and the last node; "
        "inputs are linear in the step, from u_k to u_kp1.",
        (
            *definitions(own, "fd_minus", names, tex, e.fd_minus, "f_d^-"),
            *definitions(own, "fd_plus", names, tex, e.fd_plus, "f_d^+"),
        ),
    )
    inside = "" if middle else " Nodes inside the step: r_i = 0."
    yield Section(
        "Discrete Euler-Lagrange equations",
        "r_minus = D1_Ld + fd_minus is -p at the step's start, r_plus = D2_Ld + fd_plus is p at "
        "its end. Interior nodes: r_plus(k-1) + r_minus(k) = 0. Start: r_minus(0) + p_B = 0. End: "
        f"r_plus(N-1) - p_E = 0.{inside}",
        (
            *definitions(own, "r_minus", names, tex, e.r_minus, "r^-"),
            *definitions(own, "r_plus", names, tex, e.r_plus, "r^+"),
            *(
                equation
                for a, tag in enumerate(inner)
                for equation in definitions(
                    own, f"r_{tag}", names, tex, e.r_i[a * n : (a + 1) * n], f"r^{{{tag}}}"
                )
            ),
        ),
    )


def _places_of(e: StepElement) -> Section:
    """Section on the points at which the integrals of a step are taken."""
    middle = len(e.points) == 1
    place = "Midpoint" if middle else "Quadrature points"
    text = (
        "Coordinates and velocities of the midpoint rule"
        if middle
        else f"Coordinates and velocities at the {len(e.points)} Gauss points of the polynomial "
        f"through the nodes k (start), {', '.join(inner_nodes(e.inside))} (inside) and k+1 (end)"
    )
    used = {
        s
        for p in e.points
        for f in (p.start, p.end)
        for part in (f.L, *f.Q, f.C, *f.r)
        for s in part.free_symbols
    }
    times = {p.start.t for p in e.points}
    return Section(
        f"{place} of a step",
        f"{text}, in the step from node k to node k+1 of size h.",
        tuple(
            Equation(str(s), latex_symbol(str(s)), value)
            for s, value in e.definitions
            if s in used or s not in times
        ),
    )


def collision_sections(
    system: MechanicalSystem, f: Continuous, e: StepElement, own: DisplayNames
) -> Iterable[Section]:
    if not f.g:
        return
    names = [str(q) for q in f.q]
    before = [own.symbol(f"r_plus_{n}", LEFT) for n in names]
    after = [own.symbol(f"r_minus_{n}", LEFT) for n in names]
    lam = own.symbol("lam", "impulse")
    equations = []
    for name, g in zip(system.gaps, f.g, strict=True):
        normal = gradient(g, f.q)
        tag = upright(name)
        momentum = sp.Matrix(
            [a + b - lam * c for a, b, c in zip(before, after, normal, strict=True)]
        )
        equations.append(Equation(f"0 (position, {name})", f"0_{tag}", g))
        equations.append(Equation(f"0 (momentum, {name})", f"0_{tag}", momentum))
        for t in tangents(normal):
            total = [a + b for a, b in zip(before, after, strict=True)]
            equations.append(
                Equation(f"0 (tangential momentum, {name})", f"0_{tag}", dot(t, total))
            )
    impulses = [own.symbol(f"lam_{n}", "impulse") for n in system.gaps]
    equations.append(definition(own, "e_plus", "e^+", e.e_plus))
    equations.append(definition(own, "e_minus", "e^-", e.e_minus))
    for name, e in zip(system.gaps, f.e, strict=False):
        if name in system.restitution:
            equations.append(definition(own, f"e_{name}", f"e_{upright(name)}", e))
    moving, rate = impact_work(f, impulses)
    equations.append(definition(own, "W_t", "W_t", moving))
    equations.append(definition(own, "W_gamma", r"W_\gamma", rate))
    yield Section(
        "Collision conditions",
        "At a collision node q_c: g(q_c) = 0; only the normal part of the momentum jumps, "
        "r_plus(before) + r_minus(after) = lam grad g, or, without the impulse lam >= 0, its "
        "projection on the tangents vanishes. With the coefficient of restitution e and the rate "
        "gamma = grad g . q' + dg/dt of the gap after the collision, e (e_plus(before) - "
        "e_minus(after) - W_t) = (1 - e)/2 W_gamma with W_t = lam dg/dt and W_gamma = lam gamma: "
        "the mean of the balance of energy (e = 1) and of the plastic impact gamma = 0 (e = 0), "
        "which is Newton's law gamma = -e gamma(before).",
        tuple(equations),
    )


def tangents(normal: Sequence[Any]) -> list[list[Any]]:
    """Return nq - 1 vectors t with t . normal = 0 identically, for a gradient that is nowhere
    zero in one component."""
    pivot = next((i for i, n in enumerate(normal) if n.is_nonzero), None)
    if pivot is None:
        pivot = next(i for i, n in enumerate(normal) if n != 0)
    vectors = []
    for i in range(len(normal)):
        if i != pivot:
            t = [sp.S.Zero] * len(normal)
            t[i], t[pivot] = sp.S.One, -normal[i] / normal[pivot]
            vectors.append(t)
    return vectors


def cost_sections(
    system: MechanicalSystem, f: Continuous, e: StepElement, own: DisplayNames
) -> Iterable[Section]:
    middle = len(e.points) == 1
    text = (
        "C_d = h/2 (C with u_k + C with u_kp1) at the midpoint."
        if middle
        else "C_d, the quadrature of C over the step."
    )
    yield Section("Discrete cost", text, (definition(own, "C_d", "C_d", e.C_d),))
    if f.Phi != 0:
        yield Section(
            "Terminal cost",
            "Phi at the final time is added to the cost.",
            (definition(own, "Phi", r"\Phi", f.Phi),),
        )
    if e.r_d:
        names = list(system.path_constraints) * len(e.points)
        paths = [
            definition(own, f"r_{n}", f"r_{upright(n)}", r, "path")
            for n, r in zip(names, e.r_d, strict=True)
        ]
        yield Section("Path constraints", "r_d >= 0 in every step.", tuple(paths))


def derivative_sections(e: StepElement, own: DisplayNames) -> Iterable[Section]:
    n = len(e.q_k)
    rows = {f"r_minus_{i}": r for i, r in enumerate(e.r_minus)} | {
        f"r_plus_{i}": r for i, r in enumerate(e.r_plus)
    }
    rows |= {f"r_i_{i}": r for i, r in enumerate(e.r_i)}
    rows |= {"e_plus": e.e_plus, "e_minus": e.e_minus, "C_d": e.C_d}
    equations, pattern = [], []
    for name, row in rows.items():
        derivatives = e.gradient(row)
        pattern.append(f"  {name:>10}  " + " ".join("x" if d != 0 else "." for d in derivatives))
        equations += [
            Equation(
                f"d{name}/d{z}", f"\\partial {_row_tex(name)} / \\partial {latex_symbol(str(z))}", d
            )
            for z, d in zip(e.x_k, derivatives, strict=True)
            if d != 0
        ]
    columns = "x_k = (" + ", ".join(map(str, e.x_k)) + ")"
    yield Section(
        "First derivatives",
        f"Columns {columns}; x marks what is not identically zero.",
        tuple(equations),
        tuple(pattern),
    )
    mu = (
        [own.symbol(f"mu_minus_{i}", "weight") for i in range(n)],
        [own.symbol(f"mu_plus_{i}", "weight") for i in range(n)],
    )
    mu_i = [own.symbol(f"mu_i_{i}", "weight") for i in range(len(e.r_i))]
    sigma, w_plus, w_minus = (own.symbol(name, "weight") for name in ("sigma", "w_plus", "w_minus"))
    inside = " + mu_i . r_i" if e.r_i else ""
    what = f"sigma C_d + mu_minus . r_minus + mu_plus . r_plus{inside}"
    momenta = dot(mu[0], e.r_minus) + dot(mu[1], e.r_plus) + dot(mu_i, e.r_i)
    yield _second_derivatives(e, "step", what, sigma * e.C_d + momenta)
    energies = w_plus * e.e_plus + w_minus * e.e_minus
    yield _second_derivatives(e, "energy", "w_plus e_plus + w_minus e_minus", energies)


def _second_derivatives(e: StepElement, title: str, what: str, expression: Any) -> Section:
    hessian = e.hessian(expression)
    grid = ["  " + " ".join("x" if d != 0 else "." for d in row) for row in hessian]
    second = [
        Equation(
            f"d2/d{a}d{b}",
            f"\\partial^2/\\partial {latex_symbol(str(a))}\\,\\partial {latex_symbol(str(b))}",
            hessian[i][j],
            (a, b),
        )
        for i, a in enumerate(e.x_k)
        for j, b in enumerate(e.x_k)
        if j >= i and hessian[i][j] != 0
    ]
    return Section(
        f"Second derivatives ({title})",
        f"Upper triangle for {what}.",
        tuple(second),
        tuple(grid),
    )


def _row_tex(name: str) -> str:
    return {"e_plus": "e^+", "e_minus": "e^-", "C_d": "C_d"}.get(
        name, name.replace("r_minus_", "r^-_").replace("r_plus_", "r^+_")
    )


def inner_nodes(nodes: int) -> list[str]:
    """Names of the nodes inside a step."""
    return ["i"] if nodes == 1 else [f"i{a + 1}" for a in range(nodes)]
