"""How far a motion amplifies small errors: its linearised flow, through the collisions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from dmoc.check.checked_motion import Motion
from dmoc.check.findings import largest
from dmoc.check.segments import PERTURBED, Segment
from dmoc.codegen.kernels import Array

SMALLEST = 1e-11  # error of a segment that is not told from those of the integration
# A phase that amplifies errors more often than this may be off at its end by that much more: where
# its segments are right to half a percent, by what the flow makes of that.
STEADY = 6.0


@dataclass(frozen=True)
class Carried:
    """What the linearised flow makes of errors on the way, in sizes of positions and velocities:
    the largest ratio of an error at the end to one at a segment's start, by how much an
    open-loop run leaves the motion at the end of each segment (n, 2 nq), as the errors of the
    segments until there predict, the largest error at the end of a phase that is followed from its
    own first node, divided by its amplification beyond the steady one, and the predicted deviation
    at the end of the motion."""

    amplification: float
    deviations: Array
    phase_error: float
    end: float


def carried(motion: Motion, segments: Sequence[Segment]) -> Carried:
    """Carry the errors of segments to the ends of those that follow."""
    unit = np.concatenate([motion.sizes.q, motion.sizes.v])
    slopes = [segment.slope / unit[:, None] * unit for segment in segments]
    own = np.maximum(np.abs([segment.defect / unit for segment in segments]), SMALLEST)
    deviations, errors = np.empty(own.shape), np.empty((len(unit), len(segments)))
    product, products = np.eye(len(unit)), [np.eye(len(unit))]
    events = [
        event_slope(motion, one.phase, unit) if one.phase < other.phase else None
        for one, other in pairwise(segments)
    ]
    last = motion.stepped - 1
    strikes = last < len(motion.trajectory.collisions)  # the motion ends with its last event
    events.append(event_slope(motion, last, unit) if strikes else None)
    for k, (slope, event) in enumerate(zip(slopes, events, strict=True)):
        errors[:, :k] = slope @ errors[:, :k]
        errors[:, k] = own[k]
        np.abs(errors[:, : k + 1]).sum(axis=1, out=deviations[k])
        if event is not None:
            errors[:, : k + 1] = event @ errors[:, : k + 1]
    end = np.abs(errors).sum(axis=1)
    for slope, event in zip(reversed(slopes), reversed(events), strict=True):
        product = (product if event is None else product @ event) @ slope
        products.append(product)
    finite = np.isfinite(products).all()
    most = np.linalg.norm(np.array(products), 2, axis=(1, 2)).max() if finite else np.inf
    pairs = list(zip(segments, slopes, strict=True))
    phases = [
        _phase_error([pair for pair in pairs if pair[0].phase == i], unit)
        for i in range(motion.stepped)
    ]
    return Carried(float(most), deviations, max(phases), largest(end))


def _phase_error(parts: Sequence[tuple[Segment, Array]], unit: Array) -> float:
    """The weighed error at the end of the segments of a phase, with their scaled slopes."""
    off, products = np.zeros(len(unit)), [np.eye(len(unit))]
    for segment, slope in parts:
        off = slope @ off + segment.defect / unit
    for _, slope in reversed(parts):
        products.append(products[-1] @ slope)
    if not np.isfinite(products[-1]).all():  # without limit: its segments are judged alone
        return 0.0
    most = float(np.abs(products).sum(axis=2).max())
    return largest(np.abs(off)) / max(1.0, most / STEADY)


def event_slope(motion: Motion, i: int, unit: Array) -> Array:
    """Derivative of the state after an event, at its planned time, by the state before it, in
    sizes.  A collision happens where its surface is met; events between modes, at their time."""
    p, model, nq = motion.passages[i], motion.model, motion.model.nq
    start = np.concatenate([p.before.q[-1], p.before.v[-1]])
    rows = start + PERTURBED * np.vstack([np.diag(unit), -np.diag(unit)])
    q, v = (np.ascontiguousarray(part) for part in np.hsplit(rows, 2))
    late, a = np.zeros((len(q), 1)), np.zeros((2, nq))
    if not motion.has_modes:
        j = model.surface_numbers[p.c.surface]
        if p.c.grazes or not p.rates[0, j] > 0:
            return np.eye(2 * nq)
        late = -((q - p.before.q[-1]) @ p.normals[j])[:, None] / p.rates[0, j]
        after = motion.trajectory.input_sides(p.after)[1][0]
        sides = (p.before, -1, motion.steps[i].u1[-1]), (p.after, 0, after)
        a = np.array([model.acceleration(x.q[k], x.v[k], u, p.c.time) for x, k, u in sides])
    q, v = q + late * v, v + late * a[0]
    v = p.after_law(q, v, late[:, 0]).velocity
    ends = np.hstack([q - late * v, v - late * a[1]])
    return np.asarray((ends[: 2 * nq] - ends[2 * nq :]).T / (2 * PERTURBED * unit[:, None]))
