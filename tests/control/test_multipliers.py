"""What the multipliers of a periodic motion say of it, and which motions begin at any time."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dmoc.control.stability import Stability, depends_on_time

EMPTY = np.zeros((0, 0))


@pytest.mark.parametrize(
    ("multipliers", "stable"),
    [
        ([], True), ([0.5], True), ([-0.9, 0.5, 0.1], True), ([0.6 + 0.7j, 0.6 - 0.7j], True),
        ([1.0, 0.5], True),  # moved as a whole
        ([1.1], False), ([-1.1, 0.5], False), ([0.5, 1.1], False), ([0.5, 1.1, 0.2], False),
        ([0.8 + 0.7j, 0.8 - 0.7j], False), ([1 + 1e-5, 0.1], False),
    ],
)  # fmt: skip
def test_one_deviation_that_grows_is_enough(multipliers: list[complex], stable: bool) -> None:
    whole: Any = SimpleNamespace()
    s = Stability((), EMPTY, (), whole, EMPTY, np.eye(1), np.array(multipliers, complex))
    assert s.stable is stable
    assert Stability((), EMPTY, (), whole, EMPTY, None, np.array(multipliers)).stable is None


@pytest.mark.parametrize(
    ("inputs", "needed", "explicit", "depends"),
    [
        ([[3.0, 3.0], [3.0, 3.0]], 1.0, False, False),
        ([[3.0, 3.0], [3.0, 3.0]], 1.0, True, True),
        ([[3.0, 3.0], [3.0, 3.1]], 1.0, False, True),
        ([[3.1, 3.0], [3.0, 3.0]], 1.0, False, True),
        ([[3.0, 3.0], [3.0, 3.0 + 1e-9]], 1.0, False, False),  # by less than 1e-9 of its size
        ([[3.0, 3.0], [3.0, 3.0 + 4e-9]], 1.0, False, True),
        ([[0.0, 0.0], [0.0, 5e-10]], 1.0, False, False),  # and of what would be needed
        ([[0.0, 0.0], [0.0, 5e-10]], np.inf, False, True),
    ],
)
def test_a_motion_depends_on_the_time_where_an_input_changes(
    inputs: list[list[float]], needed: float, explicit: bool, depends: bool
) -> None:
    """One of two inputs, at an end of a step of one of two phases; the other one is steady."""
    for which in (0, 1):
        steps = []
        for ends in inputs:
            u0, u1 = (np.full((1, 2), 7.0) for _ in range(2))
            u0[0, which], u1[0, which] = ends
            steps.append(SimpleNamespace(u0=u0, u1=u1))
        kernels = SimpleNamespace(manifest=SimpleNamespace(explicit_time=explicit))
        motion: Any = SimpleNamespace(
            steps=steps, needed_inputs=np.full(2, needed), model=SimpleNamespace(kernels=kernels)
        )
        assert depends_on_time(motion) is depends
