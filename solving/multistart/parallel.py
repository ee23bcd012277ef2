"""Many starts of one problem by the compiled method, in threads: it runs without the interpreter's
lock, and each thread has a program of its own."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import chain, takewhile, zip_longest

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.solvers.outcome import Options, Status
from dmoc.solving.attempts import Attempt, LocalSolver
from dmoc.solving.programs import Programs

MOST_THREADS = 8


def free_threads() -> int:
    """Threads that a solve may take: one in workers, which are as many as there are processors."""
    # loaded in every worker; others do without it
    processes = sys.modules.get("multiprocessing.process")
    alone = processes is None or processes.parent_process() is None
    if not (alone and threading.current_thread() is threading.main_thread()):
        return 1
    return min(len(os.sched_getaffinity(0)), MOST_THREADS)


def attempts_from(
    programs: Sequence[Programs], points: Sequence[Array], options: Options
) -> list[Attempt]:
    """Attempts from some points in units of the problem, in their order, as many as there is time
    for.  Each of ``programs``, equal ones, is solved in a thread of its own; an interrupted solve
    raises KeyboardInterrupt."""
    stopped, count = threading.Event(), min(len(programs), len(points))
    if count <= 1:
        return _solved(programs[0], points, options, stopped)

    def every(k: int) -> list[Attempt]:
        with np.errstate(all="ignore"):
            return _solved(programs[k], points[k::count], options, stopped)

    with ThreadPoolExecutor(count) as pool:
        try:
            rows = zip_longest(*pool.map(every, range(count)))
        finally:
            stopped.set()
    return list(takewhile(lambda a: a is not None, chain.from_iterable(rows)))


def _solved(
    programs: Programs,
    points: Sequence[Array],
    options: Options,
    stopped: threading.Event,
) -> list[Attempt]:
    """Attempts one after the other, until the deadline or an event."""
    nlp, solver, attempts = programs.program(), LocalSolver.compiled(programs), list[Attempt]()
    for x in points:
        if options.deadline.passed or stopped.is_set():
            break
        attempts.append(solver.minimised(nlp, nlp.scaled(x), options))
        if attempts[-1].status is Status.INTERRUPTED:
            raise KeyboardInterrupt
    return attempts
