"""How a model was named travels with its kernels."""

from __future__ import annotations

import pickle
from pathlib import Path

import pytest

import dmoc
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
