"""From a graph of expressions to straight-line code: which values there are, and in what order.

The pairs of factors that most products share become values of their own.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain

from dmoc.symbolic.arrangement import with_common_factors
from dmoc.symbolic.called import Function
from dmoc.symbolic.graph import CALLED, PRODUCT, RESULT, GraphNode
from dmoc.symbolic.pairs import Part, share_pairs
from dmoc.symbolic.scalar import Scalar
from dmoc.symbolic.spec import FunctionSpec, KernelSpec
from dmoc.symbolic.traversal import in_order, reached

# Results that are stored in order, so that memory is written in a row.
MANY = 500


@dataclass(frozen=True)
class Schedule:
    """The values that ``results`` need; ``factors`` of products, each as often as it counts;
    ``definitions`` of symbols."""

    results: tuple[GraphNode, ...]
    factors: Mapping[GraphNode, Sequence[GraphNode]]
    definitions: Mapping[GraphNode, GraphNode]
    specs: Sequence[FunctionSpec]

    def operands(self, node: GraphNode) -> Sequence[GraphNode]:
        if node in self.definitions:
            return (self.definitions[node],)
        return self.factors.get(node, node.children)

    @cached_property
    def order(self) -> list[GraphNode]:
        """All nodes, operands first."""
        return in_order(self.results, self.operands)

    @cached_property
    def uses(self) -> Counter[GraphNode]:
        """How often a node is read; one that is several results is stored at once, where they are
        few."""
        uses = Counter(self.results if len(self.results) > MANY else dict.fromkeys(self.results, 1))
        uses.update(chain.from_iterable(map(self.operands, self.order)))
        return uses

    @cached_property
    def functions(self) -> dict[GraphNode, tuple[FunctionSpec, int]]:
        """The function that gives a result, and its place there."""
        results = [n for n in self.order if n.kind == RESULT]
        orders = dict(_by_function(results).keys())
        specs = {(s.function, s.order): s for s in self.specs}
        called = {n: specs[n.value[0], orders[n.value[0]]] for n in results}
        return {n: (spec, spec.paths.index(n.value[1])) for n, spec in called.items()}


def schedule(
    results: Sequence[GraphNode],
    definitions: Mapping[GraphNode, GraphNode],
    specs: Iterable[FunctionSpec],
) -> Schedule:
    """Arrange the computation of some nodes."""
    count = len(results)
    arranged = with_common_factors([*results, *definitions.values()])
    results = arranged[:count]
    definitions = dict(zip(definitions, arranged[count:], strict=True))
    factors: dict[GraphNode, list[GraphNode]] = {}
    waiting = [node for node in reached(arranged) if node.kind == PRODUCT]
    while waiting:
        node = waiting.pop()
        if node not in factors:
            factors[node] = _factors(node)
            waiting += [n for n in factors[node] if n.kind == PRODUCT]
    parts = {n: [(f, 1.0) for f in own] for n, own in factors.items() if len(own) > 1}
    share_pairs(parts, _product_of)
    factors |= {n: [f for f, _ in own] for n, own in parts.items()}
    return Schedule(tuple(results), factors, definitions, tuple(specs))


def _product_of(a: GraphNode, b: GraphNode, ratio: float, owners: Sequence[GraphNode]) -> Part:
    if owners:
        return owners[0], 1.0
    parts = ((a, 2),) if a is b else ((a, 1), (b, 1))
    return a.graph.make(PRODUCT, None, parts), 1.0


def is_unit(node: GraphNode) -> bool:
    """Whether a product is an inverse or a root, which are values of their own."""
    return node.kind == PRODUCT and len(node.parts) == 1 and node.parts[0][1] in (-1, 0.5)


def _factors(node: GraphNode) -> list[GraphNode]:
    """The factors of a product, each with exponent 1; inverses, roots and powers as nodes."""
    if is_unit(node):
        return [node.parts[0][0]]
    g, factors = node.graph, []
    for base, e in node.parts:
        whole, part = divmod(abs(e), 1)
        if part not in (0, 0.5) or whole > 4:
            power = g.apply("pow", base, g.node(abs(e)))
            factors.append(power if e > 0 else g.product([(power, -1)]))
            continue
        for unit, times in ((base, int(whole)), (g.power(base, 0.5) if part else base, bool(part))):
            if times:
                factors += [unit if e > 0 else g.make(PRODUCT, None, ((unit, -1),))] * times
    return factors


def functions_of(kernels: Iterable[KernelSpec]) -> list[FunctionSpec]:
    """The functions that kernels call, each with all results that any of them needs."""
    paths: dict[tuple[Scalar, int], set[tuple[int, ...]]] = {}
    for kernel in kernels:
        results = [n for n in reached(_expressions(kernel)) if n.kind == RESULT]
        for (function, order), own in _by_function(results).items():
            paths.setdefault((function, order), set()).update(own)
    return [
        FunctionSpec(function, order, tuple(sorted(own, key=lambda path: (len(path), path))))
        for (function, order), own in paths.items()
    ]


def called_of(kernels: Iterable[KernelSpec]) -> list[Function]:
    """The functions that kernels call by their names, each behind those that it calls itself."""
    called: dict[Function, None] = {}
    for kernel in kernels:
        own = dict.fromkeys(n.value for n in reached(_expressions(kernel)) if n.kind == CALLED)
        for function in own:
            if function not in called:
                called.update(dict.fromkeys([*called_of([function.kernel]), function]))
    return list(called)


def _expressions(kernel: KernelSpec) -> list[GraphNode]:
    values = [e for output in kernel.outputs for e in output.expressions]
    return [*values, *(e for _, e in kernel.definitions)]


def _by_function(results: Iterable[GraphNode]) -> dict[tuple[Scalar, int], list[tuple[int, ...]]]:
    """The derivatives of functions with the order of the highest one."""
    paths: dict[Scalar, list[tuple[int, ...]]] = {}
    for node in results:
        paths.setdefault(node.value[0], []).append(node.value[1])
    return {(f, max(map(len, own))): own for f, own in paths.items()}
