"""How far and how fast the coordinates of a problem may be expected to move, by what it says, and
inputs around which its forces are looked at: zero, as long as these have slopes there."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dmoc.base.records import record
from dmoc.base.tolerances import BALANCED, ROUNDING, SAME
from dmoc.codegen.kernels import Array
from dmoc.mechanics.model import Model
from dmoc.mechanics.projection import onto_gap

if TYPE_CHECKING:
    from dmoc.problem.problem import Problem

# Times at which a surface is looked at to see how far it moves.
MOVING = 33
# Ends at this share of the way to a surface, or of what the forces alone do in a phase, say
# nothing, as the 1e-16 that a user has computed instead of 0.  A spring does as much in 14
# oscillations, which need finer meshes.
UNRESOLVED = 1e-3
# States at which forces are looked at, the start and others with coordinates so many reaches around
# it.
STATES, AROUND = 5, 0.3
# Where in its bounds an input is looked at; sizes of inputs without bounds, by half decades.
SHARE = 0.75
SIZES = 10.0 ** (np.arange(-24, 25) / 2)
# Bounds and position of each end, and its phase.
BOUNDARIES = ("start_bounds", "start_position", 0), ("goal_bounds", "goal_position", -1)


def onto_first(problem: Problem, q: Array) -> Array:
    """Move the free coordinates of a point, shape (nq,), onto the first surface of the sequence, as
    it is at the start; the point as it is where that does not lead there."""
    surfaces = [event.surface for event in problem.touch.events if event.impact]
    if not surfaces or not problem.unsaid.any():
        return q
    with np.errstate(all="ignore"):
        sizes = problem.unsaid / np.sqrt(np.abs(np.diagonal(problem.model.mass(q))))
        at = onto_gap(problem.model, q, surfaces[0], 0.0, sizes, np.inf)
    return q if at is None else at


def inertia_of(problem: Problem) -> Array:
    """Diagonal of the mass matrix at the start, shape (nq,)."""
    return np.diagonal(problem.model.mass(problem.start_position)).copy()


def reach_of(problem: Problem) -> Array:
    """How far each coordinate may be expected to move: to the goal, to zero, to the surfaces
    of the sequence, or, where that says nothing, what the inertias make of the reach of the
    others, which for a light leg are many turns: half of one is as far as it gets, shape (nq,)."""
    start, goal = problem.start_position, problem.goal_position
    ends = np.max(np.abs([goal - start, start, goal]), axis=0) * (1 - problem.unsaid)
    root = np.sqrt(np.abs(problem.inertia))
    root = np.where(root > 0, root, 1.0)
    away, shortest = _to_surfaces(problem, root)
    least = SAME * (np.maximum(ends, away) * root).max() / root
    least = np.maximum(least, UNRESOLVED * np.maximum(shortest, _swung(problem)))
    box = problem.coordinate_bounds
    width = np.where(
        np.isfinite(box).all(axis=1), np.ptp(np.where(np.isfinite(box), box, 0.0), axis=1), 0.0
    )
    reach = np.zeros(problem.nq)
    for other in (ends, away, width):
        reach = np.where(reach > least, reach, other)
    reach = np.where(reach > least, reach, (reach * root).max() / root)
    reach = reach if (reach > 0).all() else np.where(reach > 0, reach, _swing(problem))
    far = (reach > np.pi) & (np.maximum(ends, width) <= least)
    return np.where(far & _turns(problem), np.pi, reach) if far.any() else reach


def spread_of(problem: Problem) -> Array:
    """How far each coordinate may get where all move what their inertias make of the largest reach,
    half a turn at most for an angle that reaches no more, shape (nq,): a light link, of which
    neither the goal nor the surfaces ask much, may swing far on the way."""
    root, reach = np.sqrt(np.abs(problem.inertia)), problem.reach
    root = np.where(root > 0, root, 1.0)
    swing = np.minimum((reach * root).max() / root, np.pi)
    return np.where(_turns(problem), np.maximum(reach, swing), reach)


def gap_sizes(problem: Problem, q: Array, t: ArrayLike = 0.0) -> Array:
    """Sizes of the gaps at positions (..., nq) and times (...), of what makes them there and of how
    far they may move, where that is a number, shape (..., nc)."""
    moved = np.abs(problem.model.gap_slopes(q, t)[..., :-1]) @ problem.reach
    return np.asarray(np.fmax(problem.model.gap_sizes(q, t), moved))


def latest_time(problem: Problem) -> float:
    """The end of the time that a problem allows, or a time behind its beginning."""
    low, high = problem.final_time_bounds
    return float(high if np.isfinite(high) else 1.0 + 2.0 * low)


def rate_sizes(problem: Problem, slopes: Array, v: Array) -> Array:
    """Sizes of rates with some slopes (..., n, nq + 1), of velocities (..., nq) and of what makes
    the reach in the time that a problem allows, shape (..., n)."""
    fast = np.maximum(np.abs(v), problem.reach / latest_time(problem))
    one = np.ones((*v.shape[:-1], 1))
    return np.asarray((np.abs(slopes) @ np.concatenate([fast, one], axis=-1)[..., None])[..., 0])


def _to_surfaces(problem: Problem, root: Array) -> tuple[Array, Array]:
    """How far each coordinate alone is from the surfaces of the sequence, and its part of the
    shortest ways to them, where inertias with these roots measure lengths, shape (nq,) each."""
    start, away, shortest = problem.start_position, np.zeros(problem.nq), np.zeros(problem.nq)
    if not problem.kernels.surfaces:
        return away, shortest
    slopes, gaps = np.abs(problem.model.gap_slopes(start)), np.abs(problem.model.gaps(start))
    gaps = np.where(gaps <= problem.model.gap_rounding(start), 0.0, gaps)
    for j in {event.surface for event in problem.touch.events if event.impact}:
        with np.errstate(divide="ignore", invalid="ignore"):
            to = gaps[j] / slopes[j, :-1]
            part = (slopes[j, :-1] / root) ** 2
            way = to * (part / part.sum())
        away = np.where((away == 0) & np.isfinite(to), to, away)
        shortest = np.where(np.isfinite(way), np.maximum(shortest, way), shortest)
    return away, shortest


def _turns(problem: Problem) -> NDArray[np.bool_]:
    """Which coordinates are angles: inertias, forces and contacts are as before after a full turn,
    and not after another one, shape (nq,)."""
    model, nq = problem.model, problem.nq
    ways = np.vstack([np.zeros(nq), 2 * np.pi * np.eye(nq), np.eye(nq)])
    q = problem.start_position + np.cos(np.arange(nq)) + ways  # where no sine is zero
    v = np.ones_like(q)
    with np.errstate(all="ignore"):
        parts = (*model.equations(q, v), model.gaps(q), model.tangent_slopes(q))
        turned, other = np.ones(nq, bool), np.zeros(nq, bool)
        for part in parts:
            rows = part.reshape(len(q), -1)
            least = SAME * np.abs(rows).max(initial=0.0)
            moved = np.abs(rows[1:] - rows[0]).max(axis=1, initial=0.0)
            turned &= moved[:nq] <= least
            other |= moved[nq:] > least
    return turned & other


def _time(problem: Problem) -> float:
    low, high = problem.final_time_bounds
    return high if np.isfinite(high) else max(low, 0.0)


def _swung(problem: Problem) -> Array:
    """How far the forces alone move each coordinate up and down in a phase, shape (nq,)."""
    with np.errstate(all="ignore"):
        force = np.abs(problem.model.acceleration(problem.start_position, u=np.zeros(problem.nu)))
        return np.where(np.isfinite(force), force, 0.0) * (_time(problem) / problem.phases) ** 2 / 8


def _swing(problem: Problem) -> Array:
    """How far each coordinate gets in the time that a problem allows where nothing else says
    so, shape (nq,): up and down against its forces in a phase, or as far as surfaces of the
    sequence move; where these balance, what the inertias make of the others; 1 where these
    say nothing either."""
    swing = _swung(problem)
    with np.errstate(all="ignore"):
        times = np.linspace(0.0, _time(problem), MOVING)
        gaps = problem.model.gaps(np.tile(problem.start_position, (MOVING, 1)), times)
        slopes = np.abs(problem.model.gap_slopes(problem.start_position)[:, :-1])
        for j in {event.surface for event in problem.touch.events if event.impact}:
            moved = np.ptp(gaps[:, j]) / slopes[j]
            swing = np.where(np.isfinite(moved), np.maximum(swing, moved), swing)
    root = np.sqrt(np.abs(problem.inertia))
    share = (swing * root).max() / np.where(root > 0, root, 1.0)
    swing = np.where(swing > BALANCED * share, swing, share)
    return np.where(swing > 0, swing, 1.0)


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
        """Largest derivatives of the forces by each input, shape (STATES, nu), at inputs u, shape
        (nu,), as :func:`slopes_by_inputs` has them."""
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


def end_speeds_of(problem: Problem) -> Array:
    """Speeds that are fixed at the start or at the goal, shape (nq,); 0 where they are not."""
    return np.asarray(end_speeds_of_rows([problem])[0])


def end_speeds_of_rows(problems: Sequence[Problem]) -> Array:
    """Those of R problems of one model, shape (R, nq)."""
    speeds = np.zeros((len(problems), problems[0].nq))
    for bounds, position, phase in BOUNDARIES:
        velocities, impelled = np.zeros_like(speeds), list[int]()
        for k, problem in enumerate(problems):
            boundary = getattr(problem, bounds)
            if boundary.known_velocity is not None:
                velocities[k] = boundary.known_velocity
            elif (boundary.momentum[:, 0] == boundary.momentum[:, 1]).all():
                impelled.append(k)
        if impelled:
            models = [problems[k].models[phase] for k in impelled]
            model = Model(models[0].kernels, np.concatenate([m.par for m in models]))
            q = np.array([getattr(problems[k], position) for k in impelled])
            p = np.array([getattr(problems[k], bounds).momentum[:, 0] for k in impelled])
            velocities[impelled] = model.velocity(q, p)
        there = np.isfinite(velocities).all(axis=1)
        speeds[there] = np.maximum(speeds[there], np.abs(velocities[there]))
    return speeds
