"""Kernels of path constraints r(q, v, u, t) >= 0 and of quantities z(q, v, u, t): in a step, at its
ends, at nodes, and at states of their own.

Where inputs have a value of their own at a node, a constraint on them stands there.  At order 2 the
velocity at a node inside a phase is (q_kp1 - q_km1)/(2 h), right to h^2; at higher orders that of
the step's polynomial.  At the ends of phases velocities are unknowns.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import sympy as sp

from dmoc.symbolic.continuous import Continuous, dot
from dmoc.symbolic.discrete import StepElement, at_ends
from dmoc.symbolic.graph import Node
from dmoc.symbolic.kernel_family import family, parameters, state_inputs
from dmoc.symbolic.spec import Input, KernelSpec, Output


def path_rows(
    f: Continuous, names: Sequence[str | None], functions: Sequence[Node]
) -> list[dict[str, Any]]:
    """What each path constraint, or other function, depends on: numbers of the coordinates,
    whether on velocities, inputs and the time.  Those of hidden unknowns have no name."""
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


def path_kernels(f: Continuous, e: StepElement, step: tuple[Input, ...]) -> list[KernelSpec]:
    """All kernels of the path constraints; ``step`` are the arguments of a step."""
    return _along("path", "r", "Path constraints {} >= 0", f, e, step)


def quantity_kernels(f: Continuous, e: StepElement, step: tuple[Input, ...]) -> list[KernelSpec]:
    """The same kernels of the quantities."""
    g = replace(f, r=f.z)
    points = tuple(
        replace(p, start=replace(p.start, r=p.start.z), end=replace(p.end, r=p.end.z))
        for p in e.points
    )
    return _along("quantity", "z", "Quantities {}", g, replace(e, points=points), step)


def _along(
    name: str, a: str, text: str, f: Continuous, e: StepElement, step: tuple[Input, ...]
) -> list[KernelSpec]:
    """Kernels of the functions r, which are called ``a``."""
    if not f.r:
        return []
    par = parameters(f)
    state = (Input("q", f.q), Input("v", f.v), Input("u", f.u), Input("t", (f.t,)))
    kernels = [
        *_of_step(name, f"{text.format(f'{a}_d')} of a step.", f"{a}_d", e, step, par),
        *family(f"{name}_point", f"{text.format(a)} at a state.", state, {a: f.r}, par),
    ]
    if not e.inside:
        return kernels + _at_node(name, a, text, f, par)
    ends = at_ends(f, e, f.L.graph.symbol, float)
    at_both = f"{text.format(f'{a}_e')} at the start and at the end of a step."
    return kernels + _of_step(f"{name}_ends", at_both, f"{a}_e", ends, step, par)


def quantity_values(f: Continuous) -> list[KernelSpec]:
    """Kernels of the quantities at states, without the hidden unknowns."""
    if not f.z:
        return []
    *state, par = state_inputs(f)
    return family("quantity_value", "Quantities z.", tuple(state), {"z_s": f.z}, par, second=False)


def path_limits(f: Continuous, terms: Sequence[Node]) -> list[KernelSpec]:
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
    return family(name, text, step, {output: e.r_d}, par, e.chain, e.spread, e.definitions)


def _at_node(name: str, a: str, text: str, f: Continuous, par: Input) -> list[KernelSpec]:
    """The functions r at a node inside a phase."""
    n, g = len(f.q), f.L.graph
    h = g.symbol("h")
    before, after = (Input.vector(g, name, n) for name in ("q_km1", "q_kp1"))
    inputs = (before, Input("q_k", f.q), after, Input("u_k", f.u), Input("h", (h,)),
              Input("t_k", (f.t,)))  # fmt: skip

    def chain(partial: Callable[[Sequence[Node]], list[Node]]) -> list[Node]:
        by = dict(zip(symbols := (*f.q, *f.v, *f.u, h, f.t), partial(symbols), strict=True))
        rates = [by[v] / (2 * h) for v in f.v]
        slowed = by[h] - dot(f.v, [by[v] for v in f.v]) / h
        return [*(-r for r in rates), *(by[q] for q in f.q), *rates, *(by[u] for u in f.u), slowed,
                by[f.t]]  # fmt: skip

    central = tuple(
        (v, (right - left) / (2 * h))
        for v, left, right in zip(f.v, before.symbols, after.symbols, strict=True)
    )
    text = f"{text.format(f'{a}_k')} at a node inside a phase, from the three nodes around it."
    return family(f"{name}_node", text, inputs, {f"{a}_k": f.r}, par, chain, definitions=central)


def terms_of(r: Any) -> tuple[Any, ...]:
    """The terms of a sum, an expression of SymPy."""
    return tuple(sp.Add.make_args(r if r.is_Add else sp.expand(r)))
