"""Standard deviations of what is measured, where nobody says them: first from the measured values
alone, then from what a fit leaves."""

from __future__ import annotations

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.fitting.data import Samples
from dmoc.fitting.regression import MEDIAN, Regression

# Fourth differences, which a smooth motion hardly has, and their size for noise of size 1.
DIFFERENCES, OF_NOISE = np.array([1.0, -4.0, 6.0, -4.0, 1.0]), np.sqrt(70.0)
FEWEST = 12  # values of which they say anything
# Share of the range of a sensor below which nothing is taken for its noise; and what is assumed of
# a sensor with few values.
LEAST, ASSUMED = 1e-7, 1e-2
MOST_ROUNDS, SETTLED = 6, 0.02


def first_noise(s: Samples) -> float:
    """The noise of a sensor by the fourth differences of its values."""
    size = float(np.ptp(s.y)) or float(np.abs(s.y).max()) or 1.0
    if len(s.y) < FEWEST:
        return ASSUMED * size
    bent = np.convolve(s.y, DIFFERENCES, mode="valid") / OF_NOISE
    return max(float(np.median(np.abs(bent))) / MEDIAN, LEAST * size)


def assumed_sigma(regression: Regression) -> Array:
    """Standard deviations (n,), those that are not given as shares of the ranges of sensors, and of
    the times of runs."""
    sigma, begin = regression.given_sigma.copy(), 0
    for e in regression.experiments:
        for name, at in e.slices.items():
            rows = slice(begin + at.start, begin + at.stop)
            values = e.measured[at]
            size = float(np.ptp(values)) or float(np.abs(values).max()) or 1.0
            size = e.run.end - e.run.begin if name == "event" else size
            sigma[rows] = np.where(np.isnan(sigma[rows]), ASSUMED * size, sigma[rows])
        begin += len(e.measured)
    return sigma


def first_sigma(regression: Regression) -> Array:
    """Standard deviations (n,), those that are not given by the measured values alone."""
    sigma = regression.given_sigma.copy()
    estimates: dict[str, list[float]] = {}
    for e in regression.experiments:
        for name, s in e.run.sensors.items():
            noise = ASSUMED * float(np.std(s.y)) if e.run.before else first_noise(s)
            estimates.setdefault(name, []).append(noise or ASSUMED)
        if e.run.events:
            estimates.setdefault("event", []).append(1e-3 * (e.run.end - e.run.begin))
    for name, values in estimates.items():
        open_ = (regression.channels == name) & np.isnan(sigma)
        sigma[open_] = float(np.median(values))
    return sigma


def sigma_left(regression: Regression, residual: Array, sigma: Array) -> Array:
    """Standard deviations (n,), those that are not given by what is left of each sensor; by its
    median where outliers may be among it.  Unknowns take their share."""
    open_, made = np.isnan(regression.given_sigma), sigma.copy()
    n = len(residual)
    share = max(1.0 - len(regression.parameters) / max(n, 1), 1.0 / max(n, 1))
    for name in dict.fromkeys(regression.channels.tolist()):
        at = (regression.channels == name) & open_
        if not at.any():
            continue
        left = residual[at]
        size = float(np.ptp(regression.measured[at])) or float(
            np.abs(regression.measured[at]).max()
        )
        if regression.loss == "huber":
            rms = float(np.median(np.abs(left))) / MEDIAN
        else:
            rms = float(np.sqrt(np.mean(left**2) / share))
        made[at] = max(rms, 1e-12 * (size or 1.0))
    return made
