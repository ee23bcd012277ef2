"""When a feedback takes the event that it expects as happened."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dmoc.control.controller import BEYOND, SOONER, Controller
from dmoc.motion.trajectory import Collision

NONE = np.zeros(1)
NEAR = 3.0 - 2.0 * BEYOND  # the phase lasts from 1 to 3 s


def event(surface: str = "", **kind: Any) -> Collision:
    return Collision(surface, 3.0, NONE, 0.0, NONE, NONE, 0.0, 0.0, **kind)


LANDS, HITS = event("floor", lands=("floor",)), event("wall")
LEAVES = event(leaves=("floor",), friction={"floor": 0})
STICKS = event(friction={"floor": 0, "rail": 1})


@pytest.mark.parametrize(
    ("expected", "t", "closed", "rubbing", "opened", "hits", "happened"),
    [
        (LANDS, 1.9, ["floor"], {}, ["floor"], [], False),  # before the half of the phase
        (LANDS, 2.0, ["floor"], {}, ["floor"], [], True),
        (LANDS, 2.5, ["floor", "wall"], {}, ["floor"], [], True),
        (LANDS, 2.5, ["wall"], {}, ["floor"], [], False),
        (LANDS, 9.0, ["wall"], {}, ["floor"], [], False),
        (LANDS, 2.5, ["floor"], {}, [], [], False),  # it was never open
        (HITS, 1.0, [], {}, [], ["wall"], True),
        (HITS, 3.1, [], {}, [], ["floor"], False),
        (LEAVES, NEAR - 1e-6, [], {}, [], [], False),
        (LEAVES, NEAR + 1e-6, [], {}, [], [], True),
        (LEAVES, NEAR + 1e-6, ["floor"], {}, [], [], False),
        (LEAVES, 3.0, ["floor"], {}, [], [], True),
        (STICKS, NEAR + 1e-6, [], {"floor": 0, "rail": 1}, [], [], True),
        (STICKS, NEAR + 1e-6, [], {"floor": 0, "rail": -1}, [], [], False),
        (STICKS, NEAR + 1e-6, [], {"rail": 1}, [], [], False),
        (STICKS, 3.0, [], {"floor": 1, "rail": -1}, [], [], True),
    ],
)
def test_an_event_is_felt_by_its_kind(
    expected: Collision, t: float, closed: list[str], rubbing: dict[str, int], opened: list[str],
    hits: list[str], happened: bool,
) -> None:  # fmt: skip
    assert SOONER == 0.5
    steers = SimpleNamespace(span=lambda phase: (1.0, 3.0))
    own: Any = SimpleNamespace(steers=steers, phase=0, opened=set(opened), hits=hits)
    assert Controller._happened(own, expected, t, closed, rubbing) is happened
