"""A motion that somebody claims, read from a table: what `referee.py` judges."""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import dmoc
from dmoc.base.errors import MotionError
from dmoc.base.names import momentum_name, unit_of, velocity_name
from dmoc.codegen.kernels import Array

OWN = "phase"  # a column that tables of dmoc have
CLOCK = "numerical_time"  # of a tool whose physical time may stand still
FORMS = ("held", "linear")
MOST = 1e100  # a larger number overflows where it is multiplied by itself
# Share of the final time, and of the numerical time, that passes while the physical time stands.
SAME_TIME, SLOW = 1e-9, 1e-2
_UNIT = re.compile(r"(.*?)\s*\[(.*)\]")


@dataclass(frozen=True)
class Frozen:
    """A moment at which the physical time stands: rows that were cut out, the numerical time that
    passes, and the running cost that it would add."""

    time: float
    rows: int
    seconds: float
    cost: float


@dataclass(frozen=True, eq=False)
class Claim:
    """Rows of a motion: times (n,), positions and velocities (n, nq), inputs at both ends of the
    intervals (n - 1, nu).  Two rows at one time are the two sides of a jump."""

    t: Array
    q: Array
    v: Array | None
    u0: Array
    u1: Array
    form: str
    frozen: tuple[Frozen, ...]

    @property
    def steps(self) -> Array:
        """Numbers of the intervals in which time passes."""
        return np.flatnonzero(np.diff(self.t) > 0)


def read_claim(path: Path, problem: dmoc.Problem, form: str | None = None) -> Claim:
    """Read a table with a header: ``t``, all coordinates, all inputs, and all velocities or none.

    Raises
    ------
    MotionError
        If a column is missing or unknown, or has another unit than the model; if a number is
        missing, or the times do not increase.
    """
    lines = _lines(path)
    comments = [line[1:].partition(":") for line in lines if line.startswith("#")]
    forms = [value.strip() for key, _, value in comments if key.strip() == "inputs"]
    try:
        rows = list(csv.reader(line for line in lines if not line.startswith("#")))
    except csv.Error as error:  # a cell of many thousand characters
        raise MotionError(f"{path} is no table: {error}; expected numbers.") from None
    table = _columns(path, rows, problem)
    form = form or (forms[0] if forms else None)
    if form is None and OWN in (rows[0] if rows else []) and problem.control_form == "linear":
        form = "linear"
    if form not in (None, *FORMS):
        raise MotionError(f"{path}: inputs = {form!r}: expected {' or '.join(FORMS)}.")
    return _claim(path, table, problem, form)


def _lines(path: Path) -> list[str]:
    try:
        return [line for line in path.read_text(encoding="utf-8").splitlines() if line.strip()]
    except (OSError, UnicodeDecodeError) as error:
        raise MotionError(f"{path} cannot be read: {error}; expected a table as CSV.") from None


def _columns(path: Path, rows: list[list[str]], problem: dmoc.Problem) -> dict[str, Array]:
    """The columns that are used, by name."""
    kernels = problem.kernels
    rates = [velocity_name(name) for name in kernels.coordinates]
    used = ["t", CLOCK, *kernels.coordinates, *rates, *kernels.inputs]
    other = [OWN, *map(momentum_name, kernels.coordinates), *kernels.quantities]
    other += [f"{kind}_{name}" for kind, names in (
        ("N", kernels.surfaces), ("T", kernels.tangents), ("R", kernels.joints),
    ) for name in names]  # fmt: skip
    header = [_UNIT.fullmatch(name.strip()) or name.strip() for name in (rows[0] if rows else [])]
    names = [name if isinstance(name, str) else name[1] for name in header]
    units = [None if isinstance(name, str) else name[2] for name in header]
    for name, unit in zip(names, units, strict=True):
        if name not in (*used, *other):
            raise MotionError(
                f"{path}: unknown column {name!r}: expected some of {', '.join(used)}; rename it, "
                "or take it out."
            )
        own = "s" if name in ("t", CLOCK) else unit_of(name, kernels.manifest.units)
        if unit and own and unit != own:
            raise MotionError(f"{path}: column {name!r} is in {unit}: convert it to {own}.")
        if names.count(name) > 1:
            raise MotionError(f"{path}: column {name!r} stands twice: take one out.")
    needed = ["t", *kernels.coordinates, *kernels.inputs]
    needed += rates if any(rate in names for rate in rates) else []
    if missing := [name for name in needed if name not in names]:
        raise MotionError(f"{path}: no column {missing[0]!r}: expected {', '.join(needed)}.")
    if len(rows) < 3:
        raise MotionError(f"{path} has {len(rows) - 1} rows: expected two or more.")
    table = {}
    for column, name in enumerate(names):
        if name in used:
            table[name] = np.array([
                _number(path, name, k, row, column, kernels.inputs, len(rows) - 1)
                for k, row in enumerate(rows[1:], 1)
            ])  # fmt: skip
    return table


def _number(
    path: Path, name: str, k: int, row: list[str], column: int, inputs: list[str], last: int
) -> float:
    """A number; only the inputs of the last row may be missing."""
    text = row[column].strip() if column < len(row) else ""
    try:
        value = float(text) if text else np.nan
    except ValueError:
        value = np.inf
    if not abs(value) <= MOST and not (k == last and name in inputs and np.isnan(value)):
        raise MotionError(
            f"{path}: {name} in row {k} is {text[:60]!r}: expected a finite number, at most "
            f"{MOST:g}, whose squares do not overflow."
        )
    return value


def _claim(path: Path, table: dict[str, Array], problem: dmoc.Problem, form: str | None) -> Claim:
    kernels = problem.kernels
    rates = [velocity_name(name) for name in kernels.coordinates]
    t, clock = table["t"], table.get(CLOCK)
    for name, times in (("t", t), (CLOCK, t if clock is None else clock)):
        if (back := np.flatnonzero(np.diff(times) < 0)).size:
            k = int(back[0])
            raise MotionError(
                f"{path}: {name} falls from {times[k]:g} in row {k + 1} to {times[k + 1]:g}: "
                "expected times that do not decrease."
            )
    if not t[-1] > t[0]:
        raise MotionError(f"{path}: t is {t[0]:g} in all rows: expected a motion that takes time.")
    q = np.column_stack([table[name] for name in kernels.coordinates])
    v = np.column_stack([table[name] for name in rates]) if rates[0] in table else None
    u = np.column_stack([table[name] for name in kernels.inputs] or [np.zeros((len(t), 0))])
    u[-1] = np.where(np.isnan(u[-1]), u[-2], u[-1])
    standing = np.diff(t) <= SAME_TIME * (t[-1] - t[0])
    if clock is not None:
        standing |= np.diff(t) <= SLOW * np.diff(clock)
    form = form or _form(standing, u)
    kept, frozen, times = np.ones(len(t), dtype=bool), list[Frozen](), t.copy()
    edges = np.flatnonzero(np.diff(np.concatenate([[0], standing.astype(int), [0]])))
    for first, last in edges.reshape(-1, 2):
        times[first : last + 1] = t[last]
        kept[first + 1 : last] = False
        passed = 0.0 if clock is None else float(clock[last] - clock[first])
        if last - first > 1 or passed > 0:
            cost = 0.0
            if clock is not None:
                part = slice(first, last + 1)
                rate = problem.model.running_cost(
                    q[part], None if v is None else v[part], u[part], t[part]
                )
                cost = float(np.trapezoid(rate, clock[part]))
            frozen.append(Frozen(float(t[last]), int(last - first - 1), passed, cost))
    u = u[kept]
    ends = u[1:] if form == "linear" else u[:-1]
    return Claim(
        times[kept], q[kept], None if v is None else v[kept], u[:-1], ends, form, tuple(frozen)
    )


def _form(standing: Array, u: Array) -> str:
    """Linear inputs where a row before a jump has others than the row before it: of held ones it
    repeats those of the interval that ends."""
    ends = np.flatnonzero(standing[1:] & ~standing[:-1]) + 1
    return "linear" if bool((u[ends] != u[ends - 1]).any()) else "held"
