"""When a limit is passed that a step finds broken, back from there: steps by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dmoc.check import planned_run
from dmoc.check.planned_run import _passing

# Steps from 10 s on of 0.5 s, in segments that begin with the steps 0 and 3.
TIMES = SimpleNamespace(t=10 + 0.5 * np.arange(6), h=np.full(6, 0.5))
BEGINS = np.array([0, 0, 0, 3, 3, 3])


@pytest.mark.parametrize(
    ("kept", "last", "when"),
    [
        # What is left of the limit at both ends of each step: within a step,
        ("+- -- -- ++ ++ ++", 0, "in 0"), ("++ +- -- ++ ++ ++", 2, "in 1"),
        ("++ ++ ++ ++ +- --", 5, "in 4"), ("++ ++ ++ ++ ++ +-", 5, "in 5"),
        ("+0 -- -- ++ ++ ++", 1, "in 0"),  # on it
        # between two steps whose inputs differ,
        ("++ -- -- ++ ++ ++", 1, 10.5), ("++ ++ -- ++ ++ ++", 2, 11.0),
        ("++ ++ ++ ++ ++ --", 5, 12.5), ("++ -- -- ++ ++ ++", 2, 10.5),
        # and from the begin of its segment on.
        ("-- -- -- ++ ++ ++", 2, 10.0), ("++ ++ ++ -- -- --", 5, 11.5),
        ("++ ++ +- -- ++ ++", 3, 11.5), ("0- -- ++ ++ ++ ++", 1, 10.0),
    ],
)  # fmt: skip
def test_a_limit_is_passed_where_it_was_kept_last(
    kept: str, last: int, when: str | float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of the second of three limits; the others are kept."""
    sign = {"+": 1.0, "-": -1.0, "0": 0.0}
    ends = np.array([[sign[c] for c in step] for step in kept.split()]).T
    every = np.ones((2, 6, 3))
    every[:, :, 1] = ends
    steps: Any = SimpleNamespace(begins=BEGINS, kept=every, course=SimpleNamespace(steps=TIMES))
    monkeypatch.setattr(planned_run, "_crossing", lambda *arguments: ("in", *arguments[-1]))
    motion: Any = None
    passed: Any = _passing(motion, 0, steps, (last, 1))
    assert passed == (("in", int(when[3:]), 1) if isinstance(when, str) else when)
