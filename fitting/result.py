"""The result of a fit: values with their errors, what is left of the data, and the motions."""

from __future__ import annotations

import csv
import io
import json
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dmoc.base.arguments import check_known, text
from dmoc.base.arguments import path as path_of
from dmoc.base.errors import FitError
from dmoc.base.files import write_whole
from dmoc.base.signatures import public
from dmoc.base.table import Shown, Table
from dmoc.motion.trajectory import Array
from dmoc.results.result_file import Saved

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from dmoc.fitting.estimation import Estimate
    from dmoc.fitting.prediction import Predicted
    from dmoc.fitting.profile import Profile
    from dmoc.problem.problem import Problem
    from dmoc.results.solution import Solution

CONVERGED, MISFIT = "converged", "misfit"


@dataclass(frozen=True)
class Estimated:
    """One unknown of a fit.

    Attributes
    ----------
    name : str
        As ``parameters`` calls it; with the run, if it is that run's own.
    value : float
    error : float
        Standard error; infinite where nothing determines the unknown.
    low, high : float
        The interval that contains the true one in 95 of 100 fits, within the bounds.
    at_bound : bool
        Whether the value lies at a bound, where the error says little.
    """

    name: str
    value: float
    error: float
    low: float
    high: float
    at_bound: bool = False


@dataclass(frozen=True)
class SensorFit:
    """What a fit leaves of one sensor in one run.

    Attributes
    ----------
    run, sensor : str
    count : int
        Measured values.
    sigma : float
        Standard deviation, given (the mean, if each value has one) or estimated.
    rms : float
        Root mean square of the residuals, in standard deviations.
    runs_test, normality : float
        Probability of residuals with as many runs of signs, and of such a distribution, if they
        are independent and normal; not a number for fewer than 20 values, and where residuals are
        less than a tenth of the noise that is said.
    """

    run: str
    sensor: str
    count: int
    sigma: float
    rms: float
    runs_test: float
    normality: float


@public(FitError)
@dataclass(frozen=True, eq=False)
class Fit(Shown, Saved):
    """Result of :func:`dmoc.fit`.

    Attributes
    ----------
    status : str
        "converged", or "misfit" where residuals are far larger than their noise.
    message : str
        What happened, one sentence for each of what should be known.
    model : str
    unknowns : tuple of Estimated
        Everything that was fitted, free starts among it.
    covariance : array of shape (p, p)
        Of the unknowns, in their order; infinite where nothing determines them.
    undetermined : tuple of str
        What the data cannot tell, in sentences.
    words : mapping of str to tuple of str
        The events of each run.
    event_times : mapping of str to tuple of float
        Their times in seconds, in the time of the run.
    sensors : tuple of SensorFit
        What is left of each sensor of each run.
    influence : mapping of str to float
        Of each of several runs, by how many standard errors the unknown that moves most would move
        without it.
    t, measured, predicted, residual : arrays of shape (n,)
        All measured values, in the order of ``sensors``; residuals are measured less predicted, in
        standard deviations.
    degrees_of_freedom : int
    motions : tuple of Solution
        The motion of each run, checked; none of a table of hits, of a run with an event at its
        begin, and in a fit from a file.
    problem : Problem
        The problem with the fitted values, to plan with; refused in a fit from a file.

    Examples
    --------
    A pendulum that swings through its rest position, of which only g/l matters:

    >>> import dmoc, numpy as np
    >>> problem = dmoc.Problem(dmoc.load("bouncing_pendulum"), start={"theta": 0.5})
    >>> motion = dmoc.simulate(problem.kernels, {"theta": 0.5}, step_size=0.01, steps=40)
    >>> fit = dmoc.fit(problem, motion, {"g": (5, 15), "m": (0.1, 10)}, sigma={"theta": 0.001})
    >>> fit.undetermined
    ('nothing that is measured depends on m',)
    >>> round(fit["g"], 2)
    9.81
    """

    file_module = "dmoc.fitting.fit_file"

    status: str
    message: str
    model: str
    unknowns: tuple[Estimated, ...]
    covariance: Array
    undetermined: tuple[str, ...]
    words: Mapping[str, tuple[str, ...]]
    event_times: Mapping[str, tuple[float, ...]]
    sensors: tuple[SensorFit, ...]
    influence: Mapping[str, float]
    t: Array
    measured: Array
    predicted: Array
    residual: Array
    degrees_of_freedom: int
    motions: tuple[Solution, ...] = field(default=(), repr=False)
    planned: Problem | None = field(default=None, repr=False)
    estimate: Estimate | None = field(default=None, repr=False)

    def __repr__(self) -> str:
        values = ", ".join(f"{u.name} = {u.value:.6g} ± {u.error:.2g}" for u in self.unknowns)
        return f"<Fit of {self.model}: {self.status}; {values}>"

    def __getitem__(self, name: str) -> float:
        """The value of an unknown by name."""
        return self._unknown(name).value

    def _unknown(self, name: str) -> Estimated:
        names = [u.name for u in self.unknowns]
        check_known(name, names, "unknown", "of the fit", FitError)
        return self.unknowns[names.index(name)]

    @property
    def problem(self) -> Problem:
        """The problem with the fitted values, to plan with."""
        return living(self, "a problem to plan with")[1]

    @property
    def values(self) -> dict[str, float]:
        """All unknowns by name."""
        return {u.name: u.value for u in self.unknowns}

    @property
    def errors(self) -> dict[str, float]:
        """Standard errors by name."""
        return {u.name: u.error for u in self.unknowns}

    @property
    def correlation(self) -> Array:
        """Correlations of the unknowns, shape (p, p); not a number where an error is infinite."""
        size = np.sqrt(np.diag(self.covariance))
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.asarray(self.covariance / size / size[:, None])

    @property
    def chi2(self) -> float:
        """Sum of the squares of the residuals."""
        return float(self.residual @ self.residual)

    def summary(self) -> Table:
        """What ``print`` and notebooks show."""
        from dmoc.fitting.fit_report import table_of_fit

        return table_of_fit(self)

    def predict(self, run: Any, start: Mapping[str, Any] | None = None) -> Predicted:
        """What the fitted model says of a run that was kept out, with what was measured then.

        Parameters
        ----------
        run : as for :func:`dmoc.fit`
        start : mapping, optional
            As for :func:`dmoc.fit`, for this run; what is free is fitted to it, and nothing else.

        Raises
        ------
        FitError
            If the run does not fit the model, or the fit comes from a file.
        """
        from dmoc.fitting.prediction import predicted

        with np.errstate(all="ignore"):  # what overflows has no value, and is told as that
            return predicted(self, run, start)

    def profile(self, name: str, points: int = 11) -> Profile:
        """The least sum of squares over one unknown, all others fitted anew at each of its values,
        and the interval of 95 % that follows: it is right where the model is far from linear, and
        says where an unknown has no bound.

        Parameters
        ----------
        name : str
        points : int
            Values within 3 standard errors on both sides.

        Raises
        ------
        FitError
            If there is no such unknown, or the fit comes from a file.
        """
        from dmoc.fitting.profile import profile_of

        self._unknown(text(name, "name", FitError))
        return profile_of(self, name, points)

    def plot(self, path: str | os.PathLike[str] | None = None, *, style: str = "light") -> Figure:
        """Draw what was measured, the fitted motion with its hits, and the residuals."""
        from dmoc.fitting.fit_figure import plot_fit

        return plot_fit(self, path, style=style)

    def report(self, path: str | os.PathLike[str]) -> Path:
        """Write values, residuals and figure on one page (.html), which needs no network.

        Raises
        ------
        OutputError
            If the ending is another one, or the file cannot be written.
        MissingExtraError
            If Matplotlib is not installed.
        """
        from dmoc.fitting.fit_report import report

        return report(self, path_of(path))

    def to_dict(self) -> dict[str, Any]:
        """Return the summary that the command line prints as JSON."""
        return {
            "model": self.model, "status": self.status, "message": self.message,
            "unknowns": [asdict(u) for u in self.unknowns],
            "covariance": self.covariance.tolist(),
            "undetermined": list(self.undetermined),
            "words": {name: list(words) for name, words in self.words.items()},
            "event_times": {name: list(times) for name, times in self.event_times.items()},
            "sensors": [asdict(s) for s in self.sensors],
            "influence": dict(self.influence), "chi2": self.chi2,
            "degrees_of_freedom": self.degrees_of_freedom,
        }  # fmt: skip

    def to_json(self, path: str | os.PathLike[str]) -> Path:
        """Write the same summary as JSON, where what is not finite is null.

        Raises
        ------
        OutputError
            If the file cannot be written.
        """
        return write_whole(path, (json.dumps(finite(self.to_dict()), indent=1) + "\n").encode())

    def to_csv(self, path: str | os.PathLike[str]) -> Path:
        """Write the measured and predicted values as comma-separated values, with all digits.

        Raises
        ------
        OutputError
            If the file cannot be written.
        """
        stream = io.StringIO()
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(("run", "sensor", "t", "measured", "predicted", "residual"))
        rows = zip(self.t, self.measured, self.predicted, self.residual, strict=True)
        names = ((s.run, s.sensor) for s in self.sensors for _ in range(s.count))
        writer.writerows((*name, *map(float, row)) for name, row in zip(names, rows, strict=True))
        return write_whole(path, stream.getvalue().encode())


def finite(value: Any) -> Any:
    """Plain data with None for numbers that are not finite."""
    if isinstance(value, dict):
        return {key: finite(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [finite(entry) for entry in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value


def living(fit: Fit, what: str) -> tuple[Estimate, Problem]:
    """The estimate and the problem of a fit that has its runs."""
    if fit.estimate is None or fit.planned is None:
        raise FitError(
            f"a fit from a file has no runs, which {what} needs: fit them again with dmoc.fit."
        )
    return fit.estimate, fit.planned
