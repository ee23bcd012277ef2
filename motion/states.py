"""The states of a motion at any time, between its nodes too.

Within a step the inputs are what the discretisation makes of them: constant, linear between nodes,
or linear with values of their own at both ends.  Positions are a polynomial through all nodes of
the step, those inside it too, which has the velocities of the motion at both ends: at order 2 the
cubic Hermite polynomial, at order 4 of degree 4, at order 6 of degree 5.  The step's own polynomial
of degree d, q_d, leaves an error of h^(d+1) between nodes that are right to h^(2d), and its slopes
jump at the nodes; the two velocities add the term that vanishes at all nodes.  Velocities are its
slopes.  Momenta are the polynomial through those at the nodes of the step, forces of contacts
are linear between nodes, those inside steps among them; quantities are the parabola through both
ends and the middle of the step.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import chain

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dmoc.base.arguments import array, choice, shown
from dmoc.base.discretisation import DISCRETISATIONS, Discretisation
from dmoc.base.errors import MotionError
from dmoc.base.names import momentum_name, velocity_name
from dmoc.base.records import value_class
from dmoc.base.tolerances import ROUNDING
from dmoc.motion.trajectory import Array, Phase, Trajectory

SIDES = ("left", "right")
PARTS = 3  # places of a step at which a phase has quantities: both ends and the middle
TAKEN = "~"  # marks a name that the model uses for something else


@dataclass(frozen=True, eq=False)
class State(Mapping[str, "Array | float"]):
    """The state of a motion at one time or at n times; also a mapping by name.

    ``state["x"]``, ``state["x_dot"]``, ``state["p_x"]``, ``state["F"]`` are position, velocity,
    momentum and input, ``state["N_floor"]`` and ``state["T_floor"]`` contact force and friction,
    ``state["t"]`` and ``state["phase"]`` the time and the number of the phase.  A name that the
    model has given to something else is marked: ``"N_floor~"``.

    Attributes
    ----------
    t : float or array of shape (n,)
        Time in seconds.
    phase : int or array of shape (n,)
        Number of the phase, from 0 on.
    q, v, p : arrays of shape (nq,) or (n, nq)
        Coordinates, velocities, momenta.
    u : array of shape (nu,) or (n, nu)
        Inputs.
    normal : array of shape (nc,) or (n, nc)
        Contact forces N of all surfaces in newton, zero where a surface is not closed.
    tangential : array of shape (nt,) or (n, nt)
        Friction forces T of all tangents in newton.
    reaction : array of shape (nj,) or (n, nj)
        Forces R of the constraints of the model, ``state["R_rod"]``.
    quantities : array of shape (nz,) or (n, nz)
        Quantities of the model, by their names.
    names : Names
        What the columns are called.
    """

    t: Array | float
    phase: NDArray[np.intp] | int
    q: Array
    v: Array
    p: Array
    u: Array
    normal: Array
    tangential: Array
    reaction: Array
    quantities: Array
    names: Names

    def __getitem__(self, name: str) -> Array | float:
        part, column = self.names.places[name]
        value = getattr(self, part)
        return value if column is None else _plain(value[..., column])

    def __iter__(self) -> Iterator[str]:
        return iter(self.names.places)

    def __len__(self) -> int:
        return len(self.names.places)

    def __repr__(self) -> str:
        if np.ndim(self.t):
            return f"State({np.size(self.t)} times of {', '.join(self)})"
        return f"State({', '.join(f'{name}={value:.6g}' for name, value in self.items())})"


@value_class(frozen=True)
class Names:
    """Names of what a motion consists of."""

    coordinates: tuple[str, ...]
    inputs: tuple[str, ...]
    surfaces: tuple[str, ...]
    tangents: tuple[str, ...]
    joints: tuple[str, ...]
    quantities: tuple[str, ...] = ()

    @classmethod
    def of(cls, motion: Trajectory) -> Names:
        contacts = tuple(motion.restitution), tuple(motion.friction)
        return cls(
            motion.coordinates, motion.inputs, *contacts, motion.phases[0].joints, motion.quantities
        )

    @cached_property
    def places(self) -> dict[str, tuple[str, int | None]]:
        """The field of a state and the column of each name; no two are the same."""
        rates = [velocity_name(name) for name in self.coordinates]
        momenta = [momentum_name(name) for name in self.coordinates]
        places: dict[str, tuple[str, int | None]] = {"t": ("t", None)}
        for part, columns in (
            ("q", self.coordinates),
            ("v", rates),
            ("p", momenta),
            ("u", self.inputs),
            ("quantities", self.quantities),
        ):
            places |= {name: (part, i) for i, name in enumerate(columns)}
        for part, columns in (
            ("normal", [f"N_{name}" for name in self.surfaces]),
            ("tangential", [f"T_{name}" for name in self.tangents]),
            ("reaction", [f"R_{name}" for name in self.joints]),
        ):
            places |= {_free(name, places): (part, i) for i, name in enumerate(columns)}
        return places | {_free("phase", places): ("phase", None)}


def _free(name: str, taken: Mapping[str, object]) -> str:
    return _free(name + TAKEN, taken) if name in taken else name


def state_at(motion: Trajectory, t: ArrayLike, side: str = "right") -> State:
    """The state of a motion at a time, or at times of shape (n,) in any order.

    At a collision ``side`` decides: "right" for the phase that begins there, "left" for the one
    that ends; at a node inside a phase too, which matters to inputs that jump there.

    Raises
    ------
    MotionError
        If a time is no number or lies outside the motion, or the side is neither.
    """
    choice(side, "side", SIDES, MotionError)
    times = _times(t, motion)
    flat = times.ravel()
    phases = _phases_of(motion, flat, side)
    names = Names.of(motion)
    sizes = [len(names.coordinates)] * 3 + [
        len(part)
        for part in (names.inputs, names.surfaces, names.tangents, names.joints, names.quantities)
    ]
    rows = [np.zeros((len(flat), size)) for size in sizes]
    for i in np.unique(phases):
        at = phases == i
        values = _in_phase(motion, motion.phases[i], flat[at], side)
        for whole, part in zip(rows, values, strict=True):
            whole[at] = part
    if not times.ndim:
        q, v, p, u, N, T, R, z = (part[0] for part in rows)
        return State(float(times), int(phases[0]), q, v, p, u, N, T, R, z, names)
    q, v, p, u, N, T, R, z = rows
    return State(times, phases, q, v, p, u, N, T, R, z, names)


def _times(t: ArrayLike, motion: Trajectory) -> Array:
    """Times as an array of no or one dimension, within the motion."""
    end = motion.final_time
    times = array(t)
    if times is None or times.ndim > 1 or np.isnan(times).any():
        raise MotionError(f"t = {shown(t)}: expected a time in seconds, or a list of times.")
    off = times[(times < -ROUNDING * end) | (times > end * (1 + ROUNDING))]
    if off.size:
        raise MotionError(
            f"t = {off.flat[0]:.6g} s lies outside the motion: expected times from 0 to "
            f"{end:.9g} s."
        )
    return np.asarray(np.clip(times, motion.phases[0].t[0], end))


def _phases_of(motion: Trajectory, t: Array, side: str) -> NDArray[np.intp]:
    """Number of the phase of each time."""
    begins = np.array([phase.t[0] for phase in motion.phases[1:]])
    return _nodes_before(begins, t, side)


def _nodes_before(nodes: Array, t: Array, side: str) -> NDArray[np.intp]:
    """Number of nodes, at times of shape (N + 1,), that lie before each of n times, or, on the
    right side, at it; shape (n,)."""
    return np.searchsorted(nodes, t, side="right" if side == "right" else "left")


def _in_phase(motion: Trajectory, phase: Phase, t: Array, side: str) -> tuple[Array, ...]:
    """q, v, p, u, N, T, R and quantities at times of a phase, shape (n, size) each."""
    if not phase.steps:
        node = np.zeros(len(t), dtype=np.intp)
        u = np.tile(motion.last_inputs, (len(t), 1))
        forces = [rows[node] for _, rows in _all_forces(motion, phase)]
        quantities = phase.quantities.reshape(len(phase.t), len(motion.quantities))
        return phase.q[node], phase.v[node], phase.p[node], u, *forces, quantities[node]
    k = np.clip(_nodes_before(phase.t, t, side) - 1, 0, phase.steps - 1)
    h = phase.t[k + 1] - phase.t[k]
    share = np.clip((t - phase.t[k]) / h, 0.0, 1.0)
    q, v = positions(phase, k, share, h)
    first, last = motion.input_ends(phase)
    u = first[k] + share[:, None] * (last[k] - first[k])
    forces = [_interpolated(times, t, rows) for times, rows in _all_forces(motion, phase)]
    return q, v, _momenta(phase, k, share), u, *forces, _quantities(phase, k, share)


def positions(phase: Phase, k: NDArray[np.intp], share: Array, h: Array) -> tuple[Array, Array]:
    """Positions and velocities, shape (n, nq) each, at shares of steps k of size h, all of shape
    (n,)."""
    ends = [h[:, None] * phase.v[k], h[:, None] * phase.v[k + 1]]
    data = np.stack([*_nodes(phase.q, phase.q_inside, k), *ends], axis=1)
    base = _scheme(phase).course
    powers = np.arange(len(base))
    values = share[:, None] ** powers @ base
    slopes = powers * share[:, None] ** np.maximum(powers - 1, 0) @ base
    q = np.einsum("na,nai->ni", values, data)
    return q, np.einsum("na,nai->ni", slopes, data) / h[:, None]


def _quantities(phase: Phase, k: NDArray[np.intp], share: Array) -> Array:
    """Quantities at shares of steps k: the parabola through both ends and the middle."""
    rows = phase.quantities.reshape(phase.steps, PARTS, -1)
    s = share[:, None]
    start, middle, end = rows[k, 0], rows[k, 1], rows[k, 2]
    ends = start * (1 - s) * (1 - 2 * s) + end * s * (2 * s - 1)
    return np.asarray(ends + 4 * middle * s * (1 - s))


def _momenta(phase: Phase, k: NDArray[np.intp], share: Array) -> Array:
    """Momenta at shares of steps k."""
    data = np.stack(_nodes(phase.p, phase.p_inside, k), axis=1)
    shapes = _scheme(phase).shapes
    weights = share[:, None] ** np.arange(len(shapes)) @ shapes.T
    return np.asarray(np.einsum("na,nai->ni", weights, data))


def _scheme(phase: Phase) -> Discretisation:
    """The discretisation whose steps have the nodes of a phase."""
    return DISCRETISATIONS[2 + 2 * (len(phase.q_inside) // phase.steps)]


def _nodes(at_ends: Array, inside: Array, k: NDArray[np.intp]) -> list[Array]:
    """Values at the nodes of steps k, first, last, inside, shape (n, size) each."""
    count = len(inside) // (len(at_ends) - 1)
    return [at_ends[k], at_ends[k + 1], *(inside[count * k + a] for a in range(count))]


def _interpolated(nodes: Array, t: Array, rows: Array) -> Array:
    columns = [np.interp(t, nodes, column) for column in rows.T]
    return np.array(columns).reshape(rows.shape[1], len(t)).T


def phase_forces(motion: Trajectory, phase: Phase) -> tuple[Array, ...]:
    """Contact forces (N + 1, nc) of all surfaces, friction (N + 1, nt) of all tangents and forces
    of joints (N + 1, nj) at the nodes of a phase, zero where one is open."""
    every = [rows for _, rows in _all_forces(motion, phase)]
    return tuple(rows[:: max((len(rows) - 1) // max(phase.steps, 1), 1)] for rows in every)


def _all_forces(motion: Trajectory, phase: Phase) -> Iterator[tuple[Array, Array]]:
    """Times and contact forces, friction and forces of joints at the nodes and those inside steps,
    shapes (rows,) and (rows, size)."""
    forces = phase.forces
    for kind, names, everyone in (
        ("normal", phase.closed, motion.restitution),
        ("tangential", phase.rubbing, motion.friction),
        ("reaction", phase.joints, phase.joints),
    ):
        times, rows = forces.get(kind, (phase.t, np.zeros((len(phase.t), 0))))
        columns = dict(zip(names, rows.T, strict=False))
        nothing = np.zeros(len(times))
        of_all = np.array([columns.get(name, nothing) for name in everyone])
        yield times, of_all.reshape(len(everyone), len(times)).T


def _plain(value: Array) -> Array | float:
    return value if value.ndim else float(value)


def forces_in(motion: Trajectory) -> set[str]:
    """Contacts that have forces in some phase."""
    return set(chain.from_iterable((*p.closed, *p.rubbing) for p in motion.phases))
