"""Runs nodes here, in processes of this machine, or in any executor; a node that fails is tried once more."""

from __future__ import annotations

import multiprocessing
import signal
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from typing import TypeAlias

from dmoc.sequences.inner import Task, solve_node
from dmoc.sequences.nodes import Node, Verdict

ATTEMPTS = 2
# A worker that is this many times over a node's limit hangs, and is stopped; seconds are added for guesses and checks.
PATIENCE, GRACE = 3.0, 30.0
# Nodes that an executor of unknown size gets at a time.
AHEAD = 16

Run: TypeAlias = Callable[[Sequence[Task]], Iterator[Node]]


def _needs_another(node: Node) -> bool:
    """Whether a worker was lost or the time ran out, and the node has not had its second attempt."""
    lost = not node.starts or any(s.status == "time_limit" for s in node.starts)
    return node.verdict is Verdict.FAILED and lost and node.attempts < ATTEMPTS


def here(tasks: Sequence[Task]) -> Iterator[Node]:
    """One after the other in this process."""
    for task in tasks:
        node = solve_node(task)
        while _needs_another(node):
            node = solve_node(replace(task, attempts=node.attempts + 1))
        yield node


def in_executor(executor: Executor, tasks: Sequence[Task]) -> Iterator[Node]:
    """In an executor of the caller's; errors of its workers are taken as a failed attempt."""
    waiting, running = deque(tasks), dict[Future[Node], Task]()
    try:
        while waiting or running:
            while waiting and len(running) < AHEAD:
                task = waiting.popleft()
                running[executor.submit(solve_node, task)] = task
            done, _ = wait(running, return_when=FIRST_COMPLETED)
            for future in done:
                task = running.pop(future)
                try:
                    node = future.result()
                except Exception as error:
                    node = _lost(task, f"{type(error).__name__}: {error}")
                if _needs_another(node):
                    waiting.appendleft(replace(task, attempts=node.attempts + 1))
                else:
                    yield node
    finally:
        for future in running:
            future.cancel()


class Processes:
    """Worker processes of this machine; a worker that dies or hangs costs one attempt of the nodes it may have had."""

    def __init__(self, workers: int) -> None:
        self.workers = workers
        self.pool: ProcessPoolExecutor | None = None

    def __call__(self, tasks: Sequence[Task]) -> Iterator[Node]:
        waiting = deque(tasks)
        suspects: deque[Task] = deque()  # were running when a worker died: one of them may be to blame, so each runs alone
        running: dict[Future[Node], tuple[Task, float]] = {}
        while waiting or suspects or running:
            alone = bool(suspects)
            while (suspects if alone else waiting) and len(running) < (1 if alone else self.workers):
                task = (suspects if alone else waiting).popleft()
                running[self._submit(task)] = (task, time.monotonic())
            done, _ = wait(running, timeout=1.0, return_when=FIRST_COMPLETED)
            broken = False
            for future in done:
                task, _ = running.pop(future)
                try:
                    node = future.result()
                except BrokenProcessPool:
                    broken = True
                    node = _lost(task, "the worker process died")
                except Exception as error:
                    node = _lost(task, f"{type(error).__name__}: {error}")
                if _needs_another(node):
                    suspects.append(replace(task, attempts=node.attempts + 1))
                else:
                    yield node
            late = [f for f, (task, since) in running.items() if time.monotonic() - since > PATIENCE * task.seconds + GRACE]
            if broken or late:
                for future, (task, _) in running.items():
                    if future in late:
                        node = _lost(task, f"the worker did not answer within {PATIENCE * task.seconds + GRACE:.0f} s")
                        if not _needs_another(node):
                            yield node
                            continue
                        task = replace(task, attempts=task.attempts + 1)
                    suspects.append(task)
                running.clear()
                self.stop()

    def _submit(self, task: Task) -> Future[Node]:
        if self.pool is None:
            context = multiprocessing.get_context("spawn")
            self.pool = ProcessPoolExecutor(self.workers, mp_context=context, initializer=_prepare)
        return self.pool.submit(solve_node, task)

    def stop(self) -> None:
        """End the workers at once."""
        if self.pool is not None:
            processes = list((self.pool._processes or {}).values())
            self.pool.shutdown(wait=False, cancel_futures=True)
            for process in processes:
                process.terminate()
            self.pool = None


def _prepare() -> None:
    """In a worker: Ctrl-C is the search's business."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _lost(task: Task, why: str) -> Node:
    return Node(task.sequence, Verdict.FAILED, evidence=(why,), attempts=task.attempts)
