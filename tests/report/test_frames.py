"""Times of the frames of a movie."""

from __future__ import annotations

import numpy as np
import pytest

from dmoc.base.errors import OutputError
from dmoc.report.animation.movie import _times


@pytest.mark.parametrize(
    ("duration", "speed", "takes"),
    [
        (1.0, None, 3.0), (3.0, None, 3.0), (12.0, None, 12.0), (30.0, None, 30.0),
        (90.0, None, 30.0), (12.0, 1.0, 12.0), (12.0, 2.0, 6.0), (1.0, 0.25, 4.0),
        (90.0, 1.0, 90.0),
    ],
)  # fmt: skip
def test_a_movie_takes_its_time_at_a_speed_and_else_3_to_30_seconds(
    duration: float, speed: float | None, takes: float
) -> None:
    """Ten frames a second, the end among them; that stands for 0.6 s more."""
    times = _times(duration, speed, 10)
    moving = np.linspace(0.0, duration, round(10 * takes) + 1)
    np.testing.assert_allclose(times, [*moving, *[duration] * 6])


def test_a_movie_of_too_many_frames_is_refused() -> None:
    assert len(_times(500.0, 1.0, 10)) == 5000 + 1 + 6
    with pytest.raises(OutputError, match="the movie would have 5010 frames, and 5000 at most"):
        _times(501.0, 1.0, 10)
