"""Where impulses act along phases: closed forms of a mean, and of numbers of places."""

from __future__ import annotations

import numpy as np

from dmoc.base.discretisation import DISCRETISATIONS
from dmoc.program.stations import Stations


def test_a_force_at_a_node_of_two_steps_is_the_mean_of_both_sides() -> None:
    """Constant forces in four steps of two inner places each, and what jumps at one node."""
    scheme = DISCRETISATIONS[4]
    stations, d = Stations((4,), scheme), scheme.degree
    steps = np.array([11.25, 11.75, 12.25, 12.75])
    forces = np.repeat(steps, d + 1)[:, None]
    nodes, inside = stations.at_nodes(forces)
    np.testing.assert_allclose(nodes[:, 0], [11.25, 11.5, 12.0, 12.5, 12.75])
    np.testing.assert_allclose(inside[:, 0], np.repeat(steps, d - 1))
    along = Stations((4,), DISCRETISATIONS[2]).at_nodes(np.arange(5.0)[:, None])
    np.testing.assert_array_equal(along[0][:, 0], np.arange(5.0))
    assert along[1].shape == (0, 1)
