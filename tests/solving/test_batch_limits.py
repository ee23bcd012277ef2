"""Batches in time, after Ctrl-C and in threads: nothing that was solved is lost."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import pytest
from batch_rows import MASSES, NUMBERS, WORDS, masses, neighbours, pendulum

import dmoc
from dmoc.base.deadline import Deadline
from dmoc.solvers.row_solves import solve_rows
from dmoc.solving import many, rows
from dmoc.solving.many import BatchProgress
from dmoc.solving.row import Row

pytestmark = pytest.mark.slow


def test_time_and_ctrl_c_keep_what_was_done(
    bounced: dmoc.Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[BatchProgress] = []
    monkeypatch.setattr(many.Pace, "together", 1)

    def interrupt(p: BatchProgress) -> None:
        seen.append(p)
        if p.done == 2:
            raise KeyboardInterrupt

    batch = dmoc.solve_many(masses(bounced, *MASSES), progress=interrupt)
    assert batch.status == ("solved", "solved", "not_tried")
    assert batch.tried == 2 and not batch.complete
    assert "Ctrl-C" in batch.message[2]
    assert [(p.done, p.total, p.counts) for p in seen] == [
        (1, 3, {"solved": 1}),
        (2, 3, {"solved": 2}),
    ]
    slow = dmoc.solve_many(
        masses(bounced, *MASSES), seconds=0.3, progress=lambda p: time.sleep(0.4)
    )
    assert slow.status[1:] == ("not_tried",) * 2 and "time" in slow.message[1]


def test_rows_stop_in_time_and_by_ctrl_c(
    together: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    base = pendulum(2)
    guess = dmoc.solve(base, "ipm", starts=1, verify=False)
    problems = neighbours(base, 40, 0.02)
    late = dmoc.solve_many(problems, guess=guess, seconds=0.02)
    assert set(late.status) <= {"solved", "not_verified", "not_tried", "time_limit"}
    assert "not_tried" in late.status

    def interrupted(*args: Any) -> Any:
        raise KeyboardInterrupt

    monkeypatch.setattr(rows, "row_numbers", interrupted)
    batch = dmoc.solve_many(problems, guess=guess, verify=False)
    assert batch.counts == {"interrupted": 1, "not_tried": 39}


def test_rows_that_have_passed_before_ctrl_c_are_kept(
    together: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    class Interrupted(rows.FreeMotion):
        def judge(self, *args: Any) -> None:
            verdicts = args[4]
            verdicts[:7] = rows.PASSES
            raise KeyboardInterrupt

    base = pendulum(2)
    guess = dmoc.solve(base, "ipm", starts=1, verify=False)
    monkeypatch.setattr(rows, "FreeMotion", Interrupted)
    batch = dmoc.solve_many(neighbours(base, 20, 0.02), guess=guess)
    assert batch.status[:8] == (*("solved",) * 7, "interrupted")
    assert batch.counts == {"solved": 7, "interrupted": 1, "not_tried": 12}


def test_threads_solve_rows_and_give_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    """No process is started for one problem that is left over."""
    base = pendulum(2)
    guess = dmoc.solve(base, "ipm", starts=1)
    problems = [*neighbours(base, 30, 1e-3), base.but(steps=(6, 9))]
    one = dmoc.solve_many(problems, guess=guess)
    monkeypatch.setattr(many, "workforce", None)
    for workers in (2, 3):
        several = dmoc.solve_many(problems, guess=guess, workers=workers)
        assert [getattr(several, name) for name in WORDS] == [getattr(one, name) for name in WORDS]
        for name in NUMBERS:
            assert getattr(several, name).tobytes() == getattr(one, name).tobytes()


def test_what_threads_do_not_solve_is_left_to_processes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also what comes behind a share in which nothing is a row."""
    base, given = pendulum(2), list[int]()
    guess = dmoc.solve(base, "ipm", starts=1)
    problems = [base.but(steps=(6, 9 + k)) for k in range(4)] + neighbours(base, 8, 0.02)
    solved = many.solve_share

    @contextmanager
    def counted(workers: int, executor: None) -> Iterator[Any]:
        def answers(work: Any, shares: Iterator[many.Share], deadline: Deadline) -> Iterator[Any]:
            for share in shares:
                given.extend(number for number, _ in share.problems)
                yield solved(share)

        yield answers

    monkeypatch.setattr(many, "workforce", counted)
    monkeypatch.setattr(many.Pace, "together", 3)
    batch = dmoc.solve_many(problems, guess=guess, workers=2, verify=False)
    assert batch.counts == {"solved": 12}
    assert given[:4] == [0, 1, 2, 3] and len(set(given)) == len(given)


def test_the_first_share_is_as_large_as_the_guess_was_quick(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    base, sizes, solved = pendulum(2), list[int](), many.solve_share
    guess = dmoc.solve(base, "ipm", starts=1)

    def counted(share: many.Share) -> list[Row]:
        sizes.append(len(share.problems))
        return solved(share)

    monkeypatch.setattr(many, "solve_share", counted)
    for seconds, first in ((0.1, 5), (10.0, 1), (1e-6, 8)):
        sizes.clear()
        timed = replace(guess, seconds={"solve": seconds / 2, "verify": seconds / 2})
        dmoc.solve_many(neighbours(base, 8, 0.02), guess=timed, verify=False)
        assert sizes[0] == first


def test_rows_that_are_solved_in_time_are_kept(
    together: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those behind one that has no time too; where ends are checked, solves leave time for it."""
    base = pendulum(2)
    guess = dmoc.solve(base, "ipm", starts=1, verify=False)
    plain, left = neighbours(base, 3, 0.02), list[float]()

    def late(*args: Any) -> Any:
        left.append(args[-1].deadline.left)
        ends = solve_rows(*args)
        monkeypatch.setattr(Deadline, "passed", True)
        return ends

    problems = [plain[0], base.but(steps=(6, 9)), *plain[1:]]
    with monkeypatch.context() as patch:
        patch.setattr(rows, "solve_rows", late)
        batch = dmoc.solve_many(problems, guess=guess, verify=False, seconds=1000.0)
        assert batch.status == ("solved", "not_tried", "solved", "solved")
        monkeypatch.setattr(Deadline, "passed", False)
        batch = dmoc.solve_many(problems, guess=guess, seconds=1000.0)
    assert batch.counts == {"not_tried": 4} and left[1] <= 500.0 < left[0]
