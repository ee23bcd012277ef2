"""Positions moved to where conditions hold."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from dmoc.codegen.kernels import Array

# Gauss-Newton steps, and the largest of a coordinate, in its reach.
PROJECTIONS, LONGEST = 12, 0.5
# A step that is as short is the last one: the next one would be of the size of its square.
ARRIVED = 1e-9
# Singular values below this share of the largest are those of conditions that say the same twice.
REDUNDANT = 1e-8


def onto(conditions: Callable[[Array], tuple[Array, Array]], q: Array, reach: Array) -> Array:
    """Rows of positions (n, nq) where conditions hold, by Gauss-Newton steps in reaches; these say
    how far rows miss them (n, m), and their slopes in reaches (n, m, nq)."""
    for _ in range(PROJECTIONS):
        miss, slopes = conditions(q)
        finite = np.isfinite(slopes).all(axis=(1, 2)) & np.isfinite(miss).all(axis=1)
        step = np.zeros_like(q)
        inverse = np.linalg.pinv(slopes[finite], rcond=REDUNDANT)
        step[finite] = np.einsum("kij,kj->ki", inverse, -miss[finite])
        size = np.abs(step).max(axis=1, keepdims=True, initial=0.0)
        q = q + reach * step * np.minimum(1.0, LONGEST / np.maximum(size, LONGEST))
        if (size <= ARRIVED).all():
            break
    return q
