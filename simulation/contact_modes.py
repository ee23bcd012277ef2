"""The modes of a motion: which contacts are closed and what sticks or slides.

A mode is a set of conditions: closed contacts, what sticks, and the joints of the model, which hold
in every mode.  Each has a gradient C, a direction B in which its force pushes, and second-order
terms.  A closed contact breaks where its force would pull, what sticks where its friction holds it
no more (:func:`kept`); a joint does not break.

What a mode makes of accelerations and forces says :mod:`dmoc.simulation.integrator`.  An impact
obeys the same relations with impulses for forces and rates for second derivatives.

Of a ladder that rests with friction on a floor and against a wall, or of a rod that sticks at both
ends, the accelerations determine only some sums of forces.  Of the forces that have the same effect
a reaction has the smallest.  Those may pull or leave a cone of friction where others do not: a mode
is possible if any of them are borne.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dmoc.base.records import record
from dmoc.base.tolerances import SAME
from dmoc.codegen.kernels import Array
from dmoc.mechanics.algebra import solved_transpose
from dmoc.mechanics.contact_mode import Mode
from dmoc.mechanics.contacts import RAIL
from dmoc.mechanics.model import Model
from dmoc.simulation.tolerances import Tolerances

# Singular values below this share of the largest are those of conditions that say the same twice.
REDUNDANT = 1e-11
# Determinant, measured by the sizes of its rows and columns, of conditions that are far from that.
REGULAR = 1e-6
# And the share of the longest that each of them is at least.
ALIKE = 1e-3
# Entries of a projection on forces without effect above this are more than rounding errors.
UNDETERMINED = 1e-6


@record(frozen=True, eq=False)
class Reaction:
    """Accelerations (n, nq), contact forces (n, nc), friction forces (n, nt) and forces of joints
    (n, nj) of rows of states; zero where a surface is open or a tangent does not rub."""

    acceleration: Array
    normal: Array
    tangential: Array
    joint: Array


@record(frozen=True, eq=False)
class Conditions:
    """Conditions of a mode at rows of states: their gradients C and the directions B in which a
    unit of their multipliers pushes, both (n, m, nq): closed contacts, what sticks, joints."""

    C: Array
    B: Array


def conditions(model: Model, mode: Mode, q: Array, t: Array) -> Conditions:
    """The conditions of a mode at rows of positions."""
    normals = model.gap_slopes(q, t)[..., :-1]
    along = model.tangent_slopes(q, t)[..., :-1]
    closed, at = list(mode.closed), model.supports
    pushes = -normals[:, closed]
    for k, s in mode.sliding:
        if at[k] != RAIL:
            pushes[:, closed.index(at[k])] -= s * model.friction[..., k, None] * along[:, k]
    held = along[:, list(mode.sticking)], model.joint_slopes(q, t)[..., :-1]
    return Conditions(
        np.concatenate([normals[:, closed], *held], axis=1),
        np.concatenate([pushes, *held], axis=1),
    )


def condition_rates(model: Model, mode: Mode, q: Array, v: Array, t: Array) -> Array:
    """Rates (n, m) of the conditions of a mode at rows of states."""
    normal, along = model.gap_rates(q, v, t), model.slide_rates(q, v, t)
    held = normal[:, list(mode.closed)], along[:, list(mode.sticking)]
    return np.concatenate([*held, model.joint_rates(q, v, t)], axis=1)


def answers(M: Array, c: Conditions, wanted: Array) -> tuple[Array, Array]:
    """The change M^-1 B^T lam of an acceleration or a velocity (n, nq) that changes C a by what is
    wanted (n, m), and its multipliers lam (n, m): the smallest where several would do."""
    response = solved_transpose(M, c.B)
    A = c.C @ response
    if A.shape[1] == 1:
        lam = np.asarray(wanted / A[:, 0])
    else:
        squares = np.einsum("nmi,nim->nm", c.C, solved_transpose(M, c.C))
        lam = _multipliers(A, np.where(squares > 0, np.sqrt(np.abs(squares)), 1.0), wanted)
    return (response @ lam[..., None])[..., 0], lam


def spread(model: Model, mode: Mode, lam: Array) -> tuple[Array, Array, Array]:
    """Multipliers (n, m) of a mode as forces of all surfaces (n, nc), tangents (n, nt) and joints
    (n, nj)."""
    normal, tangential = np.zeros((len(lam), model.nc)), np.zeros((len(lam), model.nt))
    count = len(mode.closed)
    rest = count + len(mode.sticking)
    normal[:, list(mode.closed)] = lam[:, :count]
    tangential[:, list(mode.sticking)] = lam[:, count:rest]
    if mode.sliding:
        slide, signs = map(list, zip(*mode.sliding, strict=True))
        tangential[:, slide] = -np.array(signs) * model.dragging(normal)[:, slide]
    return normal, tangential, lam[:, rest:]


def _multipliers(A: Array, size: Array, b: Array) -> Array:
    """The shortest solution of A lam = b with rows and columns measured by their sizes; not a
    number where there is none."""
    scaled = A / size[:, :, None] / size[:, None, :]
    if not (np.isfinite(scaled).all() and np.isfinite(b).all()):
        return np.full(b.shape, np.nan)
    if (np.abs(np.linalg.det(scaled)) > REGULAR).all():
        return np.asarray(np.linalg.solve(scaled, (b / size)[..., None])[..., 0] / size)
    inverse = np.linalg.pinv(scaled, rcond=REDUNDANT)
    return np.asarray((inverse @ (b / size)[..., None])[..., 0] / size)


# Forces that the accelerations do not determine --------------------------------------------------


def without_effect(model: Model, mode: Mode, q: Array, t: Array) -> Array:
    """Projections (n, m, m) of the multipliers of a mode on those that accelerate nothing; zero
    where all are determined, and not a number where the masses are none."""
    c, M = conditions(model, mode, q, t), model.mass(q, t)
    squares = np.einsum("nmi,nim->nm", c.C, solved_transpose(M, c.C))
    size = np.where(squares > 0, np.sqrt(np.abs(squares)), 1.0)
    mass = np.sqrt(np.abs(np.diagonal(M, axis1=1, axis2=2)))
    push = np.swapaxes(c.B / size[:, :, None] / np.where(mass > 0, mass, 1.0)[:, None, :], 1, 2)
    if not np.isfinite(push).all():
        return np.full((len(q), push.shape[2], push.shape[2]), np.nan)
    if _independent(push):
        return np.zeros((len(q), push.shape[2], push.shape[2]))
    rest = np.eye(push.shape[2]) - np.linalg.pinv(push, rcond=REDUNDANT) @ push
    rest = np.where(np.abs(rest) > UNDETERMINED, rest, 0.0)
    return np.asarray(rest / size[:, :, None] * size[:, None, :])


def _independent(columns: Array) -> bool:
    """Whether the columns of matrices (n, nq, m) are alike in length and far from dependent."""
    length = np.sqrt((columns * columns).sum(axis=1))
    if not (length.min(axis=1) > ALIKE * length.max(axis=1)).all():
        return False
    unit = columns / length[:, None]
    return bool((np.linalg.det(np.swapaxes(unit, 1, 2) @ unit) > REGULAR).all())


def borne(model: Model, mode: Mode, reaction: Reaction, q: Array, t: Array) -> Reaction:
    """A reaction whose forces are those with the same effect that stay furthest from pulling and
    from the edges of their cones, in rows whose smallest forces are not borne."""
    if len(mode.closed) + len(mode.sticking) + model.nj < 2:
        return reaction
    margins = _margins(model, mode, (reaction.normal, reaction.tangential))
    bad = np.flatnonzero(~(margins >= 0).all(axis=1))
    if not len(bad):
        return reaction
    free = without_effect(model, mode, q[bad], t[bad])
    if not np.isfinite(free).all() or not free.any():
        return reaction
    normal, tangential, joint = (
        reaction.normal.copy(),
        reaction.tangential.copy(),
        reaction.joint.copy(),
    )
    for row, P in zip(bad, free, strict=True):
        forces = reaction.normal[[row]], reaction.tangential[[row]]
        changes = spread(model, mode, P.T)
        best = _furthest(model, mode, forces, changes, round(float(np.trace(P))))
        normal[row] += best @ changes[0]
        tangential[row] += best @ (changes[1] - spread(model, mode, 0 * P.T)[1])
        joint[row] += best @ changes[2]
    return Reaction(reaction.acceleration, normal, tangential, joint)


def nearest(
    model: Model, mode: Mode, reaction: Reaction, q: Array, t: Array, planned: Array
) -> Reaction:
    """A reaction with the same effect whose forces are next to planned ones of what is closed,
    what sticks and, where they are planned too, of joints (n, m)."""
    closed, stuck = list(mode.closed), list(mode.sticking)
    own = np.hstack([reaction.normal[:, closed], reaction.tangential[:, stuck], reaction.joint])
    if own.shape[1] < 2:
        return reaction
    free = without_effect(model, mode, q, t)
    if not np.isfinite(free).all() or not free.any():
        return reaction
    planned = np.hstack([planned, own[:, planned.shape[1] :]])
    lam = own + (free @ (planned - own)[..., None])[..., 0]
    return Reaction(reaction.acceleration, *spread(model, mode, lam))


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
    return np.concatenate([N[:, list(mode.closed)], held - rubs, held + rubs], axis=1)


def _furthest(
    model: Model, mode: Mode, forces: tuple[Array, Array], changes: tuple[Array, Array, Array],
    count: int,
) -> Array:  # fmt: skip
    """How much of each change, of which a count are independent, makes the least margin largest: a
    linear program; nothing where it has no solution."""
    least = _margins(model, mode, forces)[0]
    none, changed = (0 * changes[0], 0 * changes[1]), changes[:2]
    slopes = (_margins(model, mode, changed) - _margins(model, mode, none)).T
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
    """How much of one change makes the least margin largest, up to 1: where two margins are alike,
    or one is 1."""
    rising = slopes[:, None] - slopes
    apart, moved = np.abs(rising) > SAME * np.abs(slopes).max(), slopes != 0
    alike = (least - least[:, None])[apart] / rising[apart]
    x = np.concatenate([alike, (1 - least[moved]) / slopes[moved]])
    worst = np.minimum((least + x[:, None] * slopes).min(axis=1), 1.0)
    return float(x[np.lexsort((np.abs(x), -worst))[0]])


# What a mode keeps --------------------------------------------------------------------------------


def limits(
    model: Model, react: Callable[..., Reaction], mode: Mode, rows: tuple[Array, Array, Array]
) -> Array:
    """What a mode keeps from falling below zero at rows of states, inputs and times, as in
    :func:`kept`; ``react`` is the reaction of an integrator."""
    nq, (y, u, t) = model.nq, rows
    q, v = (np.ascontiguousarray(y[:, i * nq : (i + 1) * nq]) for i in (0, 1))
    reaction, model = react(mode, y, u, t), model.with_friction_at(q, v, u, t)
    return kept(model, mode, borne(model, mode, reaction, q, t), q, v, t)


def kept(model: Model, mode: Mode, reaction: Reaction, q: Array, v: Array, t: Array) -> Array:
    """What a mode keeps from falling below zero (n, nc + 2 nt): minus the gap of an open surface or
    the force of a closed one; what friction still bears of what sticks; the sliding velocity in
    its direction.  Infinite where there is nothing to keep."""
    least = -model.gaps(q, t)
    least[:, list(mode.closed)] = reaction.normal[:, list(mode.closed)]
    bears, slides = np.full((len(q), model.nt), np.inf), np.full((len(q), model.nt), np.inf)
    stuck = list(mode.sticking)
    bears[:, stuck] = (model.bearing(reaction.normal) - np.abs(reaction.tangential))[:, stuck]
    sigma = model.slide_rates(q, v, t)
    for k, s in mode.sliding:
        slides[:, k] = s * sigma[:, k]
    return np.concatenate([least, bears, slides], axis=1)


def slack(mode: Mode, small: Tolerances) -> Array:
    """What counts as zero of the limits of a mode."""
    kept = small.gap.copy()
    kept[list(mode.closed)] = small.force[list(mode.closed)]
    return np.concatenate([kept, small.hold, small.slide])
