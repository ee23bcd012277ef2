"""What moves in a given way: surfaces, and tangents such as belts. Their places, speeds and, where
something lifts off, accelerations are the shifts of a problem, functions of the time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dmoc.base.errors import ProblemError
from dmoc.codegen.kernels import Array
from dmoc.program.blocks import Index
from dmoc.proving.linear import Shifts
from dmoc.proving.recognition import SAME_VALUE
from dmoc.proving.surface_shifts import Term, check_size, rates_of, shifts_of, values_of

# Times at which contacts that are closed at once are compared.
COMPARED = 64


@dataclass(eq=False)
class Movers:
    """Numbers of the surfaces and tangents that move, with the places and speeds of each, until the
    ``latest`` time; with ``accelerations`` their shifts are of three orders, else of two."""

    surfaces: tuple[int, ...]
    tangents: tuple[int, ...]
    terms: tuple[tuple[Term, Term], ...]
    latest: float
    accelerations: bool

    @property
    def orders(self) -> int:
        return 2 + self.accelerations

    @property
    def count(self) -> int:
        """Number of shifts."""
        return self.orders * len(self.terms)

    @cached_property
    def shifts(self) -> Shifts:
        """All of them, in the order of surfaces and tangents, and of each by order."""
        every = list[Term]()
        for place, speed in self.terms:
            every += place, speed, *(rates_of([speed]) if self.accelerations else ())
        shifts = shifts_of(every)
        assert shifts is not None  # each has been tried
        check_size(shifts, "all that moves")
        return shifts

    def of_surface(self, j: int) -> Array:
        """Place, speed and acceleration of a surface as functions of the shifts, shape (orders,
        shifts)."""
        return self._rows(self._places[0].get(j))

    def of_tangent(self, k: int) -> Array:
        """The same of a tangent."""
        return self._rows(self._places[1].get(k))

    @cached_property
    def _places(self) -> tuple[dict[int, int], dict[int, int]]:
        """The places of surfaces and tangents in the order of the terms."""
        count = len(self.surfaces)
        return (
            {j: i for i, j in enumerate(self.surfaces)},
            {k: count + i for i, k in enumerate(self.tangents)},
        )

    def _rows(self, mover: int | None) -> Array:
        rows = np.zeros((self.orders, self.count))
        if mover is not None:
            rows[:, self.orders * mover : self.orders * (mover + 1)] = np.eye(self.orders)
        return rows

    def derived(self, places: Array, order: int = 1) -> Array:
        """Functions of the places, shape (..., shifts), as those of speeds or accelerations."""
        return np.roll(places, order, axis=-1) if self.count else places

    def speeds(self, surfaces: Sequence[int], tangents: Sequence[int]) -> Array:
        """The speeds of surfaces and tangents as functions of the shifts, shape (n, shifts)."""
        own = [*map(self.of_surface, surfaces), *map(self.of_tangent, tangents)]
        return np.array([rows[1] for rows in own]).reshape(len(own), self.count)

    def drives(self, closed: Sequence[int], rubs: Sequence[int]) -> Index:
        """Numbers of the places and speeds of what moves among closed contacts, shape (given,)."""
        rows = [self.of_surface(j)[:2] for j in closed] + [self.of_tangent(k)[:2] for k in rubs]
        return np.flatnonzero(np.any(rows, axis=(0, 1))) if self.count else np.zeros(0, dtype=int)

    def followed(self, E: Array, own: Sequence[Array]) -> Array | None:
        """The least motion N s that keeps E q + places zero, shape (nq, shifts); the first rows of
        ``own`` are the places of each row of E. None where some move apart."""
        places = np.array([rows[0] for rows in own]).reshape(len(E), self.count)
        N = np.asarray(np.linalg.lstsq(E, -places, rcond=None)[0])
        if not places.any():
            return np.zeros((E.shape[1], self.count))
        times = np.random.default_rng(0).uniform(0, self.latest, COMPARED)
        s = np.array([self.at(float(time)) for time in times]).T
        apart, most = np.abs((E @ N + places) @ s), np.abs(places @ s)
        together = bool(apart.max() <= SAME_VALUE * most.max())
        return N if together else None

    def at(self, time: float) -> Array:
        """The shifts at a time, shape (shifts,)."""
        return values_of(self.shifts, time)

    def at_start(self, closed: Index) -> Array:
        """The shifts at the start, shape (shifts,), where those of numbers ``closed`` need a
        value."""
        values = self.at(0.0)
        if not np.isfinite(values[closed]).all():
            raise ProblemError(
                "what is closed at the start moves at a speed without bounds there, as sqrt(t) "
                "does: proofs need one that has bounds."
            )
        return np.where(np.isfinite(values), values, 0.0)
