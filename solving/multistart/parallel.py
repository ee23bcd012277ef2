"""Many starts of one problem by the compiled method, in threads that have a program each and take
one start after the other, without the interpreter."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import zip_longest

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.solvers.ipm import solve_starts
from dmoc.solvers.judge import judged
from dmoc.solvers.outcome import Ending, Options, Status
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
    programs: Programs, points: Sequence[Array], options: Options, hurried: Sequence[bool] = ()
) -> list[Attempt]:
    """Attempts from some points in units of the problem, in their order, as many as there is time
    for, in as many threads as are free; an interrupted solve raises KeyboardInterrupt.  Those that
    are hurried are given up where they come no nearer to a motion."""
    nlp, count = programs.program(), max(1, min(free_threads(), len(points)))
    each, stopped = [programs, *(programs.beside() for _ in range(1, count))], threading.Event()
    with ThreadPoolExecutor(count) as pool:
        try:
            own = [programs.program() for programs in each]
            endings = solve_starts(pool, own, [*map(nlp.scaled, points)], options, hurried)

            def settled(k: int) -> list[Attempt]:
                with np.errstate(all="ignore"):
                    return _settled(each[k], endings[k::count], options, stopped)

            rows = zip_longest(*pool.map(settled, range(count)))
        finally:
            stopped.set()
    return [attempt for row in rows for attempt in row if attempt is not None]


def _settled(
    programs: Programs,
    endings: Sequence[Ending],
    options: Options,
    stopped: threading.Event,
) -> list[Attempt]:
    """Attempts that continue endings, one after the other, until an event; where the time is over,
    each ends at once."""
    nlp, solver, attempts = programs.program(), LocalSolver.compiled(programs), list[Attempt]()
    for ending in endings:
        if stopped.is_set():
            break
        attempt = solver.settled(nlp, judged(nlp, ending, options), options)
        attempts.append(solver.past_inflection(attempt, options))
        if attempts[-1].status is Status.INTERRUPTED:
            raise KeyboardInterrupt
    return attempts
