"""Sparse matrices whose pattern is analysed once and whose values are added up from element contributions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse
from numpy.typing import ArrayLike, NDArray


class SparsePattern:
    """A CSR pattern made of blocks of contributions, in the order in which they were added."""

    def __init__(self, shape: tuple[int, int], blocks: Sequence[tuple[ArrayLike, ArrayLike]]) -> None:
        rows, columns = [], []
        for r, c in blocks:
            row, column = np.broadcast_arrays(np.asarray(r, dtype=np.int64), np.asarray(c, dtype=np.int64))
            rows.append(row.ravel())
            columns.append(column.ravel())
        row = np.concatenate(rows) if rows else np.zeros(0, dtype=np.int64)
        column = np.concatenate(columns) if columns else np.zeros(0, dtype=np.int64)
        keys, self._slot = np.unique(row * shape[1] + column, return_inverse=True)
        self.shape = shape
        self._indices: NDArray[np.int32] = (keys % shape[1]).astype(np.int32)
        counts = np.bincount(keys // shape[1], minlength=shape[0])
        self._indptr: NDArray[np.int32] = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)

    def matrix(self, values: Sequence[ArrayLike]) -> scipy.sparse.csr_matrix:
        """Add up the contributions of all blocks, given in the same order."""
        flat = [np.asarray(v, dtype=float).ravel() for v in values]
        data = np.bincount(self._slot, weights=np.concatenate(flat) if flat else None, minlength=len(self._indices)).astype(float)
        matrix = scipy.sparse.csr_matrix(self.shape)
        matrix.data, matrix.indices, matrix.indptr = data, self._indices, self._indptr
        matrix.has_canonical_format = True
        return matrix
