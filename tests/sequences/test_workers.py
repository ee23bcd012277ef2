"""Workers of a search: any number gives the same answer; what happens where they die or fail."""

from __future__ import annotations

import multiprocessing
import multiprocessing.connection
import signal
import subprocess
import sys
import threading
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from searches import outline, suicidal

import dmoc
from dmoc.sequences import inner
from dmoc.sequences.engine import Progress, SearchResult
from dmoc.sequences.nodes import Verdict
from dmoc.solvers.diagnosis import Diagnosis

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]


def test_the_answer_does_not_depend_on_the_workers(table: dmoc.Problem, pair: SearchResult) -> None:
    assert outline(dmoc.search(table, 2, workers=2)) == outline(pair)
    with ThreadPoolExecutor(1) as pool:
        assert outline(dmoc.search(table, 2, executor=pool)) == outline(pair)


def test_a_worker_that_dies_costs_an_attempt(table: dmoc.Problem, pair: SearchResult) -> None:
    killed = threading.Event()

    def kill(p: Progress) -> None:
        if sum(p.counts.values()) == 3 and not killed.is_set():
            killed.set()
            multiprocessing.active_children()[0].kill()

    result = dmoc.search(table, 2, workers=2, progress=kill)
    assert killed.is_set() and result.complete
    assert outline(result) == outline(pair)
    assert 1 <= sum(n.attempts == 2 for n in result.nodes) <= 2


def test_workers_that_die_between_two_nodes_lose_nothing(table: dmoc.Problem) -> None:
    def kill(p: Progress) -> None:
        if sum(p.counts.values()) == 1:
            for child in (children := multiprocessing.active_children()):
                child.kill()
            for child in children:
                multiprocessing.connection.wait([child.sentinel])

    assert len(dmoc.search(table, 1, workers=2, progress=kill).nodes) == 5


def test_workers_do_not_outlive_the_search(tmp_path: Path) -> None:
    """Whoever still runs holds the other end of the pipe."""
    running = subprocess.Popen(
        suicidal(tmp_path / "journal.sqlite", nodes=3, workers=2),
        stdout=subprocess.PIPE,
        start_new_session=True,
    )
    assert running.communicate(timeout=120) == (b"", None)
    assert running.returncode == -signal.SIGKILL


def test_a_broken_executor_ends_the_search_with_what_there_is(table: dmoc.Problem) -> None:
    pool = ThreadPoolExecutor(1)

    def close(p: Progress) -> None:
        pool.shutdown(wait=False)

    result = dmoc.search(table, 2, executor=pool, progress=close)
    assert (
        len(result.nodes) == 1 and not result.complete and "takes no more work" in result.notes[0]
    )


def test_an_error_in_a_node_is_its_answer(
    table: dmoc.Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: Any, **__: Any) -> Any:
        raise ZeroDivisionError("by chance")

    monkeypatch.setattr(inner, "initial_guesses", fail)
    result = dmoc.search(table, 1)
    assert {n.verdict for n in result.nodes} == {Verdict.FAILED} and len(result.nodes) == 5
    assert "ZeroDivisionError: by chance" in result.nodes[0].evidence[0]


class Flaky(Executor):
    """Fails the first ``times`` submissions of one sequence."""

    def __init__(self, sequence: tuple[str, ...], times: int) -> None:
        self.sequence, self.times = sequence, times

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        if args[0].sequence == self.sequence and self.times > 0:
            self.times -= 1
            future.set_exception(ConnectionError("lost"))
        else:
            future.set_result(fn(*args, **kwargs))
        return future


def test_a_lost_node_is_tried_once_more_and_then_recorded(table: dmoc.Problem) -> None:
    once = dmoc.search(table, 1, executor=Flaky(("east",), 1))
    assert next(n for n in once.nodes if n.sequence == ("east",)).attempts == 2
    twice = dmoc.search(table, 1, executor=Flaky(("east",), 2))
    lost = next(n for n in twice.nodes if n.sequence == ("east",))
    assert (
        lost.verdict is Verdict.FAILED
        and lost.attempts == 2
        and "ConnectionError: lost" in lost.evidence[0]
    )
    assert len(twice.nodes) == 5


def test_a_node_over_its_time_is_tried_once_more(table: dmoc.Problem) -> None:
    result = dmoc.search(table, 0, node_seconds=1e-6)
    assert result.nodes[0].verdict is Verdict.FAILED and result.nodes[0].attempts == 2
    assert "time_limit" in result.nodes[0].evidence[0]


def test_a_cluster_of_two_processes() -> None:
    done = subprocess.run(
        [sys.executable, str(ROOT / "examples" / "search_dask.py")],
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    assert "2 workers, 21 sequences" in done.stdout and "best: east, west" in done.stdout


def test_ctrl_c_in_the_solve_after_a_diagnosis_ends_the_search(
    table: dmoc.Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every solve of a node passes an interrupt on, also that from the motion of least
    violation."""
    problem = table.but(sequence=["east"], steps=10)
    failed = replace(dmoc.solve(problem, "ipm", verify=False), status="infeasible")
    diagnosed: list[bool] = []

    def no_violation(_: dmoc.Problem, __: object, x: np.ndarray, ___: object) -> Diagnosis:
        diagnosed.append(True)
        return Diagnosis(x, 0.0, True, (), (), ())

    monkeypatch.setattr(inner, "diagnose", no_violation)
    monkeypatch.setattr(
        inner,
        "solve",
        lambda *_, **__: replace(failed, status="interrupted") if diagnosed else failed,
    )
    with pytest.raises(KeyboardInterrupt):
        inner.solve_node(inner.Task(problem, None, "ipm", 0, 0, 10.0))
