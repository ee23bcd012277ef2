"""The boxes of durations that a proof is made of, and the regions that they are in the plane of two
durations, or on the line of one."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.program.blocks import Bools
from dmoc.proving.branch import Branch
from dmoc.proving.engine import branch_of
from dmoc.proving.linear import LinearProblem

MOST_KEPT = 100_000  # boxes
# Durations that a figure can show.
MOST_SHOWN = 2
# Boxes with bounds above so many times the cost are looked at once more, in so many parts.
DEARER, PARTS = 1.5, 4


@dataclass(frozen=True, eq=False)
class Paving:
    """Boxes that cover the durations of all motions.

    Attributes
    ----------
    bound : array of shape (boxes,)
        No motion with durations in the box costs less.
    shortest, longest : array of shape (boxes, phases)
        Sides of the boxes, in seconds.
    beyond : float
        A box with a bound above this holds no motion.
    linear : LinearProblem
        The problem that the bounds are of.
    """

    bound: Array
    shortest: Array
    longest: Array
    beyond: float
    linear: LinearProblem

    @property
    def free(self) -> tuple[int, ...]:
        """The phases whose durations decide all others."""
        return free_phases(self.linear)

    def regions(self) -> list[Array]:
        """What each box is in the durations that are free, where the final time may be as it is
        then: corners of a polygon, shape (corners, 2), or ends of a line, shape (2, 1); no corners
        where there is no such final time."""
        shown = [*self.free]
        others = np.setdiff1d(np.arange(self.shortest.shape[1]), shown)
        earliest, latest = self.linear.final_time
        least = earliest - self.longest[:, others].sum(axis=1)
        most = latest - self.shortest[:, others].sum(axis=1)
        sides = zip(self.shortest[:, shown], self.longest[:, shown], least, most, strict=True)
        return [_clipped(_corners(a, b), low, high) for a, b, low, high in sides]

    def without_motion(self, cost: float) -> Bools:
        """Boxes that hold no motion, whatever it costs, shape (boxes,), as far as it is seen, where
        there is one of a cost: bounds were broken off where they were far above it."""
        none = self.bound >= self.beyond
        for i in np.flatnonzero(~none & (self.bound >= DEARER * cost)):
            durations = np.stack([self.shortest[i], self.longest[i]], axis=1)
            part = replace(self.linear, durations=durations)
            branch = branch_of(part)(part, np.inf, self.beyond, 0.0, 0.0, abs(cost))
            none[i] = not branch.run(PARTS) and branch.bound >= self.beyond
        return none


def free_phases(linear: LinearProblem) -> tuple[int, ...]:
    """The phases whose durations may be chosen; where the final time is fixed they decide the last
    of those that are not fixed."""
    free = np.flatnonzero(linear.durations[:, 0] < linear.durations[:, 1])
    fixed = linear.final_time[0] == linear.final_time[1]
    return tuple(free[:-1].tolist() if fixed else free.tolist())


def most_kept(linear: LinearProblem) -> int:
    """How many boxes are kept: those of proofs that a figure can show."""
    return MOST_KEPT if 0 < len(free_phases(linear)) <= MOST_SHOWN else 0


def paving_of(branch: Branch, linear: LinearProblem, beyond: float) -> Paving | None:
    """The boxes of a proof, if they were kept."""
    if branch.leaves is None or not most_kept(linear):
        return None
    n = len(linear.phases)
    rows = np.concatenate([branch.leaves, branch.state()["waiting"][:, : 1 + 2 * n]])
    return Paving(rows[:, 0], rows[:, 1 : 1 + n], rows[:, 1 + n :], beyond, linear)


def _corners(low: Array, high: Array) -> Array:
    if len(low) == 1:
        return np.stack([low, high])
    (a, b), (c, d) = low, high
    return np.array([[a, b], [c, b], [c, d], [a, d]])


def _clipped(corners: Array, least: float, most: float) -> Array:
    """The part of a convex polygon, shape (corners, 2), or a line, shape (2, 1), where the sum of
    the coordinates is from ``least`` to ``most``."""
    for sign, limit in ((1.0, least), (-1.0, -most)):
        excess = sign * corners.sum(axis=1) - limit
        kept = list[Array]()
        for i in range(len(corners)):
            here, there, a, b = corners[i], corners[i - 1], excess[i], excess[i - 1]
            if (a < 0) != (b < 0):
                kept.append(there + (here - there) * (b / (b - a)))
            if a >= 0:
                kept.append(here)
        corners = np.array(kept).reshape(-1, corners.shape[1])
    return corners
