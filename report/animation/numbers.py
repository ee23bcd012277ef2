"""Arrays as short lists of numbers."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from dmoc.motion.trajectory import Array

Column: TypeAlias = float | list[float]
# Digits that are kept of the largest number of an array: finer than a pixel, finer than what is
# read out.
DIGITS = 6


def rounded(values: Array) -> list[float]:
    """The numbers of an array of one dimension, to DIGITS digits of the largest."""
    largest = float(np.abs(values).max(initial=0.0))
    if not largest:
        return [0.0] * len(values)
    decimals = DIGITS - 1 - int(np.floor(np.log10(largest)))
    return [float(v) for v in np.round(values, decimals) + 0.0]


def short(value: float) -> str:
    """Four digits of a number, for texts."""
    return f"{value:.4g}".replace("-", "\N{MINUS SIGN}")


def column(values: Array) -> Column:
    """The numbers of an array, or the one that all of them are."""
    numbers = rounded(values)
    return numbers[0] if len(set(numbers)) == 1 else numbers
