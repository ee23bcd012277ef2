"""A motion with lasting contacts or friction, followed through its planned modes and events.

Segments show what ends a mode elsewhere than planned.  Each tenth of a phase is integrated in the
mode of the phase (:eq:`dae`), from the motion's own state; what that mode keeps above zero is
looked at at both ends of each step, with the inputs there.  What falls further below than errors of
discretisation explain is located where it passes zero: a contact that lifts off, friction that
gives way, sliding that stops.  Surfaces that are met in phases in which nothing is closed or rubs
are found as in a free motion.  The run from the start to the end is not independent in this: it
goes through the planned events at their planned times.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from dmoc.base.records import record
from dmoc.check.checked_motion import Motion, put
from dmoc.check.consistency import OFF
from dmoc.check.contact_forces import BEARABLE, ON_TIME, TURNED
from dmoc.check.findings import largest
from dmoc.check.integrated_steps import IntegratedSteps
from dmoc.check.runs import Departures, WholeRun, contacts_of_phases, is_planned
from dmoc.check.segments import Segments, between
from dmoc.check.verdict import PASSING
from dmoc.codegen.kernels import Array
from dmoc.mechanics.contact_mode import Mode
from dmoc.motion.trajectory import GRAZING, Collision
from dmoc.simulation.contact_modes import limits
from dmoc.simulation.flow import END_ERROR, FIRST, GAP_ERROR, LAST, PLACES, Steps, SurfaceContact
from dmoc.simulation.roots import crossing

LOCATED = 1e-6  # of a step


def planned_run(motion: Motion, parts: Segments, sizes: tuple[Array, ...]) -> WholeRun:
    """The run through the plan; ``sizes`` are those of contact forces, friction and joints."""
    # What errors of discretisation explain.
    past = OFF * motion.sizes.along(motion.nodes.within_slopes)[0]
    slack = BEARABLE * sizes[0], BEARABLE * sizes[1], TURNED * motion.sizes.slide, past
    met, ends = left(motion, parts, np.concatenate(slack))
    missed, early = list[Collision](), list[str]()
    free = [i for i in range(motion.stepped) if motion.trajectory.phases[i].free]
    for i, contacts in zip(free, contacts_of_phases(motion, parts, free), strict=True):
        planned = [c for c in contacts if is_planned(motion, i, c)]
        met += [c for c in contacts if c not in planned]
        early += [_early(motion, i, c) for c in planned if _too_early(motion, i, c)]
        missed += _missed(motion, i, planned)
    contacts = [c for c in met if c.jump > GRAZING]
    # What the segments meet counts for the run too.
    way = Departures(tuple(missed), tuple(contacts))
    return WholeRun(_terminal_error(motion), contacts, way, way, (*ends, *early))


def _terminal_error(motion: Motion) -> float:
    """The error at the end of a simulation from the start, which goes through the planned modes and
    events at their planned times."""
    nq, phases = motion.model.nq, motion.trajectory.phases
    y = np.hstack([phases[0].q[:1], phases[0].v[:1]])
    for i, (phase, mode) in enumerate(zip(phases, motion.modes, strict=True)):
        y, anchors = put(motion, mode, y, phase.t[:1])
        if phase.steps:
            flow = motion.within(i).flow
            flow.advance(y, motion.steps[i], FIRST, np.array([phase.steps]), mode, anchors)
        if i + 1 < len(phases):
            q, v = (np.ascontiguousarray(a) for a in np.split(y, [nq], axis=1))
            y = np.hstack([q, motion.passages[i].after_law(q, v).velocity])
    return largest(motion.within(i).errors(y, phase.t[-1:], phase.q[-1:], phase.p[-1:]))


def _missed(motion: Motion, i: int, planned: list[SurfaceContact]) -> list[Collision]:
    """The planned contact at the end of a free phase, where the simulation misses it."""
    return [
        c
        for c in motion.trajectory.collisions[i : i + 1]
        if c.surface
        and motion.watched[motion.model.surface_numbers[c.surface]]
        and not c.grazes
        and not planned
        and not _softly(motion, i)
    ]


def _softly(motion: Motion, i: int) -> bool:
    """Whether a phase ends on its surface with hardly a rate, so that a simulation may just not
    reach it."""
    c, phase = motion.trajectory.collisions[i], motion.trajectory.phases[i]
    j = motion.model.surface_numbers[c.surface]
    rate = motion.model.gap_rates(phase.q[-1], phase.v[-1], c.time)[j]
    return bool(rate <= TURNED * motion.sizes.rate[j])


def _too_early(motion: Motion, i: int, contact: SurfaceContact) -> bool:
    """Whether a contact is met so long before the end of a phase that the gap, which goes on with
    its rate at the end, is further behind the surface than a segment may be off."""
    phase, j = motion.trajectory.phases[i], motion.model.surface_numbers[contact.surface]
    early = float(phase.t[-1]) - contact.time
    rate = float(motion.model.gap_rates(phase.q[-1], phase.v[-1], phase.t[-1])[j])
    behind = early * rate > PASSING["segment error"] * motion.sizes.gap[j]
    return behind and early > ON_TIME * phase.duration


def _early(motion: Motion, i: int, c: SurfaceContact) -> str:
    end = motion.trajectory.phases[i].t[-1]
    return f"the simulation meets {c.surface!r} at {c.time:.4g} s, not at {end:.4g} s as planned"


@record(frozen=True, eq=False)
class HeldSteps:
    """The steps of a phase in its mode, from the starts of its segments: the first of each step's
    segment (N,), the steps as they go, the positions that what sticks keeps, and what the mode
    keeps above zero at both ends (2, N, 2 nc + 2 nt)."""

    begins: NDArray[np.intp]
    course: IntegratedSteps
    anchors: Array
    kept: Array


def left(motion: Motion, parts: Segments, slack: Array) -> tuple[list[SurfaceContact], list[str]]:
    """Contacts that are not planned and are met in phases with closed contacts or friction, and
    sentences about modes that end elsewhere than planned. ``slack`` are the contact forces,
    friction, sliding velocities and ways past ends, shape (2 nc + 2 nt,), that errors of
    discretisation explain."""
    met, sentences = list[SurfaceContact](), list[str]()
    for i in range(motion.stepped):
        if not motion.trajectory.phases[i].free:
            own = motion.within(i)
            steps = _held_steps(own, parts, i)
            met += _met(own, i, steps.course)
            sentences += passed_limits(own, i, steps, slack)
    return met, sentences


def _held_steps(motion: Motion, parts: Segments, i: int) -> HeldSteps:
    """The steps of a phase in its mode."""
    own, course = parts.of_phase(i), parts.course.part(motion.steps_of(i))
    counts = parts.last[own] - parts.first[own]
    begins, anchors = (
        np.repeat(parts.first[own], counts),
        np.repeat(parts.anchors[own], counts, axis=0),
    )
    return HeldSteps(begins, course, anchors, _kept_at_ends(motion, motion.modes[i], course))


def _kept_at_ends(motion: Motion, mode: Mode, course: IntegratedSteps) -> Array:
    """Limits of a mode at both ends of steps, shape (2, n, 2 nc + 2 nt), which it keeps above zero;
    infinite for surfaces that are open."""
    steps, react = course.steps, motion.flow.integrator.reaction
    y, u = np.vstack([course.start, course.stop]), np.vstack([steps.u0, steps.u1])
    t = np.concatenate([steps.t, steps.t + steps.h])
    least = limits(motion.model, react, mode, (y, u, t)).reshape(2, len(steps), -1)
    least[..., [j for j in range(motion.model.nc) if j not in mode.closed]] = np.inf
    return least


def _met(motion: Motion, i: int, course: IntegratedSteps) -> Iterator[SurfaceContact]:
    """Contacts in steps of a phase that its plan does not have; a phase without closed contacts
    and friction is simulated through its contacts elsewhere."""
    model, nq = motion.model, motion.model.nq
    times, path = between(motion, course, PLACES[1:])
    least = END_ERROR * motion.sizes.along(motion.nodes.within_slopes)[0]
    gaps = model.barriers(path.reshape(-1, nq), times.ravel(), least)
    gaps = gaps.reshape(*times.shape, model.nc)
    allowed = motion.flow.allowance(times.ravel()).reshape(gaps.shape)
    over = gaps > allowed + GAP_ERROR * motion.sizes.gap
    over[..., list(motion.modes[i].closed)] = False
    for n, j in zip(*np.nonzero(over.any(axis=0)), strict=True):
        name, time = model.kernels.surfaces[j], float(times[int(np.argmax(over[:, n, j])), n])
        contact = SurfaceContact(name, time, _jump(motion, course.stop[n], time, j))
        if not is_planned(motion, i, contact):
            yield contact


def _jump(motion: Motion, y: Array, t: float, j: int) -> float:
    """Largest change of a momentum by an impact from a state, relative to the largest momentum."""
    nq = motion.model.nq
    q, v = y[:nq], y[nq : 2 * nq]
    e = float(motion.model.coefficients(motion.flow.restitution, q, v, t)[j])
    after, impulse, _ = motion.flow.impact(q, v, t, j, e)
    change = motion.model.momentum(q, after, t) - motion.model.momentum(q, v, t)
    return float((np.abs(change) / motion.sizes.p).max()) if impulse > 0 else 0.0


def passed_limits(motion: Motion, i: int, steps: HeldSteps, slack: Array) -> Iterator[str]:
    """Sentences, with times, about limits that end the mode of a phase elsewhere than planned;
    ``slack`` as in :func:`left`, shape (2 nc + 2 nt,)."""
    first: dict[int, float] = {}
    for k, j in zip(*np.nonzero((steps.kept < -slack).any(axis=0)), strict=True):
        time = _passing(motion, i, steps, (int(k), int(j)))
        first[int(j)] = min(time, first.get(int(j), np.inf))
    for j, time in first.items():
        sentence = _sentence(motion, i, j, time)
        if sentence:
            yield sentence


def _passing(motion: Motion, i: int, steps: HeldSteps, where: tuple[int, int]) -> float:
    """When the limit that is passed in a step passes zero, there or before in its segment."""
    (last, j), times = where, steps.course.steps
    for k in range(last, int(steps.begins[last]) - 1, -1):
        low, high = steps.kept[:, k, j]
        if low > 0 >= high:
            return _crossing(motion, i, steps, (k, j))
        if low > 0:
            return float(times.t[k] + times.h[k])  # between two steps whose inputs differ
    return float(times.t[steps.begins[last]])


def _crossing(motion: Motion, i: int, steps: HeldSteps, where: tuple[int, int]) -> float:
    k, j = where
    one, mode, flow = slice(k, k + 1), motion.modes[i], motion.flow
    step = steps.course.steps.part(one)
    t, h = float(step.t[0]), float(step.h[0])

    def limit(share: float) -> float:
        u, y = step.inputs(share), steps.course.start[one].copy()
        part = Steps(step.t, share * step.h, step.u0, u)
        flow.advance(y, part, FIRST, LAST, mode, steps.anchors[one])
        at = np.array([t + share * h])
        return float(limits(motion.model, flow.integrator.reaction, mode, (y, u, at))[0, j])

    low, high = steps.kept[:, k, j]
    return t + h * crossing(limit, (0.0, float(low)), (1.0, float(high)), LOCATED)


def _sentence(motion: Motion, i: int, j: int, time: float) -> str:
    """A sentence on what ends a mode, empty where that is planned about then."""
    model, collisions = motion.model, motion.trajectory.collisions
    nc, nt = model.nc, model.nt
    c = collisions[i] if i < len(collisions) else None
    if j < nc:
        name = model.kernels.surfaces[j]
        what, planned = f"lifts {name!r} off", c is not None and name in c.leaves
        if model.contacts.pull[j]:
            what = f"tears grip {model.contacts.grasped([name])[0]!r} loose"
    elif j >= nc + 2 * nt:
        name = model.kernels.surfaces[j - nc - 2 * nt]
        what, planned = f"slips off the end of {name!r}", c is not None and name in c.off
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
