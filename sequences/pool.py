"""Runs nodes here, in processes of this machine, or in any executor; a node that fails is tried
once more."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from typing import TypeAlias

from dmoc.base.deadline import Deadline
from dmoc.sequences.node_solve import NodeTask, lost, solve_node
from dmoc.sequences.nodes import Node, Verdict
from dmoc.solvers.outcome import Status
from dmoc.solving.workforce import Work, workforce

ATTEMPTS = 2

Workers: TypeAlias = Callable[[Sequence[NodeTask], Deadline], Iterator[Node]]


def _again(task: NodeTask, node: Node) -> tuple[NodeTask, ...]:
    """The task once more, if a worker was lost or the time ran out, and the node has not had its
    second attempt."""
    without = not node.starts or any(s.status == Status.TIME_LIMIT for s in node.starts)
    if node.verdict is Verdict.FAILED and without and node.attempts < ATTEMPTS:
        return (replace(task, attempts=node.attempts + 1),)
    return ()


# Seconds after which a node without a limit hangs, as one with this limit does.
LONGEST = 600.0
WORK = Work(solve_node, lost, _again, lambda task: task.seconds or LONGEST)


def here(tasks: Sequence[NodeTask], deadline: Deadline) -> Iterator[Node]:
    """Solve tasks one after the other in this process, until the deadline."""
    for task in tasks:
        if deadline.passed:
            return
        if deadline.ends:
            task = replace(task, seconds=min(task.seconds or math.inf, deadline.left))
        node = solve_node(task)
        while not deadline.passed and (again := _again(task, node)):
            node = solve_node(again[0])
        yield node


@contextmanager
def workers_of(workers: int, executor: Executor | None) -> Iterator[Workers]:
    """Who solves the nodes: this process alone, or others."""
    if executor is None and workers == 1:
        yield here
        return
    with workforce(workers, executor) as others:
        yield partial(others, WORK)
