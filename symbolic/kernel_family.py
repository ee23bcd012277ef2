"""A kernel with its derivatives."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from dmoc.symbolic.arrangement import cheapest, shared
from dmoc.symbolic.continuous import Continuous, dot
from dmoc.symbolic.graph import RESULT, GraphNode, reverse
from dmoc.symbolic.spec import Input, KernelSpec, Output
from dmoc.symbolic.traversal import operations, reached

# Operations of a function below which weighted sums of only some of its slopes are functions too:
# the compiler takes too long for those of a larger one.
FEW = 180
# Derivatives from which on those that are put together from functions are written as they come.
MANY = 600
# Operations of results from which on, where they are few, they are differentiated backward.
SIZABLE = 300
# What the derivatives of a kernel are called that are by the design parameters, too.
DESIGN = "_design"

# The derivatives of an expression by all components, from its partial derivatives: a function that
# takes those by the symbols that it is given.
Chain = Callable[[Callable[[Sequence[GraphNode]], list[GraphNode]]], list[GraphNode]]


def state_inputs(f: Continuous) -> tuple[Input, Input, Input, Input, Input]:
    """(q, v, u, t, par)."""
    return (
        Input("q", f.q),
        Input("v", f.v),
        Input("u", f.u),
        Input("t", (f.t,)),
        parameters(f),
    )


def parameters(f: Continuous) -> Input:
    """par."""
    return Input("par", f.par, f.design)


def family(
    name: str,
    summary: str,
    inputs: tuple[Input, ...],
    outputs: Mapping[str, Sequence[Any]],
    par: Input,
    chain: Chain | None = None,
    spread: Chain | None = None,
    definitions: tuple[tuple[Any, Any], ...] = (),
    second: bool = True,
) -> list[KernelSpec]:
    """A kernel with its derivatives with respect to all components of ``inputs``, in this order.

    ``name`` has the values; ``name_jac`` the matrices ``a_D`` of their first derivatives, one for
    each output a; ``name_hess``, where second ones are wanted, the upper triangle of the second
    derivatives of sum_a w_a . a, with the weights w_a of every output as further inputs, in the
    order of the outputs.  ``chain`` makes derivatives with respect to the components of partial
    ones, where they are not the same; ``spread`` the same ones without sums in sums.

    Where results with second derivatives depend on parameters that a solver may choose, there are
    ``name_design_jac`` and ``name_design_hess``, too: the same with respect to these as well, in
    columns behind the others.
    """
    symbols = [s for i in inputs for s in i.symbols]
    chain = chain or (lambda partial: partial(symbols))
    ways, count = (chain, spread or chain), len(symbols)
    listed, arguments = ", ".join(i.name for i in inputs), (*inputs, par)
    values = tuple(Output.vector(a, v) for a, v in outputs.items())
    specs = [KernelSpec(name, summary, arguments, values, definitions)]
    specs += _derivatives(specs[0], outputs, ways, count, f"({listed})", second)
    free = set[GraphNode]().union(*(e.free_symbols for v in outputs.values() for e in v))
    if second and free & set(par.design):
        wider = {way: with_more(way, par.design) for way in ways}
        both, count = (wider[ways[0]], wider[ways[1]]), count + len(par.design)
        listed = f"({listed}) and the design parameters"
        for spec in _derivatives(specs[0], outputs, both, count, listed, second):
            specs.append(replace(spec, name=spec.name.replace(name, name + DESIGN, 1)))
    return specs


def with_more(way: Chain, more: Sequence[GraphNode]) -> Chain:
    """Derivatives by some more symbols behind the others."""
    return lambda partial: [*way(partial), *partial(more)]


def _derivatives(
    kernel: KernelSpec, outputs: Mapping[str, Sequence[Any]], ways: tuple[Chain, Chain], count: int,
    listed: str, second: bool,
) -> list[KernelSpec]:  # fmt: skip
    """The first derivatives of a kernel, and where they are wanted its second ones, each in so many
    columns, by a chain and by its spread form."""
    chain, spread = ways
    name, arguments, definitions = kernel.name, kernel.inputs, kernel.definitions
    results = [e for v in outputs.values() for e in v]
    few = 4 * len(results) <= count and operations(results) > SIZABLE
    first = [spread((_backward if few else _forward)(e)) for e in results]
    regular = _are_blocks(results, len(results) * count)
    forms = [first] if regular else [shared(first), first] if spread is chain else [shared(first)]
    rows = iter(cheapest(forms))
    slopes = tuple(
        Output.matrix(f"{a}_D", [next(rows) for _ in v], count) for a, v in outputs.items()
    )
    text = f"First derivatives of `{name}` with respect to {listed}."
    specs = [KernelSpec(f"{name}_jac", text, arguments, slopes, definitions)]
    if second:
        graph = results[0].graph
        weights = tuple(Input.vector(graph, f"w_{a}", len(v)) for a, v in outputs.items())
        total = dot([s for w in weights for s in w.symbols], results)
        curvatures = (Output.matrix("hess", _second(total, chain, spread), count, upper=True),)
        text = f"Second derivatives of the weighted sum of all results of `{name}`."
        specs.append(
            KernelSpec(f"{name}_hess", text, (*arguments, *weights), curvatures, definitions)
        )
    return specs


def _forward(expression: GraphNode) -> Callable[[Sequence[GraphNode]], list[GraphNode]]:
    return lambda symbols: [expression.diff(s) for s in symbols]


def _backward(expression: GraphNode) -> Callable[[Sequence[GraphNode]], list[GraphNode]]:
    return lambda symbols: reverse(expression, symbols)


def _second(total: GraphNode, chain: Chain, spread: Chain) -> list[list[GraphNode]]:
    """Upper triangle of the second derivatives."""
    whole, zero = contracted(total), total.graph.zero
    ways = [(spread, _backward), (chain, _forward)] if whole is total else [(spread, _backward)]
    squares = ([way(_forward(e)) for e in way(first(whole))] for way, first in ways)
    triangles = ([[*[zero] * i, *row[i:]] for i, row in enumerate(rows)] for rows in squares)
    return cheapest(
        rows if _are_blocks([whole], len(rows) ** 2 // 2) else shared(rows) for rows in triangles
    )


def _are_blocks(results: Sequence[GraphNode], entries: int) -> bool:
    """Whether so many derivatives of results are put together from those of functions, block by
    block: they stay of a few forms, which the code has as loops."""
    return entries > MANY and any(n.kind == RESULT for n in reached(results))


def contracted(total: GraphNode) -> GraphNode:
    """The same sum, where it is linear in the slopes of functions: their weighted sum is a function
    of its own, which has second derivatives where its parts had third ones."""
    results = [n for n in reached([total]) if n.kind == RESULT]
    if not results:
        return total
    weights = dict(zip(results, reverse(total, results), strict=True))
    if any(n.kind == RESULT for n in reached(weights.values())):
        return total
    g = total.graph
    terms = [(total.subs(dict.fromkeys(results, g.zero)), 1.0)]
    for function, arguments in dict.fromkeys((n.value[0], n.parts) for n in results):
        paths = [(), *((i,) for i in range(len(function.symbols)))]
        own = [weights.get(g.result(function, path, arguments), g.zero) for path in paths]
        few = operations([function.body]) < FEW
        used = tuple(i for i, weight in enumerate(own) if not (i and few and weight is g.zero))
        terms.append((function.weighted(used)((*arguments, *(own[i] for i in used))), 1.0))
    return g.sum(terms)
