"""Ranges at the goal and between both ends: a row for each side that has a bound, and none for
others."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from sympy.physics.mechanics import dynamicsymbols
from systems import unit_mass

import dmoc
from dmoc.codegen.kernels import Kernels
from dmoc.program.transcription import Transcription

U = dynamicsymbols("u")
SIDES = [
    ((0.1, 0.4), [0.1, -0.4]), ((None, 0.4), [-0.4]), ((0.1, None), [0.1]), ((None, None), []),
    (0.25, []),
]  # fmt: skip


@pytest.fixture(scope="module")
def kernels() -> Kernels:
    return dmoc.build(unit_mass("ranged", cost=U**2))


def distances(problem: dmoc.Problem, name: str, x: float, x_dot: float) -> np.ndarray:
    """The inequalities of a name where the motion rests at 0 and ends at x with x_dot."""
    nlp = Transcription(problem, goal_as_rows=True)
    point, lay = np.zeros(nlp.n), nlp.layout
    point[lay.index_h], point[lay.index_q[-1]] = 0.25, x
    point[lay.index_p_E], point[lay.index_v_E] = x_dot, x_dot
    rows = [b.numbers - nlp.n_eq for b in nlp.inequalities if b.name.startswith(name)]
    return np.asarray(nlp.inequality(nlp.scaled(point))[np.concatenate(rows)])


@pytest.mark.parametrize(("difference", "bounds"), SIDES)
@pytest.mark.parametrize("name", ["x", "x_dot"])
def test_what_is_periodic_has_a_row_for_each_bound_of_its_difference(
    kernels: Kernels, name: str, difference: Any, bounds: Sequence[float]
) -> None:
    ends = {"x": (-1.0, 1.0), "x_dot": (-1.0, 1.0)}
    problem = dmoc.Problem(
        kernels, ends, {}, steps=4, final_time=1.0, periodic={name: (name, difference)}
    )
    rows = distances(problem, "periodic", 0.3, 0.3)
    assert rows == pytest.approx([np.sign(b) * (0.3 - abs(b)) for b in bounds])


@pytest.mark.parametrize(("goal", "bounds"), SIDES)
def test_a_goal_has_a_row_for_each_bound(
    kernels: Kernels, goal: Any, bounds: Sequence[float]
) -> None:
    problem = dmoc.Problem(
        kernels, {"x": 0.0, "x_dot": 0.0}, {"x": goal, "x_dot": 0.0}, steps=4, final_time=1.0
    )
    rows = distances(problem, "goal", 0.3, 0.0)
    assert rows == pytest.approx([np.sign(b) * (0.3 - abs(b)) for b in bounds])
