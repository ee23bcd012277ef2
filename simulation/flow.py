"""The continuous flow of a model, integrated independently of every discretisation: smooth motion,
contacts, impacts.

:class:`~dmoc.simulation.integrator.Integrator` integrates M q'' = F(q, q', u, t) with the method of
Hairer, Norsett and Wanner of order 8 (DOP853); where a step may meet a surface, the crossing is
located here.  A state is y = (q | v).  Nothing depends on units: tolerances are shares of the sizes
of the motion that is looked at.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from dmoc.base.records import record, value_class
from dmoc.base.tolerances import ROUNDING
from dmoc.codegen.kernels import Array
from dmoc.mechanics.bound_kernels import Index
from dmoc.mechanics.contact_mode import Mode
from dmoc.mechanics.model import Model
from dmoc.simulation.integrator import Integrator
from dmoc.simulation.roots import crossing
from dmoc.simulation.sizes import Sizes

# Gap that the integration's errors leave where it touches, and approach speed below which a contact
# has no impact, as shares of the sizes of gap and rate.
GAP_ERROR, RELEASED = 1e-9, 1e-7
# Ways past an end that count as none, as shares of their size.
END_ERROR = 1e-6
# A surface that may hold a motion is at most so many times GAP_ERROR away.
RESTING = 10
# Where in a step crossings are looked for.
PLACES = np.linspace(0.0, 1.0, 9)
MOST_IMPACTS = 100  # within one step
LOCATED = 1e-14  # share of the final time to which a crossing is located
Bools = NDArray[np.bool_]
FIRST, LAST = np.array([0]), np.array([1])  # the step of a list of one


@value_class(frozen=True)
class SurfaceContact:
    """A contact met by a simulation; ``jump`` is its largest change of a momentum relative to
    the largest momentum."""

    surface: str
    time: float
    jump: float


class Lost(Exception):  # noqa: N818 - it is caught where the simulation began
    """A simulation that cannot go on: states that are not finite, or contacts without end."""


@record(frozen=True, eq=False)
class Steps:
    """Steps of a motion: begin and duration (N,), inputs at both ends (N, nu)."""

    t: Array
    h: Array
    u0: Array
    u1: Array

    def __len__(self) -> int:
        return len(self.t)

    def part(self, which: Index | slice) -> Steps:
        """Some of the steps, by their numbers, shape (n,), or a slice."""
        return Steps(self.t[which], self.h[which], self.u0[which], self.u1[which])

    def inputs(self, share: float) -> Array:
        """Inputs at a share of every step, shape (N, nu)."""
        return np.asarray((1 - share) * self.u0 + share * self.u1)


class Flow:
    """Equations of motion with fixed parameters, for one thread.

    ``restitution`` holds the coefficients of the surfaces (nc,), not a number where the
    law of the model says them; ``allowance(t)`` how far motions
    may enter them at times t, shape (n, nc); ``check_time`` is called now and then and may raise.
    """

    def __init__(
        self, model: Model, sizes: Sizes, restitution: Array, allowance: Callable[[Array], Array],
        check_time: Callable[[], None],
    ) -> None:  # fmt: skip
        self.model, self.sizes, self.restitution = model, sizes, restitution
        self.allowance, self.nq = allowance, model.nq
        size = np.concatenate([sizes.q, sizes.v, [sizes.exchanged]])
        self.integrator = Integrator(model.kernels, model.par, size, check_time)
        near = RESTING * GAP_ERROR * sizes.gap
        self.near = np.where(restitution == 0, near, -1.0)  # none is negative
        self.rests = bool((restitution == 0).any())

    # Surfaces -------------------------------------------------------------------------------------

    def impact(self, q: Array, v: Array, t: float, j: int, e: float) -> tuple[Array, Array, Array]:
        """Velocity after an impact, v - lam M^-1 n with lam = (1 + e) gamma / (n . M^-1 n); the
        impulse lam and the rate gamma before it; not numbers where M is singular. Shapes are (...,
        nq) of positions and velocities, (...) of impulses and rates."""
        slope = self.model.gap_slopes(q, t)[..., j, :]
        n = slope[..., :-1]
        response = self.model.responses(q, n, t)
        rate = (n * v).sum(axis=-1) + slope[..., -1]
        impulse = (1 + e) * rate / (n * response).sum(axis=-1)
        return v - impulse[..., None] * response, impulse, rate

    # Steps ----------------------------------------------------------------------------------------

    def advance(
        self, y: Array, steps: Steps, first: Index, last: Index,
        mode: Mode | None = None, anchors: Array | None = None, coarse: bool = False,
        course: Array | None = None,
    ) -> Array:  # fmt: skip
        """Integrate rows in place, each over some steps in a mode, where what sticks keeps the
        places ``anchors`` (n, nt); return the accelerations (n, 2, nq) at both ends of the last
        ones.  ``coarse`` is quicker and tells neither accelerations nor errors; into ``course``
        (N, 6 nq) go states and accelerations at both ends of all steps."""
        inputs = steps.t, steps.h, steps.u0, steps.u1
        return self.integrator.advance(y, first, last, *inputs, mode, anchors, coarse, course)

    def freely(self, y: Array, steps: Steps, first: int, last: int) -> Array:
        """The state, shape (2 nq,), after some steps without contacts."""
        rows = y[None].copy()
        self.advance(rows, steps, np.array([first]), np.array([last]))
        return np.asarray(rows[0])

    def upper(self, steps: Steps) -> Array:
        """Gaps that no step exceeds without a contact, at its places, shape (N, places, nc)."""
        times = steps.t[:, None] + PLACES * steps.h[:, None]
        allowed = self.allowance(times.ravel()) + GAP_ERROR * self.sizes.gap
        return np.ascontiguousarray(allowed.reshape(*times.shape, self.model.nc))

    def quiet(
        self, y: Array, steps: Steps, upper: Array, first: int, last: int, q_wanted: Array,
        astray: Array,
    ) -> tuple[int, bool]:  # fmt: skip
        """Integrate a state, shape (2 nq,), in place, over steps that meet no surface; return the
        first that might, or ``last``, and whether it has come astray. That is further than
        ``astray``, shape (nq,), from the positions (N + 1, nq) that are expected at the nodes;
        ``upper`` is as in :meth:`upper`."""
        inputs = steps.t, steps.h, steps.u0, steps.u1
        return self.integrator.quiet(
            y, *inputs, first, last, PLACES, upper, self.near, q_wanted, astray
        )

    def meets(
        self, start: Array, ends: Array, stop: Array, steps: Steps, upper: Array
    ) -> NDArray[np.bool_]:
        """Mask (N,) of the steps between states (N, 2 nq), with accelerations (N, 2, nq) at both
        ends, that might meet a surface, or have ends that are not finite. ``upper`` is as in
        :meth:`upper`."""
        return self.integrator.meets(start, ends, stop, steps.t, steps.h, PLACES, upper, self.near)

    def through_contacts(
        self, y: Array, steps: Steps, k: int, contacts: list[SurfaceContact]
    ) -> Array:
        """Integrate a state, shape (2 nq,), over a step, through the contacts that it meets, which
        are added to ``contacts``."""
        t0, nq = float(steps.t[k]), self.nq
        t1 = t0 + float(steps.h[k])

        def inputs(t: float) -> Array:
            share = (t - t0) / (t1 - t0)
            return np.asarray((1 - share) * steps.u0[k] + share * steps.u1[k])[None]

        t = t0
        for _ in range(MOST_IMPACTS):
            u = inputs(t)
            until = _Until(self, y, t, u, inputs, self._resting(y, t, u))
            y1, ends = until(t1)
            if not np.isfinite(y1).all():
                raise Lost
            hit = self._first_hit(until, y1, ends, t1)
            if hit is None:
                return y1
            at, j = hit
            y = until(at)[0] if at > t else y.copy()
            t, q, v = at, y[:nq].copy(), y[nq:].copy()
            e = float(self.model.coefficients(self.restitution, q, v, t)[j])
            after, _, rate = self.impact(q, v, t, j, e)
            if not np.isfinite(after).all():
                raise Lost
            if rate <= 0:  # leaves by itself
                after = v
            contacts.append(
                SurfaceContact(self.model.kernels.surfaces[j], t, self._jump(q, v, after, t))
            )
            y[nq:] = after
            if t1 - t <= ROUNDING * self.sizes.time:
                return y
        raise Lost

    def _jump(self, q: Array, before: Array, after: Array, t: float) -> float:
        p = self.model.momentum(np.array([q, q]), np.array([before, after]), np.full(2, t))
        return float((np.abs(p[1] - p[0]) / self.sizes.p).max())

    def _resting(self, y: Array, t: float, u: Array) -> Mode | None:
        """The mode in which the state goes on: on a plastic surface that it touches without
        approaching it, while the acceleration pushes into it; None for on none."""
        if not self.rests:
            return None
        q, v = y[: self.nq], y[self.nq :]
        near = np.flatnonzero(np.abs(self.model.barriers(q, t)) <= self.near)
        if not len(near):
            return None
        pushed = self.model.gap_slopes(q, t)[:, :-1] @ self.model.acceleration(q, v, u, t)
        pushed += self.model.gap_accelerations(q, v, t)
        rates = self.model.gap_rates(q, v, t)
        for j in map(int, near):
            if abs(rates[j]) < RELEASED * self.sizes.rate[j] and pushed[j] > 0:
                return Mode((j,))
        return None

    def _gaps_there(self, v: Array, path: Array, times: Array) -> tuple[Array, Bools, Array]:
        """Gaps along a way (n, nq) at times (n,) that begins with the velocity v (nq,), and the
        surfaces with ends that it begins beside, behind their gaps, shape (nc,): these are minus
        infinity where the way is not over them. Beside them is what is further past an end than
        the last, shape (nc,)."""
        model, q = self.model, path[0]
        gaps, beside = model.gaps(path, times), np.zeros(model.nc, dtype=bool)
        if not model.ends:
            return gaps, beside, np.zeros(model.nc)
        past = END_ERROR * self.sizes.along(model.within_slopes(path, times))[0]
        behind, error = gaps[0], GAP_ERROR * self.sizes.gap
        within, way = model.within(q, times[0]), model.within_rates(q, v, times[0])
        rates, slow = model.gap_rates(q, v, times[0]), RELEASED * self.sizes.rate
        slips = (within <= past) & (way < 0) & (np.abs(rates) < slow)  # or it would be hit
        near = (behind >= -error) & (rates > -slow)
        beside = ((behind > error) & (within <= past)) | (near & ((within < -past) | slips))
        gaps[:, beside] = model.barriers(path, times, past)[:, beside]
        return gaps, beside, past

    def _is_past(self, until: _Until, j: int, at: float, past: Array) -> bool:
        """Whether a motion is beyond an end of a surface at a time."""
        if j not in self.model.ends:
            return False
        y = until(at)[0] if at > until.t else until.y
        return bool(self.model.within(y[: self.nq], at)[j] < -past[j])

    def _first_hit(
        self, until: _Until, y1: Array, ends: Array, t1: float
    ) -> tuple[float, int] | None:
        """Time and surface of the first crossing until t1; the surface that holds the motion is
        not crossed."""
        t, y = until.t, until.y
        h = np.array([t1 - t])
        times = t + PLACES * h
        path = self.integrator.between(y[None], ends, y1[None], h, PLACES)[:, 0]
        gaps, beside, past = self._gaps_there(y[self.nq :], path, times)
        gaps = gaps - self.allowance(times)
        error, first = GAP_ERROR * self.sizes.gap, None
        beyond = np.flatnonzero((gaps > error).any(axis=0)).tolist()
        if not beyond:
            return None

        def gap(j: int, s: float) -> float:
            return until.gap(j, s, bool(beside[j])) - float(self.allowance(np.array([s]))[0, j])

        for j in beyond:
            # What has entered a surface where it might, and leaves it, is met again only after it
            # has been outside.
            leaving = (
                gaps[0, j] > error[j] and self.model.gap_rates(y[: self.nq], y[self.nq :], t)[j] < 0
            )
            outside = int(np.argmax(gaps[:, j] <= error[j])) if leaving else 0
            over = np.flatnonzero(gaps[:, j] > error[j])
            over = over[over > outside] if leaving else over
            if (
                (until.mode and j in until.mode.closed)
                or not len(over)
                or (leaving and not outside)
            ):
                continue
            k = int(over[0])
            # Starts on the surface: look for the last moment inside.
            if k == 0 or gaps[k - 1, j] >= -error[j]:
                inside = [
                    s
                    for s in np.linspace(times[max(k - 1, 0)], times[k], 17)[1:-1]
                    if k and gap(j, s) < -error[j]
                ]
                # Leaves the admissible set at once: the contact is where the step starts.
                if not inside:
                    at = t if k <= 1 else float(times[k - 1])
                    if self._is_past(until, j, at, past):
                        continue
                    return at, j
                low = float(inside[-1])
            else:
                low = float(times[k - 1])
            high = float(times[k])
            at_low, at_high = gap(j, low), gap(j, high)
            # The path between the nodes was only close.
            if at_low >= 0 or at_high <= 0:
                continue
            at = crossing(
                partial(gap, j), (low, at_low), (high, at_high), LOCATED * self.sizes.time
            )
            if self._is_past(until, j, at, past):
                continue
            if first is None or at < first[0]:
                first = at, j
        return first


@record(frozen=True, eq=False)
class _Until:
    """The motion from a state y at the time t on, in a mode: its state at a later time, and the
    accelerations (1, 2, nq) at both ends."""

    flow: Flow
    y: Array
    t: float
    u: Array  # (1, nu), at the time t
    inputs: Callable[[float], Array]
    mode: Mode | None

    def __call__(self, end: float) -> tuple[Array, Array]:
        y = self.y[None].copy()
        t, h = np.array([self.t]), np.array([end - self.t])
        inputs = self.u, self.inputs(end)
        return y[0], self.flow.integrator.advance(y, FIRST, LAST, t, h, *inputs, self.mode)

    def gap(self, j: int, end: float, beside: bool) -> float:
        """The gap to a surface at a later time; of one that the motion begins beside, minus
        infinity where it still is."""
        if beside:
            return float(self.flow.model.barriers(self(end)[0][: self.flow.nq], end)[j])
        u = self.u[0], self.inputs(end)[0]
        return self.flow.integrator.gap(self.y, self.t, end - self.t, *u, j, self.mode)
