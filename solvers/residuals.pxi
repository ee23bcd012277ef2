"""What a point leaves of the optimality conditions (kkt.py), and the entries of K there."""
from libc.math cimport fabs, isfinite


def left_over(
    const double[::1] slope, const double[::1] reach, const double[::1] x,
    const double[::1] lower, const double[::1] upper, const double[::1] z,
    const double[::1] c, const double[::1] y, const double[::1] d, const double[::1] w,
):
    """The largest of the slopes of L, of which each counts by the reach of its unknown, and of the
    products of inequalities and bounds with their multipliers; the mean of all multipliers.
    Infinite where one of the numbers is none.  Fixed unknowns have neither a slope nor a
    multiplier."""
    cdef ptrdiff_t n = x.shape[0], eq = c.shape[0], rows = d.shape[0]
    cdef double mean = 0.0, worst
    if not (slope.shape[0] == reach.shape[0] == lower.shape[0] == upper.shape[0] == z.shape[0] == n):
        raise ValueError(f"expected numbers of {n} unknowns")
    if y.shape[0] != eq or w.shape[0] != rows:
        raise ValueError(f"expected multipliers of {eq} equations and {rows} inequalities")
    with nogil:
        worst = left_of(
            n, eq, rows, &slope[0], &reach[0], &x[0], &lower[0], &upper[0], &z[0], &y[0], &d[0],
            &w[0], &mean,
        )
    return worst, mean


cdef double left_of(
    ptrdiff_t n, ptrdiff_t eq, ptrdiff_t rows, const double *slope, const double *reach,
    const double *x, const double *lower, const double *upper, const double *z, const double *y,
    const double *d, const double *w, double *mean,
) noexcept nogil:
    cdef ptrdiff_t i
    cdef double worst = 0.0, total = 0.0, distance
    for i in range(n):
        if lower[i] < upper[i]:
            distance = x[i] - lower[i] if z[i] > 0 else upper[i] - x[i] if z[i] < 0 else 0.0
            worst = larger(worst, reach[i] * fabs(slope[i] - z[i]))
            worst = larger(worst, fabs(z[i] * distance))
            total += fabs(z[i])
    for i in range(eq):
        total += fabs(y[i])
    for i in range(rows):
        worst = larger(worst, fabs(w[i] * d[i]))
        total += fabs(w[i])
    mean[0] = total / max(n + eq + rows, 1)
    return worst if isfinite(mean[0]) else INFINITY


def missed_by(
    const double[::1] x, const double[::1] lower, const double[::1] upper, const double[::1] c,
    const double[::1] d,
):
    """The largest violation of bounds, of c = 0 and of d >= 0; infinite where a number is none."""
    cdef ptrdiff_t n = x.shape[0]
    cdef double violation
    if not lower.shape[0] == upper.shape[0] == n:
        raise ValueError(f"expected bounds of {n} unknowns")
    with nogil:
        violation = violation_of(
            n, c.shape[0], d.shape[0], &x[0], &lower[0], &upper[0], &c[0], &d[0]
        )
    return violation


cdef double violation_of(
    ptrdiff_t n, ptrdiff_t eq, ptrdiff_t rows, const double *x, const double *lower,
    const double *upper, const double *c, const double *d,
) noexcept nogil:
    cdef ptrdiff_t i
    cdef double violation = 0.0
    for i in range(n):
        violation = larger(violation, lower[i] - x[i])
        violation = larger(violation, x[i] - upper[i])
    for i in range(eq):
        violation = larger(violation, fabs(c[i]))
    for i in range(rows):
        violation = larger(violation, -d[i])
    return violation


cdef inline double larger(double most, double value) noexcept nogil:
    """The larger one; infinite where the second one is no number."""
    return value if value > most else INFINITY if value != value else most


def entries_of(layout, const double[::1] hess, const double[::1] jac):
    """Entries of K that are those of H, and of A, of a
    :class:`dmoc.solvers.kkt_layout.KKTLayout`."""
    cdef const int[::1] from_hess = layout.from_hess, from_jac = layout.from_jac
    cdef ptrdiff_t size = len(layout.row)
    H, A = np.zeros(size), np.zeros(size)
    cdef double[::1] of_h = H, of_a = A
    if from_hess.shape[0] != hess.shape[0] or from_jac.shape[0] != jac.shape[0]:
        raise ValueError(f"expected {from_hess.shape[0]} and {from_jac.shape[0]} entries")
    put_entries(hess.shape[0], &from_hess[0], &hess[0], &of_h[0])
    put_entries(jac.shape[0], &from_jac[0], &jac[0], &of_a[0])
    return H, A


cdef inline void put_entries(
    ptrdiff_t count, const int *to, const double *entries, double *K
) noexcept nogil:
    """Add entries to those of K that they are part of."""
    cdef ptrdiff_t e
    for e in range(count):
        if to[e] >= 0:
            K[to[e]] += entries[e]
