"""How far a motion amplifies small errors: its linearised flow, through the collisions."""

from __future__ import annotations

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.simulation.flow import Flow
from dmoc.trajectory import Trajectory

SEGMENTS = 10  # of a phase
PERTURBED = 1e-6  # change of a state, in sizes, that shows the linearised flow


def nodes_of_segments(steps: int) -> Array:
    """First nodes of the segments of a phase, and its last node."""
    return np.unique(np.linspace(0, steps, SEGMENTS + 1).round().astype(int))


def amplification(trajectory: Trajectory, flow: Flow) -> float:
    """Largest ratio of an error at the end to one at a segment's start, by the linearised flow
    in sizes of positions and velocities."""
    n, nq = 2 * flow.nq, flow.nq
    unit = np.concatenate([flow.sizes.q, flow.sizes.v])
    product, worst = np.eye(n), 1.0
    for i in reversed(range(len(trajectory.phases))):
        phase = trajectory.phases[i]
        if i < len(trajectory.collisions):
            product = product @ _saltation(trajectory, flow, i, unit)
        u0, u1 = trajectory.input_ends(phase)
        cuts = nodes_of_segments(phase.steps)
        first, last = cuts[:-1], cuts[1:]
        rows = (
            np.hstack([phase.q[first], phase.v[first]])[:, None, :]
            + PERTURBED * np.vstack([np.eye(n), -np.eye(n)]) * unit
        )
        y, h = rows.reshape(-1, n), np.diff(phase.t)
        for j in range(int((last - first).max())):
            k = np.minimum(first + j, last - 1).repeat(2 * n)
            on = (first + j < last).repeat(2 * n)
            q, v, _ = flow.advance(
                y[:, :nq].copy(), y[:, nq:].copy(), phase.t[k], h[k], u0[k], u1[k]
            )
            y = np.where(on[:, None], np.hstack([q, v]), y)
        ends = y.reshape(len(first), 2, n, n)
        for s in reversed(range(len(first))):
            product = product @ ((ends[s, 0] - ends[s, 1]).T / (2 * PERTURBED * unit[:, None]))
            if not np.isfinite(product).all():
                return float("inf")
            worst = max(worst, float(np.linalg.norm(product, 2)))
    return worst


def _saltation(trajectory: Trajectory, flow: Flow, i: int, unit: Array) -> Array:
    """Derivative of the state after a collision, at its planned time, with respect to the state
    before it, in sizes."""
    c, before, after = trajectory.collisions[i], trajectory.phases[i], trajectory.phases[i + 1]
    j, nq, t = flow.model.kernels.surfaces.index(c.surface), flow.nq, c.time
    slope = flow.model.gap_slopes(before.q[-1], t)[j]
    rate = float(slope[:nq] @ before.v[-1] + slope[nq])
    if c.grazes or not rate > 0:
        return np.eye(2 * nq)
    ends = (
        (before, -1, trajectory.input_ends(before)[1][-1]),
        (after, 0, trajectory.input_ends(after)[0][0]),
    )
    a = [flow.acceleration(p.q[k], p.v[k], u, t) for p, k, u in ends]

    def through(y: Array) -> Array:
        q, v = y[:nq], y[nq:]
        late = -float(slope[:nq] @ (q - before.q[-1])) / rate  # until the surface is met
        q, v = q + late * v, v + late * a[0]
        v = flow.planned_impact(c, q, v)[0]
        return np.concatenate([q - late * v, v - late * a[1]])

    y = np.concatenate([before.q[-1], before.v[-1]])
    changes = [
        (through(y + d) - through(y - d)) / (2 * PERTURBED * unit)
        for d in PERTURBED * np.diag(unit)
    ]
    return np.array(changes).T
