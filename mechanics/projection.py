"""Positions moved to where conditions hold."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from dmoc.base.tolerances import SAME
from dmoc.codegen.kernels import Array
from dmoc.mechanics.conditions import Conditions
from dmoc.mechanics.model import Model

# Gauss-Newton steps, and the largest of a coordinate, in its size.
STEPS, LONGEST = 12, 0.5
# A step that is as short is the last one: the next one would be of the size of its square.
ARRIVED = 1e-9
# Steps towards a surface alone, and how often one is halved.
STEPS_TO_GAP, HALVINGS = 60, 40
# Singular values below this share of the largest are those of conditions that say the same twice.
REDUNDANT = 1e-8


def onto(
    conditions: Callable[[Array], tuple[Array, Array]],
    q: Array,
    sizes: Array,
    steps: int = STEPS,
    longest: float = LONGEST,
    box: Array | None = None,
) -> Array:
    """Rows of positions (n, nq) where conditions hold, by Gauss-Newton steps, the shortest in sizes
    of the coordinates (nq,) or (n, nq), of which those without a size stay.  Conditions say how far
    rows miss them (n, m), and their slopes (n, m, nq); the ``box`` (nq, 2) is not left.  Rows that
    get to where these are no numbers are as they were."""
    start, found = q, np.ones(len(q), dtype=bool)
    for _ in range(steps):
        miss, slopes = conditions(q)
        found = found & np.isfinite(np.dstack([slopes, miss])).all(axis=(1, 2))
        step = _shortest(-miss, slopes * sizes[..., None, :], found)
        size = np.abs(step).max(axis=1, keepdims=True, initial=0.0)
        q = q + sizes * step / np.maximum(1.0, size / longest)
        q = np.where(found[:, None], q if box is None else np.clip(q, *box.T), start)
        if (size <= ARRIVED).all():
            break
    return q


def onto_places(
    model: Model, kept: Conditions, q: Array, t: float, sizes: Array, aside: Array | float = 0.0
) -> Array:
    """A position, shape (nq,), where those of m conditions that have a place are ``aside`` of it,
    shape (m,), at a time."""

    def conditions(q: Array) -> tuple[Array, Array]:
        slopes = kept.slopes(model, q, t)[..., :-1] * kept.placed(model)[:, None]
        return kept.values(model, q, t) + aside, slopes

    return np.ravel(onto(conditions, q[None], sizes))


def _shortest(wanted: Array, slopes: Array, chosen: NDArray[np.bool_]) -> Array:
    """The shortest steps (n, nq) that change conditions by what is wanted (n, m) in chosen rows."""
    step = np.zeros((len(slopes), slopes.shape[2]))
    if slopes.shape[1] == 1:
        along = slopes[chosen, 0]
        square = (along * along).sum(axis=1, keepdims=True)
        step[chosen] = wanted[chosen] * along / np.where(square > 0, square, 1.0)
    else:
        inverse = np.linalg.pinv(slopes[chosen], rcond=REDUNDANT)
        step[chosen] = np.einsum("kij,kj->ki", inverse, wanted[chosen])
    return step


def onto_gap(
    model: Model, q: Array, surface: int, t: float, sizes: Array, longest: float = 1.0
) -> Array | None:
    """A point of one surface at a time near q, shape (nq,), or None where none is found: by steps
    along the gradient in sizes of the coordinates, each shortened until the gap gets smaller."""
    gap, slope = model.gaps(q, t)[surface], model.gap_slopes(q, t)[surface, :-1]
    for _ in range(STEPS_TO_GAP):
        if abs(gap) <= model.gap_rounding(q, t)[surface]:
            return q
        weighted = slope * sizes
        square = weighted @ weighted
        if not (np.isfinite(gap) and square > 0):
            return None
        step = -gap / square * weighted
        step = sizes * step / max(1.0, float(np.abs(step).max()) / longest)
        for _ in range(HALVINGS):
            trial = model.gaps(q + step, t)[surface]
            if abs(trial) < abs(gap):
                break
            step /= 2
        else:
            return q if near_surface(model, q, surface, t) else None
        q = q + step
        gap, slope = trial, model.gap_slopes(q, t)[surface, :-1]
    return None


def near_surface(model: Model, q: Array, surface: int, t: float) -> bool:
    """Whether a point q, shape (nq,), is meant to lie on a surface: the gap is a small share of its
    own size."""
    return bool(abs(model.gaps(q, t)[surface]) <= SAME * model.gap_sizes(q, t)[surface])
