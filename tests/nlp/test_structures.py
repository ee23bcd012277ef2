"""What programs of one form share: the same numbers as without sharing, also in several threads."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

import dmoc
from dmoc.codegen.kernels import Array
from dmoc.nlp import layout, transcription
from dmoc.nlp.guess import initial_guesses
from dmoc.nlp.scaling import scale_of
from dmoc.nlp.transcription import Transcription
from dmoc.solvers.kkt_layout import kkt_layout

CHANGES: list[dict[str, Any]] = [
    {"parameters": {"l": 0.45, "m_p": 1.2}},
    {"bounds": {"F": (-150.0, 150.0)}},
    {"start": {"alpha": 0.45, "x": 0.1}},
    {"final_time": (0.1, 1.0)},
    {"final_time": 0.5},
    {"restitution": 0.5},
    {"restitution": 0.0},
    {"sequence": ("right",)},
    {"sequence": ("left", "left")},
    {"steps": (9, 11)},
    {"controls": "linear"},
    {"periodic": ("alpha_dot",), "start": {"alpha": 0.45, "x": 0.1}, "goal": {}},
    {"goal": {"alpha": 1.5, "alpha_dot": (0.0, 1.0), "x": (-1.0, None)}},
    {"start": {"alpha": (0.4, 0.5), "x": 0.0}},
]


def forget() -> None:
    transcription._structure.cache_clear()
    layout._shared.cache_clear()


@pytest.fixture(autouse=True)
def alone() -> Iterator[None]:
    """No structure is known before a test."""
    forget()
    yield
    forget()


@pytest.fixture
def small(seed: dmoc.Problem) -> dmoc.Problem:
    return seed.but(steps=10)


def numbers(problem: dmoc.Problem, goal_as_rows: bool = False) -> list[Array]:
    """Values, derivatives, patterns and names of a program at a start."""
    x = initial_guesses(problem)[0].x
    nlp = Transcription(problem, scale_of(problem, x), goal_as_rows)
    point = nlp.scaled(x) + 1e-3 * np.sin(np.arange(nlp.n))
    y, w = np.cos(np.arange(nlp.n_eq)), np.sin(1 + np.arange(nlp.n_in))
    hessian, order = nlp.lagrangian_hessian(point, y, w, 0.7), kkt_layout(nlp)
    return [
        *(nlp.values(point), nlp.slopes(point), nlp.lower, nlp.upper, nlp.unit, nlp.row_unit),
        *(nlp.assembled.jacobian.indptr, nlp.assembled.jacobian.indices),
        *(hessian.data, hessian.indices, hessian.indptr, order.place, order.from_jac, order.row),
    ]


@pytest.mark.parametrize("goal_as_rows", [False, True])
def test_sharing_changes_no_number(small: dmoc.Problem, goal_as_rows: bool) -> None:
    problems = [small, *(small.but(**change) for change in CHANGES)]
    alone = []
    for problem in problems:
        forget()
        alone.append(numbers(problem, goal_as_rows))
    forget()
    for _ in range(2):  # first made, then shared
        for problem, expected in zip(problems, alone, strict=True):
            for a, b in zip(numbers(problem, goal_as_rows), expected, strict=True):
                np.testing.assert_array_equal(a, b)


def test_other_numbers_share_a_structure_and_other_forms_do_not(small: dmoc.Problem) -> None:
    first = Transcription(small).structure
    shared = [Transcription(small.but(**change)).structure is first for change in CHANGES]
    assert shared == [True] * 3 + [False] * (len(CHANGES) - 3)
    assert Transcription(small, by_rates=True).structure is not first


def test_names_are_those_of_the_problem_not_of_the_one_that_was_first(small: dmoc.Problem) -> None:
    for latest in (1.0, 2.0):
        nlp = Transcription(small.but(final_time=(None, latest)))
        assert nlp.rows.d.latest.name_of(0) == f"final time <= {latest:g} s"


def test_threads_may_share(small: dmoc.Problem) -> None:
    problems = [small.but(parameters={"l": 0.4 + 0.01 * i}) for i in range(8)]
    alone = [numbers(p) for p in problems]
    forget()
    with ThreadPoolExecutor(4) as pool:
        for found, expected in zip(pool.map(numbers, problems), alone, strict=True):
            for a, b in zip(found, expected, strict=True):
                np.testing.assert_array_equal(a, b)
