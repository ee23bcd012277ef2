"""What every law is: bounds, rows of the program, the terms and entries that make them, and the
order in which they are eliminated.  Its unknowns and what they push are in its table
(:class:`~dmoc.program.layout.Layout`, :mod:`dmoc.program.reactions`).

A law keeps the blocks of its rows as attributes, by which everybody addresses them: ``laws.contact.
closed``.  Layout, transcription, factorisation and diagnosis go through all laws alike.
"""

from __future__ import annotations

from collections.abc import Collection, Hashable, Iterator
from copy import copy
from dataclasses import fields, is_dataclass
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Self

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.problem.problem import Problem
from dmoc.program.blocks import Block, Entries, Index, Numbering
from dmoc.program.layout import Layout
from dmoc.program.scale import Scale
from dmoc.program.terms import Places, Term

if TYPE_CHECKING:
    from dmoc.program.laws.laws import Laws

# Ranks of pivots within the time of one node.
INEQUALITY, INPUT, INSIDE, STATE, CONTACT, COLLISION, AT_REST = range(7)
RANKS = 7


class Pivot(NamedTuple):
    """Unknowns and the rows that determine them, in one shape, and where in the chain both can be
    eliminated, one key for each place of the first axis or one for all; NOWHERE for none.  Unknowns
    without rows are eliminated alone."""

    unknowns: Index
    rows: Index | None
    key: Index | int


class Edge(NamedTuple):
    """An edge of the mode of a phase, beyond which another mode may cost less.

    Attributes
    ----------
    name : str
        The contact or the rail.
    number : int
        Of the tangent that rubs otherwise beyond the edge, or of the surface that leaves.
    friction : tuple of two int, optional
        That of the tangent, and beyond the edge; None for a contact that leaves.
    active : array of int
        Numbers of the inequalities that are active at the edge, one for each step of the phase or
        for each of its stations; of the impulses that are at their bounds, of a contact that
        leaves.
    gives : array of int, shape (steps, n)
        Numbers of the equations of the stations in or after each step that give way.
    sign : float
        The direction in which they do.
    turning : array of int, optional
        Impulses that could turn, shape (steps, n); otherwise they give way by their sizes.
    """

    name: str
    number: int
    friction: tuple[int, int] | None
    active: Index
    gives: Index
    sign: float
    turning: Index | None = None


class Law:
    """A law contributes nothing unless it says so."""

    # Its arrays that are numbers: of the rows, only their factors depend on more than the kinds of
    # these.
    numbers: ClassVar[tuple[str, ...]] = ()

    def bounds(self, problem: Problem, box: Array, scale: Scale) -> None:
        """Put the bounds of the law's unknowns into ``box``, shape (n, 2), and those that it would
        leave no interior out of the way."""

    @property
    def facts(self) -> Hashable:
        """All that the law holds before its rows are numbered, but for its layout, its problem and
        other laws; of its numbers their kinds."""
        return _parts(self, self.numbers)

    def with_numbers(self, other: Self) -> Self:
        """The same rows with the numbers of a law of the same facts."""
        if self.values == other.values:
            return self
        changed = copy(self)
        for name in self.numbers:
            setattr(changed, name, getattr(other, name))
        return changed

    @property
    def values(self) -> tuple[bytes, ...]:
        """Its numbers."""
        return tuple(getattr(self, name).tobytes() for name in self.numbers)

    def settle(self, problem: Problem, limits: tuple[Array, Array]) -> None:
        """Note which rows the fixed values settle, that is unknowns whose lower and upper
        ``limits``, shape (n,) each, are equal: such rows are left out."""

    def equations(self, block: Numbering) -> None:
        """Number the rows c = 0 of the law, and keep their blocks."""

    def inequalities(self, block: Numbering) -> None:
        """Number the rows d >= 0 of the law, and keep their blocks."""

    def terms(self, places: Places, laws: Laws) -> list[Term]:
        """Terms of the rows that are not linear, of its own or of other laws, and of the cost."""
        return []

    def entries(self, laws: Laws) -> list[Entries]:
        """Entries of the linear rows, of its own or of other laws."""
        return []

    def constants(self) -> Iterator[tuple[int, float]]:
        """Rows that have a constant, and which."""
        yield from ()

    def edges(self, i: int) -> Iterator[Edge]:
        """Edges of the mode of phase i."""
        yield from ()

    def pivots(self, laws: Laws) -> Iterator[Pivot]:
        """Unknowns and the rows that determine them, in the order of the chain where keys are the
        same."""
        yield from ()

    def loose(self) -> Iterator[tuple[Index, Index]]:
        """Unknowns that the motion does not determine, since others have the same effect, and where
        in the chain they are eliminated, after what is determined there; shape (k,) each. NOWHERE
        stands for the final group."""
        yield from ()


def key(node: Index | int, rank: int) -> Index:
    """Place in the chain of what belongs to nodes, shape (...) as ``node``."""
    return np.asarray(node) * RANKS + rank


# What is no fact of one law: the same for all laws of a program, what functions of the kernels
# contain, or what follows from facts.
_ELSEWHERE = Problem, Layout, Scale, Block, Law, dict


def _parts(record: Any, numbers: Collection[str] = ()) -> Hashable:
    """The contents of the fields of a record that are set; of numbers their kinds."""
    named = ((field.name, getattr(record, field.name, None)) for field in fields(record))
    return tuple(_kinds(v) if name in numbers else _facts(v) for name, v in named)


def _kinds(values: Any) -> Hashable:
    """Which numbers are zero, which are larger, and which are infinite or none."""
    return np.isnan(values).tobytes(), np.isinf(values).tobytes(), np.sign(values).tobytes()


def _facts(value: Any) -> Hashable:
    """The contents of a value: of arrays, and of what is made of them and of plain values."""
    if isinstance(value, _ELSEWHERE):
        return None
    if isinstance(value, np.ndarray):
        return value.shape, value.tobytes()
    if isinstance(value, tuple):
        return tuple(map(_facts, value))
    return _parts(value) if is_dataclass(value) else value
