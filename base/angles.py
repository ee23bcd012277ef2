"""The angle at which a function of it is least, as the code of kernels finds it in C
(`least_angle` in `codegen/dmoc_kernel.h`)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

STEPS = 60  # that halve a bracket of 2 pi below the last digit of an angle
LAST = 1e-10  # rad: behind a step of Newton's method below it none changes a digit

Terms = Callable[[Sequence[Any], Any], Sequence[Any]]


def least_angle(terms: Terms, z: Sequence[Any], places: int) -> Any:
    """The angle in a turn at which a function of it is least.

    Of equally spaced places the two lowest ones that are not above their neighbours are brought
    down, and the lower angle counts.

    Parameters
    ----------
    terms : callable (z, None) -> (function, slope, second derivative)
        With the angle in rad behind the other arguments z.
    z : sequence of arrays
    places : int
    """
    spacing = 2 * np.pi / places
    start = np.array(
        np.broadcast_arrays(*(terms([*z, spacing * k], None)[0] for k in range(places)))
    )
    valley = (start <= np.roll(start, 1, axis=0)) & (start <= np.roll(start, -1, axis=0))
    lowest = np.argsort(np.where(valley, start, np.inf), axis=0, kind="stable")
    first, second = (_brought_down(terms, z, spacing, spacing * k) for k in lowest[:2])
    lower = terms([*z, second], None)[0] < terms([*z, first], None)[0]
    return np.where(lower, second, first)


def _brought_down(terms: Terms, z: Sequence[Any], spacing: float, s: Any) -> Any:
    """The root of the slope between two neighbours, by Newton's method, and half of the bracket
    where a step leaves it or does not halve the slope."""
    low, high, before = s - spacing, s + spacing, np.full_like(s, np.inf)
    going = np.ones_like(s, dtype=bool)
    for _ in range(STEPS):
        _, slope, bend = terms([*z, s], None)
        low, high = np.where(slope > 0, low, s), np.where(slope > 0, s, high)
        step = np.where(bend > 0, -slope / np.where(bend > 0, bend, 1.0), np.inf)
        last = np.abs(step) <= LAST
        inside = (low <= s + step) & (s + step <= high) & (np.abs(slope) <= 0.5 * before)
        to = np.where(last | inside, s + step, 0.5 * (low + high))
        s, before = np.where(going, to, s), np.abs(slope)
        going = going & ~last
        if not np.any(going):
            break
    return s
