"""The contract between the symbolic layer and code generation: named inputs, named outputs,
expressions.

A :class:`KernelSpec` describes one function of a few small vectors.  Nothing in it is mechanics:
code generation prints, compiles and loads it without knowing what it means.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import symengine as se

Expression = Any  # a SymEngine expression; SymEngine ships no type information

# The functions that expressions may contain beside +, *, powers, numbers, pi, e and Piecewise: each
# printer knows them all.
FUNCTIONS = frozenset(
    "sin cos tan asin acos atan atan2 sinh cosh tanh asinh acosh atanh log".split()
)


@dataclass(frozen=True)
class Input:
    """A named vector argument; ``symbols`` stand for its components."""

    name: str
    symbols: tuple[Expression, ...]

    @classmethod
    def vector(cls, name: str, size: int) -> Input:
        """Make an input of ``size`` fresh symbols ``name_0 .. name_{size-1}``."""
        return cls(name, tuple(se.Symbol(f"{name}_{i}") for i in range(size)))

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
    expressions: tuple[Expression, ...]

    @classmethod
    def vector(cls, name: str, expressions: Sequence[Expression]) -> Output:
        """Make a dense vector output."""
        size = len(expressions)
        return cls(
            name,
            (size,),
            tuple((i,) for i in range(size)),
            tuple(se.sympify(e) for e in expressions),
        )

    @classmethod
    def matrix(
        cls, name: str, rows: Sequence[Sequence[Expression]], columns: int, upper: bool = False
    ) -> Output:
        """Make a sparse matrix output: entries that are identically zero are left out, as is a
        strict lower triangle when ``upper`` is set."""
        entries = []
        values = []
        for i, row in enumerate(rows):
            for j, value in enumerate(row):
                value = se.sympify(value)
                if (upper and j < i) or value == 0:
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
    definitions: tuple[tuple[Expression, Expression], ...] = ()


@dataclass(frozen=True)
class ModelSpec:
    """All kernels of one model, and the plain facts about it that the numerical layers need
    (JSON types only)."""

    name: str
    fingerprint: str
    facts: dict[str, Any]
    kernels: tuple[KernelSpec, ...]
