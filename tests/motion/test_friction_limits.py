"""How much friction what rubs along a phase may bear."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from films import motion

NORMAL = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, 8.0, 9.0], *3 * [[1.0, 1.0, 1.0]]])


@pytest.mark.parametrize("unknown", ["first", "middle", "last", "rail", ""])
def test_what_has_no_number_bears_what_is_not_known(unknown: str) -> None:
    """Contacts bear mu N, a rail its friction; each tangent has its own place."""
    friction: dict[str, float | None] = {"first": 0.5, "middle": 2.0, "rail": 7.0, "last": 3.0}
    if unknown:
        friction[unknown] = None
    film = replace(motion(), friction=friction)
    phase = replace(
        film.phases[0], closed=("last", "first", "middle"), normal=NORMAL,
        rubbing=dict.fromkeys(friction, 1),
    )  # fmt: skip
    expected = np.stack(
        [0.5 * NORMAL[:, 1], 2.0 * NORMAL[:, 2], np.full(6, 7.0), 3.0 * NORMAL[:, 0]], axis=1
    )
    if unknown:
        expected[:, list(friction).index(unknown)] = np.nan
    np.testing.assert_array_equal(film.friction_limits(phase), expected)
