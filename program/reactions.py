"""What pushes along the phases of a motion: reactions of what is held, and friction.

A law says once what it pushes with and what it holds; initial guesses, other meshes and results go
through all reactions alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from dmoc.base.records import record
from dmoc.codegen.kernels import Array
from dmoc.mechanics.conditions import Functions
from dmoc.mechanics.model import Model
from dmoc.program.blocks import NOWHERE, Bools, Index


@record(frozen=True, eq=False)
class PhaseReaction:
    """Impulses at the stations of a phase that push along the slopes of functions.

    Attributes
    ----------
    functions : Functions
    columns : tuple of int
        Those of the functions that push, m of them; ``names`` are theirs.
    unknowns : array of int, shape (rows, m)
        Impulses in the rows of :class:`~dmoc.program.stations.Stations`.
    holds : array of bool, shape (m,)
        Functions whose rates vanish; those of the others are of what slides.
    pulls : array of bool, shape (m,)
        Those whose impulses have both signs.
    in_place : array of bool, shape (m,)
        Those that are held at zero; the others where the phase begins.
    """

    functions: Functions
    names: tuple[str, ...]
    columns: tuple[int, ...]
    unknowns: Index
    holds: Bools
    pulls: Bools
    in_place: Bools

    @property
    def kind(self) -> str:
        """Kind of the forces: "normal", "tangential" or "reaction"."""
        return self.functions.kind

    @property
    def held(self) -> list[int]:
        return [c for c, holds in zip(self.columns, self.holds, strict=True) if holds]

    def impulses(self, x: Array) -> Array:
        """Impulses in the unknowns x, shape (n,), of shape (rows, m)."""
        return np.asarray(x[self.unknowns])

    def slopes(self, model: Model, q: Array, t: Array) -> Array:
        """Slopes in q of all functions that push, shape (n, m, nq), at q (n, nq) and t (n,)."""
        return np.asarray(self.functions.slopes(model, q, t)[:, list(self.columns), :-1])

    def misses(self, model: Model, q: Array, t: Array) -> Array:
        """Distances of positions q (n, nq) along the phase, at times t (n,), from where it holds
        them, shape (n, held)."""
        values = self.functions.values(model, q, t)[:, self.held]
        return np.asarray(values - values[:1] * ~self.in_place[self.holds])

    def miss_slopes(self, model: Model, q: Array, t: Array) -> Array:
        """Slopes in q of the misses, zero for functions that have no place, shape (n, held, nq)."""
        placed = self.functions.placed(model)[self.held] | ~self.in_place[self.holds]
        return np.asarray(self.slopes(model, q, t)[:, self.holds] * placed[:, None])

    def rates(self, model: Model, q: Array, v: Array, t: Array) -> Array:
        """Rates of the functions that hold, shape (n, held)."""
        return np.asarray(self.functions.rates(model, q, v, t)[:, self.held])


class EventImpulses(NamedTuple):
    """Impulses at an event: the kind of the forces that they are beside, names, unknowns, and
    whether they have both signs."""

    kind: str
    names: tuple[str, ...]
    unknowns: Index
    pulls: bool

    def values(self, x: Array) -> dict[str, float]:
        """Impulses in the unknowns x, shape (n,), by name."""
        return dict(zip(self.names, x[self.unknowns].tolist(), strict=True))


def event_impulses(kind: str, names: Sequence[str], row: Index, *, pulls: bool) -> EventImpulses:
    """The impulses that there are in a row with a column for each name."""
    there = np.flatnonzero(row != NOWHERE).tolist()
    return EventImpulses(kind, tuple(names[j] for j in there), row[there], pulls)
