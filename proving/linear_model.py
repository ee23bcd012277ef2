"""The mechanics of a model that moves linearly: momenta, gaps, and the coordinates of its modes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import null_space

from dmoc.base.errors import ProblemError
from dmoc.base.records import record
from dmoc.codegen.kernels import Array
from dmoc.mechanics.contact_mode import Mode, mode_in_words
from dmoc.mechanics.contacts import RAIL
from dmoc.problem.problem import Problem
from dmoc.proving.linear import Rows, Shifts
from dmoc.proving.recognition import Affine, affine
from dmoc.proving.surface_shifts import Term, check_bounded, shifts_of, terms_of

# Contacts are wedged where the mass matrix of what they leave free has this condition.
WEDGED = 1e9
# What is asked of surfaces.
SURFACES = (
    "proofs need surfaces that are flat, and that stand or move without turning; solve and search "
    "have no such limit."
)


@record(frozen=True, eq=False)
class Frame:
    """Coordinates of a mode: q = origin + Z y, y = Z^T (q - origin).  The last ``held`` ones are
    where it sticks: they stay what they are, and have no momentum. Those of the others are p_y =
    left p, from which the forces of contacts vanish, with left M Z the unit matrix.  ``pushes`` are
    the directions of these forces, shape (contacts, nq)."""

    origin: Array
    Z: Array
    left: Array
    held: int
    pushes: Array

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return int(self.Z.shape[1])

    @property
    def moving(self) -> int:
        """Number of those that move."""
        return self.size - self.held

    def state(self, position: Array, momentum: Array) -> Array:
        """Rows (y, p_y) of those of q - origin and p, shape (nq, k) or (nq,) each."""
        still = np.zeros((self.held, *momentum.shape[1:]))
        return np.concatenate([self.Z.T @ position, self.left @ momentum, still])


@dataclass(eq=False)
class LinearModel:
    """The model of a problem, in functions that are affine; what is not is refused by name."""

    problem: Problem

    @cached_property
    def sizes(self) -> Array:
        """Typical sizes of the coordinates, shape (nq,)."""
        reach = np.abs(self.problem.reach)
        return np.where(np.isfinite(reach) & (reach > 0), reach, 1.0)

    @cached_property
    def h(self) -> float:
        """A typical size of a step."""
        low, high = self.problem.final_time_bounds
        time = high if np.isfinite(high) else max(low, 1.0)
        return float(time / sum(self.problem.phase_steps))

    @cached_property
    def momentum(self) -> Affine:
        """p = dL/dv as function of (q, v)."""
        n, names = self.problem.nq, list(self.problem.kernels.coordinates)
        function = self.problem.model.momentum
        sizes = np.concatenate([self.sizes, self.sizes])
        return affine(lambda x: function(x[:, :n], x[:, n:]), [*names, *names], "momentum", sizes)

    @property
    def M(self) -> Array:
        """The mass matrix, shape (nq, nq)."""
        return self.momentum.A[:, self.problem.nq :]

    def gap(self, j: int) -> Affine:
        """The gap to a surface as function of q; of one that moves, without its shift."""
        if j not in self._gaps:
            self._gaps[j] = self._gap(j)
        return self._gaps[j]

    @cached_property
    def _gaps(self) -> dict[int, Affine]:
        return {}

    def _gap(self, j: int) -> Affine:
        p, n = self.problem, self.problem.nq
        name = p.kernels.surfaces[j]
        if j not in p.model.moving:

            def values(q: Array) -> Array:
                return p.model.gaps(q)[:, [j]]

            return affine(values, p.kernels.coordinates, f"gap to {name}", self.sizes, SURFACES)
        latest = p.final_time_bounds[1]
        check_bounded(shifts_of(self._terms[j]), name, latest)

        def rest(x: Array) -> Array:
            """What is left without the shift at times until the latest one."""
            q, time = x[:, :n], latest * (1 + x[:, n]) / 2
            return (p.model.gaps(q, time) - p.model.gaps(0 * q, time))[:, [j]]

        names, width = [*p.kernels.coordinates, "the time"], np.append(self.sizes, 1.0)
        even = affine(rest, names, f"gap to {name}", width, SURFACES)
        return Affine(even.A[:, :n], np.zeros(1))

    @cached_property
    def _terms(self) -> list[tuple[Term, Term]]:
        """The shift of each surface, and its slope."""
        return terms_of(self.problem)

    @cached_property
    def moving(self) -> list[int]:
        """The numbers of the flat surfaces that move."""
        return [j for j in self.flat if j in self.problem.model.moving]

    @cached_property
    def shifts(self) -> Shifts:
        """The places and speeds of these."""
        shifts = shifts_of([term for j in self.moving for term in self._terms[j]])
        assert shifts is not None  # each has been tried
        check_bounded(shifts, "all surfaces", self.problem.final_time_bounds[1])
        return shifts

    def shifted_by(self, j: int) -> int:
        """The number of the shift that is the place of a surface; -1 of one that stands."""
        return 2 * self.moving.index(j) if j in self.moving else -1

    def shift(self, j: int) -> Array:
        """The place and the speed of a surface as functions of the shifts, shape (2, shifts)."""
        rows, at = np.zeros((2, 2 * len(self.moving))), self.shifted_by(j)
        if at >= 0:
            rows[0, at] = rows[1, at + 1] = 1.0
        return rows

    @cached_property
    def flat(self) -> dict[int, Affine]:
        """Gaps to the surfaces that are flat, by number."""
        flat = {}
        for j in range(self.problem.model.nc):
            try:
                flat[j] = self.gap(j)
            except ProblemError:
                continue
        return flat

    # Modes ----------------------------------------------------------------------------------------

    def frame(self, mode: Mode) -> Frame:
        """The coordinates of a mode."""
        n = self.problem.nq
        if mode.free:
            return Frame(np.zeros(n), np.eye(n), np.eye(n), 0, np.zeros((0, n)))
        gaps = [self._standing(j) for j in mode.closed]
        places = np.array([gap.A[0] for gap in gaps]).reshape(-1, n)
        stuck = np.array([self.tangent(k) for k in mode.sticking]).reshape(-1, n)
        pushes = np.array(self.pushes(mode)).reshape(-1, n)
        origin = np.linalg.lstsq(places, -np.array([gap.b[0] for gap in gaps]), rcond=None)[0]
        free = null_space(np.vstack([places, stuck]))
        held = null_space(np.vstack([places, free.T]))
        left = null_space(pushes).T if len(pushes) else np.eye(n)
        mass = left @ self.M @ free
        square = mass.shape[0] == mass.shape[1]
        if not square or (mass.size and not np.linalg.cond(mass) < WEDGED):
            raise ProblemError(
                f"the contacts {self._in_words(mode)} leave the motion undetermined: proofs cover "
                "those whose friction does not wedge what slides."
            )
        return Frame(
            origin, np.hstack([free, held]), np.linalg.solve(mass, left), held.shape[1], pushes
        )

    def pushes(self, mode: Mode, rails: bool = True) -> list[Array]:
        """Directions in which the contacts of a mode push: against a normal with the friction of
        what slides, against and along a tangent that sticks; those of rails are left out where
        they do not count."""
        p = self.problem
        pushes = {j: self.gap(j).A[0] for j in mode.closed}
        supports = p.touch.contacts.supports
        for k, way in self.ways(mode):
            if supports[k] != RAIL:
                pushes[supports[k]] = pushes[supports[k]] + self.friction(k) * way
        stuck = (k for k in mode.sticking if rails or supports[k] != RAIL)
        return [*pushes.values(), *map(self.tangent, stuck)]

    def cones(self, surfaces: Sequence[int], tangents: Sequence[int]) -> Iterator[Array]:
        """Rows of the forces of surfaces and of tangents that stick, in the directions of
        ``pushes``, that are not positive: surfaces push, along them acts no more than friction."""
        unit, supports = np.eye(len(surfaces) + len(tangents)), self.problem.touch.contacts.supports
        forces = dict(zip(surfaces, unit, strict=False))
        yield from forces.values()
        for along, k in zip(unit[len(surfaces) :], tangents, strict=True):
            mu = float(self.problem.static_friction[0, k])
            if supports[k] in forces and np.isfinite(mu):
                limit = mu * forces[supports[k]]
                yield along + limit
                yield -along + limit

    def drag(self, mode: Mode) -> Array:
        """The force of the rails that slide, shape (nq,)."""
        supports = self.problem.touch.contacts.supports
        rails = (self.friction(k) * way for k, way in self.ways(mode) if supports[k] == RAIL)
        return -sum(rails, np.zeros(self.problem.nq))

    def ways(self, mode: Mode) -> list[tuple[int, Array]]:
        """What slides in a mode, and its gradient in its direction, shape (nq,)."""
        return [(k, s * self.tangent(k)) for k, s in mode.sliding]

    def _standing(self, j: int) -> Affine:
        """The gap to a surface that is touched for a while."""
        gap = self.gap(j)
        if j in self.problem.model.moving:
            raise ProblemError(
                f"{self.problem.kernels.surfaces[j]} moves while it is touched: proofs cover "
                "contacts that last with surfaces that stand."
            )
        return gap

    def _in_words(self, mode: Mode) -> str:
        return mode_in_words(self.problem.touch.contacts, mode)

    def tangent(self, k: int) -> Array:
        """The gradient of a tangential position, shape (nq,)."""
        p = self.problem

        def values(q: Array) -> Array:
            return p.model.tangents(q)[:, [k]]

        name = p.kernels.tangents[k]
        tangent = affine(values, list(p.kernels.coordinates), f"tangent {name}", self.sizes)
        return np.asarray(tangent.A[0])

    def friction(self, k: int) -> float:
        """The coefficient of a tangent, or the force of a rail."""
        mu = float(self.problem.friction[0, k])
        if not np.isfinite(mu):
            raise ProblemError(
                f"the friction of {self.problem.kernels.tangents[k]} varies: proofs cover a "
                "constant coefficient."
            )
        return mu

    # Functions of the state -----------------------------------------------------------------------

    def velocity(self, frame: Frame) -> tuple[Array, Array]:
        """v as function V z + v_0 of the state in a mode, shapes (nq, 2 r) and (nq,)."""
        n, r = self.problem.nq, frame.size
        Z = frame.Z[:, : frame.moving]
        inverse = Z @ np.linalg.inv(frame.left @ self.M @ Z)
        G, p_0 = self.momentum.A[:, :n], self.momentum.b
        V = np.zeros((n, 2 * r))
        V[:, :r] = -inverse @ frame.left @ G @ frame.Z
        V[:, r : r + frame.moving] = inverse
        return V, -inverse @ frame.left @ (G @ frame.origin + p_0)

    def rows(
        self, frame: Frame, a: Array, v: Array, b: Array, shifted: Array | float = 0.0
    ) -> Rows:
        """Functions a q + v v + b + shifted s(t) of the state in a mode."""
        V, v_0 = self.velocity(frame)
        A = v @ V
        A[:, : frame.size] += a @ frame.Z
        moved = np.broadcast_to(shifted, (len(b), 2 * len(self.moving))).astype(float)
        return Rows(A, a @ frame.origin + v @ v_0 + b, moved)

    def stacked(self, rows: list[Rows], size: int) -> Rows:
        """Rows below each other, of states of a size."""
        return Rows.stacked(rows, size, 2 * len(self.moving))
