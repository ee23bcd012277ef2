"""Forward simulation through the events behind which parameters have other values.

Each step is tried with the values that there are.  Where something happens in it, as a hit, another
mode or a switch that passes zero, the step is gone up to there, by the laws of the event, and goes
on with the values of the next phase.
"""

from __future__ import annotations

from collections import deque

import numpy as np

from dmoc.base.records import record
from dmoc.codegen.kernels import Array
from dmoc.mechanics.contact_mode import Mode
from dmoc.simulation.contact_motion import node, through_grasps
from dmoc.simulation.grips import Grasp
from dmoc.simulation.mode_choice import Setting
from dmoc.simulation.motion_record import MotionRecord
from dmoc.simulation.roots import crossing
from dmoc.simulation.tolerances import Magnitudes

# Shares of a step that are gone behind an event, one after the other until it has happened; within
# the last one no switch passes zero again.
BEHIND = 1e-12, 1e-9, 1e-6
# Share of a step to which switches are located.
LOCATED = 1e-12

# Setting, state (2 nq,), inputs (nu,), what there is so far and the grasps ahead.
Begun = tuple[Setting, Array, Array, tuple[Magnitudes, MotionRecord], deque[Grasp]]


@record(frozen=True, eq=False)
class _Trial:
    """A part of a step from its begin to its end: what comes of it, and when what happens."""

    setting: Setting
    y: Array
    mode: Mode
    journal: MotionRecord
    ahead: deque[Grasp]
    events: list[tuple[float, str]]

    @classmethod
    def of(cls, begun: Begun, span: tuple[float, float]) -> _Trial:
        setting, y, u, (largest, journal), ahead = begun
        copied, left = journal.copied(), deque(ahead)
        after, then, mode = through_grasps(setting, y, u, span, (largest, copied), left)
        marks = (mark.after.t for mark in copied.marks[len(journal.marks) :])
        hits = (c.time for c in copied.collisions[len(journal.collisions) :])
        events = [(t, "") for t in (*marks, *hits) if t > setting.since]
        return cls(after, then, mode, copied, left, events)


def through_changes(
    setting: Setting, y: Array, u: Array, span: tuple[float, float],
    so_far: tuple[Magnitudes, MotionRecord], ahead: deque[Grasp],
) -> tuple[Setting, Array, Mode]:  # fmt: skip
    """As :func:`~dmoc.simulation.contact_motion.through_grasps`, with the parameters of the next
    phase behind each event."""
    journal, (begin, end) = so_far[1], span
    while setting.later:
        trial, cut, event = _until_event((setting, y, u, so_far, ahead), (begin, end))
        vars(journal).update(vars(trial.journal))
        ahead.clear()
        ahead.extend(trial.ahead)
        setting, y, mode, begin = trial.setting, trial.y, trial.mode, cut
        if event:
            before, setting = node(setting, mode, y, u, cut), setting.following(cut)
            journal.enter(event, before, node(setting, mode, y, u, cut), setting.whole(mode))
        elif cut == end:
            return setting, y, mode
    return through_grasps(setting, y, u, (begin, end), so_far, ahead)


def unswitched(setting: Setting, y: Array, states: Array, first: int) -> int:
    """How many steps from number ``first`` on, between y and states (n, 2 nq), end before one in
    which a switch begins a phase with other parameters."""
    model, names = setting.model, setting.model.contacts.switches
    if not (setting.later and names and len(states)):
        return len(states)
    rows, t = np.vstack([y, states]), (first + np.arange(len(states) + 1)) * setting.h
    q, v = (np.ascontiguousarray(part) for part in np.split(rows, 2, axis=1))
    w = model.crossings(q, v, t)
    passed = ((w[:-1] < 0) & (w[1:] >= 0))[:, : len(names)].any(axis=1)
    return int(passed.argmax()) if passed.any() else len(states)


def _until_event(
    begun: Begun, span: tuple[float, float]
) -> tuple[_Trial, float, tuple[float, str] | None]:
    """A part of a step up to its first event, and a little further where this is no switch: what
    comes of it, where it ends, and the time and the switch of the event, if there is one."""
    trial, (begin, end) = _Trial.of(begun, span), span
    time, switch = min([*trial.events, *_switches(begun, trial, span)], default=(end, None))
    if switch is None:
        return trial, end, None
    if switch:
        return _Trial.of(begun, (begin, time)), time, (time, switch)
    for share in BEHIND:
        cut = min(time + share * begun[0].h, end)
        trial = _Trial.of(begun, (begin, cut))
        if trial.events:
            break
    return trial, cut, min(trial.events, default=None)


def _switches(begun: Begun, trial: _Trial, span: tuple[float, float]) -> list[tuple[float, str]]:
    """When switches grow through zero in a part of a step, and which."""
    setting, y, *_ = begun
    model, nq, (begin, end) = setting.model, setting.model.nq, span
    names = model.contacts.switches

    def values(y: Array, t: float) -> Array:
        return model.crossings(y[:nq], y[nq : 2 * nq], t)[: len(names)]

    first, last = values(y, begin), values(trial.y, end)
    found = list[tuple[float, str]]()
    for k, name in enumerate(names):
        if first[k] < 0 <= last[k]:

            def value(t: float, k: int = k) -> float:
                return float(values(_Trial.of(begun, (begin, t)).y, t)[k])

            ends = (begin, float(first[k])), (end, float(last[k]))
            time = crossing(value, *ends, LOCATED * setting.h)
            if time > setting.since + BEHIND[-1] * setting.h:
                found.append((time, name))
    return found
