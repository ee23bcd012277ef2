"""What is measured of a motion beside its steps and segments: energies, collisions and inputs."""

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
SOFT = 1e-6  # own rates of a collision count by at least this share of the largest
SINGULAR = 1e-12  # smallest eigenvalue of a regular mass matrix, relative to the largest inertias


def imbalance(motion: Motion, work: tuple[float, ...]) -> float:
    """Largest difference of the change of energy in a phase and the work, friction's too, relative
    to the energy that the motion exchanges."""
    differences, ends = [], [0, -1]
    for phase, done in zip(motion.trajectory.phases, work, strict=True):
        first, last = motion.model.energy(phase.q[ends], phase.v[ends], phase.t[ends])
        differences.append(abs(last - first - done))
    return float(np.nan_to_num(max(differences), nan=np.inf)) / motion.sizes.exchanged


def energy_error(motion: Motion, work: tuple[float, ...]) -> float:
    """Largest imbalance of a phase, or jump at a collision relative to the largest kinetic
    energy."""
    worst, energy = imbalance(motion, work), motion.model.energy
    for collision, before, after in motion.events:
        v = motion.flow.planned_impact(collision, before.q[-1], before.v[-1])[0]
        jump = energy(after.q[0], after.v[0], after.t[0]) - energy(before.q[-1], v, before.t[-1])
        worst = max(worst, float(np.nan_to_num(abs(jump), nan=np.inf)) / motion.sizes.energy)
    return worst


def impact_errors(motion: Motion) -> tuple[float, float]:
    """Errors of the rate after a collision, of the impulse, and rates that approach after it or
    leave before it: relative to the largest rate, and to the rates of the collision itself."""
    model, nq = motion.model, motion.model.nq
    worst = own = 0.0
    for c, before, after in motion.events:
        j, q, t = model.kernels.surfaces.index(c.surface), before.q[-1], c.time
        slope = model.gap_slopes(q, t)[j]
        w = [float(slope[:nq] @ v + slope[nq]) for v in (before.v[-1], after.v[0])]
        _, impulse = motion.flow.planned_impact(c, q, before.v[-1])
        e = 0.0 if c.grazes else motion.trajectory.restitution[c.surface]
        n = slope[:nq]
        _, inertia = model.impulse_response(q, n, t)
        errors = [
            abs(w[1] + e * w[0]),
            abs(float(impulse) - c.impulse) * inertia,
            max(-w[0], 0.0),
            max(w[1], 0.0),
        ]
        largest = float(np.nan_to_num(np.max(errors), nan=np.inf))
        worst = max(worst, largest / float(motion.sizes.rate[j]))
        if not c.grazes:
            own = max(own, largest / max(abs(w[0]), abs(w[1]), SOFT * float(motion.sizes.rate[j])))
    return worst, own


def wrong_places(motion: Motion, noun: str) -> list[str]:
    """Surfaces that are hit or land where the motion is not on them, by the noun for that, and a
    mass matrix that is none, in words."""
    told = [f"the {noun} with {s!r} is {gap:.3g} off it" for s, gap in _off_surface(motion)]
    where = _singular(motion)
    if where is not None:
        told.append(f"the mass matrix is singular or negative on the way, first at {where:.4g} s")
    return told


def _off_surface(motion: Motion) -> Iterator[tuple[str, float]]:
    """Those surfaces, with the gap."""
    for c in motion.trajectory.collisions:
        for name in dict.fromkeys((c.surface, *c.lands) if c.surface else ()):
            j = motion.model.kernels.surfaces.index(name)
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
