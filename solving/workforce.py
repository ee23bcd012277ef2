"""Work that others do, an executor of the caller's or processes of this machine; a worker that dies
or hangs costs the tasks it may have had one attempt."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from itertools import islice
from typing import Any, Generic, TypeAlias, TypeVar

from dmoc.base.arguments import shown
from dmoc.base.deadline import Deadline

# A worker that is this many times over a task's limit hangs, and is stopped; seconds are added for
# what the limit does not count.
HANGS_AFTER, GRACE = 3.0, 30.0
# Tasks that an executor of unknown size gets at a time.
AHEAD = 16

Task = TypeVar("Task")
Answer = TypeVar("Answer")


class NoMoreWork(Exception):  # noqa: N818 - it ends the work and loses nothing
    """The caller's executor takes no more tasks, or no worker can be started."""


@dataclass(frozen=True)
class Work(Generic[Task, Answer]):
    """What is done with tasks."""

    do: Callable[[Task], Answer]  # in whatever process; of a module, to travel by its name
    lost: Callable[[Task, str], Answer]  # where a worker has failed, for a reason
    again: Callable[[Task, Answer], Sequence[Task]]  # what is tried once more; () if it stands
    seconds: Callable[[Task], float]  # the limit of a task

    def deadline(self, task: Task) -> Deadline:
        """The deadline after which the worker of a task that begins now counts as hanging."""
        return Deadline.after(HANGS_AFTER * self.seconds(task) + GRACE)

    def late(self, task: Task) -> Answer:
        return self.lost(task, "the worker did not answer in time")


# Work, tasks and a deadline to answers as they come.
Workforce: TypeAlias = Callable[[Work[Any, Any], Iterable[Any], Deadline], Iterator[Any]]


class Waiting(deque[Task]):
    """Tasks that wait for their turn: whether there are some is asked before each is taken, and the
    next one is made then."""

    def __init__(self, tasks: Iterable[Task]) -> None:
        super().__init__()
        self._coming = iter(tasks)

    def __bool__(self) -> bool:
        if not len(self):
            self.extend(islice(self._coming, 1))
        return len(self) > 0


@contextmanager
def workforce(workers: int, executor: Executor | None) -> Iterator[Workforce]:
    """Who does work: an executor, or else processes, which end with it."""
    if executor is not None:
        yield partial(in_executor, executor)
        return
    # multiprocessing is loaded for those alone who need it
    from dmoc.solving.processes import Processes

    processes = Processes(workers)
    try:
        yield processes.answers
    finally:
        processes.stop()


def in_executor(
    executor: Executor, work: Work[Task, Answer], tasks: Iterable[Task], deadline: Deadline
) -> Iterator[Answer]:
    """Answers from an executor of the caller, until a deadline or NoMoreWork; errors of workers
    and answers that do not come are taken as a failed attempt."""
    waiting, running = Waiting(tasks), dict[Future[Answer], Task]()
    ends: dict[Future[Answer], Deadline] = {}
    try:
        while (waiting or running) and not deadline.passed:
            while waiting and len(running) < AHEAD:
                try:
                    future = executor.submit(work.do, waiting[0])
                except Exception as error:  # shut down or broken, or a foreign class
                    why = str(error) or type(error).__name__
                    raise NoMoreWork(f"the executor takes no more work ({why})") from None
                if not isinstance(future, Future):
                    answered = shown(future)
                    raise NoMoreWork(f"the executor has returned {answered} for work, no future")
                running[future] = waiting.popleft()
            done, _ = wait(running, timeout=1.0, return_when=FIRST_COMPLETED)
            for future in list(running):
                task = running[future]
                if future in done:
                    try:
                        answer = future.result()
                    except Exception as error:
                        answer = work.lost(task, f"{type(error).__name__}: {error}")
                elif future.running() and ends.setdefault(future, work.deadline(task)).passed:
                    answer = work.late(task)
                else:
                    continue
                del running[future]
                again = work.again(task, answer)
                waiting.extendleft(reversed(again))
                if not again:
                    yield answer
    finally:
        for future in running:
            future.cancel()
