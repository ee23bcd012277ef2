"""Kernels of crossing functions w(q, v, t), whose zeros are events."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from dmoc.symbolic.continuous import Continuous, dot
from dmoc.symbolic.graph import gradient
from dmoc.symbolic.kernel_family import family, state_inputs
from dmoc.symbolic.path_constraints import path_rows
from dmoc.symbolic.spec import Input, KernelSpec

if TYPE_CHECKING:
    from dmoc.symbolic.system import MechanicalSystem


def crossing_facts(system: MechanicalSystem, f: Continuous) -> dict[str, Any]:
    """The names of the switches, and what each crossing function depends on."""
    rows = path_rows(f, list(system.switches), f.w)
    return {"switches": list(system.switches), "crossings": rows}


def crossing_kernels(f: Continuous) -> list[KernelSpec]:
    """Values of the crossing functions at a state, and their rates at the end of a step, whose
    acceleration is 2 (v - (q - q_k)/h)/h, right to h."""
    if not f.w:
        return []
    q, v, _, t, par = state_inputs(f)
    graph = f.L.graph
    h, q_k = graph.symbol("h"), Input.vector(graph, "q_k", len(f.q))
    pairs = zip(f.q, q_k.symbols, f.v, strict=True)
    a = [2 * (rate - (late - early) / h) / h for late, early, rate in pairs]
    rates = [dot(gradient(w, f.q), f.v) + dot(gradient(w, f.v), a) + w.diff(f.t) for w in f.w]
    text = "Rates of the crossing functions where a step from q_k ends, with its acceleration."
    return [
        *family("crossing", "Crossing functions w.", (q, v, t), {"w": f.w}, par),
        *family("crossing_rate", text, (q_k, q, v, Input("h", (h,)), t), {"w_dot": rates}, par),
    ]
