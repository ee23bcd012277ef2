"""Conditions of a mode that follow from the others: more of them than the motion has freedoms.

Both lower corners of a box that stands on a floor with friction keep four conditions of three
coordinates.  One of them says nothing new, and its force is one of several with the same effect.
Conditions are looked at in an order, where constraints of the model come first, then contacts, then
what sticks, at positions at which the constraints hold and the contacts are closed, some of them
at later times: what follows from a constraint sticks only if that never moves it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from dmoc.base.records import value_class
from dmoc.base.tolerances import DEPENDENT, KEPT
from dmoc.codegen.kernels import Array
from dmoc.mechanics.conditions import GAPS, JOINTS, TANGENTS, Condition, Conditions, in_order
from dmoc.mechanics.contact_mode import Mode
from dmoc.mechanics.model import Model
from dmoc.mechanics.projection import onto_places

# How far from the start positions are drawn, and how late, as shares of the reach.
SPREAD = (0.0, 0.3, 1.0)
# What a force shares with forces without effect, of length 1, that is more than rounding errors.
UNDETERMINED = 1e-6

Bools = NDArray[np.bool_]


@value_class(frozen=True)
class Redundancy:
    """What follows of the conditions of a mode.

    Attributes
    ----------
    closed, sticking : tuples of int
        Surfaces and tangents whose conditions follow from those before them.
    joints : tuple of int
        Constraints that follow from other ones.
    contradictory : tuple of str
        Surfaces and tangents that do not fit what they would follow from.
    loose : tuple of str
        Sliding contacts whose friction depends on forces that the motion does not determine.
    pressing, rubbing : tuples of str
        Contacts and constraints whose forces it does not determine, and tangents whose friction.
    """

    closed: tuple[int, ...] = ()
    sticking: tuple[int, ...] = ()
    joints: tuple[int, ...] = ()
    contradictory: tuple[str, ...] = ()
    loose: tuple[str, ...] = ()
    pressing: tuple[str, ...] = ()
    rubbing: tuple[str, ...] = ()

    def __bool__(self) -> bool:
        return bool(self.closed or self.sticking or self.joints)


def redundancy(
    model: Model, mode: Mode, start: Array, reach: Array, latest: float, first: Sequence[int] = ()
) -> Redundancy:
    """Find the conditions of a mode that follow from others until the ``latest`` time, in seconds,
    of whose closed surfaces some come ``first``; ``start`` and ``reach`` have the shape (nq,)."""
    closed = sorted(mode.closed, key=lambda j: (j not in first, j))
    stuck = sorted(mode.sticking, key=lambda k: (not model.has_friction[k], k))
    if model.nj + len(closed) + len(stuck) < 2:
        return Redundancy()
    placed = tuple(Condition(JOINTS, i) for i in range(model.nj))
    placed += tuple(Condition(GAPS, j) for j in closed)
    sticks = tuple(Condition(TANGENTS, k) for k in stuck)
    mine, at_places = (in_order(model.contacts, of, mode) for of in ((*placed, *sticks), placed))
    names = [*model.kernels.joints, *model.contacts.named(closed)]
    names += [model.kernels.tangents[k] for k in stuck]
    seen, fits, misfits = list[Bools](), list[Bools](), list[Bools]()
    others, slides = np.zeros(len(names), dtype=bool), False
    for q, t, kept in places_held(model, at_places, start, reach, latest):
        slopes = mine.slopes(model, q, t)
        rows = slopes * np.append(reach, 1.0)
        if not np.isfinite(rows).all():
            continue
        new, fit = _new(rows)
        if new.all():
            return Redundancy()
        seen.append(new)
        fits.append(fit & np.append(kept, np.ones(len(stuck), dtype=bool)))
        misfits.append(~fit & kept.all())
        pushes = mine.pushes(model.with_friction_at(q, t=t), q, t, slopes) * reach
        length = np.linalg.norm(pushes, axis=1, keepdims=True)
        pushes /= np.where(length > 0, length, 1.0)
        slides |= np.linalg.matrix_rank(pushes, DEPENDENT) > new.sum()
        others |= _without_effect(pushes)
    if not seen or np.any(seen, axis=0).all():
        return Redundancy()
    follows = ~np.any(seen, axis=0)
    wrong = follows & (~np.any(fits, axis=0) | np.any(misfits, axis=0))
    joints, on, held = np.split(follows, [model.nj, model.nj + len(closed)])
    return Redundancy(
        tuple(j for j, f in zip(closed, on, strict=True) if f),
        tuple(k for k, f in zip(stuck, held, strict=True) if f),
        tuple(map(int, np.flatnonzero(joints))),
        tuple(name for name, w in zip(names, wrong, strict=True) if w),
        tuple(model.kernels.tangents[drag.tangent] for drag in mine.drags) if slides else (),
        *_named(names, others, len(names) - len(stuck)),
    )


def places_held(
    model: Model, at_places: Conditions, start: Array, reach: Array, latest: float
) -> Iterator[tuple[Array, float, Bools]]:
    """Positions, shape (nq,), and times in seconds at which m conditions hold, from ``start`` on,
    and a mask of the conditions that do, shape (m,); ``start`` and ``reach`` have the shape
    (nq,)."""
    rng = np.random.default_rng(0)
    for share in SPREAD:
        q, t = start + share * reach * rng.standard_normal(model.nq), share * latest
        q, kept = _onto(model, at_places, q, t, reach)
        yield q, t, kept


def _onto(model: Model, kept: Conditions, q: Array, t: float, reach: Array) -> tuple[Array, Bools]:
    """A position, shape (nq,), moved to where conditions hold, and which of them do, shape (m,)."""
    q = onto_places(model, kept, q, t, reach)
    misses = kept.values(model, q, t)
    slopes = kept.slopes(model, q, t)[..., :-1] * reach * kept.placed(model)[:, None]
    sizes = np.append(model.joint_sizes(q, t), model.gap_sizes(q, t)[kept.places(GAPS)[1]])
    # What a coordinate is alone has no size of its own where that is zero.
    sizes = np.fmax(sizes, np.abs(slopes).sum(axis=1))
    return q, np.asarray(np.abs(misses) <= KEPT * sizes)


def _new(slopes: Array) -> tuple[Bools, Bools]:
    """Masks of m rows of slopes (m, nq + 1): of those that do not follow from the rows before them,
    and of those whose last column, the slope in time, fits them."""
    basis = list[Array]()
    new, fits = np.ones(len(slopes), dtype=bool), np.ones(len(slopes), dtype=bool)
    for i, row in enumerate(slopes):
        length = float(np.linalg.norm(row[:-1]))
        rest = row.copy()
        for _ in range(2):  # twice is enough
            for b in basis:
                rest -= (b[:-1] @ rest[:-1]) * b
        left = float(np.linalg.norm(rest[:-1]))
        new[i] = left > DEPENDENT * length
        if new[i]:
            basis.append(rest / left)
        else:
            fits[i] = abs(rest[-1]) <= DEPENDENT * max(length, float(np.linalg.norm(row)))
    return new, fits


def _named(names: list[str], chosen: Bools, first: int) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The chosen names among the ``first`` ones, and the chosen names among the others."""
    picked = [name if other else "" for name, other in zip(names, chosen, strict=True)]
    return tuple(filter(None, picked[:first])), tuple(filter(None, picked[first:]))


def _without_effect(pushes: Array) -> Bools:
    """Forces that others can replace, shape (m,), of directions (m, nq)."""
    both = np.linalg.pinv(pushes.T, rcond=DEPENDENT) @ pushes.T
    return np.asarray(1 - np.diagonal(both) > UNDETERMINED)
