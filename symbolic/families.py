"""From a system to the list of kernels that the numerical layers call.

Letters: ``nq`` coordinates, ``nu`` inputs, ``nc`` surfaces, ``nt`` tangents; ``x_k = (q_k, q_kp1,
u_k, u_kp1, h, t_k, q_i)``; ``a_D`` is the derivative of a with respect to the inputs of its kernel
before the parameters, ``hess`` an upper triangle of second derivatives of a weighted sum.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import sympy as sp

from dmoc.base.collection import uncollected
from dmoc.base.discretisation import DISCRETISATIONS, known_order
from dmoc.base.names import name_of
from dmoc.symbolic.contact_forces import forces_at_events, residual
from dmoc.symbolic.contact_kernels import (
    joint_kernels,
    joint_step_kernels,
    slide_step_kernels,
    surface_kernels,
    tangent_kernels,
    varying,
)
from dmoc.symbolic.contact_references import symbols_of_forces
from dmoc.symbolic.continuous import (
    FUNCTIONS,
    Continuous,
    as_tuple,
    dot,
    energy,
    friction_of,
    input_matrix,
    keeps_rate,
    mass_matrix,
    momenta,
    right_hand_side,
)
from dmoc.symbolic.crossing_kernels import crossing_facts, crossing_kernels
from dmoc.symbolic.design import SHOWN, check_design
from dmoc.symbolic.discrete import StepElement, step_element
from dmoc.symbolic.drawing import table_of_drawing, values_of
from dmoc.symbolic.end_kernels import coordinates_of_ends, end_kernels, ends_of
from dmoc.symbolic.event_sums import event_kernels, event_rows, hit_quantity_rows
from dmoc.symbolic.graph import Graph, gradient, reverse
from dmoc.symbolic.grips import names_of_places, rates_alone
from dmoc.symbolic.hidden_unknowns import hidden_facts, hidden_kernels, hidden_names
from dmoc.symbolic.kernel_family import family, parameters, state_inputs
from dmoc.symbolic.kinks import split
from dmoc.symbolic.objectives import integrand_kernels, objective_facts, objective_kernels
from dmoc.symbolic.path_constraints import (
    path_kernels,
    path_limits,
    path_rows,
    quantity_kernels,
    quantity_rows,
    quantity_values,
    terms_of,
)
from dmoc.symbolic.restitution import laws_in_words, rebound_kernels, tangential_kernels
from dmoc.symbolic.scalar import Scalar
from dmoc.symbolic.shortest_times import shortest_time_kernels
from dmoc.symbolic.spec import Input, KernelSpec, ModelSpec, Output
from dmoc.symbolic.strengths import strength_kernels
from dmoc.symbolic.system import MechanicalSystem, check_system
from dmoc.symbolic.tangent_pairs import pair_kernels
from dmoc.symbolic.traversal import operations

FORMAT = 26  # of the facts and the kernel list
# Operations of the second derivatives of a Lagrangian at all points of a step, and elsewhere, from
# which on it is a function of its own.
LARGE_STEP, LARGE = 500, 600
EQUATIONS = 6  # of what the kernels compute: solutions of other equations are refused


@uncollected()
def model_spec(system: MechanicalSystem, order: int = 2, design: Sequence[str] = ()) -> ModelSpec:
    """Derive all kernels of ``system`` for the discretisation of the given order, with derivatives
    by the parameters ``design``."""
    check_system(system)
    order = known_order(order)
    nq, nu, npar = len(system.coordinates), len(system.inputs), len(system.parameters)
    nx = len(system.definitions)

    def symbols(name: str, count: int) -> tuple[Any, ...]:
        return tuple(sp.Symbol(f"{name}_{i}", real=True) for i in range(count))

    t = sp.Symbol("t", real=True)
    hidden = symbols("s", len(split(system).unknowns))
    plain = Continuous.of(
        system, symbols("q", nq), symbols("v", nq), symbols("u", nu), t, symbols("par", npar),
        symbols("x", nx), symbols("x_dot", nx), symbols_of_forces(system, "y"),
    )  # fmt: skip
    graph = Graph()
    f, smooth = plain.to_nodes(graph), plain.smooth(system, hidden).to_nodes(graph)
    check_design(system, f, design)
    names = [name_of(s) for s in system.parameters]
    chosen = tuple(f.par[names.index(name)] for name in design)
    f, smooth = (replace(g, design=chosen) for g in (f, smooth))
    terms = [terms_of(r) for r in plain.r]
    strengths = plain.rewritten(system, list(system.strength.values()))
    points, fingerprint = DISCRETISATIONS[order].degree, model_fingerprint(system, order)
    kernels = [
        *_step_kernels(
            system,
            plain,
            smooth,
            *(
                step_element(_light(smooth, most / points), order, graph.symbol, float)
                for most in (LARGE_STEP, LARGE)
            ),
        ),
        *path_limits(f, plain.as_nodes([t for own in terms for t in own], graph)),
        *quantity_values(f),
        *_state_kernels(f, light := _light(f, LARGE)),
        *forces_at_events(light, _supports(system)),
        *integrand_kernels(f),
        *event_kernels(system, plain, f),
        *surface_kernels(f),
        *crossing_kernels(f),
        *end_kernels(f),
        *rebound_kernels(f),
        *tangent_kernels(f, points),
        *tangential_kernels(f),
        *pair_kernels(f, system),
        *joint_kernels(f),
        *strength_kernels(f, plain.as_nodes(strengths, graph)),
        *_terminal_kernels(f),
        *shortest_time_kernels(f),
        *_drawing_kernels(f),
    ]
    return ModelSpec(
        system.name,
        fingerprint,
        {"format": FORMAT, "key": _key(system, fingerprint, design), "order": order}
        | _facts(system, f, smooth, [len(own) for own in terms])
        | ({"design": list(design)} if design else {}),
        tuple(kernels),
    )


def _light(f: Continuous, most: float) -> Continuous:
    """The same system; where the second derivatives of its Lagrangian are not below so many
    operations, it is a function of its own, which kernels call."""
    used = f.L.free_symbols
    symbols = (*f.q, *f.v, *(s for s in (f.t, *f.design) if s in used))
    curvature = [slope.diff(s) for slope in reverse(f.L, symbols) for s in symbols]
    if operations(curvature) < most:
        return f
    return replace(f, L=Scalar("lagrangian", symbols, f.L, f.par)(symbols))


def model_key(system: MechanicalSystem, order: int = 2, design: Sequence[str] = ()) -> str:
    """Return the key of the kernels of ``system`` in a cache: a digest of the format, the
    fingerprint, and of the title and the drawing, which the manifest holds, and of the names of
    parameters that derivatives are by."""
    check_system(system)
    return _key(system, model_fingerprint(system, known_order(order)), design)


def _key(system: MechanicalSystem, fingerprint: str, design: Sequence[str]) -> str:
    lines = [str(FORMAT), fingerprint, _title(system)]
    for (kind, name, *_), part in zip(table_of_drawing(system.drawing), system.shapes, strict=True):
        lines += [f"{kind} {name}", *map(sp.srepr, values_of(part))]
    lines += [f"design {name}" for name in design]
    lines += [f"attitude {n} {' '.join(map(name_of, p))}" for n, p in system.attitudes.items()]
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()


def model_fingerprint(system: MechanicalSystem, order: int) -> str:
    """Digest of all that solutions depend on: the content of ``system``, its units, the order and
    the equations; not its title and its drawing."""
    units = "".join(f"\n{name} {unit}" for name, unit in system.units.items())
    return hashlib.sha256(
        f"{EQUATIONS}\n{order}\n{system.fingerprint()}{units}".encode()
    ).hexdigest()


def _title(system: MechanicalSystem) -> str:
    return system.title or system.name


def _facts(
    system: MechanicalSystem, f: Continuous, smooth: Continuous, terms: list[int]
) -> dict[str, Any]:
    in_mass = set().union(*(e.free_symbols for row in mass_matrix(f) for e in row))
    in_forces = set().union(set(), *(e.free_symbols for row in input_matrix(f) for e in row))
    parts = split(system)
    without = [name for name in system.tangents if name not in friction_of(system)]
    along = list(system.quantities_along)
    more = {"without_friction": without, "quantities": quantity_rows(f, along)}
    more |= {"hit_sums": event_rows(system), "hit_quantities": hit_quantity_rows(system)}
    more |= crossing_facts(system, f)
    more["within"] = coordinates_of_ends(system, f)
    attitudes = {
        name: [system.coordinates.index(q) for q in p] for name, p in system.attitudes.items()
    }
    more["attitudes"] = {name: p for name, p in attitudes.items() if len(p) == 4}
    more["pitches"] = [p[1] for p in attitudes.values() if len(p) == 3]
    more["grips"], more["by_rate"] = names_of_places(system.grips), rates_alone(system)
    more["strength"] = list(system.strength)
    more["static_friction"] = [n for n, e in system.friction.items() if isinstance(e, sp.Tuple)]
    more["varying_friction"] = path_rows(f, *varying(f, list(system.tangents)))
    more["rate_constraints"] = [
        name for name, c in zip(system.constraints, f.phi, strict=True) if keeps_rate(f, c)
    ]
    more["rate_tangents"] = [
        name for name, tau in zip(system.tangents, f.tau, strict=True) if keeps_rate(f, tau)
    ]
    facts = {
        "explicit_time": any(
            f.t in e.free_symbols
            for name in FUNCTIONS
            if name not in SHOWN
            for e in as_tuple(getattr(f, name))
        ),
        "title": _title(system),
        "coordinates": [name_of(q) for q in system.coordinates],
        "inputs": [name_of(u) for u in system.inputs],
        "units": dict(system.units),
        "surfaces": list(system.gaps),
        "surface_coordinates": _coordinates_in(f, system.gaps, f.g),
        "moving_surfaces": [
            name
            for j, (name, g) in enumerate(zip(system.gaps, f.g, strict=True))
            if any(f.t in e.free_symbols for e in (g, *ends_of(f).get(j, ())))
        ],
        "path_constraints": list(system.path_constraints),
        "path_rows": path_rows(smooth, [name for name, _ in parts.rows], smooth.r),
        "path_limits": [
            row | {"terms": count}
            for row, count in zip(
                path_rows(f, list(system.path_constraints), f.r), terms, strict=True
            )
        ],
        "kink_signs": {name_of(s): parts.signs[s] for s in system.parameters if s in parts.signs},
        "hidden": hidden_names(system),
        "tangents": list(system.tangents),
        "tangent_coordinates": _coordinates_in(f, system.tangents, f.tau),
        "joints": list(system.constraints),
        "bent_joints": [
            name
            for name, phi in zip(system.constraints, f.phi, strict=True)
            if not keeps_rate(f, phi) and any(s.free_symbols & set(f.q) for s in gradient(phi, f.q))
        ],
        "drawing": table_of_drawing(system.drawing),
        "parameters": {
            name_of(s): (None if x is None else float(x)) for s, x in system.parameters.items()
        },
        "mass_parameters": [
            name_of(s) for s, x in zip(system.parameters, f.par, strict=True) if x in in_mass
        ],
        "inputs_enter_linearly": not in_forces & set(f.u),
        "terminal_velocity": bool(f.Phi.free_symbols & set(f.v)),
    }
    more = {key: values for key, values in more.items() if values}
    return facts | laws_in_words(system) | more | objective_facts(system) | hidden_facts(system)


def _coordinates_in(
    f: Continuous, names: Iterable[str], values: Sequence[Any]
) -> dict[str, list[int]]:
    """The coordinates that each of some functions contains."""
    return {
        name: [i for i, s in enumerate(f.q) if s in value.free_symbols]
        for name, value in zip(names, values, strict=True)
    }


def _step_kernels(
    system: MechanicalSystem, plain: Continuous, f: Continuous, e: StepElement,
    at_events: StepElement,
) -> list[KernelSpec]:  # fmt: skip
    inputs = (
        Input("q_k", e.q_k),
        Input("q_kp1", e.q_kp1),
        Input("u_k", e.u_k),
        Input("u_kp1", e.u_kp1),
        Input("h", (e.h,)),
        Input("t_k", (e.t_k,)),
        Input("q_i", e.q_i),
    )
    step = {"r_minus": e.r_minus, "r_plus": e.r_plus, "C_d": [e.C_d], "r_i": e.r_i}
    energies = {"e_plus": [at_events.e_plus], "e_minus": [at_events.e_minus]}
    par, ways = parameters(f), (e.chain, e.spread, e.definitions)
    return [
        *family(
            "step",
            "Momenta at both ends of a step, its cost, and the equations of the nodes inside.",
            inputs,
            step,
            par,
            *ways,
        ),
        *family(
            "impact",
            "Discrete energies at the end (e_plus) and at the start (e_minus) of a step.",
            inputs,
            energies,
            par,
            *ways,
        ),
        *joint_step_kernels(f, e, inputs),
        *slide_step_kernels(f, e, inputs),
        *path_kernels(f, e, inputs),
        *quantity_kernels(f, e, inputs, _supports(system)),
        *objective_kernels(system, plain, f, e, inputs),
        *hidden_kernels(system, plain, f, e, inputs),
    ]


def _supports(system: MechanicalSystem) -> list[int | None]:
    """The surfaces of the tangents, None of rails."""
    numbers = {name: j for j, name in enumerate(system.gaps)}
    return [numbers.get(name) for name in system.tangents]


def _state_kernels(f: Continuous, light: Continuous) -> list[KernelSpec]:
    """Kernels of the continuous equations: they serve the initial guess and the independent
    check.  ``light`` is the same system with its Lagrangian as a function of its own, whose third
    derivatives the equations of motion would need one by one."""
    q, v, u, t, par = state_inputs(f)
    mass = [entry for row in mass_matrix(f) for entry in row]
    force = right_hand_side(f)
    b = [entry for row in input_matrix(f) for entry in row]
    power = dot(f.Q, f.v) - f.L.diff(f.t)
    summary = "Equations of motion M q'' = F: M row by row, F."
    a = Input.vector(f.L.graph, "a", len(f.q))
    R = residual(light, a.symbols)
    of_forces = "Residual R = F - M a of the equations of motion at accelerations a."
    dynamics = (Output.vector("M", mass), Output.vector("F", force))
    return [
        KernelSpec("dynamics", summary, (q, v, u, t, par), dynamics),
        *family("residual", of_forces, (q, v, u, t, a), {"R": R}, par, second=False),
        KernelSpec(
            "input_matrix", "B = dQ/du row by row.", (q, v, u, t, par), (Output.vector("B", b),)
        ),
        KernelSpec(
            "force",
            "Generalised forces Q, and the power Q . v - dL/dt that changes the energy.",
            (q, v, u, t, par),
            (Output.vector("Q", f.Q), Output.vector("power", [power])),
        ),
        *family("momentum", "Momenta p = dL/dv.", (q, v, t), {"p": momenta(light)}, par),
        KernelSpec(
            "energy",
            "Energy E = v . p - L.",
            (q, v, t, par),
            (Output.vector("E", [energy(light)]),),
        ),
        KernelSpec(
            "running_cost",
            "Integrand C of the cost and its second derivatives in u.",
            (q, v, u, t, par),
            (
                Output.vector("C", [f.C]),
                Output.vector("C_DD_u", [f.C.diff(s).diff(s) for s in f.u]),
            ),
        ),
    ]


def _terminal_kernels(f: Continuous) -> list[KernelSpec]:
    """Kernels of the terminal cost Phi(q, v, t)."""
    if f.Phi is f.Phi.graph.zero:
        return []
    q, v, _, t, par = state_inputs(f)
    return family("terminal_cost", "Terminal cost Phi.", (q, v, t), {"Phi": [f.Phi]}, par)


def _drawing_kernels(f: Continuous) -> list[KernelSpec]:
    """The values of the drawing; nothing is differentiated by them."""
    if not f.looks:
        return []
    q, _, _, t, par = state_inputs(f)
    drawn = (Output.vector("shapes", f.looks),)
    return [KernelSpec("drawing", "Values of the shapes of the drawing.", (q, t, par), drawn)]
