"""Surfaces that are ignored hold where the sequence names them: what is left opens."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from answers import answer_of
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.program.blocks import NOWHERE
from dmoc.program.transcription import Transcription

pytestmark = pytest.mark.slow
Y, U = dynamicsymbols("y u")
RISE = 0.36**0.25  # of 12/T^3 + 100 T


def standing(goal: dict[str, Any], order: int = 2, **fields: Any) -> dmoc.Problem:
    """A mass of 1 kg, weight 10 N, stands on a foot and leaves it; the effort counts."""
    system = dmoc.MechanicalSystem(
        "standing", [Y], Y.diff() ** 2 / 2 - 10 * Y, inputs=[U], forces={Y: U}, cost=U**2,
        surfaces={"foot": Y >= 0},
    )  # fmt: skip
    return dmoc.Problem(
        dmoc.build(system, order=order), {"y": 0}, goal, contacts=["foot"], sequence=["-foot"],
        final_time=(0.2, 3), **{"ignored": ["foot"], "steps": 20} | fields,
    )  # fmt: skip


@pytest.mark.parametrize("order", [2, 4])
@pytest.mark.parametrize("ignored", [[], ["foot"]])
def test_a_foot_that_is_ignored_leaves_upwards_as_another_one(
    order: int, ignored: list[str]
) -> None:
    """It waits, and rises by 1 m against the weight to rest in T: int u^2 is 12/T^3 + 100 T."""
    problem = standing({"y": 1, "y_dot": 0}, order, ignored=ignored)
    solution = answer_of(problem, "ipm", starts=4)
    assert solution.cost == pytest.approx(12 / RISE**3 + 100 * RISE, rel=1e-2)
    assert solution.collisions[0].leaves == ("foot",)


@pytest.mark.parametrize("order", [2, 4])
def test_a_foot_that_is_ignored_is_not_left_under_load(order: int) -> None:
    """Without a force the weight holds it down."""
    dropped = standing({"y": -1}, order, bounds={"u": (0, 0)})
    solution = dmoc.solve(dropped, "ipm", starts=1)
    assert solution.status == "infeasible" and "the motion passes foot" in solution.message


def test_a_foot_that_has_opened_may_pass_its_surface() -> None:
    """It is ignored from the first step of the flight on: pulled up for it, the mass falls."""
    solution = answer_of(standing({"y": -1}, 4, steps=10), "ipm", starts=4)
    flight = solution.phases[1]
    assert flight.u[0, 0] >= 10 - 1e-6 and flight.q[1, 0] >= -1e-9
    assert flight.q[-1, 0] == pytest.approx(-1)


def test_rows_stand_in_the_first_step_away() -> None:
    """Three steps on the foot, three in flight: the node that ends the first of these, and the
    place inside it."""
    step = Transcription(standing({"y": -1}, 4, steps=3)).laws.step
    assert np.flatnonzero(step.gap.index[:, 0] != NOWHERE).tolist() == [4]
    assert np.flatnonzero(step.gap_inside.index[:, 0] != NOWHERE).tolist() == [3]
