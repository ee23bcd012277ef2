"""The continuous equations of motion of a model, integrated independently of every discretisation:
flow, contacts, impacts.

SciPy's coefficients of the Dormand-Prince method of order 8 integrate M q'' = F(q, q', u, t), many
states side by side, with as many equal steps as its error estimate asks for.  Nothing depends on
units: tolerances are shares of the sizes of the motion that is looked at.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import DOP853
from scipy.optimize import brentq

from dmoc.codegen.kernels import Array
from dmoc.mechanics.model import Model
from dmoc.simulation.sizes import Sizes
from dmoc.trajectory import Collision

# Error of an integration over a step, as a share of the sizes, far below the discretisation errors
# that are to be seen; most steps in one.
ACCURACY, MOST_STEPS = 1e-11, 64
# Gap that the integration's errors leave where it touches, and approach speed below which a contact
# has no impact, as shares of the sizes of gap and rate.
TOUCH, RELEASED = 1e-9, 1e-7
# Where in a step crossings are looked for.
PLACES = np.linspace(0.0, 1.0, 9)
MOST_IMPACTS = 100  # within one step
A, B, C, E3, E5 = DOP853.A, DOP853.B, DOP853.C, DOP853.E3, DOP853.E5


@dataclass(frozen=True)
class Contact:
    """A contact met by a simulation; ``jump`` is its largest change of a momentum relative to
    the largest momentum."""

    surface: str
    time: float
    jump: float


class Lost(Exception):  # noqa: N818 - it is caught where the simulation began
    """A simulation that cannot go on: states that are not finite, or contacts without end."""


def _accelerated(mass: Array, force: Array) -> Array:
    """M^-1 F; not a number where M is singular."""
    try:
        return np.asarray(np.linalg.solve(mass, force[..., None])[..., 0])
    except np.linalg.LinAlgError:
        return np.full_like(force, np.nan)


class Flow:
    """Equations of motion with fixed parameters.

    ``restitution`` holds the coefficients of the surfaces (nc,); ``allowance(t)`` how far motions
    may enter them at times t, shape (n, nc); ``check_time`` is called in long loops and may raise.
    """

    def __init__(
        self, model: Model, sizes: Sizes, restitution: Array, allowance: Callable[[Array], Array],
        check_time: Callable[[], None],
    ) -> None:  # fmt: skip
        self.model, self.sizes, self.restitution = model, sizes, restitution
        self.allowance, self.check_time = allowance, check_time
        self.nq = model.nq

    # Smooth motion --------------------------------------------------------------------------------

    def acceleration(self, q: Array, v: Array, u: Array, t: ArrayLike) -> Array:
        """M^-1 F for one state or rows of them; not a number where M is singular."""
        return _accelerated(*self.model.equations(q, v, u, t))

    def advance(
        self, q: Array, v: Array, t0: Array, h: Array, u0: Array, u1: Array, held: int | None = None
    ) -> tuple[Array, Array, Array]:
        """Integrate rows of states over one step each, inputs linear from u0 to u1; return q, v
        and the work done."""
        size = np.concatenate([self.sizes.q, self.sizes.v, [self.sizes.energy]])
        start = np.hstack([q, v, np.zeros((len(q), 1))])
        count = 1
        with np.errstate(all="ignore"):
            slope = self._slope(start, t0, u0, held)
            while True:
                self.check_time()
                y, worst = self._integrate(start, slope, (t0, h, u0, u1), count, held, size)
                if not worst > ACCURACY or count >= MOST_STEPS:
                    break
                count = min(MOST_STEPS, 2 * max(count, int(count * (worst / ACCURACY) ** (1 / 8))))
        return y[:, : self.nq].copy(), y[:, self.nq : 2 * self.nq].copy(), y[:, -1]

    def _integrate(
        self,
        y: Array,
        slope: Array,
        step: tuple[Array, Array, Array, Array],
        count: int,
        held: int | None,
        size: Array,
    ) -> tuple[Array, float]:
        """End states after ``count`` equal steps from y with its slope, and the method's error
        estimate relative to the sizes (Hairer, Norsett, Wanner, II.10)."""
        t0, h, u0, u1 = step
        part, worst = h[:, None] / count, 0.0
        for k in range(count):
            stages = np.zeros((len(B) + 1, *y.shape))
            flat = stages.reshape(len(B) + 1, -1)
            stages[0] = slope
            for s in range(1, len(B)):
                share = (k + C[s]) / count
                at = y + part * (A[s, :s] @ flat[:s]).reshape(y.shape)
                stages[s] = self._slope(at, t0 + share * h, (1 - share) * u0 + share * u1, held)
            y = y + part * (B @ flat[:-1]).reshape(y.shape)
            share = (k + 1) / count
            stages[-1] = slope = self._slope(y, t0 + share * h, (1 - share) * u0 + share * u1, held)
            fifth, third = (
                np.abs(part * (e @ flat).reshape(y.shape) / size).max(axis=1) for e in (E5, E3)
            )
            error = fifth**2 / np.sqrt(fifth**2 + 0.01 * third**2 + 1e-300)
            worst = max(worst, float(error.max(initial=0.0)))
        return y, worst

    def _slope(self, y: Array, t: Array, u: Array, held: int | None) -> Array:
        q, v = y[:, : self.nq], y[:, self.nq : 2 * self.nq]
        mass, force, power = self.model.balance(q, v, u, t)
        a = _accelerated(mass, force)
        if held is not None:
            a = np.array(
                [self.on_surface(q[i], v[i], a[i], float(t[i]), held)[0] for i in range(len(q))]
            )
        slope = np.empty_like(y)
        slope[:, : self.nq], slope[:, self.nq : -1], slope[:, -1] = v, a, power
        return slope

    # Surfaces -------------------------------------------------------------------------------------

    def response(self, q: Array, t: float, n: Array) -> Array:
        """M^-1 n."""
        try:
            return np.asarray(np.linalg.solve(self.model.mass(q, t), n))
        except np.linalg.LinAlgError:
            raise Lost from None

    def rate(self, q: Array, v: Array, t: float, j: int) -> float:
        """Rate of a gap."""
        slope = self.model.gap_slopes(q, t)[j]
        return float(slope[: self.nq] @ v + slope[self.nq])

    def impact(self, q: Array, v: Array, t: float, j: int, e: float) -> tuple[Array, float, float]:
        """Velocity after an impact, v - lam M^-1 n with lam = (1 + e) gamma / (n . M^-1 n); the
        impulse lam and the rate gamma before it."""
        *normal, moving = self.model.gap_slopes(q, t)[j]
        n = np.array(normal)
        response = self.response(q, t, n)
        rate = float(n @ v + moving)
        impulse = (1 + e) * rate / float(n @ response)
        return v - impulse * response, impulse, rate

    def planned_impact(
        self, collision: Collision, q: Array, v: Array
    ) -> tuple[Array, float, float]:
        """The law of impact at a planned collision; one that grazes has none."""
        if collision.grazes:
            return v, 0.0, 0.0
        j = self.model.kernels.surfaces.index(collision.surface)
        try:
            return self.impact(q, v, collision.time, j, float(self.restitution[j]))
        except Lost:
            return np.full_like(v, np.nan), np.nan, np.nan

    def on_surface(self, q: Array, v: Array, a: Array, t: float, j: int) -> tuple[Array, float]:
        """The acceleration that keeps the rate of a gap, and the second derivative of the gap
        without the contact."""
        small = 1e-6 * self.sizes.time
        ahead, behind = (self.model.gap_slopes(q + s * v, t + s)[j] for s in (small, -small))
        n = self.model.gap_slopes(q, t)[j, : self.nq]
        turning = (ahead - behind) / (2 * small)
        second = float(n @ a + turning[: self.nq] @ v + turning[self.nq])
        response = self.response(q, t, n)
        return a - second / float(n @ response) * response, second

    # With contacts --------------------------------------------------------------------------------

    def through_contacts(
        self,
        q: Array,
        v: Array,
        span: tuple[float, float],
        u0: Array,
        u1: Array,
        contacts: list[Contact],
    ) -> tuple[Array, Array]:
        """Integrate one state over a step, through the contacts that it meets, which are added
        to ``contacts``."""
        t0, t1 = span

        def inputs(t: float) -> Array:
            share = (t - t0) / (t1 - t0)
            return ((1 - share) * u0 + share * u1)[None]

        t = t0
        for _ in range(MOST_IMPACTS):
            held = self._resting(q, v, t, inputs(t))

            def until(
                end: float, begin: float = t, q: Array = q, v: Array = v, held: int | None = held
            ) -> tuple[Array, Array]:
                span = (np.array([begin]), np.array([end - begin]))
                found = self.advance(q[None], v[None], *span, inputs(begin), inputs(end), held)
                return found[0][0], found[1][0]

            q1, v1 = until(t1)
            if not (np.isfinite(q1).all() and np.isfinite(v1).all()):
                raise Lost
            hit = self._first_hit((q, v), (q1, v1), (t, t1), inputs, until, held)
            if hit is None:
                return q1, v1
            at, j = hit
            q, v = until(at) if at > t else (q, v)
            t = at
            after, _, rate = self.impact(q, v, t, j, float(self.restitution[j]))
            if rate <= 0:  # leaves by itself
                after = v
            contacts.append(Contact(self.model.kernels.surfaces[j], t, self._jump(q, v, after, t)))
            v = after
            if t1 - t <= 1e-12 * self.sizes.time:
                return q, v
        raise Lost

    def _jump(self, q: Array, before: Array, after: Array, t: float) -> float:
        jump = self.model.momentum(q, after, t) - self.model.momentum(q, before, t)
        return float((np.abs(jump) / self.sizes.p).max())

    def _resting(self, q: Array, v: Array, t: float, u: Array) -> int | None:
        """A plastic surface that the state touches without approaching it, while the
        acceleration pushes into it."""
        if not self.model.nc:
            return None
        gaps = self.model.gaps(q, t)
        near = np.flatnonzero(
            (np.abs(gaps) <= 10 * TOUCH * self.sizes.gap) & (self.restitution == 0)
        )
        if not len(near):
            return None
        slopes, a = self.model.gap_slopes(q, t), self.acceleration(q, v, u, t)
        for j in map(int, near):
            rate = slopes[j, : self.nq] @ v + slopes[j, self.nq]
            if abs(rate) < RELEASED * self.sizes.rate[j] and self.on_surface(q, v, a, t, j)[1] > 0:
                return j
        return None

    def _first_hit(
        self,
        start: tuple[Array, Array],
        end: tuple[Array, Array],
        span: tuple[float, float],
        inputs: Callable[[float], Array],
        until: Callable[[float], tuple[Array, Array]],
        held: int | None,
    ) -> tuple[float, int] | None:
        """Time and surface of the first crossing in a step; the surface that holds the motion is
        not crossed."""
        if not self.model.nc:
            return None
        t, t1 = span
        a = [self.acceleration(q, v, inputs(s), s) for (q, v), s in ((start, t), (end, t1))]
        path = quintic(*start, a[0], *end, a[1], t1 - t)
        times = t + PLACES * (t1 - t)
        gaps = self.model.gaps(path(PLACES[:, None]), times) - self.allowance(times)
        touch = TOUCH * self.sizes.gap
        first: tuple[float, int] | None = None

        def gap(s: float, j: int) -> float:
            gaps = self.model.gaps(until(s)[0] if s > t else start[0], s)
            return float(gaps[j] - self.allowance(np.array([s]))[0, j])

        for j in range(gaps.shape[1]):
            # What has entered a surface where it might, and leaves it, is met again only after it
            # has been outside.
            leaving = gaps[0, j] > touch[j] and self.rate(start[0], start[1], t, j) < 0
            outside = (
                int(np.argmax(gaps[:, j] <= touch[j]))
                if leaving and (gaps[:, j] <= touch[j]).any()
                else 0
            )
            over = np.flatnonzero(gaps[:, j] > touch[j])
            over = over[over > outside] if leaving else over
            if j == held or not len(over) or (leaving and not outside):
                continue
            k = int(over[0])
            # Starts on the surface: look for the last moment inside.
            if k == 0 or gaps[k - 1, j] >= -touch[j]:
                inside = [
                    s
                    for s in np.linspace(times[max(k - 1, 0)], times[k], 17)[1:-1]
                    if k and gap(s, j) < -touch[j]
                ]
                # Leaves the admissible set at once: the contact is where the step starts.
                if not inside:
                    return t if k <= 1 else float(times[k - 1]), j
                low = float(inside[-1])
            else:
                low = float(times[k - 1])
            # The path between the nodes was only close.
            if gap(low, j) >= 0 or gap(float(times[k]), j) <= 0:
                continue
            at = float(
                brentq(
                    gap, low, float(times[k]), args=(j,), xtol=1e-14 * self.sizes.time, rtol=1e-14
                )
            )
            if first is None or at < first[0]:
                first = at, j
        return first


def quintic(
    q0: Array, v0: Array, a0: Array, q1: Array, v1: Array, a1: Array, h: Any
) -> Callable[[Any], Array]:
    """The polynomial of degree 5 with given positions, velocities and accelerations at both ends
    of a step, at shares of it."""
    d, s, c = q1 - q0 - h * v0 - h * h / 2 * a0, h * (v1 - v0 - h * a0), h * h * (a1 - a0)
    c3, c4, c5 = 10 * d - 4 * s + c / 2, -15 * d + 7 * s - c, 6 * d - 3 * s + c / 2

    def at(x: Any) -> Array:
        return np.asarray(q0 + x * h * v0 + (x * h) ** 2 / 2 * a0 + x**3 * (c3 + x * (c4 + x * c5)))

    return at
