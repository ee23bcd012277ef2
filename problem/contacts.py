"""What touches in the phases of a problem, and what follows of it; points of surfaces."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.mechanics.contact_mode import FREE
from dmoc.mechanics.contacts import NOWHERE
from dmoc.mechanics.model_values import restitution_row
from dmoc.mechanics.possible_words import open_hits
from dmoc.mechanics.projection import onto, onto_gap
from dmoc.mechanics.redundancy import Redundancy, redundancy
from dmoc.mechanics.sequence_words import mode_of, touch_along, words_along
from dmoc.mechanics.touch import Touch
from dmoc.problem.reach import latest_time

if TYPE_CHECKING:
    from dmoc.problem.problem import Problem

# Shares of a reach to which distances of contact points count as equal.
EQUALLY_FAR = 1e-6
# Where a surface is looked for along a coordinate, in reaches: how far, at how many places, and
# where searches begin again.
FARTHEST, SAMPLES = 4.0, 257
# Share of a reach to which a root is found there, and bracketings until then: each halves the
# bracket at least.
ROOT, BRACKETINGS = 1e-15, 100
OUTWARD = (0.1, -0.1, 0.3, -0.3, 1.0, -1.0, 2.0, -2.0)


def restitution_values_of(problem: Problem) -> Array:
    """Coefficient of restitution of each surface, shape (nc,); not a number where the law of the
    model says it."""
    return restitution_row(problem.kernels, problem.restitution)


def touch_of(problem: Problem) -> Touch:
    """The modes of the phases, and the events between them."""
    model = problem.model
    names = model.contacts
    plastic = names.named(np.flatnonzero(problem.restitution_values == 0))
    laws = tuple((names.surfaces[j], law) for j, law in model.impact_laws.items())
    contacts = replace(names, plastic=plastic, rough=names.named(model.rough), impact_laws=laws)
    return touch_along(mode_of(problem.contacts, contacts), problem.sequence, contacts)


def words_of(problem: Problem) -> tuple[str, ...]:
    """The events in words that are the same for the same event; those of a motion are, too."""
    return words_along(problem.touch)


def open_hits_of(problem: Problem) -> dict[int, list[str]]:
    """Hits with friction whose course is not said, by their places in the sequence, and the words
    that say it."""
    return open_hits(problem.touch, problem.sequence)


def redundant_of(problem: Problem) -> tuple[Redundancy, ...]:
    """The conditions of each phase that follow from others."""
    model, modes, latest = problem.model, problem.touch.modes, latest_time(problem)
    start, reach = problem.start_position, problem.reach
    return tuple(
        redundancy(model, mode, start, reach, latest, before.closed)
        for before, mode in zip((FREE, *modes), modes, strict=False)
    )


def event_point(problem: Problem, q: Array, before: Array, event: int, t: float) -> Array:
    """A point near q, shape (nq,), at which a hit or a switch of the sequence happens after a
    point ``before``, shape (nq,); q itself where nothing says one."""
    here = problem.touch.events[event]
    if here.hit != NOWHERE:
        return contact_point(problem, q, before, here.hit, t)
    if here.switch != NOWHERE:
        rest, now = np.zeros((1, len(q))), np.array([t])
        return np.asarray(onto_switch(problem, q[None], rest, now, here.switch)[0])
    return q


def onto_switch(problem: Problem, q: Array, v: Array, t: Array, switch: int) -> Array:
    """Positions (n, nq) near q where a switch of places passes zero at velocities (n, nq) and times
    (n,), by steps along its gradient in reaches; q itself where it contains no coordinate."""

    def conditions(q: Array) -> tuple[Array, Array]:
        slopes = problem.model.crossing_slopes(q, v, t)[:, [switch], : problem.nq]
        return problem.model.crossings(q, v, t)[:, [switch]], slopes

    return onto(conditions, q, problem.reach, longest=1.0)


def contact_point(problem: Problem, q: Array, before: Array, surface: int, t: float) -> Array:
    """A point of the surface near q, shape (nq,), or q itself where none is found.

    Of several that are equally near it is the one nearest to the point ``before``, shape (nq,).  A
    surface of one coordinate is met at its first root on either side of q.
    """
    points = crossings(problem, q, surface, t) or [
        p for p in [onto_surface(problem, q, surface, t)] if p is not None
    ]

    def far(p: Array) -> tuple[float, float]:
        away, back = (float(np.linalg.norm((p - other) / problem.reach)) for other in (q, before))
        return round(away / EQUALLY_FAR), back

    return min(points, key=far, default=q)


def onto_surface(problem: Problem, q: Array, surface: int, t: float = 0.0) -> Array | None:
    """Return a point of g = 0 at time t near q, shape (nq,), or None where none was found.

    Newton steps along the gradient in the metric of the problem's reach, each at most one reach
    long and shortened until the gap gets smaller. Where that ends beside the surface, at a point of
    least distance, they begin again from places to both sides of q along each coordinate.
    """
    involved = problem.model.surface_coordinates[surface]
    sides = [
        d * problem.reach * (np.arange(problem.nq) == j) for d in (0.0, *OUTWARD) for j in involved
    ]
    for away in sides:
        point = onto_gap(problem.model, q + away, surface, t, problem.reach)
        if point is not None:
            return point
    return None


def crossings(problem: Problem, q: Array, surface: int, t: float = 0.0) -> list[Array]:
    """The first points of a surface of one coordinate to both sides of q, up to four reaches
    away; none for other surfaces."""
    involved = problem.model.surface_coordinates[surface]
    if len(involved) > 1:
        return []
    j, points_on = int(involved[0]), []

    def gap(s: float) -> float:
        return float(problem.model.gaps(q + s * (np.arange(problem.nq) == j), t)[surface])

    if abs(gap(0.0)) <= problem.model.gap_rounding(q, t)[surface]:
        return [q]
    for sign in (1.0, -1.0):
        places = sign * problem.reach[j] * np.linspace(0.0, FARTHEST, SAMPLES)
        points = q + places[:, None] * (np.arange(problem.nq) == j)
        gaps = problem.model.gaps(points, t)[:, surface]
        crossed = np.flatnonzero(gaps[1:] * gaps[0] <= 0)
        if len(crossed):
            k = int(crossed[0]) + 1
            root = _root(gap, float(places[k - 1]), float(places[k]), ROOT * problem.reach[j])
            points_on.append(q + root * (np.arange(problem.nq) == j))
    return points_on


def _root(value: Callable[[float], float], low: float, high: float, enough: float) -> float:
    """A root between two places with values of different signs, by C. Ridders' method (IEEE
    Transactions on Circuits and Systems 26 (1979) 979-980), which is exact where the value is
    linear."""
    f_low, f_high = value(low), value(high)
    best = (abs(f_low), low) if abs(f_low) < abs(f_high) else (abs(f_high), high)
    for _ in range(BRACKETINGS):
        middle = (low + high) / 2
        if not best[0] or abs(high - low) <= enough or middle in (low, high):
            break
        f_middle = value(middle)
        turned = (
            math.copysign(1.0, f_low)
            * f_middle
            / math.hypot(f_middle, math.sqrt(abs(f_low)) * math.sqrt(abs(f_high)))
        )
        place = middle + (middle - low) * turned
        f_place = value(place)
        best = min(best, (abs(f_middle), middle), (abs(f_place), place))
        ends = sorted(
            [(low, f_low), (middle, f_middle), (place, f_place), (high, f_high)],
            reverse=high < low,
        )
        (low, f_low), (high, f_high) = next(
            ((a, b) for a, b in pairwise(ends) if _cross(a[1], b[1])), (ends[0], ends[-1])
        )
    return best[1]


def _cross(a: float, b: float) -> bool:
    """Whether zero lies between two values; their product may vanish by underflow."""
    return min(a, b) <= 0 <= max(a, b)
