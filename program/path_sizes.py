"""Sizes of path constraints and of quantities."""

from __future__ import annotations

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.program.blocks import Index
from dmoc.program.iterate import Iterate

# Newton steps to where a path constraint is met, and its value there as a share of what unknowns of
# their sizes move it by.
NEWTON, MET = 12, 1e-6


def finite(values: Array, otherwise: float) -> Array:
    """Numbers, and another one in the place of those that are none."""
    return np.where(np.isfinite(values), values, otherwise)


def path_sizes(at: Iterate, steps: tuple[list[Array], ...], local: Array, kind: str) -> Array:
    """Sizes of the path constraints, or of the quantities: the largest change that an unknown of
    its ``local`` size makes in any step, of a constraint that the motion is near to the limit of
    where it is met; of what none changes, as a product where both factors vanish, the largest value
    in these ``steps`` or in sized ones."""
    kernels, model = at.problem.kernels, at.model
    count = len(kernels.quantities if kind == "quantity" else kernels.manifest.path_rows)
    if not count:
        return np.ones(0)
    changes = finite(np.abs(model.path_slopes(steps[0], kind) * local[:, None]), 0.0)
    size = changes.max(axis=(0, 2)).reshape(-1, count).max(axis=0)
    if kind == "path":
        at_limits = _at_limits(at, local, count)
        size = np.where(at_limits > 0, at_limits, size)
    for step in steps:
        values = finite(np.abs(model.path(step, kind)), 0.0).max(axis=0)
        size = np.where(size > 0, size, values.reshape(-1, count).max(axis=0))
    return np.where(size > 0, size, 1.0)


def _at_limits(at: Iterate, local: Array, count: int) -> Array:
    """The largest changes of path constraints (count,) by unknowns of their sizes where each is
    met, near the step that is closest to there; zero where that is farther away than these sizes.
    A violation divided by them is a distance."""
    phases, rows, step = at.lay.phase_of_step, np.arange(count), at.steps

    def looked_at(phases: Index, step: list[Array], local: Array) -> tuple[Array, Array]:
        """Values and changes of all constraints at their places."""
        model = at.problem.models.along(phases)
        return model.path(step), model.path_slopes(step) * local[:, None]

    values, changes = looked_at(phases, step, local)
    far = np.abs(values) / np.sqrt((changes * changes).sum(axis=2))
    far = finite(far, np.inf).reshape(-1, count)
    places = values.shape[1] // count
    nearest, place = np.divmod(far.argmin(axis=0), places)
    column, size = place * count + rows, local[nearest]
    begin, moved = np.hstack([part[nearest] for part in step]), np.zeros_like(size)
    ends = np.cumsum([part.shape[1] for part in step])[:-1]
    for _ in range(NEWTON):
        state = np.split(begin + moved * size, ends, axis=1)
        values, changes = looked_at(phases[nearest], state, size)
        value, change = values[rows, column], changes[rows, column]
        moved = moved - (value / (change * change).sum(axis=1))[:, None] * change
    most = np.abs(change).max(axis=1)
    met = (np.abs(value) <= MET * most) & (np.abs(moved).max(axis=1) <= 1)
    return np.where(met, most, 0.0)
