"""The integrals of a motion by a quadrature that divides steps until it agrees with itself, along
the paths that are integrated from each node: what the motion says of them, and their bounds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dmoc.base.discretisation import gauss
from dmoc.check.checked_motion import Motion
from dmoc.check.findings import infinite_where_none
from dmoc.check.path_limits import ALMOST_NOTHING, Excess, IntegratedSteps
from dmoc.codegen.kernels import Array
from dmoc.mechanics.bound_kernels import Index

# Points of a part of a step, how often steps are halved, and the share of what a step adds that a
# part and its halves may differ by.
POINTS, DEEPEST, AGREES = 4, 10, 1e-6
PLACES, WEIGHTS = gauss(POINTS)


def integral_errors(
    motion: Motion, courses: Sequence[IntegratedSteps]
) -> tuple[float, tuple[Excess, ...]]:
    """The largest error of an integral that the motion says, relative to that of the magnitude, and
    the excesses of bounds of integrals, relative to value and bound, at least to the same."""
    names = motion.model.kernels.integrals
    if not names:
        return 0.0, ()
    parts = [_integrals(motion, course) for course in courses]
    values, sizes = np.sum(parts, axis=0)
    sizes = np.maximum(sizes, _least(motion, courses))
    sizes = np.where(sizes > 0, sizes, 1.0)
    totals = np.array(
        [motion.trajectory.totals.get(n, v) for n, v in zip(names, values, strict=True)]
    )
    error = float(infinite_where_none(np.abs(values - totals) / sizes).max())
    excesses = []
    for name, value, size in zip(names, values.tolist(), sizes.tolist(), strict=True):
        low, high = motion.trajectory.limits.get(name, (-np.inf, np.inf))
        bound = low if low - value > value - high else high
        excess = max(low - value, value - high) / max(size, abs(value) + abs(bound))
        if excess > 0:
            what = f"the bound of {name} ({value:.6g})"
            excesses.append(Excess(excess, excess, what, motion.trajectory.final_time))
    return error, tuple(excesses)


def _least(motion: Motion, courses: Sequence[IntegratedSteps]) -> Array:
    """Sizes of integrals below which there are rounding errors: a share of those over the whole
    time of motions whose velocities and inputs are of their sizes, shape (number,)."""
    sizes, states = motion.sizes, [c.at(0.5) for c in courses if len(c.steps)]
    q, _, u, t = (np.concatenate(part) for part in zip(*states, strict=True))
    used = np.abs(u).max(axis=0, initial=0.0)
    needed = np.where(np.isfinite(motion.needed_inputs), motion.needed_inputs, 0.0)
    v = np.tile(sizes.v, (len(q), 1))
    c = motion.model.integrands(q, v, np.tile(np.maximum(used, needed), (len(q), 1)), t)
    most = np.nan_to_num(np.abs(c), posinf=0.0).max(axis=0)
    return np.asarray(ALMOST_NOTHING * sizes.time * most)


def _integrals(motion: Motion, course: IntegratedSteps) -> Array:
    """Integrals over the steps of a mode, and those of the magnitudes, shape (2, number)."""
    steps = np.arange(len(course.steps))
    if not len(steps):
        return np.zeros((2, len(motion.model.kernels.integrals)))
    low, width = np.zeros(len(steps)), np.ones(len(steps))
    whole = _over(motion, course, steps, low, width)
    sums, enough = np.zeros(whole[:, 0].shape), AGREES * whole[1].sum(axis=0) / len(steps)
    for depth in range(DEEPEST):
        starts = np.stack([low, low + width / 2], axis=1)
        halves = [_over(motion, course, steps, start, width / 2) for start in starts.T]
        both = halves[0] + halves[1]
        rough = (np.abs(both - whole) > enough).any(axis=(0, 2)) & (depth + 1 < DEEPEST)
        sums += both[:, ~rough].sum(axis=1)
        if not rough.any():
            break
        whole = np.concatenate([half[:, rough] for half in halves], axis=1)
        steps, width = (np.tile(a[rough], 2) for a in (steps, width / 2))
        low = starts[rough].T.ravel()
    return sums


def _over(motion: Motion, course: IntegratedSteps, steps: Index, low: Array, width: Array) -> Array:
    """Integrals over parts of steps, and those of the magnitudes, shape (2, parts, number)."""
    own, parts = course.part(steps), []
    for place, weight in zip(PLACES, WEIGHTS, strict=True):
        c = motion.model.integrands(*own.at(low + width * place))
        parts.append((weight * width * own.steps.h)[:, None] * np.stack([c, np.abs(c)]))
    return np.asarray(np.sum(parts, axis=0))
