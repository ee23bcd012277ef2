"""From a system to the list of kernels that the numerical layers call.

Letters: ``nq`` coordinates, ``nu`` inputs, ``nc`` surfaces; ``z = (q_k, q_kp1, u_k, u_kp1, h, t_k, q_i)``; ``a_D_b`` is the derivative of
a with respect to b, ``hess`` an upper triangle of second derivatives of a weighted sum.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import Any

import symengine as se
import sympy as sp

from dmoc.discretisation import check_order
from dmoc.symbolic.continuous import (
    Continuous,
    dot,
    energy,
    gap_rates,
    gradient,
    input_matrix,
    jacobian,
    mass_matrix,
    momenta,
    restitution_work,
    right_hand_side,
)
from dmoc.symbolic.discrete import StepElement, step_element
from dmoc.symbolic.names import name_of
from dmoc.symbolic.spec import Input, KernelSpec, ModelSpec, Output
from dmoc.symbolic.system import MechanicalSystem, check_system

FORMAT = 4  # of the facts and the kernel list; a manifest of another format is refused


def model_spec(system: MechanicalSystem, order: int = 2) -> ModelSpec:
    """Derive all kernels of ``system`` for the discretisation of the given order."""
    check_system(system)
    check_order(order)
    nq, nu, npar = len(system.coordinates), len(system.inputs), len(system.parameters)

    def symbols(name: str, size: int) -> tuple[Any, ...]:
        return tuple(sp.Symbol(f"{name}_{i}", real=True) for i in range(size))

    t = sp.Symbol("t", real=True)
    f = Continuous.of(system, symbols("q", nq), symbols("v", nq), symbols("u", nu), t, symbols("par", npar)).to_symengine()
    e = step_element(f, order, se.Symbol, se.sympify)
    kernels = [*_step_kernels(f, e), *_state_kernels(f), *_surface_kernels(f), *_terminal_kernels(f), *_feasibility_kernels(f)]
    return ModelSpec(system.name, model_fingerprint(system, order), _facts(system, f, order), tuple(kernels))


def model_key(system: MechanicalSystem, order: int = 2) -> str:
    """Return the key of the kernels of ``system`` in a cache: the fingerprint and the title, which the manifest holds."""
    check_system(system)
    check_order(order)
    return f"{model_fingerprint(system, order)}\n{_title(system)}"


def model_fingerprint(system: MechanicalSystem, order: int) -> str:
    """What solutions depend on: the content of ``system``, its units, the order and the format of the kernel list."""
    units = "".join(f"\n{name} {unit}" for name, unit in system.units.items())
    return hashlib.sha256(f"{FORMAT}\n{order}\n{system.fingerprint()}{units}".encode()).hexdigest()


def _title(system: MechanicalSystem) -> str:
    return system.title or system.name


def _facts(system: MechanicalSystem, f: Continuous, order: int) -> dict[str, Any]:
    in_mass = set().union(*(e.free_symbols for row in mass_matrix(f) for e in row))
    in_forces = set().union(set(), *(e.free_symbols for row in input_matrix(f) for e in row))
    surface_coordinates = {
        name: [i for i, s in enumerate(f.q) if s in g.free_symbols] for name, g in zip(system.surfaces, f.g, strict=True)
    }
    return {
        "format": FORMAT,
        "order": order,
        "explicit_time": any(f.t in e.free_symbols for e in (f.L, *f.Q, f.C, f.Phi, *f.g, *f.r)),
        "title": _title(system),
        "coordinates": [name_of(q) for q in system.coordinates],
        "inputs": [name_of(u) for u in system.inputs],
        "units": dict(system.units),
        "surfaces": list(system.surfaces),
        "surface_coordinates": surface_coordinates,
        "moving_surfaces": [name for name, g in zip(system.surfaces, f.g, strict=True) if f.t in g.free_symbols],
        "path_constraints": list(system.path_constraints),
        "parameters": {name_of(s): (None if x is None else float(x)) for s, x in system.parameters.items()},
        "mass_parameters": [name_of(s) for s, x in zip(system.parameters, f.par, strict=True) if x in in_mass],
        "inputs_enter_linearly": not in_forces & set(f.u),
        "terminal_velocity": bool(f.Phi.free_symbols & set(f.v)),
    }


def _step_kernels(f: Continuous, e: StepElement) -> list[KernelSpec]:
    inputs = (
        Input("q_k", e.q_k),
        Input("q_kp1", e.q_kp1),
        Input("u_k", e.u_k),
        Input("u_kp1", e.u_kp1),
        Input("h", (e.h,)),
        Input("t_k", (e.t_k,)),
        Input("q_i", e.q_i),
        Input("par", f.par),
    )
    nz, nq = len(e.z), len(f.q)
    mu_minus, mu_plus, mu_i = Input.vector("mu_minus", nq), Input.vector("mu_plus", nq), Input.vector("mu_i", len(e.q_i))
    sigma = Input.vector("sigma", 1)
    weights = Input.vector("w_e", 2)
    lagrangian = sigma.symbols[0] * e.C_d + dot(mu_minus.symbols, e.r_minus) + dot(mu_plus.symbols, e.r_plus)
    if e.q_i:
        lagrangian = lagrangian + dot(mu_i.symbols, e.r_i)
    kernels = [
        _step(e, "step", "Momenta at both ends of a step, its cost, and the equations of the nodes inside.", inputs,
              Output.vector("r_minus", e.r_minus), Output.vector("r_plus", e.r_plus), Output.vector("C_d", [e.C_d]),
              Output.vector("r_i", e.r_i)),
        _step(e, "step_jac", "First derivatives of `step` with respect to z.", inputs,
              Output.matrix("r_minus_D_z", e.jacobian(e.r_minus), nz), Output.matrix("r_plus_D_z", e.jacobian(e.r_plus), nz),
              Output.matrix("C_d_D_z", e.jacobian([e.C_d]), nz), Output.matrix("r_i_D_z", e.jacobian(e.r_i), nz)),
        _step(e, "step_hess", "Second derivatives of sigma C_d + mu_minus . r_minus + mu_plus . r_plus + mu_i . r_i.",
              (*inputs, sigma, mu_minus, mu_plus, mu_i), Output.matrix("hess", e.hessian(lagrangian), nz, upper=True)),
        _step(e, "impact", "Discrete energies at the end (e_plus) and at the start (e_minus) of a step.", inputs,
              Output.vector("e_plus", [e.e_plus]), Output.vector("e_minus", [e.e_minus])),
        _step(e, "impact_jac", "First derivatives of `impact` with respect to z.", inputs,
              Output.matrix("e_plus_D_z", e.jacobian([e.e_plus]), nz), Output.matrix("e_minus_D_z", e.jacobian([e.e_minus]), nz)),
        _step(e, "impact_hess", "Second derivatives of w_e . (e_plus, e_minus).", (*inputs, weights),
              Output.matrix("hess", e.hessian(dot(weights.symbols, (e.e_plus, e.e_minus))), nz, upper=True)),
    ]  # fmt: skip
    if f.r:
        w = Input.vector("w", len(e.r_d))
        kernels += [
            _step(e, "path", "Path constraints r_d >= 0 of a step.", inputs, Output.vector("r_d", e.r_d)),
            _step(e, "path_jac", "First derivatives of `path`.", inputs, Output.matrix("r_d_D_z", e.jacobian(e.r_d), nz)),
            _step(e, "path_hess", "Second derivatives of w . r_d.", (*inputs, w),
                  Output.matrix("hess", e.hessian(dot(w.symbols, e.r_d)), nz, upper=True)),
        ]  # fmt: skip
    return kernels


def _step(e: StepElement, name: str, summary: str, inputs: tuple[Input, ...], *outputs: Output) -> KernelSpec:
    return KernelSpec(name, summary, inputs, outputs, e.definitions)


def _state_kernels(f: Continuous) -> list[KernelSpec]:
    """Kernels of the continuous equations: they serve the initial guess and the independent check."""
    q, v, u, t, par = _inputs(f)
    w = Input.vector("w", len(f.q))
    mass = [entry for row in mass_matrix(f) for entry in row]
    force = right_hand_side(f)
    b = [entry for row in input_matrix(f) for entry in row]
    state = (*f.q, *f.v)
    moment = (*state, f.t)
    return [
        KernelSpec("dynamics", "Equations of motion M q'' = F: M row by row, F.", (q, v, u, t, par),
                   (Output.vector("M", mass), Output.vector("F", force))),
        KernelSpec("dynamics_jac", "First derivatives of `dynamics` with respect to (q, v).", (q, v, u, t, par),
                   (Output.matrix("M_D_s", jacobian(mass, state), len(state)), Output.matrix("F_D_s", jacobian(force, state), len(state)))),
        KernelSpec("input_matrix", "B = dQ/du row by row.", (q, v, u, t, par), (Output.vector("B", b),)),
        KernelSpec("force", "Generalised forces Q, and the power Q . v - dL/dt that changes the energy.", (q, v, u, t, par),
                   (Output.vector("Q", f.Q), Output.vector("power", [dot(f.Q, f.v) - f.L.diff(f.t)]))),
        KernelSpec("legendre", "Momenta p = dL/dv and energy E = v . p - L.", (q, v, t, par),
                   (Output.vector("p", momenta(f)), Output.vector("E", [energy(f)]))),
        KernelSpec("legendre_jac", "First derivatives of p with respect to (q, v, t).", (q, v, t, par),
                   (Output.matrix("p_D_s", jacobian(momenta(f), moment), len(moment)),)),
        KernelSpec("legendre_hess", "Second derivatives of w . p with respect to (q, v, t).", (q, v, t, par, w),
                   (_hessian(dot(w.symbols, momenta(f)), moment),)),
        KernelSpec("running_cost", "Integrand C of the cost and its second derivatives in u.", (q, v, u, t, par),
                   (Output.vector("C", [f.C]), Output.vector("C_DD_u", [f.C.diff(s).diff(s) for s in f.u]))),
    ]  # fmt: skip


def _inputs(f: Continuous) -> tuple[Input, Input, Input, Input, Input]:
    return Input("q", f.q), Input("v", f.v), Input("u", f.u), Input("t", (f.t,)), Input("par", f.par)


def _surface_kernels(f: Continuous) -> list[KernelSpec]:
    """Kernels of the gaps g(q, t), of the normal impulse lam . grad g and of the law of restitution."""
    if not f.g:
        return []
    q, v, _, t, par = _inputs(f)
    w, lam, mu = Input.vector("w", len(f.g)), Input.vector("lam", len(f.g)), Input.vector("mu", len(f.q))
    e, weight, rate_weight = Input.vector("e", len(f.g)), Input.vector("w_W", 1), Input.vector("w_w", len(f.g))
    normal = gradient(dot(lam.symbols, f.g), f.q)
    work, rates = restitution_work(f, lam.symbols, e.symbols), gap_rates(f)
    place, unknowns, state = (*f.q, f.t), (*f.q, *lam.symbols, f.t), (*f.q, *f.v, f.t)
    impact = (*f.q, *f.v, *lam.symbols, f.t)
    return [
        KernelSpec("surface", "Gaps g <= 0.", (q, t, par), (Output.vector("g", f.g),)),
        KernelSpec("surface_jac", "First derivatives of the gaps with respect to (q, t).", (q, t, par),
                   (Output.matrix("g_D_q", jacobian(f.g, place), len(place)),)),
        KernelSpec("surface_hess", "Second derivatives of w . g with respect to (q, t).", (q, t, par, w),
                   (_hessian(dot(w.symbols, f.g), place),)),
        KernelSpec("gap_rate", "Rates w of the gaps.", (q, v, t, par), (Output.vector("w", rates),)),
        KernelSpec("gap_rate_jac", "First derivatives of the rates with respect to (q, v, t).", (q, v, t, par),
                   (Output.matrix("w_D_s", jacobian(rates, state), len(state)),)),
        KernelSpec("gap_rate_hess", "Second derivatives of w_w . w with respect to (q, v, t).", (q, v, t, par, rate_weight),
                   (_hessian(dot(rate_weight.symbols, rates), state),)),
        KernelSpec("normal", "Normal impulse n = sum_j lam_j grad g_j.", (q, lam, t, par), (Output.vector("n", normal),)),
        KernelSpec("normal_jac", "First derivatives of n with respect to (q, lam, t).", (q, lam, t, par),
                   (Output.matrix("n_D_ql", jacobian(normal, unknowns), len(unknowns)),)),
        KernelSpec("normal_hess", "Second derivatives of mu . n with respect to (q, lam, t).", (q, lam, t, par, mu),
                   (_hessian(dot(mu.symbols, normal), unknowns),)),
        KernelSpec("restitution", "W in e (E+ - E-) = W at a collision, with v after it and the coefficients of restitution e.",
                   (q, v, lam, t, par, e), (Output.vector("W", [work]),)),
        KernelSpec("restitution_jac", "First derivatives of W with respect to (q, v, lam, t).", (q, v, lam, t, par, e),
                   (Output.matrix("W_D_s", jacobian([work], impact), len(impact)),)),
        KernelSpec("restitution_hess", "Second derivatives of w_W W with respect to (q, v, lam, t).", (q, v, lam, t, par, e, weight),
                   (_hessian(weight.symbols[0] * work, impact),)),
    ]  # fmt: skip


def _terminal_kernels(f: Continuous) -> list[KernelSpec]:
    """Kernels of the terminal cost Phi(q, v, t)."""
    if f.Phi == 0:
        return []
    q, v, _, t, par = _inputs(f)
    sigma, state = Input.vector("sigma", 1), (*f.q, *f.v, f.t)
    return [
        KernelSpec("terminal_cost", "Terminal cost Phi.", (q, v, t, par), (Output.vector("Phi", [f.Phi]),)),
        KernelSpec("terminal_cost_jac", "First derivatives of Phi with respect to (q, v, t).", (q, v, t, par),
                   (Output.matrix("Phi_D_s", jacobian([f.Phi], state), len(state)),)),
        KernelSpec("terminal_cost_hess", "Second derivatives of sigma Phi with respect to (q, v, t).", (q, v, t, par, sigma),
                   (_hessian(sigma.symbols[0] * f.Phi, state),)),
    ]  # fmt: skip


def _feasibility_kernels(f: Continuous) -> list[KernelSpec]:
    """Shortest time to a surface that stands still: first root of the quadratic g + g' t + g'' t^2 / 2, from the middle of a phase's first step.

    ``a`` are the averaged accelerations at full input.  The state half a step after the phase's start is (qm, v), so that h/2 is added to
    the root; the directions of g'' are taken half-way between qm and the collision q_c.
    """
    if not f.g or any(f.t in g.free_symbols for g in f.g):
        return []
    e = step_element(f, 2, se.Symbol, se.sympify)
    q_c, a = Input.vector("q_c", len(f.q)), Input.vector("a", len(f.q))
    half_way = {s: (s + c) / 2 for s, c in zip(f.q, q_c.symbols, strict=True)}
    n, half = len(f.q), e.at_h
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
