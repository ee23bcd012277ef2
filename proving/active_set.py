"""Which constraints hold a minimum, and the point where the optimality conditions hold with
them, as floating point has it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from dmoc.base.records import record
from dmoc.codegen.kernels import Array
from dmoc.program.blocks import Bools
from dmoc.program.transcription import Transcription
from dmoc.proving.factorisation import SignedFactors
from dmoc.proving.names import bound_name, row_name
from dmoc.proving.optimality_system import OptimalitySystem, balanced, scaled
from dmoc.solvers.outcome import Duals

# A constraint holds a motion if its multiplier is so many times its distance, and above this.
CLEARLY, NOISE = 100.0, 1e-9
ROUNDS = 12  # in which constraints join or leave
# Steps of Newton's method, and the largest change of an unknown, in its size, that is rounding; one
# that leads elsewhere.
STEPS, STILL, ELSEWHERE = 8, 1e-14, 1e-2
# Neither the multiplier nor the distance of a constraint is larger: it may hold or not.
DOUBTFUL = 1e-3
WRONG = 1e-10  # a multiplier or a distance of the wrong sign, as far as that is no rounding


@record(frozen=True, eq=False)
class ActiveSet:
    """Masks of the unknowns at their lower and at their upper bounds, shape (n,), and of the rows
    (c | d) that hold with equality, shape (m,)."""

    lower: Bools
    upper: Bools
    rows: Bools

    def same(self, other: ActiveSet) -> bool:
        pairs = ((self.lower, other.lower), (self.upper, other.upper), (self.rows, other.rows))
        return all(np.array_equal(a, b) for a, b in pairs)

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
    return ActiveSet(free & lower, free & upper, np.concatenate([every, rows]))


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
    multipliers have the wrong sign there leave, those that are violated join.  Shared forces stay
    what they are."""
    active, y, shared = first_set(nlp, x, duals), duals.rows, shared_forces(nlp)
    for _ in range(ROUNDS):
        point = _solved(nlp, active, shared, x, y)
        following = _corrected(nlp, point)
        if following.same(active):
            break
        active = following
    return point


def without(nlp: Transcription, point: Point, row: int) -> Point:
    """The point where a row, which follows from others, is left out."""
    rows = point.active.rows.copy()
    rows[row] = False
    active = ActiveSet(point.active.lower, point.active.upper, rows)
    return _solved(nlp, active, shared_forces(nlp), point.x, point.y)


def _solved(nlp: Transcription, active: ActiveSet, shared: Bools, x: Array, y: Array) -> Point:
    """Newton's method with some constraints."""
    lower, upper = nlp.limits
    fixed = nlp.lower >= nlp.upper
    held = np.where(active.upper, upper, np.where(active.lower | fixed, lower, np.nan))
    held = np.where(shared, np.clip(x * nlp.sizes, lower, upper), held)
    x = np.where(active.upper, nlp.upper, np.where(active.lower | fixed, nlp.lower, x))
    y, system = np.where(active.rows, y, 0.0), OptimalitySystem(nlp, held, active.rows)
    for _ in range(STEPS):
        F, K = system.at(x, y)
        d = balanced(K)
        with np.errstate(all="ignore"):
            step = d * SignedFactors(scaled(K, d)).solve((d * F)[:, None])[:, 0]
        of_x, of_y = system.parts(step)
        x, y, moved = x - of_x, y - of_y, float(np.abs(of_x).max(initial=0.0))
        if not STILL < moved <= 1:
            break
    return Point(system, active, x, y)


def _corrected(nlp: Transcription, point: Point) -> ActiveSet:
    """The constraints of a point without those that pull, with those that are violated."""
    x, y, active, e = point.x, point.y, point.active, nlp.n_eq
    slope, free = nlp.lagrangian_gradient(x, y[:e], -y[e:]), point.system.free
    lower = active.lower & (slope > -WRONG) | free & (x < nlp.lower - WRONG)
    upper = active.upper & (slope < WRONG) | free & (x > nlp.upper + WRONG)
    rows = active.rows & (y < WRONG) | ~active.rows & may_hold(nlp) & (nlp.values(x)[1:] < -WRONG)
    rows[:e] = True
    return ActiveSet(lower, upper, rows)
