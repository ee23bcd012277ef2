"""How far a motion amplifies small errors: its linearised flow, through the collisions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.simulation.measures import Segment
from dmoc.simulation.motion import Motion

PERTURBED = 1e-6  # change of a state, in sizes, that shows the linearised flow


def amplification(motion: Motion, segments: Sequence[Segment]) -> float:
    """Largest ratio of an error at the end to one at a segment's start, by the linearised flow
    in sizes of positions and velocities."""
    unit = np.concatenate([motion.sizes.q, motion.sizes.v])
    product, phase = np.eye(len(unit)), len(motion.steps) - 1
    products = [product]
    for segment in reversed(segments):
        if segment.phase < phase:
            product, phase = product @ _saltation(motion, segment.phase, unit), segment.phase
        slope = segment.slope
        if not np.isfinite(slope).all():  # forces with a kink where the motion is
            slope = _differences(motion, segment, unit)
        product = product @ (slope / unit[:, None] * unit)
        if not np.isfinite(product).all():
            return float("inf")
        products.append(product)
    return float(np.linalg.norm(np.array(products), 2, axis=(1, 2)).max())


def _differences(motion: Motion, segment: Segment, unit: Array) -> Array:
    """The derivative of the end of a segment by its start from differences."""
    phase, steps = motion.trajectory.phases[segment.phase], motion.steps[segment.phase]
    start = np.concatenate([phase.q[segment.first], phase.v[segment.first]])
    changes = PERTURBED * np.vstack([np.diag(unit), -np.diag(unit)])
    ends = np.array(
        [motion.flow.freely(start + d, steps, segment.first, segment.last) for d in changes]
    )
    n = len(unit)
    return np.asarray((ends[:n] - ends[n:]).T / (2 * PERTURBED * unit))


def _saltation(motion: Motion, i: int, unit: Array) -> Array:
    """Derivative of the state after a collision, at its planned time, with respect to the state
    before it, in sizes."""
    trajectory, flow, nq = motion.trajectory, motion.flow, motion.model.nq
    c, before, after = trajectory.collisions[i], trajectory.phases[i], trajectory.phases[i + 1]
    j, t = motion.model.kernels.surfaces.index(c.surface), c.time
    slope = motion.model.gap_slopes(before.q[-1], t)[j]
    rate = float(slope[:nq] @ before.v[-1] + slope[nq])
    if c.grazes or not rate > 0:
        return np.eye(2 * nq)
    ends = (
        (before, -1, motion.steps[i].u1[-1]),
        (after, 0, motion.steps[i + 1].u0[0]),
    )
    a = [motion.model.acceleration(p.q[k], p.v[k], u, t) for p, k, u in ends]

    def through(y: Array) -> Array:
        q, v = y[:, :nq], y[:, nq:]
        late = -((q - before.q[-1]) @ slope[:nq])[:, None] / rate  # until the surface is met
        q, v = q + late * v, v + late * a[0]
        v = flow.planned_impact(c, q, v)[0]
        return np.hstack([q - late * v, v - late * a[1]])

    y = np.concatenate([before.q[-1], before.v[-1]])
    changes = PERTURBED * np.diag(unit)
    return (through(y + changes) - through(y - changes)).T / (2 * PERTURBED * unit[:, None])
