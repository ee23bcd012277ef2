"""The phase that a state is in, by what has happened since the last plan."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dmoc.motion.trajectory import Phase, Trajectory
from dmoc.planning import planner
from dmoc.planning.plan import Plan
from dmoc.planning.planner import Planner
from dmoc.solvers.outcome import Status

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


@pytest.mark.parametrize(
    ("t", "measured", "replans"),
    [
        (0.94, 0.9, False), (0.96, 0.9, True), (1.0, 0.9, True),  # due at 1 s, in steps of 0.1 s
        (3.3, 3.3, True), (3.5, 3.5, False), (3.9, 3.9, False),  # three periods before its end
        (1.0, 0.0, False), (1.0, None, False),  # nothing was measured
    ],
)  # fmt: skip
def test_a_plan_is_made_where_it_is_due_but_not_at_the_end(
    t: float, measured: float | None, replans: bool
) -> None:
    """Every 0.2 s of a motion of 4 s, from what was measured, in the later of two phases."""
    made = list[tuple[Any, ...]]()
    own: Any = SimpleNamespace(
        _due=1.0, every=0.2, _last=SimpleNamespace(phase=2),
        plan=SimpleNamespace(final_time=4.0, input=lambda at: np.array([at])),
        replan=lambda time, state, phase: made.append((time, *map(list, state), phase)),
    )  # fmt: skip
    state: Any = measured and SimpleNamespace(time=measured, phase=1, y=np.arange(4.0))
    if measured == 0:
        state = SimpleNamespace(time=0.0, phase=1, y=np.arange(4.0))
    assert Planner.steer(own, 0, t, 0.1, state) == pytest.approx([t + 0.05])
    assert made == ([(measured, [0.0, 1.0], [2.0, 3.0], 2)] if replans else [])
    assert own._due == pytest.approx(t + 0.2 if replans else 1.0)


def test_a_plan_counts_the_time_from_the_beginning_of_the_motion() -> None:
    """Made at 3 s for 2 s, x = 10 s^2 at s seconds from then; before and after it, its ends."""
    s = np.linspace(0.0, 2.0, 5)
    phase = Phase(s, 10 * s[:, None] ** 2, 20 * s[:, None], 20 * s[:, None], s[:-1, None] + 7)
    limits = np.array([[-np.inf, np.inf]])
    motion = Trajectory(
        "m", "", ("x",), ("u",), {}, (phase,), (), "constant", limits, limits, {}, 2
    )
    plan = Plan(3.5, 0, Status.SOLVED, "", motion, 3.0, 1.0, 0.1, 4, True)
    assert plan.final_time == 5.0
    for time, x in ((3.0, 0.0), (4.0, 10.0), (5.0, 40.0), (2.0, 0.0), (9.0, 40.0)):
        assert float(plan.at(time)["x"]) == pytest.approx(x)
    assert plan.input(3.25) == pytest.approx([7.0]) and plan.input(4.75) == pytest.approx([8.5])


@pytest.mark.parametrize("over", [0, 1, 2, 3])
def test_events_are_judged_by_their_own_phases(over: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """How late it is, how long the phase lasts that an event ends, and since when it is known."""
    phase, judged = phase_of(over, monkeypatch)
    expected = [(0.3, 0.5, 0.8, 0.2), (0.7, 0.1, 0.4, 0.2), (1.5, -0.7, 0.8, 0.2)]
    assert phase == 1 + over
    np.testing.assert_allclose(judged, expected[: over + 1], atol=1e-12)
