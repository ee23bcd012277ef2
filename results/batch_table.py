"""The table that stands for many solves."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from dmoc.base.table import Table, toned

if TYPE_CHECKING:
    from dmoc.results.batch import Batch

# Rows and different messages that are shown; the file has all.
MOST_ROWS, MOST_NOTES = 40, 5
TONES = {"solved": "good", "grazes": "fair", "not_verified": "doubtful", "not_tried": "dim"}

# Columns of results; a parameter of such a name has a column that says what it is.
RESULTS = re.compile(
    r"status|cost|final_time|collisions|iterations|check|seconds|message|(time|impulse)_[0-9]+"
)


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
