# cython: language_level=3
"""Gaussian elimination of small dense matrices in place."""
from libc.math cimport fabs, isfinite


cdef inline bint factor(double *A, ptrdiff_t *pivot, ptrdiff_t n, ptrdiff_t stride) noexcept nogil:
    """Factors of A (n, n), whose rows lie ``stride`` apart, by elimination with row exchanges
    pivot[n], in place; False if A is singular."""
    cdef ptrdiff_t i, j, k, best
    cdef double swap
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if fabs(A[i * stride + k]) > fabs(A[best * stride + k]):
                best = i
        if not (fabs(A[best * stride + k]) > 0 and isfinite(A[best * stride + k])):
            return False
        pivot[k] = best
        if best != k:
            for j in range(n):
                swap = A[k * stride + j]; A[k * stride + j] = A[best * stride + j]; A[best * stride + j] = swap
        for i in range(k + 1, n):
            A[i * stride + k] /= A[k * stride + k]
            for j in range(k + 1, n):
                A[i * stride + j] -= A[i * stride + k] * A[k * stride + j]
    return True


cdef inline void solve(
    const double *LU, const ptrdiff_t *pivot, double *B, ptrdiff_t n, ptrdiff_t stride,
    ptrdiff_t columns
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
                B[i * columns + c] -= LU[i * stride + k] * B[k * columns + c]
    for k in range(n - 1, -1, -1):
        for i in range(k + 1, n):
            for c in range(columns):
                B[k * columns + c] -= LU[k * stride + i] * B[i * columns + c]
        for c in range(columns):
            B[k * columns + c] /= LU[k * stride + k]
