"""What print, repr and notebooks show of the objects that users hold."""

from __future__ import annotations

import io
import re
import shutil
from dataclasses import replace
from typing import Any
from xml.dom.minidom import parseString

import pytest
import sympy as sp
from rich.console import Console
from sympy.physics.mechanics import dynamicsymbols
from systems import block_system, driven_system, landing_problem, rod_system, there_and_back

import dmoc
from dmoc.base.table import TONES, Table, html_of, print_table, text_of, toned
from dmoc.models.registry import find
from dmoc.sequences.nodes import Node, Verdict
from dmoc.sequences.search import SearchResult
from dmoc.sequences.search_table import table_of_search
from dmoc.symbolic.derivation import mathml


@pytest.fixture(scope="module")
def objects() -> dict[str, Any]:
    problem = there_and_back(dmoc.build(block_system()), steps=20, bounds={"u": (-100, 100)})
    solution = dmoc.solve(problem, "ipm", starts=1)
    return {
        "system": block_system(), "derivation": dmoc.derive(block_system()),
        "kernels": problem.kernels, "problem": problem, "solution": solution,
        "verification": solution.verification, "simulation": dmoc.simulate(solution),
        "batch": dmoc.sweep(problem, {"m": [1.0, 2.0]}, method="ipm"),
        "result": dmoc.search(problem.but(steps=10), max_collisions=1, starts=1),
    }  # fmt: skip


EXPECTED = {
    "system": ["coordinates", "m = 1, wall = 1", "g_wall"],
    "derivation": ["Discrete Euler-Lagrange equations"], "kernels": ["order 2", "m = 1, wall = 1"],
    "problem": ["x = 0, x_dot = 0", "20 + 20 steps, order 2, constant inputs", "u: -100 to 100"],
    "solution": ["solved: a local minimum was found", "collision wall", "optimality"],
    "verification": ["passed", "amplification"], "simulation": ["final time", "collision wall"],
    "batch": ["status", "2 solved"], "result": ["verdict", "best: no collision"],
}  # fmt: skip


@pytest.mark.parametrize("name", EXPECTED)
def test_objects_print_as_tables_and_repeat_in_a_line(objects: dict[str, Any], name: str) -> None:
    value = objects[name]
    for text in EXPECTED[name]:
        assert text in str(value), text
    assert len(repr(value)) < 200 and "\n" not in repr(value)
    assert repr(value).startswith("<") and "array" not in repr(value)


@pytest.mark.parametrize("name", EXPECTED)
def test_pages_of_objects_are_well_formed(objects: dict[str, Any], name: str) -> None:
    page = objects[name]._repr_html_()
    parseString(f"<div>{page}</div>")
    assert "http" not in page.replace("http://www.w3.org/1998/Math/MathML", "")


def test_the_command_line_shows_the_same_table(objects: dict[str, Any]) -> None:
    """As wide as the table that print makes, without its colours."""
    stream = io.StringIO()
    width = shutil.get_terminal_size((100, 24)).columns
    print_table(objects["solution"].summary(), Console(file=stream, width=width))
    lines = [line.rstrip() for line in stream.getvalue().splitlines()]
    assert "\n".join(lines) == str(objects["solution"])


def test_names_are_escaped_and_tones_are_kept() -> None:
    table = Table((("<b>", toned("a & b", "bad")),), ("<i>",), ("1 < 2",), "<title>")
    page = html_of(table)
    assert "&lt;b&gt;" in page and "a &amp; b" in page and "&lt;i&gt;" in page
    assert "1 &lt; 2" in page and "&lt;title&gt;" in page and TONES["bad"][1] in page
    assert "a & b" in text_of(table) and "<title>" not in text_of(table)


@pytest.mark.slow
def test_a_title_is_no_markup_in_a_notebook() -> None:
    system = replace(block_system(), title="<script>alert(1)</script>")
    for titled in (system, dmoc.build(system)):
        assert "<script>" not in titled._repr_html_()


@pytest.mark.slow
@pytest.mark.parametrize("make", [driven_system, rod_system])
def test_formulas_of_models_are_well_formed(make: Any) -> None:
    system = make()
    parseString(f"<div>{system._repr_html_()}</div>")
    latex = system._repr_latex_()
    assert latex.startswith("$") and latex.count("{") == latex.count("}") and "C &=" in latex
    page = dmoc.derive(system)._repr_html_()
    parseString(page)
    assert len(re.findall("<math", page)) > 30
    assert "_" not in re.sub(r"<[^>]*>", "", "".join(re.findall(r"<math.*?</math>", page)))


def test_names_become_letters_with_marks() -> None:
    assert mathml.symbol("alpha") == "<mi>\u03b1</mi>"
    assert mathml.symbol("m_c") == "<msub><mi>m</mi><mrow><mi>c</mi></mrow></msub>"
    assert "<mo>.</mo>" in mathml.symbol("x_dot_kp1") and "<mn>1</mn>" in mathml.symbol("x_dot_kp1")
    assert mathml.symbol("r_plus_x").startswith("<msubsup><mi>r</mi>")
    assert "~" in mathml.symbol("h~")


def test_long_sums_go_on_in_further_lines() -> None:
    names = sp.symbols("a_0:40")
    page = mathml.equation("<mi>L</mi>", sp.Add(*(x**2 for x in names)) - sp.Symbol("b"))
    assert 3 <= page.count("<mtr>") <= 8 and page.count("<msup>") == 40
    assert page.count("<mo>\u2212</mo>") == 1
    parseString(page)


def test_problems_say_ranges_and_contacts() -> None:
    problem = landing_problem().but(
        goal={"x": (0.4, None), "x_dot": 0}, final_time=(0.5, 2), via=[{"x": 0.2}, None]
    )
    text = " ".join(str(problem).split())
    assert "x at least 0.4" in text and "0.5 to 2 s" in text and "via at event 1 x = 0.2" in text
    assert "+floor:slip+, floor:stick" in text


@pytest.mark.slow
def test_sensible_values_of_one_coordinate() -> None:
    """A model without inputs and surfaces has nothing to list there."""
    x = dynamicsymbols("x")
    system = dmoc.MechanicalSystem("free", [x], x.diff() ** 2 / 2, {})
    kernels = dmoc.build(system)
    assert "inputs none" in " ".join(str(kernels).split())
    parseString(f"<div>{system._repr_html_()}</div>")
    assert "L &=" in system._repr_latex_()


def test_the_table_of_a_search_is_narrow_and_tells_why_on_request(
    objects: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Long sequences are wrapped, and nothing is cut."""
    monkeypatch.setenv("COLUMNS", "80")
    long = ("left", "right") * 12
    why = "none of 8 starts led to it " * 5
    nodes = (Node(long, Verdict.INFEASIBLE, evidence=(why,)), Node(("left",), Verdict.FAILED))
    result = SearchResult(nodes, None, True, (), 1.0, objects["problem"])
    short, full = text_of(table_of_search(result)), text_of(table_of_search(result, why=True))
    assert max(map(len, f"{short}\n{full}".splitlines())) <= 80 and "…" not in short + full
    assert short.count("right") == full.count("right") == 12
    assert "none of 8" not in short and full.count("starts led") >= 4 and "--verbose" in short


def test_parts_of_results_are_a_line_or_a_table() -> None:
    reference = find("puck_table")
    problem = dmoc.Problem(reference.kernels(), **{**reference.defaults, "steps": 20})
    node = dmoc.search(problem, 1).best
    assert node is not None and node.solution is not None
    assert repr(node) == f"<Node east: optimal, cost {node.cost:.6g}>"
    assert "confirmed by simulation" in str(node) and "<table" in node._repr_html_()
    motion = node.solution.trajectory
    assert repr(motion).startswith("<Trajectory of puck_table in 2 s: east at 0.47")
    assert repr(motion.phases[0]).startswith("<Phase of 20 steps from 0 to 0.47")
    assert repr(motion.collisions[0]) == f"<Collision {motion.collisions[0]}>"
