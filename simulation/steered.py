"""Forward simulation with inputs that are decided on the way, step by step."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import astuple
from typing import Protocol

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.mechanics.contact_mode import FREE, Mode
from dmoc.motion.trajectory import Collision
from dmoc.simulation.contact_motion import node
from dmoc.simulation.given_inputs import quiet_steps
from dmoc.simulation.grips import Grasp
from dmoc.simulation.mode_choice import Setting
from dmoc.simulation.motion_record import ContactState, MotionRecord, Rows
from dmoc.simulation.phase_changes import through_changes, unswitched
from dmoc.simulation.tolerances import Magnitudes, magnitudes_at

# Where in a step limits are looked at, beside its start: steps of a control are short.
LOOKS = np.array([0.5, 1.0])


class Control(Protocol):
    """What decides on the inputs of a simulation while it goes on."""

    def pushed(self, k: int, y: Array) -> Array:
        """The state (q | v) at the start of step k after what pushes it there; itself if nothing
        does."""

    def input(self, k: int, y: Array) -> Array:
        """The inputs (nu,) of step k, which begins in a state y, shape (2 nq,)."""

    def feel(self, k: int, collisions: Sequence[Collision], mode: Mode) -> None:
        """Step k has ended in a mode, after some collisions."""


def steered(
    setting: Setting, y: Array, u: Array, control: Control, journal: MotionRecord,
    grasps: Sequence[Grasp] = (),
) -> Iterator[Rows]:  # fmt: skip
    """States at the end of steps with the inputs that a control decides on, which are written into
    u (steps, nu)."""
    largest, mode, h = Magnitudes(), FREE, setting.h
    keeps, ahead = False, deque(grasps)
    for k in range(len(u)):
        before, count = y, len(journal.collisions)
        y = control.pushed(k, y)
        u[k] = control.input(k, y)
        if keeps and y is before and quiet_steps(h, ahead, k, 1):
            row, so_far = y.copy(), np.array(astuple(largest))
            rows = setting.integrator.stay(mode, row, u[k : k + 1], h, k, LOOKS, so_far)
            largest = Magnitudes(*map(float, so_far))
            if unswitched(setting, before, rows[0], k):
                y = rows[0][0]
                journal.last = ContactState((k + 1) * h, y, rows[1][0], rows[2][0])
                control.feel(k, (), setting.whole(mode))
                yield journal.last.rows
                continue
        largest = magnitudes_at(setting.model, y, u[k], k * h, h, largest)
        span, record = (k * h, (k + 1) * h), (largest, journal)
        setting, y, mode = through_changes(setting, y, u[k], span, record, ahead)
        journal.last, keeps = node(setting, mode, y, u[k], (k + 1) * h), True
        control.feel(k, journal.collisions[count:], setting.whole(mode))
        yield journal.last.rows
