"""How far inputs exceed their bounds, in their own sizes."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dmoc.check.consistency import _input_excess


@pytest.mark.parametrize(
    ("u", "bounds", "needed", "excess"),
    [
        ((0.0, 10.0), (-10.0, 10.0), 2.0, 0.0),
        ((0.0, 12.0), (-10.0, 10.0), 2.0, 2 / 12),  # beside the largest
        ((-12.0, 5.0), (-10.0, 10.0), 2.0, 2 / 12),
        ((0.0, 1.5), (-1.0, 1.0), 40.0, 0.5 / 2),  # beside what could be used
        ((0.0, 1.5), (-1.0, 1.0), 1.75, 0.5 / 1.75),
        ((0.0, 1.5), (-np.inf, 1.0), 3.0, 0.5 / 3),
    ],
)
@pytest.mark.parametrize("at_end", [False, True])
def test_an_excess_is_measured_by_what_an_input_is_or_could_be(
    u: tuple[float, float], bounds: tuple[float, float], needed: float, excess: float, at_end: bool
) -> None:
    """Of the worst of two inputs, at the begins or at the ends of steps."""
    rows = np.array([u, (0.0, 0.0)]).T
    run = SimpleNamespace(u0=0 * rows if at_end else rows, u1=rows if at_end else 0 * rows)
    motion: Any = SimpleNamespace(
        run=run, needed_inputs=np.array([needed, 1.0]),
        trajectory=SimpleNamespace(input_bounds=np.array([bounds, (-np.inf, np.inf)])),
    )  # fmt: skip
    assert _input_excess(motion) == pytest.approx(excess)
