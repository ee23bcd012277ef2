"""The continuous flow within a mode: rows of states side by side, by the method of Hairer, Norsett
and Wanner of order 8 (DOP853).

A row is (q | v) or (q | v | work).  After every part of a step the row is moved back to where the
conditions of the mode hold, so that errors of integration do not open a contact or let it slip.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.errors import SimulationError
from dmoc.mechanics.model import Model
from dmoc.simulation.dormand_prince import ERROR_3, ERROR_5, STAGES, WEIGHTS, Sum
from dmoc.simulation.modes import Mode, Reaction, contact_power, reaction, settled

# Error of a step as a share of the sizes, and the most parts that a step is taken in for it.
ACCURACY, MOST_PARTS = 1e-11, 64
# More parts bring the error down to this share of it at least, or it is one of rounding, which they
# make no smaller: that of the method falls with the eighth power of their number.
FALLING = 0.5


@dataclass(frozen=True)
class Span:
    """Times of rows: begin and duration (n,), inputs at both ends (n, nu), linear in between."""

    t: Array
    h: Array
    u0: Array
    u1: Array

    def inputs(self, share: float) -> Array:
        return np.asarray((1 - share) * self.u0 + share * self.u1)


@dataclass(frozen=True, eq=False)
class ModeFlow:
    """The flow of a model; ``size`` measures a row, ``check_time`` may raise.  A step whose error
    cannot be brought below ``astray`` sizes is refused, ``accuracy`` is what is aimed at."""

    model: Model
    size: Array
    check_time: Callable[[], None]
    astray: float = np.inf
    accuracy: float = ACCURACY

    def advance(self, mode: Mode, y: Array, span: Span, held: Array) -> Array:
        """Rows after a span, from rows on which the mode's conditions hold; ``held`` (n, nt) are
        the tangential positions that are kept."""
        parts, (end, error) = 1, self._in_parts(mode, y, span, held, 1)
        while error > 1 and parts < MOST_PARTS:
            self.check_time()
            more = int(np.ceil(1.1 * parts * error**0.125)) if np.isfinite(error) else 2 * parts
            more = min(max(more, parts + 1), MOST_PARTS)
            finer, less = self._in_parts(mode, y, span, held, more)
            if less > FALLING * error:
                end, error = (finer, less) if less < error else (end, error)
                break
            parts, end, error = more, finer, less
        if error * self.accuracy > self.astray:
            raise SimulationError(
                f"the motion cannot be followed over the step of {float(span.h.max()):.4g} s at "
                f"t = {float(span.t[0]):.6g} s: reduce the step size, or stop before its mass "
                "matrix is singular."
            )
        return end

    def ends(self, mode: Mode, y0: Array, y1: Array, span: Span) -> tuple[Reaction, Reaction]:
        """Accelerations and forces at both ends of a span."""
        nq = self.model.nq
        first, last = (
            reaction(self.model, mode, y[:, :nq], y[:, nq : 2 * nq], u, t)
            for y, u, t in ((y0, span.u0, span.t), (y1, span.u1, span.t + span.h))
        )
        return first, last

    def _in_parts(
        self, mode: Mode, y: Array, span: Span, held: Array, parts: int
    ) -> tuple[Array, float]:
        """Rows after a span taken in equal parts, and the largest error of a part."""
        worst = 0.0
        for k in range(parts):
            y, error = self._part(mode, y, span, k / parts, 1 / parts)
            y = settled(self.model, mode, y, span.t + (k + 1) / parts * span.h, held)
            worst = max(worst, error)
        return y, worst * parts

    def _part(
        self, mode: Mode, y: Array, span: Span, begin: float, share: float
    ) -> tuple[Array, float]:
        """Rows after a share of a span, and the largest estimate of their errors, in shares of
        what is accepted."""
        h = share * span.h[:, None]
        slopes = [self._slope(mode, y, span, begin)]
        for c, terms in STAGES:
            slopes.append(
                self._slope(mode, y + h * _summed(terms, slopes), span, begin + c * share)
            )
        end = y + h * _summed(WEIGHTS, slopes)
        fifth, third = (h * _summed(terms, slopes) / self.size for terms in (ERROR_5, ERROR_3))
        high, low = (np.square(e).mean(axis=1) for e in (fifth, third))
        bottom = np.sqrt(high + 0.01 * low)
        error = np.where(bottom > 0, high / np.where(bottom > 0, bottom, 1.0), 0.0)
        return end, float(error.max(initial=0.0)) / self.accuracy

    def _slope(self, mode: Mode, y: Array, span: Span, share: float) -> Array:
        nq = self.model.nq
        q, v = (np.ascontiguousarray(y[:, k * nq : (k + 1) * nq]) for k in (0, 1))
        u, t = span.inputs(share), span.t + share * span.h
        found = reaction(self.model, mode, q, v, u, t)
        if y.shape[1] == 2 * nq:
            return np.hstack([v, found.acceleration])
        power = self.model.balance(q, v, u, t)[2] + contact_power(self.model, found, q, v, t)
        return np.hstack([v, found.acceleration, power[:, None]])


def _summed(terms: Sum, slopes: list[Array]) -> Array:
    return np.asarray(sum(a * slopes[j] for j, a in terms))
