"""Where functions along a motion are lowest between the places at which they were looked at, and
how far states lie beyond limits."""

from __future__ import annotations

from collections.abc import Callable
from math import sqrt

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.mechanics.bound_kernels import Index

# Golden sections of the two steps between places, to a millionth of them.
GOLDEN, SECTIONS = (sqrt(5) - 1) / 2, 28
# Shares of a way that are tried one after the other, and how often the first one that is enough is
# halved towards the one before.
SHARES, HALVES = 4.0 ** np.arange(-20, 4), 36


def dips(values: Array, function: Callable[[Index, Array], Array]) -> tuple[Index, Array]:
    """Where functions are lowest between places: the steps, and the shares of them.

    ``values`` (places, n, m) are those of m functions at even places from 0 to 1 of n steps, each
    of which goes on where the one before has ended; ``function`` says those (k, m) at shares of
    some steps.  Between the neighbours of a lowest place a function is taken to fall and rise once,
    so that what passes a small obstacle between two places is seen.
    """
    last, beyond = len(values) - 1, np.full(values[:1, :1].shape, np.inf)
    r = np.where(np.isnan(values), np.inf, values)
    before = np.concatenate([beyond, r[-2:-1, :-1]], axis=1)
    after = np.concatenate([r[1:2, 1:], beyond], axis=1)
    left, right = np.concatenate([before, r[:-1]]), np.concatenate([r[1:], after])
    place, step, row = np.nonzero((r <= left) & (r <= right) & (r < np.maximum(left, right)))
    low, high = np.maximum(place - 1, 0) / last, np.minimum(place + 1, last) / last

    def along(share: Array) -> Array:
        return np.asarray(function(step, share)[np.arange(len(row)), row])

    if not len(step):
        return step, low
    inner = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
    reached = along(inner[0]), along(inner[1])
    for _ in range(SECTIONS):
        first = reached[0] < reached[1]
        low, high = np.where(first, low, inner[0]), np.where(first, inner[1], high)
        kept, value = np.where(first, inner, inner[::-1])[0], np.where(first, *reached)
        new = np.where(first, high - GOLDEN * (high - low), low + GOLDEN * (high - low))
        fresh = along(new)
        inner = np.where(first, new, kept), np.where(first, kept, new)
        reached = np.where(first, fresh, value), np.where(first, value, fresh)
    return step, np.where(reached[0] < reached[1], *inner)


def distances(limit: Callable[[Array], Array], states: Array, ways: Array) -> tuple[Array, Array]:
    """How far states (n, d) lie beyond a limit r >= 0, and how far it is across what they lie in.

    The distance is the smallest share of one of their ways (n, k, d), there or back, that leads to
    where the limit is kept; across it is this share and that of the same way in the other
    direction.  Both are infinite where no way leads out.  Where r is small, and its slope is
    regular, the distance is r divided by what the way moves it by.  It is as well defined in the
    middle of an obstacle, where the slope is zero or infinite.
    """
    n, k, d = ways.shape
    both = np.concatenate([ways, -ways], axis=1)

    def kept(share: Array) -> Array:
        """Whether the limit is kept at shares (n, 2 k, s) of the ways."""
        moved = states[:, None, None] + share[..., None] * both[:, :, None]
        return np.asarray(limit(moved.reshape(-1, d)).reshape(share.shape) >= 0)

    enough = kept(np.broadcast_to(SHARES, (n, 2 * k, len(SHARES))))
    first = enough.argmax(axis=2)
    high, low = SHARES[first], np.where(first > 0, SHARES[first - 1], 0.0)
    for _ in range(HALVES):
        middle = (low + high) / 2
        less = kept(middle[..., None])[..., 0]
        low, high = np.where(less, low, middle), np.where(less, middle, high)
    far = np.where(enough.any(axis=2), high, np.inf)
    rows, nearest = np.arange(n), far.argmin(axis=1)
    near = far[rows, nearest]
    return near, near + far[rows, (nearest + k) % (2 * k)]
