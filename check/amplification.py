"""How far a motion amplifies small errors: its linearised flow, through the collisions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property, partial

import numpy as np

from dmoc.base.records import record
from dmoc.check.checked_motion import Motion
from dmoc.check.findings import largest
from dmoc.check.segments import Segments
from dmoc.codegen.kernels import Array
from dmoc.mechanics.algebra import largest_stretch, products_from

SMALLEST = 1e-11  # error of a segment that is not told from those of the integration
# A phase that amplifies errors more often than this may be off at its end by that much more: where
# its segments are right to half a percent, by what the flow makes of that.
STEADY = 6.0


@record(frozen=True, eq=False)
class Carried:
    """Errors that the linearised flow carries to the end, in sizes of positions and velocities.

    Attributes
    ----------
    amplification : float
        The largest ratio of an error at the end to one at a segment's start.
    phase_error : float
        The largest error at the end of a phase that is followed from its own first node, divided by
        its amplification beyond the steady one.
    predict : callable
        Makes ``deviations``.
    """

    amplification: float
    phase_error: float
    predict: Callable[[], Array]

    @cached_property
    def deviations(self) -> Array:
        """Predicted deviations of an open-loop run from the motion, shape (n + 1, 2 nq). Rows stand
        at the end of each segment, by the errors of the segments until there, and at the end of the
        motion."""
        return self.predict()

    @property
    def end(self) -> float:
        """The predicted deviation at the end of the motion."""
        return largest(self.deviations[-1])


def carried(motion: Motion, parts: Segments) -> Carried:
    """Carry the errors of segments to the ends of those that follow."""
    sizes = np.concatenate([motion.sizes.q, motion.sizes.v])
    slopes, defects = parts.slope / sizes[:, None] * sizes, parts.defect / sizes
    # Where the motion ends with its last event, there is one after the last of its segments.
    count = min(motion.stepped, len(motion.trajectory.collisions))
    events = [passage.slope for passage in motion.passages[:count]]
    rest = np.eye(len(sizes))
    products, phases = [rest[None]], []
    for i in reversed(range(motion.stepped)):
        own = parts.of_phase(i)
        # of the end of the segments by the start of each, and by itself
        to_end = products_from(slopes[own])
        phases.append(_phase_error(to_end, defects[own]))
        rest = rest @ events[i] if i < count else rest
        products.append(rest @ to_end[:-1])
        rest = products[-1][0]
    predict = partial(_deviations, parts, slopes, defects, events)
    return Carried(largest_stretch(np.concatenate(products)), max(phases), predict)


def _phase_error(to_end: Array, defects: Array) -> float:
    """The weighed error at the end of the segments of a phase."""
    if not np.isfinite(to_end[0]).all():  # without limit: its segments are judged alone
        return 0.0
    off = (to_end[1:] @ defects[..., None]).sum(axis=0)
    most = float(np.abs(to_end).sum(axis=2).max())
    return largest(np.abs(off)) / max(1.0, most / STEADY)


def _deviations(parts: Segments, slopes: Array, defects: Array, events: Sequence[Array]) -> Array:
    """Errors of segments, shape (n, 2 nq), carried to the ends of those that follow, and to the end
    of the motion, shape (n + 1, 2 nq)."""
    own, errors = np.maximum(np.abs(defects), SMALLEST), np.zeros((slopes.shape[1], len(slopes)))
    deviations = np.empty((len(own) + 1, own.shape[1]))
    lasts = {parts.of_phase(i).stop - 1: event for i, event in enumerate(events)}
    for k, slope in enumerate(slopes):
        errors[:, :k] = slope @ errors[:, :k]
        errors[:, k] = own[k]
        deviations[k] = np.abs(errors).sum(axis=1)
        if k in lasts:
            errors[:, : k + 1] = lasts[k] @ errors[:, : k + 1]
    deviations[-1] = np.abs(errors).sum(axis=1)
    return deviations
