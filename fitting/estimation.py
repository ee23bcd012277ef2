"""From runs to values: the first fit, standard deviations that nobody says, and what hits near
samples make of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dmoc.base.errors import FitError
from dmoc.base.records import record
from dmoc.codegen.kernels import Array
from dmoc.fitting.experiment import Experiment, Prediction
from dmoc.fitting.identification import Identification, identified, invariant
from dmoc.fitting.noise import MOST_ROUNDS, SETTLED, first_sigma, sigma_left
from dmoc.fitting.parameters import START, Parameter
from dmoc.fitting.regression import HUBER, MOST_ITERATIONS, Regression
from dmoc.fitting.windows import from_windows

# Mean squares of residuals, in standard deviations, up to which a motion fits what is measured.
FITS = 3.0
# Free states that nothing measures begin at the best of these times their sizes, either way.
TRIED = 2.0 ** np.arange(-5, 6)
# Share to which predictions are the same.
ALIKE = 1e-6
# Standard errors of the time of a hit within which a sample may be on either side of it.
EITHER = 3.0


@record(frozen=True, eq=False)
class Estimate:
    """Values of the unknowns, the standard deviations (n,) by which they were found, what the
    models say, derivatives (n, unknowns) of it, and what is determined."""

    regression: Regression
    x: Array
    sigma: Array
    predictions: list[Prediction]
    J: Array
    identification: Identification

    @property
    def residuals(self) -> Array:
        """Measured less predicted, in standard deviations, shape (n,)."""
        predicted = np.concatenate([p.values for p in self.predictions])
        return np.asarray((self.regression.measured - predicted) / self.sigma)


def estimated(regression: Regression) -> Estimate:
    """The estimate of all unknowns.

    Raises
    ------
    FitError
        If there are fewer values than unknowns, or no motion begins where the unknowns do.
    """
    check_enough(regression)
    sigma = first_sigma(regression)
    x, _ = first_fit(regression, sigma)
    x, sigma = _settled(regression, x, sigma)
    predictions = _predictions(regression, x)
    J, near = slopes_and_times(regression, x, predictions, sigma)
    if any(len(times) for times in near):
        x, _ = regression.fitted(x, sigma, near)
        predictions = _predictions(regression, x, near)
    identification = identified(J, regression.parameters, x, pushed(regression))
    x, predictions = _as_stated(regression, (x, predictions), identification, near)
    return Estimate(regression, x, sigma, predictions, J, identification)


def _as_stated(
    regression: Regression, at: tuple[Array, list[Prediction]], known: Identification,
    near: Sequence[Array],
) -> tuple[Array, list[Prediction]]:  # fmt: skip
    """Unknowns moved along directions that nothing depends on to where they are nearest to their
    first values, and the predictions there."""
    x, predictions = at
    low, high = regression.bounds
    for direction in known.nothing:
        part, entries = invariant(direction)
        if not (x[part] * regression.first[part] > 0).all():
            continue
        away = np.log(x[part] / regression.first[part])
        other = x.copy()
        other[part] *= np.exp(-entries * (entries @ away) / (entries @ entries))
        made = (
            regression.predict(other, near)
            if (low <= other).all() and (other <= high).all()
            else None
        )
        values = np.concatenate([p.values for p in predictions])
        if made is not None and np.allclose(
            np.concatenate([p.values for p in made]),
            values,
            rtol=ALIKE,
            atol=ALIKE * np.abs(values).max(),
        ):
            x, predictions = other, made
    return x, predictions


def check_enough(regression: Regression) -> None:
    """Refuse more unknowns than values."""
    count, unknowns = len(regression.measured), len(regression.parameters)
    if count <= unknowns:
        raise FitError(
            f"{count} values are measured and {unknowns} unknowns are fitted "
            f"({', '.join(p.name for p in regression.parameters[:6])}): expected more values than "
            "unknowns; fit fewer, or measure more."
        )


def first_fit(
    regression: Regression, sigma: Array, iterations: int = MOST_ITERATIONS
) -> tuple[Array, float]:
    """Unknowns and cost of a fit of whole runs, from their first values, or where that does not
    lead to what is measured, from windows of the runs."""
    begin = scanned(regression, sigma)
    x, cost = regression.fitted(begin, sigma, None, iterations)
    if not regression.square(x, sigma) <= FITS:
        better = from_windows(regression, begin)
        if better is not None:
            other, less = regression.fitted(better, sigma, None, iterations)
            x, cost = (other, less) if less < cost else (x, cost)
    if not np.isfinite(cost):
        raise FitError(
            "the motion cannot be followed with the first values of "
            f"{', '.join(p.name for p in regression.parameters[:6])}: state values in the problem "
            "that are nearer, or narrower ranges."
        )
    return x, cost


def scanned(regression: Regression, sigma: Array) -> Array:
    """First values of the unknowns: those of starts that no sensor tells are the best of several,
    where events were seen."""
    x = regression.first
    for i, p in enumerate(regression.parameters):
        e = next(e for e in regression.experiments if any(q is p for q in e.parameters))
        if p.kind != START or not e.run.events or p.of.removesuffix("_dot") in e.run.sensors:
            continue
        tried = [x[i], *TRIED * _reach(e, p), *-TRIED * _reach(e, p)]
        inside = [value for value in tried if p.low < value < p.high]
        costs = [regression.cost(_put(x, i, value), sigma) for value in inside]
        x[i] = inside[int(np.argmin(costs))] if inside else x[i]
    return x


def _reach(e: Experiment, p: Parameter) -> float:
    """The size of a free state: how far its coordinate may move, in the time to the first event."""
    name = p.of.removesuffix("_dot")
    far = float(e.problem.reach[e.problem.kernels.coordinates.index(name)])
    first = min(time for _, time in e.run.events) - e.run.begin
    return far / first if name != p.of and first > 0 else far


def _put(x: Array, i: int, value: float) -> Array:
    other = x.copy()
    other[i] = value
    return other


def _settled(regression: Regression, x: Array, sigma: Array) -> tuple[Array, Array]:
    """Unknowns with the standard deviations that they leave."""
    if not np.isnan(regression.given_sigma).any():
        return x, sigma
    for _ in range(MOST_ROUNDS):
        values = np.concatenate([p.values for p in _predictions(regression, x)])
        made = sigma_left(regression, regression.measured - values, sigma)
        ratio = made / sigma
        sigma = made
        alike = np.ptp(ratio) <= SETTLED * ratio.max() and regression.loss == "linear"
        if alike:  # of all by one factor, which changes no unknown
            break
        x, _ = regression.fitted(x, sigma)
        if np.abs(ratio - 1).max() <= SETTLED:
            break
    return x, sigma


def _predictions(
    regression: Regression, x: Array, near: Sequence[Array] | None = None
) -> list[Prediction]:
    made = regression.predict(x, near)
    assert made is not None
    return made


def slopes_and_times(
    regression: Regression, x: Array, predictions: Sequence[Prediction], sigma: Array
) -> tuple[Array, list[Array]]:
    """Derivatives (n, unknowns) of what is predicted in standard deviations, and times within which
    samples may be on either side of the events of each experiment."""
    J, moved = regression.accurate_slopes(x, predictions)
    J /= sigma[:, None]
    J *= np.sqrt(weights(regression, predictions, sigma))[:, None]
    covariance = identified(J, regression.parameters, x, False).covariance
    C, near = np.where(np.isfinite(covariance), covariance, 0.0), list[Array]()
    for slopes, half in zip(moved, regression.spacing, strict=True):
        error = np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", slopes, C, slopes), 0.0))
        near.append(np.maximum(half, EITHER * error))
    return J, near


def weights(regression: Regression, predictions: Sequence[Prediction], sigma: Array) -> Array:
    """Weights of residuals by the loss, shape (n,)."""
    if regression.loss != "huber":
        return np.ones(len(sigma))
    values = np.concatenate([p.values for p in predictions])
    size = np.abs(values - regression.measured) / sigma
    return np.asarray(HUBER / np.maximum(size, HUBER))


def pushed(regression: Regression) -> bool:
    """Whether a force is measured that is not zero, or there is none to be measured."""
    if not regression.experiments[0].problem.nu:
        return True
    return any(np.any(s.u) for e in regression.experiments for s in e.run.inputs.values())
