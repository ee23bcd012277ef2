"""Who solves the problems of a batch, rows or solves one by one."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import block_and_wall
import pytest

import dmoc
from dmoc.solving import many, rows
from dmoc.solving.beginning import Beginning
from dmoc.solving.row import Row


@pytest.fixture
def together(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The numbers of the problems that were solved as rows, however long they take."""
    monkeypatch.setattr(many.Pace, "together", 64)
    numbers, solved = list[int](), many.solved_rows

    def noted(*args: Any) -> Iterator[Row | Beginning]:
        for each in solved(*args):
            if isinstance(each, Row):
                numbers.append(each.number)
            yield each

    monkeypatch.setattr(many, "solved_rows", noted)
    return numbers


@pytest.fixture
def alone(monkeypatch: pytest.MonkeyPatch) -> Callable[..., dmoc.Batch]:
    """The rows of solves one by one."""

    def solved(problems: list[dmoc.Problem], **options: Any) -> dmoc.Batch:
        with monkeypatch.context() as patch:
            patch.setattr(rows, "FEWEST", len(problems) + 1)
            return dmoc.solve_many(problems, **options)

    return solved


@pytest.fixture(scope="module")
def bounced() -> dmoc.Problem:
    return block_and_wall.problem(0.8, 10, 4)
