"""What a fitted model says of a run that was kept out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from dmoc.base.errors import FitError
from dmoc.base.table import Shown, Table
from dmoc.fitting.data import AFTER, runs_of
from dmoc.fitting.hits import experiment_of
from dmoc.fitting.motion import solution_of
from dmoc.fitting.noise import first_sigma
from dmoc.fitting.parameters import START, Parameter, fixed_start, starts_parameters
from dmoc.fitting.regression import Regression
from dmoc.fitting.result import Fit, living
from dmoc.fitting.words import by_laws
from dmoc.motion.trajectory import Array

if TYPE_CHECKING:
    from dmoc.results.solution import Solution

# Fits of a free start, with the events that the last one leads to.
ROUNDS = 2


@dataclass(frozen=True, eq=False)
class Predicted(Shown):
    """A run that was kept out, beside what a fit says of it; made by :meth:`Fit.predict`.

    Attributes
    ----------
    rms : mapping of str to float
        Root mean square of measured less predicted values of each sensor, in its unit.
    relative : mapping of str to float
        The same as a share of the range that the sensor has measured.
    words : tuple of str
        The events of the run.
    t, measured, predicted : arrays of shape (n,)
        The values of all sensors, one after the other.
    start : mapping of str to float
        Free states at the begin, fitted to this run.
    motion : Solution or None
        None of a table of hits, and where an event happens at the begin.
    """

    rms: Mapping[str, float]
    relative: Mapping[str, float]
    words: tuple[str, ...]
    t: Array
    measured: Array
    predicted: Array
    start: Mapping[str, float]
    motion: Solution | None = field(repr=False)

    def __repr__(self) -> str:
        return f"<Predicted: {', '.join(f'{n} off by {x:.3g}' for n, x in self.rms.items())}>"

    def summary(self) -> Table:
        """What ``print`` and notebooks show."""
        rows = [
            (name, f"{x:.4g}", f"{100 * self.relative[name]:.3g} % of its range")
            for name, x in self.rms.items()
        ]
        rows += [(f"start of {name}", f"{x:.6g}", "fitted") for name, x in self.start.items()]
        return Table(tuple(rows), ("sensor", "off by", ""))


def predicted(fit: Fit, run: Any, start: Mapping[str, Any] | None) -> Predicted:
    """The prediction of one run by a fit."""
    estimate, problem = living(fit, "a prediction")
    first = estimate.regression.experiments[0].run
    sigma = _sigmas(fit)
    runs = runs_of(run, problem.kernels, sigma, first.form)
    if len(runs) != 1:
        raise FitError(f"{len(runs)} runs are given: expected one run to predict.")
    pairs = list(zip(estimate.regression.parameters, estimate.x, strict=True))
    sensed = [_kept(p, float(v)) for p, v in pairs if p.kind in ("bias", "gain", "delay") and
              p.run is None]  # fmt: skip
    free = starts_parameters(problem, runs, 0, start)
    e = experiment_of(
        problem, runs[0], problem.touch, (*sensed, *free), fixed_start(problem, runs, 0, start)
    )
    regression = Regression((e,), e.parameters, estimate.regression.loss)
    x = regression.first
    for _ in range(ROUNDS if free else 1):
        if free:
            x, _ = regression.fitted(x, first_sigma(regression))
        e = e if e.run.before else by_laws(e, x)
        regression = Regression((e,), e.parameters, regression.loss)
    made = regression.predict(x)
    if made is None:
        raise FitError(
            f"the motion of {runs[0].name} cannot be followed: check its start and its sequence."
        )
    off = e.measured - made[0].values
    rms = {name: float(np.sqrt(np.mean(off[at] ** 2))) for name, at in e.slices.items()}
    ranges = {name: float(np.ptp(e.measured[at])) or 1.0 for name, at in e.slices.items()}
    return Predicted(
        rms, {name: x / ranges[name] for name, x in rms.items()},
        e.words, e.times, e.measured, made[0].values,
        {p.of: float(v) for p, v in zip(e.parameters, x, strict=True) if p.kind == START},
        solution_of(e, made[0].course) if made[0].course.regular else None,
    )  # fmt: skip


def _kept(p: Parameter, value: float) -> Parameter:
    """What a sensor is known to do: it stays within rounding of its value."""
    near = 1e-12 * max(abs(value), p.size)
    return Parameter(p.name, p.kind, p.of, value - near, value + near, value, near)


def _sigmas(fit: Fit) -> dict[str, float]:
    return {s.sensor.removesuffix(AFTER): s.sigma for s in fit.sensors if s.sigma > 0}
