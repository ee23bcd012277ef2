"""What an estimate is worth, and the Fit that tells it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from dmoc.base.errors import FitError
from dmoc.base.names import unit_of
from dmoc.codegen.kernels import Array
from dmoc.fitting.course import Course
from dmoc.fitting.estimation import Estimate
from dmoc.fitting.experiment import Experiment
from dmoc.fitting.motion import solution_of
from dmoc.fitting.noise import FEWEST, first_noise, first_sigma
from dmoc.fitting.parameters import MODEL, RESTITUTION, Parameter, first_state
from dmoc.fitting.regression import MEDIAN, Regression
from dmoc.fitting.result import CONVERGED, MISFIT, Estimated, Fit, SensorFit
from dmoc.fitting.statistics import (
    UNLIKELY,
    SensorResiduals,
    influences,
    quantile,
    sandwich,
    sensor_residuals,
)
from dmoc.fitting.words import best_words, passed
from dmoc.problem.problem import Problem

# Residuals of a misfit: so many times their noise, and a share of the range of the sensor.
FAR, SEEN = 3.0, 0.005
# A start that is given contradicts what is measured: so many times its noise, and a share of the
# range.
CONTRADICTS, APART = 8.0, 0.05
# Share of a range, or of its value, by which an unknown lies at a bound.
AT_BOUND = 1e-6
# Of a value: standard errors from which on little is known.
HARDLY = 0.5
# Share of a run by which the last event may come after its end where it was measured.
LATE = 0.1


def fit_of(problem: Problem, estimate: Estimate, notes: Sequence[str]) -> Fit:
    """The result of an estimate.

    Raises
    ------
    FitError
        If a run ends before its word.
    """
    regression, x = estimate.regression, estimate.x
    misfits = list(_misfits(estimate))
    for e, made in zip(regression.experiments, estimate.predictions, strict=True):
        if not misfits:
            _check_whole(e, made.course)
    rows = list(sensor_residuals(estimate))
    correlated = [s for s in rows if s.runs_test < UNLIKELY]
    covariance = sandwich(estimate) if correlated else estimate.identification.covariance
    freedom = len(regression.measured) - len(x)
    unknowns = tuple(_unknowns(regression.parameters, x, covariance, freedom))
    said = [*notes, *misfits, *_passed(regression, x), *_correlated(correlated)]
    said += [*estimate.identification.sentences, *_doubtful(unknowns, regression)]
    return Fit(
        status=MISFIT if misfits else CONVERGED,
        message="; ".join(said),
        model=problem.kernels.name,
        unknowns=unknowns,
        covariance=covariance,
        undetermined=estimate.identification.sentences,
        words={e.run.name: e.words for e in regression.experiments},
        event_times={
            e.run.name: tuple(map(float, made.course.events))
            for e, made in zip(regression.experiments, estimate.predictions, strict=True)
        },
        sensors=tuple(_sensors(estimate, rows)),
        influence=influences(estimate),
        t=np.concatenate([e.times for e in regression.experiments]),
        measured=regression.measured,
        predicted=np.concatenate([p.values for p in estimate.predictions]),
        residual=estimate.residuals,
        degrees_of_freedom=freedom,
        motions=tuple(
            solution_of(e, made.course)
            for e, made in zip(regression.experiments, estimate.predictions, strict=True)
            if made.course.regular
        ),
        planned=with_values(problem, regression.parameters, x),
        estimate=estimate,
    )


def _unknowns(
    parameters: Sequence[Parameter], x: Array, covariance: Array, freedom: int
) -> Iterator[Estimated]:
    for p, value, variance in zip(parameters, x.tolist(), np.diag(covariance), strict=True):
        error = float(np.sqrt(variance))
        half = quantile(freedom) * error
        near = AT_BOUND * max(abs(value), p.size)
        at_bound = value - p.low < near or p.high - value < near
        yield Estimated(
            p.name, value, error, max(value - half, p.low), min(value + half, p.high), at_bound
        )


def _sensors(estimate: Estimate, rows: Sequence[SensorResiduals]) -> Iterator[SensorFit]:
    begin = 0
    for s in rows:
        sigma = float(estimate.sigma[begin : begin + s.count].mean())
        yield SensorFit(s.run, s.sensor, s.count, sigma, s.rms, s.runs_test, s.normality)
        begin += s.count


def with_values(problem: Problem, parameters: Sequence[Parameter], x: Array) -> Problem:
    """The problem with fitted values, those that are the same in all runs."""
    shared = [(p, float(v)) for p, v in zip(parameters, x, strict=True) if p.run is None]
    values = {p.of: v for p, v in shared if p.kind == MODEL}
    e = {p.of: v for p, v in shared if p.kind == RESTITUTION}
    changes: dict[str, object] = {}
    if values:
        changes["parameters"] = {**problem.parameters, **values}
        changes["design"] = {n: r for n, r in problem.design.items() if n not in values}
    if e:
        stated = problem.restitution_values
        pull = problem.model.contacts.pull
        names = [n for n, held in zip(problem.kernels.surfaces, pull, strict=True) if not held]
        of_all = dict.fromkeys(names, e[""]) if "" in e else {}
        hit = zip(names, stated[~pull], strict=True)
        known = {n: float(v) for n, v in hit if np.isfinite(v)}
        changes["restitution"] = {**known, **of_all, **{n: v for n, v in e.items() if n}}
    return problem.but(**changes)


# What is wrong ------------------------------------------------------------------------------------


def check_starts(regression: Regression) -> None:
    """Refuse starts that are given and that what is measured contradicts."""
    for e in regression.experiments:
        names = e.problem.kernels.coordinates
        states = [*names, *(f"{name}_dot" for name in names)]
        shifted = {p.of for p in e.parameters if p.kind in ("bias", "gain", "delay")}
        for name, known in zip(states, e.start, strict=True):
            s = e.run.sensors.get(name)
            if s is None or np.isnan(known) or name in shifted or len(s.y) < FEWEST:
                continue
            if s.t[0] > e.run.begin + np.median(np.diff(s.t)):
                continue
            seen = first_state(e.run, name)
            noise = float(
                np.nanmax(
                    [first_noise(s), np.nanmean(s.sigma) if np.isfinite(s.sigma).any() else np.nan]
                )
            )
            if abs(seen - known) > max(CONTRADICTS * noise, APART * float(np.ptp(s.y))):
                raise FitError(
                    f"the start of {name} is given as {known:g}, and {e.run.name} begins at "
                    f"{seen:.4g}, {abs(seen - known) / noise:.0f} times the noise of {name} away: "
                    f"correct it, or leave it free (start={{'{name}': None}})."
                )


def _check_whole(e: Experiment, course: Course) -> None:
    """Refuse a run that is over before the events of its word."""
    late = LATE * (e.run.end - e.run.begin) if e.run.events else 0.0
    for k, (word, time) in enumerate(zip(e.words, course.events, strict=True)):
        if k >= len(course.arcs) - 1 or time > e.run.end + late:
            raise FitError(
                f"{e.run.name} ends at {e.run.end:g} s, before event {k + 1} of its sequence "
                f"({word}): give the sequence of what happens in the run, or leave it out, and it "
                "is looked for."
            )


def _misfits(estimate: Estimate) -> Iterator[str]:
    """A sentence about each run whose residuals are far larger than noise."""
    regression, begin = estimate.regression, 0
    noise = first_sigma(regression)
    predicted = np.concatenate([p.values for p in estimate.predictions])
    left = regression.measured - predicted
    for i, e in enumerate(regression.experiments):
        worst, words = 0.0, ""
        for name, at in e.slices.items():
            rows = slice(begin + at.start, begin + at.stop)
            given = np.isfinite(regression.given_sigma[rows]).all()
            few = at.stop - at.start < FEWEST or bool(e.run.before)
            if few and not given:
                continue
            size = np.abs(left[rows] / noise[rows])
            times = _rms(size, regression.loss)
            least = SEEN * float(np.ptp(regression.measured[rows])) * (not given)
            if times > max(FAR, worst) and _rms(np.abs(left[rows]), regression.loss) > least:
                k = int(np.argmax(size))
                worst = times
                unit = unit_of(name, e.problem.kernels.manifest.units)
                sensor = f"{name} [{unit}]" if unit else name
                words = (
                    f"{e.run.name} does not fit: residuals of {sensor} are {times:.3g} times their "
                    f"noise, the largest {size[k]:.3g} times, at t = {e.times[at][k]:.4g} s"
                )
        if words:
            yield words + _other_word(regression, i)
        begin += len(e.measured)


def _rms(size: Array, loss: str) -> float:
    """Root mean square; the median where outliers may be among it."""
    return float(np.median(size) / MEDIAN) if loss == "huber" else float(np.sqrt(np.mean(size**2)))


def _other_word(regression: Regression, i: int) -> str:
    """What is said of other words of a run that does not fit."""
    e = regression.experiments[i]
    if not e.problem.kernels.surfaces or len(regression.alone(i).parameters) >= len(e.measured):
        return ""
    seen = all(name in e.run.sensors for name in e.problem.kernels.coordinates)
    best, square = best_words(regression, i, 0 if seen else 1)
    if best.words == e.words or not square <= FAR**2:
        return ", and no other word that was tried does" if e.words else ""
    return f", as {', '.join(best.words) or 'a motion without events'} would"


def _passed(regression: Regression, x: Array) -> Iterator[str]:
    for run, surface, time in passed(regression, x):
        yield (
            f"the motion of {run} is behind {surface} at {time:.4g} s, where its word has no event"
        )


def _correlated(rows: Sequence[SensorResiduals]) -> Iterator[str]:
    if rows:
        which = ", ".join(dict.fromkeys(f"{s.sensor} in {s.run}" for s in rows))
        yield (
            f"residuals are correlated ({which}): something is missing in the model, or noise is "
            "filtered; standard errors count that"
        )


def _doubtful(unknowns: Sequence[Estimated], regression: Regression) -> Iterator[str]:
    for u, p in zip(unknowns, regression.parameters, strict=True):
        if u.at_bound:
            yield f"{u.name} is at its bound {u.value:.6g}"
        elif np.isfinite(u.error) and u.error > HARDLY * max(abs(u.value), p.size):
            yield f"{u.name} is hardly known: {u.value:.3g} with a standard error of {u.error:.2g}"
