"""A mesh that is given and too coarse for its cost is told."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from answers import answer_of

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.problem import ranges
from dmoc.results.notes import Topic
from dmoc.results.solution import Minimum
from dmoc.solving.case import Case
from dmoc.solving.mesh import coarseness


def across(block: Kernels, steps: int | None) -> dmoc.Problem:
    """1 kg goes 0.5 m in 1 s: the least integral of u^2 / 2 is 1.5 n^2 / (n^2 - 1) with n steps in
    which u does not change."""
    goal = {"x": 0.5, "x_dot": 0.0}
    return dmoc.Problem(block, {"x": 0.0}, goal, steps=steps, final_time=1.0)


def told(solution: dmoc.Solution) -> list[str]:
    return [note.text for note in solution.notes if note.topic is Topic.STEPS]


def test_a_cost_that_a_finer_mesh_changes_by_more_than_a_tenth_is_told(block: Kernels) -> None:
    solution = answer_of(across(block, 2))
    assert solution.cost == pytest.approx(2.0)
    (text,) = told(solution)
    assert text.startswith("it costs 1.6 with 4 steps instead of 2: ")
    assert not told(answer_of(across(block, 4)))  # 1.5238 with 8 steps


@pytest.mark.parametrize(
    "options", [{"tolerance": 1e-3}, {"starts": 1}, {"verify": False}], ids=lambda o: str(*o)
)
def test_no_finer_mesh_is_looked_at_unasked(block: Kernels, options: dict[str, Any]) -> None:
    assert not told(answer_of(across(block, 2), **options))


def test_no_mesh_beyond_the_finest_one_is_looked_at(
    block: Kernels, monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in (ranges, coarseness):
        monkeypatch.setattr(module, "MOST_STEPS", 3)
    solution = answer_of(across(block, 2))
    assert solution.status == "solved" and not told(solution)


@pytest.mark.parametrize("steps, looks", [(47, True), (48, False)])
def test_a_finer_mesh_is_looked_at_where_that_of_the_starts_is_no_half_of_it(
    block: Kernels, monkeypatch: pytest.MonkeyPatch, steps: int, looks: bool
) -> None:
    meshes, along = list[tuple[int, ...]](), Case.along

    def counted(case: Case, problem: dmoc.Problem, motion: dmoc.Solution) -> dmoc.Solution:
        meshes.append(problem.phase_steps)
        return along(case, problem, motion)

    monkeypatch.setattr(Case, "along", counted)
    answer_of(across(block, steps))
    assert meshes == [(2 * steps,)] * looks


@pytest.mark.parametrize(
    "steps, cost, same",
    [
        ((10, 20), 91.0, True),
        ((10, 20), 109.0, True),
        ((10, 20), 89.0, False),
        ((10, 20), 111.0, False),
        ((11, 20), 100.0, False),
        ((10, 21), 100.0, False),
        ((20,), 100.0, False),
    ],
)
def test_a_cost_has_converged_where_half_of_the_steps_say_it_within_a_tenth(
    steps: tuple[int, ...], cost: float, same: bool
) -> None:
    answer: Any = SimpleNamespace(steps=(20, 40), cost=100.0)
    assert coarseness._converged(answer, Minimum(cost, 1, "coarse", steps)) is same
    assert not coarseness._converged(answer, None)
