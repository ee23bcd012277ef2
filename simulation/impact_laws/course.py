"""One impact with friction in the plane, in which Coulomb's law holds all along; how much normal
impulse restitution has, its law says.

Y. Wang and M. T. Mason, Journal of Applied Mechanics 59 (1992) 635-642.  The normal impulse takes
the place of the time; the rates change by (equation :eq:`poisson` of the theory)

    dn = A_nn dP + A_nt dS,    dt = A_nt dP + A_tt dS,    A = D M^-1 D^T

with the directions D = (-grad g, grad tau), dS = -s mu dP while the contact slides with the sign
s of t, and dS = -A_nt / A_tt dP while it sticks, where that is at most mu dP.  Compression ends
where n = 0.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field
from typing import NamedTuple

import numpy as np

from dmoc.base.records import record, value_class
from dmoc.codegen.kernels import Array
from dmoc.motion.friction import STICK, friction_word, sliding_with, sticks

# A tangential rate below this share of what the impact changes it by is none.
STOPPED = 1e-13


class Coefficients(NamedTuple):
    """Of an impact: mu >= 0 of friction, infinite where nothing limits it, 0 <= e <= 1 of
    restitution, and -1 <= e_t <= 1 along the tangent."""

    mu: float
    e: float
    e_t: float = -1.0


@record(frozen=True, eq=False)
class HitState:
    """Rates n and t at some moment of an impact, the impulses P and S until then, and the work W of
    the normal one, the integral of n dP."""

    n: float
    t: float
    P: float
    S: float
    W: float


# The normal impulse that is left to restitution, from e, the end of compression, the state at which
# a state begins, and dn/dP in it.
Restitution = Callable[[float, HitState, HitState, float], float]


@value_class(frozen=True)
class Impulses:
    """Normal impulse P >= 0 and tangential impulse S with |S| <= mu P, and the states of friction
    in compression and in restitution, one after the other."""

    normal: float
    tangential: float
    compression: tuple[int, ...]
    restitution: tuple[int, ...]
    stops: tuple[tuple[float, float], ...] = ()  # both impulses until sliding stops

    @property
    def course(self) -> str:
        """The states in the word of a sequence, as "slip+:stick:late"; empty without an
        impact."""
        said = [friction_word(state) for state in self._states]
        late = len(said) > 1 and len(set(self.compression)) == 1
        return ":".join([*said, "late"] if late else said)

    def slopes(self, response: Array, mu: float) -> tuple[float, ...]:
        """dS/dP in each of its states of friction, for a response A, shape (2, 2)."""
        still = sticking(response, mu)
        return tuple(still if sticks(s) else -s * mu for s in self._states)

    @property
    def _states(self) -> tuple[int, ...]:
        return tuple(dict.fromkeys(self.compression + self.restitution))


def sticking(response: Array, mu: float) -> float:
    """dS/dP of a contact at rest that sticks, or begins to slide, for a response A, shape (2, 2);
    zero where nothing can slide."""
    own = float(response[1, 1])
    return float(np.clip(-response[1, 0] / own, -mu, mu)) if own > 0 else 0.0


# Without an impact.
NONE = Impulses(0.0, 0.0, (), ())


def in_stages(
    rates: Array, response: Array, coefficients: Coefficients, left: Restitution
) -> Impulses:
    """The impulses of an impact from the rates before it, of separation, negative where the bodies
    approach, and of sliding (2,), and the response A (2, 2), symmetric and positive definite
    where nothing else slides."""
    (n, t), mu, e = map(float, rates), coefficients.mu, coefficients.e
    if n >= 0:
        return NONE
    # What slides beside it may make A_nn negative.
    along = float(np.sqrt(abs(response[1, 1] / response[0, 0])))
    small = STOPPED * (abs(t) + abs(n) * along)
    way = _ImpactPath(response, mu, small)
    full, first = way.follow(HitState(n, t, 0.0, 0.0, 0.0), _of_compression)
    if e == 0:
        return Impulses(full.P, full.S, first, (), tuple(way.stops))
    end, second = way.follow(full, lambda at, slope: left(e, full, at, slope))
    return Impulses(end.P, end.S, first, second, tuple(way.stops))


def _of_compression(at: HitState, slope: float) -> float:
    """The normal impulse that is left of compression if a state goes on with dn/dP = ``slope``."""
    return -at.n / slope if slope > 0 else np.inf


@record(frozen=True, eq=False)
class _ImpactPath:
    """The path of an impact through its states of friction, for the response A, shape (2, 2), and
    mu; a tangential rate up to ``small`` counts as none."""

    response: Array
    mu: float
    small: float
    stops: list[tuple[float, float]] = field(default_factory=list)

    def follow(
        self, at: HitState, remaining: Callable[[HitState, float], float]
    ) -> tuple[HitState, tuple[int, ...]]:
        """Go on to the end of compression or of restitution, by the normal impulse that remains of
        it where a state begins with its dn/dP."""
        states: list[int] = []
        while True:
            slope = self._slope(at.t)  # dS/dP
            # as Python's numbers, whose division overflows to infinity in silence
            n_slope, t_slope = (self.response @ np.array([1.0, slope])).tolist()
            left = remaining(at, n_slope)
            stop = -at.t / t_slope if abs(at.t) > self.small and at.t * t_slope < 0 else np.inf
            states.append(self._state(at.t, slope, t_slope))
            dP = min(left, stop)
            # of what sticks, t_slope is a rounding error
            t = 0.0 if stop < left or sticks(states[-1]) else at.t + t_slope * dP
            n = at.n + n_slope * dP
            at = HitState(n, t, at.P + dP, at.S + slope * dP, at.W + dP * (at.n + n) / 2)
            if not stop < left:  # what is not a number ends it too
                return at, tuple(states)
            self.stops.append((at.P, at.S))

    def _slope(self, t: float) -> float:
        """dS/dP at a sliding velocity t; at rest that of a contact that sticks or begins to
        slide."""
        if abs(t) > self.small:
            return -sliding_with(t) * self.mu
        return sticking(self.response, self.mu)

    def _state(self, t: float, slope: float, t_slope: float) -> int:
        at_rest = abs(t) <= self.small
        if at_rest and abs(slope) < self.mu:
            return STICK
        return 1 if (t_slope if at_rest else t) > 0 else -1
