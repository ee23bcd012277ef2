"""Small linear systems that never raise and never let LAPACK write: what has no finite solution
is not a number."""

from __future__ import annotations

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.mechanics.small_systems import largest_stretch as largest_stretch
from dmoc.mechanics.small_systems import products_from as products_from
from dmoc.mechanics.small_systems import solved as solved

# What rounding leaves of a smallest eigenvalue that is zero, of a matrix with ones on its diagonal.
DEFINITE = 1e-14


def solved_transpose(M: Array, B: Array) -> Array:
    """M^-1 B^T (..., nq, m) for rows B (..., m, nq); not a number as in :func:`solved`."""
    return solved(M, np.ascontiguousarray(np.swapaxes(B, -1, -2)))


def is_positive(M: Array) -> bool:
    """Whether a symmetric matrix is positive definite beyond rounding errors, whatever the units of
    its rows: that of D M D with D = diag(M)^(-1/2) is."""
    diagonal = np.diagonal(M)
    if not (np.isfinite(M).all() and (diagonal > 0).all()):
        return False
    root = np.sqrt(diagonal)
    return bool(np.linalg.eigvalsh(M / root[:, None] / root)[0] > DEFINITE)


def least_squares(A: Array, b: Array) -> Array:
    """The shortest x of least |A x - b|; not a number where A or b is not finite or the
    decomposition fails."""
    nothing = np.full((A.shape[1], *b.shape[1:]), np.nan)
    if not (np.isfinite(A).all() and np.isfinite(b).all()):
        return nothing
    try:
        return np.asarray(np.linalg.lstsq(A, b, rcond=None)[0])
    except np.linalg.LinAlgError:
        return nothing
