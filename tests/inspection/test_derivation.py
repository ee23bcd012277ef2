"""The page of a derivation, and the check of kernels that it shows."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.dom.minidom import parseString

import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols
from systems import block_system, driven_system, puck_system, rod_system

import dmoc
from dmoc.base.discretisation import ORDERS
from dmoc.base.errors import OutputError
from dmoc.codegen.kernels import Kernels
from dmoc.codegen.operation_counts import count_of
from dmoc.inspection.kernel_check import kernel_errors
from dmoc.inspection.system_derivation import small_problem
from dmoc.symbolic.graph import Graph
from dmoc.symbolic.spec import Input, KernelSpec, Output


def towed_system() -> dmoc.MechanicalSystem:
    """At order 4 two of its sums differ by its input alone."""
    x, y, u = dynamicsymbols("x y u")
    d = sp.Symbol("d")
    return dmoc.MechanicalSystem(
        "towed", [x, y], (x.diff() ** 2 + y.diff() ** 2) / 2 - 9.81 * y, {d: 0.4}, [u],
        {x: 0.8 * u, y: 0.6 * u}, cost=u**2, dissipation=d * x.diff() ** 2,
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("make", [driven_system, rod_system, puck_system, towed_system])
def test_kernels_agree_with_an_evaluation_in_many_digits(make: Any, order: int) -> None:
    kernels = dmoc.build(make(), order=order)
    comparisons = kernel_errors(make(), kernels)
    names = {c.kernel for c in comparisons}
    assert max(c.error for c in comparisons) < 1e-11
    left_out = set(kernels.manifest["kernels"]) - names
    # Estimates, pictures and sizes, in which nothing is derived.
    assert left_out <= {"min_time", "min_time_jac", "drawing", "path_terms"}


@pytest.mark.parametrize("wrong", ["step", "step_jac", "step_hess", "dynamics", "surface_jac"])
def test_a_wrong_kernel_is_found(monkeypatch: pytest.MonkeyPatch, wrong: str) -> None:
    """One entry of its results is off by a millionth."""
    kernels, call = dmoc.build(puck_system()), Kernels.call

    def off(self: Kernels, kernel: str, *inputs: np.ndarray) -> tuple[np.ndarray, ...]:
        results = call(self, kernel, *inputs)
        if kernel == wrong:
            results[0][..., 0] += 1e-6
        return results

    monkeypatch.setattr(Kernels, "call", off)
    errors = {c.kernel: c.error for c in kernel_errors(puck_system(), kernels)}
    assert [name for name, error in errors.items() if error > 1e-10] == [wrong]


def test_operations_are_counted_after_sharing() -> None:
    graph = Graph()
    x, y = Input.vector(graph, "x", 2).symbols
    shared = graph.apply("sin", x * y)
    values = [shared + 1, shared * 3.0 - x / y]
    spec = KernelSpec("f", "", (Input("x", (x, y)),), (Output.vector("a", values),))
    count = count_of(spec)
    # x y, + 1, * 3, -, /: the sine is called once
    assert (count.results, count.operations, count.calls) == (2, 5, 1)


def test_the_page_needs_nothing_else(tmp_path: Path) -> None:
    derivation = dmoc.derive(block_system())
    text = derivation.save(tmp_path / "x.html").read_text()
    body = text[text.index("<main>") : text.index("</body>")]
    parseString(body)
    assert "prefers-color-scheme:dark" in text and "<script" not in text
    assert not re.search(r'(src|href)="?(?!data:)', text)
    for title in ("System", "Discrete Lagrangian", "Cost", "A small problem", "Kernels", "Check"):
        assert title in text or title.lower() in text, title
    assert text.count("<svg") == 2 and "Jacobian of the constraints" in text
    (worst,) = re.findall(r"Largest relative error: (\S+) ", text)
    assert float(worst) < 1e-12


@pytest.mark.slow
def test_derivations_are_saved_by_their_endings(tmp_path: Path) -> None:
    derivation = dmoc.derive(block_system(), order=4)
    assert derivation.save(tmp_path / "x.txt").read_text() == str(derivation)
    assert derivation.save(tmp_path / "x.tex").read_text() == derivation.latex()
    with pytest.raises(OutputError, match=r"end it in \.html, \.tex, \.txt"):
        derivation.save(tmp_path / "x.doc")


@pytest.mark.slow
def test_a_function_that_is_nowhere_real_is_told() -> None:
    x, u = dynamicsymbols("x u")
    k = sp.Symbol("k")
    system = dmoc.MechanicalSystem(
        "nowhere", [x], x.diff() ** 2 / 2 - k * sp.sqrt(-3 - x**2), {k: 1.0}, inputs=[u],
        forces={x: u}, cost=u**2,
    )  # fmt: skip
    assert kernel_errors(system, dmoc.build(system)) == ()
    assert "not real at any of the random points" in dmoc.derive(system).html()


def test_small_problems_go_through_a_collision_where_there_is_one() -> None:
    problem = small_problem(dmoc.build(block_system()))
    assert problem is not None and problem.sequence == ("wall",)


def test_an_objective_names_states_at_ends_as_everywhere_else():
    x = dynamicsymbols("x")
    system = replace(block_system("ends"), objective=dmoc.at_end(x.diff()) ** 2 + dmoc.at_start(x))
    (section,) = [s for s in dmoc.derive(system).sections if s.title == "Objective"]
    (equation,) = section.equations
    assert str(equation.right) == "at_end(x_dot)**2 + at_start(x)"


@pytest.mark.parametrize("order", [2, 4])
def test_kernels_of_kinks_agree_at_all_points_of_a_step(order: int) -> None:
    """Half of a step has hidden unknowns of its own where there is one point of it."""
    x, u, w = dynamicsymbols("x u w")
    system = dmoc.MechanicalSystem(
        "rough", [x], x.diff() ** 2 / 2, {}, [u, w], {x: u + w},
        cost=u**2 + sp.Abs(u) + sp.Abs(w) * (1 + x**2),
        integrals={"fuel": sp.Max(u, 2 * w)},
    )  # fmt: skip
    comparisons = kernel_errors(system, dmoc.build(system, order=order))
    names = {c.kernel for c in comparisons}
    assert {"lifted", "lifted_jac", "hidden", "integral"} <= names
    assert max(c.error for c in comparisons) < 1e-11
