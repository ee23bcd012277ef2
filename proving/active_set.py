"""Which constraints hold a minimum, and the point where the optimality conditions hold with
them, as floating point has it."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from dmoc.base.records import record
from dmoc.codegen.kernels import Array
from dmoc.program.blocks import Bools
from dmoc.program.transcription import Transcription
from dmoc.proving.central_path import CentralPath
from dmoc.proving.dependence import Null
from dmoc.proving.factorisation import SignedFactors
from dmoc.proving.names import bound_name, row_name
from dmoc.proving.optimality_system import OptimalitySystem, balanced, scaled
from dmoc.solvers.outcome import Duals

# A constraint holds a motion if its multiplier is so many times its distance, and above this.
CLEARLY, NOISE = 100.0, 1e-9
ROUNDS = 12  # in which constraints join or leave
MOST_LEFT_OUT = 12  # rows that follow from others
# Steps of Newton's method, and the largest change of an unknown, in its size, that is rounding; one
# that leads elsewhere.
STEPS, STILL, ELSEWHERE = 8, 1e-14, 1e-2
# Neither the multiplier nor the distance of a constraint is larger: it may hold or not.
DOUBTFUL = 1e-3
# Changes of unknowns beside those of multipliers that are rounding.
IMPLIED = 1e-9
WRONG = 1e-10  # a multiplier or a distance of the wrong sign, as far as that is no rounding


@record(frozen=True, eq=False)
class ActiveSet:
    """Masks of the unknowns at their lower and at their upper bounds, shape (n,), of the rows
    (c | d) that hold with equality, and of those that do as well, but follow from others, shape
    (m,)."""

    lower: Bools
    upper: Bools
    rows: Bools
    left_out: Bools

    def same(self, other: ActiveSet) -> bool:
        """Whether the same constraints hold."""
        pairs = ((self.lower, other.lower), (self.upper, other.upper), (self.rows, other.rows))
        return all(np.array_equal(a, b) for a, b in pairs)

    def without(self, row: int) -> ActiveSet:
        """The set where a row follows from others."""
        at = np.arange(len(self.rows)) == row
        return replace(self, rows=self.rows & ~at, left_out=self.left_out | at)

    @property
    def count(self) -> int:
        return int(self.lower.sum() + self.upper.sum() + self.rows.sum())


class Point(NamedTuple):
    """Scaled unknowns x, shape (n,), and multipliers y of L = f + y . (c | d), shape (m,), with the
    equations that they solve."""

    system: OptimalitySystem
    active: ActiveSet
    x: Array
    y: Array

    def away(self, answer: Array) -> float:
        """How far it is from an answer, shape (n,), in sizes of the unknowns."""
        return float(np.abs(self.x - answer).max(initial=0.0))


def first_set(nlp: Transcription, x: Array, duals: Duals) -> ActiveSet:
    """The constraints that a solver's multipliers say hold x."""
    free, every = nlp.lower < nlp.upper, np.ones(nlp.n_eq, dtype=bool)

    def holds(force: Array, distance: Array) -> Bools:
        return np.asarray(force > np.maximum(CLEARLY * distance, NOISE))

    lower, upper = holds(duals.z, x - nlp.lower), holds(-duals.z, nlp.upper - x)
    rows = holds(duals.w, nlp.inequality(x)) & may_hold(nlp)[nlp.n_eq :]
    rows = np.concatenate([every, rows])
    return ActiveSet(free & lower, free & upper, rows, np.zeros(len(rows), dtype=bool))


def doubtful(nlp: Transcription, x: Array, duals: Duals) -> list[str]:
    """Names of the constraints of which a solver's multipliers do not say whether they hold x, the
    most doubtful ones first."""
    distance = np.concatenate([np.minimum(x - nlp.lower, nlp.upper - x), nlp.inequality(x)])
    force = np.concatenate([np.abs(duals.z), duals.w])
    size = np.maximum(force, distance)
    size[: nlp.n][nlp.lower >= nlp.upper] = np.inf
    alike = np.maximum(force, NOISE) < CLEARLY * distance, distance < CLEARLY * force
    (at,) = np.nonzero(alike[0] & alike[1] & (size < DOUBTFUL))
    at = at[np.argsort(-size[at], kind="stable")]
    return [
        bound_name(nlp, i) if i < nlp.n else row_name(nlp, i - nlp.n + nlp.n_eq)
        for i in at.tolist()
    ]


def may_hold(nlp: Transcription) -> Bools:
    """Rows that depend on an unknown that is not fixed, shape (m,): what the others are, the
    problem says."""
    jac, free = nlp.assembled.jacobian, nlp.lower < nlp.upper
    rows = np.repeat(np.arange(jac.shape[0]), np.diff(jac.indptr))[free[jac.indices]]
    return np.bincount(rows, minlength=jac.shape[0]) > 0


def shared_forces(nlp: Transcription) -> Bools:
    """Unknowns that others have the effect of, as the friction of both corners of a box, shape
    (n,)."""
    shared = np.zeros(nlp.n, dtype=bool)
    for law in nlp.laws:
        for index, _ in law.loose():
            shared[index] = True
    return shared & (nlp.lower < nlp.upper)


def sharpened(nlp: Transcription, x: Array, duals: Duals) -> Point:
    """The point near x, shape (n,), where the optimality conditions hold: constraints whose
    multipliers have the wrong sign there leave, those that are violated join; rows that follow from
    others are left out.  Shared forces stay what they are."""
    active, y = first_set(nlp, x, duals), duals.rows
    for _ in range(ROUNDS):
        point = _solved(independent(nlp, active, x, y))
        near = point.away(x) <= ELSEWHERE
        following = _corrected(nlp, point) if near else _blocked(nlp, point, x)
        if following.same(point.active):
            break
        active = following
    return _without_implied(nlp, point) if point.away(x) <= ELSEWHERE else point


def posed(nlp: Transcription, active: ActiveSet, x: Array, y: Array) -> Point:
    """Scaled unknowns, shape (n,), and multipliers, shape (m,), with some constraints."""
    lower, upper = nlp.limits
    low, shared = active.lower | (nlp.lower >= nlp.upper), shared_forces(nlp)
    held = np.where(active.upper, upper, np.where(low, lower, np.nan))
    held = np.where(shared, np.clip(x * nlp.sizes, lower, upper), held)
    x = np.where(active.upper, nlp.upper, np.where(low, nlp.lower, x))
    system = OptimalitySystem(nlp, held, active.rows)
    return Point(system, active, x, np.where(active.rows, y, 0.0))


def independent(nlp: Transcription, active: ActiveSet, x: Array, y: Array) -> Point:
    """A point with the constraints that do not follow from others."""
    for _ in range(MOST_LEFT_OUT):
        point = posed(nlp, active, x, y)
        row = Null(point.system, _step(point)[0]).follows(y)
        if row is None:
            break
        active = active.without(row)
    return posed(nlp, active, x, y)


def followed(nlp: Transcription, x: Array, duals: Duals) -> tuple[Array, Duals]:
    """Unknowns, shape (n,), and multipliers that tell better than those of an answer which
    inequalities hold."""
    e, nothing = nlp.n_eq, np.zeros(nlp.n, dtype=bool)
    left_out = independent(nlp, first_set(nlp, x, duals), x, duals.rows).active.left_out
    rows = may_hold(nlp) & (np.arange(len(left_out)) >= e)
    rows[:e] = ~left_out[:e]
    point = posed(nlp, ActiveSet(nothing, nothing, rows, left_out), x, duals.rows)
    path = CentralPath(point.system, point.x, point.y, duals.z)
    multipliers = path.follow()
    return path.x, multipliers


def _without_implied(nlp: Transcription, point: Point) -> Point:
    """A point without the rows that hold with equality because others do: their gradients are sums
    of those of the constraints that hold, which move no unknown."""
    system, active = point.system, point.active
    idle = ~active.rows & ~active.left_out & may_hold(nlp)
    (touched,) = np.nonzero(idle & (np.abs(nlp.values(point.x)[1:]) < WRONG))
    if not len(touched):
        return point
    factors, d, slopes = *_factors(point)[1:], nlp.slopes(point.x)[nlp.n :]
    for row in touched.tolist():
        gradient, at = np.zeros(len(system.place)), system.entry_rows == row
        gradient[system.entry_columns[at]] = slopes[at]
        of_x, of_y = system.parts(factors.solve((d * gradient[system.order])[:, None])[:, 0])
        if np.abs(of_x).max() <= IMPLIED * np.abs(of_y).max():
            active = active.without(row)
    return point._replace(active=active)


def _step(point: Point) -> tuple[SignedFactors, Array]:
    """The factors of K at a point, and the step of Newton's method."""
    F, factors, d = _factors(point)
    with np.errstate(all="ignore"):
        return factors, d * factors.solve((d * F)[:, None])[:, 0]


def _factors(point: Point) -> tuple[Array, SignedFactors, Array]:
    """F at a point, the factors of d K d, and d."""
    F, K = point.system.at(point.x, point.y)
    d = balanced(K)
    with np.errstate(all="ignore"):
        return F, SignedFactors(scaled(K, d)), d


def _solved(point: Point) -> Point:
    """Newton's method from a point."""
    for _ in range(STEPS):
        _, step = _step(point)
        if not np.isfinite(step).all():
            break
        of_x, of_y = point.system.parts(step)
        point = point._replace(x=point.x - of_x, y=point.y - of_y)
        if not STILL < np.abs(of_x).max(initial=0.0) <= 1:
            break
    return point


def _blocked(nlp: Transcription, point: Point, x: Array) -> ActiveSet:
    """The constraints of a point that is far from x, shape (n,), and the one that is met first on
    the way there, if any is."""
    active, n = point.active, nlp.n
    idle = ~active.rows & ~active.left_out & may_hold(nlp)
    with np.errstate(all="ignore"):
        before = np.concatenate([x - nlp.lower, nlp.upper - x, nlp.values(x)[1:]])
        after = [point.x - nlp.lower, nlp.upper - point.x, nlp.values(point.x)[1:]]
        shares = before / (before - np.concatenate(after))
    may = np.concatenate([point.system.free, point.system.free, idle])
    shares = np.where(may & (shares >= 0), shares, np.inf)
    first = int(np.argmin(shares))
    joins = (np.arange(len(shares)) == first) & (shares < 1)
    lower, upper, rows = np.split(joins, [n, 2 * n])
    return replace(
        active, lower=active.lower | lower, upper=active.upper | upper, rows=active.rows | rows
    )


def _corrected(nlp: Transcription, point: Point) -> ActiveSet:
    """The constraints of a point without those that pull, with those that are violated."""
    x, y, active, e = point.x, point.y, point.active, nlp.n_eq
    slope, free = nlp.lagrangian_gradient(x, y[:e], -y[e:]), point.system.free
    lower = active.lower & (slope > -WRONG) | free & (x < nlp.lower - WRONG)
    upper = active.upper & (slope < WRONG) | free & (x > nlp.upper + WRONG)
    missed = ~active.rows & ~active.left_out & may_hold(nlp) & (nlp.values(x)[1:] < -WRONG)
    rows = active.rows & (y < WRONG) | missed
    rows[:e] = active.rows[:e]
    return replace(active, lower=lower, upper=upper, rows=rows)
