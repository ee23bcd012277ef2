"""From a system to the list of kernels that the numerical layers call.

Letters: ``nq`` coordinates, ``nu`` inputs, ``nc`` surfaces; ``z = (q_k, q_kp1, u_k, u_kp1, h)``; ``a_D_b`` is the derivative of
a with respect to b, ``hess`` an upper triangle of second derivatives of a weighted sum.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import Any

import symengine as se
import sympy as sp

from dmoc.symbolic.continuous import (
    Continuous,
    dot,
    energy,
    gradient,
    input_matrix,
    jacobian,
    mass_matrix,
    momenta,
    right_hand_side,
)
from dmoc.symbolic.discrete import StepElement, step_element
from dmoc.symbolic.names import name_of
from dmoc.symbolic.spec import Input, KernelSpec, ModelSpec, Output
from dmoc.symbolic.system import MechanicalSystem

FORMAT = 2  # of the facts and the kernel list; a manifest of another format is refused


def model_spec(system: MechanicalSystem) -> ModelSpec:
    """Derive all kernels of ``system``."""
    sizes = (len(system.coordinates), len(system.coordinates), len(system.inputs), len(system.parameters))
    q, v, u, par = (
        tuple(sp.Symbol(f"{n}_{i}", real=True) for i in range(k)) for n, k in zip(("q", "v", "u", "par"), sizes, strict=True)
    )
    f = Continuous.of(system, q, v, u, par).to_symengine()
    kernels = [*_step_kernels(f), *_state_kernels(f), *_surface_kernels(f), *_feasibility_kernels(f)]
    return ModelSpec(system.name, model_key(system), _facts(system, f), tuple(kernels))


def model_key(system: MechanicalSystem) -> str:
    """Return the key of the kernels of ``system``: its content, its units and the format of the kernel list."""
    units = "".join(f"\n{name} {unit}" for name, unit in system.units.items())
    return hashlib.sha256(f"{FORMAT}\n{system.fingerprint()}{units}".encode()).hexdigest()


def _facts(system: MechanicalSystem, f: Continuous) -> dict[str, Any]:
    in_mass = set().union(*(e.free_symbols for row in mass_matrix(f) for e in row))
    in_forces = set().union(set(), *(e.free_symbols for row in input_matrix(f) for e in row))
    surface_coordinates = {
        name: [i for i, s in enumerate(f.q) if s in g.free_symbols] for name, g in zip(system.surfaces, f.g, strict=True)
    }
    return {
        "format": FORMAT,
        "title": system.title or system.name,
        "coordinates": [name_of(q) for q in system.coordinates],
        "inputs": [name_of(u) for u in system.inputs],
        "units": dict(system.units),
        "surfaces": list(system.surfaces),
        "surface_coordinates": surface_coordinates,
        "path_constraints": list(system.path_constraints),
        "parameters": {name_of(s): (None if x is None else float(x)) for s, x in system.parameters.items()},
        "mass_parameters": [name_of(s) for s, x in zip(system.parameters, f.par, strict=True) if x in in_mass],
        "inputs_enter_linearly": not in_forces & set(f.u),
    }


def _step_kernels(f: Continuous) -> list[KernelSpec]:
    e = step_element(f, se.Symbol, se.Rational(1, 2))
    inputs = (
        Input("q_k", e.q_k),
        Input("q_kp1", e.q_kp1),
        Input("u_k", e.f.u),
        Input("u_kp1", e.u_kp1),
        Input("h", (e.h,)),
        Input("par", f.par),
    )
    nz, nq = len(e.z), len(f.q)
    mu_minus, mu_plus = Input.vector("mu_minus", nq), Input.vector("mu_plus", nq)
    sigma = Input.vector("sigma", 1)
    weights = Input.vector("w_e", 2)
    lagrangian = sigma.symbols[0] * e.C_d + dot(mu_minus.symbols, e.r_minus) + dot(mu_plus.symbols, e.r_plus)
    kernels = [
        _step(e, "step", "Momenta at both ends of a step and its cost.", inputs,
              Output.vector("r_minus", e.r_minus), Output.vector("r_plus", e.r_plus), Output.vector("C_d", [e.C_d])),
        _step(e, "step_jac", "First derivatives of `step` with respect to z.", inputs,
              Output.matrix("r_minus_D_z", e.jacobian(e.r_minus), nz), Output.matrix("r_plus_D_z", e.jacobian(e.r_plus), nz),
              Output.matrix("C_d_D_z", e.jacobian([e.C_d]), nz)),
        _step(e, "step_hess", "Second derivatives of sigma C_d + mu_minus . r_minus + mu_plus . r_plus.",
              (*inputs, sigma, mu_minus, mu_plus), Output.matrix("hess", e.hessian(lagrangian), nz, upper=True)),
        _step(e, "impact", "Discrete energies at the end (e_plus) and at the start (e_minus) of a step.", inputs,
              Output.vector("e_plus", [e.e_plus]), Output.vector("e_minus", [e.e_minus])),
        _step(e, "impact_jac", "First derivatives of `impact` with respect to z.", inputs,
              Output.matrix("e_plus_D_z", e.jacobian([e.e_plus]), nz), Output.matrix("e_minus_D_z", e.jacobian([e.e_minus]), nz)),
        _step(e, "impact_hess", "Second derivatives of w_e . (e_plus, e_minus).", (*inputs, weights),
              Output.matrix("hess", e.hessian(dot(weights.symbols, (e.e_plus, e.e_minus))), nz, upper=True)),
    ]  # fmt: skip
    if f.r:
        w = Input.vector("w", len(f.r))
        kernels += [
            _step(e, "path", "Path constraints r_d >= 0 of a step.", inputs, Output.vector("r_d", e.f.r)),
            _step(e, "path_jac", "First derivatives of `path`.", inputs, Output.matrix("r_d_D_z", e.jacobian(e.f.r), nz)),
            _step(e, "path_hess", "Second derivatives of w . r_d.", (*inputs, w),
                  Output.matrix("hess", e.hessian(dot(w.symbols, e.f.r)), nz, upper=True)),
        ]  # fmt: skip
    return kernels


def _step(e: StepElement, name: str, summary: str, inputs: tuple[Input, ...], *outputs: Output) -> KernelSpec:
    return KernelSpec(name, summary, inputs, outputs, e.definitions)


def _state_kernels(f: Continuous) -> list[KernelSpec]:
    """Kernels of the continuous equations: they serve the initial guess and the independent check."""
    q, v, u, par = Input("q", f.q), Input("v", f.v), Input("u", f.u), Input("par", f.par)
    w = Input.vector("w", len(f.q))
    mass = [entry for row in mass_matrix(f) for entry in row]
    force = right_hand_side(f)
    b = [entry for row in input_matrix(f) for entry in row]
    state = (*f.q, *f.v)
    return [
        KernelSpec("dynamics", "Equations of motion M q'' = F: M row by row, F.", (q, v, u, par),
                   (Output.vector("M", mass), Output.vector("F", force))),
        KernelSpec("dynamics_jac", "First derivatives of `dynamics` with respect to (q, v).", (q, v, u, par),
                   (Output.matrix("M_D_s", jacobian(mass, state), len(state)), Output.matrix("F_D_s", jacobian(force, state), len(state)))),
        KernelSpec("input_matrix", "B = dQ/du row by row.", (q, v, u, par), (Output.vector("B", b),)),
        KernelSpec("force", "Generalised forces Q.", (q, v, u, par), (Output.vector("Q", f.Q),)),
        KernelSpec("legendre", "Momenta p = dL/dv and energy E = v . p - L.", (q, v, par),
                   (Output.vector("p", momenta(f)), Output.vector("E", [energy(f)]))),
        KernelSpec("legendre_jac", "First derivatives of p with respect to (q, v).", (q, v, par),
                   (Output.matrix("p_D_s", jacobian(momenta(f), state), len(state)),)),
        KernelSpec("legendre_hess", "Second derivatives of w . p with respect to (q, v).", (q, v, par, w),
                   (_hessian(dot(w.symbols, momenta(f)), state),)),
        KernelSpec("running_cost", "Integrand C of the cost and its second derivatives in u.", (q, v, u, par),
                   (Output.vector("C", [f.C]), Output.vector("C_DD_u", [f.C.diff(s).diff(s) for s in f.u]))),
    ]  # fmt: skip


def _surface_kernels(f: Continuous) -> list[KernelSpec]:
    """Kernels of the gaps g(q) and of the normal impulse lam . grad g(q)."""
    if not f.g:
        return []
    q, par = Input("q", f.q), Input("par", f.par)
    w, lam, mu = Input.vector("w", len(f.g)), Input.vector("lam", len(f.g)), Input.vector("mu", len(f.q))
    normal = gradient(dot(lam.symbols, f.g), f.q)
    unknowns = (*f.q, *lam.symbols)
    return [
        KernelSpec("surface", "Gaps g <= 0.", (q, par), (Output.vector("g", f.g),)),
        KernelSpec("surface_jac", "Gradients of the gaps.", (q, par), (Output.matrix("g_D_q", jacobian(f.g, f.q), len(f.q)),)),
        KernelSpec("surface_hess", "Second derivatives of w . g.", (q, par, w), (_hessian(dot(w.symbols, f.g), f.q),)),
        KernelSpec("normal", "Normal impulse n = sum_j lam_j grad g_j.", (q, lam, par), (Output.vector("n", normal),)),
        KernelSpec("normal_jac", "First derivatives of n with respect to (q, lam).", (q, lam, par),
                   (Output.matrix("n_D_ql", jacobian(normal, unknowns), len(unknowns)),)),
        KernelSpec("normal_hess", "Second derivatives of mu . n with respect to (q, lam).", (q, lam, par, mu),
                   (_hessian(dot(mu.symbols, normal), unknowns),)),
    ]  # fmt: skip


def _feasibility_kernels(f: Continuous) -> list[KernelSpec]:
    """Shortest time to a surface: first root of the quadratic g + g' t + g'' t^2 / 2, from the middle of a phase's first step.

    ``a`` are the averaged accelerations at full input.  The state half a step after the phase's start is (qm, v), so that h/2 is added to
    the root; the directions of g'' are taken half-way between qm and the collision q_c.
    """
    if not f.g:
        return []
    e = step_element(f, se.Symbol, se.Rational(1, 2))
    q_c, a = Input.vector("q_c", len(f.q)), Input.vector("a", len(f.q))
    half_way = {s: (s + c) / 2 for s, c in zip(f.q, q_c.symbols, strict=True)}
    n, half = len(f.q), len(e.z) - 1
    times = [e.h / 2 + first_root(*approach(g, f, a.symbols, half_way)) for g in f.g]
    columns = (*range(2 * n), half)

    def row(t: Any) -> list[Any]:
        return [e.D(t, i) for i in columns] + gradient(t, q_c.symbols) + gradient(t, a.symbols)

    inputs = (Input("q_k", e.q_k), Input("q_kp1", e.q_kp1), Input("h", (e.h,)), q_c, a, Input("par", f.par))
    return [
        KernelSpec("min_time", "Shortest time to each surface at averaged full acceleration.", inputs,
                   (Output.vector("T_min", times),), e.definitions),
        KernelSpec("min_time_jac", "First derivatives of T_min with respect to (q_k, q_kp1, h, q_c, a).", inputs,
                   (Output.matrix("T_min_D_y", [row(t) for t in times], 4 * n + 1),), e.definitions),
    ]  # fmt: skip


def approach(g: Any, f: Continuous, a: Sequence[Any], half_way: dict[Any, Any]) -> tuple[Any, Any, Any]:
    """Return g, g' and g'' along the motion with velocity v and acceleration a."""
    slope = gradient(g, f.q)
    curvature = [dot(gradient(s, f.q), f.v) for s in slope]
    return g, dot(slope, f.v), dot([s.subs(half_way) for s in slope], a) + dot(curvature, f.v)


def first_root(g: Any, rate: Any, acceleration: Any) -> Any:
    """First positive root of g + rate t + acceleration t^2 / 2 for g < 0; not a number, or not positive, where there is none."""
    half = 1 / (1 + g**0)  # exact in the expression type of g
    return -2 * g / (rate + (rate**2 - 2 * g * acceleration) ** half)


def _hessian(expression: Any, symbols: Sequence[Any]) -> Output:
    rows = [[expression.diff(a).diff(b) if j >= i else 0 for j, b in enumerate(symbols)] for i, a in enumerate(symbols)]
    return Output.matrix("hess", rows, len(symbols), upper=True)
