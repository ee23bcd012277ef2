"""The least sum of squares over one unknown."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2

from dmoc.base.arguments import whole
from dmoc.base.errors import FitError
from dmoc.base.table import Shown, Table
from dmoc.codegen.kernels import Array
from dmoc.fitting.result import Fit, living
from dmoc.fitting.statistics import LEVEL

WIDE = 3.0  # standard errors on both sides
MOST_POINTS = 1000


@dataclass(frozen=True, eq=False)
class Profile(Shown):
    """The least sum of squares over one unknown; made by :meth:`Fit.profile`.

    Attributes
    ----------
    name : str
    values : array of shape (n,)
    chi2 : array of shape (n,)
        Least sum of squares of the residuals, in standard deviations, above that of the fit.
    low, high : float
        Where it is 3.84, the interval of 95 %; a bound, or infinite, where it does not come so
        high.
    """

    name: str
    values: Array
    chi2: Array
    low: float
    high: float

    def __repr__(self) -> str:
        return f"<Profile of {self.name}: {self.low:.6g} to {self.high:.6g}>"

    def summary(self) -> Table:
        """What ``print`` and notebooks show."""
        rows = [(f"{x:.6g}", f"{c:.3g}") for x, c in zip(self.values, self.chi2, strict=True)]
        note = f"95 %: {self.low:.6g} to {self.high:.6g}"
        return Table(tuple(rows), (self.name, "chi2 more"), (note,))


def profile_of(fit: Fit, name: str, points: int) -> Profile:
    """The profile of one unknown."""
    count = whole(points, "points", 3, MOST_POINTS, FitError)
    estimate, _ = living(fit, "a profile")
    regression = estimate.regression
    k = [p.name for p in regression.parameters].index(name)
    p, error = regression.parameters[k], fit.errors[name]
    half = WIDE * error if np.isfinite(error) else p.size
    grid = np.linspace(max(estimate.x[k] - half, p.low), min(estimate.x[k] + half, p.high), count)
    middle = int(np.argmin(np.abs(grid - estimate.x[k])))
    least, costs = _cost(fit, k, float(estimate.x[k]), estimate.x)[0], np.empty(count)
    for way in (range(middle, count), range(middle - 1, -1, -1)):
        x = estimate.x
        for i in way:
            costs[i], x = _cost(fit, k, float(grid[i]), x)
    more = np.maximum(costs - least, 0.0)
    level = float(chi2.ppf(LEVEL, 1))
    ends = [x if x == bound else far for x, bound, far in
            ((grid[0], p.low, -np.inf), (grid[-1], p.high, np.inf))]  # fmt: skip
    low = _where(grid[: middle + 1][::-1], more[: middle + 1][::-1], level, ends[0])
    return Profile(name, grid, more, low, _where(grid[middle:], more[middle:], level, ends[1]))


def _cost(fit: Fit, k: int, value: float, x: Array) -> tuple[float, Array]:
    """Twice the least cost with one unknown at a value, and the unknowns there."""
    estimate, _ = living(fit, "a profile")
    regression, p = estimate.regression, estimate.regression.parameters[k]
    near = 1e-10 * max(abs(value), p.size)
    kept = replace(p, low=value - near, high=value + near, first=value)
    others = {id(p): kept}
    experiments = tuple(
        replace(e, parameters=tuple(others.get(id(q), q) for q in e.parameters))
        for e in regression.experiments
    )
    parameters = tuple(others.get(id(q), q) for q in regression.parameters)
    begin = x.copy()
    begin[k] = value
    at, cost = replace(regression, experiments=experiments, parameters=parameters).fitted(
        begin, estimate.sigma
    )
    return 2 * cost, at


def _where(values: Array, more: Array, level: float, none: float) -> float:
    """Where the sum first comes to a level, by the square root of it; ``none`` if it does not."""
    over = np.flatnonzero(more >= level)
    if not len(over) or not over[0]:
        return none
    i = int(over[0])
    a, b = np.sqrt(more[i - 1]), np.sqrt(more[i])
    return float(values[i - 1] + (np.sqrt(level) - a) / (b - a) * (values[i] - values[i - 1]))
