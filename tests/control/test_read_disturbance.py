"""What a disturbance may say."""

from __future__ import annotations

from typing import Any

import pytest

import dmoc
from dmoc.base.errors import SimulationError
from dmoc.control.disturbance import read_disturbance

STATES = "x", "x_dot"


def test_fields_of_a_mapping_are_those_of_a_disturbance() -> None:
    stated = {"start": {"x": 0.1}, "noise": {"x_dot": 0.2}, "seed": 3}
    for value in (stated, dmoc.Disturbance(**stated)):
        read = read_disturbance(value, STATES, 2.0)
        assert read.start.tolist() == [0.1, 0.0] and read.noise.tolist() == [0.0, 0.2]
        assert read.seed == 3 and read.delay == 0 and not read.pushes
    assert not read_disturbance(None, STATES, 2.0).noise.any()


@pytest.mark.parametrize(
    ("value", "told"),
    [
        ({"nois": {}}, r"unknown field 'nois' in disturb: .*\(did you mean 'noise'\?\)"),
        ({"seed": 1, "begin": {}}, "unknown field 'begin' in disturb: expected one of start"),
        ({1: 2}, "unknown field '1' in disturb"),
        (5, "disturb = 5: expected a dmoc.Disturbance or a mapping of its fields"),
        ([("seed", 1)], "expected a dmoc.Disturbance or a mapping of its fields"),
    ],
)
def test_nothing_else_is_one(value: Any, told: str) -> None:
    with pytest.raises(SimulationError, match=told):
        read_disturbance(value, STATES, 2.0)
