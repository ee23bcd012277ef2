"""Sizes of a motion: what its errors are compared with, in whatever units it is given."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.mechanics.model import Model
from dmoc.trajectory import Trajectory

# Share of the speed that its energy could give to a coordinate by which that counts at least, where
# contacts hold coordinates still.
STILL = 1e-3


@dataclass(frozen=True)
class Sizes:
    """Sizes of a motion: ranges of the coordinates, largest velocities and momenta (nq,), gaps
    and their rates (nc,), final time, and the largest kinetic energy."""

    q: Array
    v: Array
    p: Array
    gap: Array
    rate: Array
    time: float
    energy: float


def sizes_of(trajectory: Trajectory, model: Model) -> Sizes:
    """Ranges of a motion; what does not move counts by a small share of what its energy could
    make of it, so that roundings stay small."""
    q = np.vstack([p.q for p in trajectory.phases])
    v, p = (
        np.abs(np.vstack([getattr(phase, name) for phase in trajectory.phases])).max(axis=0)
        for name in "vp"
    )
    t = np.concatenate([phase.t for phase in trajectory.phases])
    M = model.mass(q, t)
    inertia = np.abs(np.diagonal(M, axis1=1, axis2=2)).max(axis=0)
    speeds = np.vstack([phase.v for phase in trajectory.phases])
    kinetic = float(np.einsum("ki,kij,kj->k", speeds, M, speeds).max()) / 2
    time = trajectory.final_time
    spread = np.ptp(q, axis=0)
    little = 1e-6 * np.sqrt(2 * kinetic / inertia)
    size_q = np.maximum(spread, little * time)
    size_q = np.where(
        size_q > 0, size_q, np.where(np.abs(q).max(axis=0) > 0, np.abs(q).max(axis=0), 1.0)
    )
    size_v = np.maximum(np.maximum(v, little), 1e-6 * size_q / time)
    size_p = np.maximum(p, inertia * size_v * 1e-6)
    slope = np.abs(model.gap_slopes(q, t)).max(axis=0)
    gap, rate = slope @ np.append(size_q, time), slope @ np.append(size_v, 1.0)
    largest = kinetic if kinetic > 0 else float(size_p @ size_v)
    return Sizes(
        size_q,
        size_v,
        np.where(size_p > 0, size_p, 1.0),
        gap,
        rate,
        time,
        largest if largest > 0 else 1.0,
    )


def sizes_with_contacts(trajectory: Trajectory, model: Model) -> Sizes:
    """Sizes of a motion whose contacts hold some coordinates still: these count by a thousandth of
    what its energy could make of them."""
    sizes = sizes_of(trajectory, model)
    q = np.vstack([p.q for p in trajectory.phases])
    t = np.concatenate([p.t for p in trajectory.phases])
    inertia = np.abs(np.diagonal(model.mass(q, t), axis1=1, axis2=2)).max(axis=0)
    little = STILL * np.sqrt(2 * sizes.energy / inertia)
    size_q, size_v = np.maximum(sizes.q, little * sizes.time), np.maximum(sizes.v, little)
    slope = np.abs(model.gap_slopes(q, t)).max(axis=0)
    return replace(
        sizes,
        q=size_q,
        v=size_v,
        p=np.maximum(sizes.p, inertia * little),
        gap=slope @ np.append(size_q, sizes.time),
        rate=slope @ np.append(size_v, 1.0),
    )
