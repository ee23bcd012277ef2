"""Forces of the conditions of a mode (:mod:`dmoc.mechanics.conditions`) at states of a motion.

What a mode makes of accelerations and forces says :mod:`dmoc.simulation.integrator`.  A closed
contact breaks where its force would pull, what sticks where its friction holds it no more
(:func:`kept`); a joint does not break.  An impact obeys the same relations with impulses for forces
and rates for second derivatives.

Of a ladder that rests with friction on a floor and against a wall, or of a rod that sticks at both
ends, the accelerations determine only some sums of forces.  Of the forces that have the same effect
a reaction has the smallest.  Those may pull or leave a cone of friction where others do not: a mode
is possible if any of them are borne.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dmoc.base.records import record
from dmoc.base.tolerances import DEPENDENT, SAME
from dmoc.codegen.kernels import Array
from dmoc.mechanics.algebra import REGULAR
from dmoc.mechanics.conditions import (
    GAPS,
    TANGENTS,
    Conditions,
    Forces,
    conditions_of,
    number_of,
    sizes_by_mass,
)
from dmoc.mechanics.contact_mode import Mode
from dmoc.mechanics.model import Model
from dmoc.simulation.tolerances import Tolerances

# The share of the longest that each of the pushes is at least which are far from dependent.
ALIKE = 1e-3
# A force has as much of itself in a projection on forces without effect, where it has a part in it:
# its square, in which rounding errors are far below.
UNDETERMINED = 1e-6


@record(frozen=True, eq=False)
class Reaction:
    """Accelerations (n, nq), contact forces (n, nc), friction forces (n, nt) and forces of joints
    (n, nj) of rows of states; zero where a surface is open or a tangent does not rub."""

    acceleration: Array
    normal: Array
    tangential: Array
    joint: Array

    @property
    def forces(self) -> Forces:
        return Forces(self.normal, self.tangential, self.joint)


# Forces that the accelerations do not determine --------------------------------------------------


def without_effect(model: Model, held: Conditions, q: Array, t: Array) -> Array:
    """Projections (n, m, m) of the multipliers of conditions, at q (n, nq) and t (n,), on those
    that accelerate nothing; zero where all are determined, and not a number where the masses are
    none."""
    C, M = held.slopes(model, q, t)[..., :-1], model.mass(q, t)
    size, mass = sizes_by_mass(M, C), np.sqrt(np.abs(np.diagonal(M, axis1=1, axis2=2)))
    B = held.pushes(model, q, t, C) / size[:, :, None]
    push = np.swapaxes(B / np.where(mass > 0, mass, 1.0)[:, None, :], 1, 2)
    if not np.isfinite(push).all():
        return np.full((len(q), push.shape[2], push.shape[2]), np.nan)
    if _independent(push):
        return np.zeros((len(q), push.shape[2], push.shape[2]))
    rest = np.eye(push.shape[2]) - np.linalg.pinv(push, rcond=DEPENDENT) @ push
    largest = np.diagonal(rest, axis1=1, axis2=2).max(axis=1)
    rest = np.where(largest[:, None, None] > UNDETERMINED, rest, 0.0)
    return np.asarray(rest / size[:, :, None] * size[:, None, :])


def _independent(columns: Array) -> bool:
    """Whether the columns of matrices (n, nq, m) are alike in length and far from dependent."""
    length = np.sqrt((columns * columns).sum(axis=1))
    if not (length.min(axis=1) > ALIKE * length.max(axis=1)).all():
        return False
    unit = columns / length[:, None]
    return bool((np.linalg.det(np.swapaxes(unit, 1, 2) @ unit) > REGULAR).all())


def borne(model: Model, mode: Mode, reaction: Reaction, q: Array, t: Array) -> Reaction:
    """A reaction of n rows whose forces are those with the same effect that stay furthest from
    pulling and from the edges of their cones, in rows whose smallest forces are not borne.
    Positions q have the shape (n, nq), times t (n,)."""
    if number_of(model, mode) < 2:
        return reaction
    held = conditions_of(model, mode)
    bad = np.flatnonzero(~(held.margins(model, reaction.forces) >= 0).all(axis=1))
    if not len(bad):
        return reaction
    free = without_effect(model, held, q[bad], t[bad])
    if not np.isfinite(free).all() or not free.any():
        return reaction
    forces = Forces(*(rows.copy() for rows in reaction.forces))
    for row, P in zip(bad, free, strict=True):
        one = Forces(*(rows[[row]] for rows in forces))
        changes = held.changes(model, P.T)
        best = _furthest(model, held, one, changes, round(float(np.trace(P))))
        for rows, change in zip(forces, changes, strict=True):
            rows[row] += best @ change
    return Reaction(reaction.acceleration, *forces)


def nearest(
    model: Model, mode: Mode, reaction: Reaction, q: Array, t: Array, planned: Array
) -> Reaction:
    """A reaction with the same effect at q (n, nq) and t (n,), whose forces are next to planned
    ones (n, m). These are of closed contacts, of tangents that stick and, if planned too, of
    joints."""
    held = conditions_of(model, mode)
    if len(held) < 2:
        return reaction
    free, own = without_effect(model, held, q, t), held.gathered(reaction.forces)
    if not np.isfinite(free).all() or not free.any():
        return reaction
    planned = np.hstack([planned, own[:, planned.shape[1] :]])
    lam = own + (free @ (planned - own)[..., None])[..., 0]
    return Reaction(reaction.acceleration, *held.spread(model, lam))


def names_without_effect(model: Model, mode: Mode, q: Array, t: float) -> tuple[list[str], ...]:
    """Surfaces whose contact forces, and tangents whose friction, are not determined."""
    held = conditions_of(model, mode)
    if len(held) < 2:
        return [], []
    free = np.diagonal(without_effect(model, held, q[None], np.array([t]))[0]) > UNDETERMINED
    names = model.kernels.surfaces, model.kernels.tangents
    return tuple(
        [of[j] for i, j in zip(*held.places(functions), strict=True) if free[i]]
        for of, functions in zip(names, (GAPS, TANGENTS), strict=True)
    )


def _furthest(model: Model, held: Conditions, forces: Forces, changes: Forces, count: int) -> Array:
    """Multiples, shape (k,), of k changes, of which ``count`` are independent, that make the least
    margin largest: a linear program; zero where it has no solution."""
    least, none = held.margins(model, forces)[0], Forces(*(0 * rows for rows in changes))
    slopes = (held.margins(model, changes) - held.margins(model, none)).T
    size = float(np.abs(least).max())
    if not size > 0:
        return np.zeros(len(changes[0]))
    if count == 1:
        most = int(np.abs(slopes).max(axis=0).argmax())
        along = _furthest_along(least / size, slopes[:, most]) * size
        return np.where(np.arange(len(changes[0])) == most, along, 0.0)
    from scipy.optimize import linprog  # here, because the check does without SciPy

    rows = np.hstack([-slopes, np.ones((len(least), 1))])
    goal = np.append(np.zeros(slopes.shape[1]), -1.0)
    answer = linprog(
        goal, rows, least / size, bounds=[*[(None, None)] * slopes.shape[1], (None, 1.0)]
    )
    return np.asarray(answer.x[:-1] * size) if answer.success else np.zeros(len(changes[0]))


def _furthest_along(least: Array, slopes: Array) -> float:
    """The multiple of one change that makes the least margin largest, up to 1: where two margins
    are alike, or one is 1."""
    rising = slopes[:, None] - slopes
    apart, moved = np.abs(rising) > SAME * np.abs(slopes).max(), slopes != 0
    alike = (least - least[:, None])[apart] / rising[apart]
    x = np.concatenate([alike, (1 - least[moved]) / slopes[moved]])
    worst = np.minimum((least + x[:, None] * slopes).min(axis=1), 1.0)
    return float(x[np.lexsort((np.abs(x), -worst))[0]])


# What a mode keeps --------------------------------------------------------------------------------


def limits(
    model: Model, react: Callable[..., Reaction], mode: Mode, rows: tuple[Array, Array, Array],
    past: Array | None = None,
) -> Array:  # fmt: skip
    """The limits :func:`kept` of a mode, shape (n, 2 nc + 2 nt), at rows of states (n, 2 nq),
    inputs (n, nu) and times (n,); ``react`` is the reaction of an integrator, ``past`` the W up to
    which a surface with ends is not there, shape (nc,), none where not said."""
    nq, (y, u, t) = model.nq, rows
    q, v = (np.ascontiguousarray(y[:, i * nq : (i + 1) * nq]) for i in (0, 1))
    reaction, model = react(mode, y, u, t), model.with_friction_at(q, v, u, t)
    return kept(model, mode, borne(model, mode, reaction, q, t), (q, v, t), past)


def kept(
    model: Model,
    mode: Mode,
    reaction: Reaction,
    at: tuple[Array, Array, Array],
    past: Array | None,
) -> Array:
    """Numbers that a mode keeps from falling below zero at q and v (n, nq) and t (n,), shape (n, 2
    nc + 2 nt); infinite where there is nothing to keep. They are minus the gap of an open surface
    or the force of a closed one, the friction that tangents that stick can still bear, sliding
    velocities in their directions, and how far closed surfaces with ends go on. What a grip holds
    it keeps until it lets go; one with a strength has what this leaves, at its first place."""
    (q, v, t), closed, stuck = at, list(mode.closed), list(mode.sticking)
    # What the motion is beside holds it back where it comes over it alone.
    least = -(model.gaps(q, t) if past is None else model.barriers(q, t, past))
    least[:, closed] = reaction.normal[:, closed]
    least[:, model.contacts.pull] = np.inf
    for j, left in model.spared(reaction.normal, (*closed, *model.gripped)):
        least[:, j] = left
    bears, slides = np.full((len(q), model.nt), np.inf), np.full((len(q), model.nt), np.inf)
    if stuck:
        needs = model.contacts.needed(reaction.tangential)
        bears[:, stuck] = (model.bearing(reaction.normal) - needs)[:, stuck]
    if mode.sliding:
        rates = model.slide_rates(q, v, t)
        for k, forward in conditions_of(model, mode).forward(rates).items():
            slides[:, k] = forward
    ends = np.full_like(least, np.inf)
    on = [j for j in closed if j in model.ends]
    if on:
        ends[:, on] = model.within(q, t)[:, on]
    return np.concatenate([least, bears, slides, ends], axis=1)


def limit_by_motion(
    model: Model, mode: Mode, which: int, at: tuple[Array, Array, Array]
) -> float | None:
    """One of the limits :func:`kept` of a mode at q and v (1, nq) and t (1,), of those that no
    force has a part in: of an open surface, or of what slides; None of others."""
    (q, v, t), tangent = at, which - model.nc - model.nt
    if which < model.nc and not (which in mode.closed or model.contacts.pull[which]):
        return -float(model.gaps(q, t)[0, which])
    slides = conditions_of(model, mode).forward(model.slide_rates(q, v, t)) if tangent >= 0 else {}
    return float(slides[tangent][0]) if tangent in slides else None


def slack(model: Model, mode: Mode, small: Tolerances) -> Array:
    """Sizes that count as zero of the limits of a mode, shape (2 nc + 2 nt,)."""
    kept, pressed = small.gap.copy(), [*mode.closed, *model.gripped]
    kept[pressed] = small.force[pressed]
    return np.concatenate([kept, small.hold, small.slide, small.within])
