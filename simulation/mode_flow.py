"""The continuous flow of one mode from a place on, and where the mode ends: what it keeps above
zero falls below, or a joint moves what it holds fast."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dmoc.base.errors import SimulationError
from dmoc.base.records import record
from dmoc.codegen.kernels import Array
from dmoc.mechanics.contact_mode import Mode
from dmoc.simulation.contact_modes import limit_by_motion, limits, slack
from dmoc.simulation.friction_at import with_friction
from dmoc.simulation.mode_choice import Place, Setting, there
from dmoc.simulation.roots import crossing

# Where in a way limits are looked at, and, where one falls at once, how near to its start.
PLACES, NEAR = np.linspace(0.0, 1.0, 9)[1:], 0.5 ** np.arange(50, 0, -1)
LOCATED = 1e-12  # of a step, to which events are located
# Error of a step, in sizes, that shows that it is too long to be followed.
ASTRAY = 1e-6


@dataclass(frozen=True)
class ModeEnd:
    """When a mode ends, and which of its limits is passed there; None where its conditions
    contradict one another from then on, and ``broken`` is a time at which they do."""

    time: float
    limit: int | None
    broken: float


@record(frozen=True, eq=False)
class ModeFlow:
    """The motion in one mode from a place on."""

    setting: Setting
    place: Place
    mode: Mode

    @cached_property
    def anchors(self) -> Array:
        """Tangential positions (1, nt) at the place, which what sticks keeps."""
        model, at = self.setting.model, self.place
        return model.tangents(at.y[None, : model.nq], np.array([at.t]))

    @cached_property
    def sizes(self) -> Array:
        """Sizes of the rows that are integrated, and of their energy, shape (2 nq + 1,)."""
        return np.append(self.place.small.size, 1.0)

    @cached_property
    def past(self) -> Array | None:
        """The W up to which surfaces are not there, shape (nc,): of those with ends that the place
        is beside, behind their gaps, what is zero, and none of others."""
        model, at, nq = self.setting.model, self.place, self.setting.model.nq
        if not model.ends:
            return None
        q, v = at.y[:nq], at.y[nq : 2 * nq]
        gaps, rates = model.gaps(q, at.t), model.gap_rates(q, v, at.t)
        near = (gaps >= -at.small.gap) & (rates >= -at.small.rate)
        beside = ((gaps > at.small.gap) | near) & ~there(model, at)
        return np.where(beside, at.small.within, -np.inf)

    def until(self, end: float) -> tuple[Array, ModeEnd | None]:
        """The state at a time, and where the mode ends before it, if it does."""
        rows = self.rows(self.place.t + PLACES * (end - self.place.t))
        return rows[-1], self._first(end, rows)

    def state(self, t: float) -> Array:
        """The state at a time, not before that of the place, shape (2 nq,)."""
        return self.rows(np.array([t]))[0] if t > self.place.t else self.place.y

    def rows(self, times: Array) -> Array:
        """States, shape (n, 2 nq), at later times, shape (n,)."""
        n, integrator, at = len(times), self.setting.integrator, self.place
        y, u, anchors = (_repeated(row, n) for row in (at.y, at.u, self.anchors[0]))
        number, t = np.arange(n), _repeated(at.t, n)
        integrator.sizes = self.sizes
        integrator.advance(y, number, number + 1, t, times - t, u, u, self.mode, anchors)
        if integrator.worst > ASTRAY:
            raise SimulationError(
                f"the motion cannot be followed over the step of {times[-1] - at.t:.4g} s at "
                f"t = {at.t:.6g} s: reduce the step size, or stop before its mass matrix is "
                "singular, or what it lies on has a kink."
            )
        if not np.isfinite(y).all():
            raise SimulationError(
                f"the motion cannot be followed from t = {at.t:.6g} s on: its mass matrix "
                "is singular, or its forces are not finite there; stop before it."
            )
        return y

    def _limits(self, rows: Array, times: Array) -> Array:
        """The limits of the mode at states at later times."""
        setting = self.setting
        u = np.repeat(self.place.u[None], len(times), axis=0)
        with_friction(setting.model, rows, u, times, self.mode.closed)
        react = setting.integrator.reaction
        return limits(setting.model, react, self.mode, (rows, u, times), self.past)

    def _limit(self, j: int, at: Array) -> float:
        """One of the limits at a later time, shape (1,); by itself where no force has a part in
        it."""
        model, rows = self.setting.model, self.rows(at)
        if not (model.varying_friction or model.gripped or self.past is not None):
            q, v = np.split(rows, 2, axis=1)
            alone = limit_by_motion(model, self.mode, j, (q, v, at))
            if alone is not None:
                return alone
        return float(self._limits(rows, at)[0, j])

    def _first(self, end: float, rows: Array) -> ModeEnd | None:
        """Where a limit is passed first, None if there is none until the end.  ``rows`` are the
        states at the places on the way there."""
        t, least = self.place.t, -slack(self.setting.model, self.mode, self.place.small)
        times = t + PLACES * (end - t)
        kept = self._limits(rows, times)
        over = ~(kept >= least)
        if not over.any():
            return None
        row = int(np.argmax(over.any(axis=1)))
        if row == 0:  # from the start on, or soon after it
            times = t + NEAR * (times[0] - t)
            times, kept = (
                np.append(times, t + PLACES[0] * (end - t)),
                np.vstack([self._limits(self.rows(times), times), kept[:1]]),
            )
            over = ~(kept >= least)
            row = int(np.argmax(over.any(axis=1)))
        if np.isnan(kept[row]).any():
            broken = self._contradiction(float(times[row - 1]) if row else t, float(times[row]))
            times[row] = broken.time
            kept[row] = self._limits(self.state(broken.time)[None], times[row, None])[0]
            over[row] = kept[row] < least
            if not over[row].any():
                return broken
        passed = np.flatnonzero(over[row])
        at, j = min(self._moment(int(j), (times, kept), row) for j in passed)
        return ModeEnd(at, j, at)

    def _contradiction(self, low: float, high: float) -> ModeEnd:
        """When the conditions of the mode, which hold at one time, contradict one another."""
        near = self._located(high)
        while high - low > near and low < (middle := low + (high - low) / 2) < high:
            at = np.array([middle])
            if np.isnan(self._limits(self.rows(at), at)).any():
                high = middle
            else:
                low = middle
        return ModeEnd(low, None, high)

    def _located(self, t: float) -> float:
        """The time within which events about a time are located, in seconds."""
        return max(LOCATED * self.setting.h, 4 * float(np.finfo(float).eps) * abs(t))

    def _moment(self, j: int, seen: tuple[Array, Array], row: int) -> tuple[float, int]:
        """When a limit is passed that holds in the rows before, and not in this one."""
        times, kept = seen
        inside = np.flatnonzero(kept[:row, j] > 0)
        if not len(inside):
            return float(times[row - 1]) if row else self.place.t, j
        low, high = int(inside[-1]), row

        def limit(time: float) -> float:
            return self._limit(j, np.array([time]))

        ends = [(float(times[k]), float(kept[k, j])) for k in (low, high)]
        return crossing(limit, ends[0], ends[1], self._located(ends[1][0])), j


def _repeated(row: Array | float, n: int) -> Array:
    """So many rows of the same numbers."""
    rows = np.empty((n, *np.shape(row)))
    rows[...] = row
    return rows
