"""How much friction what rubs along a phase may bear, and where forces inside steps stand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from films import motion

from dmoc.motion.trajectory import Phase

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


@pytest.mark.parametrize("order", [2, 4, 6])
def test_forces_inside_steps_stand_at_the_places_of_their_polynomials(order: int) -> None:
    """Of three steps of 0.5 s; the forces are the times."""
    places = {2: [], 4: [0.5], 6: [0.5 - np.sqrt(5) / 10, 0.5 + np.sqrt(5) / 10]}[order]
    nodes = np.array([1.0, 1.5, 2.0, 2.5])
    inside = np.array([n + 0.5 * p for n in nodes[:-1] for p in places])
    column = np.zeros((4, 1))
    phase = Phase(
        nodes, column, column, column, column[1:], ("floor",), normal=nodes[:, None],
        normal_inside=inside.reshape(-1, 1) if places else np.zeros((0, 0)),
    )  # fmt: skip
    ((times, forces),) = phase.forces.values()
    every = np.sort(np.append(nodes, inside))
    np.testing.assert_allclose(times, every)
    np.testing.assert_allclose(forces[:, 0], every)
