"""The page of a derivation, and the check of kernels that it shows."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from xml.dom.minidom import parseString

import mpmath as mp
import numpy as np
import pytest
import sympy as sp
from scipy import sparse
from sympy.physics.mechanics import dynamicsymbols
from systems import block_system, driven_system, puck_system, rod_system

import dmoc
from dmoc.base.discretisation import ORDERS
from dmoc.base.errors import OutputError
from dmoc.base.table import TONES
from dmoc.codegen.kernels import Kernels
from dmoc.codegen.operation_counts import count_of
from dmoc.inspection import system_derivation
from dmoc.inspection.kernel_check import Checked, _curvature, _error, kernel_errors
from dmoc.inspection.reference_functions import DIGITS
from dmoc.inspection.system_derivation import small_problem
from dmoc.symbolic.derivation.notebook import system_table
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
    left_out = set(kernels.manifest.kernels) - names
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


def test_constraints_of_velocities_are_told_apart_from_those_of_places() -> None:
    x, y, a = dynamicsymbols("x y a")
    blade = x.diff() * sp.sin(a) - y.diff() * sp.cos(a)
    system = dmoc.MechanicalSystem(
        "towed_blade", [x, y, a], (x.diff() ** 2 + y.diff() ** 2 + a.diff() ** 2) / 2,
        constraints={"blade": blade, "rail": y},
    )  # fmt: skip
    sections = {s.title: s for s in dmoc.derive(system).sections}
    (place,) = sections["Constraints"].equations
    (rate,) = sections["Constraints of velocities"].equations
    assert (place.name, rate.name) == ("phi_rail", "c_blade")
    assert place.latex_name.startswith(r"\phi_") and rate.latex_name.startswith("c_")
    shown = str(system_table(system))
    assert "phi_rail" in shown and "c_blade" in shown and "phi_blade" not in shown


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


def test_blocks_are_listed_one_behind_the_other() -> None:
    blocks: Any = [
        SimpleNamespace(name=name, count=count, name_of=lambda k, name=name: f"{name} {k}")
        for name, count in (("p_B", 2), ("none", 0), ("q", 5), ("h", 1))
    ]
    assert list(system_derivation._listed(blocks)) == [
        ("p B", "0", "2", "p_B 0"), ("q", "2", "5", "q 0"), ("h", "7", "1", "h 0"),
    ]  # fmt: skip


def test_a_hessian_is_drawn_with_both_its_triangles(monkeypatch: pytest.MonkeyPatch) -> None:
    """[x 0 x; 0 x x] of constraints, and [x x; . x] as the upper triangle of a Hessian."""
    drawn = list[tuple[Any, ...]]()
    monkeypatch.setattr(system_derivation, "sparsity", lambda *a: drawn.append(a) or "")

    def pattern(m: list[list[int]]) -> SimpleNamespace:
        matrix = sparse.csr_array(np.array(m))
        return SimpleNamespace(indptr=matrix.indptr, matrix=lambda *_: matrix)

    nlp: Any = SimpleNamespace(
        assembled=SimpleNamespace(
            jacobian=pattern([[1, 0, 1], [0, 1, 1]]), hessian=pattern([[1, 1], [0, 1]])
        )
    )
    system_derivation._patterns(nlp)
    (rows, columns, places, caption), hessian = drawn
    assert (rows, columns, sorted(places)) == (2, 3, [(0, 0), (0, 2), (1, 1), (1, 2)])
    assert caption == "Jacobian of the constraints: 2 x 3, 4 entries, 66.7 %"
    assert sorted(hessian[2]) == [(0, 0), (0, 1), (1, 0), (1, 1)]
    assert hessian[3].endswith("2 x 2, 4 entries, 100.0 %")


def test_the_worst_kernel_is_named_and_the_bad_ones_marked(monkeypatch: pytest.MonkeyPatch) -> None:
    errors = (Checked("a", 1e-12), Checked("b", 2e-9), Checked("c", 9e-10))
    monkeypatch.setattr(system_derivation, "kernel_errors", lambda *_: errors)
    kernels: Any = SimpleNamespace(manifest=SimpleNamespace(kernels=dict.fromkeys("dcbae")))
    system: Any = None
    text = system_derivation._check(system, kernels)
    assert "Largest relative error: 2.0e-09 (b). Not compared: d, e." in text
    bad = [n for n in ("1.0e-12", "2.0e-09", "9.0e-10") if f'{TONES["bad"][1]}">{n}' in text]
    assert bad == ["2.0e-09"]


def test_errors_are_measured_by_the_largest_value() -> None:
    assert _error(np.array([1.0, 4.0]), [1.0, 5.0]) == pytest.approx(0.2)
    assert _error(np.array([-4.0, 10.0]), [-5.0, 10.0]) == pytest.approx(0.1)
    assert _error(np.array([8.0]), [4.0]) == pytest.approx(0.5)
    assert _error(np.zeros(2), [0.0, 0.0]) == 0 and _error(np.zeros(0), []) == 0


def test_curvatures_are_those_of_a_product() -> None:
    """2 x^2 y - 3 x y: d . H e with H = [4 y, 4 x - 3; 4 x - 3, 0] at (2, 5)."""
    values = {"a": np.array([2.0, -3.0])}
    d, e = [mp.mpf(1), mp.mpf(2)], [mp.mpf(-1), mp.mpf(3)]
    with mp.workdps(DIGITS):
        bent = _curvature(
            lambda x: {"a": [x[0] ** 2 * x[1], x[0] * x[1]]}, values, ([mp.mpf(2), mp.mpf(5)], d, e)
        )
    assert float(bent) == pytest.approx(20 * 1 * -1 + 5 * (1 * 3 + 2 * -1), rel=1e-12)


def test_kernels_of_contacts_agree_beside_inputs() -> None:
    """A floor that rises, with friction, laws of both restitutions, and a switch."""
    x, y, u = dynamicsymbols("x y u")
    mu, k = sp.symbols("mu k")
    system = dmoc.MechanicalSystem(
        "rising", [x, y], x.diff() ** 2 / 2 + y.diff() ** 2 - 9.81 * y, {mu: 0.3, k: 0.5}, [u],
        {x: u, y: u / 2}, cost=u**2, surfaces={"floor": y >= dynamicsymbols._t / 3},
        tangents={"floor": x}, friction={"floor": mu}, tangential_restitution={"floor": k},
        restitution={"floor": sp.exp(-k * dmoc.approach_speed)},
        switches={"gate": x * y.diff() - k * dynamicsymbols._t},
    )  # fmt: skip
    comparisons = kernel_errors(system, dmoc.build(system))
    names = {c.kernel for c in comparisons}
    assert {"friction", "tangential", "rebound", "tangent", "slide_rate", "surface"} <= names
    assert {"crossing", "crossing_rate_jac", "crossing_rate_hess"} <= names
    assert max(c.error for c in comparisons) < 1e-11
