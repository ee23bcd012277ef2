"""Sparse matrices whose pattern is analysed once: contributions to one entry share its slot."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dmoc.codegen.kernels import Array
from dmoc.program.assembly import pattern, transposed_product
from dmoc.program.blocks import Index

if TYPE_CHECKING:
    import scipy.sparse


class SparsePattern:
    """A CSR pattern (``indptr``, ``indices``) made of contributions (row, column), given in groups;
    a negative row stands for none. ``slots`` has for each group, in its shape, the entry that each
    contribution is added to, -1 for none."""

    def __init__(self, shape: tuple[int, int], groups: Sequence[tuple[Index, Index]]) -> None:
        none = np.zeros(0, dtype=np.intp)
        rows, columns = (
            np.concatenate([none, *(part.ravel() for part in parts)])
            for parts in (zip(*groups, strict=True) if groups else ((), ()))
        )
        starts, entries, slots = pattern(rows, columns, *shape)
        self.shape = shape
        self.indptr: NDArray[np.int32] = starts
        self.indices: NDArray[np.int32] = entries
        self.slots = list[Index]()
        at = 0
        for row, _ in groups:
            self.slots.append(slots[at : at + row.size].reshape(row.shape))
            at += row.size

    @property
    def size(self) -> int:
        return len(self.indices)

    def matrix(
        self, values: Array, first: int = 0, last: int | None = None
    ) -> scipy.sparse.csr_matrix:
        """Return rows first to last with the given values of all entries, shape (entries,)."""
        import scipy.sparse  # here, because the compiled method does without SciPy

        last = self.shape[0] if last is None else last
        a, b = self.indptr[first], self.indptr[last]
        matrix = scipy.sparse.csr_matrix((last - first, self.shape[1]))
        matrix.data, matrix.indices, matrix.indptr = (
            values[a:b],
            self.indices[a:b],
            self.indptr[first : last + 1] - a,
        )
        matrix.has_canonical_format = True
        return matrix

    def transposed_times(self, values: Array, y: Array) -> Array:
        """A' y of the matrix A with the given values of all entries."""
        return transposed_product(self.indptr, self.indices, values, y, self.shape[1])
