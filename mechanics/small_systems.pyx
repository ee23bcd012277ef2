# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, binding=False
"""Small linear systems and matrices, one after the other: calls of LAPACK and of NumPy for each take
several times as long as their numbers."""
from libc.math cimport INFINITY, NAN, fabs, isfinite, isnan, sqrt

from elimination cimport factor, largest_column, solve, squares, turn_columns

import numpy as np


def solved(A, b):
    """A^-1 b for a matrix A (n, n) and b (n,) or (n, m), or for stacks of them, where b has the
    shape of the stack and (n,), or (n, m); not a number where any A is singular or where any number
    is not finite."""
    cdef ptrdiff_t n = A.shape[A.ndim - 1], columns = 1
    if b.ndim == 1 or b.ndim == A.ndim - 1:
        fits = b.shape == A.shape[:-1]
    else:
        fits = b.shape[:-1] == A.shape[:-1]
        columns = b.shape[b.ndim - 1]
    if not fits or A.shape[A.ndim - 2] != n:
        raise ValueError(f"matrices of shape {A.shape} and numbers of shape {b.shape} do not fit")
    factors, x = np.array(A, float, order="C"), np.array(b, float, order="C")
    if x.size and not _solve(factors.reshape(-1), x.reshape(-1), np.empty(n, np.intp), columns):
        x[...] = np.nan
    return x


cdef bint _solve(double[::1] A, double[::1] b, ptrdiff_t[::1] pivot, ptrdiff_t columns):
    """Solve one system after the other in place, and say whether all could be."""
    cdef ptrdiff_t n = pivot.shape[0], count = A.shape[0] // (n * n), i
    for i in range(A.shape[0]):
        if not isfinite(A[i]):
            return False
    for i in range(b.shape[0]):
        if not isfinite(b[i]):
            return False
    for i in range(count):
        if n == 2 and columns == 1:  # constant numbers unroll the loops
            if not factor(&A[4 * i], &pivot[0], 2, 2):
                return False
            solve(&A[4 * i], &pivot[0], &b[2 * i], 2, 2, 1)
            continue
        if not factor(&A[n * n * i], &pivot[0], n, n):
            return False
        solve(&A[n * n * i], &pivot[0], &b[n * columns * i], n, n, columns)
    return True


def products_from(matrices):
    """The products (n + 1, m, m) of the last of n matrices (m, m) back to each of them, and the
    identity."""
    cdef const double[:, :, ::1] A = np.ascontiguousarray(matrices, float)
    cdef ptrdiff_t n = A.shape[0], m = A.shape[1], k, i, j, c
    cdef double total
    if A.shape[2] != m:
        raise ValueError(f"expected square matrices, got {m} by {A.shape[2]}")
    products = np.empty((n + 1, m, m))
    products[n] = np.eye(m)
    cdef double[:, :, ::1] P = products
    with nogil:
        for k in range(n - 1, -1, -1):
            for i in range(m):
                for j in range(m):
                    total = 0.0
                    for c in range(m):
                        total += P[k + 1, i, c] * A[k, c, j]
                    P[k, i, j] = total
    return products


def largest_stretch(matrices):
    """The largest singular value of matrices (n, m, m); infinite where a number is not finite."""
    cdef double size = np.abs(matrices).max(initial=0.0), most = 0.0, total
    if not 0 < size < INFINITY:
        return size if size == 0 else INFINITY
    copy = np.ascontiguousarray(matrices / size, float)
    cdef double[:, :, ::1] A = copy
    cdef ptrdiff_t n = A.shape[0], m = A.shape[1], k
    if A.shape[2] != m:
        raise ValueError(f"expected square matrices, got {m} by {A.shape[2]}")
    with nogil:
        for k in range(n):
            total = squares(&A[k, 0, 0], m * m)
            if total > most * most:  # else it has no singular value that large
                turn_columns(&A[k, 0, 0], NULL, m, total)
                most = max(most, sqrt(largest_column(&A[k, 0, 0], m)))
    return size * most


def most_of(rows):
    """The largest absolute values of the columns of rows (n, ...); not a number where one is
    none."""
    cdef const double[:, ::1] A = np.ascontiguousarray(rows, float).reshape(len(rows), -1)
    cdef ptrdiff_t n = A.shape[0], m = A.shape[1], i, j
    most = np.zeros(m)
    cdef double[::1] largest = most
    with nogil:
        for i in range(n):
            for j in range(m):
                if not fabs(A[i, j]) <= largest[j]:
                    largest[j] = NAN if isnan(largest[j]) else fabs(A[i, j])
    return most.reshape(rows.shape[1:])


def largest_form(v, M):
    """The largest v . M v of rows v (n, m) and matrices M (n, m, m); not a number where one is
    none."""
    cdef const double[:, ::1] x = np.ascontiguousarray(v, float)
    cdef const double[:, :, ::1] A = np.ascontiguousarray(M, float)
    cdef ptrdiff_t n = x.shape[0], m = x.shape[1], k, i, j
    cdef double most = -INFINITY, form
    if not (A.shape[0] == n and A.shape[1] == A.shape[2] == m):
        raise ValueError(f"expected {n} matrices of {m} rows and columns")
    with nogil:
        for k in range(n):
            form = 0.0
            for i in range(m):
                for j in range(m):
                    form += x[k, i] * A[k, i, j] * x[k, j]
            if not form <= most:
                most = NAN if isnan(most) else form
    return most


def reached(slopes, sizes, M):
    """What motions of some sizes (k, n) make of functions with slopes (m, n) at most, |slopes|
    sizes, shape (k, m); and C . M^-1 C of each slope C by the masses M (n, n), shape (m,), which is
    not a number where M is singular or not finite."""
    cdef const double[:, ::1] C = np.ascontiguousarray(slopes, float)
    cdef const double[:, ::1] by = np.ascontiguousarray(sizes, float)
    cdef ptrdiff_t m = C.shape[0], n = C.shape[1], k = by.shape[0], i, j, c
    if not (by.shape[1] == n and M.shape == (n, n)):
        raise ValueError(f"expected sizes and masses of {n} coordinates")
    most, squares_by_mass = np.zeros((k, m)), np.full(m, NAN)
    cdef double[:, ::1] out = most
    cdef double[::1] square = squares_by_mass, LU = np.array(M, float, order="C").reshape(-1)
    cdef double[::1] pushed = np.empty(n)
    cdef ptrdiff_t[::1] pivot = np.empty(n, np.intp)
    cdef bint regular = isfinite(squares(&LU[0], n * n)) and factor(&LU[0], &pivot[0], n, n)
    for i in range(m):
        for c in range(k):
            for j in range(n):
                out[c, i] += fabs(C[i, j]) * by[c, j]
        if not regular:
            continue
        square[i] = 0.0
        pushed[:] = C[i]
        solve(&LU[0], &pivot[0], &pushed[0], n, n, 1)
        for j in range(n):
            square[i] += C[i, j] * pushed[j]
    return most, squares_by_mass
