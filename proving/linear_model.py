"""The mechanics of a model that moves linearly: momenta, gaps, and the coordinates of its modes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np
from scipy.linalg import null_space

from dmoc.base.errors import ProblemError
from dmoc.base.records import record
from dmoc.codegen.kernels import Array
from dmoc.mechanics.contact_mode import Mode, mode_in_words
from dmoc.mechanics.contacts import RAIL
from dmoc.problem.problem import Problem
from dmoc.program.blocks import Bools, Index
from dmoc.program.liftoffs import Liftoff, liftoffs_of
from dmoc.proving.linear import Rows, Shifts
from dmoc.proving.movers import Movers
from dmoc.proving.recognition import NEEDED, TRIALS, Affine, affine, force_of
from dmoc.proving.surface_shifts import Term, check_bounded, shifts_of, terms_of

# A function of positions and times.
Function: TypeAlias = Callable[[Array, Array], Array]

# Contacts are wedged where the mass matrix of what they leave free has this condition.
WEDGED = 1e9
# What is asked of surfaces.
SURFACES = (
    "proofs need surfaces that are flat, and that stand or move without turning; solve and search "
    "have no such limit."
)


@record(frozen=True, eq=False)
class Frame:
    """Coordinates of a mode: q = origin + Z y + moved s(t), where s are shifts of what moves, y =
    Z^T (q - origin - moved s).  The last ``held`` ones are where it sticks: they stay what they
    are, and have no momentum. Those of the others are p_y = left p, from which the forces of
    contacts vanish, with left M Z the unit matrix.  ``pushes`` are the directions of these forces,
    shape (contacts, nq), and ``drives`` the numbers of the shifts that the steps depend on."""

    origin: Array
    Z: Array
    left: Array
    held: int
    pushes: Array
    moved: Array
    drives: Index

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return int(self.Z.shape[1])

    @property
    def moving(self) -> int:
        """Number of those that move."""
        return self.size - self.held

    def state(self, position: Array, momentum: Array) -> Array:
        """Rows (y, p_y) of those of q - origin - moved s and p, shape (nq, k) or (nq,) each."""
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

    @cached_property
    def force(self) -> Affine:
        """The forces of the model as function of (q, v, u)."""
        return force_of(self.problem, self.sizes)

    def gap(self, j: int) -> Affine:
        """The gap to a surface as function of q; of one that moves, without its shift."""
        if j not in self._gaps:
            self._gaps[j] = self._gap(j)
        return self._gaps[j]

    @cached_property
    def _gaps(self) -> dict[int, Affine]:
        return {}

    def _gap(self, j: int) -> Affine:
        p = self.problem
        name = p.kernels.surfaces[j]
        if j not in p.model.moving:

            def values(q: Array) -> Array:
                return p.model.gaps(q)[:, [j]]

            return affine(values, p.kernels.coordinates, f"gap to {name}", self.sizes, SURFACES)
        check_bounded(shifts_of(self._terms[0][j]), name, p.final_time_bounds[1])
        return Affine(self._moved(p.model.gaps, j, f"gap to {name}", SURFACES), np.zeros(1))

    @cached_property
    def _terms(self) -> tuple[list[tuple[Term, Term]], list[tuple[Term, Term]]]:
        """The places and speeds of all surfaces and tangents."""
        return terms_of(self.problem)

    def _moved(self, function: Function, j: int, what: str, needed: str) -> Array:
        """The gradient of a function of (q, t) that moves without turning, shape (1, nq)."""
        p, n, latest = self.problem, self.problem.nq, self.problem.final_time_bounds[1]

        def rest(x: Array) -> Array:
            """What is left without the shift at times until the latest one."""
            q, time = x[:, :n], latest * (1 + x[:, n]) / 2
            return (function(q, time) - function(0 * q, time))[:, [j]]

        names, width = [*p.kernels.coordinates, "the time"], np.append(self.sizes, 1.0)
        return affine(rest, names, what, width, needed).A[:, :n]

    @cached_property
    def movers(self) -> Movers:
        """What moves in a given way: flat surfaces, and tangents that rub."""
        p, latest = self.problem, self.problem.final_time_bounds[1]
        surfaces = [j for j in self.flat if j in p.model.moving]
        rubs = sorted({k for mode in p.touch.modes for k in mode.rubbing})
        tangents = [k for k in rubs if self._slides_away[k]]
        terms = [self._terms[0][j] for j in surfaces]
        for k in tangents:
            check_bounded(shifts_of(self._terms[1][k]), f"tangent {p.kernels.tangents[k]}", latest)
            terms.append(self._terms[1][k])
        return Movers(tuple(surfaces), tuple(tangents), tuple(terms), latest, bool(self.liftoffs))

    @cached_property
    def _slides_away(self) -> Bools:
        """Which tangents move, as belts do, shape (nt,)."""
        p = self.problem
        t = np.random.default_rng(0).uniform(0, p.final_time_bounds[1], TRIALS)
        slopes = p.model.tangent_slopes(np.zeros((TRIALS, p.nq)), t)
        return np.asarray(slopes[..., -1].any(axis=0))

    @cached_property
    def liftoffs(self) -> tuple[Liftoff, ...]:
        """Contacts that leave where their forces vanish."""
        return liftoffs_of(self.problem)

    @property
    def shifts(self) -> Shifts:
        """The places and speeds of what moves, and its accelerations where something lifts off."""
        return self.movers.shifts

    def shift(self, j: int) -> Array:
        """Place, speed and acceleration of a surface as functions of the shifts, shape (orders,
        shifts)."""
        return self.movers.of_surface(j)

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
        n, movers = self.problem.nq, self.movers
        if mode.free:
            none = np.zeros((0, n)), np.zeros((n, movers.count)), np.zeros(0, dtype=int)
            return Frame(np.zeros(n), np.eye(n), np.eye(n), 0, *none)
        gaps = [self.gap(j) for j in mode.closed]
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
        own = [movers.of_surface(j) for j in mode.closed]
        own += [movers.of_tangent(k) for k in mode.sticking]
        moved = movers.followed(np.vstack([places, stuck]), own)
        if moved is None:
            raise ProblemError(
                f"the contacts {self._in_words(mode)} move apart: proofs cover those that keep "
                "their distances while they are closed at once."
            )
        return Frame(
            origin, np.hstack([free, held]), np.linalg.solve(mass, left), held.shape[1], pushes,
            moved, movers.drives(mode.closed, tuple(mode.rubbing)),
        )  # fmt: skip

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

    def _in_words(self, mode: Mode) -> str:
        return mode_in_words(self.problem.touch.contacts, mode)

    def tangent(self, k: int) -> Array:
        """The gradient of a tangential position, shape (nq,)."""
        if k not in self._tangents:
            model, name = self.problem.model, self.problem.kernels.tangents[k]
            self._tangents[k] = self._moved(model.tangents, k, f"tangent {name}", NEEDED)[0]
        return self._tangents[k]

    @cached_property
    def _tangents(self) -> dict[int, Array]:
        return {}

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

    def velocity(self, frame: Frame) -> Rows:
        """v as function of the state in a mode."""
        n, r = self.problem.nq, frame.size
        Z = frame.Z[:, : frame.moving]
        inverse = Z @ np.linalg.inv(frame.left @ self.M @ Z)
        G, p_0 = self.momentum.A[:, :n], self.momentum.b
        V = np.zeros((n, 2 * r))
        V[:, :r] = -inverse @ frame.left @ G @ frame.Z
        V[:, r : r + frame.moving] = inverse
        speeds = self.movers.derived(frame.moved)
        own = speeds - inverse @ frame.left @ (G @ frame.moved + self.M @ speeds)
        return Rows(V, -inverse @ frame.left @ (G @ frame.origin + p_0), own)

    def rows(
        self, frame: Frame, a: Array, v: Array, b: Array, shifted: Array | float = 0.0
    ) -> Rows:
        """Functions a q + v v + b + shifted s(t) of the state in a mode."""
        speed = self.velocity(frame)
        A = v @ speed.A
        A[:, : frame.size] += a @ frame.Z
        moved = shifted + a @ frame.moved + v @ speed.shifted
        return Rows(A, a @ frame.origin + v @ speed.b + b, moved)

    def stacked(self, rows: list[Rows], size: int) -> Rows:
        """Rows below each other, of states of a size."""
        return Rows.stacked(rows, size, self.movers.count)
