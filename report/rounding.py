"""What of a motion is nothing but rounding errors, which an axis would otherwise be scaled to."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dmoc.base.tolerances import ROUNDING
from dmoc.motion.trajectory import Array, Phase, Trajectory

# One whose velocity times momentum is at most this share of that of the motion stands still: both
# are rounding errors, of about 1e-13 each.
AT_REST = 1e-22
# A coordinate at rest whose rounding errors are a larger share of its value than this is at zero.
UNSURE = 1e-6


def without_rounding(trajectory: Trajectory) -> Trajectory:
    """A motion to draw: what is zero or constant but for rounding errors is that exactly.

    Nothing here knows a unit, so that quantities are compared by their energies: the largest of
    p_i v_i is that of the motion; a momentum times the velocity of its coordinate, and a force
    times the final time and the largest velocity, are shares of it.  A motion at rest is returned
    as it is.
    """
    phases = trajectory.phases
    v, p = (_largest([getattr(phase, name) for phase in phases]) for name in "vp")
    q = np.vstack([phase.q for phase in phases])
    energy = float((v * p).max(initial=0.0))
    if not (np.isfinite(energy) and energy > 0.0):
        return trajectory
    rests = (v * p <= AT_REST * energy) & ((p > 0.0) | (v == 0.0))
    way, farthest = np.ptp(q, axis=0), np.abs(q).max(axis=0)
    stands = rests | (way <= ROUNDING * farthest)
    place = np.where(way <= UNSURE * farthest, q[0], 0.0)
    weight = trajectory.final_time * float(v.max()) / energy

    def forces(values: Array) -> Array:
        small = np.abs(values).max(axis=0, initial=0.0) * weight <= ROUNDING
        return np.where(small, 0.0, values)

    idle = _largest([phase.u for phase in phases]) * weight <= ROUNDING
    nothing = rests | (v * p <= ROUNDING * energy)

    def cleaned(phase: Phase) -> Phase:
        return replace(
            phase,
            q=np.where(stands, place, phase.q),
            v=np.where(rests, 0.0, phase.v),
            p=np.where(nothing, 0.0, phase.p),
            u=np.where(idle, 0.0, phase.u),
            normal=forces(phase.normal),
            tangential=forces(phase.tangential),
            reaction=forces(phase.reaction),
        )

    return replace(trajectory, phases=tuple(map(cleaned, phases)))


def _largest(values: list[Array]) -> Array:
    """The largest magnitude in each column of all phases."""
    return np.asarray(np.max([np.abs(v).max(axis=0, initial=0.0) for v in values], axis=0))
