"""Kernels of surfaces, tangents and constraints: what touches, slides and holds."""

from __future__ import annotations

from collections.abc import Sequence
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
        *family(
            "gap_work",
            "Normal impulses times gaps of the surfaces, lam_j g_j.",
            (q, lam, t),
            {"W_g": [a * b for a, b in zip(lam.symbols, f.g, strict=True)]},
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
    ends = _ends_of_step(f)
    before, after = ([_at(f, tau, end) for tau in f.tau] for end in ends)
    slipped = zip(T.symbols, before, after, strict=True)
    return [
        *family("tangent", "Tangential positions tau.", (q, t), {"tau": f.tau}, par),
        *family("slide_rate", "Sliding velocities sigma.", (q, v, t), {"sigma": slides}, par),
        *family(
            "traction", "Tangential impulse s = sum_j T_j grad tau_j.", (q, T, t), {"s": along}, par
        ),
        *family(
            "slip_work",
            "Tangential impulses times how far their tangents slide in a step, "
            "T_j (tau_j(q_kp1) - tau_j(q_k)).",
            (ends[0][0], ends[1][0], T, ends[0][1], ends[1][1]),
            {"W_tau": [a * (late - early) for a, early, late in slipped]},
            par,
        ),
        *_friction_kernels(f),
    ]


def _friction_kernels(f: Continuous) -> list[KernelSpec]:
    """Kernels of the coefficients of friction: of all that are constant along a motion, and, where
    some are not, of what they bear at a state.

    ``c`` is the place between two inputs, in [0, 1]; N what each tangent is pressed with.
    """
    q, v, _, t, par = state_inputs(f)
    graph, stated = f.L.graph, {"mu": f.mu} | ({"mu_s": f.mu_s} if f.mu_s != f.mu else {})
    moving = [varies(f, mu) or varies(f, mu_s) for mu, mu_s in zip(f.mu, f.mu_s, strict=True)]
    constant = {
        name: [graph.zero if moves else mu for mu, moves in zip(values, moving, strict=True)]
        for name, values in stated.items()
    }
    kernels = [
        KernelSpec(
            "friction",
            "Coefficients of friction of surfaces, largest forces of rails; 0 where they vary.",
            (par,),
            tuple(Output.vector(name, values) for name, values in constant.items()),
        )
    ]
    if not any(moving):
        return kernels
    (c,) = (place := Input.vector(graph, "c", 1)).symbols
    sides = [Input.vector(graph, f"u_{k}", len(f.u)) for k in ("k", "kp1")]
    between = {
        s: (1 - c) * a + c * b
        for s, a, b in zip(f.u, *(side.symbols for side in sides), strict=True)
    }
    N = Input.vector(graph, "N", len(f.tau))
    state, ends = (q, v, *sides, place, N, t), _ends_of_step(f)
    bears = {
        name: [
            load * mu.subs(between) if moves else graph.zero
            for load, mu, moves in zip(N.symbols, values, moving, strict=True)
        ]
        for name, values in stated.items()
    }
    text = "What friction holds whose coefficients vary, mu_j N_j"
    kernels += family("bearing", f"{text}.", state, {"bears": bears["mu"]}, par)
    if "mu_s" in bears:
        kernels += family("holding", f"{text}, that sticks.", state, {"holds": bears["mu_s"]}, par)
    moved = [_at(f, tau, ends[1]) - _at(f, tau, ends[0]) for tau in f.tau]
    step = (ends[0][0], ends[1][0], ends[0][1], ends[1][1])
    return [
        *kernels,
        *family(
            "bearing_work",
            "The same times how far their tangents slide in a step.",
            (*state, *step),
            {"W_mu": [a * b for a, b in zip(bears["mu"], moved, strict=True)]},
            par,
        ),
    ]


def varying(f: Continuous, tangents: Sequence[str]) -> tuple[list[str], list[Any]]:
    """The tangents whose friction varies, and what has the symbols of both coefficients."""
    both = [(name, a * a + b * b) for name, a, b in zip(tangents, f.mu, f.mu_s, strict=True)]
    pairs = [(name, mu) for name, mu in both if varies(f, mu)]
    return [name for name, _ in pairs], [mu for _, mu in pairs]


def varies(f: Continuous, mu: Any) -> bool:
    """Whether a coefficient of friction varies along a motion, or with what a solver chooses."""
    return bool(mu.free_symbols & {*f.q, *f.v, *f.u, f.t, *f.design})


def joint_kernels(f: Continuous) -> list[KernelSpec]:
    """Kernels of the constraints phi(q, t) = 0 and of their impulse R . grad c."""
    if not f.phi:
        return []
    q, v, _, t, par = state_inputs(f)
    R = Input.vector(f.L.graph, "R", len(f.phi))
    (q_k, t_k), (q_kp1, t_kp1) = _ends_of_step(f)
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


def _ends_of_step(f: Continuous) -> list[tuple[Input, Input]]:
    """Positions and times at the start and at the end of a step."""
    graph, nq = f.L.graph, len(f.q)
    return [
        (Input.vector(graph, f"q_{k}", nq), Input.vector(graph, f"t_{k}", 1)) for k in ("k", "kp1")
    ]


def _at(f: Continuous, expression: Any, place: tuple[Input, Input]) -> Any:
    """An expression at a position and a time."""
    q, t = place
    return expression.subs(dict(zip((*f.q, f.t), (*q.symbols, *t.symbols), strict=True)))


def _turns(f: Continuous, start: tuple[Input, Input], end: tuple[Input, Input]) -> list[Any]:
    """Of each constraint, sum_i d_i phi(start) d_i phi(end) / M_ii(start)."""
    masses = [_at(f, row[i], start) for i, row in enumerate(mass_matrix(f))]
    slopes = [gradient(phi, f.q) for phi in f.phi]
    return [
        total(_at(f, s, start) * _at(f, s, end) / m for s, m in zip(row, masses, strict=True))
        for row in slopes
    ]
