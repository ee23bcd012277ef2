"""Gaps at the ends of periodic motions that contacts of the other end decide."""

from __future__ import annotations

from typing import Any

import pytest
import sympy as sp
from several_contacts import GRAVITY
from sympy.physics.mechanics import dynamicsymbols

import dmoc
from dmoc.program.transcription import Transcription


@pytest.mark.parametrize(
    ("stated", "rows"),
    [
        ({"contacts": ["left"], "sequence": ["+right -left"], "durations": [None, 0]}, []),
        (
            {"contacts": ["left"], "final_time": 1, "design": {"k": (0.5, 2)}},
            ["right 0", "right 4"],
        ),
        ({"contacts": ["left"], "final_time": 1}, []),
        ({"final_time": 1}, ["left 0", "right 0", "left 4", "right 4"]),
        ({"final_time": 1, "ignored": ["right"]}, ["left 0", "left 4"]),
        ({"final_time": 1, "start": {"y": 0.5, "a": 0.2}}, []),
        (
            {"final_time": 1, "start": {"y": 0.5}, "periodic": {"a": "-a"}},
            ["left 0", "right 0", "left 4", "right 4"],
        ),
    ],
    ids=["exchanged", "of another length", "standing", "free", "ignored", "fixed", "in one state"],
)
def test_a_gap_that_is_that_of_a_contact_at_the_other_end_is_no_row(
    stated: dict[str, Any], rows: list[str]
) -> None:
    """Mirrored from one end to the other, the right foot begins where the left one has ended: both
    rows together would leave no motion between them, and no limit to their multipliers."""
    y, a = dynamicsymbols("y a")
    k = sp.Symbol("k")
    feet = {"left": y - k * a >= 0, "right": y + a >= 0}
    lagrangian = y.diff() ** 2 / 2 + a.diff() ** 2 / 2 - GRAVITY * y
    system = dmoc.MechanicalSystem("beam", [y, a], lagrangian, {k: 1.0}, surfaces=feet)
    mirrored = {"start": {}, "steps": 4, "periodic": {"y": "y", "a": "-a"}}
    problem = dmoc.Problem(dmoc.build(system), **mirrored | stated)
    gap = Transcription(problem).laws.step.gap
    ends = [(k, j) for k, j in gap.places.tolist() if k in (0, problem.steps)]
    assert [f"{[*feet][j]} {k}" for k, j in ends] == rows
