"""The result of many solves: a table with one row for each."""

from __future__ import annotations

import csv
import io
import os
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dmoc.base.errors import MissingExtraError, ProblemError
from dmoc.base.files import write_whole
from dmoc.base.signatures import public
from dmoc.base.table import Shown, Table, toned
from dmoc.motion.trajectory import Array, noun_of
from dmoc.results.result_file import Saved
from dmoc.solvers.outcome import Status

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame

    from dmoc.results.solution import Solution

# Beside the statuses of a solution: a problem that cannot be stated or solved as it is given, a
# worker that died or hung, and what the time or the caller left no room for.
REFUSED, FAILED, NOT_TRIED = "refused", "failed", "not_tried"
STATUSES = (*map(str, Status), REFUSED, FAILED, NOT_TRIED)
# What the simulation says of a motion; nothing where it was not asked.
CHECKS = ("passed", "failed", "")
APART = ","  # between events, as in the option of a sequence
# Rows and different messages that are shown; the file has all.
MOST_ROWS, MOST_NOTES = 40, 5
TONES = {"solved": "good", "grazes": "fair", "not_verified": "doubtful", "not_tried": "dim"}
# Columns of results; a parameter of such a name has a column that says what it is.
RESULTS = re.compile(
    r"status|cost|final_time|collisions|iterations|check|seconds|message|(time|impulse)_[0-9]+"
)


@public(ProblemError)
@dataclass(frozen=True, eq=False)
class Batch(Shown, Saved):
    """Results of :func:`dmoc.solve_many` and :func:`dmoc.sweep`, one row for each of n problems, in
    their order.

    Attributes
    ----------
    varied : mapping of str to array, shape (n,)
        What a sweep varies, by name; empty for other problems.
    status : tuple of str
        That of the solution, or "refused" (the problem cannot be stated or solved as it is given),
        "failed" (its worker died or hung), "not_tried" (there was no time left, or Ctrl-C).
    message : tuple of str
        What happened and what helps, one sentence.
    cost, final_time : array, shape (n,)
        NaN where no local minimum was found.  Seconds.
    collisions : tuple of str
        What happens at the events in their order, with commas between them; empty where no local
        minimum was found.
    collision_times, impulses : array, shape (n, most collisions)
        NaN where a problem has fewer.  Seconds; units of the model.
    iterations : array, shape (n,)
    check : tuple of str
        What the independent simulation says: "passed", "failed", or "" where it was not asked.
    seconds : array, shape (n,)
        Time of each in its worker.
    method : str
    total_seconds : float
        Time of all together.
    design : mapping of str to array, shape (n,)
        Parameters that the solver chose, by name; NaN where a problem has no such one, or no local
        minimum was found.
    solutions : tuple of Solution or None
        Only with ``keep=True``; not part of files.

    Examples
    --------
    >>> import dmoc
    >>> from dmoc.models.registry import find
    >>> reference = find("puck_table")
    >>> problem = dmoc.Problem(reference.kernels(), **reference.defaults)
    >>> batch = dmoc.sweep(problem, start={"x": [0.2, 0.3]})
    >>> batch.counts, len(batch)
    ({'solved': 2}, 2)
    >>> list(batch.columns())[:4]
    ['start x', 'status', 'cost', 'final_time']
    >>> path = batch.to_csv("puck.csv")
    """

    file_module = "dmoc.results.batch_file"

    varied: Mapping[str, Array]
    status: tuple[str, ...]
    message: tuple[str, ...]
    cost: Array
    final_time: Array
    collisions: tuple[str, ...]
    collision_times: Array
    impulses: Array
    iterations: Array
    check: tuple[str, ...]
    seconds: Array
    method: str
    total_seconds: float
    design: Mapping[str, Array] = field(default_factory=dict)
    solutions: tuple[Solution | None, ...] = field(default=(), repr=False)

    def __repr__(self) -> str:
        what = f" over {', '.join(self.varied)}" if self.varied else ""
        return f"<Batch of {len(self)} problems{what}: {counted(self)}>"

    def summary(self) -> Table:
        """What ``print`` and notebooks show."""
        return table_of_batch(self)

    def __len__(self) -> int:
        return len(self.status)

    @property
    def solved(self) -> NDArray[np.bool_]:
        """Rows for which a local minimum was found that nothing contradicts, shape (n,)."""
        return np.array([s == Status.SOLVED for s in self.status], dtype=bool)

    @property
    def tried(self) -> int:
        """Number of problems that were tried."""
        return len(self) - self.status.count(NOT_TRIED)

    @property
    def complete(self) -> bool:
        """Whether every problem was tried."""
        return self.tried == len(self)

    @property
    def counts(self) -> dict[str, int]:
        """Number of rows with each status."""
        return dict(Counter(self.status))

    @property
    def noun(self) -> str:
        """Noun for the events between the phases: "collision" where all are hits, else "event"."""
        return noun_of(word for row in self.collisions for word in row.split(APART))

    def columns(self) -> dict[str, Sequence[Any]]:
        """The table by columns: what is given, the results, a column for the time and the impulse
        of each collision, and the message last.  A parameter that is called like a result, such as
        ``cost``, has the column "parameter cost"."""
        table: dict[str, Sequence[Any]] = {column_of(k): list(v) for k, v in self.varied.items()}
        table |= {"status": self.status, "cost": list(self.cost)}
        table |= {"final_time": list(self.final_time), "collisions": self.collisions}
        table |= {f"chosen {name}": list(values) for name, values in self.design.items()}
        for i in range(self.collision_times.shape[1]):
            table[f"time_{i + 1}"] = list(self.collision_times[:, i])
            table[f"impulse_{i + 1}"] = list(self.impulses[:, i])
        table["iterations"] = [int(n) for n in self.iterations]
        return table | {"check": self.check, "seconds": list(self.seconds), "message": self.message}

    def to_frame(self) -> DataFrame:
        """The table as a pandas DataFrame.

        Raises
        ------
        MissingExtraError
            If pandas is not installed.
        """
        try:
            from pandas import DataFrame
        except ModuleNotFoundError:
            raise MissingExtraError(
                "pandas is needed for a data frame: install it with `pip install pandas`, or take "
                "columns()."
            ) from None
        return DataFrame(self.columns())

    def to_csv(self, path: str | os.PathLike[str]) -> Path:
        """Write the table as comma-separated values, numbers in full, empty where there is none.

        Raises
        ------
        OutputError
            If the file cannot be written.
        """
        stream = io.StringIO()
        columns = self.columns()
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(columns)
        for row in zip(*columns.values(), strict=True):
            writer.writerow(map(_cell, row))
        return write_whole(path, stream.getvalue().encode())

    def plot(self, path: str | os.PathLike[str] | None = None, *, style: str = "light") -> Figure:
        """Draw a sweep over one or two values: the cost and the times of collisions over the value,
        or a map of the cost; write the figure if a path is given.  ``style`` is "light" or "dark".

        Raises
        ------
        ProblemError
            If this is no sweep, or one over more than two values.
        """
        from dmoc.report.sweep_figure import plot_sweep

        return plot_sweep(
            self.varied, self.cost, self.final_time, self.collision_times, self.solved, path,
            self.noun, style=style,
        )  # fmt: skip

    def to_dict(self) -> dict[str, Any]:
        """The table as plain data, as the command line prints it as JSON."""
        return {
            "method": self.method,
            "complete": self.complete,
            "counts": self.counts,
            "seconds": self.total_seconds,
            "columns": {name: list(values) for name, values in self.columns().items()},
        }


def _cell(value: Any) -> str:
    if isinstance(value, float):
        return "" if np.isnan(value) else repr(float(value))
    return str(value)


def table_of_batch(batch: Batch) -> Table:
    """Table of the problems of a batch and their results, one row for each."""
    times = [f"{batch.noun} {i + 1} [s]" for i in range(batch.collision_times.shape[1])]
    rows = []
    for i, status in enumerate(batch.status[:MOST_ROWS]):
        numbers = [batch.cost[i], batch.final_time[i]]
        numbers += [*(values[i] for values in batch.design.values()), *batch.collision_times[i]]
        rows.append(
            (
                *(f"{values[i]:.6g}" for values in batch.varied.values()),
                toned(status, TONES.get(status, "bad")),
                *("" if n != n else f"{n:.6g}" for n in numbers),
                f"{batch.iterations[i]:.0f}",
            )
        )
    more = len(batch) - MOST_ROWS
    notes = [f"... and {more} more: --out FILE, or save(), has all of them"] if more > 0 else []
    unsolved = [m for m, good in zip(batch.message, batch.solved, strict=True) if not good]
    notes += [f"note: {message}" for message in list(dict.fromkeys(unsolved))[:MOST_NOTES]]
    rate = batch.tried / max(batch.total_seconds, 1e-9)
    notes.append(f"{counted(batch)}; in {batch.total_seconds:.1f} s ({rate:.1f} a second)")
    chosen = [f"chosen {name}" for name in batch.design]
    varied = map(column_of, batch.varied)
    head = (*varied, "status", "cost", "end [s]", *chosen, *times, "iterations")
    return Table(tuple(rows), head, tuple(notes))


def counted(batch: Batch) -> str:
    """The numbers of rows with each status, in words."""
    return ", ".join(f"{n} {status}" for status, n in batch.counts.items())


def column_of(name: str) -> str:
    """Name of the column of a swept value in a table."""
    return f"parameter {name}" if RESULTS.fullmatch(name) else name
