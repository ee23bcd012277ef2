"""Measured runs: what was measured when, with which standard deviation, and with which inputs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dmoc.base.arguments import check_known, check_magnitude, positive, shown
from dmoc.base.errors import FitError
from dmoc.base.names import momentum_name, velocity_name
from dmoc.base.records import record
from dmoc.codegen.kernels import Array, Kernels
from dmoc.fitting.course import Mesh
from dmoc.fitting.tables import EVENT, Columns, tables_of

HELD, LINEAR = "held", "linear"
# Ends of the names of columns of a table of hits.
BEFORE, AFTER = " before", " after"
SIDES = BEFORE, AFTER
# Steps of a run at least, so that events between rare samples are seen; and how far it goes on, as
# a share of its time, where an event that was measured comes later than the last sample.
LEAST_STEPS, BEYOND = 128, 0.5


@record(frozen=True, eq=False)
class Samples:
    """What one sensor has measured: times (n,), values (n,) and standard deviations (n,), not a
    number where they are to be estimated; and the rows of the table that they stand in."""

    t: Array
    y: Array
    sigma: Array
    rows: NDArray[np.intp] = field(default_factory=lambda: np.zeros(0, dtype=np.intp))


@record(frozen=True, eq=False)
class Signal:
    """An input as it was measured: times (n,) and values (n,)."""

    t: Array
    u: Array


@record(frozen=True, eq=False)
class Run:
    """A measured run: what sensors say, by the names of states and quantities; inputs by name; and
    times of events, by their words.  Of a table of hits, the states before them (rows,) by name,
    and what sensors say after."""

    name: str
    begin: float
    end: float
    sensors: Mapping[str, Samples]
    inputs: Mapping[str, Signal]
    form: str
    events: tuple[tuple[str, float], ...]
    sigma_events: float
    before: Mapping[str, Array] = field(default_factory=dict)
    rows: int = 0

    @property
    def count(self) -> int:
        """Number of measured values."""
        return sum(len(s.y) for s in self.sensors.values()) + len(self.events)

    @property
    def measures(self) -> tuple[str, ...]:
        """Names of what is measured."""
        return (*self.sensors, *([EVENT] if self.events else []))

    def mesh(self, kernels: Kernels, sensed: Mapping[str, tuple[float, float, float]]) -> Mesh:
        """Steps of a simulation, with a node at each sample and wherever inputs change; ``sensed``
        are bias, gain and delay of what measures the inputs."""
        knots = [s.t - sensed[name][2] for name, s in self.inputs.items()]
        samples = [s.t for s in self.sensors.values()]
        span = self.end - self.begin
        even = np.linspace(self.begin, self.end, LEAST_STEPS + 1)
        beyond = self.end + BEYOND * span * np.linspace(0, 1, LEAST_STEPS // 4 + 1)[1:]
        t = np.unique(np.concatenate([*knots, *samples, even, beyond]))
        t = t[(t >= self.begin) & (t <= beyond[-1])]
        t = t[np.append(True, np.diff(t) > 1e-12 * span)]
        ends = [np.zeros((len(t) - 1, len(kernels.inputs))) for _ in range(2)]
        for i, name in enumerate(kernels.inputs):
            if name in self.inputs:
                pair = self._values(self.inputs[name], t, sensed[name])
                for side, values in zip(ends, pair, strict=True):
                    side[:, i] = values
        return Mesh(t, *ends)

    def _values(
        self, signal: Signal, t: Array, sensed: tuple[float, float, float]
    ) -> tuple[Array, Array]:
        """Values of an input at both ends of steps."""
        bias, gain, delay = sensed
        if self.form == LINEAR:
            values = (np.interp(t + delay, signal.t, signal.u) - bias) / gain
            return values[:-1], values[1:]
        middle = (t[:-1] + t[1:]) / 2 + delay
        k = np.clip(np.searchsorted(signal.t, middle, side="right") - 1, 0, len(signal.t) - 1)
        held = (signal.u[k] - bias) / gain
        return held, held


def runs_of(
    runs: Any, kernels: Kernels, sigma: Mapping[str, Any] | None, form: str
) -> tuple[Run, ...]:
    """The runs that a user gives.

    Raises
    ------
    FitError
        If a column names nothing, times go back, or a standard deviation is not positive.
    """
    sigma = _sigmas(sigma, kernels)
    return tuple(_run_of(name, table, kernels, sigma, form) for name, table in tables_of(runs))


def sensed_names(kernels: Kernels) -> list[str]:
    """Names of what a sensor may measure."""
    coordinates = kernels.coordinates
    return [
        *coordinates,
        *map(velocity_name, coordinates),
        *map(momentum_name, coordinates),
        *kernels.quantities,
    ]


def _sigmas(sigma: Any, kernels: Kernels) -> dict[str, Any]:
    if sigma is None:
        return {}
    if not isinstance(sigma, Mapping):
        raise FitError(
            f"sigma = {shown(sigma)}: expected standard deviations by name, such as {{'y': 0.01}}."
        )
    for name, value in sigma.items():
        check_known(str(name), [*sensed_names(kernels), EVENT], "column", "in sigma", FitError)
        if not isinstance(value, str):
            what = f"sigma of {name}"
            size = positive(value, what, "expected a positive standard deviation", FitError)
            check_magnitude(size, value, what, FitError)
    return {str(name): value for name, value in sigma.items()}


def _run_of(
    name: str, table: Columns, kernels: Kernels, sigma: Mapping[str, Any], form: str
) -> Run:
    if any(column.endswith(SIDES) for column in table):
        return _hits_of(name, table, kernels, sigma)
    aside = {value for value in sigma.values() if isinstance(value, str)}
    measured, others = sensed_names(kernels), _said_elsewhere(kernels)
    for column in table:
        if column not in aside and column not in others:
            known = ["t", *measured, *kernels.inputs, EVENT]
            check_known(column, known, "column", f"of {name}", FitError)
    t = _times(name, table)
    sensors = {
        column: _samples(name, column, t, table, sigma.get(column))
        for column in measured
        if column in table and np.isfinite(table[column]).any()
    }
    inputs = {
        column: _signal(t, table[column])
        for column in kernels.inputs
        if column in table and np.isfinite(table[column]).any()
    }
    events = tuple(
        (word, float(time)) for word, time in zip(table.get(EVENT, ()), t, strict=False) if word
    )
    if not sensors and not events:
        raise FitError(
            f"{name} measures nothing: expected a column of a coordinate, velocity or quantity "
            f"({', '.join(measured)}), or events."
        )
    at = sigma.get(EVENT, np.nan)
    return Run(
        name, float(t[0]), float(t[-1]), sensors, inputs, form, events,
        np.nan if isinstance(at, str) else float(at),
    )  # fmt: skip


def _hits_of(name: str, table: Columns, kernels: Kernels, sigma: Mapping[str, Any]) -> Run:
    """A table of hits, a row each."""
    states = [*kernels.coordinates, *map(velocity_name, kernels.coordinates)]
    known = [f"{s}{BEFORE}" for s in states]
    known += [f"{velocity_name(q)}{AFTER}" for q in kernels.coordinates]
    aside = {value for value in sigma.values() if isinstance(value, str)}
    for column in table:
        if column not in aside:
            check_known(column, [*known, "t"], "column", f"of {name}, a table of hits,", FitError)
    count = len(next(iter(table.values())))
    t = np.asarray(table.get("t", np.arange(1.0, count + 1)), dtype=float)
    before = {
        column.removesuffix(BEFORE): np.asarray(values, dtype=float)
        for column, values in table.items()
        if column.endswith(BEFORE)
    }
    for state, values in before.items():
        if not np.isfinite(values).all():
            k = int(np.argmin(np.isfinite(values)))
            raise FitError(
                f"{name} has no {state}{BEFORE} in row {k + 2}: expected the state before each hit."
            )
    sensors = {
        column: _samples(name, column, t, table, sigma.get(column.removesuffix(AFTER)))
        for column in table
        if column.endswith(AFTER)
    }
    if not before or not any(len(s.y) for s in sensors.values()):
        raise FitError(
            f"{name} is a table of hits: expected columns such as '{states[-1]}{BEFORE}' and "
            f"'{states[-1]}{AFTER}'."
        )
    return Run(
        name, float(t.min()), float(t.max()) + 1.0, sensors, {}, HELD, (), np.nan, before, count
    )


def _said_elsewhere(kernels: Kernels) -> set[str]:
    """Columns of dmoc's own tables that are no measurements here."""
    forces = [("N_", kernels.surfaces), ("T_", kernels.tangents), ("R_", kernels.joints)]
    return {"phase", *(f"{letter}{name}" for letter, names in forces for name in names)}


def _times(name: str, table: Columns) -> Array:
    if "t" not in table:
        raise FitError(f"{name} has no column t: expected the times of its rows in seconds.")
    t = np.asarray(table["t"], dtype=float)
    if not len(t) or not np.isfinite(t).all():
        raise FitError(f"{name} has rows without a time: expected a finite number in column t.")
    back = np.flatnonzero(np.diff(t) < 0)
    if len(back):
        k = int(back[0])
        raise FitError(
            f"the times of {name} go back from {t[k]:g} to {t[k + 1]:g} s in row {k + 2}: sort its "
            "rows, or make two runs of it."
        )
    if t[-1] <= t[0]:
        raise FitError(f"{name} has no duration: expected rows at two times at least.")
    return t


def _samples(name: str, column: str, t: Array, table: Columns, sigma: Any) -> Samples:
    values = np.asarray(table[column], dtype=float)
    there = np.isfinite(values)
    own = _deviations(name, column, table, sigma, there)
    return Samples(t[there], values[there], own, np.flatnonzero(there))


def _deviations(
    name: str, column: str, table: Columns, sigma: Any, there: NDArray[np.bool_]
) -> Array:
    """Standard deviations of the values of a column that are there."""
    if sigma is None:
        return np.full(int(there.sum()), np.nan)
    if not isinstance(sigma, str):
        return np.full(int(there.sum()), float(sigma))
    if sigma not in table:
        raise FitError(
            f"sigma of {column} = {shown(sigma)}: {name} has no such column; give a number, or the "
            "name of one of its columns."
        )
    own = np.asarray(table[sigma], dtype=float)[there]
    if not (own > 0).all():
        wrong = float(own[~(own > 0)][0])
        raise FitError(
            f"column {sigma} of {name} has a standard deviation of {wrong:g}: expected positive "
            f"numbers wherever {column} is measured."
        )
    return own


def _signal(t: Array, values: Array) -> Signal:
    there = np.isfinite(values)
    return Signal(t[there], np.asarray(values, dtype=float)[there])
