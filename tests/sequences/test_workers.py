"""Workers of a search: any number gives the same answer; what happens where they die or fail."""

from __future__ import annotations

import multiprocessing
import multiprocessing.connection
import os
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import printed
from searches import outline, suicidal

import dmoc
from dmoc.models.registry import find
from dmoc.sequences import node_solve, relaxation
from dmoc.sequences.nodes import Verdict
from dmoc.sequences.search import Progress, SearchResult
from dmoc.solvers.diagnosis import Diagnosis
from dmoc.solvers.outcome import Status
from dmoc.solving.multistart import parallel
from dmoc.solving.multistart.exploration import Exploration, Start
from dmoc.solving.multistart.parallel import free_threads
from dmoc.solving.request import Request

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]
# What one start has led to: nothing.
NOTHING = Exploration((), (), (Start("automatic 1", Status.INFEASIBLE, None),))


def no_violation(
    _: dmoc.Problem, __: object, x: np.ndarray, *___: object, **____: object
) -> Diagnosis:
    """Instead of the search for the least violation: there is none."""
    return Diagnosis(x, 0.0, True, (), (), ())


def test_the_answer_does_not_depend_on_the_workers(table: dmoc.Problem, pair: SearchResult) -> None:
    assert outline(dmoc.search(table, 2, workers=2)) == outline(pair)
    with ThreadPoolExecutor(1) as pool:
        assert outline(dmoc.search(table, 2, executor=pool)) == outline(pair)


@pytest.fixture(scope="module")
def three(seed: dmoc.Problem) -> SearchResult:
    """All sequences of the source's problem of at most three collisions."""
    return dmoc.search(seed, 3)


def test_verdicts_and_costs_of_the_seed_do_not_depend_on_the_workers(
    seed: dmoc.Problem, three: SearchResult
) -> None:
    assert len(three.nodes) == 15 and three.complete
    assert {n.verdict for n in three.nodes} == {Verdict.OPTIMAL, Verdict.FEASIBLE}
    assert all(n.cost is not None and n.attempts == 1 for n in three.nodes)
    assert outline(dmoc.search(seed, 3, workers=2)) == outline(three)


@pytest.mark.parametrize("way", ["spawn", "forkserver"])
def test_starts_of_a_node_take_threads_where_no_other_worker_has_them(
    way: str, threads: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(parallel, "MOST_THREADS", threads)
    assert free_threads() == min(len(os.sched_getaffinity(0)), threads)
    with ThreadPoolExecutor(1) as other:
        assert other.submit(free_threads).result() == 1
    processes = multiprocessing.get_context(way)
    with ProcessPoolExecutor(1, mp_context=processes) as pool:
        assert pool.submit(free_threads).result() == 1


@pytest.mark.parametrize("strategy", ["tree", "propose"])
def test_what_is_found_does_not_depend_on_the_threads(
    weak: dmoc.Problem, strategy: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    strong, results = weak.but(steps=8, bounds={"u": (-20, 20)}), []
    for count in (1, 3):
        for module in (parallel, relaxation):
            monkeypatch.setattr(module, "free_threads", lambda count=count: count)
        results.append(outline(dmoc.search(strong, 1, strategy=strategy)))
    assert results[0] == results[1] != []


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

    monkeypatch.setattr(node_solve, "explored", fail)
    result = dmoc.search(table, 1)
    assert {n.verdict for n in result.nodes} == {Verdict.FAILED} and len(result.nodes) == 5
    assert {n.evidence for n in result.nodes} == {("ZeroDivisionError: by chance",)}


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


@pytest.mark.parametrize(("backend", "method"), [("compiled", "ipm"), ("numpy", "slsqp")])
def test_a_node_over_its_time_is_tried_once_more(
    table: dmoc.Problem, backend: str, method: str
) -> None:
    kernels = dmoc.build(find("puck_table").system(), backend=backend)
    problem = table.but(kernels=kernels)
    (node,) = dmoc.search(problem, 0, node_seconds=1e-6, method=method).nodes
    assert node.verdict is Verdict.FAILED and node.attempts == 2
    assert node.evidence == ("the limit of 1e-06 s was reached",)
    assert node.starts[-1] == Start("rest", Status.TIME_LIMIT, None)


def test_the_limit_of_a_node_holds_for_the_search_for_the_reason_too(
    table: dmoc.Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where no start leads to a minimum, what is tried next has what is left of the time: here a
    motion that obeys all conditions, from which every solve takes longer."""
    problem, seconds = table.but(sequence=["east"], steps=10), 1.0
    limits: list[float] = []

    def slow(problem: dmoc.Problem, guess: Any, request: Request) -> dmoc.Solution:
        left = request.options.deadline.seconds
        assert left is not None
        limits.append(left)
        time.sleep(left)
        return replace(unsolved, status=Status.TIME_LIMIT)

    unsolved = dmoc.solve(problem, "ipm", starts=1, verify=False)
    monkeypatch.setattr(node_solve, "explored", lambda *_, **__: NOTHING)
    monkeypatch.setattr(node_solve, "diagnose", no_violation)
    monkeypatch.setattr(node_solve, "solved_on_mesh", slow)
    node = node_solve.solve_node(node_solve.NodeTask(problem, None, "ipm", 0, 0, seconds))
    assert len(limits) == 2 and 0 < limits[0] < seconds and 0 < limits[1] <= seconds / 100
    assert node.verdict is Verdict.FAILED
    assert node.evidence == (f"the limit of {seconds:g} s was reached",)
    assert node.starts == (*NOTHING.starts, Start("rest", Status.TIME_LIMIT, None))


def test_a_cluster_of_two_processes() -> None:
    text = printed(sys.executable, ROOT / "examples" / "search_dask.py")
    assert "2 workers, 21 sequences" in text and "best: east, west" in text


@pytest.mark.parametrize("at", [1, 2])
def test_ctrl_c_in_the_solve_after_a_diagnosis_ends_the_search(
    table: dmoc.Problem, monkeypatch: pytest.MonkeyPatch, at: int
) -> None:
    """Every solve of a node passes an interrupt on, also those from the motion of least
    violation, on the coarse mesh and on that of the problem."""
    problem = table.but(sequence=["east"], steps=10)
    failed = replace(dmoc.solve(problem, "ipm", starts=1, verify=False), status=Status.INFEASIBLE)
    solves: list[int] = []

    def interrupted(*_: Any, **__: Any) -> dmoc.Solution:
        solves.append(1)
        return replace(failed, status=Status.INTERRUPTED) if len(solves) == at else failed

    monkeypatch.setattr(node_solve, "explored", lambda *_, **__: NOTHING)
    monkeypatch.setattr(node_solve, "diagnose", no_violation)
    monkeypatch.setattr(node_solve, "solved_on_mesh", interrupted)
    with pytest.raises(KeyboardInterrupt):
        node_solve.solve_node(node_solve.NodeTask(problem, None, "ipm", 0, 0, 10.0))
    assert len(solves) == at


@pytest.mark.parametrize("backend", ["compiled", "numpy"])
def test_ctrl_c_in_the_solve_by_another_method_ends_the_search(
    table: dmoc.Problem, monkeypatch: pytest.MonkeyPatch, backend: str
) -> None:
    """That method begins with the minimum of the exploration, or alone without a compiler."""
    system = find("puck_table").system()
    problem = table.but(kernels=dmoc.build(system, backend=backend), sequence=["east"], steps=10)
    solved = dmoc.solve(problem, "slsqp", starts=1, verify=False)
    interrupted = replace(solved, status=Status.INTERRUPTED)
    monkeypatch.setattr(node_solve, "solved_on_mesh", lambda *_, **__: interrupted)
    with pytest.raises(KeyboardInterrupt):
        node_solve.solve_node(node_solve.NodeTask(problem, None, "slsqp", 0, 0, None))
