"""Kernels of path constraints r(q, v, u, t) >= 0: in a step, at its ends, at nodes, and at states
of their own.

Where inputs have a value of their own at a node, a constraint on them stands there.  At order 2 the
velocity at a node inside a phase is (q_kp1 - q_km1)/(2 h), right to h^2; at higher orders that of
the step's polynomial.  At the ends of phases velocities are unknowns.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import symengine as se

from dmoc.symbolic.continuous import Continuous
from dmoc.symbolic.discrete import StepElement, at_ends
from dmoc.symbolic.kernel_family import family
from dmoc.symbolic.spec import Input, KernelSpec, Output


def path_rows(f: Continuous, names: Sequence[str | None]) -> list[dict[str, Any]]:
    """What each path constraint depends on: numbers of the coordinates, whether on velocities,
    inputs and the time; and how many terms it has.  Those of hidden unknowns have no name."""
    return [
        {
            "name": name,
            "coordinates": [i for i, s in enumerate(f.q) if s in r.free_symbols],
            "velocities": bool(r.free_symbols & set(f.v)),
            "inputs": bool(r.free_symbols & set(f.u)),
            "time": f.t in r.free_symbols,
            "terms": len(_terms(r)),
        }
        for name, r in zip(names, f.r, strict=True)
    ]


def path_kernels(f: Continuous, e: StepElement, step: tuple[Input, ...]) -> list[KernelSpec]:
    """All kernels of the path constraints; ``step`` are the arguments of a step."""
    if not f.r:
        return []
    par = Input("par", f.par)
    state = (Input("q", f.q), Input("v", f.v), Input("u", f.u), Input("t", (f.t,)))
    kernels = [
        *_of_step("path", "Path constraints r_d >= 0 of a step.", "r_d", e, step, par),
        *family("path_point", "Path constraints r >= 0 at a state.", state, {"r": f.r}, par),
    ]
    if not e.inside:
        return kernels + _at_node(f, par)
    ends = at_ends(f, e, se.Symbol, se.sympify)
    text = "Path constraints r_e >= 0 at the start and at the end of a step."
    return kernels + _of_step("path_ends", text, "r_e", ends, step, par)


def path_limits(f: Continuous) -> list[KernelSpec]:
    """Path constraints as they were stated, for the check."""
    if not f.r:
        return []
    par = Input("par", f.par)
    state = (Input("q", f.q), Input("v", f.v), Input("u", f.u), Input("t", (f.t,)))
    terms = [term for r in f.r for term in _terms(r)]
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
    return family(name, text, step, {output: e.r_d}, par, e.D, e.definitions)


def _at_node(f: Continuous, par: Input) -> list[KernelSpec]:
    """Path constraints at a node inside a phase."""
    n, h = len(f.q), se.Symbol("h")
    before, after = (Input.vector(name, n) for name in ("q_km1", "q_kp1"))
    inputs = (before, Input("q_k", f.q), after, Input("u_k", f.u), Input("h", (h,)),
              Input("t_k", (f.t,)))  # fmt: skip
    symbols = [s for i in inputs for s in i.symbols]

    def derive(expression: Any, i: int) -> Any:
        if i < n or 2 * n <= i < 3 * n:
            rate = expression.diff(f.v[i % n]) / (2 * h)
            return -rate if i < n else rate
        partial = expression.diff(symbols[i])
        if symbols[i] == h:
            return partial - sum((v / h * expression.diff(v) for v in f.v), start=0 * h)
        return partial

    central = tuple(
        (v, (b - a) / (2 * h)) for v, a, b in zip(f.v, before.symbols, after.symbols, strict=True)
    )
    text = "Path constraints r_k >= 0 at a node inside a phase, from the three nodes around it."
    return family("path_node", text, inputs, {"r_k": f.r}, par, derive, central)


def _terms(r: Any) -> list[Any]:
    """The terms of a sum, in an order that does not depend on how they are stored."""
    if not isinstance(r, se.Add):
        r = se.expand(r)
    return sorted(r.args, key=str) if isinstance(r, se.Add) else [r]
