"""Kernels of path constraints r(q, v, u, t) >= 0 and of quantities z(q, v, u, t): in a step, at its
ends, at nodes, and at states of their own; momenta as quantities.

Where inputs have a value of their own at a node, a constraint on them stands there.  At order 2 the
velocity at a node inside a phase is (q_kp1 - q_km1)/(2 h), right to h^2; at higher orders that of
the step's polynomial.  At the ends of phases velocities are unknowns.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import sympy as sp

from dmoc.base.names import bounded_momentum, momentum_name, name_of, unit_of
from dmoc.symbolic.contact_forces import equations_of_forces, forces_input
from dmoc.symbolic.continuous import Continuous, dot
from dmoc.symbolic.definitions import expanded
from dmoc.symbolic.discrete import StepElement, at_ends
from dmoc.symbolic.graph import GraphNode
from dmoc.symbolic.kernel_family import family, parameters, state_inputs, with_more
from dmoc.symbolic.spec import Input, KernelSpec, Output

if TYPE_CHECKING:
    from dmoc.symbolic.system import MechanicalSystem


def path_rows(
    f: Continuous, names: Sequence[str], functions: Sequence[GraphNode]
) -> list[dict[str, Any]]:
    """What each path constraint, or other function, depends on: numbers of the coordinates,
    whether on velocities, inputs and the time."""
    return [
        {
            "name": name,
            "coordinates": [i for i, s in enumerate(f.q) if s in r.free_symbols],
            "velocities": bool(r.free_symbols & set(f.v)),
            "inputs": bool(r.free_symbols & set(f.u)),
            "time": f.t in r.free_symbols,
        }
        for name, r in zip(names, functions, strict=True)
    ]


def quantity_rows(f: Continuous, names: Sequence[str]) -> list[dict[str, Any]]:
    """The rows of :func:`path_rows` for the quantities; those with forces depend on all of a
    state."""
    every = {"coordinates": list(range(len(f.q))), "velocities": True, "inputs": True}
    return [
        row | every | {"forces": True} if z.free_symbols & set(f.y) else row
        for row, z in zip(path_rows(f, names, f.z), f.z, strict=True)
    ]


def path_kernels(f: Continuous, e: StepElement, step: tuple[Input, ...]) -> list[KernelSpec]:
    """All kernels of the path constraints; ``step`` are the arguments of a step."""
    without = _put(f, e, lambda f: f.r, forces=False)
    return _along("path", "r", "Path constraints {} >= 0", *without, step)


def quantity_kernels(
    f: Continuous, e: StepElement, step: tuple[Input, ...], supports: Sequence[int | None]
) -> list[KernelSpec]:
    """All kernels of the quantities, and of the equations of the forces that they contain;
    ``supports`` are the surfaces of the tangents, None of rails."""
    kernels = _along("quantity", "z", "Quantities {}", *_put(f, e, lambda f: f.z), step)
    if not f.y:
        return kernels
    text = "Equations of the accelerations and forces {} = 0"
    own = replace(e, points=()) if e.inside else e
    equations = partial(equations_of_forces, supports=supports)
    return kernels + _along("forces", "e", text, *_put(f, own, equations), step)


def _put(
    f: Continuous, e: StepElement, functions: Callable[[Continuous], Sequence[Any]],
    forces: bool = True,
) -> tuple[Continuous, StepElement]:  # fmt: skip
    """A system and its element with other functions in the place of the path constraints, with
    forces or without."""

    def put(f: Continuous) -> Continuous:
        return replace(f, r=tuple(functions(f)), y=f.y if forces else ())

    points = (
        replace(p, start=put(p.start), end=p.start if p.end is p.start else put(p.end))
        for p in e.points
    )
    return put(f), replace(e, points=tuple(points))


def _along(
    name: str, a: str, text: str, f: Continuous, e: StepElement, step: tuple[Input, ...]
) -> list[KernelSpec]:
    """Kernels of the functions r, which are called ``a``."""
    if not f.r:
        return []
    par = parameters(f)
    state = (Input("q", f.q), Input("v", f.v), Input("u", f.u), Input("t", (f.t,)))
    at_state = (*state, *forces_input([f]))
    kernels = family(f"{name}_point", f"{text.format(a)} at a state.", at_state, {a: f.r}, par)
    if e.points:
        of_step = f"{text.format(f'{a}_d')} of a step."
        kernels = [*_of_step(name, of_step, f"{a}_d", e, step, par), *kernels]
    if not e.inside:
        return kernels + _at_node(name, a, text, f, par)
    ends = at_ends(f, e, f.L.graph.symbol, float)
    at_both = f"{text.format(f'{a}_e')} at the start and at the end of a step."
    return kernels + _of_step(f"{name}_ends", at_both, f"{a}_e", ends, step, par)


def quantity_values(f: Continuous) -> list[KernelSpec]:
    """Kernels of the quantities at states."""
    if not f.z:
        return []
    *state, par = state_inputs(f)
    state = [*state, *forces_input([f])]
    return family("quantity_value", "Quantities z.", tuple(state), {"z_s": f.z}, par, second=False)


def path_limits(f: Continuous, terms: Sequence[GraphNode]) -> list[KernelSpec]:
    """Path constraints as they were stated, for the check, and their terms."""
    if not f.r:
        return []
    par = parameters(f)
    state = (Input("q", f.q), Input("v", f.v), Input("u", f.u), Input("t", (f.t,)))
    text = "Path constraints r >= 0 as they were stated."
    return [
        *family("path_limit", text, state, {"r_s": f.r}, par, second=False),
        KernelSpec(
            "path_terms",
            "The terms of the path constraints, those of one after those of another.",
            (*state, par),
            (Output.vector("terms", terms),),
        ),
    ]


def _of_step(
    name: str, text: str, output: str, e: StepElement, step: tuple[Input, ...], par: Input
) -> list[KernelSpec]:
    own = forces_input([p.start for p in e.points])
    symbols = [s for i in own for s in i.symbols]
    chain, spread = (with_more(way, symbols) for way in (e.chain, e.spread))
    return family(name, text, (*step, *own), {output: e.r_d}, par, chain, spread, e.definitions)


def _at_node(name: str, a: str, text: str, f: Continuous, par: Input) -> list[KernelSpec]:
    """The functions r at a node inside a phase."""
    n, g = len(f.q), f.L.graph
    h = g.symbol("h")
    before, after = (Input.vector(g, name, n) for name in ("q_km1", "q_kp1"))
    inputs = (before, Input("q_k", f.q), after, Input("u_k", f.u), Input("h", (h,)),
              Input("t_k", (f.t,)), *forces_input([f]))  # fmt: skip

    def chain(partial: Callable[[Sequence[GraphNode]], list[GraphNode]]) -> list[GraphNode]:
        symbols = (*f.q, *f.v, *f.u, h, f.t, *f.y)
        by = dict(zip(symbols, partial(symbols), strict=True))
        rates = [by[v] / (2 * h) for v in f.v]
        slowed = by[h] - dot(f.v, [by[v] for v in f.v]) / h
        return [*(-r for r in rates), *(by[q] for q in f.q), *rates, *(by[u] for u in f.u), slowed,
                by[f.t], *(by[s] for s in f.y)]  # fmt: skip

    central = tuple(
        (v, (right - left) / (2 * h))
        for v, left, right in zip(f.v, before.symbols, after.symbols, strict=True)
    )
    text = f"{text.format(f'{a}_k')} at a node inside a phase, from the three nodes around it."
    return family(f"{name}_node", text, inputs, {f"{a}_k": f.r}, par, chain, definitions=central)


def terms_of(r: Any) -> tuple[Any, ...]:
    """The terms of a sum, an expression of SymPy."""
    return tuple(sp.Add.make_args(r if r.is_Add else sp.expand(r)))


def with_momenta(system: MechanicalSystem, coordinates: Sequence[str]) -> MechanicalSystem:
    """The same system, whose quantities have the momenta dL/dq' of some coordinates."""
    energies = expanded(system.lagrangian, system.definitions)
    by_name = dict(zip(map(name_of, system.coordinates), system.velocities, strict=True))
    momenta = {bounded_momentum(q): energies.diff(by_name[q]) for q in coordinates}
    of_names = {name_of(q): unit for q, unit in system.units.items()}
    units = {bounded_momentum(q): unit_of(momentum_name(q), of_names) for q in coordinates}
    return replace(
        system, quantities={**system.quantities, **momenta},
        units={**system.units, **{name: unit for name, unit in units.items() if unit}},
    )  # fmt: skip
