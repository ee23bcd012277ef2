"""All runs together as a problem of least squares: residuals in standard deviations, their
derivatives, and the fit by SciPy's trust region with bounds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from dmoc.base.errors import DmocError
from dmoc.base.records import record
from dmoc.codegen.kernels import Array
from dmoc.fitting.experiment import Experiment, Places, Prediction
from dmoc.fitting.parameters import Parameter

# Changes of unknowns, in sizes, of differences on one side and on both.
CHANGED, CHANGED_BOTH = 1e-7, 1e-5
# A change of what is predicted, as a share of it, that is rounding.
ROUNDED = 1e-12
# Relative changes of cost and unknowns at which a fit ends.
CLOSE = 1e-8
MOST_ITERATIONS = 100
# Residuals, in standard deviations, beyond which Huber's loss grows linearly: 95 % efficient for
# Gaussian noise (P. J. Huber, Annals of Mathematical Statistics 35 (1964) 73-101).
HUBER = 1.345
MEDIAN = 0.6745  # the median of |x| of a standard normal x
LOSSES = ("linear", "huber")
# Half of the time between samples, in which a hit may be on either side of one.
HALF = 0.51


@record(frozen=True, eq=False)
class Regression:
    """Experiments and all unknowns; the loss by which residuals count."""

    experiments: tuple[Experiment, ...]
    parameters: tuple[Parameter, ...]
    loss: str = "linear"

    @cached_property
    def own(self) -> tuple[Places, ...]:
        """The unknowns that each experiment depends on."""
        number = {id(p): k for k, p in enumerate(self.parameters)}
        return tuple(
            np.array([number[id(p)] for p in e.parameters], dtype=np.intp) for e in self.experiments
        )

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        return (
            np.array([p.low for p in self.parameters]),
            np.array([p.high for p in self.parameters]),
        )

    @cached_property
    def sizes(self) -> Array:
        return np.array([p.size for p in self.parameters])

    @property
    def first(self) -> Array:
        """Where the unknowns begin."""
        return np.array([p.first for p in self.parameters])

    @cached_property
    def ends(self) -> Places:
        """Where the values of experiments end among all."""
        return np.cumsum([len(e.measured) for e in self.experiments])

    @property
    def measured(self) -> Array:
        return np.concatenate([e.measured for e in self.experiments])

    @cached_property
    def channels(self) -> Array:
        """The sensor of each value, by its name, shape (n,)."""
        names = [np.repeat(name, s.stop - s.start)
                 for e in self.experiments for name, s in e.slices.items()]  # fmt: skip
        return np.concatenate(names)

    @cached_property
    def given_sigma(self) -> Array:
        return np.concatenate([e.sigma for e in self.experiments])

    @cached_property
    def spacing(self) -> tuple[Array, ...]:
        """Half of the time between samples at any event of each experiment, shape (events,)."""
        apart = []
        for e in self.experiments:
            gaps = [float(np.median(np.diff(s.t))) for s in e.run.sensors.values() if len(s.t) > 1]
            apart.append(np.full(len(e.touch.events), HALF * min(gaps, default=0.0)))
        return tuple(apart)

    def predict(self, x: Array, near: Sequence[Array] | None = None) -> list[Prediction] | None:
        """What the models of all experiments say, each value of the side of an event that fits
        better where it is within times ``near`` of it; None where a motion has no value."""
        near = self.spacing if near is None else near
        made = []
        for e, own, close in zip(self.experiments, self.own, near, strict=True):
            one = _tried(lambda e=e, own=own, close=close: e.predict(x[own], None, close))  # type: ignore[misc]
            if one is None:
                return None
            made.append(one)
        return made

    def slopes(self, x: Array, base: Sequence[Prediction]) -> Array:
        """Derivatives (n, unknowns) of the predicted values, by differences on one side in the
        phases of ``base``."""
        return self._differences(x, base, CHANGED, False)[0]

    def accurate_slopes(self, x: Array, base: Sequence[Prediction]) -> tuple[Array, list[Array]]:
        """The same by differences on both sides, and the derivatives (events, unknowns) of the
        times of events of each experiment."""
        return self._differences(x, base, CHANGED_BOTH, True)

    def _differences(
        self, x: Array, base: Sequence[Prediction], step: float, both: bool
    ) -> tuple[Array, list[Array]]:
        J, begin = np.zeros((int(self.ends[-1]), len(x))), 0
        times = [np.zeros((len(at.course.events), len(x))) for at in base]
        for e, own, at, moved in zip(self.experiments, self.own, base, times, strict=True):
            rows = slice(begin, begin + len(e.measured))
            for k in own.tolist():
                h = step * max(abs(x[k]), self.sizes[k])
                J[rows, k], moved[:, k] = self._difference((e, own, at), x, k, h, both)
            begin = rows.stop
        return J, times

    def _difference(
        self, of: tuple[Experiment, Places, Prediction], x: Array, k: int, h: float, both: bool
    ) -> tuple[Array, Array]:
        """Derivatives of values and times of events by one unknown, by a change of it."""
        e, own, at = of

        def moved(h: float) -> tuple[float, Prediction] | None:
            other = x.copy()
            other[k] += h
            if not self.bounds[0][k] <= other[k] <= self.bounds[1][k]:
                return None
            there = _tried(lambda: e.predict(other[own], at.phases))
            return None if there is None else (float(other[k] - x[k]), there)

        up = moved(h)
        down = moved(-h) if both or up is None else None
        ends = [side for side in (up, down) if side is not None]
        if not ends:
            return np.zeros(len(at.values)), np.zeros(len(at.course.events))
        (last, there), (first, before) = ends[0], ends[1] if len(ends) > 1 else (0.0, at)
        change = there.values - before.values
        if np.abs(change).max() <= ROUNDED * np.abs(at.values).max():
            change = np.zeros(len(change))
        later = there.course.events - before.course.events
        return change / (last - first), later / (last - first)

    # Fits -----------------------------------------------------------------------------------------

    def fitted(
        self, x: Array, sigma: Array, near: Sequence[Array] | None = None,
        iterations: int = MOST_ITERATIONS,
    ) -> tuple[Array, float]:  # fmt: skip
        """Unknowns of the least sum, from where they begin, and half of that sum; ``sigma`` are
        the standard deviations of all values, shape (n,)."""
        measured, seen = self.measured, dict[bytes, list[Prediction] | None]()

        def predicted(x: Array) -> list[Prediction] | None:
            key = x.tobytes()
            if key not in seen:
                seen.clear()
                seen[key] = self.predict(x, near)
            return seen[key]

        def residuals(x: Array) -> Array:
            made = predicted(x)
            if made is None:
                return np.full(len(measured), np.inf)
            return (np.concatenate([p.values for p in made]) - measured) / sigma

        def jacobian(x: Array) -> Array:
            made = predicted(x)
            assert made is not None
            return self.slopes(x, made) / sigma[:, None]

        low, high = self.bounds
        x = np.clip(x, np.nextafter(low, np.inf), np.nextafter(high, -np.inf))
        if predicted(x) is None:
            return x, np.inf
        still = np.ones(len(x), dtype=bool)
        while still.any():  # what nothing depends on stays; at another place it may depend
            moves = (jacobian(x) != 0).any(axis=0)
            if not (moves & still).any():
                break
            still &= ~moves
            x = self._least(x, ~still, (residuals, jacobian), iterations)
        return x, float(self._half_sum(residuals(x)))

    def _least(
        self, x: Array, free: NDArray[np.bool_], functions: tuple[Callable[[Array], Array], ...],
        iterations: int,
    ) -> Array:  # fmt: skip
        """The unknowns of the least sum where only some are free."""
        residuals, jacobian = functions

        def whole(part: Array) -> Array:
            y = x.copy()
            y[free] = part
            return y

        end = least_squares(
            lambda part: residuals(whole(part)), x[free],
            lambda part: jacobian(whole(part))[:, free],
            (self.bounds[0][free], self.bounds[1][free]), x_scale=self.sizes[free], loss=self.loss,
            f_scale=HUBER, ftol=CLOSE, xtol=CLOSE, gtol=1e-12, max_nfev=iterations,
        )  # fmt: skip
        return whole(end.x)

    def cost(self, x: Array, sigma: Array) -> float:
        """Half of the sum at values of the unknowns; infinite where a motion has no value."""
        made = self.predict(x)
        if made is None:
            return np.inf
        return self._half_sum((np.concatenate([p.values for p in made]) - self.measured) / sigma)

    def square(self, x: Array, sigma: Array) -> float:
        """Mean square of the residuals in standard deviations, by their median where outliers count
        little; infinite where a motion has no value."""
        made = self.predict(x)
        if made is None:
            return np.inf
        size = np.abs((np.concatenate([p.values for p in made]) - self.measured) / sigma)
        if self.loss == "huber":
            return float((np.median(size) / MEDIAN) ** 2)
        return float(size @ size / len(size))

    def _half_sum(self, residuals: Array) -> float:
        """The cost of residuals in standard deviations."""
        size = np.abs(residuals)
        if self.loss == "huber":
            far = HUBER * (size - HUBER / 2)
            return float(np.where(size <= HUBER, size**2 / 2, far).sum())
        return float(size @ size / 2)

    def alone(self, i: int) -> Regression:
        """One experiment with its unknowns."""
        e = self.experiments[i]
        return replace(self, experiments=(e,), parameters=e.parameters)


def _tried(predict: Callable[[], Prediction]) -> Prediction | None:
    """A prediction; None where the motion has no value."""
    try:
        with np.errstate(all="ignore"):
            made = predict()
    except (DmocError, np.linalg.LinAlgError, FloatingPointError):
        return None
    return made if np.isfinite(made.values).all() else None
