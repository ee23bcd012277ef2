"""The phase that a state is in, by what has happened since the last plan."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dmoc.planning import planner
from dmoc.planning.planner import Planner

STATE = np.zeros(1), np.zeros(1)


def phase_of(over: int, monkeypatch: pytest.MonkeyPatch) -> tuple[int, list[tuple[float, ...]]]:
    """The phase where so many of three events are over, and what each is judged by: a plan that
    was made at 10 s, in phase 1 of 5, which had begun at 9.5 s."""
    judged = list[tuple[float, ...]]()

    def is_over(problem: Any, event: Any, state: Any, *times: float) -> bool:
        judged.append((event.time, *times))
        return len(judged) <= over

    monkeypatch.setattr(planner, "is_over", is_over)
    motion = SimpleNamespace(collisions=[SimpleNamespace(time=t) for t in (0.3, 0.7, 1.5)])
    last = SimpleNamespace(phase=1, origin=10.0, begun=9.5, motion=motion)
    own: Any = SimpleNamespace(_last=last, _measured=10.6, problem=SimpleNamespace(phases=5))
    return Planner._phase(own, None, STATE, 10.8), judged


@pytest.mark.parametrize("over", [0, 1, 2, 3])
def test_events_are_judged_by_their_own_phases(over: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """How late it is, how long the phase lasts that an event ends, and since when it is known."""
    phase, judged = phase_of(over, monkeypatch)
    expected = [(0.3, 0.5, 0.8, 0.2), (0.7, 0.1, 0.4, 0.2), (1.5, -0.7, 0.8, 0.2)]
    assert phase == 1 + over
    np.testing.assert_allclose(judged, expected[: over + 1], atol=1e-12)
