# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, binding=False
"""The continuous equations of motion M q'' = F, integrated for many rows of states side by side.

A row is (q | v), (q | v | work) or (q | v | X), of 2 nq, 2 nq + 1 or 2 nq + (2 nq)^2 numbers.  The
work is the integral of the power Q . v - dL/dt and of that of the contacts; X, row by row, is the
derivative of (q | v) with respect to what a row starts from, X' = J X with the derivative J of
(v, M^-1 F) by (q, v), where nothing is closed or rubs.

In a mode the motion obeys (equation :eq:`dae` of the theory)

    M a = F(q, v, u, t) - sum_j N_j grad g_j + sum_k T_k grad tau_k

with g_j'' = 0 of closed surfaces and tau_k'' = 0 of what sticks; T_k = -s mu N_j of a contact that
slides with the sign s of tau_k', -s F of a rail.  After every part of a step the rows are moved
back, the shortest way by the masses, to where the conditions of the mode hold: errors of
integration do not open a contact or let it slip.  Free flight is the empty mode.

The method is DOP853, that of Hairer, Norsett and Wanner of order 8 (dormand_prince.py), in as many
equal parts as its error estimate asks for.  Kernels in C run without the GIL; kernels on NumPy take
the same way.  An integrator belongs to one thread.
"""
from libc.math cimport INFINITY, NAN, fabs, fmax, isfinite, pow, sqrt

from dmoc_kernel cimport DMOC_MOST, dmoc_entry, find_kernel
from elimination cimport factor, shortest, solve

import numpy as np

from dmoc.simulation.dormand_prince import ERROR_3, ERROR_5, STAGES, WEIGHTS
from dmoc.simulation.modes import Reaction

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
# Error that shows that a step is too long to be followed.
cdef double ASTRAY = 1e-6
# An error below the first that more parts do not bring below this share of it is one of rounding.
cdef double ROUNDED = 1e-6, FALLING = 0.5
# Determinant, measured by the sizes of its rows and columns, of conditions that are far from saying
# the same twice, and singular values, as shares of the largest, of those that do.
cdef double REGULAR = 1e-6, REDUNDANT = 1e-11


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
    check_time : callable
        Called now and then; it may raise.
    """
    cdef ptrdiff_t nq, nu, nc, nt, capacity, parts
    cdef object check_time
    cdef readonly double worst  # error of the last rows
    cdef Rows dynamics, force, dynamics_jac, surface, tangent, gap_rate, slide_rate
    cdef Rows gap_rate_jac, slide_rate_jac
    cdef public double[::1] sizes
    cdef double[::1] par, start, y, at, slopes, u, t, mass, f, Q, power, M_D, F_D, G
    cdef double[::1] u0, u1, begin, span, error, before, path, moments, gaps
    cdef ptrdiff_t[::1] row, which, step, pivot, M_row, M_column, F_row, F_column
    # Conditions of the mode: their number, their gradients C and the directions B of their pushes
    # at one state, what sliding tangents push by, and the places of surfaces and tangents.
    cdef ptrdiff_t m, closed, sticking, sliding
    cdef ptrdiff_t[::1] closed_at, sticks_at, slides_at, presses, support, exchange
    cdef ptrdiff_t[::1] gamma_row, gamma_column, sigma_row, sigma_column
    cdef double[::1] mu, push, gamma_D, sigma_D, g, tau, C, B, along, bent, lam, change
    cdef double[::1] responses, A, scaled, V, unit, wanted, spare
    cdef const double[:, ::1] held
    cdef ptrdiff_t sum_start[SUMS + 1]
    cdef ptrdiff_t sum_index[TERMS]
    cdef double sum_factor[TERMS]
    cdef double share[STAGE]

    def __init__(self, kernels, par, size, check_time):
        cdef ptrdiff_t nq = len(kernels.coordinates), rows, widest = 2 * nq * (2 * nq + 1)
        self.nq, self.nu, self.nc = nq, len(kernels.inputs), len(kernels.surfaces)
        self.par = np.append(par[0], 0.0)
        self.sizes, self.check_time = np.array(size), check_time
        if self.sizes.shape[0] != 2 * nq + 1:
            raise ValueError(f"expected {2 * nq + 1} sizes")
        compiled = kernels.backend == "compiled"
        self.capacity = rows = SIDE_BY_SIDE if compiled else SIDE_BY_SIDE_NUMPY
        self.dynamics, self.force = Rows(kernels, "dynamics"), Rows(kernels, "force")
        self.dynamics_jac = Rows(kernels, "dynamics_jac")
        self.M_row, self.M_column = map(np.array, kernels.pattern("dynamics_jac", "M_D"))
        self.F_row, self.F_column = map(np.array, kernels.pattern("dynamics_jac", "F_D"))
        self.start, self.y, self.at = (_space(rows * widest) for _ in range(3))
        self.slopes = _space((STAGE + 1) * rows * widest)
        self.u, self.u0, self.u1 = (_space(rows * self.nu) for _ in range(3))
        self.t, self.begin, self.span = (_space(rows) for _ in range(3))
        self.error, self.before = _space(rows), _space(rows)
        self.mass, self.f, self.Q = _space(rows * nq * nq), _space(rows * nq), _space(rows * nq)
        self.power = _space(rows)
        self.M_D = _space(rows * self.M_row.shape[0])
        self.F_D = _space(rows * self.F_row.shape[0])
        self.G = _space(2 * nq * nq)
        self.row, self.which, self.step = (np.zeros(rows, dtype=np.intp) for _ in range(3))
        self.pivot = np.zeros(nq, dtype=np.intp)
        self._sums()
        self._contacts(kernels, par)

    def _contacts(self, kernels, par):
        """What modes need of surfaces and tangents."""
        cdef ptrdiff_t nq = self.nq, rows = self.capacity, most
        surfaces = kernels.surfaces
        self.nt = len(kernels.tangents)
        most = self.nc + self.nt
        places = [surfaces.index(n) if n in surfaces else -1 for n in kernels.tangents]
        self.support = np.array([*places, -1], dtype=np.intp)
        none = np.zeros(0, dtype=np.intp)
        self.gamma_row = self.gamma_column = self.sigma_row = self.sigma_column = none
        if self.nc:
            self.surface, self.gap_rate = Rows(kernels, "surface"), Rows(kernels, "gap_rate")
            self.gap_rate_jac = Rows(kernels, "gap_rate_jac")
            places = kernels.pattern("gap_rate_jac", "gamma_D")
            self.gamma_row, self.gamma_column = map(np.array, places)
        if self.nt:
            self.tangent, self.slide_rate = Rows(kernels, "tangent"), Rows(kernels, "slide_rate")
            self.slide_rate_jac = Rows(kernels, "slide_rate_jac")
            places = kernels.pattern("slide_rate_jac", "sigma_D")
            self.sigma_row, self.sigma_column = map(np.array, places)
            self.mu = np.array(kernels.call("friction", par)[0][0])
        self.gamma_D = _space(rows * self.gamma_row.shape[0])
        self.sigma_D = _space(rows * self.sigma_row.shape[0])
        self.g, self.tau = _space(rows * self.nc), _space(rows * self.nt)
        self.lam = _space(rows * most)
        self.C, self.B, self.along = _space(most * nq), _space(most * nq), _space(self.nt * nq)
        self.responses = _space(2 * most * nq)
        self.A, self.scaled, self.V = (_space(most * most) for _ in range(3))
        self.bent, self.wanted, self.unit, self.spare = (_space(most) for _ in range(4))
        self.change, self.push = _space(nq), _space(self.nt)
        self.closed_at, self.sticks_at, self.slides_at, self.presses, self.exchange = (
            np.zeros(n + 1, dtype=np.intp) for n in (self.nc, self.nt, self.nt, self.nt, most)
        )
        self.held = np.zeros((1, max(self.nt, 1)))
        self._enter(None)

    def _enter(self, mode):
        """Go by the conditions of a mode; without one, by none."""
        cdef ptrdiff_t i, k
        closed, sticking, sliding = ((), (), ()) if mode is None else (
            mode.closed, mode.sticking, mode.sliding
        )
        if not all(0 <= j < self.nc for j in closed) or not all(
            0 <= k < self.nt for k in (*sticking, *(k for k, _ in sliding))
        ):
            raise ValueError(f"expected some of {self.nc} surfaces and of {self.nt} tangents")
        self.closed, self.sticking, self.sliding = len(closed), len(sticking), len(sliding)
        self.m = self.closed + self.sticking
        self.closed_at[:], self.sticks_at[:], self.slides_at[:] = -1, -1, -1
        for i, j in enumerate(closed):
            self.closed_at[<ptrdiff_t>j] = i
        for i, k in enumerate(sticking):
            self.sticks_at[k] = self.closed + i
        for i, (k, s) in enumerate(sliding):
            self.slides_at[k], self.push[i] = i, -s * self.mu[k]
            self.presses[i] = self.closed_at[self.support[k]] if self.support[k] >= 0 else -1
            if self.presses[i] < 0 <= self.support[k]:
                raise ValueError("expected closed surfaces under what slides")

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
        self, ptrdiff_t n, ptrdiff_t width, const double *y, double *out
    ) except -1 nogil:
        """Slopes of n rows at the times t and with the inputs u, in the mode."""
        cdef ptrdiff_t nq = self.nq, i, j
        cdef const double *args[DMOC_MOST]
        cdef ptrdiff_t stride[DMOC_MOST]
        cdef double *results[DMOC_MOST]
        cdef const double *state
        cdef double *M
        cdef double *rate
        cdef bint free = not (self.m or self.sliding)
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
        if not free:
            self.gradients(n, width, y)
        for i in range(n):
            state, rate, M = y + i * width, out + i * width, &self.mass[i * nq * nq]
            for j in range(nq):
                rate[j], rate[nq + j] = state[nq + j], self.f[i * nq + j]
            if not free:
                self.conditions(i, state + nq, rate + nq)
            if not factor(M, &self.pivot[0], nq, nq):
                for j in range(nq, width):
                    rate[j] = NAN
                for j in range(self.m):
                    self.lam[i * self.m + j] = NAN
                continue
            solve(M, &self.pivot[0], rate + nq, nq, nq, 1)
            if self.m:
                self.react(i, M, rate + nq)
            if width == 2 * nq + 1:
                rate[2 * nq] = self.power[i]
                if not free:
                    rate[2 * nq] += self.contact_power(i, state + nq)
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

    # Contacts -------------------------------------------------------------------------------------

    cdef int gradients(self, ptrdiff_t n, ptrdiff_t width, const double *y) except -1 nogil:
        """Evaluate what the conditions of n rows are made of."""
        cdef const double *args[DMOC_MOST]
        cdef ptrdiff_t stride[DMOC_MOST]
        cdef double *results[DMOC_MOST]
        args[0], args[1], args[2], args[3] = y, y + self.nq, &self.t[0], &self.par[0]
        stride[0], stride[1], stride[2], stride[3] = width, width, 1, 0
        if self.closed:
            results[0] = &self.gamma_D[0]
            self.gap_rate_jac.run(n, args, stride, results)
        if self.sticking or self.sliding:
            results[0] = &self.sigma_D[0]
            self.slide_rate_jac.run(n, args, stride, results)
        return 0

    cdef void conditions(self, ptrdiff_t i, const double *v, double *F) noexcept nogil:
        """Gradients C of the conditions of row i, their second derivatives without acceleration,
        and the directions B of their pushes; the friction of rails is added to F."""
        cdef ptrdiff_t nq = self.nq, e, p, c
        for e in range(self.m * nq):
            self.C[e] = 0.0
        for p in range(self.m):
            self.bent[p] = 0.0
        for e in range(self.sliding * nq):
            self.along[e] = 0.0
        for e in range(self.gamma_row.shape[0] if self.closed else 0):
            p = self.closed_at[self.gamma_row[e]]
            if p >= 0:
                self.enter(p, self.gamma_column[e], self.gamma_D[i * self.gamma_row.shape[0] + e], v)
        for e in range(self.sigma_row.shape[0] if self.sticking or self.sliding else 0):
            c = self.sigma_column[e]
            p = self.sticks_at[self.sigma_row[e]]
            if p >= 0:
                self.enter(p, c, self.sigma_D[i * self.sigma_row.shape[0] + e], v)
            p = self.slides_at[self.sigma_row[e]]
            if p >= 0 and nq <= c < 2 * nq:
                self.along[p * nq + c - nq] = self.sigma_D[i * self.sigma_row.shape[0] + e]
        for e in range(self.m * nq):
            self.B[e] = -self.C[e] if e < self.closed * nq else self.C[e]
        for p in range(self.sliding):
            for c in range(nq):
                if self.presses[p] >= 0:
                    self.B[self.presses[p] * nq + c] += self.push[p] * self.along[p * nq + c]
                elif F != NULL:
                    F[c] += self.push[p] * self.along[p * nq + c]

    cdef void enter(self, ptrdiff_t p, ptrdiff_t c, double x, const double *v) noexcept nogil:
        """A derivative of the rate of condition p by entry c of (q, v, t)."""
        if c < self.nq:
            self.bent[p] += x * v[c]
        elif c < 2 * self.nq:
            self.C[p * self.nq + c - self.nq] = x
        else:
            self.bent[p] += x

    cdef void react(self, ptrdiff_t i, const double *LU, double *a) noexcept nogil:
        """Add to a = M^-1 F of row i what its multipliers make of it."""
        cdef ptrdiff_t p, c
        for p in range(self.m):
            self.wanted[p] = -self.bent[p]
            for c in range(self.nq):
                self.wanted[p] -= self.C[p * self.nq + c] * a[c]
        self.answer(LU, &self.B[0], &self.lam[i * self.m])
        for c in range(self.nq):
            a[c] += self.change[c]

    cdef void answer(self, const double *LU, const double *B, double *lam) noexcept nogil:
        """The change M^-1 B^T lam of an acceleration, a velocity or a position that changes the
        conditions by what is wanted, and its multipliers: the smallest where several would do."""
        cdef ptrdiff_t nq = self.nq, m = self.m, columns = m if m == 1 else 2 * m, p, k, c
        cdef double determinant = 1.0
        for c in range(nq):
            for p in range(m):
                self.responses[c * columns + p] = B[p * nq + c]
                if m > 1:
                    self.responses[c * columns + m + p] = self.C[p * nq + c]
        solve(LU, &self.pivot[0], &self.responses[0], nq, nq, columns)
        for p in range(m):
            self.unit[p] = 0.0
            for c in range(nq):
                self.unit[p] += self.C[p * nq + c] * self.responses[c * columns + columns - m + p]
            self.unit[p] = sqrt(fabs(self.unit[p])) if self.unit[p] > 0 and m > 1 else 1.0
        for p in range(m):
            lam[p] = self.wanted[p] / self.unit[p]
            for k in range(m):
                self.A[p * m + k] = 0.0
                for c in range(nq):
                    self.A[p * m + k] += self.C[p * nq + c] * self.responses[c * columns + k]
                self.A[p * m + k] /= self.unit[p] * self.unit[k]
                self.scaled[p * m + k] = self.A[p * m + k]
        if m == 1:
            lam[0] /= self.A[0]
        else:
            if factor(&self.A[0], &self.exchange[0], m, m):
                for p in range(m):
                    determinant *= self.A[p * m + p]
            else:
                determinant = 0.0
            if fabs(determinant) > REGULAR:
                solve(&self.A[0], &self.exchange[0], lam, m, m, 1)
            else:
                shortest(&self.scaled[0], &self.V[0], lam, &self.A[0], m, REDUNDANT)
        for p in range(m):
            lam[p] /= self.unit[p]
        for c in range(nq):
            self.change[c] = 0.0
            for p in range(m):
                self.change[c] += self.responses[c * columns + p] * lam[p]

    cdef double contact_power(self, ptrdiff_t i, const double *v) noexcept nogil:
        """Power of contact and friction forces of row i, whose conditions were the last."""
        cdef ptrdiff_t p, c
        cdef double power = 0.0
        for c in range(self.nq):
            for p in range(self.m):
                power += self.lam[i * self.m + p] * self.B[p * self.nq + c] * v[c]
            for p in range(self.sliding):
                if self.presses[p] < 0:
                    power += self.push[p] * self.along[p * self.nq + c] * v[c]
        return power

    cdef int settle_rows(
        self, ptrdiff_t n, ptrdiff_t width, double *y, ptrdiff_t turns
    ) except -1 nogil:
        """Move n rows at the times t to where closed gaps are zero and what sticks is at its place,
        and, in the third turn, to where neither has a rate."""
        cdef ptrdiff_t nq = self.nq, turn, i, j, c
        cdef double *state
        for turn in range(turns):  # Newton's method, from errors of integration
            self.values(n, width, y, turn == 2)
            for i in range(n):
                state = y + i * width
                self.conditions(i, state + nq, NULL)
                for j in range(self.nc):
                    if self.closed_at[j] >= 0:
                        self.wanted[self.closed_at[j]] = -self.g[i * self.nc + j]
                for j in range(self.nt):
                    if self.sticks_at[j] >= 0:
                        self.wanted[self.sticks_at[j]] = -self.tau[i * self.nt + j]
                        if turn < 2:
                            self.wanted[self.sticks_at[j]] += self.held[self.which[self.row[i]], j]
                if turn == 2:
                    state += nq
                if factor(&self.mass[i * nq * nq], &self.pivot[0], nq, nq):
                    self.answer(&self.mass[i * nq * nq], &self.C[0], &self.spare[0])
                else:
                    self.change[:] = NAN
                for c in range(nq):
                    state[c] += self.change[c]
        return 0

    cdef int values(
        self, ptrdiff_t n, ptrdiff_t width, const double *y, bint rates
    ) except -1 nogil:
        """Masses, gradients, and gaps and tangential positions, or their rates, of n rows."""
        cdef const double *args[DMOC_MOST]
        cdef ptrdiff_t stride[DMOC_MOST]
        cdef double *results[DMOC_MOST]
        cdef ptrdiff_t at = 1
        args[0], args[1], args[2] = y, y + self.nq, &self.u[0]
        args[3], args[4] = &self.t[0], &self.par[0]
        stride[0] = stride[1] = width
        stride[2], stride[3], stride[4] = self.nu, 1, 0
        results[0], results[1] = &self.mass[0], &self.f[0]
        self.dynamics.run(n, args, stride, results)
        self.gradients(n, width, y)
        if rates:
            at = 2
        args[at], args[at + 1] = &self.t[0], &self.par[0]
        stride[at], stride[at + 1] = 1, 0
        if self.closed:
            results[0] = &self.g[0]
            if rates:
                self.gap_rate.run(n, args, stride, results)
            else:
                self.surface.run(n, args, stride, results)
        if self.sticking:
            results[0] = &self.tau[0]
            if rates:
                self.slide_rate.run(n, args, stride, results)
            else:
                self.tangent.run(n, args, stride, results)
        return 0

    def settle(
        self, mode, double[:, ::1] y, const double[::1] t, held, bint rates=True
    ):
        """Move rows y = (q | v ...) at the times t (n,), in place, the shortest way by the masses
        to where the conditions of a mode hold: closed gaps are zero, what sticks is at its place
        ``held`` (n, nt), and, if ``rates``, neither has a rate."""
        cdef ptrdiff_t n = y.shape[0], begin = 0, i, count, turns = 3 if rates else 2
        self._enter(mode)
        self._rows(n, y.shape[1], t.shape[0])
        self._hold(n, held)
        if not self.m:
            return
        with nogil:
            while begin < n:
                count = min(self.capacity, n - begin)
                for i in range(count):
                    self.row[i], self.which[i], self.t[i] = i, begin + i, t[begin + i]
                self.settle_rows(count, y.shape[1], &y[begin, 0], turns)
                begin += count

    def reaction(
        self, mode, const double[:, ::1] y, const double[:, ::1] u, const double[::1] t
    ):
        """Accelerations and forces of rows of states (q | v ...) in a mode, with inputs u (n, nu)
        at times t (n,)."""
        cdef ptrdiff_t n = y.shape[0], nq = self.nq, begin = 0, i, j, k, count
        self._enter(mode)
        self._rows(n, y.shape[1], t.shape[0])
        if u.shape[0] != n or u.shape[1] != self.nu:
            raise ValueError(f"expected {self.nu} inputs of {n} rows")
        accelerations, normals, tangentials = (
            np.zeros((n, max(size, 1))) for size in (nq, self.nc, self.nt)
        )
        cdef double[:, ::1] a = accelerations, normal = normals, tangential = tangentials
        with nogil:
            while begin < n:
                count = min(self.capacity, n - begin)
                for i in range(count):
                    self.t[i] = t[begin + i]
                    for j in range(self.nu):
                        self.u[i * self.nu + j] = u[begin + i, j]
                    for j in range(2 * nq):
                        self.at[i * 2 * nq + j] = y[begin + i, j]
                self.slope(count, 2 * nq, &self.at[0], &self.slopes[0])
                for i in range(count):
                    for j in range(nq):
                        a[begin + i, j] = self.slopes[i * 2 * nq + nq + j]
                    self.spread(i, &normal[begin + i, 0], &tangential[begin + i, 0])
                begin += count
        return Reaction(accelerations, normals[:, : self.nc], tangentials[:, : self.nt])

    cdef void spread(self, ptrdiff_t i, double *normal, double *tangential) noexcept nogil:
        """The multipliers of row i as forces of surfaces and tangents."""
        cdef ptrdiff_t j, p
        cdef const double *lam = &self.lam[i * self.m]
        for j in range(self.nc):
            p = self.closed_at[j]
            normal[j] = lam[p] if p >= 0 else 0.0
        for j in range(self.nt):
            tangential[j] = 0.0
            if self.sticks_at[j] >= 0:
                tangential[j] = lam[self.sticks_at[j]]
            elif self.slides_at[j] >= 0:
                p = self.presses[self.slides_at[j]]
                tangential[j] = self.push[self.slides_at[j]] * (lam[p] if p >= 0 else 1.0)

    def _rows(self, n, width, times):
        """Refuse rows that do not fit together."""
        if width < 2 * self.nq or times != n:
            raise ValueError(f"expected {self.nq} coordinates and their rates at {n} times")

    def _hold(self, n, held):
        """Keep what sticks at its places."""
        if self.sticking:
            if held is None or held.shape != (n, self.nt):
                raise ValueError(f"expected places of {self.nt} tangents in {n} rows")
            self.held = held

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
        self, ptrdiff_t n, ptrdiff_t width, ptrdiff_t count, double *ends
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
        self.slope(n, width, &self.y[0], &self.slopes[0])
        if ends != NULL:
            for i in range(n):
                for c in range(nq):
                    ends[2 * nq * self.which[self.row[i]] + c] = self.slopes[i * width + nq + c]
        for k in range(count):
            for s in range(1, STAGE):
                self.add(n, width, s, count, &self.at[0])
                self.moment(n, (k + self.share[s]) / count)
                self.slope(n, width, &self.at[0], &self.slopes[s * total])
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
            if k + 1 < count or ends != NULL or self.m:
                self.moment(n, (k + 1.0) / count)
            if self.m:
                self.settle_rows(n, width, &self.y[0], 3)
            if k + 1 < count or ends != NULL:
                self.slope(n, width, &self.y[0], &self.slopes[0])
        if ends != NULL:
            for i in range(n):
                for c in range(nq):
                    ends[2 * nq * self.which[self.row[i]] + nq + c] = self.slopes[i * width + nq + c]
        for i in range(n):
            if not finite(2 * nq, &self.y[i * width]) and finite(2 * nq, &self.start[i * width]):
                self.error[i] = INFINITY
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
        const double *u0, const double *u1, double *ends
    ) except -1 nogil:
        """Integrate the rows ``which`` of y, at most ``capacity``, over the steps ``step``."""
        cdef ptrdiff_t i, c, left = n, again, count = 1
        cdef double worst
        cdef double *row
        for i in range(n):
            self.put(i, i, width, y, t, h, u0, u1)
            self.before[i] = INFINITY
        while left:
            self.integrate(left, width, count, ends)
            again, worst = 0, 0.0
            for i in range(left):
                if count < MOST_PARTS and ACCURACY < self.error[i] and not (
                    FALLING * self.before[self.row[i]] < self.error[i] < ROUNDED
                ):
                    worst = fmax(worst, self.error[i])
                    self.before[self.row[i]] = self.error[i]
                    self.put(again, self.row[i], width, y, t, h, u0, u1)
                    again += 1
                else:
                    self.worst = fmax(self.worst, self.error[i])
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
        const double[:, ::1] u1, mode=None, held=None
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
        mode : Mode, optional
            What is closed or rubs (:class:`dmoc.simulation.modes.Mode`); nothing, if left out.
            Rows begin where its conditions hold.
        held : array of shape (n, nt), optional
            Places that what sticks keeps.

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
        if not u0.shape[1] == u1.shape[1] == self.nu:
            raise ValueError(f"expected {self.nu} inputs")
        self._enter(mode)
        self._hold(n, held)
        if width > 2 * nq + 1 and (self.m or self.sliding):
            raise ValueError("expected (q | v), and work, of rows in a mode")
        if not (first.shape[0] == last.shape[0] == n):
            raise ValueError(f"expected {n} rows")
        for i in range(n):
            if not 0 <= first[i] <= last[i] <= N:
                raise ValueError(f"steps {first[i]} to {last[i]}: expected 0 to {N}")
        found = np.empty((n, 2, nq))
        cdef double[:, :, ::1] ends = found
        self.worst = 0.0
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
                        m, width, &y[0, 0], &t[0], &h[0], &u0[0, 0], &u1[0, 0], &ends[0, 0, 0]
                    )
                    j += 1
                begin += self.capacity
        return found

    # Simulation -----------------------------------------------------------------------------------

    def stay(
        self, mode, double[::1] y, const double[:, ::1] u, double h, ptrdiff_t first,
        const double[::1] shares, double[::1] reach
    ):
        """Simulate a state y = (q | v), in place, over steps of the size h with constant inputs, as
        long as it clearly keeps its mode: closed contacts push, friction holds what sticks, what
        slides goes on, and no other surface is touched.

        Parameters
        ----------
        u : array of shape (n, nu)
            Inputs of the steps, of which the first is number ``first`` of a simulation from zero.
        shares : array of shape (places,)
            Where in a step that is looked at beside its start, up to 1.
        reach : array of shape (3,)
            Largest coordinate, velocity and acceleration so far, measured by the masses, of which
            the sizes follow; made larger by what is met.

        Returns
        -------
        arrays of shapes (steps, 2 nq), (steps, nc) and (steps, nt)
            States, contact forces and friction forces at the ends of the steps that are done.
        """
        cdef ptrdiff_t nq = self.nq, n = u.shape[0], places = shares.shape[0], k = 0, i
        if not (y.shape[0] == 2 * nq and u.shape[1] == self.nu and reach.shape[0] == 3):
            raise ValueError(f"expected {nq} coordinates and {self.nu} inputs")
        if not 0 < places <= self.capacity:
            raise ValueError(f"expected 1 to {self.capacity} places")
        self._enter(mode)
        self.held = held = np.zeros((places, max(self.nt, 1)))
        states, normals, tangentials = (
            np.zeros((n, max(size, 1))) for size in (2 * nq, self.nc, self.nt)
        )
        cdef double[:, ::1] keep = held, ends = states, normal = normals, tangential = tangentials
        cdef double[:, ::1] rows = np.empty((places, 2 * nq))
        cdef double[:, ::1] inputs = np.empty((places, max(self.nu, 1)))
        cdef double[::1] begin = np.empty(places), span = np.empty(places)
        with nogil:
            while k < n:
                self.t[0] = (first + k) * h
                self.u[: self.nu] = u[k]
                self.values(1, 2 * nq, &y[0], False)
                self.measure(&y[0], h, reach)
                for i in range(places):
                    begin[i], span[i] = self.t[0], shares[i] * h
                    rows[i], inputs[i, : self.nu] = y, u[k]
                    keep[i, : self.nt] = self.tau[: self.nt]
                    self.which[i] = self.step[i] = i
                if not self.keeps(1, &y[0]):
                    break
                self.worst = 0.0
                self.advance_rows(
                    places, 2 * nq, &rows[0, 0], &begin[0], &span[0], &inputs[0, 0],
                    &inputs[0, 0], NULL
                )
                for i in range(places):
                    self.t[i] = begin[i] + span[i]
                    self.u[i * self.nu : (i + 1) * self.nu] = u[k]
                if self.worst > ASTRAY or not self.keeps(places, &rows[0, 0]):
                    break
                y[:] = rows[places - 1]
                ends[k] = y
                self.spread(places - 1, &normal[k, 0], &tangential[k, 0])
                k += 1
        return states[:k], normals[:k, : self.nc], tangentials[:k, : self.nt]

    cdef void measure(self, const double *y, double h, double[::1] reach) noexcept nogil:
        """Read the sizes of a motion off what it has reached, with the masses and forces of a
        state."""
        cdef ptrdiff_t nq = self.nq, i
        cdef double root
        for i in range(nq):
            root = sqrt(self.mass[i * nq + i])
            reach[2] = fmax(reach[2], fabs(self.f[i] / root))
            reach[1] = fmax(reach[1], fabs(root * y[nq + i]))
            reach[0] = fmax(reach[0], fabs(root * y[i]))
        reach[1] = fmax(reach[1], h * reach[2])
        reach[0] = fmax(reach[0], h * reach[1])
        for i in range(nq):
            root = sqrt(self.mass[i * nq + i])
            self.sizes[i] = reach[0] / root if reach[0] > 0 else 1.0
            self.sizes[nq + i] = reach[1] / root if reach[1] > 0 else 1.0

    cdef bint keeps(self, ptrdiff_t n, const double *y) except -1 nogil:
        """Whether n rows (q | v), at the times t and with the inputs u, clearly keep the mode."""
        cdef const double *args[DMOC_MOST]
        cdef ptrdiff_t stride[DMOC_MOST]
        cdef double *results[DMOC_MOST]
        cdef ptrdiff_t nq = self.nq, i, j, p
        cdef double rest
        args[0], args[1], args[2] = y, &self.t[0], &self.par[0]
        stride[0], stride[1], stride[2] = 2 * nq, 1, 0
        if self.nc:
            results[0] = &self.g[0]
            self.surface.run(n, args, stride, results)
        args[1], args[2], args[3] = y + nq, &self.t[0], &self.par[0]
        stride[1], stride[2], stride[3] = 2 * nq, 1, 0
        if self.sliding:
            results[0] = &self.tau[0]
            self.slide_rate.run(n, args, stride, results)
        self.slope(n, 2 * nq, y, &self.slopes[0])
        for i in range(n):
            for j in range(self.nc):
                p = self.closed_at[j]
                if not (self.lam[i * self.m + p] if p >= 0 else -self.g[i * self.nc + j]) > 0:
                    return False
            for j in range(self.nt):
                rest = 1.0
                if self.sticks_at[j] >= 0:
                    p = self.closed_at[self.support[j]] if self.support[j] >= 0 else -1
                    rest = self.mu[j] * (self.lam[i * self.m + p] if p >= 0 else 1.0)
                    rest -= fabs(self.lam[i * self.m + self.sticks_at[j]])
                elif self.slides_at[j] >= 0:
                    rest = -self.push[self.slides_at[j]] * self.tau[i * self.nt + j]
                if not rest > 0:
                    return False
        return True

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
        self._enter(None)
        with nogil:
            while k < end and not lost:
                y1[:] = y
                self.which[0], self.step[0] = 0, k
                self.advance_rows(
                    1, 2 * nq, &y1[0], &t[0], &h[0], &u0[0, 0], &u1[0, 0], &ends[0]
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


cdef bint finite(ptrdiff_t n, const double *x) noexcept nogil:
    cdef ptrdiff_t i
    for i in range(n):
        if not isfinite(x[i]):
            return False
    return True


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
