"""Linear systems that never raise and never let LAPACK write: what has no finite solution is not a
number."""

from __future__ import annotations

import numpy as np

from dmoc.base.tolerances import DEPENDENT
from dmoc.codegen.kernels import Array
from dmoc.mechanics.small_systems import largest_form as largest_form
from dmoc.mechanics.small_systems import largest_stretch as stretch_of_small
from dmoc.mechanics.small_systems import most_of as most_of
from dmoc.mechanics.small_systems import products_from as products_from
from dmoc.mechanics.small_systems import reached as reached
from dmoc.mechanics.small_systems import solved as solved_small

# Unknowns of a system, and rows of a matrix with singular values, up to which calling LAPACK takes
# longer than the numbers do here.
SMALL, SMALLEST = 12, 6
# Determinant, measured by the sizes of its rows and columns, of conditions that are far from
# depending on each other.
REGULAR = 1e-6
# What rounding leaves of a smallest eigenvalue that is zero, of a matrix with ones on its diagonal.
DEFINITE = 1e-14


def solved(A: Array, b: Array) -> Array:
    """A^-1 b for a matrix (m, m) and a vector (m,) or columns (m, k), or row by row for stacks (n,
    m, m) and (n, m). It is not a number where A is singular or not finite."""
    fits = A.shape[:-1] in (b.shape, b.shape[:-1])  # NumPy repeats one beside others
    if A.shape[-1] <= SMALL and fits:
        return solved_small(A, b)
    stacked = b.ndim == A.ndim - 1 and A.ndim > 2
    right = b[..., None] if stacked else b
    if not (np.isfinite(A).all() and np.isfinite(b).all()):
        return np.full(b.shape, np.nan)
    try:
        x = np.linalg.solve(A, right)
    except np.linalg.LinAlgError:
        return np.full(b.shape, np.nan)
    return np.asarray(x[..., 0] if stacked else x)


def largest_stretch(matrices: Array) -> float:
    """The largest singular value of matrices (n, m, m); infinite where a number is not finite."""
    if matrices.shape[-1] <= SMALLEST:
        return stretch_of_small(matrices)
    if not np.isfinite(matrices).all():
        return np.inf
    return float(np.linalg.svd(matrices, compute_uv=False).max(initial=0.0))


def solved_transpose(M: Array, B: Array) -> Array:
    """M^-1 B^T (..., nq, m) for rows B (..., m, nq); not a number as in :func:`solved`."""
    return solved(M, np.ascontiguousarray(np.swapaxes(B, -1, -2)))


def is_positive(M: Array) -> bool:
    """Whether a symmetric matrix, shape (m, m), is positive definite beyond rounding errors,
    whatever the units of its rows: whether D M D with D = diag(M)^(-1/2) is."""
    diagonal = np.diagonal(M)
    if not (np.isfinite(M).all() and (diagonal > 0).all()):
        return False
    root = np.sqrt(diagonal)
    return bool(np.linalg.eigvalsh(M / root[:, None] / root)[0] > DEFINITE)


def least_squares(A: Array, b: Array) -> Array:
    """The shortest x of least |A x - b| for A (m, n): x (n,) for b (m,), or columns (n, k) for (m,
    k). It is not a number where A or b is not finite or the decomposition fails."""
    nothing = np.full((A.shape[1], *b.shape[1:]), np.nan)
    if not (np.isfinite(A).all() and np.isfinite(b).all()):
        return nothing
    try:
        return np.asarray(np.linalg.lstsq(A, b, rcond=None)[0])
    except np.linalg.LinAlgError:
        return nothing


def multipliers(A: Array, size: Array, b: Array) -> Array:
    """The shortest solutions (n, m) of A lam = b for matrices (n, m, m) and b (n, m), with rows and
    columns of some sizes (n, m). They are not numbers where there is none."""
    scaled, right = A / size[:, :, None] / size[:, None, :], b / size
    good = np.isfinite(scaled).all(axis=(1, 2)) & np.isfinite(right).all(axis=1)
    lam = np.full(b.shape, np.nan)
    lam[good] = _shortest(scaled[good], right[good]) / size[good]
    return lam


def _shortest(A: Array, b: Array) -> Array:
    """The shortest solutions of A lam = b for finite numbers, whose rows and columns have the size
    1."""
    if (np.abs(np.linalg.det(A)) > REGULAR).all():
        return np.asarray(np.linalg.solve(A, b[..., None])[..., 0])
    return np.asarray((np.linalg.pinv(A, rcond=DEPENDENT**2) @ b[..., None])[..., 0])
