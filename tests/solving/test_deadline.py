"""Time limits: one moment, on one clock, wherever it travels."""

from __future__ import annotations

import math
import pickle
import time
from concurrent.futures import Executor, Future
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import block_and_wall
import pytest
from answers import answer_of
from hit_problems import back
from systems import unit_mass

import dmoc
from dmoc.base.deadline import ENDLESS, Deadline
from dmoc.solvers.outcome import Options, Status
from dmoc.solving import many, open_hits, workforce
from dmoc.solving.attempts import Attempt
from dmoc.solving.multistart import exploration, rounds
from dmoc.solving.multistart.effort import Effort


@pytest.fixture
def now(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """A clock that stands still, and may be moved."""
    moment = [100.0]
    monkeypatch.setattr(time, "perf_counter", lambda: moment[0])
    monkeypatch.setattr(time, "monotonic", lambda: moment[0])
    return moment


def test_a_limit_ends_at_its_moment_and_not_before(now: list[float]) -> None:
    deadline = Deadline.after(10.0)
    half = deadline.share(0.5)
    for now[0], left, passed in ((100.0, 10.0, False), (105.0, 5.0, False), (110.0, 0.0, True)):
        assert (deadline.left, deadline.passed) == (left, passed) and deadline.ends
        assert half.passed == (now[0] >= 105.0)
        assert passed or deadline.seconds == left
    assert deadline.seconds is not None and 0 < deadline.seconds < 1e-6
    assert deadline.share(0.5).passed


def test_no_limit_never_ends(now: list[float]) -> None:
    now[0] = 1e9
    for deadline in (ENDLESS, Deadline.after(None), ENDLESS.share(0.5)):
        assert not deadline.ends and not deadline.passed
        assert deadline.left == math.inf and deadline.seconds is None
    assert not pickle.loads(pickle.dumps(ENDLESS)).ends


def test_a_limit_travels_on_the_time_of_day(
    now: list[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """To a machine that has been up for longer, in three seconds."""
    day = [5e8]
    monkeypatch.setattr(time, "time", lambda: day[0])
    sent = pickle.dumps(Deadline.after(10.0))
    now[0], day[0] = 7e4, day[0] + 3.0
    assert pickle.loads(sent).left == pytest.approx(7.0)


def test_a_clock_that_is_set_stops_no_batch(monkeypatch: pytest.MonkeyPatch) -> None:
    """The time of day goes on by a day between two problems."""
    problem, real, day = block_and_wall.problem(0.8, 10), time.time, [0.0]
    monkeypatch.setattr(time, "time", lambda: real() + day[0])

    def set_clock(_: object) -> None:
        day[0] = 86400.0

    batch = dmoc.solve_many([problem, problem], seconds=600.0, progress=set_clock)
    assert batch.status == ("solved", "solved")


class Slow(Executor):
    """Takes tasks and comes to no end by itself."""

    def __init__(self) -> None:
        self.tasks = dict[Future[Any], Any]()

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        future = Future[Any]()
        future.set_running_or_notify_cancel()
        self.tasks[future] = lambda: fn(*args, **kwargs)
        return future


def test_a_worker_may_take_all_its_time_before_it_counts_as_hanging(
    now: list[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The last of 200 seconds, of which none is left then to multiply."""
    slow = Slow()

    def waits(running: Any, **_: object) -> tuple[set[Future[Any]], None]:
        now[0] += 10.0
        if now[0] > 285.0:
            for future, task in slow.tasks.items():
                future.set_result(task())
        return {f for f in running if f.done()}, None

    def solved(share: many.Share) -> list[many.Row]:
        return [many.Row(number, "solved", "") for number, _ in share.problems]

    monkeypatch.setattr(workforce, "wait", waits)
    monkeypatch.setattr(many, "solve_share", solved)
    monkeypatch.setattr(time, "time", lambda: now[0])
    problem = block_and_wall.problem(0.8, 10)
    batch = dmoc.solve_many([problem], seconds=200.0, executor=slow)
    assert batch.status == ("solved",) and len(slow.tasks) == 1


def block(bound: float) -> dmoc.Problem:
    """One metre from rest to rest in 2 s, for which it takes 1 N."""
    return dmoc.Problem(
        unit_mass("in_time"), start={"x": 0}, goal={"x": 1, "x_dot": 0}, steps=10, final_time=2,
        bounds={"u": (-bound, bound)},
    )  # fmt: skip


@pytest.mark.parametrize(
    ("first", "begun"),
    [
        (3, 8),  # half of the time, of which each start takes a fifteenth
        (9, 9),
        (12, 12),
        (None, 14),  # until nothing but a refinement has time
    ],
)
def test_starts_go_on_until_one_leads_to_a_motion(
    now: list[float], monkeypatch: pytest.MonkeyPatch, first: int | None, begun: int
) -> None:
    count, real = 0, rounds.attempts_from

    def slow(programs: Any, points: Any, options: Options, *_: Any) -> list[Attempt]:
        nonlocal count
        attempts = list[Attempt]()
        for x in points:
            if options.deadline.passed:
                break
            now[0], count = now[0] + 2.0, count + 1
            (attempt,) = real(programs, [x], replace(options, deadline=ENDLESS))
            attempts.append(attempt if count == first else attempt.ending(Status.INFEASIBLE))
        return attempts

    monkeypatch.setattr(rounds, "attempts_from", slow)
    monkeypatch.setattr(rounds, "free_threads", lambda: 1)
    ended = exploration.explored(block(5.0), Effort(), Options(deadline=Deadline.after(30.0)))
    assert len(ended.starts) == count == begun
    assert bool(ended.solutions) == (first is not None) and ended.late == (first is None)


def test_the_time_that_is_left_after_an_answer_has_further_starts(
    now: list[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each start takes 2 of 30 s, nothing else takes any; a batch has its limit in common."""
    real = rounds.attempts_from

    def slow(programs: Any, points: Any, options: Options, *_: Any) -> list[Attempt]:
        some = points[: math.ceil(options.deadline.left / 2)]
        now[0] += 2.0 * len(some)
        return real(programs, some, replace(options, deadline=ENDLESS))

    monkeypatch.setattr(rounds, "attempts_from", slow)
    solution = answer_of(block(5.0), seconds=30.0, starts=20)
    assert solution.starts == solution.agreeing_starts == 15
    (in_batch,) = dmoc.solve_many([block(5.0)], seconds=30.0, keep=True, starts=20).solutions
    assert in_batch is not None and in_batch.starts == 8


def test_a_time_limit_is_told_where_it_is_used_up(
    now: list[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """With half a newton there is no motion; each start that says so takes 2 s."""
    real = rounds.attempts_from

    def slow(programs: Any, points: Any, options: Options, *_: Any) -> list[Attempt]:
        some = points[: max(0, math.ceil(options.deadline.left / 2))]
        now[0] += 2.0 * len(some)
        return real(programs, some, replace(options, deadline=ENDLESS)) if some else []

    monkeypatch.setattr(rounds, "attempts_from", slow)
    short, long = (dmoc.solve(block(0.5), "ipm", seconds=s, starts=20) for s in (30.0, 60.0))
    assert short.status == "time_limit" and "raise it" in short.message and short.starts == 14
    assert long.status == "infeasible" and long.starts == 20


@pytest.mark.parametrize("place", [0, 4, 9])
def test_every_word_of_a_hit_is_tried_in_time(
    now: list[float], monkeypatch: pytest.MonkeyPatch, place: int
) -> None:
    """Each of the ten takes all the time that it is given, and one leads to a motion."""
    problem = back(sequence=["floor"])
    (words,) = problem.open_hits.values()
    minimum: Any = SimpleNamespace(status=Status.SOLVED, cost=1.0)
    times = list[float]()

    def slow(way: dmoc.Problem, effort: Any, options: Options, points: Any) -> Any:
        times.append(options.deadline.left)
        now[0] += times[-1]
        helps = way.sequence == (words[place],)
        return SimpleNamespace(solutions=(minimum,) if helps else ())

    monkeypatch.setattr(open_hits, "explored", slow)
    answer = dmoc.solve(problem, "ipm", seconds=30.0)
    assert [c.word for c in answer.collisions] == [words[place]]
    assert len(words) == 10 and min(times) > 15 / 12 and now[0] <= 115.0 + 1e-6
