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

from dmoc.check.checked_motion import Motion, nodes_of_segments
from dmoc.check.path_limits import IntegratedSteps
from dmoc.check.runs import SAME_CONTACT
from dmoc.check.segments import between, put
from dmoc.codegen.kernels import Array
from dmoc.mechanics.contact_mode import Mode
from dmoc.simulation.flow import FIRST, LAST, PLACES, TOUCH, Steps, SurfaceContact
from dmoc.simulation.mode_choice import limits
from dmoc.simulation.roots import crossing

# An event that is planned may happen within this share of the phase that it ends.
ON_TIME = 0.01
LOCATED = 1e-6  # of a step


@dataclass(frozen=True)
class Stage:
    """Steps of a phase side by side, one of each segment: the places of the segments, the steps as
    they go, the positions that what sticks keeps, and what the mode keeps above zero at both ends
    (2, n, nc + 2 nt)."""

    segments: NDArray[np.intp]
    course: IntegratedSteps
    held: Array
    kept: Array


def left(motion: Motion, slack: Array) -> tuple[list[SurfaceContact], list[str]]:
    """Contacts that are not planned and are met in phases with closed contacts or friction, and
    what ends a mode elsewhere than planned, in sentences; ``slack`` are the contact forces,
    friction and sliding velocities (nc + 2 nt) that errors of discretisation explain."""
    met, sentences = list[SurfaceContact](), list[str]()
    for i in range(len(motion.steps)):
        if not is_free(motion, i):
            stages = list(_stages(motion, i))
            met += [contact for stage in stages for contact in _met(motion, i, stage.course)]
            sentences += passed_limits(motion, i, stages, slack)
    return met, sentences


def _stages(motion: Motion, i: int) -> Iterator[Stage]:
    """The steps of a phase in its mode, those of its segments side by side."""
    phase, mode, steps = motion.trajectory.phases[i], motion.modes[i], motion.steps[i]
    cuts = nodes_of_segments(phase.steps)
    begins = cuts[:-1]
    y, held = put(motion, mode, np.hstack([phase.q[begins], phase.v[begins]]), phase.t[begins])
    for k in range(int(np.diff(cuts).max())):
        on = np.flatnonzero(begins + k < cuts[1:])
        step, start, stop = begins[on] + k, y[on], y[on]
        ends = motion.flow.advance(stop, steps, step, step + 1, mode, held[on])
        y[on], course = stop, IntegratedSteps(steps.part(step), start, ends, stop)
        yield Stage(on, course, held[on], _kept_at_ends(motion, mode, course))


def _kept_at_ends(motion: Motion, mode: Mode, course: IntegratedSteps) -> Array:
    """What a mode keeps above zero at both ends of steps, shape (2, n, nc + 2 nt); infinite for
    surfaces that are open."""
    steps, integrator = course.steps, motion.flow.integrator
    rows = (course.start, steps.u0, steps.t), (course.stop, steps.u1, steps.t + steps.h)
    least = np.array([limits(motion.model, integrator, mode, one) for one in rows])
    least[..., [j for j in range(motion.model.nc) if j not in mode.closed]] = np.inf
    return least


def _met(motion: Motion, i: int, course: IntegratedSteps) -> Iterator[SurfaceContact]:
    """Contacts in steps of a phase that its plan does not have; a phase without closed contacts
    and friction is simulated through its contacts elsewhere."""
    model, nq = motion.model, motion.model.nq
    times, path = between(motion, course, PLACES[1:])
    gaps = model.gaps(path.reshape(-1, nq), times.ravel()).reshape(*times.shape, model.nc)
    allowed = motion.flow.allowance(times.ravel()).reshape(gaps.shape)
    over = gaps > allowed + TOUCH * motion.sizes.gap
    over[..., list(motion.modes[i].closed)] = False
    for n, j in zip(*np.nonzero(over.any(axis=0)), strict=True):
        name, time = model.kernels.surfaces[j], float(times[int(np.argmax(over[:, n, j])), n])
        if not is_planned(motion, i, name, time):
            yield SurfaceContact(name, time, _jump(motion, course.stop[n], time, j))


def _jump(motion: Motion, y: Array, t: float, j: int) -> float:
    """Largest change of a momentum by an impact from a state, relative to the largest momentum."""
    nq = motion.model.nq
    q, v = y[:nq], y[nq : 2 * nq]
    after, impulse, _ = motion.flow.impact(q, v, t, j, float(motion.flow.restitution[j]))
    change = motion.model.momentum(q, after, t) - motion.model.momentum(q, v, t)
    return float((np.abs(change) / motion.sizes.p).max()) if impulse > 0 else 0.0


def is_free(motion: Motion, i: int) -> bool:
    """Whether nothing is closed or rubs in a phase."""
    phase = motion.trajectory.phases[i]
    return not phase.closed and not phase.rubbing


def is_planned(motion: Motion, i: int, surface: str, time: float) -> bool:
    """Whether a contact is the one that ends a phase."""
    if i >= len(motion.trajectory.collisions):
        return False
    c = motion.trajectory.collisions[i]
    return surface in (c.surface, *c.lands) and abs(time - c.time) <= (
        SAME_CONTACT * motion.sizes.time
    )


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
        (low, high), steps = stage.kept[:, row, j], stage.course.steps
        t, h = float(steps.t[row]), float(steps.h[row])
        if low > 0 >= high:
            return _crossing(motion, i, stage, (row, j))
        if low > 0:
            return t + h  # between two steps whose inputs differ
    return t


def _crossing(motion: Motion, i: int, stage: Stage, where: tuple[int, int]) -> float:
    row, j = where
    one, mode, flow = slice(row, row + 1), motion.modes[i], motion.flow
    step = stage.course.steps.part(one)
    t, h = float(step.t[0]), float(step.h[0])

    def limit(share: float) -> float:
        u, y = step.inputs(share), stage.course.start[one].copy()
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
