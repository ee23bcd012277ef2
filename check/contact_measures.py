"""What is measured of a motion with lasting contacts or friction: its steps and segments within
their modes, and the forces that hold it."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from dmoc.check.amplification import PERTURBED
from dmoc.check.checked_motion import Motion, nodes_of_segments
from dmoc.check.contact_law import after_event, event_of
from dmoc.check.contact_location import Stage, kept_at_ends, passed_limits
from dmoc.check.measures import Segment, StepErrors, inside_errors, largest
from dmoc.check.path_limits import Course, path_excess
from dmoc.check.runs import SAME_CONTACT
from dmoc.codegen.kernels import Array
from dmoc.mechanics.model import Index
from dmoc.simulation.flow import FIRST, PLACES, TOUCH, Contact, Steps
from dmoc.simulation.indeterminate_forces import nearest
from dmoc.simulation.modes import Mode, Reaction
from dmoc.simulation.sizes import penetration


def rows_at(motion: Motion, i: int, nodes: Index) -> Array:
    """States at nodes of a phase as rows (q | v | work)."""
    phase = motion.trajectory.phases[i]
    return np.hstack([phase.q[nodes], phase.v[nodes], np.zeros((len(nodes), 1))])


def put(motion: Motion, i: int, y: Array, t: Array) -> tuple[Array, Array]:
    """Rows moved to where the conditions of a phase's mode hold, and the tangential positions that
    they keep."""
    held, y = motion.model.tangents(np.ascontiguousarray(y[:, : motion.model.nq]), t), y.copy()
    motion.flow.integrator.settle(motion.modes[i], y, t, held)
    return y, held


def wanted(motion: Motion, i: int, nodes: Index) -> tuple[Array, Array, Array]:
    """Times, positions and momenta of nodes of a phase, less what its closed contacts and what
    sticks would not let pass: that is judged by itself (:mod:`dmoc.check.contact_forces`)."""
    phase, nq = motion.trajectory.phases[i], motion.model.nq
    t, q, v, p = phase.t[nodes], phase.q[nodes], phase.v[nodes], phase.p[nodes]
    y, _ = put(motion, i, rows_at(motion, i, nodes), t)
    at, rates = (np.ascontiguousarray(y[:, k * nq : (k + 1) * nq]) for k in (0, 1))
    return t, at, p + motion.model.momentum(at, rates, t) - motion.model.momentum(q, v, t)


# Steps --------------------------------------------------------------------------------------------


def _open(motion: Motion, mode: Mode) -> NDArray[np.bool_]:
    """Surfaces that hold an open motion back in a mode, shape (nc,)."""
    found = motion.watched.copy()
    found[list(mode.closed)] = False
    return found


def step_errors(motion: Motion) -> StepErrors:
    """Integrate every step from its first node, in the mode of its phase."""
    courses = [_course(motion, i) for i in range(len(motion.steps))]
    parts = [_steps_of(motion, i, course) for i, course in enumerate(courses)]
    return StepErrors(
        np.concatenate([p.defects for p in parts]),
        tuple(p.work[0] for p in parts),
        max(p.penetration for p in parts),
        max(p.excess for p in parts),
        path_excess(motion, courses),
    )


def _course(motion: Motion, i: int) -> Course:
    """The steps of a phase in its mode."""
    steps, first = motion.steps[i], np.arange(motion.trajectory.phases[i].steps)
    start, held = put(motion, i, rows_at(motion, i, first), steps.t)
    stop = start.copy()
    ends = motion.flow.advance(stop, steps, first, first + 1, motion.modes[i], held)
    return Course(steps, start, ends, stop)


def _steps_of(motion: Motion, i: int, course: Course) -> StepErrors:
    phase, mode, nq = motion.trajectory.phases[i], motion.modes[i], motion.model.nq
    y1 = course.stop
    times, between = _between(motion, course, np.concatenate([PLACES[1:], motion.nodes_inside]))
    off = inside_errors(motion, between[len(PLACES) - 1 :], [phase.q_inside])
    gaps = penetration(motion.model, motion.sizes, between.reshape(-1, nq), times.ravel())
    low, high = motion.trajectory.coordinate_bounds.T
    return StepErrors(
        np.maximum(motion.error(y1, *wanted(motion, i, np.arange(1, phase.steps + 1))), off),
        (float(y1[:, -1].sum()),),
        largest(gaps[:, _open(motion, mode)]),
        largest(np.maximum(low - between, between - high) / motion.sizes.q),
    )


def _between(motion: Motion, course: Course, places: Array) -> tuple[Array, Array]:
    """Times and positions at places within steps, shapes (places, n) and (places, n, nq)."""
    steps = course.steps
    parts = (course.start, course.ends, course.stop, steps.h)
    y0, a, y1, h = (np.ascontiguousarray(part) for part in parts)
    found = motion.flow.integrator.between(y0, a, y1, h, places)
    return steps.t + places[:, None] * h, found


# Segments -----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Segments:
    """The segments of all phases with the derivatives of their ends by their starts, from
    differences; contacts that were not planned and are met in phases with closed contacts or
    friction; and what ends a mode elsewhere than planned, in sentences."""

    parts: list[Segment]
    met: list[Contact]
    told: list[str]


def segments(motion: Motion, sizes: tuple[Array, Array, Array]) -> Segments:
    """Simulate the segments of all phases; ``sizes`` are those of contact forces, of friction and
    of sliding velocities that errors of discretisation explain."""
    found = Segments([], [], [])
    for i in range(len(motion.steps)):
        parts, contacts, stages = _segments_of(motion, i)
        found.parts.extend(parts)
        found.met.extend(contacts)
        found.told.extend(passed_limits(motion, i, stages, np.concatenate(sizes)))
    return found


def _segments_of(motion: Motion, i: int) -> tuple[list[Segment], list[Contact], list[Stage]]:
    phase, steps, m = motion.trajectory.phases[i], motion.steps[i], 2 * motion.model.nq
    cuts = nodes_of_segments(phase.steps)
    places = list(pairwise(map(int, cuts)))
    unit = PERTURBED * np.concatenate([motion.sizes.q, motion.sizes.v])
    changes = np.zeros((1 + 2 * m, m + 1))
    changes[1:, :m] = np.vstack([np.diag(unit), -np.diag(unit)])
    y = (rows_at(motion, i, cuts[:-1])[:, None] + changes).reshape(-1, m + 1)
    y, held = put(motion, i, y, np.repeat(phase.t[cuts[:-1]], len(changes)))
    met, stages = list[Contact](), list[Stage]()
    for k in range(int(np.diff(cuts).max())):
        on = np.flatnonzero(cuts[:-1] + k < cuts[1:])
        rows = (on[:, None] * len(changes) + np.arange(len(changes))).ravel()
        step = np.repeat(cuts[on] + k, len(changes))
        y0, y1 = y[rows], y[rows]
        motion.flow.advance(y1, steps, step, step + 1, motion.modes[i], held[rows])
        y[rows], one = y1, slice(None, None, len(changes))
        alone = steps.part(cuts[on] + k)
        if not is_free(motion, i):
            both = np.ascontiguousarray(y0[one]), np.ascontiguousarray(y1[one])
            forced = _reactions(motion, i, both, alone)
            met += _met(motion, i, both, forced, alone)
            least = kept_at_ends(motion, motion.modes[i], both, alone, forced)
            stages.append(Stage(on, both, np.ascontiguousarray(held[rows][one]), alone, least))
    ends = y.reshape(len(places), len(changes), m + 1)[..., :m]
    errors = motion.error(np.ascontiguousarray(ends[:, 0]), *wanted(motion, i, cuts[1:]))
    planned, _ = put(motion, i, rows_at(motion, i, cuts[1:]), phase.t[cuts[1:]])
    slopes = np.swapaxes(ends[:, 1 : 1 + m] - ends[:, 1 + m :], 1, 2) / (2 * unit)
    parts = [
        Segment(i, a, b, float(error), slope, end[0] - row[:m])
        for (a, b), error, slope, end, row in zip(
            places, errors, slopes, ends, planned, strict=True
        )
    ]
    return parts, met, stages


def _reactions(
    motion: Motion, i: int, y: tuple[Array, Array], steps: Steps
) -> tuple[Reaction, Reaction]:
    """Accelerations and forces at both ends of steps of a phase."""
    mode, integrator = motion.modes[i], motion.flow.integrator
    first = integrator.reaction(mode, y[0], steps.u0, steps.t)
    return first, integrator.reaction(mode, y[1], steps.u1, steps.t + steps.h)


def _met(
    motion: Motion, i: int, y: tuple[Array, Array], ends: tuple[Reaction, Reaction], steps: Steps
) -> list[Contact]:
    """Contacts in steps of a phase that its plan does not have; a phase without closed contacts
    and friction is simulated through its contacts elsewhere."""
    mode, model, nq = motion.modes[i], motion.model, motion.model.nq
    course = Course(steps, y[0], np.stack([end.acceleration for end in ends], axis=1), y[1])
    times, path = _between(motion, course, PLACES[1:])
    gaps = model.gaps(path.reshape(-1, nq), times.ravel()).reshape(*times.shape, model.nc)
    allowed = motion.flow.allowance(times.ravel()).reshape(gaps.shape)
    over = gaps > allowed + TOUCH * motion.sizes.gap
    over[..., list(mode.closed)] = False
    return [
        Contact(
            model.kernels.surfaces[j], float(times[k, n]), _jump(motion, y[1][n], times[k, n], j)
        )
        for n, j in zip(*np.nonzero(over.any(axis=0)), strict=True)
        for k in [int(np.argmax(over[:, n, j]))]
        if not is_planned(motion, i, model.kernels.surfaces[j], float(times[k, n]))
    ]


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


# From the start to the end ------------------------------------------------------------------------


def event_slope(motion: Motion, i: int, unit: Array) -> Array:
    """Derivative of the state after an event, at its planned time, by the state before it, in
    sizes."""
    phase, nq = motion.trajectory.phases[i], motion.model.nq
    start = np.concatenate([phase.q[-1], phase.v[-1]])
    rows = start + PERTURBED * np.vstack([np.diag(unit), -np.diag(unit)])
    q, v = (np.ascontiguousarray(rows[:, k * nq : (k + 1) * nq]) for k in (0, 1))
    ends = np.hstack([q, after_event(motion, event_of(motion, i), q, v, phase.t[-1]).velocity])
    return np.asarray((ends[: 2 * nq] - ends[2 * nq :]).T / (2 * PERTURBED * unit[:, None]))


def open_loop(motion: Motion) -> float:
    """The error at the end of a simulation from the start, which goes through the planned modes and
    events at their planned times."""
    nq, phases = motion.model.nq, motion.trajectory.phases
    y = rows_at(motion, 0, np.array([0]))
    for i, phase in enumerate(phases):
        y, held = put(motion, i, y, phase.t[:1])
        motion.flow.advance(
            y, motion.steps[i], FIRST, np.array([phase.steps]), motion.modes[i], held
        )
        if i + 1 < len(phases):
            q, v = (np.ascontiguousarray(y[:, k * nq : (k + 1) * nq]) for k in (0, 1))
            y[:, nq : 2 * nq] = after_event(
                motion, event_of(motion, i), q, v, float(phase.t[-1])
            ).velocity
    last = phases[-1]
    return float(motion.error(y, last.t[-1:], last.q[-1:], last.p[-1:])[0])


# Forces -------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Forces:
    """Contact forces (2, N + 1, nc) and friction forces (2, N + 1, nt) of the flow at the nodes of
    a phase, with the inputs before each node and after it."""

    normal: Array
    tangential: Array


def forces(motion: Motion, i: int) -> Forces:
    """The forces that hold a phase at its nodes: where others have the same effect, those next to
    the planned ones."""
    phase, mode, steps = motion.trajectory.phases[i], motion.modes[i], motion.steps[i]
    y, _ = put(motion, i, rows_at(motion, i, np.arange(phase.steps + 1)), phase.t)
    q = np.ascontiguousarray(y[:, : motion.model.nq])
    inputs = (np.vstack([steps.u0[:1], steps.u1]), np.vstack([steps.u0, steps.u1[-1:]]))
    planned = np.hstack([_closed(motion, i), _sticking(motion, i)])
    found = [
        nearest(
            motion.model,
            mode,
            motion.flow.integrator.reaction(mode, y, u, phase.t),
            q,
            phase.t,
            planned,
        )
        for u in inputs
    ]
    return Forces(np.array([f.normal for f in found]), np.array([f.tangential for f in found]))


def _closed(motion: Motion, i: int) -> Array:
    """The planned forces of what is closed in a phase."""
    phase = motion.trajectory.phases[i]
    return phase.normal.reshape(phase.steps + 1, len(phase.closed))


def _sticking(motion: Motion, i: int) -> Array:
    """The planned friction of what sticks in a phase, in the order of its mode."""
    phase, tangents = motion.trajectory.phases[i], motion.model.kernels.tangents
    names = list(phase.rubbing)
    columns = [names.index(tangents[k]) for k in motion.modes[i].sticking]
    return phase.tangential.reshape(phase.steps + 1, len(names))[:, columns]
