"""The course of an impact on contacts that are touched at once, with friction (equation
:eq:`impact-course` of the theory).

What is hit is compressed in one proportion: while the share tau of the compression passes, the rate
n of each gap that is approached stays below (1 - tau) n(0), that of any other touched gap below
zero.  Who has the rate of its bound may push, who lies below it does not; friction obeys Coulomb's
law all along, in the direction in which the contact slides at that moment.  So no contact pulls,
and a plastic impact gains no energy: n dP >= 0 and sigma dT <= 0 in each of its parts.

In restitution the bounds of what is released fall on, until its impulse is 1 + e times that of
compression.  Of one contact by itself this is Poisson's law.

Between two moments at which a contact begins or ceases to push, to stick or to slide, all rates and
impulses change in proportion.  Where sliding jams, pressing the bodies together harder and harder,
the compression goes backwards until the sliding stops.  A touched contact that is not approached,
and jams, has the impact of one that is approached ever more slowly: by itself, before the others.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from dmoc.base.records import record
from dmoc.base.tolerances import ROUNDING, SAME
from dmoc.codegen.kernels import Array
from dmoc.mechanics.algebra import solved_transpose
from dmoc.mechanics.conditions import answers, conditions_of, sizes_by_mass
from dmoc.mechanics.contact_mode import Mode
from dmoc.mechanics.model import Model
from dmoc.motion.friction import sliding_against
from dmoc.simulation.contact_modes import Reaction, borne, nearest
from dmoc.simulation.mode_choice import Hints, Place, first_mode, is_borne

# Parts of one impact: each ends where a contact changes its state.
MOST_PARTS = 200


@record(frozen=True, eq=False)
class Blow:
    """Velocity after an impact (nq,), and the impulses of surfaces (nc,) and tangents (nt,)."""

    velocity: Array
    normal: Array
    tangential: Array


def blow_on(model: Model, at: Place, on: list[int], e: Array) -> Blow | None:
    """The impact on touched surfaces with coefficients of restitution (nc,); None where some part
    of it has no state of contact and friction that obeys the laws."""
    course = _Course.of(model, at, on)
    whole = np.zeros(model.nc)
    if not course.follow(whole):
        return None
    released = np.flatnonzero((course.approach > 0) & (e > 0) & (course.normal > 0))
    whole[released] = (1 + e[released]) * course.normal[released]
    course.falling[released] = course.approach[released]
    if not course.follow(whole):
        return None
    if len(released):
        return Blow(course.velocity, course.normal, course.tangential)
    return course.stopped


@record(frozen=True, eq=False)
class _Part:
    """Changes while a unit of compression passes, of the velocity (nq,), the impulses of surfaces
    (nc,) and tangents (nt,), and the bounds (nc,); and the mode."""

    mode: Mode
    velocity: Array
    normal: Array
    tangential: Array
    bounds: Array


@dataclass(eq=False)
class _Course:
    """An impact on its way."""

    model: Model  # with the friction that acts in it
    at: Place
    on: list[int]
    M: Array  # (1, nq, nq)
    normals: Array  # gradients of gaps (nc, nq) and of tangential positions (nt, nq)
    along: Array
    across: Array  # their sizes by the masses, (nc,) and (nt,)
    aside: Array
    approach: Array  # rates of the gaps that are hit, (nc,)
    velocity: Array
    normal: Array
    tangential: Array
    bounds: Array  # of the rates, and how they fall (nc,)
    falling: Array

    @classmethod
    def of(cls, model: Model, at: Place, on: list[int]) -> _Course:
        q, v, t = at.y[None, : model.nq], at.y[model.nq : 2 * model.nq], np.array([at.t])
        rates, touched = model.gap_rates(q[0], v, at.t), np.isin(np.arange(model.nc), on)
        approach = np.where(touched & (rates > at.small.rate), rates, 0.0)
        M, model = model.mass(q, t), model.in_impact_at(q, t)
        slopes = [
            s[:, :-1] for s in (model.gap_slopes(q[0], at.t), model.tangent_slopes(q[0], at.t))
        ]
        sizes = (np.einsum("ji,ij->j", s, solved_transpose(M, s[None])[0]) for s in slopes)
        across, aside = (np.sqrt(np.where(size > 0, size, 1.0)) for size in sizes)
        return cls(
            model, at, on, M, slopes[0], slopes[1], across, aside, approach, v.copy(),
            np.zeros(model.nc), np.zeros(model.nt), approach.copy(), approach.copy(),
        )  # fmt: skip

    @property
    def stopped(self) -> Blow:
        """The result of an impact on plastic contacts, with the smallest of the impulses that have
        the same effect if those are borne: no restitution says how contacts share them."""
        held = self._whole
        own = Reaction(
            (self.velocity - self.at.y[self.model.nq : 2 * self.model.nq])[None],
            self.normal[None], self.tangential[None], np.zeros((1, self.model.nj)),
        )  # fmt: skip
        none = np.zeros((1, len(held.closed) + len(held.sticking)))
        shared = nearest(self.model, held, own, *self.moment, none)
        shared = borne(self.model, held, shared, *self.moment)
        least = SAME * self._size(own.acceleration[0])
        impulses = shared.normal[0], shared.tangential[0]
        if not is_borne(self.model, held, impulses, least / self.across, least / self.aside):
            impulses = self.normal, self.tangential
        return Blow(self.velocity, *impulses)

    @property
    def _whole(self) -> Mode:
        """The mode of the whole impact: contacts with an impulse, and their friction. A tangent
        slides whose friction has all along been the largest in one direction, others stick."""
        closed = [j for j in self.on if self.normal[j] > 0]
        most = self.model.dragging(self.normal)
        rubbing = {}
        for k in (self.model.rough[j] for j in closed if j in self.model.rough):
            slid = abs(self.tangential[k]) >= (1 - SAME) * most[k]
            rubbing[k] = sliding_against(self.tangential[k] if slid else 0.0)
        return Mode.of(closed, rubbing)

    @property
    def moment(self) -> tuple[Array, Array]:
        """Position and time, as rows."""
        return self.at.y[None, : self.model.nq], np.array([self.at.t])

    @property
    def rates(self) -> tuple[Array, Array]:
        """Rates of the gaps and sliding velocities, shapes (nc,) and (nt,)."""
        (q, t), v = self.moment, self.velocity[None]
        return self.model.gap_rates(q, v, t)[0], self.model.slide_rates(q, v, t)[0]

    def follow(self, whole: Array) -> bool:
        """Go on until every bound that falls is zero; of a contact that has a ``whole`` impulse,
        shape (nc,), until it has that. Return whether the impact has an end."""
        for _ in range(MOST_PARTS):
            if not self.falling.any():
                return True
            part = self._next()
            if part is None:
                if not self._jams():
                    return False
                continue
            lengths = [s for s in self._ends(part, whole) if s >= 0]
            if not lengths:
                return False
            s = min(lengths)
            self.velocity = self.velocity + s * part.velocity
            self.normal, self.tangential = (
                self.normal + s * part.normal,
                self.tangential + s * part.tangential,
            )
            self.bounds = self.bounds + s * part.bounds
            compressed = (whole == 0) & (self.bounds <= ROUNDING * self.approach)
            released = (whole > 0) & (self.normal >= (1 - ROUNDING) * whole)
            done = (self.falling > 0) & (compressed | released)
            self.bounds[done], self.falling[done] = 0.0, 0.0
        return False

    def _jams(self) -> bool:
        """Have touched contacts that are not approached, but jam as they slide, take an impact of
        their own, as one does that is approached ever more slowly; return whether it is one."""
        resting = [j for j in self.on if not self.falling[j] and self._meets(j)]
        size = np.where(np.isin(np.arange(self.model.nc), resting), self.approach.max(), 0.0)
        bounds = np.where(size > 0, 0.0, np.inf)
        own = replace(self, approach=size, bounds=bounds, falling=size.copy())
        ended = own.follow(np.zeros(self.model.nc))
        moved = bool((own.velocity != self.velocity).any())
        self.velocity, self.normal, self.tangential = own.velocity, own.normal, own.tangential
        fall = self.falling > 0
        reached = np.append(self.rates[0][fall], self.bounds[fall]) / np.tile(self.falling[fall], 2)
        self.bounds[fall] = reached.max() * self.falling[fall]
        return ended and moved

    def _meets(self, j: int) -> bool:
        """Whether a touched gap has the rate of its bound."""
        return bool(self.rates[0][j] >= self.bounds[j] - self.at.small.rate[j])

    def _ends(self, part: _Part, whole: Array) -> Iterator[float]:
        """Amounts of compression after which something ends a part; ``whole`` has the shape
        (nc,)."""
        rates, slides = self.rates
        for j in np.flatnonzero(self.falling).tolist():
            if whole[j] > 0:
                if part.normal[j] > 0:
                    yield float((whole[j] - self.normal[j]) / part.normal[j])
            elif part.bounds[j] < 0:
                yield float(-self.bounds[j] / part.bounds[j])
        held = conditions_of(self.model, part.mode)
        forward = held.forward(slides)
        for k, faster in held.forward(self.along @ part.velocity).items():
            if faster < 0 and forward[k] > self.at.small.slide[k]:
                yield float(-forward[k] / faster)
        for j in self.on:
            below = self.bounds[j] - rates[j]
            closer = float(self.normals[j] @ part.velocity - part.bounds[j])
            if j not in part.mode.closed and closer > 0 and below > self.at.small.rate[j]:
                yield float(below / closer)

    def _next(self) -> _Part | None:
        """The part that begins, in which compression goes on or, where sliding jams, backwards;
        None where no state of contact and friction obeys the laws."""
        slides, meeting = self.rates[1], [j for j in self.on if self._meets(j)]
        parts: dict[Mode, _Part] = {}
        for sense in (1.0, -1.0):

            def holds(mode: Mode, opened: tuple[int, ...], sense: float = sense) -> bool:
                part = self._part(mode, sense)
                if part is None or not self._lawful(part, list(opened), slides):
                    return False
                parts[mode] = part
                return sense > 0 or bool(part.normal[self.falling > 0].sum() > 0)

            small = self.at.small.slide
            mode = first_mode(self.model, meeting, slides, small, Hints(), holds, rails=False)
            if mode is not None:
                return parts[mode]
        return None

    def _part(self, mode: Mode, sense: float) -> _Part | None:
        """A part in a mode; None if its conditions contradict each other."""
        held, bounds = conditions_of(self.model, mode), -sense * self.falling
        C = held.slopes(self.model, *self.moment)[..., :-1]
        wanted = np.zeros((1, len(held)))
        wanted[0, : len(mode.closed)] = bounds[list(mode.closed)]
        change, lam = answers(self.M, C, held.pushes(self.model, *self.moment, C), wanted)
        off, size = (C @ change[..., None])[..., 0] - wanted, self._size(change[0])
        if not (np.abs(off) <= SAME * size * sizes_by_mass(self.M, C)).all():
            return None
        reaction = Reaction(change, *held.spread(self.model, lam))
        reaction = borne(self.model, mode, reaction, *self.moment)
        return _Part(mode, change[0], reaction.normal[0], reaction.tangential[0], bounds)

    def _size(self, velocity: Array) -> float:
        """Size of a velocity, shape (nq,), by the masses."""
        return float(np.sqrt(velocity @ self.M[0] @ velocity))

    def _lawful(self, part: _Part, opened: list[int], slides: Array) -> bool:
        """Whether no contact pulls, what sticks is held, and what opens or begins to slide does."""
        least = SAME * self._size(part.velocity)
        closer, faster = self.normals @ part.velocity - part.bounds, self.along @ part.velocity
        return (
            is_borne(
                self.model, part.mode, (part.normal, part.tangential), least / self.across,
                least / self.aside,
            )
            and bool((closer[opened] <= least * self.across[opened]).all())
            and all(
                rate >= -least * self.aside[k]
                for k, rate in conditions_of(self.model, part.mode).forward(faster).items()
                if abs(slides[k]) <= self.at.small.slide[k]
            )
        )  # fmt: skip
