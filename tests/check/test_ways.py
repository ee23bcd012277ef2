"""Ways out of a limit: how far entries of a state are moved to come within it."""

from __future__ import annotations

import numpy as np

from dmoc.check.path_limits import LEVEL, _ways


def test_a_state_is_moved_in_all_and_in_each_entry_by_its_width() -> None:
    """Against the slopes together, by what counts, and both ways alone."""
    slopes = np.array([[2.0, -3.0, 0.0], [0.0, 0.0, 4.0], [1.0, 0.1 * LEVEL, -1.0]])
    widths = np.array([10.0, 0.5, 1.0])
    ways = _ways(slopes, widths)
    together = [[10.0, -0.5, 0.0], [0.0, 0.0, 1.0], [10.0, 0.0, -1.0]]
    np.testing.assert_array_equal(ways[:, 0], together)
    for row in ways:
        np.testing.assert_array_equal(row[1:4], np.diag(widths))
        np.testing.assert_array_equal(row[4:], -np.diag(widths))


def test_what_has_no_width_is_not_moved() -> None:
    ways = _ways(np.array([[1.0, 1.0]]), np.array([0.0, 2.0]))
    np.testing.assert_array_equal(ways, [[[0.0, 2.0], [0.0, 2.0], [0.0, -2.0]]])
