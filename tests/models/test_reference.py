"""How a model was named travels with its kernels."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest

import dmoc
from dmoc.base.errors import ModelError
from dmoc.models.catalogue import ENTRIES
from dmoc.models.registry import find

MODEL = """
import dmoc
from dmoc.models.registry import find

def problem():
    reference = find("puck_table")
    return dmoc.Problem(reference.kernels(), **{**reference.defaults, "steps": 10})
"""


def solved(reference: str) -> dmoc.Solution:
    model = find(reference)
    problem = dmoc.Problem(model.kernels(), **{**model.defaults, "steps": 10})
    return dmoc.solve(problem, "ipm", iterations=3, verify=False)


LADDER = """
from sympy.physics.mechanics import dynamicsymbols
import dmoc

x = dynamicsymbols("x")

def mass(name="mass", *more, **fields):
    return dmoc.MechanicalSystem(name, [x], x.diff() ** 2 / 2, {}, **fields)

def needs(one, /, *, other):
    return mass()

def raises():
    raise ValueError("first: second: third")

def silent():
    raise ValueError

shifted = mass("shifted")
number = 5
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "ladder.py"
    path.write_text(LADDER, encoding="utf-8")
    return path


@pytest.mark.parametrize("name", ["mass", "shifted"])
def test_a_system_of_a_file_is_found_by_its_name(file: Path, name: str) -> None:
    reference = find(f"{file}:{name}")
    assert reference.system().name == name and reference.name == f"{file}:{name}"


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("needs", "needs in .*ladder.py needs the arguments one, other: expected"),
        ("raises", "cannot be loaded: ValueError in line 14: first: second: third; correct"),
        ("silent", "cannot be loaded: ValueError in line 17: no message; correct"),
        ("number", "number in .*ladder.py is 5: expected a MechanicalSystem"),
        ("nothing", "ladder.py defines no 'nothing': expected"),
    ],
)
def test_what_is_no_system_of_a_file_is_told(file: Path, name: str, told: str) -> None:
    with pytest.raises(ModelError, match=told):
        find(f"{file}:{name}")


@pytest.mark.parametrize("name", [n for n, e in ENTRIES.items() if e.problem])
def test_what_is_shipped_can_be_stated(name: str) -> None:
    """Its start and its goal lie before all surfaces and within all bounds."""
    reference = find(name)
    problem = dmoc.Problem(reference.kernels(), **reference.defaults)
    assert problem.kernels.name == ENTRIES[name].model
    for end in (problem.start_bounds, problem.goal_bounds):
        fixed = end.position[:, 0] == end.position[:, 1]
        at = np.where(fixed, end.position[:, 0], problem.start_position)
        assert (problem.model.gaps(at) < 0).all()


def test_the_swing_up_of_the_source_begins_at_27_degrees() -> None:
    reference = find("cart_pendulum")
    assert np.degrees(reference.defaults["start"]["alpha"]) == pytest.approx(27.0)
    assert np.degrees(reference.defaults["goal"]["alpha"]) == pytest.approx(90.0)


@pytest.mark.slow
def test_a_solution_names_its_model_as_the_user_did(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(MODEL, encoding="utf-8")
    for reference in ("cart_pendulum_hanging", f"{tmp_path / 'mine.py'}:problem"):
        assert solved(reference).reference == reference
        assert pickle.loads(pickle.dumps(find(reference).kernels())).reference == reference


@pytest.mark.slow
def test_what_nobody_named_has_the_name_of_its_model_or_the_one_that_is_given(
    seed: dmoc.Problem,
) -> None:
    problem = seed.but(kernels=dmoc.build(find("cart_pendulum").system()), steps=10)
    first = dmoc.solve(problem, "ipm", iterations=2, verify=False)
    second = dmoc.solve(problem, "ipm", iterations=2, verify=False, reference="mine")
    assert (first.reference, second.reference) == ("cart_pendulum", "mine")


def test_solutions_of_a_search_name_the_model_too() -> None:
    model = find("puck_table")
    problem = dmoc.Problem(model.kernels(), **{**model.defaults, "steps": 10, "sequence": ()})
    best = dmoc.search(problem, 0).best
    assert (
        best is not None and best.solution is not None and best.solution.reference == "puck_table"
    )
