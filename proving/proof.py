"""The proof of a minimum at a point where the optimality conditions hold as floating point has
them: an exact solution of theirs is near, it is a strict minimum, the constraints that were taken
for active are, and the others are not."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from functools import partial
from typing import TypeAlias

import numpy as np

from dmoc.base.records import record
from dmoc.codegen.kernels import Array
from dmoc.program.blocks import Index
from dmoc.program.transcription import Transcription
from dmoc.proving.active_set import Point, may_hold, shared_forces
from dmoc.proving.balls import ENLARGED, Ball
from dmoc.proving.dependence import Null
from dmoc.proving.enclosure import Inverse, radii
from dmoc.proving.factorisation import SignedFactors, lost_of
from dmoc.proving.names import MOST_NAMED, bound_name, counted, row_name
from dmoc.proving.optimality_system import Matrix, Values, balanced, scaled, whole
from dmoc.results.certificate import Certificate

# Balls of some constraints, what names them, and their numbers.
Part: TypeAlias = tuple[Ball, Callable[[int], str], Index]
NEARLY_KEPT = 1e-8  # of a row that was left out


def proof(nlp: Transcription, answer: Array, point: Point) -> Certificate:
    """What is proved of an answer, shape (n,), at a point near it."""
    trial = Trial(point)
    if trial.radii is None:
        return Certificate((trial.not_regular,))
    near = Near(nlp, point, trial.exact, trial.radii)
    fails = [*trial.no_minimum(), *near.undecided()]
    if fails:
        return Certificate(tuple(fails))
    active = point.active
    left_out = tuple(row_name(nlp, i) for i in np.flatnonzero(active.left_out).tolist())
    return Certificate(
        (), near.cost, near.radius(answer), int(point.system.free.sum()),
        active.count - int(active.rows[: nlp.n_eq].sum()), near.slack,
        counted(nlp, shared_forces(nlp)), left_out,
    )  # fmt: skip


class Trial:
    """The equations at a point, and the ``radii`` within which they have exactly one solution; None
    where there are none."""

    def __init__(self, point: Point) -> None:
        self.system = system = point.system
        self.exact = system.enclosed(point.x, point.y, np.zeros(system.size))
        K = system.upper(self.exact.hess.m, self.exact.jac.m)
        d = balanced(K)
        K = scaled(K, d)

        def variation(r: Array) -> Matrix:
            around = system.enclosed(point.x, point.y, d * r)
            pairs = ((around.hess, self.exact.hess), (around.jac, self.exact.jac))
            # Where a condition is open, a middle is that of another case.
            off = (np.abs(a.m - b.m) * ENLARGED + a.r for a, b in pairs)
            return whole(scaled(system.upper(*off), d)) * ENLARGED

        with np.errstate(all="ignore"):  # what is singular has no numbers
            self.factors = SignedFactors(K)
            inverse = Inverse(whole(K), self.factors)
            self._norm = inverse.norm
            within = radii(inverse, d * system.equations(self.exact), variation)
        self.radii = None if within is None else d * within

    def no_minimum(self) -> Iterator[str]:
        """Why the signs of K are not those of a strict minimum: as many are to be positive as there
        are unknowns."""
        if not self.factors.error * self._norm * (1 + lost_of(8)) < 1:
            yield "the signs of the curvatures are not decided: rounding errors are larger."
        elif falls := int(self.system.free.sum()) - self.factors.positive:
            directions = "a direction" if falls == 1 else f"{falls} directions"
            yield (
                f"the cost falls along {directions} that the active constraints allow: the answer "
                "is a saddle, and no minimum."
            )

    @property
    def singular(self) -> str:
        """What is singular, nothing where nothing is."""
        return Null(self.system, self.factors).sentence

    @property
    def not_regular(self) -> str:
        """Why no solution is enclosed."""
        return self.singular or (
            "no distance was found within which the optimality conditions are sure to have a "
            "solution: rounding errors are too large for it."
        )


@record(frozen=True, eq=False)
class Near:
    """The balls around a point in which the solution lies: ``exact`` is the program at the point,
    ``radii`` are those of the unknowns and multipliers of its equations."""

    nlp: Transcription
    point: Point
    exact: Values
    radii: Array

    def __post_init__(self) -> None:
        system, (x, y) = self.point.system, (self.point.x, self.point.y)
        of_x, of_y = system.parts(self.radii)
        self.x, self.y = Ball(x, of_x), Ball(y, of_y)
        self.around = system.enclosed(x, y, self.radii)

    def radius(self, answer: Array) -> float:
        """How far the solution is from an answer at most, in sizes of the unknowns."""
        return float((self.x - Ball(answer, np.zeros(len(answer)))).most.max(initial=0.0))

    @property
    def cost(self) -> tuple[float, float]:
        """Bounds of the cost: that of L at the point, and what the slope of L, which is nearly
        zero, and the curvatures can change of it."""
        exact, (r, _) = self.exact, self.point.system.parts(self.radii)
        rows = self.point.active.rows
        at = np.flatnonzero(rows)
        y = self.point.y[at]
        left = exact.rows[1 + at] * Ball(y, np.zeros(len(y)))
        hess = self.nlp.assembled.hessian
        i = np.repeat(np.arange(self.nlp.n), np.diff(hess.indptr))
        bent = np.sum(self.around.hess.most * r[i] * r[hess.indices])
        off = np.sum(left.most) + np.sum(exact.slope.most * r) + bent
        off *= 1 + lost_of(len(r) + len(y) + len(i))
        value = Ball(exact.rows.m[0], exact.rows.r[0] + off) * self.nlp.scale.cost
        return float(value.low), float(value.high)

    @property
    def slack(self) -> float:
        """What the constraints that do not hold leave at least, relative to their sizes."""
        return float(min(part.low.min(initial=np.inf) for part, *_ in self._idle()))

    def undecided(self) -> list[str]:
        """Sentences about constraints that may hold or not."""
        sentences = [
            f"whether {name} holds the motion is open: its multiplier lies in {_range(ball)}."
            for ball, name in _open(self._forces())
        ]
        sentences += [
            f"whether {name} is kept is open: its distance lies in {_range(ball)}."
            for ball, name in _open(self._idle())
        ]
        out = np.flatnonzero(self.point.active.left_out)
        sentences += [
            f"{row_name(self.nlp, i)}, which was left out, is missed by {missed:.1e}."
            for i, missed in zip(out.tolist(), self.around.rows[1 + out].most, strict=True)
            if not missed <= NEARLY_KEPT
        ]
        more = len(sentences) - MOST_NAMED
        return sentences[:MOST_NAMED] + [f"and {more} more of this kind."] * (more > 0)

    def _forces(self) -> Iterator[Part]:
        """Multipliers of active constraints, positive where they are right, and their names."""
        nlp, active, slope = self.nlp, self.point.active, self.around.slope
        for mask, sign in ((active.lower, 1.0), (active.upper, -1.0)):
            at = np.flatnonzero(mask)
            yield slope[at] * sign, partial(bound_name, nlp), at
        at = np.flatnonzero(active.rows)
        at = at[at >= nlp.n_eq]
        yield -self.y[at], partial(row_name, nlp), at

    def _idle(self) -> Iterator[Part]:
        """Distances from constraints that do not hold, and their names."""
        nlp, active, free = self.nlp, self.point.active, self.point.system.free
        for limit, sign in ((nlp.lower, 1.0), (nlp.upper, -1.0)):
            at = np.flatnonzero(free & np.isfinite(limit))
            apart = (self.x[at] - Ball(limit[at], np.abs(limit[at]) * 2.0**-52)) * sign
            yield apart, partial(bound_name, nlp), at
        at = np.flatnonzero(~active.rows & ~active.left_out & may_hold(nlp))
        yield self.around.rows[1 + at], partial(row_name, nlp), at


def _open(parts: Iterable[Part]) -> Iterator[tuple[Ball, str]]:
    """Those that may be negative, with their names."""
    for balls, name_of, numbers in parts:
        for i in np.flatnonzero(~(balls.low > 0)):
            yield balls[i], name_of(int(numbers[i]))


def _range(ball: Ball) -> str:
    return f"[{float(ball.low):.1e}, {float(ball.high):.1e}]"
