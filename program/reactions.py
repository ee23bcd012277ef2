"""What pushes along the phases of a motion: reactions of what is held, and friction.

A law says once what it pushes with and what it holds; initial guesses, other meshes and results go
through all reactions alike.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.mechanics.model import Model
from dmoc.program.blocks import NOWHERE, Bools, Index


class Functions(NamedTuple):
    """Functions of places of a model, their slopes in (q, t), and their rates."""

    values: Callable[[Model, Array, Array], Array]
    slopes: Callable[[Model, Array, Array], Array]
    rates: Callable[[Model, Array, Array, Array], Array]


GAPS = Functions(Model.gaps, Model.gap_slopes, Model.gap_rates)
TANGENTS = Functions(Model.tangents, Model.tangent_slopes, Model.slide_rates)


@dataclass(frozen=True, eq=False)
class PhaseReaction:
    """Impulses at the nodes of a phase that push along the slopes of functions.

    Attributes
    ----------
    kind : str
        Of the forces of a phase: "normal", "tangential".
    functions : Functions
    columns : tuple of int
        Those of the functions that push, m of them; ``names`` are theirs.
    unknowns : array of int, shape (steps + 1, m)
        Impulses at the nodes.
    sign : float
        They change the momentum by sign * impulse * slope.
    holds : array of bool, shape (m,)
        Functions whose rates vanish.
    in_place : bool
        What holds is zero; otherwise it keeps its value of the first node.
    pulls : bool
        Impulses of both signs.
    """

    kind: str
    names: tuple[str, ...]
    functions: Functions
    columns: tuple[int, ...]
    unknowns: Index
    sign: float
    holds: Bools
    in_place: bool
    pulls: bool

    @property
    def held(self) -> list[int]:
        return [c for c, holds in zip(self.columns, self.holds, strict=True) if holds]

    def impulses(self, x: Array) -> Array:
        """Those of the unknowns x, shape (steps + 1, m)."""
        return np.asarray(x[self.unknowns])

    def slopes(self, model: Model, q: Array, t: Array) -> Array:
        """Slopes in q of all that push, shape (n, m, nq)."""
        return np.asarray(self.functions.slopes(model, q, t)[:, list(self.columns), :-1])

    def misses(self, model: Model, q: Array, t: Array) -> Array:
        """How far positions along the phase are from where it holds them, shape (n, held)."""
        values = self.functions.values(model, q, t)[:, self.held]
        return np.asarray(values if self.in_place else values - values[:1])

    def rates(self, model: Model, q: Array, v: Array, t: Array) -> Array:
        """Rates of what it holds, shape (n, held)."""
        return np.asarray(self.functions.rates(model, q, v, t)[:, self.held])


class EventImpulses(NamedTuple):
    """Impulses at an event: the kind of the forces that they are beside, names, unknowns, and
    whether they have both signs."""

    kind: str
    names: tuple[str, ...]
    unknowns: Index
    pulls: bool

    def values(self, x: Array) -> dict[str, float]:
        """Those of the unknowns x, by name."""
        return dict(zip(self.names, x[self.unknowns].tolist(), strict=True))


def event_impulses(kind: str, names: Sequence[str], row: Index, *, pulls: bool) -> EventImpulses:
    """The impulses that there are in a row with a column for each name."""
    there = np.flatnonzero(row != NOWHERE).tolist()
    return EventImpulses(kind, tuple(names[j] for j in there), row[there], pulls)


def place(steps: tuple[int, ...], row: int) -> str:
    """The node and the phase of a row of phase nodes."""
    phase = int(np.searchsorted(np.cumsum([n + 1 for n in steps]), row, side="right"))
    return f"at node {phase_nodes(steps)[row]} in phase {phase}"


def phase_nodes(steps: tuple[int, ...]) -> Index:
    """The node of each node of each phase; those that two phases share come twice."""
    ends = np.concatenate([[0], np.cumsum(steps)])
    return np.concatenate([np.arange(a, b + 1) for a, b in pairwise(ends)])


def rows_of_phase(steps: tuple[int, ...], i: int) -> slice:
    """Rows of phase nodes that belong to phase i."""
    first = sum(steps[:i]) + i
    return slice(first, first + steps[i] + 1)


def node_shares(steps: int) -> Array:
    """What each node of a phase stands for, in steps."""
    return np.concatenate([[0.5], np.ones(steps - 1), [0.5]])
