# cython: language_level=3
"""Small dense linear systems in place: elimination, the shortest solution where that fails, and
singular values."""
from libc.math cimport NAN, copysign, fabs, isfinite, sqrt


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


cdef inline double squares(const double *A, ptrdiff_t count) noexcept nogil:
    """The sum of squares; not a finite number where one of them is none."""
    cdef ptrdiff_t i
    cdef double total = 0.0
    for i in range(count):
        total += A[i] * A[i]
    return total


cdef inline void turn_columns(double *A, double *V, ptrdiff_t n, double total) noexcept nogil:
    """Turn the columns of A (n, n), whose squares are ``total``, and those of V with them unless it
    is NULL, until they are orthogonal (Jacobi's rotations, Hestenes 1958)."""
    cdef ptrdiff_t i, j, k, sweep
    cdef double p, q, r, t, c, s
    cdef bint turned = True
    for sweep in range(30):
        if not turned:
            break
        turned = False
        for i in range(n):
            for j in range(i + 1, n):
                p = q = r = 0.0
                for k in range(n):
                    p += A[k * n + i] * A[k * n + i]
                    q += A[k * n + j] * A[k * n + j]
                    r += A[k * n + i] * A[k * n + j]
                # Columns that rounding leaves of nothing are orthogonal to all.
                if fabs(r) <= 1e-15 * sqrt(p * q) or p <= 1e-31 * total or q <= 1e-31 * total:
                    continue
                turned = True
                t = (q - p) / (2 * r)
                t = copysign(1 / (fabs(t) + sqrt(1 + t * t)), t)
                c = 1 / sqrt(1 + t * t)
                s = c * t
                for k in range(n):
                    p, q = A[k * n + i], A[k * n + j]
                    A[k * n + i], A[k * n + j] = c * p - s * q, s * p + c * q
                    if V != NULL:
                        p, q = V[k * n + i], V[k * n + j]
                        V[k * n + i], V[k * n + j] = c * p - s * q, s * p + c * q


cdef inline double largest_column(const double *A, ptrdiff_t n) noexcept nogil:
    """The largest sum of squares of a column of A (n, n)."""
    cdef ptrdiff_t j, k
    cdef double p, largest = 0.0
    for j in range(n):
        p = 0.0
        for k in range(n):
            p += A[k * n + j] * A[k * n + j]
        largest = p if p > largest else largest
    return largest


cdef inline void shortest(
    double *A, double *V, double *b, double *x, ptrdiff_t n, double least
) noexcept nogil:
    """The shortest solution of least |A x - b|, into b, for A (n, n): columns are turned until they
    are orthogonal; singular values below the share ``least`` of the largest count as zero.
    V (n, n) and x (n,) are room; not a number where A or b is none."""
    cdef ptrdiff_t i, j, k
    cdef double p, r, total = squares(A, n * n), largest
    for i in range(n * n):
        V[i] = 1.0 if i % (n + 1) == 0 else 0.0
    for i in range(n):
        if not (isfinite(b[i]) and isfinite(total)):
            total = NAN
    if not isfinite(total):
        for i in range(n):
            b[i] = NAN
        return
    turn_columns(A, V, n, total)
    for k in range(n):
        x[k] = 0.0
    largest = largest_column(A, n)
    for j in range(n):
        p = r = 0.0
        for k in range(n):
            p += A[k * n + j] * A[k * n + j]
            r += A[k * n + j] * b[k]
        if p > least * least * largest:
            for k in range(n):
                x[k] += V[k * n + j] * r / p
    for k in range(n):
        b[k] = x[k]
