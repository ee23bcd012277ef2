"""Worker processes of this machine, which run no script of the caller unless a task needs it."""

from __future__ import annotations

import multiprocessing
import multiprocessing.connection
import os
import pickle
import signal
import threading
from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import popen_spawn_posix, resource_tracker, spawn
from multiprocessing.context import SpawnContext, SpawnProcess
from multiprocessing.process import BaseProcess
from types import FunctionType, SimpleNamespace
from typing import Any

from dmoc.base.deadline import Deadline
from dmoc.solvers.blas import WAITS
from dmoc.solving.workforce import Answer, NoMoreWork, Task, Waiting, Work

# Tasks beside those that run, so that no worker waits for its next one.
WAITING = 1


class Processes:
    """Worker processes of this machine."""

    def __init__(self, workers: int) -> None:
        self.workers = workers
        self.pool: ProcessPoolExecutor | None = None

    def answers(
        self, work: Work[Task, Answer], tasks: Iterable[Task], deadline: Deadline
    ) -> Iterator[Answer]:
        """Answers until a deadline."""
        waiting = Waiting(tasks)
        # Were running when a worker died: one of them may be to blame, so each runs alone.
        suspects: deque[Task] = deque()
        running: dict[Future[Answer], tuple[Task, Deadline]] = {}
        while (waiting or suspects or running) and not deadline.passed:
            broken = self._feed(work, waiting, suspects, running)
            done, _ = (
                wait(running, timeout=1.0, return_when=FIRST_COMPLETED)
                if running
                else (set(), None)
            )
            for future in done:
                task, _ = running.pop(future)
                try:
                    answer = future.result()
                except BrokenProcessPool:
                    broken = True
                    answer = work.lost(task, "the worker process died")
                except Exception as error:
                    answer = work.lost(task, f"{type(error).__name__}: {error}")
                again = work.again(task, answer)
                suspects.extend(again)
                if not again:
                    yield answer
            late = [f for f, (_, end) in running.items() if end.passed]
            if broken or late:
                for future, (task, _) in running.items():
                    again = (task,)
                    if future in late:
                        answer = work.late(task)
                        again = tuple(work.again(task, answer))
                        if not again:
                            yield answer
                    suspects.extend(again)
                running.clear()
                self.stop()

    def _feed(
        self,
        work: Work[Task, Answer],
        waiting: deque[Task],
        suspects: deque[Task],
        running: dict[Future[Answer], tuple[Task, Deadline]],
    ) -> bool:
        """Give the workers something to do, suspects alone; whether the pool turns out to be
        broken."""
        alone = bool(suspects)
        source = suspects if alone else waiting
        while source and len(running) < (1 if alone else self.workers + WAITING):
            try:
                # Also for ever in a worker process that is started here.
                with _interrupts_wait():
                    pool = self._workers(source[0])
                    running[pool.submit(work.do, source[0])] = source[0], work.deadline(source[0])
            except BrokenProcessPool:  # a worker died between two tasks
                return True
            except (OSError, AssertionError) as error:
                # and its pool is being closed, just when it was to start another one
                if getattr(self.pool, "_broken", False):
                    return True
                # no memory or semaphore is left, or this process is one that may start no other
                raise NoMoreWork(
                    f"no worker process can be started ({error}): take workers=1"
                ) from None
            source.popleft()
        return False

    def _workers(self, task: object) -> ProcessPoolExecutor:
        """The pool; all its processes are started with it, for tasks such as this one."""
        if self.pool is None:
            context = SpawnContext() if _names_script(task) else _WorkerContext()
            self.pool = ProcessPoolExecutor(self.workers, mp_context=context, initializer=_prepare)
            for _ in range(self.workers):
                self.pool.submit(_arrived, task)
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


def _arrived(task: object) -> None:
    """Do nothing in a worker: what a task needs is loaded when the task has come."""


def _names_script(task: object) -> bool:
    """Whether a task has a function or a class of the script, which a worker has to run for it."""
    try:
        return b"__main__" in pickle.dumps(task)
    except Exception:  # cannot travel: told as the task's answer
        return False


def _without_script(name: str) -> dict[str, Any]:
    """Data that a worker needs of the process that starts it, without the caller's script: that may
    have no ``if __name__ == "__main__":``, and what it imports takes its time."""
    data = spawn.get_preparation_data(name)
    return {k: v for k, v in data.items() if not k.startswith("init_main")}


class _Popen(popen_spawn_posix.Popen):
    """Starts a process that does not run the caller's script.

    Python reads the script off ``sys.modules["__main__"]``, which all threads share, so the
    function that starts a process is the library's, with its own view of that module alone.
    """

    _launch = FunctionType(
        vars(popen_spawn_posix.Popen)["_launch"].__code__,
        vars(popen_spawn_posix)
        | {"spawn": SimpleNamespace(**vars(spawn) | {"get_preparation_data": _without_script})},
    )


class _Process(SpawnProcess):
    @staticmethod
    def _Popen(process_obj: BaseProcess) -> Any:
        return _Popen(process_obj)


class _WorkerContext(SpawnContext):
    Process = _Process


def _prepare() -> None:
    """Prepare a worker: Ctrl-C is the caller's business, and a worker does not outlive it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, name=WAITS, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        multiprocessing.connection.wait([parent.sentinel])
        os._exit(1)
