"""The end of an open-loop run is excused by what the errors of the segments predict, not by the
amplification alone."""

from __future__ import annotations

import numpy as np
import pytest

import dmoc
from dmoc.simulation.amplification import carried, saltation
from dmoc.simulation.measures import segments
from dmoc.simulation.motion import Motion
from dmoc.simulation.runs import missable
from dmoc.simulation.verdict import is_unstable


@pytest.mark.parametrize(
    ("worst", "amplified", "terminal", "predicted", "excused"),
    [
        (1e-3, 957, 0.9, 0.3, True),
        (1e-3, 957, 0.9, 0.1, False),  # the errors are too small for this end
        (1e-3, 957, 50.0, 1.0, True),  # the run leaves the motion altogether, as predicted
        (1e-3, 20, 0.9, 0.3, False),  # nothing is amplified
        (6e-3, 957, 0.9, 0.3, False),  # segments are not right
        (1e-3, np.inf, 0.9, np.inf, False),
        (1e-3, 957, np.inf, 0.1, False),
    ],
)
def test_an_end_is_weighed_with_the_errors_on_the_way(
    worst: float, amplified: float, terminal: float, predicted: float, excused: bool
) -> None:
    assert is_unstable(worst, amplified, terminal, predicted) is excused


def test_the_prediction_is_near_the_end_and_misses_no_collision(seed: dmoc.Problem) -> None:
    """With fine steps the linearised flow tells the error at the end within a factor, which falls
    as h^2 with it; a run that meets no contact is not excused by it, though the seed amplifies
    957 times."""
    for steps in (200, 400):
        solution = dmoc.solve(seed.but(steps=steps), "ipm", verify=False)
        motion = Motion.of(solution.trajectory, seed.kernels, None)
        parts = segments(motion)
        flowed, check = carried(motion, parts, saltation), solution.verify()
        assert check.terminal_error / 3 < flowed.end < 10 * check.terminal_error
        assert missable(motion, check.contacts, parts, flowed.deviations)
        assert not missable(motion, (), parts, flowed.deviations)
