"""Kernels of surfaces, tangents and constraints: what touches, slides and holds."""

from __future__ import annotations

from typing import Any

from dmoc.symbolic.continuous import (
    Continuous,
    dot,
    gap_rates,
    impact_work,
    mass_matrix,
    rates,
    total,
)
from dmoc.symbolic.graph import gradient
from dmoc.symbolic.kernel_family import family, state_inputs
from dmoc.symbolic.spec import Input, KernelSpec, Output


def surface_kernels(f: Continuous) -> list[KernelSpec]:
    """Kernels of the gaps g(q, t), of the normal impulse lam . grad g and of the work of an
    impact."""
    if not f.g:
        return []
    q, v, _, t, par = state_inputs(f)
    lam = Input.vector(f.L.graph, "lam", len(f.g))
    normal = gradient(dot(lam.symbols, f.g), f.q)
    moving, rate = impact_work(f, lam.symbols)
    return [
        *family("surface", "Gaps g <= 0.", (q, t), {"g": f.g}, par),
        *family("gap_rate", "Rates gamma of the gaps.", (q, v, t), {"gamma": gap_rates(f)}, par),
        *family(
            "normal", "Normal impulse n = sum_j lam_j grad g_j.", (q, lam, t), {"n": normal}, par
        ),
        *family(
            "moving_work",
            "Work of moving surfaces, W_t = sum_j lam_j dg_j/dt, in an impact.",
            (q, lam, t),
            {"W_t": [moving]},
            par,
        ),
        *family(
            "rate_work",
            "Impulses times rates after an impact, W_gamma = sum_j lam_j gamma_j.",
            (q, v, lam, t),
            {"W_gamma": [rate]},
            par,
        ),
    ]


def tangent_kernels(f: Continuous) -> list[KernelSpec]:
    """Kernels of the tangential positions tau(q, t), of the tangential impulse T . grad tau, and
    of the coefficients of friction."""
    if not f.tau:
        return []
    q, v, _, t, par = state_inputs(f)
    T = Input.vector(f.L.graph, "T", len(f.tau))
    along = gradient(dot(T.symbols, f.tau), f.q)
    slides = rates(f, f.tau)
    return [
        *family("tangent", "Tangential positions tau.", (q, t), {"tau": f.tau}, par),
        *family("slide_rate", "Sliding velocities sigma.", (q, v, t), {"sigma": slides}, par),
        *family(
            "traction", "Tangential impulse s = sum_j T_j grad tau_j.", (q, T, t), {"s": along}, par
        ),
        KernelSpec(
            "friction",
            "Coefficients of friction of surfaces, largest forces of rails.",
            (par,),
            (Output.vector("mu", f.mu),),
        ),
    ]


def joint_kernels(f: Continuous) -> list[KernelSpec]:
    """Kernels of the constraints phi(q, t) = 0 and of their impulse R . grad c."""
    if not f.phi:
        return []
    q, v, _, t, par = state_inputs(f)
    R = Input.vector(f.L.graph, "R", len(f.phi))
    q_k, q_kp1 = (Input.vector(f.L.graph, name, len(f.q)) for name in ("q_k", "q_kp1"))
    t_k, t_kp1 = (Input.vector(f.L.graph, name, 1) for name in ("t_k", "t_kp1"))
    along = gradient(dot(R.symbols, f.phi), f.q)
    return [
        *family("joint", "Constraints phi = 0.", (q, t), {"phi": f.phi}, par),
        *family("joint_rate", "Their rates.", (q, v, t), {"phi_dot": rates(f, f.phi)}, par),
        *family("reaction", "Impulse s = sum_j R_j grad phi_j.", (q, R, t), {"s": along}, par),
        *family(
            "joint_turn",
            "Products of the gradients at both ends of a step, each over the masses.",
            (q_k, q_kp1, t_k, t_kp1),
            {"turn": _turns(f, (q_k, t_k), (q_kp1, t_kp1))},
            par,
        ),
    ]


def _turns(f: Continuous, start: tuple[Input, Input], end: tuple[Input, Input]) -> list[Any]:
    """Of each constraint, sum_i d_i phi(start) d_i phi(end) / M_ii(start)."""

    def at(expression: Any, place: tuple[Input, Input]) -> Any:
        q, t = place
        return expression.subs(dict(zip((*f.q, f.t), (*q.symbols, *t.symbols), strict=True)))

    masses = [at(row[i], start) for i, row in enumerate(mass_matrix(f))]
    slopes = [gradient(phi, f.q) for phi in f.phi]
    return [
        total(at(s, start) * at(s, end) / m for s, m in zip(row, masses, strict=True))
        for row in slopes
    ]
