"""The contract between the symbolic layer and code generation: named inputs, named outputs,
expressions.

A :class:`KernelSpec` describes one function of a few small vectors.  Nothing in it is mechanics:
code generation prints, compiles and loads it without knowing what it means.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from dmoc.symbolic.graph import Graph, GraphNode
from dmoc.symbolic.pairs import with_shared_sums
from dmoc.symbolic.scalar import Scalar


@dataclass(frozen=True)
class Input:
    """A named vector argument; ``symbols`` stand for its components, of parameters ``design`` for
    those that a solver may choose."""

    name: str
    symbols: tuple[GraphNode, ...]
    design: tuple[GraphNode, ...] = ()

    @classmethod
    def vector(cls, graph: Graph, name: str, count: int) -> Input:
        """Make an input of ``count`` symbols ``name_0 .. name_{count-1}``."""
        return cls(name, tuple(graph.symbol(f"{name}_{i}") for i in range(count)))

    @property
    def size(self) -> int:
        return len(self.symbols)


@dataclass(frozen=True)
class Output:
    """A named result.

    ``shape`` is the shape of the full array.  ``entries`` lists the index of each stored value: all
    of them for a dense vector, the structural nonzeros for a matrix.  ``expressions`` are the
    stored values in the same order.
    """

    name: str
    shape: tuple[int, ...]
    entries: tuple[tuple[int, ...], ...]
    expressions: tuple[GraphNode, ...]

    @classmethod
    def vector(cls, name: str, expressions: Sequence[GraphNode]) -> Output:
        """Make a dense vector output."""
        size = len(expressions)
        return cls(
            name,
            (size,),
            tuple((i,) for i in range(size)),
            tuple(expressions),
        )

    @classmethod
    def matrix(
        cls, name: str, rows: Sequence[Sequence[GraphNode]], columns: int, upper: bool = False
    ) -> Output:
        """Make a sparse matrix output: entries that are identically zero are left out, as is a
        strict lower triangle when ``upper`` is set."""
        entries = []
        values = []
        for i, row in enumerate(rows):
            for j, value in enumerate(row):
                if (upper and j < i) or value is value.graph.zero:
                    continue
                entries.append((i, j))
                values.append(value)
        return cls(name, (len(rows), columns), tuple(entries), tuple(values))

    @property
    def size(self) -> int:
        return len(self.expressions)


@dataclass(frozen=True)
class KernelSpec:
    """One function: inputs, intermediate definitions (evaluated in order) and outputs."""

    name: str
    summary: str
    inputs: tuple[Input, ...]
    outputs: tuple[Output, ...]
    definitions: tuple[tuple[GraphNode, GraphNode], ...] = ()


@dataclass(frozen=True)
class FunctionSpec:
    """A function that kernels call: a scalar's derivatives ``paths``, of which the longest have
    ``order``, by its arguments."""

    function: Scalar
    order: int
    paths: tuple[tuple[int, ...], ...]

    @property
    def name(self) -> str:
        return f"{self.function.name}_{self.order}"

    @property
    def size(self) -> int:
        return len(self.paths)

    @property
    def constants(self) -> Input:
        return Input("par", self.function.constants)

    @cached_property
    def kernel(self) -> KernelSpec:
        """The function as a kernel of its arguments z and its results d."""
        values = with_shared_sums([self.function.derivative(path) for path in self.paths])
        inputs = (Input("z", self.function.symbols), self.constants)
        return KernelSpec(self.name, "", inputs, (Output.vector("d", values),))


@dataclass(frozen=True)
class ModelSpec:
    """All kernels of one model, and the plain facts about it that the numerical layers need
    (JSON types only)."""

    name: str
    fingerprint: str
    facts: dict[str, Any]
    kernels: tuple[KernelSpec, ...]
