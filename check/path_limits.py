"""By how much a motion exceeds its path constraints and the bounds of its velocities and
quantities: at the nodes and between them, on the path that is integrated from each node."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dmoc.base.discretisation import DISCRETISATIONS
from dmoc.base.names import velocity_name
from dmoc.base.records import record
from dmoc.check.checked_motion import Motion
from dmoc.codegen.kernels import Array
from dmoc.mechanics.bound_kernels import Index
from dmoc.mechanics.contact_mode import Mode
from dmoc.simulation.flow import PLACES, Steps

# Share of the largest terms of a constraint by which it counts at least, where they all vanish.
LEAST_SIZE = 0.02
# And share of what the sizes of the motion could move it by, where nothing of it moves: rounding
# errors are no excess.
ALMOST_NOTHING = 1e-4
# What an excess counts between the quadrature points of a constraint that contains both states and
# inputs that are constant in a step: it varies there by a share of h instead of h^2.
VARYING = 0.05


@record(frozen=True, eq=False)
class IntegratedSteps:
    """Steps that were integrated from their first nodes: states (n, 2 nq ...) at both ends, and
    the accelerations there (n, 2, nq)."""

    steps: Steps
    start: Array
    ends: Array
    stop: Array

    def part(self, which: Index | slice) -> IntegratedSteps:
        """Some of them."""
        ends = (a[which] for a in (self.start, self.ends, self.stop))
        return IntegratedSteps(self.steps.part(which), *ends)

    def at(self, share: float | Array) -> tuple[Array, Array, Array, Array]:
        """q, v, u and t at a share of every step, one for all or one for each: the polynomial of
        degree 5."""
        nq = self.ends.shape[2]
        h, s = self.steps.h[:, None], np.reshape(share, (-1, 1))
        q, v, a = self.start[:, :nq], h * self.start[:, nq : 2 * nq], h**2 * self.ends[:, 0]
        d = self.stop[:, :nq] - q - v - a / 2
        e = h * self.stop[:, nq : 2 * nq] - v - a
        f = h**2 * self.ends[:, 1] - a
        c3, c4, c5 = 10 * d - 4 * e + f / 2, -15 * d + 7 * e - f, 6 * d - 3 * e + f / 2
        place = q + s * (v + s * (a / 2 + s * (c3 + s * (c4 + s * c5))))
        rate = v + s * (a + s * (3 * c3 + s * (4 * c4 + s * 5 * c5)))
        u = self.steps.u0 + s * (self.steps.u1 - self.steps.u0)
        return place, rate / h, u, self.steps.t + s[:, 0] * self.steps.h


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
        """What contradicts the motion."""
        share = 100 * self.share
        return f"{self.what} is exceeded by {share:.3g} % of its size at {self.time:.4g} s"


def path_excess(motion: Motion, courses: Sequence[IntegratedSteps]) -> tuple[Excess, ...]:
    """The largest excess of each path constraint and each bound that is exceeded.

    The size of a constraint is that of its terms, at the time itself; of one in coordinates alone,
    how far the ranges of the motion move it.  The terms of a bound are the value and the bound.
    """
    names = motion.model.kernels.manifest["path_constraints"]
    integrals = motion.model.kernels.integrals
    limits = {n: box for n, box in motion.trajectory.limits.items() if n not in integrals}
    if not names and not limits:
        return ()
    path = _Path.of(motion, courses)
    parts = [path.constraints()] if names else []
    parts += [path.bounds(name, *ends) for name, ends in limits.items()]
    texts = [f"path constraint {name!r}" for name in names] + [f"the bound of {n}" for n in limits]
    share = np.nan_to_num(np.hstack([part[0] for part in parts]), nan=np.inf)
    counts = np.hstack([part[1] for part in parts]) * share
    return tuple(
        Excess(float(counts[row, j]), float(share[row, j]), texts[j], float(path.t[row]))
        for j, row in enumerate(counts.argmax(axis=0))
        if counts[row, j] > 0
    )


def _pushed(motion: Motion, mode: Mode, q: Array, v: Array, u: Array, t: Array) -> Array:
    """Accelerations and forces of the flow at states of a mode, (n, ny)."""
    if not motion.model.ny:
        return np.zeros((len(q), 0))
    r = motion.flow.integrator.reaction(mode, np.hstack([q, v]), u, t)
    return np.hstack([r.acceleration, r.normal, r.tangential, r.joint])


@record(frozen=True, eq=False)
class _Path:
    """States of a motion at n places, with the accelerations and forces of the flow there, if
    quantities contain any, which ones are quadrature points, and which one is the state after an
    event that ends the motion, where no inputs act."""

    motion: Motion
    q: Array
    v: Array
    u: Array
    t: Array
    y: Array
    at_points: NDArray[np.bool_]
    after: NDArray[np.bool_]

    @classmethod
    def of(cls, motion: Motion, courses: Sequence[IntegratedSteps]) -> _Path:
        points = DISCRETISATIONS[motion.trajectory.order].places
        parts, at_points = [], []
        for share in (*PLACES, *points):
            for piece, course in zip(motion.pieces, courses, strict=True):
                state = course.at(share)
                parts.append((*state, _pushed(motion, piece.mode, *state)))
                at_points.append(np.full(len(course.steps), bool(np.isin(share, points))))
        for phase, mode in zip(motion.trajectory.phases, motion.modes, strict=True):
            if not phase.steps:
                state = phase.q, phase.v, motion.trajectory.last_inputs[None], phase.t
                parts.append((*state, _pushed(motion, mode, *state)))
        q, v, u, t, y = (np.concatenate(part) for part in zip(*parts, strict=True))
        along, after = np.concatenate(at_points), np.zeros(len(t), dtype=bool)
        after[len(along) :] = True
        return cls(motion, q, v, u, t, y, np.append(along, after[len(along) :]), after)

    def constraints(self) -> tuple[Array, Array]:
        """Excesses of the path constraints as shares of their sizes, and what they count, shape
        (n, nr) each."""
        model = self.motion.model
        r = model.path_at(self.q, self.v, self.u, self.t)
        return -r / self._sizes(), self._weights(model.kernels.manifest["path_limits"])

    def bounds(self, name: str, low: float, high: float) -> tuple[Array, Array]:
        """The same of a velocity or a quantity within its bounds, shape (n, 1)."""
        model, none = self.motion.model, {"coordinates": [], "velocities": True, "inputs": False}
        rates = [velocity_name(q) for q in model.kernels.coordinates]
        if name in rates:
            i = rates.index(name)
            value, row, moved = self.v[:, i], none, self.motion.sizes.v[i]
        else:
            j = model.kernels.quantities.index(name)
            state = self.q, self.v, self.u, self.t, self.y
            value, row = model.quantities(*state)[:, j], model.kernels.quantity_rows[j]
            moved = self._moved(model.quantity_slopes(*state))[j]
        excess = np.maximum(low - value, value - high)
        sizes = np.abs(value) + np.abs(np.where(low - value > value - high, low, high))
        largest = LEAST_SIZE * np.nan_to_num(sizes, posinf=0.0).max(initial=0.0)
        sizes = np.maximum(sizes, max(largest, ALMOST_NOTHING * moved))
        return (excess / np.where(sizes > 0, sizes, 1.0))[:, None], self._weights([row])

    def _moved(self, slopes: Array) -> Array:
        """What coordinates, velocities, inputs, accelerations and forces of their sizes, and the
        time, could move functions by, from their slopes (n, rows, size of all)."""
        sizes, needed = self.motion.sizes, self.motion.needed_inputs
        used = np.abs(self.u).max(axis=0, initial=0.0)
        inputs = np.maximum(used, np.where(np.isfinite(needed), needed, 0.0))
        forces = np.abs(self.y).max(axis=0, initial=0.0)
        ways = np.concatenate([sizes.q, sizes.v, inputs, [sizes.time], forces])
        ways = ways[: slopes.shape[2]]  # path constraints contain no forces
        return np.asarray(np.nan_to_num(np.abs(slopes) @ ways, posinf=0.0).max(axis=0))

    def _weights(self, rows: Sequence[Mapping[str, Any]]) -> Array:
        """What excesses of functions count, shape (n, len(rows))."""
        constant = self.motion.trajectory.input_form.width == 0
        varies = [r["inputs"] and (bool(r["coordinates"]) or r["velocities"]) for r in rows]
        little = ~self.at_points[:, None] & np.array(varies, dtype=bool) & constant
        acts = np.array([r["inputs"] or bool(r.get("forces")) for r in rows], dtype=bool)
        return np.where(self.after[:, None] & acts, 0.0, np.where(little, VARYING, 1.0))

    def _sizes(self) -> Array:
        """Sizes of the path constraints, shape (n, nr)."""
        model, sizes = self.motion.model, self.motion.sizes
        terms = model.path_terms(self.q, self.v, self.u, self.t)
        slopes = model.path_slopes_at(self.q, self.v, self.u, self.t)
        least = LEAST_SIZE * np.nan_to_num(terms).max(axis=0)
        extents = np.maximum(terms, np.maximum(least, ALMOST_NOTHING * self._moved(slopes)))
        rows = model.kernels.manifest["path_limits"]
        places = [j for j, row in enumerate(rows) if not (row["velocities"] or row["inputs"])]
        if places:
            own = np.abs(slopes[:, places])
            moved = own[..., : model.nq] @ sizes.q + own[..., -1] * sizes.time
            extents[:, places] = np.nan_to_num(moved).max(axis=0)
        return np.where(extents > 0, extents, 1.0)
