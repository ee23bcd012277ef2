"""The list of methods, and what reads it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import block_and_wall
import pytest
from answers import answer_of
from sympy.physics.mechanics import dynamicsymbols
from systems import landing_problem, landing_system

import dmoc
from dmoc.base.errors import ProblemError, SearchError
from dmoc.solving.keywords import Keywords
from dmoc.solving.methods import FORMS, METHODS, listed
from dmoc.solving.request import request_of


def test_every_method_has_a_driver_and_its_package_is_an_extra() -> None:
    from importlib.metadata import metadata

    extras = metadata("dmoc").get_all("Provides-Extra") or []
    for name, method in METHODS.items():
        assert method.name == name and name in listed()
        assert all(callable(method.loaded(form)) for form in FORMS)
        assert method.package is None or name in extras
        assert method.falls_back_on is None or method.falls_back_on in METHODS


ALREADY = """
import sys, dmoc
from dmoc.models.registry import find
reference = find("cart_pendulum")
problem = dmoc.Problem(reference.kernels(), **{**reference.defaults, "steps": 24})
s = dmoc.solve(problem, sys.argv[1], verify=False)
print(s.status, s.method, s.iterations, s.cost.hex(), "scipy" in sys.modules)
"""


def test_slsqp_runs_where_its_start_is_a_solution() -> None:
    """The best of the starts, a minimum by the compiled method, is looked at by SLSQP before it is
    its answer; the compiled method alone loads no SciPy."""
    by_slsqp, by_ipm = (
        subprocess.run(
            [sys.executable, "-c", ALREADY, method],
            capture_output=True, text=True, check=True,
        ).stdout.split()
        for method in ("slsqp", "ipm")
    )  # fmt: skip
    assert by_slsqp[:2] == ["solved", "slsqp"] and int(by_slsqp[2]) > 0 and by_slsqp[4] == "True"
    assert by_ipm[:2] == ["solved", "ipm"] and by_ipm[4] == "False"
    cost, other = (float.fromhex(answer[3]) for answer in (by_slsqp, by_ipm))
    assert cost == pytest.approx(other, rel=1e-6)


def test_slsqp_goes_on_from_a_solution_of_another_problem() -> None:
    """Multipliers that do not meet the tolerances there keep no start."""
    problem = landing_problem(6)
    other = dmoc.solve(problem.but(final_time=1.6), "ipm", starts=1)
    solution = dmoc.solve(problem, "slsqp", guess=other, verify=False)
    wanted = dmoc.solve(problem, "ipm", starts=1, verify=False)
    assert solution.iterations > 0 and solution.status == "solved"
    assert "took over" not in solution.message
    assert solution.cost == pytest.approx(wanted.cost, rel=1e-8)


@pytest.mark.parametrize(
    ("check", "error"), [(dmoc.solve, ProblemError), (dmoc.search, SearchError)]
)
def test_a_method_that_cannot_be_used_is_refused_before_anything_is_tried(
    check: Any, error: type[Exception]
) -> None:
    problem = block_and_wall.problem(0.8, 10)
    plain = problem.but(kernels=dmoc.build(block_and_wall.system(), backend="numpy"))
    with pytest.raises(error, match="method ipm needs compiled kernels"):
        check(plain, method="ipm")
    with pytest.raises(error, match="at most 2000 inputs"):
        check(problem.but(steps=2000), method="slsqp")


@pytest.mark.slow
def test_without_a_compiler_there_is_a_warning_of_one_sentence_and_an_answer(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Whatever has the compiled method as its default takes one that needs no compiler."""
    problem = block_and_wall.problem(1.0, 8)
    monkeypatch.setenv("CC", "no-such-compiler")
    monkeypatch.setenv("DMOC_CACHE", str(tmp_path))
    with pytest.warns(RuntimeWarning, match=r"no C compiler was found [^.]*much slower\.$"):
        kernels = dmoc.build(block_and_wall.system())
    problem = problem.but(kernels=kernels)
    refined = answer_of(problem, tolerance=1e-2)
    assert refined.method == "slsqp"
    assert refined.cost == pytest.approx(24, rel=1e-2)
    batch = dmoc.sweep(problem, {"m": [1.0, 2.0]})
    assert batch.method == "slsqp" and batch.cost[1] == pytest.approx(4 * batch.cost[0])
    result = dmoc.search(problem, 1)
    assert result.best is not None and result.best.sequence == ()
    assert {node.sequence: node.verdict for node in result.nodes}["wall",] == "feasible"


@pytest.mark.slow
def test_contacts_that_last_are_solved_without_a_compiler() -> None:
    problem = landing_problem(6)
    plain = problem.but(kernels=dmoc.build(landing_system(), backend="numpy"))
    solution, wanted = dmoc.solve(plain), dmoc.solve(problem, starts=1)
    assert (solution.status, solution.method) == ("solved", "slsqp")
    assert solution.cost == pytest.approx(wanted.cost, rel=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("order", [2, 4])
def test_the_full_program_has_the_minimum_of_the_condensed_one(order: int) -> None:
    condensed, full = (
        dmoc.solve(block_and_wall.problem(0.8, 8, order), form=form, starts=1, verify=False)
        for form in FORMS
    )
    assert full.status == condensed.status == "solved"
    assert full.cost == pytest.approx(condensed.cost, rel=1e-12)
    assert abs(full.unknowns - condensed.unknowns).max() < 1e-8


@pytest.mark.parametrize("form", FORMS)
def test_slsqp_solves_contacts_that_last(form: str) -> None:
    """The same minimum as the compiled method, through an event without an impact."""
    problem = landing_problem(6)
    solution = dmoc.solve(problem, "slsqp", form=form, starts=1, verify=False)
    wanted = dmoc.solve(problem, starts=1, verify=False)
    assert (solution.status, solution.method) == ("solved", "slsqp")
    assert solution.cost == pytest.approx(wanted.cost, rel=1e-5)
    assert [c.word for c in solution.collisions] == ["+floor:slip+", "floor:stick"]


@pytest.mark.parametrize(("steps", "method"), [(1000, "slsqp"), (1001, "ipm")])
def test_a_default_solve_of_many_steps_is_none_of_dense_matrices(steps: int, method: str) -> None:
    x, u = dynamicsymbols("x u")
    sled = dmoc.MechanicalSystem(
        "sled", [x], x.diff() ** 2 / 2, inputs=[u], forces={x: u}, cost=u**2
    )
    problem = dmoc.Problem(sled, {x: 0}, {x: 1, "x_dot": 0}, final_time=1, steps=steps)
    assert request_of(problem, Keywords()).method.name == method
