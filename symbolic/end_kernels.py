"""Kernels of the ends of surfaces."""

from __future__ import annotations

from functools import reduce
from typing import TYPE_CHECKING, Any

from dmoc.symbolic.continuous import Continuous, rates
from dmoc.symbolic.graph import RELATION, GraphNode
from dmoc.symbolic.kernel_family import family, state_inputs
from dmoc.symbolic.spec import KernelSpec

if TYPE_CHECKING:
    from dmoc.symbolic.system import MechanicalSystem


def ends_of(f: Continuous) -> dict[int, list[Any]]:
    """Functions that are not negative where a surface is, by the number of each that has ends."""
    ends: dict[int, list[Any]] = {}
    for j, w in zip(f.ends, f.within, strict=True):
        ends.setdefault(j, []).append(w)
    return ends


def coordinates_of_ends(system: MechanicalSystem, f: Continuous) -> dict[str, list[int]]:
    """The coordinates that the ends of each surface that has some contain."""
    names, ends = list(system.surfaces), sorted(ends_of(f).items())
    free = {names[j]: set().union(*(w.free_symbols for w in own)) for j, own in ends}
    return {name: [i for i, s in enumerate(f.q) if s in own] for name, own in free.items()}


def end_kernels(f: Continuous) -> list[KernelSpec]:
    """Kernels of surfaces with ends: W >= 0 where each is, 1 of one without ends, its rate, and
    B <= 0 where nothing has passed it, the gap of one without ends."""
    if not f.within:
        return []
    q, v, _, t, par = state_inputs(f)
    one = f.L.graph.one
    own = _joined(f)
    places = [own.get(j, one) for j in range(len(f.g))]
    ways = {"omega": rates(f, places)}
    return [
        *family("within", "Ends of surfaces, W >= 0 where each is.", (q, t), {"W": places}, par),
        *family("within_rate", "Rates omega of the ends.", (q, v, t), ways, par),
        *family(
            "barrier", "Gaps that count within the ends, B <= 0.", (q, t), {"B": barriers(f)}, par
        ),
    ]


def _joined(f: Continuous) -> dict[int, GraphNode]:
    """W of each surface that has ends."""
    return {j: reduce(both_positive, functions) for j, functions in ends_of(f).items()}


def barriers(f: Continuous) -> list[GraphNode]:
    """B of all surfaces."""
    own = _joined(f)
    return [both_positive(g, own[j]) if j in own else g for j, g in enumerate(f.g)]


def both_positive(a: GraphNode, b: GraphNode) -> GraphNode:
    """The function a + b - sqrt(a^2 + b^2), which is positive where both are, and zero where one is
    zero and the other is not negative, with the slopes of that one."""
    g = a.graph
    square = a * a + b * b
    far = g.make(RELATION, ">", (square, g.zero))
    safe = g.choice([square, far, g.one])  # no slope divides by zero where both are
    return a + b - g.choice([g.power(safe, 0.5), far, g.zero])
