"""The functions r >= 0 that a motion keeps, of states as rows (q | v | u | t | y): its path
constraints as they were stated, and the bounds of its velocities and quantities."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dmoc.base.discretisation import DISCRETISATIONS
from dmoc.base.names import velocity_name
from dmoc.base.records import record
from dmoc.check.checked_motion import Motion
from dmoc.check.integrated_steps import IntegratedSteps
from dmoc.codegen.kernels import Array, Kernels
from dmoc.codegen.manifest import FunctionFacts
from dmoc.mechanics.contact_mode import Mode
from dmoc.mechanics.model import Model
from dmoc.motion.trajectory import Trajectory
from dmoc.simulation.flow import PLACES

Bools = NDArray[np.bool_]
# States (k, d) of steps in a mode, from those (places, n, d) at places of them.
Between = Callable[[Mode, IntegratedSteps, Array], Array]


@record(frozen=True, eq=False)
class Bound:
    """A side on which a velocity, or a quantity of the model, is bounded, sign (z - value) >= 0,
    with its place there."""

    name: str
    sign: float
    value: float
    is_velocity: bool
    place: int


def bounds_of(trajectory: Trajectory, kernels: Kernels) -> tuple[Bound, ...]:
    """The bounds of velocities and quantities that a motion has beside those of integrals and of
    quantities of hits."""
    return bounds_among(trajectory.limits, kernels)


def bounds_among(limits: Mapping[str, tuple[float, float]], kernels: Kernels) -> tuple[Bound, ...]:
    """Those bounds among limits by name."""
    rates, bounds = [velocity_name(q) for q in kernels.coordinates], list[Bound]()
    for name, box in limits.items():
        if name not in (*kernels.integrals, *kernels.hit_quantities):
            of = rates if name in rates else kernels.quantities
            sides = [(s, e) for s, e in zip((1.0, -1.0), box, strict=True) if np.isfinite(e)]
            bounds += [Bound(name, *side, name in rates, of.index(name)) for side in sides]
    return tuple(bounds)


@record(frozen=True, eq=False)
class LimitFunctions:
    """The m functions r >= 0 of a motion, those of path constraints before those of bounds; states
    have the shape (n, d)."""

    motion: Motion
    bounds: tuple[Bound, ...]

    @classmethod
    def of(cls, motion: Motion) -> LimitFunctions:
        return cls(motion, bounds_of(motion.trajectory, motion.model.kernels))

    @property
    def model(self) -> Model:
        return self.motion.model

    @cached_property
    def constraints(self) -> int:
        """Number of path constraints, which come first."""
        return len(self.model.kernels.manifest.path_constraints)

    @cached_property
    def rows(self) -> list[FunctionFacts]:
        """Facts about each function from the model: the parts of a state that it depends on."""
        rate = FunctionFacts(name="", coordinates=[], velocities=True, inputs=False, time=False)
        kernels = self.model.kernels
        own = [rate if b.is_velocity else kernels.quantity_rows[b.place] for b in self.bounds]
        return [*kernels.manifest.path_limits, *own]

    @cached_property
    def texts(self) -> list[str]:
        """Words for each function that may be exceeded."""
        names = self.model.kernels.manifest.path_constraints
        texts = [f"path constraint {name!r}" for name in names]
        return texts + [f"the bound of {b.name}" for b in self.bounds]

    @cached_property
    def _begins(self) -> list[int]:
        """Columns of a state at which v, u, t and y begin."""
        nq, nu = self.model.nq, self.model.nu
        return [nq, 2 * nq, 2 * nq + nu, 2 * nq + nu + 1]

    @cached_property
    def depends(self) -> NDArray[np.bool_]:
        """Entries of a state that each function depends on, shape (m, d)."""
        model, on = self.model, list[Array]()
        for row in self.rows:
            places = np.isin(np.arange(model.nq), row["coordinates"])
            parts = (row["velocities"], model.nq), (row["inputs"], model.nu), (row["time"], 1)
            others = [np.full(size, bool(there)) for there, size in parts]
            on.append(np.hstack([places, *others, np.full(model.ny, bool(row.get("forces")))]))
        return np.array(on, dtype=bool).reshape(len(self.rows), self._begins[-1] + model.ny)

    def states(self, mode: Mode, q: Array, v: Array, u: Array, t: Array) -> Array:
        """States of a mode as rows, shape (n, d), from q, v and u, n rows each, and t (n,), with
        the accelerations and forces of the flow there, if quantities contain any."""
        parts = [q, v, u, t[:, None]]
        if self.model.ny:
            r = self.motion.flow.integrator.reaction(mode, np.hstack([q, v]), u, t)
            parts.append(np.hstack([r.acceleration, r.normal, r.tangential, r.joint]))
        return np.hstack(parts)

    def visited(
        self, courses: Sequence[IntegratedSteps], between: Between | None = None
    ) -> tuple[Array, Bools, Bools]:
        """States (n, d) of the motion at the places that steps are looked at, and those (k, d) that
        ``between`` finds from them; which of them are quadrature points, and which is the one after
        an event that ends it."""
        motion, parts, at_points = self.motion, list[Array](), [np.zeros(0, dtype=bool)]
        places = (*PLACES, *DISCRETISATIONS[motion.trajectory.order].places)
        is_point = np.isin(places, places[len(PLACES) :])
        for piece, course in zip(motion.pieces, courses, strict=True):
            states = [self.states(piece.mode, *course.at(share)) for share in places]
            parts += states
            at_points.append(np.repeat(is_point, len(course.steps)))
            if between is not None:
                parts.append(between(piece.mode, course, np.array(states[: len(PLACES)])))
                at_points.append(np.zeros(len(parts[-1]), dtype=bool))
        on_steps = sum(map(len, parts))
        for mode, phase in motion.last_node:
            u = motion.trajectory.last_inputs[None]
            parts.append(self.states(mode, phase.q, phase.v, u, phase.t))
        whole = np.concatenate(parts)
        after = np.arange(len(whole)) >= on_steps
        return whole, np.append(np.concatenate(at_points), after[on_steps:]), after

    def split(self, states: Array) -> tuple[Array, Array, Array, Array, Array]:
        """q, v, u, t and y of states (n, d), with n rows each."""
        q, v, u, t, y = (np.ascontiguousarray(a) for a in np.split(states, self._begins, axis=1))
        return q, v, u, t[:, 0], y

    def values(self, states: Array) -> Array:
        """The functions at states, shape (n, m)."""
        parts = [self._constraints(states)] if self.constraints else []
        for bound in self.bounds:
            parts.append(bound.sign * (self.bounded(bound, states) - bound.value)[:, None])
        return np.hstack(parts)

    def _constraints(self, states: Array) -> Array:
        q, v, u, t, _ = self.split(states)
        return self.model.path_at(q, v, u, t)

    def terms(self, states: Array) -> Array:
        """Sums of the absolute values of the terms of the functions, shape (n, m)."""
        q, v, u, t, _ = self.split(states)
        parts = [self.model.path_terms(q, v, u, t)] if self.constraints else []
        for bound in self.bounds:
            value = np.abs(self.bounded(bound, states))
            parts.append((value + abs(bound.value))[:, None])
        return np.hstack(parts)

    @cached_property
    def by_terms(self) -> list[bool]:
        """Whether each function is measured by its terms too: bounds, and path constraints that
        contain velocities or inputs; terms of others depend on where zero lies."""
        own = self.rows[: self.constraints]
        of_constraints = [bool(row["velocities"] or row["inputs"]) for row in own]
        return of_constraints + [True] * len(self.bounds)

    def bounded(self, bound: Bound, states: Array) -> Array:
        """The bounded velocity or quantity at states (n, d), shape (n,)."""
        if bound.is_velocity:
            return np.asarray(states[:, self.model.nq + bound.place])
        return self.model.quantities(*self.split(states))[:, bound.place]

    def slopes(self, states: Array) -> Array:
        """Derivatives of the functions by states, shape (n, m, d)."""
        slopes, whole = np.zeros((len(states), *self.depends.shape)), self.split(states)
        if self.constraints:
            own = self.model.path_slopes_at(*whole[:4])
            slopes[:, : self.constraints, : own.shape[2]] = own
        of_quantities = None
        for j, bound in enumerate(self.bounds, self.constraints):
            if bound.is_velocity:
                slopes[:, j, self.model.nq + bound.place] = bound.sign
                continue
            if of_quantities is None:
                of_quantities = self.model.quantity_slopes(*whole)
            slopes[:, j] = bound.sign * of_quantities[:, bound.place]
        return slopes

    def sizes(self, states: Array) -> Array:
        """Sizes of the entries of a state along these states (n, d), shape (d,)."""
        sizes, needed = self.motion.sizes, self.motion.needed_inputs
        _, _, u, _, y = self.split(states)
        used = np.abs(u).max(axis=0, initial=0.0)
        inputs = np.maximum(used, np.where(np.isfinite(needed), needed, 0.0))
        forces = np.abs(y).max(axis=0, initial=0.0)
        return np.concatenate([sizes.q, sizes.v, inputs, [sizes.time], forces])

    def widths(self, states: Array) -> Array:
        """The widths in which these states lie, shape (d,): sizes of coordinates and the time are
        ranges, those of all others the largest magnitudes, which have two signs."""
        widths, begins = self.sizes(states), self._begins
        widths[begins[0] : begins[2]] *= 2
        widths[begins[3] :] *= 2
        return widths

    def even_widths(self, states: Array) -> Array:
        """Widths as of :meth:`widths` for a motion that is as wide in all coordinates, and in all
        velocities, as in the widest one by the masses: for what a motion passes beside itself."""
        widths, root = self.widths(states), np.sqrt(self.motion.nodes.inertia)
        for begin in (0, self._begins[0]):
            own = slice(begin, begin + self.model.nq)
            widths[own] = (widths[own] * root).max() / root
        return widths
