# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, binding=False
"""The continuous equations of motion M q'' = F, integrated for many rows of states side by side.

A row is (q | v), (q | v | work) or (q | v | X), of 2 nq, 2 nq + 1 or 2 nq + (2 nq)^2 numbers.  The
work is the integral of the power Q . v - dL/dt; X, row by row, is the derivative of (q | v) with
respect to what a row starts from, X' = J X with the derivative J of (v, M^-1 F) by (q, v).

The method is DOP853, that of Hairer, Norsett and Wanner of order 8 (dormand_prince.py), in as many
equal parts as its error estimate asks for.  Kernels in C run without the GIL; kernels on NumPy take
the same way.  An integrator belongs to one thread.
"""
from libc.math cimport NAN, fabs, fmax, isfinite, pow, sqrt

from dmoc_kernel cimport DMOC_MOST, dmoc_entry, find_kernel
from elimination cimport factor, solve

import numpy as np

from dmoc.simulation.dormand_prince import ERROR_3, ERROR_5, STAGES, WEIGHTS

cdef enum:
    STAGE = 12       # stages of the method; the slope at the end is one more
    END = 12         # places of the sums: the end of a step and its error estimates
    FIFTH = 13
    THIRD = 14
    SUMS = 15
    TERMS = 80       # of all sums, at most
    SIDE_BY_SIDE = 16     # rows: what fits into a processor's cache
    SIDE_BY_SIDE_NUMPY = 256
    ATTENTION = 256  # parts between two looks at the time
    MOST_PARTS = 64

# Error of an integration over a step, as a share of the sizes, far below the discretisation errors
# that are to be seen.
cdef double ACCURACY = 1e-11


cdef class Rows:
    """A kernel whose rows of inputs lie some stride apart in memory, in C or on NumPy."""
    cdef const dmoc_entry *entry
    cdef object function
    cdef list sizes
    cdef ptrdiff_t inputs

    def __init__(self, kernels, str name):
        facts = kernels.manifest["kernels"][name]
        self.sizes = [size for _, size in facts["inputs"]]
        self.inputs = len(self.sizes)
        self.sizes += [len(o["rows"]) if "rows" in o else o["shape"][0] for o in facts["outputs"]]
        self.entry = NULL
        self.function = kernels.functions[name]
        if kernels.backend == "compiled":
            self.entry = find_kernel(kernels.module, name)

    cdef ptrdiff_t size(self, ptrdiff_t output):
        return self.sizes[self.inputs + output]

    cdef int run(
        self, ptrdiff_t n, const double *const *args, const ptrdiff_t *stride,
        double *const *results
    ) except -1 nogil:
        if self.entry != NULL:
            self.entry.kernel(n, args, stride, results)
            return 0
        with gil:
            arrays = []
            for a, size in enumerate(self.sizes):
                if a < self.inputs:
                    arrays.append(_seen(<double *>args[<ptrdiff_t>a], n, stride[<ptrdiff_t>a], size))
                else:
                    arrays.append(_seen(results[<ptrdiff_t>a - self.inputs], n, size, size))
            self.function(*arrays)
        return 0


cdef object _seen(double *at, ptrdiff_t n, ptrdiff_t stride, ptrdiff_t size):
    """Rows in memory as an array of shape (n, size), or (1, size) where the stride is 0."""
    if not size:
        return np.empty((n, 0))
    if not stride:
        return np.asarray(<double[:1, :size]>at)
    return np.asarray(<double[:n, :stride]>at)[:, :size]


cdef double[::1] _space(ptrdiff_t size):
    return np.zeros(max(size, 1))


cdef class Integrator:
    """Integrates rows of states of one model.

    Parameters
    ----------
    kernels : Kernels
    par : array of shape (1, npar)
    size : array of shape (2 nq + 1,)
        Sizes of positions, velocities and energy: integration errors are shares of them.
    small_time : float
        Time by which slopes of gaps are moved to see them turn.
    check_time : callable
        Called now and then; it may raise.
    """
    cdef ptrdiff_t nq, nu, nc, capacity, parts
    cdef object check_time
    cdef double small_time
    cdef Rows dynamics, force, dynamics_jac, surface, surface_jac
    cdef double[::1] par, sizes, start, y, at, slopes, u, t, mass, f, Q, power, M_D, F_D, G, n0, n1
    cdef double[::1] now, u0, u1, begin, span, error, path, moments, gaps, stored
    cdef ptrdiff_t[::1] row, which, step, pivot, M_row, M_column, F_row, F_column, g_row, g_column
    cdef ptrdiff_t sum_start[SUMS + 1]
    cdef ptrdiff_t sum_index[TERMS]
    cdef double sum_factor[TERMS]
    cdef double share[STAGE]

    def __init__(self, kernels, par, size, double small_time, check_time):
        cdef ptrdiff_t nq = len(kernels.coordinates), rows, widest = 2 * nq * (2 * nq + 1)
        self.nq, self.nu, self.nc = nq, len(kernels.inputs), len(kernels.surfaces)
        self.par = np.append(par[0], 0.0)
        self.sizes, self.small_time, self.check_time = np.array(size), small_time, check_time
        if self.sizes.shape[0] != 2 * nq + 1:
            raise ValueError(f"expected {2 * nq + 1} sizes")
        compiled = kernels.backend == "compiled"
        self.capacity = rows = SIDE_BY_SIDE if compiled else SIDE_BY_SIDE_NUMPY
        self.dynamics, self.force = Rows(kernels, "dynamics"), Rows(kernels, "force")
        self.dynamics_jac = Rows(kernels, "dynamics_jac")
        self.M_row, self.M_column = map(np.array, kernels.pattern("dynamics_jac", "M_D"))
        self.F_row, self.F_column = map(np.array, kernels.pattern("dynamics_jac", "F_D"))
        if self.nc:
            self.surface = Rows(kernels, "surface")
            self.surface_jac = Rows(kernels, "surface_jac")
            self.g_row, self.g_column = map(np.array, kernels.pattern("surface_jac", "g_D"))
            self.stored = _space(self.surface_jac.size(0))
        self.start, self.y, self.at = (_space(rows * widest) for _ in range(3))
        self.slopes = _space((STAGE + 1) * rows * widest)
        self.u, self.u0, self.u1 = (_space(rows * self.nu) for _ in range(3))
        self.t, self.begin, self.span, self.error = (_space(rows) for _ in range(4))
        self.mass, self.f, self.Q = _space(rows * nq * nq), _space(rows * nq), _space(rows * nq)
        self.power = _space(rows)
        self.M_D = _space(rows * self.M_row.shape[0])
        self.F_D = _space(rows * self.F_row.shape[0])
        self.G, self.now = _space(2 * nq * nq), _space(2 * nq)
        self.n0, self.n1 = _space(nq + 1), _space(nq + 1)
        self.row, self.which, self.step = (np.zeros(rows, dtype=np.intp) for _ in range(3))
        self.pivot = np.zeros(nq, dtype=np.intp)
        self._sums()

    def _sums(self):
        """Read the coefficients of the method."""
        cdef ptrdiff_t k = 0
        lists = [(), *(terms for _, terms in STAGES), WEIGHTS, ERROR_5, ERROR_3]
        for s, terms in enumerate(lists):
            self.sum_start[<ptrdiff_t>s] = k
            for j, factor in terms:
                self.sum_index[k], self.sum_factor[k] = j, factor
                k += 1
        self.sum_start[SUMS] = k
        for s, (share, _) in enumerate(STAGES):
            self.share[<ptrdiff_t>s + 1] = share

    # One slope ------------------------------------------------------------------------------------

    cdef int slope(
        self, ptrdiff_t n, ptrdiff_t width, const double *y, ptrdiff_t held, double *out
    ) except -1 nogil:
        """Slopes of n rows at the times t and with the inputs u; a surface may hold them."""
        cdef ptrdiff_t nq = self.nq, i, j
        cdef const double *args[DMOC_MOST]
        cdef ptrdiff_t stride[DMOC_MOST]
        cdef double *results[DMOC_MOST]
        cdef const double *state
        cdef double *M
        cdef double *rate
        cdef double second = 0.0
        args[0], args[1], args[2] = y, y + nq, &self.u[0]
        args[3], args[4] = &self.t[0], &self.par[0]
        stride[0] = stride[1] = width
        stride[2], stride[3], stride[4] = self.nu, 1, 0
        results[0], results[1] = &self.mass[0], &self.f[0]
        self.dynamics.run(n, args, stride, results)
        if width == 2 * nq + 1:
            results[0], results[1] = &self.Q[0], &self.power[0]
            self.force.run(n, args, stride, results)
        elif width > 2 * nq:
            results[0], results[1] = &self.M_D[0], &self.F_D[0]
            self.dynamics_jac.run(n, args, stride, results)
        for i in range(n):
            state, rate, M = y + i * width, out + i * width, &self.mass[i * nq * nq]
            for j in range(nq):
                rate[j], rate[nq + j] = state[nq + j], self.f[i * nq + j]
            if not factor(M, &self.pivot[0], nq, nq):
                for j in range(nq, width):
                    rate[j] = NAN
                continue
            solve(M, &self.pivot[0], rate + nq, nq, nq, 1)
            if held >= 0:
                self.bend(state, rate + nq, self.t[i], held, &second)
                self.hold(M, rate + nq, second)
            if width == 2 * nq + 1:
                rate[2 * nq] = self.power[i]
            elif width > 2 * nq:
                self.carry(i, M, rate + nq, state + 2 * nq, rate + 2 * nq)
        return 0

    cdef void carry(
        self, ptrdiff_t i, const double *LU, const double *a, const double *X, double *X_dot
    ) noexcept nogil:
        """X' = J X with the factors of M, the acceleration a and the derivatives of row i."""
        cdef ptrdiff_t nq = self.nq, m = 2 * self.nq, e, r, c, k
        cdef double *G = &self.G[0]
        for e in range(nq * m):
            G[e] = 0.0
        for e in range(self.F_row.shape[0]):
            if self.F_column[e] < m:
                G[self.F_row[e] * m + self.F_column[e]] += self.F_D[i * self.F_row.shape[0] + e]
        for e in range(self.M_row.shape[0]):
            if self.M_column[e] < m:
                r = self.M_row[e]  # of the entry (r // nq, r % nq) of M
                G[(r // nq) * m + self.M_column[e]] -= (
                    self.M_D[i * self.M_row.shape[0] + e] * a[r % nq]
                )
        solve(LU, &self.pivot[0], G, nq, nq, m)
        for e in range(nq * m):
            X_dot[e] = X[nq * m + e]
        for r in range(nq):
            for c in range(m):
                X_dot[(nq + r) * m + c] = 0.0
            for k in range(m):
                for c in range(m):
                    X_dot[(nq + r) * m + c] += G[r * m + k] * X[k * m + c]

    # Surfaces -------------------------------------------------------------------------------------

    cdef int gap_slope(self, const double *q, double t, ptrdiff_t j, double *n) except -1 nogil:
        """Slopes of gap j with respect to (q, t)."""
        cdef const double *args[DMOC_MOST]
        cdef ptrdiff_t stride[DMOC_MOST]
        cdef double *results[DMOC_MOST]
        cdef ptrdiff_t e
        args[0], args[1], args[2] = q, &t, &self.par[0]
        stride[0], stride[1], stride[2] = self.nq, 1, 0
        results[0] = &self.stored[0]
        self.surface_jac.run(1, args, stride, results)
        for e in range(self.nq + 1):
            n[e] = 0.0
        for e in range(self.g_row.shape[0]):
            if self.g_row[e] == j:
                n[self.g_column[e]] = self.stored[e]
        return 0

    cdef int bend(
        self, const double *y, const double *a, double t, ptrdiff_t j, double *second
    ) except -1 nogil:
        """Second derivative of gap j along a motion with the acceleration a; leaves the slopes of
        the gap in n0."""
        cdef ptrdiff_t nq = self.nq, i
        cdef double s = self.small_time
        for i in range(nq):
            self.now[i], self.now[nq + i] = y[i] + s * y[nq + i], y[i] - s * y[nq + i]
        self.gap_slope(&self.now[0], t + s, j, &self.n0[0])
        self.gap_slope(&self.now[nq], t - s, j, &self.n1[0])
        second[0] = (self.n0[nq] - self.n1[nq]) / (2 * s)
        for i in range(nq):
            second[0] += (self.n0[i] - self.n1[i]) / (2 * s) * y[nq + i]
        self.gap_slope(y, t, j, &self.n0[0])
        for i in range(nq):
            second[0] += self.n0[i] * a[i]
        return 0

    cdef void hold(self, const double *LU, double *a, double second) noexcept nogil:
        """Take M^-1 n times a force from a, so that the rate of the gap with the slopes n0
        stays."""
        cdef ptrdiff_t i
        cdef double inertia = 0.0
        for i in range(self.nq):
            self.G[i] = self.n0[i]
        solve(LU, &self.pivot[0], &self.G[0], self.nq, self.nq, 1)
        for i in range(self.nq):
            inertia += self.n0[i] * self.G[i]
        for i in range(self.nq):
            a[i] -= second / inertia * self.G[i]

    # One step -------------------------------------------------------------------------------------

    cdef void moment(self, ptrdiff_t n, double share) noexcept nogil:
        """Times and inputs at a share of the steps."""
        cdef ptrdiff_t i
        for i in range(n):
            self.t[i] = self.begin[i] + share * self.span[i]
        for i in range(n * self.nu):
            self.u[i] = (1 - share) * self.u0[i] + share * self.u1[i]

    cdef void add(
        self, ptrdiff_t n, ptrdiff_t width, ptrdiff_t s, ptrdiff_t count, double *out
    ) noexcept nogil:
        """y plus a part of the step along the sum s of slopes."""
        cdef ptrdiff_t i, c, e
        cdef const double *slope
        cdef double *row
        cdef double share
        for i in range(n):
            row = out + i * width
            for c in range(width):
                row[c] = self.y[i * width + c]
            for e in range(self.sum_start[s], self.sum_start[s + 1]):
                share = self.span[i] / count * self.sum_factor[e]
                slope = &self.slopes[(self.sum_index[e] * n + i) * width]
                for c in range(width):
                    row[c] += share * slope[c]

    cdef double largest(
        self, ptrdiff_t n, ptrdiff_t width, ptrdiff_t s, ptrdiff_t count, ptrdiff_t i
    ) noexcept nogil:
        """Largest entry of an error estimate of row i relative to the sizes."""
        cdef ptrdiff_t c, e
        cdef double total, found = 0.0
        for c in range(min(width, 2 * self.nq + (width == 2 * self.nq + 1))):
            total = 0.0
            for e in range(self.sum_start[s], self.sum_start[s + 1]):
                total += self.sum_factor[e] * self.slopes[(self.sum_index[e] * n + i) * width + c]
            found = fmax(found, fabs(self.span[i] / count * total) / self.sizes[c])
        return found

    cdef int integrate(
        self, ptrdiff_t n, ptrdiff_t width, ptrdiff_t count, ptrdiff_t held, double *ends
    ) except -1 nogil:
        """Integrate n rows from ``start`` in ``count`` parts to ``y``, with the estimates of the
        largest ``error`` of a part (Hairer, Norsett, Wanner, II.10); accelerations at both ends."""
        cdef ptrdiff_t i, k, s, c, total = n * width, nq = self.nq
        cdef double fifth, third
        for c in range(total):
            self.y[c] = self.start[c]
        for i in range(n):
            self.error[i] = 0.0
        self.moment(n, 0.0)
        self.slope(n, width, &self.y[0], held, &self.slopes[0])
        if ends != NULL:
            for i in range(n):
                for c in range(nq):
                    ends[2 * nq * self.which[self.row[i]] + c] = self.slopes[i * width + nq + c]
        for k in range(count):
            for s in range(1, STAGE):
                self.add(n, width, s, count, &self.at[0])
                self.moment(n, (k + self.share[s]) / count)
                self.slope(n, width, &self.at[0], held, &self.slopes[s * total])
            self.add(n, width, END, count, &self.at[0])
            for c in range(total):
                self.y[c] = self.at[c]
            for i in range(n):
                fifth, third = (
                    self.largest(n, width, FIFTH, count, i),
                    self.largest(n, width, THIRD, count, i),
                )
                self.error[i] = fmax(
                    self.error[i], fifth**2 / sqrt(fifth**2 + 0.01 * third**2 + 1e-300)
                )
            if k + 1 < count or ends != NULL:
                self.moment(n, (k + 1.0) / count)
                self.slope(n, width, &self.y[0], held, &self.slopes[0])
        if ends != NULL:
            for i in range(n):
                for c in range(nq):
                    ends[2 * nq * self.which[self.row[i]] + nq + c] = self.slopes[i * width + nq + c]
        self.parts += n * count
        if self.parts >= ATTENTION:
            self.parts = 0
            with gil:
                self.check_time()
        return 0

    cdef void put(
        self, ptrdiff_t i, ptrdiff_t row, ptrdiff_t width, const double *y, const double *t,
        const double *h, const double *u0, const double *u1
    ) noexcept nogil:
        """Make the step of a row the one of place i of what is integrated."""
        cdef ptrdiff_t c, at = self.which[row], k = self.step[row], nu = self.nu
        for c in range(width):
            self.start[i * width + c] = y[at * width + c]
        for c in range(nu):
            self.u0[i * nu + c], self.u1[i * nu + c] = u0[k * nu + c], u1[k * nu + c]
        self.begin[i], self.span[i], self.row[i] = t[k], h[k], row

    cdef int advance_rows(
        self, ptrdiff_t n, ptrdiff_t width, double *y, const double *t, const double *h,
        const double *u0, const double *u1, ptrdiff_t held, double *ends
    ) except -1 nogil:
        """Integrate the rows ``which`` of y, at most ``capacity``, over the steps ``step``."""
        cdef ptrdiff_t i, c, left = n, again, count = 1
        cdef double worst
        cdef double *row
        for i in range(n):
            self.put(i, i, width, y, t, h, u0, u1)
        while left:
            self.integrate(left, width, count, held, ends)
            again, worst = 0, 0.0
            for i in range(left):
                if self.error[i] > ACCURACY and count < MOST_PARTS:
                    worst = fmax(worst, self.error[i])
                    self.put(again, self.row[i], width, y, t, h, u0, u1)
                    again += 1
                else:
                    row = y + self.which[self.row[i]] * width
                    for c in range(width):
                        row[c] = self.y[i * width + c]
            if again:
                worst = pow(min(worst / ACCURACY, 1e30), 0.125)
                count = min(<ptrdiff_t>MOST_PARTS, 2 * max(count, <ptrdiff_t>(count * worst)))
            left = again
        return 0

    def advance(
        self, double[:, ::1] y, const ptrdiff_t[::1] first, const ptrdiff_t[::1] last,
        const double[::1] t, const double[::1] h, const double[:, ::1] u0,
        const double[:, ::1] u1, ptrdiff_t held=-1
    ):
        """Integrate rows in place, each over the steps first to last - 1 of a list; in a step
        inputs are linear from u0 to u1.

        Parameters
        ----------
        y : array of shape (n, width)
        first, last : arrays of shape (n,)
        t, h : arrays of shape (N,)
            Begin and duration of the steps.
        u0, u1 : arrays of shape (N, nu)
        held : int
            Surface that holds the motion, or -1.

        Returns
        -------
        array of shape (n, 2, nq)
            Accelerations at both ends of the last steps.
        """
        cdef ptrdiff_t n = y.shape[0], width = y.shape[1], N = t.shape[0], nq = self.nq
        cdef ptrdiff_t begin = 0, i, j, m
        if width not in (2 * nq, 2 * nq + 1, 2 * nq * (2 * nq + 1)):
            raise ValueError(f"rows of {width} numbers: expected (q | v), and work or X")
        if not (h.shape[0] == u0.shape[0] == u1.shape[0] == N):
            raise ValueError(f"expected {N} steps")
        if not (u0.shape[1] == u1.shape[1] == self.nu and -1 <= held < self.nc):
            raise ValueError(f"expected {self.nu} inputs and one of {self.nc} surfaces")
        if not (first.shape[0] == last.shape[0] == n):
            raise ValueError(f"expected {n} rows")
        for i in range(n):
            if not 0 <= first[i] <= last[i] <= N:
                raise ValueError(f"steps {first[i]} to {last[i]}: expected 0 to {N}")
        found = np.empty((n, 2, nq))
        cdef double[:, :, ::1] ends = found
        with nogil:
            while begin < n:
                j, m = 0, 1
                while m:
                    m = 0
                    for i in range(begin, min(begin + self.capacity, n)):
                        if first[i] + j < last[i]:
                            self.which[m], self.step[m] = i, first[i] + j
                            m += 1
                    self.advance_rows(
                        m, width, &y[0, 0], &t[0], &h[0], &u0[0, 0], &u1[0, 0], held,
                        &ends[0, 0, 0]
                    )
                    j += 1
                begin += self.capacity
        return found

    def gap_acceleration(
        self, const double[::1] y, const double[::1] a, double t, ptrdiff_t j
    ):
        """Second derivative of gap j along a motion with the state y and the acceleration a."""
        cdef double second = 0.0
        if not (y.shape[0] == 2 * self.nq and a.shape[0] == self.nq and 0 <= j < self.nc):
            raise ValueError(f"expected {self.nq} coordinates and one of {self.nc} surfaces")
        self.bend(&y[0], &a[0], t, j, &second)
        return second

    # Without contacts -----------------------------------------------------------------------------

    def between(
        self, const double[:, ::1] y0, const double[:, :, ::1] ends, const double[:, ::1] y1,
        const double[::1] h, const double[::1] shares
    ):
        """Positions at shares of steps from y0 to y1 with the accelerations ``ends``, shape
        (shares, n, nq): the polynomial of degree 5."""
        cdef ptrdiff_t n = y0.shape[0], nq = self.nq, i, s
        if not (y1.shape[0] == ends.shape[0] == h.shape[0] == n and ends.shape[1] == 2):
            raise ValueError(f"expected {n} steps")
        if not (y0.shape[1] >= 2 * nq and y1.shape[1] >= 2 * nq and ends.shape[2] == nq):
            raise ValueError(f"expected {nq} coordinates")
        found = np.empty((shares.shape[0], n, nq))
        cdef double[:, :, ::1] q = found
        with nogil:
            for s in range(shares.shape[0]):
                for i in range(n):
                    quintic(nq, &y0[i, 0], &ends[i, 0, 0], &y1[i, 0], h[i], shares[s], &q[s, i, 0])
        return found

    def quiet(
        self, double[::1] y, const double[::1] t, const double[::1] h, const double[:, ::1] u0,
        const double[:, ::1] u1, ptrdiff_t k, ptrdiff_t end, const double[::1] shares,
        const double[:, :, ::1] upper, const double[::1] near, const double[:, ::1] q_wanted,
        const double[::1] astray
    ):
        """Integrate a state y = (q | v), in place, over the steps k to end - 1 as long as it can
        meet no surface.

        Parameters
        ----------
        t, h, u0, u1 : arrays of shapes (N,), (N,), (N, nu), (N, nu)
            Of all steps, as for ``advance``.
        shares : array of shape (places,)
            Where in a step gaps are looked at; the first is its start.
        upper : array of shape (N, places, nc)
            Gaps that stop the integration before the step.
        near : array of shape (nc,)
            Distances from surfaces at its start that do.
        q_wanted, astray : arrays of shapes (N + 1, nq), (nq,)
            Positions, and the distances from them beyond which it ends after a step.

        Returns
        -------
        pair of int and bool
            The step that is not done, and whether the motion has gone astray before it.
        """
        cdef ptrdiff_t nq = self.nq, nc = self.nc, places = shares.shape[0], N = u0.shape[0], i
        cdef double[::1] y1 = np.empty(2 * nq), ends = np.empty(2 * nq)
        cdef double[::1] path = _space(places * nq), moments = _space(places)
        cdef double[::1] gaps = _space(places * nc)
        cdef bint lost = False
        if not (y.shape[0] == 2 * nq and N >= end >= k >= 0):
            raise ValueError(f"expected {nq} coordinates and steps below {N}")
        if not (t.shape[0] == h.shape[0] == u1.shape[0] == N):
            raise ValueError(f"expected {N} steps")
        if not (u0.shape[1] == u1.shape[1] == self.nu and upper.shape[0] == N):
            raise ValueError(f"expected {self.nu} inputs and {N} steps")
        if not (upper.shape[1] == places > 0 and upper.shape[2] == near.shape[0] == nc):
            raise ValueError(f"expected {places} places and {nc} surfaces")
        if not (q_wanted.shape[0] == N + 1 and q_wanted.shape[1] == astray.shape[0] == nq):
            raise ValueError(f"expected {N + 1} positions of {nq} coordinates")
        with nogil:
            while k < end and not lost:
                y1[:] = y
                self.which[0], self.step[0] = 0, k
                self.advance_rows(
                    1, 2 * nq, &y1[0], &t[0], &h[0], &u0[0, 0], &u1[0, 0], -1, &ends[0]
                )
                for i in range(2 * nq):
                    if not isfinite(y1[i]):
                        break
                else:
                    if nc:
                        self.look(&y[0], &ends[0], &y1[0], t[k], h[k], shares, path, moments, gaps)
                    if meets(places, nc, &gaps[0], &upper[0, 0, 0] + k * places * nc, &near[0]):
                        break
                    y[:] = y1
                    k += 1
                    for i in range(nq):
                        lost = lost or fabs(y[i] - q_wanted[k, i]) > astray[i]
                    continue
                break
        return k, lost

    cdef int look(
        self, const double *y0, const double *ends, const double *y1, double t, double h,
        const double[::1] shares, double[::1] path, double[::1] moments, double[::1] gaps
    ) except -1 nogil:
        """Gaps at shares of a step."""
        cdef const double *args[DMOC_MOST]
        cdef ptrdiff_t stride[DMOC_MOST]
        cdef double *results[DMOC_MOST]
        cdef ptrdiff_t s
        for s in range(shares.shape[0]):
            moments[s] = t + shares[s] * h
            quintic(self.nq, y0, ends, y1, h, shares[s], &path[s * self.nq])
        args[0], args[1], args[2] = &path[0], &moments[0], &self.par[0]
        stride[0], stride[1], stride[2] = self.nq, 1, 0
        results[0] = &gaps[0]
        self.surface.run(shares.shape[0], args, stride, results)
        return 0


cdef bint meets(
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
    ptrdiff_t nq, const double *y0, const double *ends, const double *y1, double h, double x,
    double *q
) noexcept nogil:
    """Positions at the share x of a step: the polynomial of degree 5 with the positions,
    velocities and accelerations of its ends."""
    cdef ptrdiff_t i
    cdef double d, s, c
    for i in range(nq):
        d = y1[i] - y0[i] - h * y0[nq + i] - h * h / 2 * ends[i]
        s = h * (y1[nq + i] - y0[nq + i] - h * ends[i])
        c = h * h * (ends[nq + i] - ends[i])
        q[i] = (
            y0[i] + x * h * y0[nq + i] + (x * h) ** 2 / 2 * ends[i]
            + x**3 * (10 * d - 4 * s + c / 2 + x * (-15 * d + 7 * s - c + x * (6 * d - 3 * s + c / 2)))
        )
