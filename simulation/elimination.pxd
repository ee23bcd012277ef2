# cython: language_level=3
"""Gaussian elimination of small dense matrices in place."""
from libc.math cimport fabs, isfinite


cdef inline bint factor(double *A, ptrdiff_t *pivot, ptrdiff_t n) noexcept nogil:
    """Factors of A (n, n) by elimination with row exchanges pivot[n], in place; False if A is
    singular."""
    cdef ptrdiff_t i, j, k, best
    cdef double swap
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if fabs(A[i * n + k]) > fabs(A[best * n + k]):
                best = i
        if not (fabs(A[best * n + k]) > 0 and isfinite(A[best * n + k])):
            return False
        pivot[k] = best
        if best != k:
            for j in range(n):
                swap = A[k * n + j]; A[k * n + j] = A[best * n + j]; A[best * n + j] = swap
        for i in range(k + 1, n):
            A[i * n + k] /= A[k * n + k]
            for j in range(k + 1, n):
                A[i * n + j] -= A[i * n + k] * A[k * n + j]
    return True


cdef inline void solve(
    const double *LU, const ptrdiff_t *pivot, double *B, ptrdiff_t n, ptrdiff_t columns
) noexcept nogil:
    """Solve A X = B in place, B of shape (n, columns)."""
    cdef ptrdiff_t i, k, c
    cdef double swap
    for k in range(n):
        if pivot[k] != k:
            for c in range(columns):
                swap = B[k * columns + c]
                B[k * columns + c] = B[pivot[k] * columns + c]
                B[pivot[k] * columns + c] = swap
    for k in range(n):
        for i in range(k + 1, n):
            for c in range(columns):
                B[i * columns + c] -= LU[i * n + k] * B[k * columns + c]
    for k in range(n - 1, -1, -1):
        for i in range(k + 1, n):
            for c in range(columns):
                B[k * columns + c] -= LU[k * n + i] * B[i * columns + c]
        for c in range(columns):
            B[k * columns + c] /= LU[k * n + k]
