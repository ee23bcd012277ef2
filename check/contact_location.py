"""Where the flow of a phase, from the motion's own states, ends its mode: a contact that lifts off,
friction that gives way, sliding that stops, whatever moment is planned for it.

Each tenth of a phase is integrated in the mode of the phase (:eq:`dae`); what that mode keeps above
zero is looked at at both ends of each step, with the inputs there.  What falls further below than
errors of discretisation explain is located where it passes zero.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dmoc.check.checked_motion import Motion
from dmoc.codegen.kernels import Array
from dmoc.simulation.flow import FIRST, LAST, Steps
from dmoc.simulation.indeterminate_forces import borne
from dmoc.simulation.mode_choice import kept, limits
from dmoc.simulation.modes import Mode, Reaction
from dmoc.simulation.roots import crossing

# An event that is planned may happen within this share of the phase that it ends.
ON_TIME = 0.01
LOCATED = 1e-6  # of a step


@dataclass(frozen=True)
class Stage:
    """Steps of a phase side by side, one of each segment: the places of the segments, rows of
    states at both ends, the positions that what sticks keeps, and what the mode keeps above zero
    there (2, n, nc + 2 nt)."""

    segments: NDArray[np.intp]
    y: tuple[Array, Array]
    held: Array
    steps: Steps
    kept: Array


def kept_at_ends(
    motion: Motion,
    mode: Mode,
    y: tuple[Array, Array],
    steps: Steps,
    ends: tuple[Reaction, Reaction],
) -> Array:
    """What a mode keeps above zero at both ends of steps, shape (2, n, nc + 2 nt); infinite for
    surfaces that are open."""
    nq, nc = motion.model.nq, motion.model.nc
    found = []
    for rows, reaction, t in zip(y, ends, (steps.t, steps.t + steps.h), strict=True):
        q, v = (np.ascontiguousarray(rows[:, k * nq : (k + 1) * nq]) for k in (0, 1))
        held = borne(motion.model, mode, reaction, q, t)
        found.append(kept(motion.model, mode, held, q, v, t))
    least = np.array(found)
    least[..., [j for j in range(nc) if j not in mode.closed]] = np.inf
    return least


def passed_limits(motion: Motion, i: int, stages: list[Stage], slack: Array) -> Iterator[str]:
    """What ends the mode of a phase elsewhere than planned, in sentences with its time."""
    first: dict[int, float] = {}
    for number, stage in enumerate(stages):
        for n, j in zip(*np.nonzero((stage.kept < -slack).any(axis=0)), strict=True):
            time = _passing(motion, i, stages[: number + 1], (int(n), int(j)))
            first[int(j)] = min(time, first.get(int(j), np.inf))
    for j, time in first.items():
        sentence = _told(motion, i, j, time)
        if sentence:
            yield sentence


def _passing(motion: Motion, i: int, stages: list[Stage], where: tuple[int, int]) -> float:
    """When the limit that is passed in the last stage passes zero."""
    n, j = where
    segment = stages[-1].segments[n]
    for stage in reversed(stages):
        row = int(np.flatnonzero(stage.segments == segment)[0])
        low, high = stage.kept[:, row, j]
        t, h = float(stage.steps.t[row]), float(stage.steps.h[row])
        if low > 0 >= high:
            return _crossing(motion, i, stage, (row, j))
        if low > 0:
            return t + h  # between two steps whose inputs differ
    return t


def _crossing(motion: Motion, i: int, stage: Stage, where: tuple[int, int]) -> float:
    row, j = where
    one, mode, flow = slice(row, row + 1), motion.modes[i], motion.flow
    step = stage.steps.part(one)
    t, h = float(step.t[0]), float(step.h[0])

    def limit(share: float) -> float:
        u, y = step.inputs(share), stage.y[0][one].copy()
        part = Steps(step.t, share * step.h, step.u0, u)
        flow.advance(y, part, FIRST, LAST, mode, stage.held[one])
        at = np.array([t + share * h])
        return float(limits(motion.model, flow.integrator, mode, (y, u, at))[0, j])

    low, high = stage.kept[:, row, j]
    return t + h * crossing(limit, (0.0, float(low)), (1.0, float(high)), LOCATED)


def _told(motion: Motion, i: int, j: int, time: float) -> str:
    """A sentence on what ends a mode, empty where that is planned about then."""
    model, collisions = motion.model, motion.trajectory.collisions
    nc, nt = model.nc, model.nt
    c = collisions[i] if i < len(collisions) else None
    if j < nc:
        name = model.kernels.surfaces[j]
        what, planned = f"lifts {name!r} off", c is not None and name in c.leaves
    else:
        name = model.kernels.tangents[(j - nc) % nt]
        what = f"lets {name!r} slide" if j < nc + nt else f"ends the sliding of {name!r}"
        planned = c is not None and (name in c.friction or name in c.leaves)
    phase = motion.trajectory.phases[i]
    end = float(phase.t[-1])
    if planned and abs(time - end) <= ON_TIME * phase.duration:
        return ""
    instead = f"not at {end:.4g} s as planned" if planned else "which is not planned"
    return f"the simulation {what} at {time:.4g} s, {instead}"
