"""Runs nodes here, in processes of this machine, or in any executor; a node that fails is tried
once more."""

from __future__ import annotations

import multiprocessing
import multiprocessing.connection
import os
import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import replace
from multiprocessing import resource_tracker
from typing import TypeAlias

from dmoc.sequences.inner import Task, lost, solve_node
from dmoc.sequences.nodes import Node, Verdict
from dmoc.solvers.outcome import Status

ATTEMPTS = 2
# A worker that is this many times over a node's limit hangs, and is stopped; seconds are added for
# guesses and checks.
HANGS_AFTER, GRACE = 3.0, 30.0
# Nodes that an executor of unknown size gets at a time.
AHEAD = 16

Workers: TypeAlias = Callable[[Sequence[Task], float], Iterator[Node]]


class NoMoreWork(Exception):  # noqa: N818 - it ends a search and loses nothing
    """The caller's executor takes no more nodes."""


def _needs_another(node: Node) -> bool:
    """Whether a worker was lost or the time ran out, and the node has not had its second
    attempt."""
    lost = not node.starts or any(s.status == Status.TIME_LIMIT for s in node.starts)
    return node.verdict is Verdict.FAILED and lost and node.attempts < ATTEMPTS


def here(tasks: Sequence[Task], deadline: float) -> Iterator[Node]:
    """One after the other in this process, until the deadline on the monotonic clock."""
    for task in tasks:
        left = deadline - time.monotonic()
        if left <= 0:
            return
        task = replace(task, seconds=min(task.seconds, left))
        node = solve_node(task)
        while _needs_another(node) and time.monotonic() < deadline:
            node = solve_node(replace(task, attempts=node.attempts + 1))
        yield node


def in_executor(executor: Executor, tasks: Sequence[Task], deadline: float) -> Iterator[Node]:
    """In an executor of the caller's; errors of its workers, and answers that do not come, are
    taken as a failed attempt."""
    waiting, running = deque(tasks), dict[Future[Node], Task]()
    since: dict[Future[Node], float] = {}
    try:
        while (waiting or running) and time.monotonic() < deadline:
            while waiting and len(running) < AHEAD:
                try:
                    future = executor.submit(solve_node, waiting[0])
                except RuntimeError as error:  # shut down or broken
                    raise NoMoreWork(str(error)) from None
                running[future] = waiting.popleft()
            done, _ = wait(running, timeout=1.0, return_when=FIRST_COMPLETED)
            for future in list(running):
                task = running[future]
                if future in done:
                    try:
                        node = future.result()
                    except Exception as error:
                        node = lost(task, f"{type(error).__name__}: {error}")
                elif future.running() and time.monotonic() - since.setdefault(
                    future, time.monotonic()
                ) > _most(task):
                    node = lost(task, f"the worker did not answer within {_most(task):.0f} s")
                else:
                    continue
                del running[future]
                if _needs_another(node):
                    waiting.appendleft(replace(task, attempts=node.attempts + 1))
                else:
                    yield node
    finally:
        for future in running:
            future.cancel()


def _most(task: Task) -> float:
    return HANGS_AFTER * task.seconds + GRACE


class Processes:
    """Worker processes of this machine; a worker that dies or hangs costs one attempt of the
    nodes it may have had."""

    def __init__(self, workers: int) -> None:
        self.workers = workers
        self.pool: ProcessPoolExecutor | None = None

    def __call__(self, tasks: Sequence[Task], deadline: float) -> Iterator[Node]:
        waiting = deque(tasks)
        # Were running when a worker died: one of them may be to blame, so each runs alone.
        suspects: deque[Task] = deque()
        running: dict[Future[Node], tuple[Task, float]] = {}
        while (waiting or suspects or running) and time.monotonic() < deadline:
            broken = self._feed(waiting, suspects, running)
            done, _ = (
                wait(running, timeout=1.0, return_when=FIRST_COMPLETED)
                if running
                else (set(), None)
            )
            for future in done:
                task, _ = running.pop(future)
                try:
                    node = future.result()
                except BrokenProcessPool:
                    broken = True
                    node = lost(task, "the worker process died")
                except Exception as error:
                    node = lost(task, f"{type(error).__name__}: {error}")
                if _needs_another(node):
                    suspects.append(replace(task, attempts=node.attempts + 1))
                else:
                    yield node
            late = [
                f for f, (task, since) in running.items() if time.monotonic() - since > _most(task)
            ]
            if broken or late:
                for future, (task, _) in running.items():
                    if future in late:
                        node = lost(task, f"the worker did not answer within {_most(task):.0f} s")
                        if not _needs_another(node):
                            yield node
                            continue
                        task = replace(task, attempts=task.attempts + 1)
                    suspects.append(task)
                running.clear()
                self.stop()

    def _feed(
        self,
        waiting: deque[Task],
        suspects: deque[Task],
        running: dict[Future[Node], tuple[Task, float]],
    ) -> bool:
        """Give the workers something to do, suspects alone; whether the pool turns out to be
        broken."""
        alone = bool(suspects)
        source = suspects if alone else waiting
        while source and len(running) < (1 if alone else self.workers):
            try:
                # Also for ever in the worker processes that are started here.
                with _interrupts_wait():
                    running[self._workers().submit(solve_node, source[0])] = (
                        source[0],
                        time.monotonic(),
                    )
            except BrokenProcessPool:  # a worker died between two nodes
                return True
            source.popleft()
        return False

    def _workers(self) -> ProcessPoolExecutor:
        if self.pool is None:
            context = multiprocessing.get_context("spawn")
            self.pool = ProcessPoolExecutor(self.workers, mp_context=context, initializer=_prepare)
        return self.pool

    def stop(self) -> None:
        """End the workers at once."""
        if self.pool is not None:
            processes = list((self.pool._processes or {}).values())
            self.pool.shutdown(wait=False, cancel_futures=True)
            for process in processes:
                process.kill()
            self.pool = None


@contextmanager
def _interrupts_wait() -> Iterator[None]:
    """Hold Ctrl-C back from this thread until the end, and from processes and threads that it
    starts meanwhile."""
    # it is started with the first worker, and until Python 3.12 that lets Ctrl-C through again
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _prepare() -> None:
    """In a worker: Ctrl-C is the search's business, and a worker does not outlive it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        multiprocessing.connection.wait([parent.sentinel])
        os._exit(1)
