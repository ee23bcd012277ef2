"""What the multipliers of a periodic motion say of it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dmoc.control.stability import Stability

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
