"""Expressions as graphs: their derivatives against SymPy's, and what several have in common."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from functools import cache
from typing import Any

import mpmath
import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from sympy.physics.mechanics import dynamicsymbols
from systems import chain_system

import dmoc
from dmoc.base.errors import GenerationError
from dmoc.codegen.build import numpy_kernels
from dmoc.codegen.manifest import Manifest
from dmoc.codegen.operation_counts import count_of
from dmoc.codegen.schedule import functions_of, schedule
from dmoc.codegen.text import c_files, manifest, numpy_text
from dmoc.inspection.kernel_check import kernel_errors
from dmoc.symbolic import families
from dmoc.symbolic.arrangement import with_common_factors
from dmoc.symbolic.conversion import to_nodes
from dmoc.symbolic.graph import RESULT, SUM, Graph, GraphNode, reverse
from dmoc.symbolic.pairs import with_shared_sums
from dmoc.symbolic.scalar import Scalar
from dmoc.symbolic.slopes import SLOPES
from dmoc.symbolic.spec import KernelSpec
from dmoc.symbolic.traversal import evaluated, operations, reached

X, Y, Z = SYMBOLS = sp.symbols("x y z")
LEAVES = st.sampled_from([X, Y, Z, sp.Integer(2), sp.Rational(1, 3), sp.Float(0.7)])
POSITIVE = {X: 0.31, Y: 0.57, Z: 0.83}


def joined(parts: st.SearchStrategy[Any]) -> st.SearchStrategy[Any]:
    return st.one_of(
        st.builds(sp.Add, parts, parts),
        st.builds(sp.Mul, parts, parts),
        st.builds(lambda a, b: a - b, parts, parts),
        st.builds(lambda a: sp.sin(a), parts),
        st.builds(lambda a: sp.exp(sp.cos(a)), parts),
        st.builds(lambda a: (1 + a**2) ** sp.Rational(-1, 2), parts),
        st.builds(lambda a: a**3, parts),
    )


def nodes_of(*expressions: Any) -> tuple[list[GraphNode], dict[Any, GraphNode]]:
    graph = Graph()
    table = {s: graph.symbol(s.name) for s in SYMBOLS}
    return to_nodes(graph, expressions, table), table


@settings(max_examples=60)
@given(st.recursive(LEAVES, joined, max_leaves=12))
def test_first_and_second_derivatives_are_sympys(expression: Any) -> None:
    (node,), table = nodes_of(expression)
    backward = reverse(node, list(table.values()))
    point = {table[s]: mpmath.mpf(x) for s, x in POSITIVE.items()}
    for s, slope in zip(SYMBOLS, backward, strict=True):
        wanted = [expression.diff(s), *(expression.diff(s).diff(r) for r in SYMBOLS)]
        ours = [slope, *(slope.diff(table[r]) for r in SYMBOLS)]
        forward = node.diff(table[s])
        for a, b in zip(evaluated([*ours, forward], point, mpmath), [*wanted, wanted[0]],
                        strict=True):  # fmt: skip
            assert float(a) == pytest.approx(float(b.subs(POSITIVE)), rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("name", sorted(SLOPES))
def test_the_derivative_of_every_function_is_its_slope(name: str) -> None:
    graph = Graph()
    arguments = [graph.symbol(s) for s in ("a", "b")[: 2 if name in ("atan2", "pow") else 1]]
    node = graph.apply(name, *arguments)
    at = [1.7 if name == "acosh" else 0.4, 0.9][: len(arguments)]
    step = 1e-6
    for i, argument in enumerate(arguments):
        ahead, behind = (
            getattr(math, name)(*(a + s * (k == i) for k, a in enumerate(at)))
            for s in (step, -step)
        )
        (slope,) = evaluated([node.diff(argument)], dict(zip(arguments, at, strict=True)), math)
        assert slope == pytest.approx((ahead - behind) / (2 * step), rel=1e-8)


def test_equal_expressions_are_one_node_and_what_cancels_is_gone() -> None:
    g = Graph()
    x, y = g.symbol("x"), g.symbol("y")
    assert x * y + 2 is 2 + y * x
    assert (x + y) - x is y and (x + y) - (y + x) is g.zero
    assert 2 * (x - y) is -((y - x) * 2)
    assert x * y / x is y and (x**2) ** 0.5 is not x


def test_a_sum_that_takes_in_another_takes_its_constant_with_the_sign() -> None:
    g = Graph()
    x, y, z = map(g.symbol, "xyz")
    inner = g.sum([(x * y, 1.0), (z, 1.0)], 4.0)
    outer = g.sum([(x, 1.0), (inner, -1.0), (x * z, 1.0)], 0.5)
    at = {x: 0.3, y: 0.7, z: 1.1}
    (arranged,) = evaluated(with_common_factors([outer]), at, math)
    assert arranged == pytest.approx(0.3 - (0.21 + 1.1 + 4) + 0.33 + 0.5)


def test_sums_that_sympy_writes_flat_share_their_parts_again() -> None:
    n = 8
    symbols = sp.symbols(f"x0:{n}")
    graph = Graph()
    table = {s: graph.symbol(s.name) for s in symbols}
    sums = to_nodes(graph, [sp.Add(*symbols[: k + 1]) for k in range(n)], table)
    nested = [node for node in reached(sums) if node.kind == SUM]
    assert len(nested) == n - 1 and all(len(node.parts) == 2 for node in nested)


def test_terms_of_a_sum_take_out_their_common_factors() -> None:
    g = Graph()
    a, b, c, d = (g.symbol(s) for s in "abcd")
    plan = schedule([a * b + a * c + a * d], {}, ())
    assert operations(plan.results) == 3  # a*(b + c + d)
    point = {s: 1.0 + i for i, s in enumerate((a, b, c, d))}
    assert evaluated(plan.results, point, math) == [9.0]


def test_a_function_and_its_weighted_slopes_have_the_derivatives_of_their_body() -> None:
    g = Graph()
    x, y, s, t = (g.symbol(n) for n in "xyst")
    body = x**2 * y + g.apply("sin", x * y)
    f = Scalar("f", (x, y), body)
    arguments = (s * t, s + t)
    inside = body.subs({x: arguments[0], y: arguments[1]})
    call = f(arguments)
    for p in (s, t):
        for q in (s, t):
            second = call.diff(p).diff(q)
            flat = second.subs(
                {
                    n: n.value[0].derivative(n.value[1]).subs({x: arguments[0], y: arguments[1]})
                    for n in reached([second])
                    if n.kind == RESULT
                }
            )
            point = {s: 0.3, t: 0.8}
            a, b = evaluated([flat, inside.diff(p).diff(q)], point, math)
            assert a == pytest.approx(b, rel=1e-13)
    for places in ((0, 1, 2), (0, 2)):
        function = f.weighted(places)
        assert f.weighted(places) is function
        weights = dict(zip(places, function.symbols[2:], strict=True))
        values = (body, body.diff(x), body.diff(y))
        wanted = g.sum((w * values[i], 1.0) for i, w in weights.items())
        point = {x: 0.4, y: 1.1, **{w: 0.3 * i - 0.5 for i, w in weights.items()}}
        a, b = evaluated([function.body, wanted], point, math)
        assert a == pytest.approx(b, rel=1e-13)


@cache
def kernels_of_a_chain(links: int) -> dict[str, KernelSpec]:
    return {k.name: k for k in families.model_spec(chain_system(links)).kernels}


@pytest.mark.slow
def test_momenta_and_energies_do_without_the_slopes_by_coordinates() -> None:
    """Their second derivatives call a function of the Lagrangian and of its slopes by velocities
    alone, of which the slopes by two velocities are none of third order."""
    kernels, functions = kernels_of_a_chain(8), {}
    for name in ("step_hess", "impact_hess", "momentum_hess"):
        (function,) = functions_of([kernels[name]])
        functions[name] = count_of(function.kernel).operations
    assert functions["impact_hess"] < 0.6 * functions["step_hess"]
    assert functions["momentum_hess"] < 0.6 * functions["step_hess"]


@pytest.mark.slow
@pytest.mark.parametrize("order", [2, 4])
def test_a_lagrangian_as_a_function_gives_the_same_kernels(
    order: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(3)
    system, kernels = chain_system(2), []
    for large in (0, 10**9):
        for limit in ("LARGE_STEP", "LARGE"):
            monkeypatch.setattr(families, limit, large)
        model = families.model_spec(system, order)
        calls = re.findall(r"    lagrangian_w1?_2\(", c_files(model)["kernels.c"])
        # The second derivatives of steps and events at all points, of momenta and the residual.
        assert len(calls) == (order + 2) * (large == 0)
        kernels.append(numpy_kernels(Manifest.read(manifest(model)), numpy_text(model)))
    as_function, inline = kernels
    for name, facts in inline.manifest.kernels.items():
        inputs = [rng.uniform(0.3, 1.2, (2, size)) for _, size in facts["inputs"]]
        for output in facts["outputs"]:
            place = inline.outputs(name).index(output["name"])
            full = []
            for k in kernels:
                values = k.call(name, *inputs)[place]
                if "rows" in output:
                    dense = np.zeros((2, *output["shape"]))
                    dense[:, *k.pattern(name, output["name"])] = values
                    values = dense
                full.append(values)
            np.testing.assert_allclose(full[0], full[1], rtol=1e-11, atol=1e-12, err_msg=name)
    assert as_function.manifest.fingerprint == inline.manifest.fingerprint


@pytest.mark.slow
@pytest.mark.parametrize("backend", ["compiled", "numpy"])
def test_a_lagrangian_without_parameters_may_be_a_function(
    backend: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for limit in ("LARGE_STEP", "LARGE"):
        monkeypatch.setattr(families, limit, 0)
    x, y = dynamicsymbols("x y")
    mass = 2 + sp.sin(x + dynamicsymbols._t) * sp.cos(y)
    made = dmoc.MechanicalSystem("bare", [x, y], mass * (x.diff() ** 2 + y.diff() ** 2) - x * y)
    kernels = dmoc.build(made, backend=backend)
    errors = kernel_errors(made, kernels)
    assert errors and all(c.error < 1e-12 for c in errors)


@pytest.mark.slow
def test_kernels_of_a_chain_of_four_are_those_of_its_lagrangian() -> None:
    """Its Lagrangian is a function of its own; the numbers are differences of 40 digits."""
    system = chain_system(4, relative=True)
    kernels = dmoc.build(system, backend="numpy")
    assert all(c.error < 1e-10 for c in kernel_errors(system, kernels))


@pytest.mark.slow
def test_work_of_a_chain_grows_as_its_matrices_do() -> None:
    counts = []
    for links in (4, 8):
        kernels = [kernels_of_a_chain(links)[k] for k in ("step", "step_jac", "step_hess")]
        outputs = {k.name: [e for o in k.outputs for e in o.expressions] for k in kernels}
        counts.append({name: operations(values) for name, values in outputs.items()})
    few, many = counts
    assert many["step"] < 2.5 * few["step"]
    assert many["step_jac"] < 5 * few["step_jac"] and many["step_hess"] < 5 * few["step_hess"]


@pytest.mark.parametrize("links", [4, 8])
def test_a_steps_jacobian_takes_few_operations_beside_its_function(links: int) -> None:
    # Two links have the entries a +- s and b +- d of both momenta, with a, b = h/4 L_qq +- L_vv/h
    # and s, d = (L_qv +- L_vq)/2: products, sums and coefficients are at most 20 for each pair of
    # links, and for the slopes by h two products with the velocities (4 for each two links), and
    # for each link its q, v, the time and its input.
    most = 20 * links * (links + 1) // 2 + 4 * links**2 + 24 * links
    assert count_of(kernels_of_a_chain(links)["step_jac"]).operations < most


def test_sums_of_thousands_of_terms_take_no_depth_and_no_pairs() -> None:
    g = Graph()
    x, y, u, w = (g.symbol(name) for name in "xyuw")
    waves = [(g.apply("sin", x * float(i)), 1.0 + i) for i in range(1, 3000)]
    alone = [g.sum(waves)]
    assert with_shared_sums(alone) == alone
    more = [g.sum([*waves, (u, 1.0)]), g.sum([*waves, (w, 1.0)]), g.sum([*waves[::2], (y, 3.0)])]
    point = {x: 0.3, y: 0.7, u: 0.2, w: 0.9}
    shared = with_shared_sums(more)
    assert evaluated(shared, point, math) == pytest.approx(evaluated(more, point, math), rel=1e-9)
    assert operations(shared) < 1.1 * operations(alone)
    pairs = g.sum(
        (g.apply("sin", x * float(i)) * h, 1.0)
        for i in range(1, 1300)
        for h in (g.apply("cos", y * float(i)), g.apply("exp", y / float(i)))
    )
    (factored,) = schedule([pairs], {}, ()).results
    expected = evaluated([pairs], point, math)
    assert evaluated([factored], point, math) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(
    ("kink", "expected"),
    [
        (lambda a, b: sp.Max(a, b, 0), lambda a, b: max(a, b, 0)),
        (lambda a, b: sp.Min(sp.Abs(a), b), lambda a, b: min(abs(a), b)),
        (lambda a, b: sp.sign(sp.Abs(a) - 1) * b, lambda a, b: float(np.sign(abs(a) - 1)) * b),
        (lambda a, b: sp.Heaviside(a - b, 0), lambda a, b: float(a > b)),
        (
            lambda a, b: sp.Piecewise((a, sp.Max(a, b) > 1), (b**2, True)),
            lambda a, b: a if max(a, b) > 1 else b**2,
        ),
    ],
)
def test_kinks_add_and_do_not_multiply(
    kink: Callable[[Any, Any], Any], expected: Callable[[float, float], float]
) -> None:
    """Each is a choice of its own, and not all their ways together one choice."""
    numbers, sizes = (-1.5, -1.0, 0.0, 0.5, 1.0, 2.0), []
    for terms in (3, 12):
        g = Graph()
        x, y = sp.symbols("x y", real=True)
        nodes = {s: g.symbol(s.name) for s in (x, y)}
        (node,) = to_nodes(g, [sum(kink(x, i * y) for i in range(1, terms))], nodes)
        sizes.append(operations([node]))
        for a in numbers:
            for b in numbers:
                (value,) = evaluated([node], {nodes[x]: a, nodes[y]: b}, math)
                assert value == pytest.approx(sum(expected(a, i * b) for i in range(1, terms)))
    assert sizes[1] <= 10 * sizes[0]


def test_constants_far_apart_neither_overflow_nor_vanish() -> None:
    g = Graph()
    x, y, z = (g.symbol(name) for name in "xyz")
    point = {x: 0.3, y: 0.7, z: 0.0}
    (tiny,) = evaluated([g.sum([(x, 1e-300), (y, 1e-300)], 1e10)], point, math)
    assert tiny == 1e10
    (huge,) = evaluated([g.sum([(x, 1e300), (y, 1e300)], 1e-20)], {x: 0.0, y: 0.0}, math)
    assert huge == 1e-20
    sums = [g.sum([(z, 1e300), (x, 1e-300), (y, c)]) for c in (1.0, 2.0)]
    sums = [g.apply("sin", e) for e in with_shared_sums(sums)]
    assert evaluated(sums, point, math) == pytest.approx([math.sin(0.7), math.sin(1.4)])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda g, x: (x * 1e200 + 1) * (x * 1e200) * 1e200 * 1e200, "is inf: expected"),
        (lambda g, x: (x * 1e200) ** 2, "is inf: expected"),
        (lambda g, x: g.apply("sin", x * 1e200).diff(x).diff(x), "is -inf: expected"),
        (lambda g, x: g.apply("pow", g.node(-2.0), x).diff(x), r"log\(-2\), or a derivative"),
        (lambda g, x: g.apply("exp", g.node(1e4)), r"exp\(10000\), or a derivative"),
        (lambda g, x: x / g.zero, "divides by a constant that is 0"),
        (lambda g, x: g.zero**-0.5 * x, "divides by a constant that is 0"),
    ],
)
def test_constants_that_are_no_numbers_of_c_are_refused(
    make: Callable[[Graph, GraphNode], GraphNode], message: str
) -> None:
    g = Graph()
    with pytest.raises(GenerationError, match=message):
        make(g, g.symbol("x"))


@pytest.mark.parametrize(
    ("constant", "message"),
    [
        (sp.asin(2), "1.5707963267949 - 1.31695789692482.I: expected a real number"),
        (sp.Integer(-1) ** sp.Rational(1, 3), "expected a real number"),
        (1 / (sp.sin(1) ** 2 + sp.cos(1) ** 2 - 1), "divides by a constant that is 0"),
        ((sp.sqrt(2) + 1) ** 2 - 3 - 2 * sp.sqrt(2), None),
        (sp.exp(1000), "is inf: expected"),
        (sp.pi * sp.sqrt(2), None),
    ],
)
def test_constants_of_expressions_are_their_numbers(constant: sp.Expr, message: str | None) -> None:
    g, s = Graph(), sp.Symbol("x")
    if message is not None:
        with pytest.raises(GenerationError, match=message):
            to_nodes(g, [s * constant], {s: g.symbol("x")})
        return
    (node,) = to_nodes(g, [s * constant], {s: g.symbol("x")})
    (value,) = evaluated([node], {g.symbol("x"): 1.0}, math)
    assert value == pytest.approx(float(constant.expand()), rel=1e-15, abs=0.0)


@pytest.mark.parametrize(
    "mass",
    [
        lambda x: 1 + x ** sp.Symbol("n"),
        lambda x: sp.Piecewise((x, sp.sqrt(x - 5) < 1), (2, True)),
    ],
)
def test_masses_that_mpmath_calls_otherwise_or_has_no_order_for(
    mass: Callable[[sp.Expr], sp.Expr],
) -> None:
    x = dynamicsymbols("x")
    own = mass(x)
    parameters = {s: 2.0 for s in own.free_symbols if s.name == "n"}
    made = dmoc.MechanicalSystem("mass", [x], own * x.diff() ** 2 / 2, parameters)
    assert made.coordinates == (x,)


@pytest.mark.parametrize("power", [1000, -1000, 5000])
def test_a_high_power_is_taken_out_of_a_sum_at_once(power: int) -> None:
    """One by one would go as deep as the power."""
    g = Graph()
    x, y, z = (g.symbol(name) for name in "xyz")
    (sum_of_both,) = with_common_factors([g.power(x, power) * y + g.power(x, power) * z])
    values = {x: 1.001, y: 2.0, z: 3.0}
    (value,) = evaluated([sum_of_both], values, math)
    assert value == pytest.approx(5 * 1.001**power, rel=1e-12)
    assert operations([sum_of_both]) <= 4
