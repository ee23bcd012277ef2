"""Inputs around which the forces of a problem are looked at: zero, as long as these have slopes
there."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dmoc.base.records import record
from dmoc.base.tolerances import ROUNDING
from dmoc.codegen.kernels import Array

if TYPE_CHECKING:
    from dmoc.problem.problem import Problem

# States at which forces are looked at, the start and others with coordinates so many reaches around
# it.
STATES, AROUND = 5, 0.3
# Where in its bounds an input is looked at; sizes of inputs without bounds, by half decades.
SHARE = 0.75
SIZES = 10.0 ** (np.arange(-24, 25) / 2)


def operating_inputs_of(problem: Problem) -> Array:
    """Inputs at which each of them changes the forces, shape (nu,): zero, unless the forces have no
    slope by one of them at zero or at its bound beside zero, as those of u^2 or u w; then values
    within the bounds, or of a size that balances the forces that there are, of as few inputs as it
    takes."""
    zero, every = np.zeros(problem.nu), np.ones(problem.nu)
    if enter_linearly(problem):
        return zero
    with np.errstate(all="ignore"):
        forces = _Forces.of(problem)
        idle = [forces.slopes(u) for u in (zero, np.clip(zero, *problem.input_bounds.T))]
        beside = [forces.slopes(forces.sized(signs)) for signs in (every, -every)]
        flat = np.any([_vanishing(at, other) for at in idle for other in beside], axis=0)
        if not flat.any():
            return zero
        supports = [*np.eye(problem.nu), 1.0 * flat, 1.0 * ~flat, every]
        candidates = [forces.sized(sign * s) for s in supports for sign in (1.0, -1.0)]
        return max(candidates, key=lambda u: int((forces.slopes(u) > 0).any(axis=0).sum()))


def enter_linearly(problem: Problem) -> bool:
    """Whether the forces have the same slopes by the inputs at all inputs."""
    return bool(not problem.nu or problem.kernels.manifest.inputs_enter_linearly)


def slopes_by_inputs(problem: Problem, q: Array, v: Array, u: Array, t: Array) -> Array:
    """Largest derivatives of the generalised forces by each input at states, by the roots of the
    inertias, shape (n, nu); zero where they are no numbers."""
    B = problem.model.input_matrix(q, v, u, t) / np.sqrt(problem.inertia)[:, None]
    size = np.abs(B).max(axis=1)
    return np.where(np.isfinite(size), size, 0.0)


def _vanishing(slopes: Array, others: Array) -> NDArray[np.bool_]:
    """The inputs whose slopes, shape (n, nu), are none beside others wherever these are some."""
    some = others > 0
    none = slopes <= ROUNDING * others
    return np.asarray(some.any(axis=0) & (none | ~some).all(axis=0))


@record(frozen=True, eq=False)
class _Forces:
    """The forces of a problem at positions around its start and velocities that make the reach in
    its time, shape (STATES, nq) each, and the size that inputs have to balance, by the roots of the
    inertias."""

    problem: Problem
    q: Array
    v: Array
    needed: float

    @classmethod
    def of(cls, problem: Problem) -> _Forces:
        low, high = problem.final_time_bounds
        time = high if np.isfinite(high) else low or 1.0
        draws = np.random.default_rng(0).standard_normal((2, STATES, problem.nq))
        draws[0, 0] = 0.0
        q, v = problem.start_position + AROUND * draws[0] * problem.reach, draws[1] * problem.reach
        root = np.sqrt(problem.inertia)
        still = np.abs(problem.model.equations(q)[1] / root)
        needed = np.nanmax([*still.ravel(), *(root * problem.reach / time**2)])
        return cls(problem, q, v / time, float(needed))

    def slopes(self, u: Array) -> Array:
        rows = np.tile(u, (STATES, 1))
        return slopes_by_inputs(self.problem, self.q, self.v, rows, np.zeros(STATES))

    def sized(self, signs: Array) -> Array:
        """Inputs of some signs, or zero: shares of their bounds; without these of a size with which
        they first change the forces by as much as they have to balance, or of size 1."""
        low, high = self.problem.input_bounds.T
        below, above = np.isfinite(low), np.isfinite(high)
        base = np.where(below, low, np.where(above, high, 0.0))
        inward = np.where(below, 1.0, np.where(above, -1.0, signs))
        inside = low + (0.5 + signs * (SHARE - 0.5)) * (high - low)
        sized = np.where(below & above, inside, base + inward * SIZES[:, None])
        sized = np.where(signs == 0, np.clip(0.0, low, high), sized)
        first = np.append(self._changes(sized) >= self.needed, True).argmax()
        return np.asarray(sized[first if first < len(SIZES) else len(SIZES) // 2])

    def _changes(self, inputs: Array) -> Array:
        """The largest changes of the forces by rows of inputs."""
        rows, root = np.repeat(inputs, STATES, axis=0), np.sqrt(self.problem.inertia)
        q, v = (np.tile(part, (len(inputs), 1)) for part in (self.q, self.v))
        pushed, idle = (self.problem.model.equations(q, v, u)[1] / root for u in (rows, None))
        change = np.abs(pushed - np.where(np.isfinite(idle), idle, 0.0))
        change = np.where(np.isfinite(change), change, 0.0)
        return np.asarray(change.reshape(len(inputs), -1).max(axis=1))
