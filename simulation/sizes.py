"""Sizes of a motion: what its errors are compared with.

They follow from the motion, its problem and its model, and from no number that has a unit, so that
a motion told in other units or at another place has the same errors.  What moves counts by its
range; what hardly moves by a small share of what the energy of the motion, or the forces that act
although nothing moves, could make of it; and nothing by less than the rounding errors of its
numbers.  Coordinates of different kinds are compared through the masses.
"""

from __future__ import annotations

from functools import cached_property
from itertools import accumulate

import numpy as np
from numpy.typing import NDArray

from dmoc.base.records import record
from dmoc.codegen.kernels import Array
from dmoc.mechanics.algebra import largest_form, most_of, solved_transpose
from dmoc.mechanics.bound_kernels import Index
from dmoc.mechanics.model import Model
from dmoc.mechanics.phase_models import PhaseModels
from dmoc.motion.trajectory import Trajectory

# A coordinate counts by at least this share of the speed that the kinetic energy could give it,
# and of the speed that the forces that act on something could give it in the whole time: solvers
# leave 1e-10 of what these would do.
STILL, FORCED = 1e-4, 1e-6
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


@record(frozen=True, eq=False)
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
        """Sizes, shape (m,) each, of functions of the position and the time, and of their rates, by
        their slopes (n, m, nq + 1) at positions of the motion."""
        return _along(slopes, self.q, self.v, self.time)


def _along(slopes: Array, q: Array, v: Array, time: float) -> tuple[Array, Array]:
    slope = most_of(slopes)
    place, rate = slope[:, :-1] @ q + slope[:, -1] * time, slope[:, :-1] @ v + slope[:, -1]
    return np.maximum(place, NOTHING), np.maximum(rate, NOTHING)


@record(frozen=True, eq=False)
class Nodes:
    """All n nodes of a motion, those of one phase after those of another.

    ``begins`` are the first nodes of the phases, and n behind, shape (phases + 1,); ``starts`` the
    nodes at which steps start, shape (N,), and ``inputs`` those at both ends of steps, shape
    (N, nu) each.  At the nodes are the masses, shape (n, nq, nq), and the forces of the positions
    alone, shape (n, nq).
    """

    model: Model
    q: Array
    v: Array
    p: Array
    t: Array
    begins: Index
    starts: Index
    inputs: tuple[Array, Array]
    mass: Array
    force: Array

    @cached_property
    def h(self) -> Array:
        """Durations of the steps, shape (N,)."""
        return np.asarray(self.t[self.starts + 1] - self.t[self.starts])

    @cached_property
    def u(self) -> tuple[Array, Array]:
        """Inputs before and after each node, of the steps that end and begin there, shape (n, nu)
        each."""
        (u0, u1), first = self.inputs, self.begins - np.arange(len(self.begins))
        before, after = np.empty((2, len(self.t), u0.shape[1]))
        before[self.starts + 1], after[self.starts] = u1, u0
        before[self.begins[:-1]] = np.concatenate([u0, u1[-1:]])[first[:-1]]
        after[self.begins[1:] - 1] = u1[first[1:] - 1]
        return before, after

    @cached_property
    def y(self) -> Array:
        """States (q | v), shape (n, 2 nq)."""
        return np.concatenate([self.q, self.v], axis=1)

    @cached_property
    def inertia(self) -> Array:
        """The largest inertia of each coordinate, shape (nq,); of one that has none the largest of
        all."""
        inertia = np.diagonal(most_of(self.mass))
        return np.asarray(np.where(inertia > 0, inertia, inertia.max()))

    @cached_property
    def momentum(self) -> Array:
        """Momenta of the velocities, shape (n, nq)."""
        return self.model.momentum(self.q, self.v, self.t)

    @cached_property
    def energy(self) -> Array:
        """Energies of the nodes, shape (n,)."""
        return self.model.energy(self.q, self.v, self.t)

    @cached_property
    def gaps(self) -> Array:
        """Gaps at the nodes, shape (n, nc), minus infinity beyond the ends of surfaces."""
        return self.model.barriers(self.q, self.t)

    @cached_property
    def gap_slopes(self) -> Array:
        """Slopes of the gaps at the nodes, shape (n, nc, nq + 1)."""
        return self.model.gap_slopes(self.q, self.t)

    @cached_property
    def within_slopes(self) -> Array:
        """Slopes of the ends of surfaces at the nodes, shape (n, nc, nq + 1)."""
        return self.model.within_slopes(self.q, self.t)

    @cached_property
    def tangent_slopes(self) -> Array:
        """Slopes of the tangential positions at the nodes, shape (n, nt, nq + 1)."""
        return self.model.tangent_slopes(self.q, self.t)

    def of_phase(self, i: int) -> slice:
        """The nodes of a phase."""
        return slice(int(self.begins[i]), int(self.begins[i + 1]))


def nodes_of(trajectory: Trajectory, models: PhaseModels) -> Nodes:
    """All nodes of a motion, with the parameters of their phases."""
    phases = trajectory.phases
    model = models.along(np.repeat(np.arange(len(phases)), [len(phase.t) for phase in phases]))
    q, v, p, t = (np.concatenate([getattr(phase, name) for phase in phases]) for name in "qvpt")
    begins = np.array([0, *accumulate(len(phase.t) for phase in phases)])
    goes_on = np.ones(len(t), dtype=bool)
    goes_on[begins[1:] - 1] = False
    ends = zip(*(trajectory.input_ends(phase) for phase in phases if phase.steps), strict=True)
    u0, u1 = (np.concatenate(u, dtype=float) for u in ends)
    mass, force = model.equations(q, None, None, t)
    return Nodes(model, q, v, p, t, begins, np.flatnonzero(goes_on), (u0, u1), mass, force)


def sizes_of(trajectory: Trajectory, nodes: Nodes) -> Sizes:
    """Read the sizes of a motion."""
    model, time = nodes.model, float(nodes.t[-1] - nodes.t[0])
    root = np.sqrt(nodes.inertia)
    kinetic = largest_form(nodes.v, nodes.mass) / 2
    force = _forces(model, nodes)
    fastest = np.sqrt(2 * kinetic)
    strongest = float((force / root).max())
    speed = max(STILL * fastest, FORCED * strongest * time)
    speed = max(speed, ROOM * _room(trajectory, nodes) / time, NOTHING)
    rounding = DIGITS * most_of(nodes.q)
    moved, step = nodes.q.T.copy(), float(nodes.h.min())
    way, least = speed * time / root, np.maximum(speed / root, rounding / step)
    q = np.maximum(np.maximum(moved.max(axis=1) - moved.min(axis=1), way), rounding)
    v = np.maximum(most_of(nodes.v), least)
    p = np.maximum(most_of(nodes.p), nodes.inertia * least)
    rounded = DIGITS * float(np.abs(nodes.energy).max())
    energy = max(kinetic, float(force @ way), float(least @ p), rounded)

    gap, rate = _along(nodes.gap_slopes, q, v, time)
    place, slide = _along(nodes.tangent_slopes, q, v, time)
    # Of a motion without forces that rests, what rounding errors of its places accelerate.
    shaken = float((rounding * root / step**2).max())
    acceleration = max(strongest, fastest / time, speed / time, shaken)
    exchanged = max(energy, _lifted(nodes))
    return Sizes(q, v, p, gap, rate, place, slide, time, energy, exchanged, acceleration)


def pushes(nodes: Nodes, sizes: Sizes, slopes: Array) -> Array:
    """Forces along gradients (n, m, nq + 1) at the nodes that accelerate as much as a small share
    of the forces of the motion, shape (m,)."""
    least = inertia_along(nodes, slopes[..., :-1])
    return np.asarray(WEAK * sizes.acceleration / np.sqrt(np.where(least > 0, least, np.inf)))


def inertia_along(nodes: Nodes, ways: Array) -> Array:
    """The largest b . M^-1 b of each of the rows b of ways (n, m, nq) at the nodes, shape (m,)."""
    if not ways.shape[1]:
        return np.zeros(0)
    response = np.swapaxes(solved_transpose(nodes.mass, ways), 1, 2)
    return np.asarray((ways * response).sum(axis=2).max(axis=0, initial=0.0))


def _forces(model: Model, nodes: Nodes) -> Array:
    """Largest generalised forces (nq,) that act anywhere: of the position alone, of position and
    velocity, and of each input by itself, balanced or not."""
    both = model.equations(nodes.q, nodes.v, None, nodes.t)[1]
    most = np.maximum(most_of(nodes.force), most_of(both))
    if model.nu:
        B = np.abs(model.input_matrix(nodes.q, nodes.v, nodes.u[0], nodes.t))
        for u in nodes.u:
            most = np.maximum(most, most_of((B * np.abs(u)[:, None]).sum(axis=2)))
    return np.asarray(most)


def _lifted(nodes: Nodes) -> float:
    """The largest work that the forces of the position alone do on the way of one coordinate
    between any two nodes: a motion that inputs lift slowly exchanges far more energy than it has
    in its velocities."""
    force, q = nodes.force.T.copy(), nodes.q.T.copy()
    mean, way = (force[:, 1:] + force[:, :-1]) / 2, q[:, 1:] - q[:, :-1]
    work = np.cumsum(mean * way, axis=1)
    most, least = work.max(axis=1, initial=0.0), work.min(axis=1, initial=0.0)
    return float((most - least).max())


def _room(trajectory: Trajectory, nodes: Nodes) -> float:
    """The shortest of the ways, measured by the masses, to a surface and between the limits of a
    coordinate; 0 where there are none."""
    low, high = trajectory.coordinate_bounds.T
    ways = (high - low) * np.sqrt(nodes.inertia)
    if nodes.model.nc:
        slope = nodes.gap_slopes[0, :, :-1] / np.sqrt(nodes.inertia)
        gaps = nodes.model.gaps(nodes.q[:1], nodes.t[:1])[0]
        off = np.abs(gaps) / np.sqrt((slope * slope).sum(axis=1))
        ways = np.concatenate([ways, off])
    ways = ways[(ways > 0) & (ways < np.inf)]
    return float(ways.min()) if len(ways) else 0.0


def penetration(
    model: Model, sizes: Sizes, q: Array, t: Array, watched: NDArray[np.bool_]
) -> float:
    """The largest positive gap of ``watched`` surfaces, shape (nc,), at positions q (n, nq) and
    times t (n,), relative to how far the motion's ranges move it by its slopes there. In a small
    obstacle these are far below the largest. It is infinite where a gap is not a number."""
    gaps = model.barriers(q, t)[:, watched]
    if np.isnan(gaps).any() or np.isnan(sizes.gap[watched]).any():
        return np.inf
    if not gaps.max(initial=0.0) > 0:
        return 0.0
    behind = np.flatnonzero((gaps > 0).any(axis=1))
    slopes = model.gap_slopes(q[behind], t[behind])
    depth = gaps[behind] / gap_sizes(slopes, sizes)[:, watched]
    if model.ends:  # the way out may lead past an end
        place, _ = sizes.along(model.within_slopes(q[behind], t[behind]))
        depth = np.minimum(depth, (model.within(q[behind], t[behind]) / place)[:, watched])
    return float(depth.max())


def gap_sizes(slopes: Array, sizes: Sizes) -> Array:
    """Distances by which the motion's ranges move gaps with slopes (..., nc, nq + 1), shape (...,
    nc)."""
    slopes = np.abs(slopes)
    moved = slopes[..., :-1] @ sizes.q + slopes[..., -1] * sizes.time
    return np.asarray(np.maximum(moved, LEVEL * sizes.gap))
