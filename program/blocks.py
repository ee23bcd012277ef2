"""What unknowns and rows have in common: blocks of one kind, numbered in the order they are
declared."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from dmoc.base.records import record
from dmoc.codegen.kernels import Array
from dmoc.mechanics.contacts import NOWHERE as NOWHERE
from dmoc.program.bound_kinds import BoundKind
from dmoc.program.scale import Scale

Index = NDArray[np.intp]
Bools = NDArray[np.bool_]
# Linear entries: rows, unknowns and factors.
Entries: TypeAlias = tuple[Index, Index, Array]
# Names the one at some place of a block, as `label(node, coordinate)`.
Label: TypeAlias = Callable[..., str]
# Prices of rows that do not hold, relative to that of missing the goal: of what limits the motion,
# and of the laws of motion.
GOAL, LIMIT, LAW = 1.0, 10.0, 1000.0
# Typical sizes of a block's members, of its shape or of one that is broadcast to it.
Size: TypeAlias = Callable[[Scale], Array | float]


def no_unit(*_: int) -> str:
    return ""


def seconds(*_: int) -> str:
    return "s"


class Missed(NamedTuple):
    """How a row that does not hold is reported.

    Attributes
    ----------
    price : float
    words : callable, optional
        Sentence about the row at a place; unless given, the row's name is said to be violated.
    unit : callable
        The unit of its amount, "" for none.
    apart : int, optional
        The axis along which each row is reported by itself; else the worst of all.
    """

    price: float = LIMIT
    words: Label | None = None
    unit: Label = no_unit
    apart: int | None = None


PLAIN = Missed()


class Counted(NamedTuple):
    """What is said of active bounds and rows of which there are some for every node or step: their
    kind, the names along the second axis, once for each quadrature point, and the nodes or steps
    along the first one."""

    kind: BoundKind
    names: Sequence[str]
    places: Index


@record(frozen=True, eq=False)
class Block:
    """Unknowns or rows of one kind.

    Attributes
    ----------
    name : str
    index : array of int
        Their numbers, in the shape that is natural for the kind; NOWHERE where there is none.
    label : callable
        Name of the one at a place of that shape, in the user's words.
    size : callable
        Typical sizes, from those of the problem's quantities.
    nodes : array of int, optional
        The node at which each row of ``index`` stands, for what follows the chain of steps.
    missed : Missed
    counted : Counted, optional
    """

    name: str
    index: Index
    label: Label
    size: Size
    nodes: Index | None = None
    missed: Missed = PLAIN
    counted: Counted | None = None

    @cached_property
    def numbers(self) -> Index:
        """The numbers of all members, in order, shape (count,)."""
        return np.asarray(self.index[self.index != NOWHERE])

    @cached_property
    def count(self) -> int:
        return len(self.numbers)

    def name_of(self, member: int) -> str:
        """Name of a member, counted among those of the block."""
        return self.label(*map(int, self.places[member]))

    @cached_property
    def places(self) -> Index:
        """Places of all members in the block's shape, shape (count, dimensions of ``index``)."""
        return np.argwhere(self.index != NOWHERE)

    def sizes(self, scale: Scale) -> Array:
        """Typical sizes of all members, shape (count,)."""
        return Spread()((self,), scale)

    def again(self, label: Label, size: Size, missed: Missed, counted: Counted | None) -> Block:
        """A block of the same members, of which something else is said."""
        other = object.__new__(Block)
        vars(other).update(vars(self), label=label, size=size, missed=missed, counted=counted)
        return other


class Spread:
    """Typical sizes of the members of blocks, of which each block has few: which of these each
    member has is the same for all blocks of the same members, and is found once."""

    def __init__(self) -> None:
        self._places: Index | None = None

    def __call__(self, blocks: Sequence[Block], scale: Scale) -> Array:
        """Sizes of all members of some blocks, one block after the other, shape (..., members); a
        scale of several problems has their leading axis."""
        there, lead = [block for block in blocks if block.count], np.shape(scale.time)
        few = [np.asarray(block.size(scale), dtype=float) for block in there]
        if self._places is None:
            self._places = self._found(there, few)
        every = [part.reshape(*lead, -1) for part in few]
        return np.concatenate([*every, np.zeros((*lead, 0))], axis=-1).take(self._places, axis=-1)

    def _found(self, blocks: Sequence[Block], few: Sequence[Array]) -> Index:
        places, first = [np.zeros(0, np.intp)], 0
        for block, sizes in zip(blocks, few, strict=True):
            numbers = first + np.arange(sizes.size).reshape(sizes.shape)
            places.append(np.broadcast_to(numbers, block.index.shape)[block.index != NOWHERE])
            first += sizes.size
        return np.concatenate(places)


class Numbering:
    """Makes blocks whose numbers follow each other, or are those of blocks ``like`` which they
    are."""

    def __init__(self, first: int = 0, like: Sequence[Block] = ()) -> None:
        self.next, self.like = first, like
        self.made: list[Block] = []

    def __call__(
        self,
        name: str,
        where: tuple[int, ...] | Bools,
        label: Label,
        size: Size,
        nodes: Index | None = None,
        *,
        missed: Missed = PLAIN,
        counted: Counted | None = None,
    ) -> Block:
        """A block of a shape, or of a mask whose False members do not exist; its members are
        remembered by its name, which no other block has."""
        if self.like:
            self.made.append(self.like[len(self.made)].again(label, size, missed, counted))
            return self.made[-1]
        if any(block.name == name for block in self.made):
            raise ValueError(f"two blocks are called {name!r}: multipliers are kept by these names")
        if isinstance(where, tuple):
            count = math.prod(where)
            index = np.arange(self.next, self.next + count).reshape(where)
        else:
            count = int(where.sum())
            index = np.full(where.shape, NOWHERE)
            index[where] = np.arange(self.next, self.next + count)
        self.next += count
        self.made.append(Block(name, index, label, size, nodes, missed, counted))
        return self.made[-1]


def mask_of(count: int, numbers: Sequence[int] | Index) -> Bools:
    """Mask of shape (count,) that is True at some ``numbers``."""
    mask = np.zeros(count, dtype=bool)
    mask[list(numbers)] = True
    return mask


def two_sided(mask: Bools) -> Bools:
    """A mask with a last axis for two sides."""
    return np.repeat(mask[..., None], 2, axis=-1)


def in_columns(values: Index, at: Index, count: int, otherwise: int = NOWHERE) -> Index:
    """Values of the events in the columns of their contacts, shape (events, ..., count); an event
    without a contact has no value."""
    columns = np.full((*values.shape, count), otherwise)
    filled = np.flatnonzero(at != NOWHERE)
    columns[filled, ..., at[filled]] = values[filled]
    return columns


def sizes_of(sizes: Array, surfaces: Index) -> Array:
    """Sizes of the surfaces of events, shape (..., events), from those of all surfaces, shape (...,
    nc), and the surface of each event, shape (events,); 1 where there is none."""
    if not sizes.shape[-1]:
        return np.ones((*sizes.shape[:-1], len(surfaces)))
    return np.where(surfaces == NOWHERE, 1.0, sizes[..., surfaces])
