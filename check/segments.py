"""Every step, and every tenth of a phase, of a motion integrated from its own states, in the modes
of its phases: how far off they end, what they do on the way, and how their ends depend on their
starts."""

from __future__ import annotations

from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dmoc.base.records import record
from dmoc.check.checked_motion import ModeSpan, Motion, nodes_of_segments, put
from dmoc.check.findings import Findings, infinite_where_none, largest, together
from dmoc.check.hits import hit_excesses
from dmoc.check.integrals import integral_errors, peak_errors
from dmoc.check.integrated_steps import IntegratedSteps
from dmoc.check.passages import PERTURBED
from dmoc.check.path_limits import Excess, path_excess
from dmoc.codegen.kernels import Array
from dmoc.mechanics.bound_kernels import Index
from dmoc.mechanics.contact_mode import FREE, Mode
from dmoc.simulation.flow import PLACES
from dmoc.simulation.sizes import penetration

# Errors of a coarse integration, in sizes, with which it still shows what differences and the
# linearised flow are.
COARSE, NEAR = 1e-3, 1e-5


def _errors(motion: Motion, y: Array, at: Index) -> tuple[Array, Array]:
    """Relative errors of rows beside nodes, of positions and momenta (n, 2 nq), and the positions
    and velocities that they should have.  What closed contacts and what sticks would not let pass
    is judged by itself (:mod:`dmoc.check.contact_forces`)."""
    planned, held = motion.held.y[at], motion.held
    p = motion.nodes.p[at] + held.moved[at]
    return motion.errors(y, motion.nodes.t[at], planned[:, : motion.model.nq], p), planned


# Steps --------------------------------------------------------------------------------------------


@record(frozen=True, eq=False)
class StepErrors:
    """Every step integrated from its first node: the largest errors at its end and at the nodes
    inside, and between nodes, the work of each phase, and the excesses of path constraints and of
    bounds of integrals."""

    findings: Findings
    work: tuple[float, ...]
    path: tuple[Excess, ...] = ()


def step_errors(motion: Motion) -> StepErrors:
    """Integrate every step from its first node."""
    pieces = [(motion.within(piece.numbers[0]), piece) for piece in motion.pieces]
    courses = [_course(*part) for part in pieces]
    parts = [_errors_on(*part, course) for part, course in zip(pieces, courses, strict=True)]
    measured = [part.findings.measured for part in parts]
    worst = {name: max(errors[name] for errors in measured) for name in measured[0]}
    work = tuple(work for part in parts for work in part.work)
    peaks, of_peaks = peak_errors(motion, courses)
    totals, bounds = integral_errors(motion, courses, peaks)
    findings = together(Findings(worst), of_peaks, totals)
    of_path = (path_excess(*part) for part in motion.by_values(courses))
    excesses = *chain.from_iterable(of_path), *bounds, *hit_excesses(motion)
    return StepErrors(findings, work, excesses)


def _course(motion: Motion, piece: ModeSpan) -> IntegratedSteps:
    """The steps of a piece, with their work."""
    at = motion.nodes.starts[piece.places]
    start, anchors = np.zeros((len(at), 2 * motion.model.nq + 1)), motion.held.anchors[at]
    start[:, :-1] = motion.held.y[at]
    stop, first = start.copy(), np.arange(len(start))
    mode = None if piece.mode == FREE else piece.mode
    ends = motion.flow.advance(stop, piece.steps, first, first + 1, mode, anchors)
    return IntegratedSteps(piece.steps, start, ends, stop)


def _errors_on(motion: Motion, piece: ModeSpan, course: IntegratedSteps) -> StepErrors:
    nq, (low, high) = motion.model.nq, motion.trajectory.coordinate_bounds.T
    times, path = between(motion, course, PLACES[1:])
    nodes, at = _planned(motion, piece)
    path, times = np.concatenate([nodes, path.reshape(-1, nq)]), np.append(at, times)
    gaps = penetration(motion.model, motion.sizes, path, times, _open(motion, piece.mode))
    beside = path.T.copy()  # coordinates side by side have their extremes more quickly
    over = np.maximum(low - beside.min(axis=1), beside.max(axis=1) - high)
    errors, _ = _errors(motion, course.stop, motion.nodes.starts[piece.places] + 1)
    measured = {
        "step error": max(largest(errors), _inside_error(motion, piece, course)),
        "penetration": gaps,
        "excess of a limit": largest(over / motion.sizes.q),
    }
    begins = motion.begins[list(piece.numbers)] - piece.places.start
    work = np.add.reduceat(course.stop[:, -1], begins)
    return StepErrors(Findings(measured), tuple(work.tolist()))


def _planned(motion: Motion, piece: ModeSpan) -> tuple[Array, Array]:
    """Planned positions and times of the nodes of phases, also of those inside steps, shapes (n,
    nq) and (n,)."""
    if len(motion.nodes_inside):
        at = [motion.places[i] for i in piece.numbers]
        return np.concatenate([a.q for a in at]), np.concatenate([a.t for a in at])
    begins = motion.nodes.begins
    own = slice(int(begins[piece.numbers[0]]), int(begins[piece.numbers[-1] + 1]))
    return motion.nodes.q[own], motion.nodes.t[own]


def between(motion: Motion, course: IntegratedSteps, places: Array) -> tuple[Array, Array]:
    """Times and positions at places within steps, shape (places,), in [0, 1]: shapes (places, n)
    and (places, n, nq)."""
    parts = (course.start, course.ends, course.stop, course.steps.h)
    path = motion.flow.integrator.between(*parts, places)
    return course.steps.t + places[:, None] * course.steps.h, path


def _open(motion: Motion, mode: Mode) -> NDArray[np.bool_]:
    """Surfaces that hold an open motion back in a mode, shape (nc,)."""
    watched = motion.watched.copy()
    watched[list(mode.closed)] = False
    return watched


def _inside_error(motion: Motion, piece: ModeSpan, course: IntegratedSteps) -> float:
    """Largest relative error of the nodes inside steps beside their course."""
    if not len(motion.nodes_inside):
        return 0.0
    _, path = between(motion, course, motion.nodes_inside)
    planned = np.vstack([motion.trajectory.phases[i].q_inside for i in piece.numbers])
    nodes = planned.reshape(path.shape[1], -1, motion.model.nq)
    return largest(np.abs(np.swapaxes(path, 0, 1) - nodes) / motion.sizes.q)


# Segments -----------------------------------------------------------------------------------------


@record(frozen=True, eq=False)
class Segments:
    """Segments of phases, integrated from their first node in its mode, without events.

    The arrays ``phase``, ``first``, ``last`` and ``error``, shape (n,), are their phases, first and
    last nodes, and relative errors at the ends.  Derivatives of the ends by the starts are
    ``slope``, shape (n, 2 nq, 2 nq), errors of positions and velocities there ``defect``, shape
    (n, 2 nq).  Tangents that stick keep the positions ``anchors``, shape (n, nt); ``course`` has
    all steps on the way.
    """

    phase: Index
    first: Index
    last: Index
    error: Array
    slope: Array
    defect: Array
    anchors: Array
    course: IntegratedSteps

    def __len__(self) -> int:
        return len(self.phase)

    def of_phase(self, i: int) -> slice:
        """The segments of a phase."""
        begin, end = np.searchsorted(self.phase, [i, i + 1])
        return slice(int(begin), int(end))


def segments(motion: Motion) -> Segments:
    """The segments of all phases, in their order."""
    pieces = ((motion.within(piece.numbers[0]), piece) for piece in motion.pieces)
    parts = zip(*(_segments_of(*part) for part in pieces), strict=True)
    phase, first, last, error, slope, defect, anchors, course = map(np.concatenate, parts)
    m = 2 * motion.model.nq
    start, ends, stop = (course[:, k * m : (k + 1) * m].copy() for k in range(3))
    ends = ends.reshape(len(ends), 2, motion.model.nq)
    whole = IntegratedSteps(motion.run, start, ends, stop)
    return Segments(phase, first, last, error, slope, defect, anchors, whole)


def _segments_of(motion: Motion, piece: ModeSpan) -> tuple[NDArray[Any], ...]:
    """The segments of a piece, integrated side by side, and the course of its steps (N, 6 nq)."""
    nodes, mode, m = motion.nodes, piece.mode, 2 * motion.model.nq
    cuts = {i: nodes_of_segments(motion.trajectory.phases[i].steps) for i in piece.numbers}
    phase = np.repeat(piece.numbers, [len(cut) - 1 for cut in cuts.values()])
    first = np.concatenate([cut[:-1] for cut in cuts.values()])
    last = np.concatenate([cut[1:] for cut in cuts.values()])
    at, to = (nodes.begins[phase] + part for part in (first, last))
    begin, end = (motion.begins[phase] - piece.places.start + part for part in (first, last))
    start, t, anchors = nodes.y[at], nodes.t[at], motion.held.anchors[at]
    course = np.empty((len(piece.steps), 3 * m))
    if mode != FREE or motion.model.nj:
        ends = motion.held.y[at]
        motion.flow.advance(ends, piece.steps, begin, end, mode, anchors, course=course)
        slopes = _differences(motion, piece, (start, t, ends), begin, end)
    else:
        ends = start.copy()
        motion.flow.advance(ends, piece.steps, begin, end, course=course)
        slopes = _linearised(motion, piece, (start, ends), begin, end)
        bad = ~np.isfinite(slopes).all(axis=(1, 2))  # forces with a kink where the motion is
        if bad.any():
            kinked = start[bad], t[bad], ends[bad]
            slopes[bad] = _differences(motion, piece, kinked, begin[bad], end[bad])
    errors, planned = _errors(motion, ends, to)
    worst, defects = infinite_where_none(errors.max(axis=1)), ends - planned
    return phase, first, last, worst, slopes, defects, anchors, course


def _linearised(
    motion: Motion, piece: ModeSpan, planned: tuple[Array, Array], first: Index, last: Index
) -> Array:
    """Derivatives of the ends (q | v) of free segments by their starts, from the linearised flow:
    by a coarse integration where that gets to the same ends."""
    (y, reached), m = planned, 2 * motion.model.nq
    start = np.hstack([y, np.tile(np.eye(m).ravel(), (len(y), 1))])
    rows, sizes = start.copy(), np.concatenate([motion.sizes.q, motion.sizes.v])
    motion.flow.advance(rows, piece.steps, first, last, coarse=True)
    far = ~(np.abs(rows[:, :m] - reached) <= NEAR * sizes).all(axis=1)
    if far.any():
        again = start[far]
        motion.flow.advance(again, piece.steps, first[far], last[far])
        rows[far] = again
    return rows[:, m:].reshape(-1, m, m)


def _differences(
    motion: Motion, piece: ModeSpan, planned: tuple[Array, Array, Array], first: Index, last: Index
) -> Array:
    """Derivatives of the ends of segments by their starts (q | v) at times, from differences: by a
    coarse integration where that gets to the same ends (q | v)."""
    (y, t, reached), m = planned, 2 * motion.model.nq
    sizes = np.concatenate([motion.sizes.q, motion.sizes.v])
    changes = PERTURBED * np.vstack([np.zeros(m), np.diag(sizes)])

    def ends(which: Index, coarse: bool) -> Array:
        """Ends of changed starts, shape (which, changes, m)."""
        each = np.repeat(which, len(changes))
        rows = (y[which, None] + changes).reshape(-1, m)
        rows, anchors = put(motion, piece.mode, rows, t[each])
        motion.flow.advance(rows, piece.steps, first[each], last[each], piece.mode, anchors, coarse)
        return rows.reshape(len(which), -1, m)

    every = np.arange(len(y))
    changed = ends(every, True)
    near = (np.abs(changed[:, 0] - reached) <= COARSE * sizes).all(axis=1)
    if not near.all():
        changed[~near] = ends(every[~near], False)
    return np.swapaxes(changed[:, 1:] - changed[:, :1], 1, 2) / (PERTURBED * sizes)
