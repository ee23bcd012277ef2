"""What holds a point, the signs of K there (curvature.py), and what a barrier has left of the cost
(kkt.py)."""


def holding(
    const double[::1] x, const double[::1] lower, const double[::1] upper, const double[::1] z,
    const double[::1] d, const double[::1] w, ptrdiff_t equations, double cost, *,
    double clearly, double noise,
):
    """Masks of the unknowns at bounds and of the rows (c | d) that hold x, the equations among
    them, and of those that may.  A multiplier, relative to the cost, that is ``clearly`` times the
    distance and above the ``noise`` says that they do; the other way round, that they do not.
    Fixed unknowns are in none of both."""
    cdef ptrdiff_t n = x.shape[0], rows = d.shape[0]
    if not lower.shape[0] == upper.shape[0] == z.shape[0] == n or w.shape[0] != rows:
        raise ValueError(f"expected numbers of {n} unknowns and of {rows} inequalities")
    active, perhaps = np.zeros(n + equations + rows, bool), np.zeros(n + equations + rows, bool)
    cdef unsigned char[::1] holds = active.view(np.uint8), may = perhaps.view(np.uint8)
    with nogil:
        hold(
            n, equations, rows, &x[0], &lower[0], &upper[0], &z[0], &d[0], &w[0], cost, clearly,
            noise, &holds[0], &may[0],
        )
    return active, perhaps


cdef void hold(
    ptrdiff_t n, ptrdiff_t equations, ptrdiff_t rows, const double *x, const double *lower,
    const double *upper, const double *z, const double *d, const double *w, double cost,
    double clearly, double noise, unsigned char *holds, unsigned char *may,
) noexcept nogil:
    cdef ptrdiff_t i
    cdef double low, high
    for i in range(n):
        holds[i] = may[i] = False
        if lower[i] < upper[i]:
            low, high = x[i] - lower[i], upper[i] - x[i]
            low = low if z[i] > 0 or (z[i] == 0 and low < high) else high
            _hold(&holds[i], &may[i], low, fabs(z[i])/cost, clearly, noise)
    holds, may = holds + n, may + n
    for i in range(equations):
        holds[i], may[i] = True, False
    for i in range(rows):
        _hold(&holds[equations + i], &may[equations + i], d[i], w[i]/cost, clearly, noise)


cdef inline void _hold(
    unsigned char *holds, unsigned char *may, double distance, double force, double clearly,
    double noise
) noexcept nogil:
    distance = 0.0 if distance < 0 else distance
    holds[0] = force > clearly*distance and force > noise
    may[0] = not holds[0] and not (distance > clearly*force and distance > noise)


def largest_bend(
    layout, const double[::1] hess, const double[::1] weights, const double[::1] lower,
    const double[::1] upper,
):
    """The largest second derivative by a free unknown, over its weight, from the entries of K that
    are those of H; infinite where one is no number."""
    cdef const int[::1] diagonal = layout.diagonal
    cdef ptrdiff_t n = weights.shape[0]
    if not lower.shape[0] == upper.shape[0] == n or diagonal.shape[0] < n:
        raise ValueError(f"expected numbers of {n} unknowns")
    return bend_of(n, &diagonal[0], &hess[0], &weights[0], &lower[0], &upper[0])


cdef double bend_of(
    ptrdiff_t n, const int *diagonal, const double *hess, const double *weights,
    const double *lower, const double *upper,
) noexcept nogil:
    cdef ptrdiff_t i
    cdef double most = 0.0
    for i in range(n):
        if lower[i] < upper[i]:
            most = larger(most, fabs(hess[diagonal[i]])/weights[i])
    return most


def signs(
    layout, Factorisation factorisation, const double[::1] hess, const double[::1] jac,
    active, const double[::1] curvatures, ptrdiff_t equations, *, double fixed, double relaxed,
    double held, double idle,
):
    """Factorise K with entries that are those of H and of A, and on its diagonal: for unknowns
    their ``curvatures``, ``fixed`` where they are active; for the equations -``relaxed``, for
    inequalities -``held``, -``idle`` where they are not active.  Returns the numbers of positive
    and of zero pivots."""
    cdef const int[::1] diagonal = layout.diagonal
    cdef const unsigned char[::1] holds = active.view(np.uint8)
    cdef ptrdiff_t n = curvatures.shape[0], every = holds.shape[0]
    cdef ptrdiff_t size = hess.shape[0]
    if diagonal.shape[0] != every or n + equations > every or jac.shape[0] != size:
        raise ValueError(f"expected what holds {diagonal.shape[0]} unknowns and rows")
    K = np.empty(size)
    cdef double[::1] entries = K
    put_signs(
        size, n, equations, every, &diagonal[0], &hess[0], &jac[0], &holds[0], &curvatures[0],
        fixed, relaxed, held, idle, &entries[0],
    )
    positive, _, zero = factorisation.factor(K)
    return positive, zero


cdef void put_signs(
    ptrdiff_t size, ptrdiff_t n, ptrdiff_t equations, ptrdiff_t every, const int *diagonal,
    const double *hess, const double *jac, const unsigned char *holds, const double *curvatures,
    double fixed, double relaxed, double held, double idle, double *K,
) noexcept nogil:
    """The entries of K with its diagonal."""
    cdef ptrdiff_t i
    cdef double add
    for i in range(size):
        K[i] = hess[i] + jac[i]
    for i in range(every):
        if diagonal[i] >= 0:
            if i < n:
                add = fixed if holds[i] else curvatures[i]
            else:
                add = -idle if not holds[i] else -relaxed if i < n + equations else -held
            K[diagonal[i]] += add


def left_by_barrier(
    const double[::1] x, const double[::1] lower, const double[::1] upper, const double[::1] z,
    const double[::1] d, const double[::1] w,
):
    """Sum of the products of inequalities and bounds with their multipliers, where these are
    larger than the distances; fixed unknowns have none."""
    cdef ptrdiff_t n = x.shape[0], rows = d.shape[0], i
    cdef double total = 0.0, distance
    if not lower.shape[0] == upper.shape[0] == z.shape[0] == n or w.shape[0] != rows:
        raise ValueError(f"expected numbers of {n} unknowns and of {rows} inequalities")
    for i in range(rows):
        if fabs(w[i]) > fabs(d[i]):
            total += fabs(w[i]*d[i])
    for i in range(n):
        if lower[i] < upper[i]:
            distance = x[i] - lower[i] if z[i] > 0 else upper[i] - x[i] if z[i] < 0 else 0.0
            if fabs(z[i]) > fabs(distance):
                total += fabs(z[i]*distance)
    return total
