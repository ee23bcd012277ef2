"""By how much first motions exceed limits of inputs and velocities, beside limit and value."""

from __future__ import annotations

import numpy as np
import pytest
from sympy.physics.mechanics import dynamicsymbols
from systems import unit_mass

import dmoc
from dmoc.guess.limit_excess import _path_excess
from dmoc.program.iterate import Iterate
from dmoc.program.layout import Layout

X, U = dynamicsymbols("x u")


@pytest.mark.parametrize(
    ("force", "rate", "excess"),
    [
        (10.0, 0.0, 5 / 15), (5.0, 0.0, 0.0), (-10.0, 0.0, 0.0),  # u <= 5
        (0.0, -6.0, 4 / 8), (0.0, -2.0, 0.0), (0.0, 6.0, 0.0),  # x' >= -2
        (10.0, -6.0, 1 / 2), (10.0, -3.0, 5 / 15),  # the larger of both
    ],
)  # fmt: skip
@pytest.mark.parametrize("at", [0, 1, 2])
def test_an_excess_is_a_share_of_limit_and_value(
    force: float, rate: float, excess: float, at: int
) -> None:
    """In the first of three steps, in the middle, in the last; places count elsewhere."""
    system = unit_mass(
        "limited", path_constraints={"push": U <= 5, "back": X.diff() >= -2, "room": X <= 1}
    )
    problem = dmoc.Problem(system, {"x": 0.0}, {}, steps=3, final_time=3.0)
    lay = Layout.of(problem)
    x, q = np.zeros(lay.size), np.full(4, 9.0)
    q[at + 1 :] += rate
    x[lay.index_h], x[lay.index_q[:, 0]], x[lay.index_u[at]] = 1.0, q, force
    assert _path_excess(Iterate.of(problem, x)) == pytest.approx(excess)
