"""What a statistician looks at: whether residuals are independent and normal, what correlation
makes of standard errors, and what single runs decide."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy import stats

from dmoc.base.records import record
from dmoc.codegen.kernels import Array
from dmoc.fitting.estimation import Estimate
from dmoc.fitting.identification import identified

# Values of a sensor from which on tests say anything.
ENOUGH = 20
# Root mean square, in standard deviations, of residuals that are none: the noise is said too large.
BELOW = 0.1
# Probability of a test below which it is told.
UNLIKELY = 1e-3
LEVEL = 0.95  # of intervals


@record(frozen=True, eq=False)
class SensorResiduals:
    """Residuals of one sensor in one run: their number, root mean square in standard deviations,
    and probabilities of as many runs of signs and of such a distribution, were they independent and
    normal; not a number of too few."""

    run: str
    sensor: str
    count: int
    rms: float
    runs_test: float
    normality: float


def sensor_residuals(estimate: Estimate) -> Iterator[SensorResiduals]:
    """Each sensor of each run."""
    left, begin = estimate.residuals, 0
    for e in estimate.regression.experiments:
        for name, at in e.slices.items():
            own = left[begin + at.start : begin + at.stop]
            rms = float(np.sqrt(np.mean(own**2)))
            several = len(own) >= ENOUGH and rms > BELOW
            yield SensorResiduals(
                e.run.name, name, len(own), rms,
                runs_test(own) if several else np.nan,
                float(stats.normaltest(own).pvalue) if several and np.ptp(own) else np.nan,
            )  # fmt: skip
        begin += len(e.measured)


def runs_test(values: Array) -> float:
    """Probability of so few or so many runs of signs of independent values [1]_.

    References
    ----------
    .. [1] A. Wald, J. Wolfowitz, Annals of Mathematical Statistics 11 (1940) 147-162.
    """
    up = values > np.median(values)
    n, m = int(up.sum()), int((~up).sum())
    if not n or not m:
        return np.nan
    runs = 1 + int((up[1:] != up[:-1]).sum())
    mean = 2 * n * m / (n + m) + 1
    variance = (mean - 1) * (mean - 2) / (n + m - 1)
    return float(2 * stats.norm.sf(abs(runs - mean) / np.sqrt(variance)))


def sandwich(estimate: Estimate) -> Array:
    """The covariance of correlated residuals (unknowns, unknowns): H^-1 S H^-1 with the sum S of
    the products of scores of one sensor in one run, weighted by W. Newey and K. West, Econometrica
    55 (1987) 703-708, up to the lag at which the residuals' correlation ends."""
    J, left = estimate.J, -estimate.residuals
    bread, begin = estimate.identification.covariance, 0
    bread = np.where(np.isfinite(bread), bread, 0.0)
    S = np.zeros_like(bread)
    for e in estimate.regression.experiments:
        for at in e.slices.values():
            rows = slice(begin + at.start, begin + at.stop)
            score = J[rows] * left[rows, None]
            S += score.T @ score
            most = _memory(left[rows])
            for lag in range(1, most + 1):
                pair = score[lag:].T @ score[:-lag]
                S += (1 - lag / (most + 1)) * (pair + pair.T)
        begin += len(e.measured)
    made = bread @ S @ bread
    return np.where(np.isfinite(estimate.identification.covariance), made, np.inf)


def _memory(values: Array) -> int:
    """Lag up to which values are correlated, at most a quarter of them."""
    x = values - values.mean()
    power = float(x @ x)
    for lag in range(1, len(x) // 4):
        if abs(float(x[lag:] @ x[:-lag])) < 2 / np.sqrt(len(x)) * power:
            return 2 * lag
    return len(x) // 4


def influences(estimate: Estimate) -> dict[str, float]:
    """By how many standard errors the unknown that moves most would move without a run, to first
    order; of those that are the same in all runs."""
    regression, J = estimate.regression, estimate.J
    shared = np.array([p.run is None for p in regression.parameters])
    if len(regression.experiments) < 2 or not shared.any():
        return {}
    covariance = estimate.identification.covariance
    error = np.sqrt(np.diag(covariance))
    shared &= np.isfinite(error) & (error > 0)
    made, begin, left = {}, 0, estimate.residuals
    for e in regression.experiments:
        rows = np.ones(len(left), dtype=bool)
        rows[begin : begin + len(e.measured)] = False
        rest = identified(J[rows], regression.parameters, estimate.x, False).covariance
        rest = np.where(np.isfinite(rest), rest, 0.0)
        moved = rest @ (J[rows].T @ left[rows])
        made[e.run.name] = float(np.abs(moved[shared] / error[shared]).max(initial=0.0))
        begin += len(e.measured)
    return made


def quantile(freedom: int) -> float:
    """Half of the interval in standard errors."""
    return float(stats.t.ppf((1 + LEVEL) / 2, max(freedom, 1)))
