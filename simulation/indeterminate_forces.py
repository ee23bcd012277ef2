"""Contact forces that the accelerations do not determine: of a ladder that rests with friction on
a floor and against a wall, or of a rod that sticks at both ends, only some sums of forces have an
effect.

Of the forces that have the same effect :func:`dmoc.simulation.contact_modes.reaction` has the
smallest.  Those may pull or leave a cone of friction where others do not: a mode is possible if any
of them are borne.
"""

from __future__ import annotations

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.mechanics.contact_mode import Mode
from dmoc.mechanics.model import Model
from dmoc.simulation.contact_modes import REDUNDANT, Reaction, columns, conditions, spread

# Entries of a projection on forces without effect above this are more than rounding errors.
UNDETERMINED = 1e-6


def without_effect(model: Model, mode: Mode, q: Array, t: Array) -> Array:
    """Projections (n, m, m) of the multipliers of a mode on those that accelerate nothing; zero
    where all are determined, and not a number where the masses are none."""
    c, M = conditions(model, mode, q, t), model.mass(q, t)
    squares = np.einsum("nmi,nim->nm", c.C, columns(M, c.C))
    size = np.where(squares > 0, np.sqrt(np.abs(squares)), 1.0)
    mass = np.sqrt(np.abs(np.diagonal(M, axis1=1, axis2=2)))
    push = np.swapaxes(c.B / size[:, :, None] / np.where(mass > 0, mass, 1.0)[:, None, :], 1, 2)
    if not np.isfinite(push).all():
        return np.full((len(q), push.shape[2], push.shape[2]), np.nan)
    rest = np.eye(push.shape[2]) - np.linalg.pinv(push, rcond=REDUNDANT) @ push
    rest = np.where(np.abs(rest) > UNDETERMINED, rest, 0.0)
    return np.asarray(rest / size[:, :, None] * size[:, None, :])


def borne(model: Model, mode: Mode, found: Reaction, q: Array, t: Array) -> Reaction:
    """A reaction whose forces are those with the same effect that stay furthest from pulling and
    from the edges of their cones, in rows whose smallest forces are not borne."""
    margins = _margins(model, mode, (found.normal, found.tangential))
    bad = np.flatnonzero(~(margins >= 0).all(axis=1))
    if not len(bad) or len(mode.closed) + len(mode.sticking) + model.nj < 2:
        return found
    free = without_effect(model, mode, q[bad], t[bad])
    if not np.isfinite(free).all() or not free.any():
        return found
    normal, tangential, joint = found.normal.copy(), found.tangential.copy(), found.joint.copy()
    for row, P in zip(bad, free, strict=True):
        forces = found.normal[[row]], found.tangential[[row]]
        changes = spread(model, mode, P.T)
        best = _furthest(model, mode, forces, changes)
        normal[row] += best @ changes[0]
        tangential[row] += best @ (changes[1] - spread(model, mode, 0 * P.T)[1])
        joint[row] += best @ changes[2]
    return Reaction(found.acceleration, normal, tangential, joint)


def nearest(
    model: Model, mode: Mode, found: Reaction, q: Array, t: Array, planned: Array
) -> Reaction:
    """A reaction with the same effect whose forces are next to planned ones of what is closed and
    what sticks (n, count); those of joints are what they are."""
    if planned.shape[1] + model.nj < 2:
        return found
    free = without_effect(model, mode, q, t)
    if not np.isfinite(free).all() or not free.any():
        return found
    own = np.hstack([found.normal[:, list(mode.closed)], found.tangential[:, list(mode.sticking)]])
    lam = np.hstack([own, found.joint])
    off = np.hstack([planned - own, np.zeros_like(found.joint)])
    lam = lam + (free @ off[..., None])[..., 0]
    return Reaction(found.acceleration, *spread(model, mode, lam))


def names_without_effect(model: Model, mode: Mode, q: Array, t: float) -> tuple[list[str], ...]:
    """Surfaces whose contact forces, and tangents whose friction, are not determined."""
    if len(mode.closed) + len(mode.sticking) + model.nj < 2:
        return [], []
    free = np.diagonal(without_effect(model, mode, q[None], np.array([t]))[0]) > 0
    on, rubs, count = model.kernels.surfaces, model.kernels.tangents, len(mode.closed)
    return (
        [on[j] for j, loose in zip(mode.closed, free, strict=False) if loose],
        [rubs[k] for k, loose in zip(mode.sticking, free[count:], strict=False) if loose],
    )


def _margins(model: Model, mode: Mode, forces: tuple[Array, Array]) -> Array:
    """What must not be negative, rows of contact forces and of what friction holds beyond the
    force that sticks, in either direction."""
    (N, T), stuck = forces, list(mode.sticking)
    held, rubs = model.bearing(N)[:, stuck], T[:, stuck]
    return np.hstack([N[:, list(mode.closed)], held - rubs, held + rubs])


def _furthest(
    model: Model, mode: Mode, forces: tuple[Array, Array], changes: tuple[Array, Array, Array]
) -> Array:
    """How much of each change makes the least margin largest: a linear program; nothing where it
    has no solution."""
    from scipy.optimize import linprog  # here, because the check does without SciPy

    least = _margins(model, mode, forces)[0]
    none, changed = (0 * changes[0], 0 * changes[1]), changes[:2]
    slopes = (_margins(model, mode, changed) - _margins(model, mode, none)).T
    size = float(np.abs(least).max())
    if not size > 0:
        return np.zeros(len(changes[0]))
    rows = np.hstack([-slopes, np.ones((len(least), 1))])
    goal = np.append(np.zeros(slopes.shape[1]), -1.0)
    answer = linprog(
        goal, rows, least / size, bounds=[*[(None, None)] * slopes.shape[1], (None, 1.0)]
    )
    return np.asarray(answer.x[:-1] * size) if answer.success else np.zeros(len(changes[0]))
