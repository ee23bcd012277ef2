"""Shortest times to surfaces that stand still, and their kernels."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import sympy as sp

from dmoc.symbolic.continuous import Continuous, dot
from dmoc.symbolic.discrete import step_element
from dmoc.symbolic.graph import GraphNode, gradient
from dmoc.symbolic.kernel_family import family, parameters
from dmoc.symbolic.spec import Input, KernelSpec


def shortest_time_kernels(f: Continuous) -> list[KernelSpec]:
    """Shortest time to a surface that stands still: first root of the quadratic g + g' t + g'' t^2
    / 2, from the middle of a phase's first step.

    ``a`` are the averaged accelerations at full input.  The state half a step after the phase's
    start is (qm, v), so that h/2 is added to the root; the directions of g'' are taken half-way
    between qm and the collision q_c.
    """
    if not f.g or any(f.t in g.free_symbols for g in f.g):
        return []
    e = step_element(f, 2, f.L.graph.symbol, float)
    q_c, a = (Input.vector(f.L.graph, name, len(f.q)) for name in ("q_c", "a"))
    half_way = {s: (s + c) / 2 for s, c in zip(f.q, q_c.symbols, strict=True)}
    n = len(f.q)
    times = [e.h / 2 + first_root(*approach(g, f, a.symbols, half_way)) for g in f.g]
    inputs = (Input("q_k", e.q_k), Input("q_kp1", e.q_kp1), Input("h", (e.h,)), q_c, a)

    def chain(partial: Callable[[Sequence[GraphNode]], list[GraphNode]]) -> list[GraphNode]:
        own = (*q_c.symbols, *a.symbols)
        slopes = partial((*e.symbols, *own))
        of_step = e.chain(lambda symbols: slopes[: len(symbols)])
        return [*of_step[: 2 * n], of_step[e.at_h], *slopes[-len(own) :]]

    summary = "Shortest time to each surface at averaged full acceleration."
    par = parameters(f)
    return family(
        "min_time",
        summary,
        inputs,
        {"T_min": times},
        par,
        chain,
        definitions=e.definitions,
        second=False,
    )


def approach(
    g: Any, f: Continuous, a: Sequence[Any], half_way: dict[Any, Any]
) -> tuple[Any, Any, Any]:
    """Return g, g' and g'' along the motion with velocity v and acceleration a."""
    slope = gradient(g, f.q)
    rate = dot(slope, f.v)
    curvature = dot(gradient(rate, f.q), f.v)
    return g, rate, dot([s.subs(half_way) for s in slope], a) + curvature


def first_root(g: Any, rate: Any, acceleration: Any) -> Any:
    """First positive root of g + rate t + acceleration t^2 / 2 for g < 0; not a number, or not
    positive, where there is none."""
    return -2 * g / (rate + (rate**2 - 2 * g * acceleration) ** sp.S.Half)
