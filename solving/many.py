"""Solve many problems: in this process, in processes of this machine, or in any executor."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import ExitStack, suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from dmoc.base.arguments import listed, shown
from dmoc.base.deadline import Deadline
from dmoc.base.errors import DmocError, ProblemError
from dmoc.base.options import options_of, read
from dmoc.base.progress import Listener, listener
from dmoc.base.signatures import public
from dmoc.codegen.kernels import Array
from dmoc.problem.problem import Problem
from dmoc.results.batch import APART, FAILED, NOT_TRIED, REFUSED, Batch
from dmoc.results.solution import Solution
from dmoc.solvers.outcome import Status
from dmoc.solving.beginning import Beginning
from dmoc.solving.keywords import BatchKeywords, Keywords
from dmoc.solving.methods import SEARCHING, usual
from dmoc.solving.row import Row, row_of
from dmoc.solving.rows import FEWEST, solved_rows
from dmoc.solving.solve import solved
from dmoc.solving.starts import InitialGuess, loaded
from dmoc.solving.workforce import NoMoreWork, Work, in_executor, workforce

# Problems travel to a worker together, at most so many, if they take it no longer than this by what
# those before them took: slow ones one by one, so that none waits long for the last.
TOGETHER, SHARE_SECONDS = 256, 0.5
MOST_PROBLEMS = 1_000_000
# Arguments of a solve that are the same for all problems.
OPTIONS = sorted(options_of(Keywords).keys() - {"method", "seconds", "reference"})
# Every problem is explored only where its caller asks for it: that takes many times as long as a
# solve.
STARTS = {"starts": 1}
# Seconds that answers may take to arrive after the limit, which the workers keep themselves.
UNDER_WAY = 5.0
INTERRUPTED, NO_TIME = "Ctrl-C came before its turn", "the time was used up before its turn"


@dataclass(frozen=True)
class BatchProgress:
    """How far a batch is: problems done and in all, counts of statuses, seconds."""

    done: int
    total: int
    counts: dict[str, int]
    seconds: float

    def __str__(self) -> str:
        counts = "  ".join(f"{n} {status}" for status, n in self.counts.items())
        return f"{self.done} of {self.total}: {counts}  {self.seconds:.0f} s"


@dataclass
class Pace:
    """How long the problems of a batch have taken so far."""

    problems: int = 0
    seconds: float = 0.0

    @classmethod
    def of(cls, like: InitialGuess) -> Pace:
        """That of problems that take as long as the solution at which they start."""
        known = like.seconds if isinstance(like, Solution) else {}
        seconds = known.get("solve", 0.0) + known.get("verify", 0.0)
        return cls(1, seconds) if seconds > 0 else cls()

    def count(self, rows: Sequence[Row]) -> None:
        self.problems += len(rows)
        self.seconds += sum(row.seconds for row in rows)

    @property
    def together(self) -> int:
        """Problems that take about as long as those that travel together may; one where nothing is
        known."""
        if not self.seconds > 0:
            return 1
        return max(1, min(TOGETHER, int(SHARE_SECONDS * self.problems / self.seconds)))


@dataclass(frozen=True)
class Share:
    """Problems that travel together, by number, or the errors that stand in their place; the
    keywords and the guess of each solve, whether its solution is kept, and until when all may
    take."""

    problems: tuple[tuple[int, Problem | DmocError], ...]
    keywords: Keywords
    guess: InitialGuess
    keep: bool
    deadline: Deadline
    attempts: int = 1


@public(ProblemError, OPTIONS)
def solve_many(
    problems: Iterable[Problem],
    method: str | None = None,
    *,
    workers: int = 1,
    executor: Executor | None = None,
    guess: InitialGuess = None,
    keep: bool = False,
    seconds: float | None = None,
    progress: Listener[BatchProgress] = None,
    **options: Any,
) -> Batch:
    """Solve many problems, each as :func:`dmoc.solve` does, and check each solution by simulation;
    how many steps confirm one that this contradicts is told by :func:`dmoc.solve` alone.

    Parameters
    ----------
    problems : iterable of Problem
    method : str, optional
        As in :func:`dmoc.solve`; by default "ipm", or "slsqp" if some kernels are not compiled.
    workers : int
        Threads for neighbours of the solution ``guess`` that compiled code solves together.  For
        all others processes of this machine: most of a small problem is Python, which runs in one
        thread at a time.  They run a script only where ``guess`` is a function of it, which then
        needs ``if __name__ == "__main__":``.
    executor : concurrent.futures.Executor, optional
        Where problems are solved instead: ``Client(...).get_executor()`` of dask.distributed, or a
        ``ThreadPoolExecutor`` for large problems, whose compiled solves run side by side.
    guess : optional
        Where all start, as :func:`dmoc.solve` takes it; by default each from its automatic guess.
        The solution of a nominal problem spares the guess and most iterations, and leads to minima
        of the same kind.
    keep : bool
        Keep every solution, not only its row.
    seconds : float, optional
        Limit of all together; what is not done then is "not_tried".
    progress : callable, bool or "lines", optional
        Called with a :class:`BatchProgress` whenever problems are done.  True shows it in a line on
        a terminal or in a notebook, "lines" writes it to standard error every second.
    **options
        Further arguments of :func:`dmoc.solve`: tolerance, verify, iterations and others.
        ``starts`` is 1 unless stated: a solve from the automatic guess, without exploration.

    Returns
    -------
    Batch
        Rows in the order of the problems.  An error of one problem is its message; Ctrl-C keeps the
        rows so far.

    Raises
    ------
    ProblemError
        If an argument does not fit.

    Examples
    --------
    >>> import dmoc
    >>> from dmoc.models.registry import find
    >>> reference = find("puck_table")
    >>> problem = dmoc.Problem(reference.kernels(), **reference.defaults)
    >>> problem = problem.but(sequence=["east"])
    >>> batch = dmoc.solve_many([problem.but(final_time=t) for t in (1.5, 2.0, 2.5)])
    >>> batch.status
    ('solved', 'solved', 'solved')
    >>> batch.cost.round(2)
    array([4.97, 2.82, 1.94])
    """
    entries = listed(problems, "problems", "Problems", most=MOST_PROBLEMS)
    for i, problem in enumerate(entries):
        if not isinstance(problem, Problem):
            raise ProblemError(
                f"problems has {shown(problem)} at place {i}: expected Problems, as "
                "dmoc.Problem(system, start=..., ...) states them."
            )
    return batch_of(entries, {}, locals(), all(p.kernels.compiled for p in entries))


def batch_of(
    problems: Sequence[Problem | DmocError],
    varied: Mapping[str, Array],
    keywords: Mapping[str, Any],
    compiled: bool,
) -> Batch:
    """Solve problems with the keywords of a batch, whose kernels are all compiled or not; an error
    in the place of a problem is its row.  A problem is asked for when its turn comes.  ``varied``
    is what differs, by columns."""
    batch = read(BatchKeywords, keywords, ProblemError)
    method = batch.method
    if method is None:
        method = usual(SEARCHING, compiled)
    of_solves = _of_solves(method, batch), loaded(batch.guess)
    begin, rows, reason = time.perf_counter(), dict[int, Row](), NO_TIME
    deadline = Deadline.after(batch.seconds)
    with ExitStack() as stack:
        tell = stack.enter_context(listener(batch.progress, "first solve"))
        try:
            for answered in _answers(problems, of_solves, batch, deadline, stack):
                rows |= {row.number: row for row in answered}
                if any(row.status == Status.INTERRUPTED for row in answered):
                    raise KeyboardInterrupt
                if tell is not None:
                    counts = dict(Counter(row.status for row in rows.values()))
                    spent = time.perf_counter() - begin
                    tell(BatchProgress(len(rows), len(problems), counts, spent))
        except KeyboardInterrupt:
            reason = INTERRUPTED
        except NoMoreWork as error:
            reason = str(error)
    whole_rows = [rows.get(i, Row(i, NOT_TRIED, reason)) for i in range(len(problems))]
    with_kernels = [_with_kernels(row, problems) for row in whole_rows]
    table = _table(with_kernels, varied, method, time.perf_counter() - begin)
    if not batch.keep:
        return table
    return replace(table, solutions=tuple(row.solution for row in with_kernels))


def _of_solves(method: str, batch: BatchKeywords) -> Keywords:
    """The keywords of each solve; values that do not fit are refused before any begins."""
    return read(Keywords, {"method": method, **STARTS, **batch.options}, ProblemError)


def _answers(
    problems: Sequence[Problem | DmocError],
    of_solves: tuple[Keywords, InitialGuess],
    batch: BatchKeywords,
    deadline: Deadline,
    stack: ExitStack,
) -> Iterator[list[Row]]:
    """Rows as they come."""
    workers, executor, guess = batch.workers, batch.executor, of_solves[1]
    like = guess if isinstance(guess, Solution) and not batch.keep else None
    here, pace = executor is None and workers == 1, Pace.of(guess)

    def shares(numbers: Sequence[int], least: int = 1) -> Iterator[Share]:
        begin = 0
        while begin < len(numbers) and not deadline.passed:
            if pace.together < least:
                return
            left = len(numbers) - begin  # each worker gets some of them
            size = min(pace.together, left if here else left // (2 * workers) + 1)
            size = max(size, least)
            part = tuple((i, problems[i]) for i in numbers[begin : begin + size])
            yield Share(part, *of_solves, batch.keep, deadline)
            begin += size

    numbers, late = list(range(len(problems))), Deadline(deadline.at + UNDER_WAY)
    if like is not None and executor is None and not here:
        done = set[int]()
        for rows in _in_threads(shares(numbers, FEWEST), workers, late):
            pace.count(rows)
            done.update(row.number for row in rows)
            yield rows
        numbers = [i for i in numbers if i not in done]
        here = len(numbers) <= workers or deadline.passed  # processes would take longer to start
    if here:
        answers: Iterator[list[Row]] = map(solve_share, shares(numbers))
    else:
        work = Work(solve_share, _lost, _again, lambda share: share.deadline.left)
        others = stack.enter_context(workforce(workers, executor))
        answers = others(work, shares(numbers), late)
    for rows in answers:
        pace.count(rows)
        yield rows


def _in_threads(shares: Iterator[Share], workers: int, deadline: Deadline) -> Iterator[list[Row]]:
    """Rows of neighbours, which take compiled code nearly alone, until a share has none."""
    hopeless = False

    def promising() -> Iterator[Share]:
        while not hopeless and (share := next(shares, None)) is not None:
            yield share

    work = Work[Share, list[Row]](
        lambda share: [row for row in _together(share) if isinstance(row, Row)],
        lambda share, why: [],
        lambda share, rows: (),
        lambda share: share.deadline.left,
    )
    with ThreadPoolExecutor(workers) as threads:
        for rows in in_executor(threads, work, promising(), deadline):
            hopeless = not rows
            if rows:
                yield rows


def solve_share(share: Share) -> list[Row]:
    """Solve the problems of a share one after the other, in any process; neighbours of one form
    together."""
    rows, together, begun = list[Row](), dict[int, Row](), dict[int, Beginning]()
    try:
        for each in _together(share):
            if isinstance(each, Row):
                together[each.number] = each
            else:
                begun[each.number] = each
    except KeyboardInterrupt:
        left = [number for number, _ in share.problems if number not in together]
        return [*together.values(), _interrupted(left[0] if left else share.problems[-1][0])]
    for number, problem in share.problems:
        if number not in together and share.deadline.passed:
            continue
        row = together.get(number) or _row(number, problem, share, begun.pop(number, None))
        rows.append(row)
        if row.status == Status.INTERRUPTED:
            break
    return rows


def _together(share: Share) -> Iterator[Row | Beginning]:
    """The rows of neighbours, and where the solves of some others go on."""
    stated = [(i, p) for i, p in share.problems if isinstance(p, Problem)]
    with suppress(Exception):  # a solve of its own tells that of a single problem
        yield from solved_rows(stated, share.keywords, share.guess, share.deadline, share.keep)


def _interrupted(number: int) -> Row:
    return Row(number, Status.INTERRUPTED, Status.INTERRUPTED.sentence)


def _row(number: int, problem: Problem | DmocError, share: Share, begun: Beginning | None) -> Row:
    begin = time.perf_counter() - (begun.seconds if begun else 0.0)
    try:
        if isinstance(problem, DmocError):
            raise problem
        keywords = replace(share.keywords, seconds=share.deadline.seconds)
        s = solved(problem, keywords, share.guess, begun=begun)
    except KeyboardInterrupt:
        return _interrupted(number)
    except DmocError as error:
        return Row(number, REFUSED, str(error), seconds=time.perf_counter() - begin)
    except Exception as error:
        return Row(number, FAILED, f"{type(error).__name__}: {error}")
    return row_of(number, s, time.perf_counter() - begin, share.keep)


def _lost(share: Share, why: str) -> list[Row]:
    return [Row(number, FAILED, why) for number, _ in share.problems]


def _again(share: Share, rows: Sequence[Row]) -> list[Share]:
    """Each problem of a share whose worker was lost once more, alone."""
    if share.attempts > 1 or not rows or any(row.status != FAILED for row in rows):
        return []
    return [replace(share, problems=(one,), attempts=2) for one in share.problems]


def _with_kernels(row: Row, problems: Sequence[Problem | DmocError]) -> Row:
    if row.solution is None or isinstance(problem := problems[row.number], DmocError):
        return row
    return replace(row, solution=replace(row.solution, kernels=problem.kernels))


def _table(rows: Sequence[Row], varied: Mapping[str, Array], method: str, seconds: float) -> Batch:
    most = max((len(row.times) for row in rows), default=0)

    def column(name: str) -> tuple[Any, ...]:
        return tuple(getattr(row, name) for row in rows)

    def numbers(name: str) -> Array:
        return np.array(column(name), dtype=float)

    def filled(name: str) -> Array:
        table = np.full((len(rows), most), np.nan)
        for line, values in zip(table, column(name), strict=True):
            line[: len(values)] = values
        return table

    chosen = dict.fromkeys(name for row in rows for name in row.design)
    return Batch(
        varied=varied,
        status=column("status"),
        message=column("message"),
        cost=numbers("cost"),
        final_time=numbers("final_time"),
        collisions=tuple(map(APART.join, column("collisions"))),
        collision_times=filled("times"),
        impulses=filled("impulses"),
        iterations=numbers("iterations"),
        check=column("check"),
        seconds=numbers("seconds"),
        method=method,
        total_seconds=seconds,
        design={n: np.array([row.design.get(n, np.nan) for row in rows]) for n in chosen},
    )
