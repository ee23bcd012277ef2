"""What is fitted, by name: parameters of the model, coefficients of restitution, what sensors do to
what they measure, and starts; some of them the same in all runs, others each run's own."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.polynomial.polynomial import polyfit, polyval

from dmoc.base.arguments import check_known, check_largest, interval, listed, names, shown
from dmoc.base.errors import DmocError, FitError
from dmoc.base.names import momentum_name, velocity_name
from dmoc.base.records import record
from dmoc.codegen.kernels import Array
from dmoc.fitting.data import Run
from dmoc.mechanics.model_values import by_name
from dmoc.problem.problem import Problem

MODEL, RESTITUTION, START = "model", "restitution", "start"
BIAS, GAIN, DELAY = "bias", "gain", "delay"
SENSOR = (BIAS, GAIN, DELAY)
E = "e"  # what coefficients of restitution are called where no parameter of the model is
# Values of a sensor that is right.
RIGHT = {BIAS: 0.0, GAIN: 1.0, DELAY: 0.0}
# A restitution that nothing says begins in the middle of what it may be.
SOMEWHERE = 0.5
# Samples from which a state at the begin is read, and how far outliers among them are off, in
# medians.
FIRST, OUTLYING, ROUNDS = 9, 6.0, 20


@record(frozen=True, eq=False)
class Parameter:
    """One unknown: its name, what it is and of what, its bounds, where it begins, its size, and the
    number of the run that it belongs to, if it is one run's own."""

    name: str
    kind: str
    of: str  # a parameter, a surface ("" for all), a sensor, a state
    low: float
    high: float
    first: float
    size: float
    run: int | None = None

    def serves(self, run: int) -> bool:
        """Whether it is one of a run's."""
        return self.run is None or self.run == run


def parameters_of(
    problem: Problem, runs: Sequence[Run], given: Any, own: Any, start: Any
) -> tuple[Parameter, ...]:
    """All unknowns of a fit, those that are the same in all runs first.

    Raises
    ------
    FitError
        If a name is unknown, a range is empty, or there is none.
    """
    try:
        ranges = by_name(given, "parameters", FitError)
        if not ranges:
            raise FitError(
                "parameters = {}: expected what is to be fitted, as {'m': (0.5, 2), 'e': (0, 1)}."
            )
        each = names(own, "own", "parameters", FitError)
        for name in each:
            check_known(name, ranges, "parameter", "in own", FitError)
        made = [
            p for name, value in ranges.items()
            for p in _read(problem, runs, name, value, name in each)
        ]  # fmt: skip
        starts = [
            p for i, run in enumerate(runs) for p in starts_parameters(problem, runs, i, start)
        ]
    except FitError:
        raise
    except DmocError as error:  # a range that is none
        raise FitError(str(error)) from None
    return (*sorted(made, key=lambda p: p.run is not None), *starts)


def _read(
    problem: Problem, runs: Sequence[Run], name: str, value: Any, own: bool
) -> Iterator[Parameter]:
    kind, of = _kind(problem, runs, name)
    low, high = interval(value, f"parameters: {name}")
    if low == high:
        raise FitError(
            f"parameters: {name} = {low:g} is no range: give bounds such as ({low / 2:g}, "
            f"{low * 2:g}), or state the value in the problem."
        )
    if kind == RESTITUTION:
        low, high = max(low, 0.0), min(high, 1.0)
    elif kind == GAIN:
        low = max(low, 0.0)
    first = _first(problem, kind, of)
    if kind == MODEL and first > 0 and low == -np.inf:
        low = 0.0  # masses, lengths, coefficients
    first = _within(first, low, high)
    size = _size(first, low, high, kind, runs)
    if not own:
        yield Parameter(name, kind, of, low, high, first, size)
        return
    for i, run in enumerate(runs):
        yield Parameter(f"{name} of {run.name}", kind, of, low, high, first, size, i)


def _kind(problem: Problem, runs: Sequence[Run], name: str) -> tuple[str, str]:
    """What a name says, and of what."""
    kernels = problem.kernels
    if name in kernels.parameters:
        return MODEL, name
    head, colon, of = name.partition(":")
    if head == E:
        if colon:
            check_known(of, kernels.surfaces, "surface", f"in {shown(name)}", FitError)
        if not kernels.surfaces:
            raise FitError(f"{shown(name)} in parameters: the model has no surface that is hit.")
        lawful = [s for s in kernels.surfaces if s in kernels.manifest.restitution]
        if (of in lawful) if of else lawful:
            raise FitError(
                f"{shown(name)} in parameters: the model states a law of restitution of "
                f"{of or lawful[0]}; fit the parameters of that law."
            )
        return RESTITUTION, of
    if head in SENSOR and colon:
        sensed = sorted({s for run in runs for s in (*run.sensors, *run.inputs)})
        check_known(of, sensed, "sensor", f"in {shown(name)}", FitError)
        return head, of
    known = [*kernels.parameters, *([E] if kernels.surfaces else []), *(f"{s}:..." for s in SENSOR)]
    check_known(name, known, "parameter", "in parameters", FitError)
    raise FitError(f"{shown(name)} in parameters: say of which sensor, as '{name.rstrip('.')}y'.")


def _first(problem: Problem, kind: str, of: str) -> float:
    if kind == MODEL:
        at = list(problem.kernels.parameters).index(of)
        return float(problem.parameter_values[0, at])
    if kind in SENSOR:
        return RIGHT[kind]
    stated = problem.restitution
    if isinstance(stated, Mapping):
        stated = stated.get(of)
    return SOMEWHERE if stated is None else float(stated)


def _within(value: float, low: float, high: float) -> float:
    """A value inside its bounds: its own where it is, else the middle, else beside a bound."""
    if low < value < high:
        return value
    if np.isfinite([low, high]).all():
        return (low + high) / 2
    bound, side = (low, 1.0) if np.isfinite(low) else (high, -1.0)
    return bound + side * max(abs(bound), 1.0) * 0.1


def _size(first: float, low: float, high: float, kind: str, runs: Sequence[Run]) -> float:
    """What a parameter may change by."""
    if kind == DELAY:
        return 0.01 * max(run.end - run.begin for run in runs)
    if first:
        return abs(first)
    return (high - low) / 10 if np.isfinite([low, high]).all() else 1.0


# Starts -------------------------------------------------------------------------------------------


def starts_of(problem: Problem, runs: Sequence[Run], i: int, start: Any) -> dict[str, Any]:
    """What is said of the start of a run, by the names of states: numbers, ranges, None."""
    coordinates = problem.kernels.coordinates
    for q in coordinates:
        if momentum_name(q) in problem.start:
            raise FitError(
                f"the start of the problem gives {momentum_name(q)}: a fit needs the start in "
                f"velocities; give {velocity_name(q)}."
            )
    states = [*coordinates, *map(velocity_name, coordinates)]
    said = {q: problem.start.get(q) for q in coordinates}
    said |= {v: problem.start.get(v, 0.0) for v in states[len(coordinates) :]}
    if start is None:
        return said
    if not isinstance(start, Mapping):
        each = listed(start, "start", "mappings, one for each run", FitError)
        if len(each) != len(runs):
            raise FitError(
                f"start has {len(each)} entries: expected a mapping, or one for each of the "
                f"{len(runs)} runs."
            )
        start = each[i] or {}
    for name, value in by_name(start, "start", FitError).items():
        check_known(name, states, "state", "in start", FitError)
        said[name] = value
    return said


def starts_parameters(
    problem: Problem, runs: Sequence[Run], i: int, start: Any
) -> Iterator[Parameter]:
    """The free starts of a run."""
    run = runs[i]
    if run.before:  # a table of hits has its states
        return
    for name, value in starts_of(problem, runs, i, start).items():
        low, high = interval(value, f"start of {name}")
        if low == high:
            continue
        first = _within(first_state(run, name), low, high)
        label = f"start of {name}" if len(runs) == 1 else f"start of {name} of {run.name}"
        yield Parameter(label, START, name, low, high, first, state_size(run, name), i)


def fixed_start(problem: Problem, runs: Sequence[Run], i: int, start: Any) -> Array:
    """The state (2 nq,) that a run begins with, as far as it is known; not a number elsewhere."""
    said = starts_of(problem, runs, i, start)
    pairs = [interval(value, f"start of {name}") for name, value in said.items()]
    for name, bounds in zip(said, pairs, strict=True):
        for bound in bounds:
            check_largest(bound, f"start of {name}", FitError)
    return np.array([low if low == high else np.nan for low, high in pairs])


def first_state(run: Run, name: str, t: float | None = None, last: float | None = None) -> float:
    """A state of a run about a time, its begin if none is given, by a parabola through what was
    measured from there on, until a time at the latest; 0 where it was not measured."""
    t = run.begin if t is None else t
    base = name.removesuffix("_dot")
    if name in run.sensors:
        return _polynomial(run, name, t, last)[0]
    if base in run.sensors and base != name:
        return _polynomial(run, base, t, last)[1]
    return 0.0


def _polynomial(run: Run, name: str, t: float, last: float | None) -> tuple[float, float]:
    """Value and slope at a time of the parabola through the samples that follow."""
    s = run.sensors[name]
    span = (run.end - run.begin) / 20
    stop = run.end if last is None else last
    here = s.t >= t
    few = here & (s.t <= min(t + span, stop))
    if few.sum() < FIRST:
        few = here & (s.t <= stop)
        few[np.flatnonzero(few)[FIRST:]] = False
    x, y = s.t[few] - t, s.y[few]
    if len(x) < 2:
        k = int(np.argmin(np.abs(s.t - t)))
        return float(s.y[k]), 0.0
    unit = max(float(np.abs(x).max()), 1e-300)
    degree = min(2, len(np.unique(x)) - 1)
    fitted, weight = polyfit(x / unit, y, degree), np.ones(len(x))
    for _ in range(ROUNDS if len(x) > FIRST / 2 else 0):  # the least sum of distances, and then
        off = np.abs(y - polyval(x / unit, fitted))
        weight = 1 / np.sqrt(np.maximum(off, 1e-6 * float(np.abs(y).max()) + 1e-300))
        fitted = polyfit(x / unit, y, degree, w=weight)
    near = off <= OUTLYING * np.median(off) if len(x) > FIRST / 2 else weight > 0
    fitted = polyfit(x[near] / unit, y[near], degree)  # that of squares without outliers
    return float(fitted[0]), float(fitted[1]) / unit


def state_size(run: Run, name: str) -> float:
    """The size of a state in a run."""
    base = name.removesuffix("_dot")
    if name in run.sensors and (size := float(np.abs(run.sensors[name].y).max(initial=0.0))):
        return size
    if base in run.sensors:
        size = float(np.ptp(run.sensors[base].y)) or float(np.abs(run.sensors[base].y).max())
        return (size / (run.end - run.begin) if base != name else size) or 1.0
    return 1.0
