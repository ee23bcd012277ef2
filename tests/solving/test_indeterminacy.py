"""Where a mesh has moved a motion most: phases, nodes and coordinates are counted by hand."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dmoc.solving.indeterminacy import _most_changed

STEPS = 2, 3, 2, 0  # on the coarse mesh; the last phase is the state after the last event
RANGES = np.array([10.0, 1.0])


def motion(steps: Sequence[int]) -> Any:
    """Coordinates that go from 0 to their ranges."""
    ends = np.cumsum([0, *steps])
    phases = [
        SimpleNamespace(
            steps=n, q=np.outer(np.linspace(first, first + n, n + 1) / ends[-1], RANGES)
        )
        for first, n in zip(ends, steps, strict=False)
    ]
    return SimpleNamespace(phases=phases)


@pytest.mark.parametrize("times", [1, 2, 5])
@pytest.mark.parametrize("coordinate", [0, 1])
@pytest.mark.parametrize(
    ("phase", "k", "node"),
    [(0, 0, 0), (0, 1, 1), (0, 2, 2), (1, 1, 3), (1, 2, 4), (2, 1, 6), (2, 2, 7), (3, 0, 7)],
)
def test_the_node_that_has_moved_most_is_one_of_the_fine_mesh(
    times: int, coordinate: int, phase: int, k: int, node: int
) -> None:
    """By a fifth of the range of a coordinate; elsewhere by a tenth of that of each."""
    coarse, fine = motion(STEPS), motion([times * n for n in STEPS])
    for part in coarse.phases:
        part.q[...] -= 0.1 * RANGES
    coarse.phases[phase].q[k, coordinate] -= 0.1 * RANGES[coordinate]
    assert _most_changed(coarse, fine) == (times * node, coordinate)


def test_what_stands_still_does_not_move() -> None:
    """A coordinate without a range is none of those that the mesh moves."""
    coarse, fine = motion(STEPS), motion(STEPS)
    for part in fine.phases:
        part.q[:, 0] = 3.0
    coarse.phases[1].q[2, 1] += 1e-3
    assert _most_changed(coarse, fine) == (4, 1)
