"""By how much a motion exceeds its path constraints: at the nodes and between them, on the path
that is integrated from each node."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dmoc.base.discretisation import DISCRETISATIONS
from dmoc.check.checked_motion import Motion
from dmoc.codegen.kernels import Array
from dmoc.simulation.flow import PLACES, Steps

# Share of the largest terms of a constraint by which it counts at least, where they all vanish.
LEAST_SIZE = 0.02
# What an excess counts between the quadrature points of a constraint that contains both states and
# inputs that are constant in a step: it varies there by a share of h instead of h^2.
VARYING = 0.05


@dataclass(frozen=True)
class IntegratedSteps:
    """Steps that were integrated from their first nodes: states (n, 2 nq ...) at both ends, and
    the accelerations there (n, 2, nq)."""

    steps: Steps
    start: Array
    ends: Array
    stop: Array

    def at(self, share: float) -> tuple[Array, Array, Array, Array]:
        """q, v, u and t at a share of every step: the polynomial of degree 5."""
        nq = self.ends.shape[2]
        h, s = self.steps.h[:, None], share
        q, v, a = self.start[:, :nq], h * self.start[:, nq : 2 * nq], h**2 * self.ends[:, 0]
        d = self.stop[:, :nq] - q - v - a / 2
        e = h * self.stop[:, nq : 2 * nq] - v - a
        f = h**2 * self.ends[:, 1] - a
        c3, c4, c5 = 10 * d - 4 * e + f / 2, -15 * d + 7 * e - f, 6 * d - 3 * e + f / 2
        place = q + s * (v + s * (a / 2 + s * (c3 + s * (c4 + s * c5))))
        rate = v + s * (a + s * (3 * c3 + s * (4 * c4 + s * 5 * c5)))
        u = self.steps.u0 + s * (self.steps.u1 - self.steps.u0)
        return place, rate / h, u, self.steps.t + s * self.steps.h


@dataclass(frozen=True)
class Excess:
    """The largest excess of a path constraint, relative to its size: what it counts, and what it
    is, with its name and time."""

    counts: float
    share: float
    name: str
    time: float

    @property
    def text(self) -> str:
        """What contradicts the motion."""
        return (
            f"path constraint {self.name!r} is exceeded by {100 * self.share:.3g} % of its size "
            f"at {self.time:.4g} s"
        )


def path_excess(motion: Motion, courses: Sequence[IntegratedSteps]) -> tuple[Excess, ...]:
    """The largest excess of each path constraint that is exceeded.

    The size of a constraint is that of its terms, at the time itself; of one in coordinates alone,
    how far the ranges of the motion move it.
    """
    names = motion.model.kernels.manifest["path_constraints"]
    if not names:
        return ()
    values = _Values.of(motion, courses)
    share = np.nan_to_num(-values.r / values.sizes, nan=np.inf)
    counts = values.weights * share
    return tuple(
        Excess(float(counts[row, j]), float(share[row, j]), names[j], float(values.t[row]))
        for j, row in enumerate(counts.argmax(axis=0))
        if counts[row, j] > 0
    )


@dataclass(frozen=True)
class _Values:
    """Path constraints and their terms at n places, shape (n, nr); what they count there."""

    motion: Motion
    q: Array
    v: Array
    u: Array
    t: Array
    weights: Array

    @classmethod
    def of(cls, motion: Motion, courses: Sequence[IntegratedSteps]) -> _Values:
        rows = motion.model.kernels.manifest["path_limits"]
        points = DISCRETISATIONS[motion.trajectory.order].places
        constant = motion.trajectory.input_form.width == 0
        on_inputs = np.array([bool(row["inputs"]) for row in rows])
        on_states = np.array([bool(row["coordinates"]) or row["velocities"] for row in rows])
        parts, weights = [], []
        for share in (*PLACES, *points):
            little = constant and not np.isin(share, points)
            weight = np.where(on_inputs & on_states & little, VARYING, 1.0)
            for course in courses:
                parts.append(course.at(share))
                weights.append(np.tile(weight, (len(course.steps), 1)))
        q, v, u, t = (np.concatenate(part) for part in zip(*parts, strict=True))
        return cls(motion, q, v, u, t, np.concatenate(weights))

    @cached_property
    def r(self) -> Array:
        return self.motion.model.path_at(self.q, self.v, self.u, self.t)

    @cached_property
    def sizes(self) -> Array:
        model, sizes = self.motion.model, self.motion.sizes
        terms = model.path_terms(self.q, self.v, self.u, self.t)
        least = LEAST_SIZE * np.nan_to_num(terms).max(axis=0)
        extents = np.maximum(terms, least)
        rows = model.kernels.manifest["path_limits"]
        places = [j for j, row in enumerate(rows) if not (row["velocities"] or row["inputs"])]
        if places:
            slopes = np.abs(model.path_slopes_at(self.q, self.v, self.u, self.t)[:, places])
            moved = slopes[..., : model.nq] @ sizes.q + slopes[..., -1] * sizes.time
            extents[:, places] = np.nan_to_num(moved).max(axis=0)
        return np.where(extents > 0, extents, 1.0)
