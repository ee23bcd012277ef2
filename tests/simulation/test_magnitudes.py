"""How far a motion has come, measured by the masses: the largest of any coordinate, of the state
and of what came before."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dmoc.simulation.tolerances import Magnitudes, magnitudes_at

H = 0.1


def largest(
    q: Any = (0, 0, 0), v: Any = (0, 0, 0), F: Any = (0, 0, 0), before: Any = None
) -> Magnitudes:
    """Masses of 1, 4 and 9."""
    model: Any = SimpleNamespace(
        nq=3, equations=lambda q, v, u, t: (np.diag([1.0, 4.0, 9.0]), np.array(F, dtype=float))
    )
    y = np.array([*q, *v], dtype=float)
    return magnitudes_at(model, y, np.zeros(0), 0.0, H, before or Magnitudes())


@pytest.mark.parametrize("i", [0, 1, 2])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_each_coordinate_counts_by_the_root_of_its_mass(i: int, sign: float) -> None:
    row, root = sign * 6.0 * np.eye(3)[i], (1.0, 2.0, 3.0)[i]
    assert largest(F=row).acceleration == pytest.approx(6 / root)
    assert largest(v=row).velocity == pytest.approx(6 * root)
    assert largest(q=row).coordinate == pytest.approx(6 * root)


def test_what_a_step_may_do_counts_where_it_is_more() -> None:
    """6 m/s^2 for a tenth of a second, and that speed for as long."""
    pushed = largest(F=(6, 0, 0))
    assert (pushed.velocity, pushed.coordinate) == pytest.approx((0.6, 0.06))
    faster = largest(F=(6, 0, 0), v=(0, 0.4, 0), q=(0, 0, 0.5))
    assert (faster.velocity, faster.coordinate) == pytest.approx((0.8, 1.5))


def test_what_came_before_stays() -> None:
    before = Magnitudes(3.0, 2.0, 1.0)
    still, moved = largest(before=before), largest((4, 0, 0), (5, 0, 0), (6, 0, 0), before)
    assert (still.coordinate, still.velocity, still.acceleration) == (3.0, 2.0, 1.0)
    assert (moved.coordinate, moved.velocity, moved.acceleration) == (4.0, 5.0, 6.0)
