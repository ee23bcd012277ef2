"""What counts as zero in a simulation through contacts, in whatever units the model is given:
shares of what coordinates, velocities and forces make of gaps, rates and accelerations."""

from __future__ import annotations

import numpy as np

from dmoc.base.records import record
from dmoc.codegen.kernels import Array
from dmoc.mechanics.algebra import reached
from dmoc.mechanics.model import Model

# Shares of the sizes of gaps, of rates, and of accelerations.
GAP, RATE, ACCELERATION = 1e-13, 1e-9, 1e-9
# An end of a surface is reached within so many times what is zero of a gap: events are located to a
# share of a step.
END = 1e3
# Of a time, by which a moment is known: long runs move on in what rounding leaves of it.
MOMENT = 4 * float(np.finfo(float).eps)


@record(frozen=True, eq=False)
class Magnitudes:
    """Largest coordinate, velocity and acceleration so far, each measured by the masses."""

    coordinate: float = 0.0
    velocity: float = 0.0
    acceleration: float = 0.0


@record(frozen=True, eq=False)
class Tolerances:
    """Sizes that count as zero at one state."""

    size: Array  # of the rows (q | v) that are integrated, (2 nq,)
    gap: Array  # of gaps, their rates, their second derivatives, and contact forces, (nc,)
    rate: Array
    bend: Array
    force: Array
    slide: Array  # of sliding velocities, their rates, and friction forces, (nt,)
    skid: Array
    hold: Array
    within: Array  # of the ends of surfaces and their rates, (nc,)
    outwards: Array


def magnitudes_at(
    model: Model, y: Array, u: Array, t: float, h: float, before: Magnitudes
) -> Magnitudes:
    """The magnitudes of a motion that has come to a state y, shape (2 nq,), at inputs u, shape
    (nu,), for steps of size h."""
    q, v = y[: model.nq], y[model.nq : 2 * model.nq]
    M, F = model.equations(q, v, u, t)
    mass = np.sqrt(np.diagonal(M))
    acceleration = max(before.acceleration, float(np.abs(F / mass).max()))
    velocity = max(before.velocity, float(np.abs(mass * v).max()), h * acceleration)
    coordinate = max(before.coordinate, float(np.abs(mass * q).max()), h * velocity)
    return Magnitudes(coordinate, velocity, acceleration)


def tolerances(model: Model, q: Array, t: float, h: float, largest: Magnitudes) -> Tolerances:
    """Sizes that count as zero at a position, shape (nq,)."""
    M = model.mass(q, t)
    largest_of = np.array([[largest.coordinate], [largest.velocity], [largest.acceleration]])
    sizes = largest_of / np.sqrt(M.diagonal())
    size = sizes[:2].reshape(-1)
    small = []
    functions = [model.gap_slopes, model.tangent_slopes]
    functions += [model.within_slopes] if model.ends else []
    for slopes in (function(q, t) for function in functions):
        (places, rates, bends), inertia = reached(slopes[:, :-1], sizes, M)
        moving = np.abs(slopes[:, -1])
        rate = rates + moving
        place = GAP * (places + moving * max(abs(t), h)) + MOMENT * abs(t) * rate
        bend = ACCELERATION * (bends + moving / h)
        small.append((place, RATE * rate, bend, bend / np.where(inertia > 0, inertia, 1.0)))
    if not model.ends:
        small.append((np.zeros(model.nc),) * 4)
    (gap, rate, bend, force), (_, slide, skid, hold), (within, outwards, *_) = small
    return Tolerances(
        np.where(size > 0, size, 1.0), gap, rate, bend, force, slide, skid, hold,
        END * within, outwards,
    )  # fmt: skip
