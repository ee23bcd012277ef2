"""By how much a motion exceeds its path constraints and the bounds of its velocities and
quantities: at the nodes and between them, on the path that is integrated from each node."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property, partial

import numpy as np

from dmoc.base.records import record
from dmoc.base.tolerances import ROUNDING
from dmoc.check.checked_motion import Motion
from dmoc.check.depth import dips, distances
from dmoc.check.integrated_steps import IntegratedSteps
from dmoc.check.limit_functions import Bools, LimitFunctions
from dmoc.codegen.kernels import Array
from dmoc.codegen.manifest import FunctionFacts
from dmoc.mechanics.bound_kernels import Index
from dmoc.mechanics.contact_mode import Mode

# Share of the largest terms of a constraint by which it counts at least, where they all vanish.
LEAST_SIZE = 0.02
# And share of what the sizes of the motion could move it by, where nothing of it moves: rounding
# errors are no excess.
ALMOST_NOTHING = 1e-4
# What an excess counts between the quadrature points of a constraint that contains both states and
# inputs that are constant in a step: it varies there by a share of h instead of h^2.
VARYING = 0.05
# Of the states that exceed a limit, so many of the deepest are measured.
DEEPEST = 8
# What moves a limit by less than this share of what another one does, does not count beside it.
LEVEL = 0.01
# The share of what a motion passes through that it may lie within it, in units of the excess: it
# gets through no wire, however thin this is beside the widths of the motion.
THIN = 50.0


@record(frozen=True, eq=False)
class Excess:
    """The largest excess of a path constraint or a bound, relative to its size: what it counts, and
    what it is, with what is exceeded and the time."""

    counts: float
    share: float
    what: str
    time: float

    @property
    def text(self) -> str:
        """A sentence about the excess."""
        share = 100 * self.share
        return f"{self.what} is exceeded by {share:.3g} % of its size at {self.time:.4g} s"


def path_excess(motion: Motion, courses: Sequence[IntegratedSteps]) -> tuple[Excess, ...]:
    """The largest excess of each path constraint and each bound that is exceeded: how far the
    motion lies beyond it, as a share of its widths; of what contains velocities or inputs or is a
    bound, the share of its terms at the time, where that is larger.

    The terms of a bound are the value and the bound.
    """
    limits = LimitFunctions.of(motion)
    if not limits.rows:
        return ()
    path = _Path.of(limits, courses)
    share = np.nan_to_num(np.maximum(path.shares(), path.distances()), nan=np.inf)
    counts = path.weights * share
    return tuple(
        Excess(float(counts[row, j]), float(share[row, j]), limits.texts[j], float(path.t[row]))
        for j, row in enumerate(counts.argmax(axis=0))
        if counts[row, j] > 0
    )


@record(frozen=True, eq=False)
class _Path:
    """States of a motion at n places: those that steps are looked at, and where functions are
    lowest between them; which ones are quadrature points, and which one is the state after an
    event that ends the motion, where no inputs act; and the values of the functions (n, m)."""

    limits: LimitFunctions
    states: Array
    at_points: Bools
    after: Bools
    values: Array

    @classmethod
    def of(cls, limits: LimitFunctions, courses: Sequence[IntegratedSteps]) -> _Path:
        states, at_points, after = limits.visited(courses, partial(_dips, limits))
        return cls(limits, states, at_points, after, limits.values(states))

    @cached_property
    def t(self) -> Array:
        """Times of the states, shape (n,)."""
        return self.limits.split(self.states)[3]

    @cached_property
    def _slopes(self) -> Array:
        return self.limits.slopes(self.states)

    @cached_property
    def _terms(self) -> Array:
        return np.nan_to_num(self.limits.terms(self.states), posinf=0.0)

    def shares(self) -> Array:
        """Excesses of the functions as shares of their terms, shape (n, m); none of those that are
        measured by distances alone."""
        shares = np.where(np.isnan(self.values), np.nan, 0.0)
        for j in np.flatnonzero(self.limits.by_terms).tolist():
            shares[:, j] = -self.values[:, j] / self._at_least(self._terms[:, j], j)
        return shares

    def _at_least(self, sizes: Array, j: int) -> Array:
        """Sizes of a function (n,), at least a share of the largest, and of what sizes of all that
        a state consists of could move it by."""
        least = LEAST_SIZE * sizes.max(initial=0.0)
        moved = np.abs(self._slopes[:, j]) @ self.limits.sizes(self.states)
        moved = np.nan_to_num(moved, posinf=0.0).max(initial=0.0)
        sizes = np.maximum(sizes, max(least, ALMOST_NOTHING * moved))
        return np.where(sizes > 0, sizes, 1.0)

    def distances(self) -> Array:
        """Distances of the motion beyond the functions where they are deepest, as shares of its
        widths, shape (n, m), and zero elsewhere."""
        far = np.zeros_like(self.values)
        for j in range(far.shape[1]):
            behind = self._deepest(j)
            if len(behind):
                near, _ = self._distances(behind, j, self._widths)
                near = np.where(np.isfinite(near), near, self._by_slopes(behind, j))
                within, across = self._distances(behind, j, self._even_widths)
                far[behind, j] = np.fmax(near, within / across / THIN)
        return far

    def _distances(self, behind: Index, j: int, widths: Array) -> tuple[Array, Array]:
        """Distances of some states from a function, and widths of the region across it, shape
        (states,) each."""
        ways = _ways(self._slopes[behind, j], np.where(self.limits.depends[j], widths, 0.0))
        return distances(lambda z: self.limits.values(z)[:, j], self.states[behind], ways)

    @cached_property
    def _widths(self) -> Array:
        return self.limits.widths(self.states)

    @cached_property
    def _even_widths(self) -> Array:
        return self.limits.even_widths(self.states)

    def _deepest(self, j: int) -> Index:
        """States at which a function is exceeded most, by itself and by its slopes, and by more
        than rounding errors, shape (k,)."""
        behind = np.flatnonzero(self.values[:, j] < -ROUNDING * self._terms[:, j])
        weight = self.weights[behind, j]
        depths = -weight * self.values[behind, j], weight * self._by_slopes(behind, j)
        ranks = [np.argsort(-depth, kind="stable")[:DEEPEST] for depth in depths]
        return np.unique(behind[np.concatenate(ranks)])

    def _by_slopes(self, behind: Index, j: int) -> Array:
        """Distances from a function that its slopes predict, shape (states,)."""
        moved = np.abs(self._slopes[behind, j]) @ self._widths
        return np.asarray(-self.values[behind, j] / moved)

    @cached_property
    def weights(self) -> Array:
        """Weights of the excesses of functions, shape (n, m)."""
        return counted(self.limits.motion, self.limits.rows, self.at_points, self.after)


def counted(motion: Motion, rows: Sequence[FunctionFacts], at_points: Bools, after: Bools) -> Array:
    """Weights of the excesses of functions with some rows at states, shape (n, len(rows)); masks
    (n,) say which states are quadrature points, and which come ``after`` an event that ends the
    motion."""
    constant = motion.trajectory.input_form.width == 0
    varies = [r["inputs"] and (bool(r["coordinates"]) or r["velocities"]) for r in rows]
    little = ~at_points[:, None] & np.array(varies, dtype=bool) & constant
    acts = np.array([r["inputs"] or bool(r.get("forces")) for r in rows], dtype=bool)
    return np.where(after[:, None] & acts, 0.0, np.where(little, VARYING, 1.0))


def _dips(limits: LimitFunctions, mode: Mode, course: IntegratedSteps, places: Array) -> Array:
    """States of a piece (k, d) where functions are lowest between ``places`` (places, n, d)."""

    def states(step: Index, share: Array) -> Array:
        return limits.states(mode, *course.part(step).at(share))

    values = limits.values(places.reshape(-1, places.shape[2]))
    by_place = values.reshape(*places.shape[:2], -1)
    return states(*dips(by_place, lambda step, share: limits.values(states(step, share))))


def _ways(slopes: Array, widths: Array) -> Array:
    """The ways (n, k, d) out of a limit: in all that its function has slopes (n, d) by together,
    each entry by its width, and in each alone."""
    moved = np.nan_to_num(np.abs(slopes) * widths, posinf=0.0)
    counts = moved > LEVEL * moved.max(axis=1, keepdims=True)
    together = np.where(counts, np.sign(slopes), 0.0) * widths
    alone = np.diag(widths)[widths > 0]
    alone = np.broadcast_to(alone, (len(slopes), *alone.shape))
    return np.concatenate([together[:, None], alone, -alone], axis=1)
