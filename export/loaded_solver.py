"""dmoc.load_solver: a folder of dmoc.generate_solver as a solver in Python."""

from __future__ import annotations

import ctypes
import math
import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from difflib import get_close_matches
from typing import Any

import numpy as np

from dmoc.base.arguments import array, is_number, listed, number, positive, shown, whole
from dmoc.base.errors import BuildError, ProblemError
from dmoc.base.messages import path as path_of
from dmoc.base.messages import place
from dmoc.base.signatures import public
from dmoc.base.tolerances import ITERATIONS
from dmoc.codegen.kernels import Array
from dmoc.export.library import library_of, sources_in
from dmoc.export.loaded_end import HEAD, Ends, LoadedEnd, address
from dmoc.export.numbers import SIDES
from dmoc.results.batch import NOT_TRIED, REFUSED
from dmoc.solvers.outcome import Status

# How a solve ends, in the order of dmoc_solver.h.
STATUSES = (
    Status.SOLVED, Status.INFEASIBLE, Status.ITERATION_LIMIT, Status.TIME_LIMIT, Status.STALLED,
    Status.INTERRUPTED, "no_memory", REFUSED, "outside", "unphysical",
    "no_rest",
)  # fmt: skip
REFUSES, NO_REST = STATUSES.index(REFUSED), STATUSES.index("no_rest")
LISTS = ("durations", "via")  # fields that are told by their places
TOGETHER = 16  # instances that a thread takes at a time
MOST_ITERATIONS = 2**31 - 1
MOST_INSTANCES, MOST_THREADS, MOST_STARTS, MOST_SEED = 1_000_000, 1024, 1_000_000, 2**63


@public(ProblemError)
class LoadedSolver:
    """A solver in C with its numbers, as :func:`load_solver` returns it.

    It keeps its numbers and where it has ended: the next solve goes on from there.

    Attributes
    ----------
    tables : dict
        Rows and columns of the tables of its ends, by name.
    """

    def __init__(self, library: ctypes.CDLL) -> None:
        self._c = library
        self._problem = self._c.dmoc_loaded()
        self._names = [
            self._c.dmoc_solver_number(self._problem, i).decode()
            for i in range(self._c.dmoc_solver_numbers(self._problem))
        ]
        self._bytes = int(self._c.dmoc_solver_memory(self._problem))
        self._memory = self._room()
        self._solver = self._c.dmoc_solver_begin(self._problem, address(self._memory), self._bytes)
        self.tables = self._tables()
        self._rows = int(self._c.dmoc_solver_rows(self._problem))
        nodes = ctypes.c_int()
        self._c.dmoc_solver_times(self._solver, ctypes.byref(nodes))
        self._nodes = nodes.value
        self._row = int(self._c.dmoc_loaded_row(self._solver))
        self._stop = ctypes.c_int(0)
        self._begin_thread()

    def _room(self) -> Array:
        return np.empty(self._bytes // 8 + 1)

    def _begin_thread(self) -> None:
        self._process, self._thread = os.getpid(), ThreadPoolExecutor(1)

    def _tables(self) -> dict[str, tuple[int, int]]:
        tables, size = {}, (ctypes.c_int(), ctypes.c_int())
        for i in range(self._c.dmoc_solver_tables(self._problem)):
            self._c.dmoc_solver_table(self._solver, i, *map(ctypes.byref, size))
            name = self._c.dmoc_solver_table_name(self._problem, i).decode()
            tables[name] = size[0].value, size[1].value
        return tables

    def __repr__(self) -> str:
        return f"LoadedSolver({len(self._names)} numbers, {self._bytes} bytes)"

    @property
    def numbers(self) -> dict[str, float]:
        """The numbers that it takes, by their names in the header, with their values."""
        values = (self._c.dmoc_solver_get(self._solver, i) for i in range(len(self._names)))
        return dict(zip(self._names, values, strict=True))

    def set(self, **numbers: Any) -> None:
        """Set numbers, as :class:`dmoc.Problem` takes them: ``start={"x": 0.1}``,
        ``bounds={"F": (-5, 5)}``, ``final_time=2``; or by names, ``**{"start.x": 0.1}``.

        Raises
        ------
        ProblemError
            If there is no such number; none is set then.
        """
        for name, value in dict(self._read(numbers)).items():
            self._c.dmoc_solver_set(self._solver, self._names.index(name), value)

    def solve(
        self, guess: Any = None, *, iterations: int = ITERATIONS, seconds: float | None = None
    ) -> LoadedEnd:
        """Solve with the numbers as they are set.

        Parameters
        ----------
        guess : optional
            Where to start: where the last solve has ended, with its multipliers; "answer", that of
            the day of export with its multipliers; "first", the first motion that it came from; or
            all unknowns, shape (n,).
        iterations : int
        seconds : float, optional
            Limit of the time.

        Returns
        -------
        LoadedEnd

        Raises
        ------
        ProblemError
            If an argument or a number does not fit.
        """
        limits = self._limits(iterations, seconds)
        self._start(guess)
        return self._solved(*limits, 0, 0)

    def explore(
        self, starts: int, seed: int = 0, *, iterations: int = ITERATIONS,
        seconds: float | None = None,
    ) -> LoadedEnd:  # fmt: skip
        """Solve from several starts: where the last solve has ended, the first motion, and random
        ones of a seed; the best end is kept.

        Limits of iterations are for each start, of seconds for all.
        """
        count = whole(starts, "starts", 1, MOST_STARTS)
        chosen = whole(seed, "seed", 0, MOST_SEED)
        return self._solved(*self._limits(iterations, seconds), count, chosen)

    def shift(self, elapsed: float) -> None:
        """Go on to the rest of the motion from a time in its first phase on: its start is the state
        then, its final time and the duration of its first phase are shorter by that time.

        A start that was measured may be set afterwards.

        Raises
        ------
        ProblemError
            If the first event is over by then, or the problem has no such rest: its start is not
            fixed, or something depends on the time, on integrals, on peaks or on both ends.
        """
        time = number(elapsed, "elapsed")
        if self._c.dmoc_solver_shift(self._solver, time) == NO_REST:
            raise ProblemError(f"elapsed = {time:g}: {self._sentence(NO_REST)}.")

    def solve_many(
        self, instances: Iterable[Mapping[str, Any]], *, threads: int = 1,
        iterations: int = ITERATIONS, seconds: float | None = None,
    ) -> list[LoadedEnd]:  # fmt: skip
        """Solve instances that differ in numbers, each from the answer of the day of export.

        Parameters
        ----------
        instances : iterable of mapping
            The numbers of each, as :meth:`set` takes them; others are as they are set.
        threads : int
            Threads of this process, each with memory of its own: the answers are the same for any
            number of them.
        iterations : int
            Limit of each.
        seconds : float, optional
            Limit of all together; what is not done then is "not_tried".

        Returns
        -------
        list of LoadedEnd
            In the order of the instances.  Ctrl-C ends those that run and keeps what is done.
        """
        entries = listed(instances, "instances", "mappings", most=MOST_INSTANCES)
        many = whole(threads, "threads", 1, MOST_THREADS)
        most, until = self._limits(iterations, seconds)
        values = np.tile([*self.numbers.values()], (len(entries), 1))
        for k, entry in enumerate(entries):
            if not isinstance(entry, Mapping):
                raise ProblemError(
                    f"instances has {shown(entry)} at place {k}: expected a mapping of numbers, "
                    "such as {'start': {'x': 0.1}}."
                )
            for name, value in self._read(entry):
                values[k, self._names.index(name)] = value
        ends = Ends(len(entries), self._row)
        # Threads take shares as soon as they are free: Ctrl-C must not meet the main one while it
        # hands them out, with a lock of the pool.
        shares = iter(range(0, len(entries), TOGETHER))

        def solved() -> None:
            room = self._room()
            for first in shares:
                count = min(TOGETHER, len(entries) - first)
                self._c.dmoc_loaded_many(
                    address(room), self._bytes, address(values[first:]), count, most, until,
                    ctypes.byref(self._stop), *ends.at(first),
                )  # fmt: skip

        with ThreadPoolExecutor(many) as pool:
            self._run(pool, [solved] * many)
        return [self._end(ends, k, values[k]) for k in range(len(entries))]

    def _run(self, pool: ThreadPoolExecutor, tasks: Sequence[Callable[[], None]]) -> None:
        """Do tasks in threads; Ctrl-C stops them after an iteration each."""
        self._stop.value = 0
        running: list[Future[None]] = []
        try:
            running.extend(pool.submit(task) for task in tasks)
            for task in running:
                task.result()
        except KeyboardInterrupt:
            self._stop.value = 1
            for task in running:
                task.result()

    def _solved(self, iterations: int, until: float, starts: int, seed: int) -> LoadedEnd:
        ends = Ends(1, self._row)

        def solved() -> None:
            self._c.dmoc_loaded_solve(
                self._solver, iterations, until, starts, seed, ctypes.byref(self._stop), *ends.at(0)
            )

        if self._process != os.getpid():  # a forked process has no threads of its parent
            self._begin_thread()
        self._run(self._thread, [solved])
        end = self._end(ends, 0, np.array([*self.numbers.values()]))
        if end.status == REFUSED:
            raise ProblemError(end.message)
        return end

    def _limits(self, iterations: Any, seconds: Any) -> tuple[int, float]:
        """The limit of iterations, and until when a solve may take."""
        most = whole(iterations, "iterations", 1, MOST_ITERATIONS)
        if seconds is None:
            return most, math.inf
        limit = positive(seconds, "seconds", "expected a positive number of seconds, or None")
        return most, self._c.dmoc_loaded_clock() + limit

    def _start(self, guess: Any) -> None:
        """Where the next solve starts."""
        if guess is None:
            return
        if isinstance(guess, str) and guess in ("answer", "first"):
            name = "answer" if guess == "answer" else "first_motion"
            getattr(self._c, f"dmoc_solver_from_{name}")(self._solver)
            return
        size = self._c.dmoc_solver_size(self._problem)
        unknowns = None if isinstance(guess, str) else array(guess)
        if unknowns is None or unknowns.shape != (size,) or not np.isfinite(unknowns).all():
            raise ProblemError(
                f"guess = {shown(guess)}: expected 'answer', 'first', or the {size} unknowns."
            )
        self._c.dmoc_solver_from(self._solver, address(np.ascontiguousarray(unknowns)))

    def _read(self, fields: Mapping[str, Any]) -> Iterator[tuple[str, float]]:
        """Names and values of numbers."""
        for field, value in fields.items():
            if field == "restitution" and is_number(value):
                value = {name.partition(".")[2]: value for name in self._of_restitution()}
            if field == "periodic" and isinstance(value, Mapping):
                value = {end: _difference(stated) for end, stated in value.items()}
            if field not in LISTS:
                yield from self._values(str(field), value)
                continue
            for i, entry in enumerate(listed(value, str(field), "numbers, ranges or mappings")):
                if entry is not None:
                    yield from self._values(f"{field}.{i}", entry)

    def _of_restitution(self) -> list[str]:
        return [name for name in self._names if name.startswith("restitution.")]

    def _values(self, name: str, value: Any) -> Iterator[tuple[str, float]]:
        if isinstance(value, Mapping) and any(n.startswith(f"{name}.") for n in self._names):
            for key, part in value.items():
                yield from self._values(f"{name}.{key}", part)
            return
        row = isinstance(value, (tuple, list)) or (
            isinstance(value, np.ndarray) and value.ndim == 1
        )
        if own := [n for n in self._names if re.fullmatch(rf"{re.escape(name)}\.\d+", n)]:
            if not row or len(value) != len(own):
                raise ProblemError(
                    f"{name} = {shown(value)}: expected {len(own)} values, one for each phase."
                )
            for named, part in zip(own, value, strict=True):
                yield from self._values(named, part)
            return
        pair = row and len(value) == len(SIDES)
        for side, part in zip(SIDES, value, strict=True) if pair else (("", value),):
            named = f"{name}.{side}" if side else name
            if side and part is None and named not in self._names:
                continue  # there was no such bound
            if named not in self._names:
                near = get_close_matches(named[:100], self._names, 1)
                hint = f" (did you mean {near[0]}?)" if near else ""
                raise ProblemError(
                    f"{shown(named)} is no number that this solver takes{hint}: solver.numbers has "
                    "those that it takes, README.md of its folder those that it keeps."
                )
            if not is_number(part):
                raise ProblemError(f"{named} = {shown(part)}: expected a number.")
            yield named, number(part, named)

    def _sentence(self, status: int) -> str:
        return str(self._c.dmoc_solver_sentence(status).decode())

    def _end(self, ends: Ends, k: int, values: Array) -> LoadedEnd:
        row, (status, iterations, wrong, starts) = ends.rows[k], ends.counts[k].tolist()
        if status < 0:
            none = np.zeros(0)
            return LoadedEnd(
                NOT_TRIED, "the time was used up, or Ctrl-C came, before its turn",
                math.nan, math.nan, math.nan, 0, 0, none, {}, {},
            )  # fmt: skip
        message = self._sentence(status)
        if status == REFUSES:
            expected = (ends.expected[k] or b"").decode()
            named = f"{self._names[wrong]} = {values[wrong]:.9g}: " if wrong >= 0 else ""
            message = f"{named}expected {expected}."
        cost, optimality, violation = row[:HEAD].tolist()
        (t, *tables), (y, z) = self._parts(row[HEAD:])
        return LoadedEnd(
            str(STATUSES[status]), message, cost, optimality, violation, iterations, starts, t,
            dict(zip(self.tables, tables, strict=True)), {"rows": y, "bounds": z},
        )  # fmt: skip

    def _parts(self, row: Array) -> tuple[list[Array], list[Array]]:
        """Times and tables of a row, and the multipliers."""
        shapes = [(self._nodes,), *self.tables.values()]
        *parts, y, z = np.split(row, np.cumsum([*map(math.prod, shapes), self._rows]))
        return [a.reshape(shape) for a, shape in zip(parts, shapes, strict=True)], [y, z]


def _difference(stated: Any) -> Any:
    """The difference in what ``periodic`` says of a state: ("x", 0.5)."""
    pair = isinstance(stated, (tuple, list)) and len(stated) == 2
    return stated[1] if pair and not (stated[0] is None or is_number(stated[0])) else stated


@public(BuildError)
def load_solver(folder: str | os.PathLike[str]) -> LoadedSolver:
    """Compile and load the folder that :func:`generate_solver` has written; nothing is written to
    it.

    Parameters
    ----------
    folder : path

    Returns
    -------
    LoadedSolver
        It sets numbers, solves, explores, goes on to the rest of a motion, and solves batches in
        threads.

    Raises
    ------
    BuildError
        If the folder is none of these, or was written by a version of dmoc with another form of
        them; if there is no C compiler, or it fails.

    Examples
    --------
    >>> import tempfile
    >>> import dmoc
    >>> from dmoc.models.registry import find
    >>> reference = find("puck_table")
    >>> problem = dmoc.Problem(reference.kernels(), **reference.defaults)
    >>> folder = tempfile.mkdtemp(prefix="puck_")
    >>> files = dmoc.generate_solver(problem.but(sequence=["east"], steps=20), folder)
    >>> solver = dmoc.load_solver(folder)
    >>> solver.set(final_time=1.5)
    >>> end = solver.solve()
    >>> end.status, round(end.cost, 2)
    ('solved', 4.97)
    """
    source = path_of(folder, "folder", BuildError)
    try:
        texts = sources_in(source)
    except (OSError, UnicodeDecodeError):
        raise BuildError(
            f"{place(source)} holds no solver: expected a folder that dmoc.generate_solver has "
            "written, with all its files."
        ) from None
    return LoadedSolver(library_of(texts))
