"""Roots between two points at which a function has different signs."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from dmoc.simulation.roots import crossing


@pytest.mark.parametrize(
    ("f", "low", "high", "root"),
    [
        (lambda x: x**3 - 2, 0.0, 2.0, 2 ** (1 / 3)),
        (lambda x: np.exp(8 * x) - 2, -1.0, 1.0, np.log(2) / 8),
        (lambda x: 1 - x, 0.0, 3.0, 1.0),
        (lambda x: (x - 0.3) ** 9, 0.0, 1.0, 0.3),
        (lambda x: -1.0 if x < 0.7 else 1.0, 0.0, 1.0, 0.7),
    ],
)
def test_crossings_are_found(
    f: Callable[[float], float], low: float, high: float, root: float
) -> None:
    calls = []

    def counted(x: float) -> float:
        calls.append(x)
        return f(x)

    place = crossing(counted, (low, f(low)), (high, f(high)), 1e-13)
    assert place == pytest.approx(root, abs=1e-12)
    assert len(calls) < 100 and all(low <= x <= high for x in calls)
