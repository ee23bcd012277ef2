"""Sizes of a motion: what its errors are compared with.

They follow from the motion, its problem and its model, and from no number that has a unit, so that
a motion told in other units or at another place has the same errors.  What moves counts by its
range; what hardly moves by a small share of what the energy of the motion, or the forces that act
although nothing moves, could make of it; and nothing by less than the rounding errors of its
numbers.  Coordinates of different kinds are compared through the masses.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.mechanics.algebra import solved_transpose
from dmoc.mechanics.model import Model
from dmoc.motion.trajectory import Trajectory

# A coordinate counts by at least this share of the speed that the kinetic energy could give it,
# and of the speed that the forces that act on something could give it in the whole time: solvers
# leave 1e-10 of what these would do.
STILL, HELD = 1e-4, 1e-6
# Where no force acts and nothing moves, by this share of the way to the nearest surface or between
# limits.
ROOM = 1e-12
# And by so many rounding errors of the numbers that it is told in.
DIGITS = 1e4 * float(np.finfo(float).eps)
# A contact force counts by at least this share of the forces of the motion.
WEAK = 0.05
# Where there is nothing at all to go by, errors are either none or infinite.
NOTHING = 1e-100
# Where a gap hardly changes with the coordinates, as in the middle of a post, its size is this
# share of the largest.
LEVEL = 0.01


@dataclass(frozen=True)
class Sizes:
    """Sizes of a motion: coordinates, velocities and momenta (nq,), gaps and their rates (nc,),
    tangential positions and sliding velocities (nt,), time, kinetic energy, the energy that moves
    between forms, and the largest acceleration that its forces and its velocities say, measured by
    the masses."""

    q: Array
    v: Array
    p: Array
    gap: Array
    rate: Array
    place: Array
    slide: Array
    time: float
    energy: float
    exchanged: float
    acceleration: float

    def along(self, slopes: Array) -> tuple[Array, Array]:
        """Sizes of functions of the position and the time, and of their rates, by their slopes
        (n, m, nq + 1) at positions of the motion."""
        return _along(slopes, self.q, self.v, self.time)


def _along(slopes: Array, q: Array, v: Array, time: float) -> tuple[Array, Array]:
    slope = np.abs(slopes).max(axis=0)
    place, rate = slope @ np.append(q, time), slope @ np.append(v, 1.0)
    return np.maximum(place, NOTHING), np.maximum(rate, NOTHING)


@dataclass(frozen=True)
class _Nodes:
    """All nodes of a motion, with the inputs of the steps that end and begin there, and their
    masses."""

    q: Array
    v: Array
    p: Array
    t: Array
    step: float
    u: tuple[Array, Array]
    mass: Array
    inertia: Array


def sizes_of(trajectory: Trajectory, model: Model) -> Sizes:
    """Read the sizes of a motion."""
    nodes = _nodes(trajectory, model)
    time = float(nodes.t[-1] - nodes.t[0])
    root = np.sqrt(nodes.inertia)
    kinetic = float(np.einsum("ki,kij,kj->k", nodes.v, nodes.mass, nodes.v).max()) / 2
    force = _forces(model, nodes)
    fastest = np.sqrt(2 * kinetic)
    strongest = float((force / root).max())
    speed = max(STILL * fastest, HELD * strongest * time)
    speed = max(speed, ROOM * _room(trajectory, model, nodes) / time, NOTHING)
    rounding = DIGITS * np.abs(nodes.q).max(axis=0)
    way, least = speed * time / root, np.maximum(speed / root, rounding / nodes.step)
    q = np.maximum.reduce([np.ptp(nodes.q, axis=0), way, rounding])
    v = np.maximum(np.abs(nodes.v).max(axis=0), least)
    p = np.maximum(np.abs(nodes.p).max(axis=0), nodes.inertia * least)
    energies = np.abs(model.energy(nodes.q, nodes.v, nodes.t))
    energy = max(kinetic, float(force @ way), float(least @ p), DIGITS * float(energies.max()))

    gap, rate = _along(model.gap_slopes(nodes.q, nodes.t), q, v, time)
    place, slide = _along(model.tangent_slopes(nodes.q, nodes.t), q, v, time)
    acceleration = max(strongest, fastest / time, speed / time)
    exchanged = max(energy, _lifted(model, nodes))
    return Sizes(q, v, p, gap, rate, place, slide, time, energy, exchanged, acceleration)


def pushes(model: Model, sizes: Sizes, q: Array, t: Array, slopes: Array) -> Array:
    """Forces along gradients (n, m, nq + 1) at rows of positions that accelerate as much as a
    small share of the forces of the motion, shape (m,)."""
    along = slopes[..., :-1]
    response = solved_transpose(model.mass(q, t), along)
    inertia = np.einsum("nmi,nim->nm", along, response).max(axis=0, initial=0.0)
    return np.asarray(WEAK * sizes.acceleration / np.sqrt(np.where(inertia > 0, inertia, np.inf)))


def _nodes(trajectory: Trajectory, model: Model) -> _Nodes:
    phases = trajectory.phases
    q, v, p = (np.vstack([getattr(phase, name) for phase in phases]) for name in "qvp")
    t = np.concatenate([phase.t for phase in phases])
    sides = [trajectory.input_sides(phase) for phase in phases]
    before, after = (np.vstack(part) for part in zip(*sides, strict=True))
    mass = model.mass(q, t)
    inertia = np.abs(np.diagonal(mass, axis1=1, axis2=2)).max(axis=0)
    inertia = np.where(inertia > 0, inertia, inertia.max())
    step = min(float(np.diff(phase.t).min()) for phase in phases if phase.steps)
    return _Nodes(q, v, p, t, step, (before, after), mass, inertia)


def _forces(model: Model, nodes: _Nodes) -> Array:
    """Largest generalised forces (nq,) that act anywhere: of the position alone, of position and
    velocity, and of each input by itself, balanced or not."""
    forces = [np.abs(model.equations(nodes.q, v, None, nodes.t)[1]) for v in (None, nodes.v)]
    if model.nu:
        B = np.abs(model.input_matrix(nodes.q, nodes.v, nodes.u[0], nodes.t))
        forces += [(B @ np.abs(u)[..., None])[..., 0] for u in nodes.u]
    return np.asarray(np.max(forces, axis=(0, 1)))


def _lifted(model: Model, nodes: _Nodes) -> float:
    """The largest work that the forces of the position alone do on the way of one coordinate
    between any two nodes: a motion that inputs lift slowly exchanges far more energy than it has
    in its velocities."""
    force = model.equations(nodes.q, None, None, nodes.t)[1]
    work = np.cumsum((force[1:] + force[:-1]) / 2 * np.diff(nodes.q, axis=0), axis=0)
    return float(np.ptp(np.vstack([np.zeros(model.nq), work]), axis=0).max())


def _room(trajectory: Trajectory, model: Model, nodes: _Nodes) -> float:
    """The shortest of the ways, measured by the masses, to a surface and between the limits of a
    coordinate; 0 where there are none."""
    ways = list(np.ptp(trajectory.coordinate_bounds, axis=1) * np.sqrt(nodes.inertia))
    if model.nc:
        q, t = nodes.q[:1], nodes.t[:1]
        slope = np.abs(model.gap_slopes(q, t))[0, :, :-1] / np.sqrt(nodes.inertia)
        ways += list(np.abs(model.gaps(q, t)[0]) / np.linalg.norm(slope, axis=1))
    return float(min((way for way in ways if 0 < way < np.inf), default=0.0))


def penetration(model: Model, sizes: Sizes, q: Array, t: Array) -> Array:
    """Gaps (n, nc) at rows of positions, relative to how far the motion's ranges move them: where
    they are positive by their slopes there, which in a small obstacle are far below the largest."""
    gaps = model.gaps(q, t)
    shares, behind = gaps / sizes.gap, np.flatnonzero((gaps > 0).any(axis=1))
    if len(behind):
        shares[behind] = gaps[behind] / gap_sizes_at(model, sizes, q[behind], t[behind])
    return np.asarray(shares)


def gap_sizes_at(model: Model, sizes: Sizes, q: Array, t: Array) -> Array:
    """How far the motion's ranges move gaps at rows of positions, shape (n, nc)."""
    slopes = np.abs(model.gap_slopes(q, t))
    return np.asarray(np.maximum(slopes @ np.append(sizes.q, sizes.time), LEVEL * sizes.gap))
