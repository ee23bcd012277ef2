"""Forward simulation with inputs that are given, step by step."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import astuple, replace

import numpy as np

from dmoc.base.tolerances import ROUNDING
from dmoc.codegen.kernels import Array
from dmoc.mechanics.contact_mode import Mode
from dmoc.simulation.contact_motion import node
from dmoc.simulation.grips import Grasp
from dmoc.simulation.mode_choice import Setting
from dmoc.simulation.mode_flow import PLACES
from dmoc.simulation.motion_record import ContactState, MotionRecord, Rows
from dmoc.simulation.phase_changes import through_changes, unswitched
from dmoc.simulation.tolerances import Magnitudes, magnitudes_at

# Steps that are gone in compiled code between two looks for Ctrl-C.
AT_ONCE = 256


def nodes(
    setting: Setting, y: Array, u: Array, first: int, journal: MotionRecord,
    grasps: Sequence[Grasp] = (),
) -> Iterator[Rows]:  # fmt: skip
    """States at the end of the steps from ``first`` on, each with its inputs u (steps, nu), some at
    a time."""
    largest, k, ahead = Magnitudes(), first, deque(grasps)
    while k < len(u):
        t, end = k * setting.h, (k + 1) * setting.h
        largest = magnitudes_at(setting.model, y, u[k], t, setting.h, largest)
        setting, y, mode = through_changes(setting, y, u[k], (t, end), (largest, journal), ahead)
        journal.last, k = node(setting, mode, y, u[k], end), k + 1
        yield journal.last.rows
        count = quiet_steps(setting.h, ahead, k, AT_ONCE)
        inputs, so_far = np.ascontiguousarray(u[k : k + count]), np.array(astuple(largest))
        before, y = y, y.copy()
        rows = setting.integrator.stay(mode, y, inputs, setting.h, k, PLACES, so_far)
        quiet = unswitched(setting, before, rows[0], k)
        if quiet < len(rows[0]):
            y = rows[0][quiet - 1] if quiet else before
            rows = rows[0][:quiet], rows[1][:quiet], rows[2][:quiet]
        largest = Magnitudes(*map(float, so_far))
        k += len(rows[0])
        if len(rows[0]):
            journal.last = ContactState(k * setting.h, *(of[-1] for of in rows))
            yield rows
        rests = not len(rows[0]) and _rests(setting, mode, journal.last, u[k - 1], largest)
        while rests and not ahead and k < len(u) and (u[k] == u[k - 1]).all():
            k += 1
            journal.last = replace(journal.last, t=k * setting.h)
            yield journal.last.rows


def quiet_steps(h: float, ahead: Sequence[Grasp], k: int, most: int) -> int:
    """How many steps from step k on, at most ``most``, end before the next grasp."""
    if not ahead:
        return most
    return min(most, max(0, int(ahead[0].ready / h * (1 + ROUNDING)) - k))


def _rests(setting: Setting, mode: Mode, at: ContactState, u: Array, largest: Magnitudes) -> bool:
    """Whether a state goes on for ever under its inputs: nothing moves or is accelerated, and
    nothing depends on the time."""
    model, nq = setting.model, setting.model.nq
    if model.kernels.manifest.explicit_time:
        return False
    times, mass = np.array([at.t]), np.sqrt(np.diagonal(model.mass(at.y[:nq], at.t)))
    acceleration = setting.integrator.reaction(mode, at.y[None], u[None], times).acceleration[0]
    moved = np.abs(mass * at.y[nq : 2 * nq]), np.abs(mass * acceleration)
    most = largest.velocity, largest.acceleration
    return all(bool((m <= ROUNDING * size).all()) for m, size in zip(moved, most, strict=True))
