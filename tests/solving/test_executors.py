"""Batches in executors of the caller: what these get, and what is said of broken ones."""

from __future__ import annotations

from concurrent.futures import Executor, Future
from typing import Any

import pytest
from batch_rows import masses

import dmoc
from dmoc.solving import many

pytestmark = pytest.mark.slow


class Counting(Executor):
    """Does each share at once, and keeps how many problems it had."""

    def __init__(self) -> None:
        self.sizes = list[int]()

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        self.sizes.append(len(args[0].problems))
        future: Future[Any] = Future()
        future.set_result(fn(*args, **kwargs))
        return future


@pytest.mark.parametrize(
    "seconds, largest", [(1.0, 1), (0.05, 10), (1e-4, many.TOGETHER)], ids=["slow", "some", "quick"]
)
def test_quick_problems_travel_together_and_slow_ones_alone(
    bounced: dmoc.Problem, monkeypatch: pytest.MonkeyPatch, seconds: float, largest: int
) -> None:
    def solved(share: many.Share) -> list[many.Row]:
        return [many.Row(number, "solved", "", seconds=seconds) for number, _ in share.problems]

    monkeypatch.setattr(many, "solve_share", solved)
    executor = Counting()
    batch = dmoc.solve_many([bounced] * 1200, executor=executor)
    assert batch.status == ("solved",) * 1200 and sum(executor.sizes) == 1200
    assert executor.sizes[0] == 1 and max(executor.sizes) == largest
    assert executor.sizes[-1] <= 2  # the last ones are small, so that none is waited for


class Refusing(Executor):
    """Takes one share."""

    taken = 0

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        if self.taken:
            raise RuntimeError("closed")
        self.taken += 1
        future: Future[Any] = Future()
        future.set_result(fn(*args, **kwargs))
        return future


def test_an_executor_that_takes_no_more_is_told(bounced: dmoc.Problem) -> None:
    problems = masses(bounced, 1.0, 1.0)
    batch = dmoc.solve_many(problems, executor=Refusing(), verify=False)
    assert set(batch.status) == {"not_tried"} and "takes no more work (closed)" in batch.message[0]


class Broken(Executor):
    """Raises, or returns what is no future."""

    def __init__(self, answer: object) -> None:
        self.answer = answer

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Any:
        if isinstance(self.answer, Exception):
            raise self.answer
        return self.answer


@pytest.mark.parametrize(
    ("answer", "says"),
    [
        (TypeError("no"), "the executor takes no more work (no)"),
        (ValueError(), "the executor takes no more work (ValueError)"),
        (OSError(28, "No space"), "the executor takes no more work ([Errno 28] No space)"),
        (None, "the executor has returned None for work, no future"),
    ],
)
def test_an_executor_that_is_broken_ends_the_work(
    bounced: dmoc.Problem, answer: object, says: str
) -> None:
    batch = dmoc.solve_many(masses(bounced, 1.0, 1.0), executor=Broken(answer), verify=False)
    assert batch.status == ("not_tried",) * 2 and set(batch.message) == {says}
