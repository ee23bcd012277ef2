"""What is measured of a motion beside its steps, segments and events: places and inputs."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from dmoc.check.checked_motion import Motion
from dmoc.check.segments import largest
from dmoc.codegen.kernels import Array
from dmoc.mechanics.algebra import solved
from dmoc.simulation.sizes import NOTHING

# gap of a planned collision, relative to how far the coordinates move it, that a solver may leave
OFF_SURFACE = 1e-6
SINGULAR = 1e-12  # smallest eigenvalue of a regular mass matrix, relative to the largest inertias


def wrong_places(motion: Motion) -> list[str]:
    """Surfaces that are hit or land where the motion is not on them, and a mass matrix that is
    none, in sentences."""
    noun = "contact" if motion.has_modes else "collision"
    off = [f"the {noun} with {s!r} is {gap:.3g} off it" for s, gap in _off_surface(motion)]
    where = _singular(motion)
    if where is None:
        return off
    return [*off, f"the mass matrix is singular or negative on the way, first at {where:.4g} s"]


def _off_surface(motion: Motion) -> Iterator[tuple[str, float]]:
    """Those surfaces, with the gap."""
    for c in motion.trajectory.collisions:
        for name in dict.fromkeys((c.surface, *c.lands) if c.surface else ()):
            j = motion.model.surface_numbers[name]
            gap = float(motion.model.gaps(c.position, c.time)[j])
            if not abs(gap) <= OFF_SURFACE * motion.sizes.gap[j]:
                yield name, gap


def input_excess(motion: Motion) -> float:
    """Largest excess of an input over its bounds in any step, relative to the largest input, or to
    one that the motion could use within them."""
    low, high = motion.trajectory.input_bounds.T
    u = np.vstack([ends for s in motion.steps for ends in (s.u0, s.u1)])
    excess = np.maximum(low - u, u - high)
    size = np.maximum(np.abs(u).max(axis=0, initial=0.0), np.minimum(high - low, _needed(motion)))
    return largest(np.where(excess > 0, excess, 0.0) / np.where(size > 0, size, NOTHING))


def _needed(motion: Motion) -> Array:
    """Inputs that accelerate as much as the forces of the motion, shape (nu,); infinite for one
    that does not."""
    model, parts = motion.model, [np.zeros(motion.model.nu)]
    for phase in motion.trajectory.phases if model.nu else ():
        B = np.swapaxes(model.input_matrix(phase.q, phase.v, t=phase.t), 1, 2)
        response = np.swapaxes(solved(model.mass(phase.q, phase.t), np.swapaxes(B, 1, 2)), 1, 2)
        parts.append((B * response).sum(axis=2).max(axis=0))
    inertia = np.sqrt(np.max(parts, axis=0))
    return np.asarray(motion.sizes.acceleration / inertia)


def _singular(motion: Motion) -> float | None:
    """First node at which the mass matrix is not positive definite, up to rounding errors of
    its entries."""
    for phase in motion.trajectory.phases:
        M = motion.model.mass(phase.q, phase.t)
        root = np.sqrt(np.abs(np.diagonal(M, axis1=1, axis2=2)).max(axis=0))
        scaled = M / np.where(root > 0, root, 1.0)[:, None] / np.where(root > 0, root, 1.0)
        good = np.array(np.isfinite(scaled).all(axis=(1, 2)))
        good[good] = np.linalg.eigvalsh(scaled[good])[:, 0] > SINGULAR
        if not good.all():
            return float(phase.t[int(np.argmin(good))])
    return None
