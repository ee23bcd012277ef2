"""Gaps along steps that were integrated, and states that go on until they may meet a surface."""


cdef class Surfaces(Method):
    """Steps of free motions beside surfaces."""

    cdef int look(
        self, const double *y0, const double *ends, const double *y1, double t, double h,
        const double[::1] shares, double[::1] path, double[::1] moments, double[::1] gaps
    ) except -1 nogil:
        """Gaps at shares of a step, wherever their surfaces end."""
        cdef const double *args[DMOC_MOST]
        cdef ptrdiff_t stride[DMOC_MOST]
        cdef double *results[DMOC_MOST]
        cdef ptrdiff_t s
        for s in range(shares.shape[0]):
            moments[s] = t + shares[s] * h
        quintic(self.nq, y0, ends, y1, h, shares, &path[0], self.nq)
        args[0], args[1], args[2] = &path[0], &moments[0], &self.par[0]
        stride[0], stride[1], stride[2] = self.nq, 1, 0
        results[0] = &gaps[0]
        self.surface.run(shares.shape[0], args, stride, results)
        return 0


cdef bint over(
    ptrdiff_t places, ptrdiff_t nc, const double *gaps, const double *upper, const double *near
) noexcept nogil:
    """Whether a gap at the start of a step is near, or one in it above what it may be."""
    cdef ptrdiff_t i
    for i in range(nc):
        if fabs(gaps[i]) <= near[i]:
            return True
    for i in range(places * nc):
        if gaps[i] > upper[i]:
            return True
    return False


cdef void quintic(
    ptrdiff_t nq, const double *y0, const double *ends, const double *y1, double h,
    const double[::1] shares, double *q, ptrdiff_t stride
) noexcept nogil:
    """Positions at shares of a step, which lie some stride apart: the polynomial of degree 5 with
    the positions, velocities and accelerations of its ends."""
    cdef ptrdiff_t i, s
    cdef double v, a, d, e, f, x
    for i in range(nq):
        v, a = h * y0[nq + i], h * h * ends[i]
        d, e, f = y1[i] - y0[i] - v - a / 2, h * y1[nq + i] - v - a, h * h * ends[nq + i] - a
        for s in range(shares.shape[0]):
            x = shares[s]
            q[s * stride + i] = y0[i] + x * (
                v + x * (a / 2 + x * (
                    10 * d - 4 * e + f / 2 + x * (-15 * d + 7 * e - f + x * (6 * d - 3 * e + f / 2))
                ))
            )
