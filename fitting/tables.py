"""Tables of measured runs as users have them: CSV files, frames, mappings of arrays, motions."""

from __future__ import annotations

import csv
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from dmoc.base.arguments import array, place, shown
from dmoc.base.arguments import path as path_of
from dmoc.base.errors import FitError
from dmoc.motion.motion_tables import columns
from dmoc.results.motion_result import MotionResult

EVENT = "event"  # the column of what happened at the time of a row, in words of a sequence
MISSING = ("", "nan", "na", "none", "null")

# A table: columns of numbers (n,), not a number where nothing was measured; of texts for events.
Columns = dict[str, Any]


def tables_of(runs: Any) -> list[tuple[str, Columns]]:
    """Each run with its name.

    Raises
    ------
    FitError
        If something is no run, or a file cannot be read.
    """
    several = isinstance(runs, Sequence) and not isinstance(runs, (str, bytes))
    given = list(runs) if several else [runs]
    if not given:
        raise FitError("runs = []: expected a measured run, or several of them.")
    made = [_named(run, f"run {i + 1}") for i, run in enumerate(given)]
    names = [name for name, _ in made]
    if len(set(names)) < len(names):
        return [(f"run {i + 1}", table) for i, (_, table) in enumerate(made)]
    return made


def _named(run: Any, name: str) -> tuple[str, Columns]:
    if isinstance(run, (str, os.PathLike)):
        path = path_of(run, error=FitError)
        return path.stem, _from_csv(path)
    if isinstance(run, MotionResult):
        return name, _from_motion(run)
    if isinstance(run, Mapping) or (hasattr(run, "columns") and hasattr(run, "__getitem__")):
        names = list(run) if isinstance(run, Mapping) else list(run.columns)
        return name, _checked({_plain(str(c)): _column(run[c], str(c), name) for c in names}, name)
    raise FitError(
        f"{name} = {shown(run)}: expected a path of a CSV file, a data frame, a mapping from names "
        "to arrays, or a simulation."
    )


def _plain(header: str) -> str:
    """The name of a column, without the unit that a header may have in brackets."""
    return header.partition("[")[0].strip()


def _from_motion(motion: MotionResult) -> Columns:
    """What sensors of all states would have measured, and the inputs."""
    names, trajectory = columns(motion.trajectory), motion.trajectory
    kept = ["t", *trajectory.coordinates, *(f"{q}_dot" for q in trajectory.coordinates)]
    return {name: names[name] for name in (*kept, *trajectory.inputs)}


def _column(values: Any, column: str, run: str) -> Any:
    if _plain(column) == EVENT:
        return [_event(value) for value in values]
    numbers = array([np.nan if value is None else value for value in np.asarray(values).ravel()])
    if numbers is None or numbers.ndim != 1:
        raise FitError(f"column {shown(column)} of {run}: expected numbers, NaN for none.")
    return numbers


def _event(value: Any) -> str:
    text = "" if value is None or value != value else str(value).strip()
    return "" if text.lower() in MISSING else text


def _checked(table: Columns, run: str) -> Columns:
    """Refuse columns of different lengths."""
    counts = {name: len(values) for name, values in table.items()}
    if len(set(counts.values())) > 1:
        first, *_, last = sorted(counts, key=lambda name: counts[name])
        raise FitError(
            f"{run} has {counts[first]} values of {first} and {counts[last]} of {last}: expected "
            "as many of each, NaN where nothing was measured."
        )
    return table


def _from_csv(path: Path) -> Columns:
    name = place(path)
    try:
        with path.open(newline="", encoding="utf-8-sig") as stream:
            rows = [row for row in csv.reader(stream) if row and not row[0].startswith("#")]
    except OSError as error:
        raise FitError(f"{name} cannot be read ({error.strerror}): give a CSV file.") from None
    except (UnicodeDecodeError, csv.Error):
        raise FitError(f"{name} is no table of comma-separated values: give a CSV file.") from None
    if len(rows) < 2:
        raise FitError(f"{name} has no rows: expected a header with names, and numbers below it.")
    header, *body = rows
    for i, row in enumerate(body):
        if len(row) != len(header):
            raise FitError(
                f"{name}: row {i + 2} has {len(row)} values, the header {len(header)} names: "
                "expected as many."
            )
    texts = zip(header, zip(*body, strict=True), strict=True)
    return {_plain(column): _numbers(values, column, name) for column, values in texts}


def _numbers(values: Sequence[str], column: str, name: str) -> Any:
    if _plain(column) == EVENT:
        return [_event(value) for value in values]
    numbers = np.full(len(values), np.nan)
    for i, text in enumerate(values):
        if text.strip().lower() in MISSING:
            continue
        try:
            numbers[i] = float(text)
        except ValueError:
            raise FitError(
                f"{name}: row {i + 2} has {shown(text)} for {column}: expected a number, or "
                "nothing."
            ) from None
    return numbers
