"""Which deviations of a state the inputs of a motion reach."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dmoc.control.riccati import REACHED, reachable


def reached_by(B: np.ndarray, transition: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """The projection of a motion of one interval that repeats."""
    phase: Any = SimpleNamespace(
        B=np.repeat(B[None, None], 2, axis=1), transitions=lambda: transition[None]
    )
    weights: Any = SimpleNamespace(sizes=sizes, input_sizes=np.ones(B.shape[1]))
    return reachable([phase], [], np.eye(len(sizes)), weights)


@pytest.mark.parametrize(("share", "rank"), [(5.0, 1), (30.0, 2)])
def test_what_is_reached_is_measured_by_what_is_reached_most(share: float, rank: int) -> None:
    """A hundred inputs push one state, twice: by sqrt(200) in all."""
    B = np.zeros((2, 100))
    B[0], B[1, 0] = 1.0, share * REACHED
    P = reached_by(B, np.eye(2), np.ones(2))
    assert np.trace(P) == pytest.approx(rank)
    assert P[0, 0] == pytest.approx(1.0)


def test_a_push_reaches_what_the_motion_makes_of_it() -> None:
    """A double integrator by its velocity; a state beside it by nothing."""
    transition = np.array([[1.0, 0.5, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    P = reached_by(np.array([[0.0], [2.0], [0.0]]), transition, np.array([1.0, 4.0, 1.0]))
    np.testing.assert_allclose(P, np.diag([1.0, 1.0, 0.0]), atol=1e-12)
