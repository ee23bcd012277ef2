"""Every step, and every tenth of a phase, of a motion integrated from its own states, in the modes
of its phases: how far off they end, what they do on the way, and how their ends depend on their
starts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from dmoc.check.checked_motion import ModeSpan, Motion, nodes_of_segments
from dmoc.check.findings import Findings, infinite_where_none, largest
from dmoc.check.integrals import integral_errors
from dmoc.check.path_limits import Excess, IntegratedSteps, path_excess
from dmoc.codegen.kernels import Array
from dmoc.mechanics.bound_kernels import Index
from dmoc.mechanics.contact_mode import FREE, Mode
from dmoc.simulation.flow import PLACES
from dmoc.simulation.sizes import penetration

PERTURBED = 1e-6  # change of a state, in sizes, that shows the linearised flow
COARSE = 1e-3  # error of a coarse integration, in sizes, that still shows it


def put(motion: Motion, mode: Mode, y: Array, t: Array) -> tuple[Array, Array]:
    """Rows (q | v ...) moved to where the conditions of a mode hold, and the tangential positions
    that they keep."""
    if not _holds(motion, mode):
        return y, np.zeros((len(y), motion.model.nt))
    y = y.copy()
    held = motion.model.tangents(np.ascontiguousarray(y[:, : motion.model.nq]), t)
    motion.flow.integrator.settle(mode, y, t, held)
    return y, held


def _holds(motion: Motion, mode: Mode) -> bool:
    """Whether a mode has conditions that hold positions."""
    return bool(mode.closed or mode.sticking or motion.model.nj)


def _errors(motion: Motion, mode: Mode, y: Array, nodes: Sequence[Array]) -> tuple[Array, Array]:
    """Largest relative errors of rows beside nodes (q, v, p, t), and by how much positions and
    velocities are off.  What closed contacts and what sticks would not let pass is judged by
    itself (:mod:`dmoc.check.contact_forces`)."""
    q, v, p, t = nodes
    planned, _ = put(motion, mode, np.hstack([q, v]), t)
    at, rates = (np.ascontiguousarray(a) for a in np.hsplit(planned, 2))
    if _holds(motion, mode):
        p = p + motion.model.momentum(at, rates, t) - motion.model.momentum(q, v, t)
    return motion.error(y, t, at, p), y[:, : planned.shape[1]] - planned


# Steps --------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class StepErrors:
    """Every step integrated from its first node: the largest errors at its end and at the nodes
    inside, and between nodes, the work of each phase, and the excesses of path constraints and of
    bounds of integrals."""

    findings: Findings
    work: tuple[float, ...]
    path: tuple[Excess, ...] = ()


def step_errors(motion: Motion) -> StepErrors:
    """Integrate every step from its first node."""
    courses = [_course(motion, piece) for piece in motion.pieces]
    parts = [_errors_on(motion, p, c) for p, c in zip(motion.pieces, courses, strict=True)]
    measured = [part.findings.measured for part in parts]
    worst = {name: max(errors[name] for errors in measured) for name in measured[0]}
    work = tuple(work for part in parts for work in part.work)
    worst["error of an integral"], integrals = integral_errors(motion, courses)
    return StepErrors(Findings(worst), work, (*path_excess(motion, courses), *integrals))


def _course(motion: Motion, piece: ModeSpan) -> IntegratedSteps:
    """The steps of a piece, with their work."""
    q, v, _, t = piece.nodes(slice(-1))
    rows = np.hstack([q, v, np.zeros((len(q), 1))])
    start, held = put(motion, piece.mode, rows, t)
    stop, first = start.copy(), np.arange(len(start))
    mode = None if piece.mode == FREE else piece.mode
    ends = motion.flow.advance(stop, piece.steps, first, first + 1, mode, held)
    return IntegratedSteps(piece.steps, start, ends, stop)


def _errors_on(motion: Motion, piece: ModeSpan, course: IntegratedSteps) -> StepErrors:
    inside, nq = motion.nodes_inside, motion.model.nq
    times, path = between(motion, course, np.concatenate([PLACES[1:], inside]))
    path, nodes = np.split(path, [len(PLACES) - 1])
    times = times[: len(PLACES) - 1]
    gaps = penetration(motion.model, motion.sizes, path.reshape(-1, nq), times.ravel())
    low, high = motion.trajectory.coordinate_bounds.T
    errors, _ = _errors(motion, piece.mode, course.stop, piece.nodes(slice(1, None)))
    works = np.split(course.stop[:, -1], piece.begins[1:])
    inner = _inside_errors(motion, nodes, [p.q_inside for p in piece.phases])
    measured = {
        "step error": largest(np.maximum(errors, inner)),
        "penetration": largest(gaps[:, _open(motion, piece.mode)]),
        "excess of a limit": largest(np.maximum(low - path, path - high) / motion.sizes.q),
    }
    return StepErrors(Findings(measured), tuple(float(work.sum()) for work in works))


def between(motion: Motion, course: IntegratedSteps, places: Array) -> tuple[Array, Array]:
    """Times and positions at places within steps, shapes (places, n) and (places, n, nq)."""
    parts = (course.start, course.ends, course.stop, course.steps.h)
    path = motion.flow.integrator.between(*parts, places)
    return course.steps.t + places[:, None] * course.steps.h, path


def _open(motion: Motion, mode: Mode) -> NDArray[np.bool_]:
    """Surfaces that hold an open motion back in a mode, shape (nc,)."""
    watched = motion.watched.copy()
    watched[list(mode.closed)] = False
    return watched


def _inside_errors(motion: Motion, path: Array, planned: Sequence[Array]) -> Array:
    """Largest relative error (N,) of the nodes inside steps beside a path there, (nodes, N, nq)."""
    nodes = np.vstack(planned).reshape(path.shape[1], -1, motion.model.nq)
    off = np.abs(np.swapaxes(path, 0, 1) - nodes) / motion.sizes.q
    return infinite_where_none(off.max(axis=(1, 2), initial=0.0))


# Segments -----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Segment:
    """Some steps of a phase integrated from their first node in its mode, without events: relative
    error at the end, the derivative (2 nq, 2 nq) of the end by the start, and by how much positions
    and velocities (2 nq,) are off at the end."""

    phase: int
    first: int
    last: int
    error: float
    slope: Array
    defect: Array


def segments(motion: Motion) -> list[Segment]:
    """The segments of all phases, in their order."""
    return [segment for piece in motion.pieces for segment in _segments_of(motion, piece)]


def _segments_of(motion: Motion, piece: ModeSpan) -> list[Segment]:
    """The segments of a piece, integrated side by side."""
    phases, m = motion.trajectory.phases, 2 * motion.model.nq
    places = [
        (i, int(a), int(b))
        for i in piece.numbers
        for a, b in pairwise(nodes_of_segments(phases[i].steps))
    ]
    begins = dict(zip(piece.numbers, piece.begins, strict=True))
    first, last = (np.array([begins[place[0]] + place[n] for place in places]) for n in (1, 2))
    q, v, _, t = (np.array([getattr(phases[i], x)[a] for i, a, _ in places]) for x in "qvpt")
    start = np.hstack([q, v])
    if piece.mode != FREE or motion.model.nj:
        ends, slopes = _differences(motion, piece, (start, t), first, last)
    else:
        ends = np.hstack([start, np.tile(np.eye(m).ravel(), (len(start), 1))])
        motion.flow.advance(ends, piece.steps, first, last)
        slopes = ends[:, m:].reshape(-1, m, m)
        bad = ~np.isfinite(slopes).all(axis=(1, 2))  # forces with a kink where the motion is
        if bad.any():
            kinked = start[bad], t[bad]
            slopes[bad] = _differences(motion, piece, kinked, first[bad], last[bad])[1]
    planned = [np.array([getattr(phases[i], x)[b] for i, _, b in places]) for x in "qvpt"]
    errors, defects = _errors(motion, piece.mode, ends, planned)
    return [
        Segment(*place, float(error), slope, defect)
        for place, error, slope, defect in zip(places, errors, slopes, defects, strict=True)
    ]


def _differences(
    motion: Motion, piece: ModeSpan, start: tuple[Array, Array], first: Index, last: Index
) -> tuple[Array, Array]:
    """Ends of segments from starts (q | v) at times, and their derivatives by the starts, from
    differences: by a coarse integration where that gets to the same ends."""
    (y, t), m = start, 2 * motion.model.nq
    unit = np.concatenate([motion.sizes.q, motion.sizes.v])
    changes = PERTURBED * np.vstack([np.zeros(m), np.diag(unit)])

    def ends(changes: Array, which: Index, coarse: bool) -> Array:
        """Ends of changed starts, shape (which, changes, m)."""
        each = np.repeat(which, len(changes))
        rows = (y[which, None] + changes).reshape(-1, m)
        rows, held = put(motion, piece.mode, rows, t[each])
        motion.flow.advance(rows, piece.steps, first[each], last[each], piece.mode, held, coarse)
        return rows.reshape(len(which), -1, m)

    every = np.arange(len(y))
    planned = ends(changes[:1], every, False)[:, 0]
    changed = ends(changes, every, True)
    near = (np.abs(changed[:, 0] - planned) <= COARSE * unit).all(axis=1)
    if not near.all():
        changed[~near] = ends(changes, every[~near], False)
    slopes = np.swapaxes(changed[:, 1:] - changed[:, :1], 1, 2) / (PERTURBED * unit)
    return planned, slopes
