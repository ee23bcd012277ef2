"""Slopes of rows of states in a mode, from the kernels of a model."""

cdef class Dynamics(Conditions):
    """The equations of motion of one model in a mode."""
    cdef Rows dynamics, force, residual_jac
    cdef double[::1] at, rates, mass, f, Q, power, R_D
    cdef ptrdiff_t[::1] pivots, R_row, R_column
    # Places (n, nt) that what sticks keeps, and which of them are those of the rows.
    cdef const double[:, ::1] anchors
    cdef ptrdiff_t[::1] holds

    def __init__(self, kernels, par):
        super().__init__(kernels, par)
        cdef ptrdiff_t nq = self.nq, rows = self.capacity
        self.dynamics, self.force = Rows(kernels, "dynamics"), Rows(kernels, "force")
        self.residual_jac = Rows(kernels, "residual_jac")
        self.R_row, self.R_column = map(np.array, kernels.pattern("residual_jac", "R_D"))
        self.at, self.rates = _space(rows * 2 * nq), _space(rows * 2 * nq)
        self.u, self.power = _space(rows * self.nu), _space(rows)
        self.mass, self.f, self.Q = _space(rows * nq * nq), _space(rows * nq), _space(rows * nq)
        self.R_D = _space(rows * self.R_row.shape[0])
        self.pivots = np.zeros(rows * nq, dtype=np.intp)  # of all rows
        self.holds = np.zeros(rows, dtype=np.intp)
        self.anchors = np.zeros((1, max(self.nt, 1)))

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
        args[0], args[1], args[2] = y, y + nq, &self.u[0]
        args[3], args[4] = &self.t[0], &self.par[0]
        stride[0] = stride[1] = width
        stride[2], stride[3], stride[4] = self.nu, 1, 0
        results[0], results[1] = &self.mass[0], &self.f[0]
        self.dynamics.run(n, args, stride, results)
        if width == 2 * nq + 1:
            results[0], results[1] = &self.Q[0], &self.power[0]
            self.force.run(n, args, stride, results)
        if not self.free:
            self.gradients(n, width, y)
        for i in range(n):
            state, rate, M = y + i * width, out + i * width, &self.mass[i * nq * nq]
            for j in range(nq):
                rate[j], rate[nq + j] = state[nq + j], self.f[i * nq + j]
            if not self.free:
                self.conditions(i, state + nq, rate + nq)
            if not factored(M, &self.pivot[0], nq):
                for j in range(nq, width):
                    rate[j] = NAN
                for j in range(self.m):
                    self.lam[i * self.m + j] = NAN
                continue
            solved(M, &self.pivot[0], rate + nq, nq, 1)
            if self.m:
                self.react(i, M, rate + nq)
            if width == 2 * nq + 1:
                rate[2 * nq] = self.power[i]
                if not self.free:
                    rate[2 * nq] += self.contact_power(i, state + nq)
            elif width > 2 * nq:
                for j in range(nq):
                    self.pivots[i * nq + j] = self.pivot[j]
        if width > 2 * nq + 1:
            args[4], args[5] = out + nq, &self.par[0]
            stride[4], stride[5] = width, 0
            results[0] = &self.R_D[0]
            self.residual_jac.run(n, args, stride, results)
            for i in range(n):
                state, rate = y + i * width, out + i * width
                if rate[nq] == rate[nq]:
                    self.carry(i, state + 2 * nq, rate + 2 * nq)
        return 0

    cdef void carry(self, ptrdiff_t i, const double *X, double *X_dot) noexcept nogil:
        """X' = D X of row i, whose M is factored: M D = R below, by its stored entries."""
        cdef ptrdiff_t nq = self.nq, m = 2 * self.nq, stored = self.R_row.shape[0], e, c
        cdef const double *R = &self.R_D[i * stored]
        cdef const double *row
        cdef double *out
        for e in range(nq * m):
            X_dot[e], X_dot[nq * m + e] = X[nq * m + e], 0.0
        for e in range(stored):
            if self.R_column[e] < m:
                row, out = X + self.R_column[e] * m, X_dot + (nq + self.R_row[e]) * m
                for c in range(m):
                    out[c] += R[e] * row[c]
        solved(&self.mass[i * nq * nq], &self.pivots[i * nq], X_dot + nq * m, nq, m)

    cdef int project_rows(
        self, ptrdiff_t n, ptrdiff_t width, double *y, ptrdiff_t turns
    ) except -1 nogil:
        """Move n rows at the times t to where closed gaps and joints are zero and what sticks is at
        its place, and, in the third turn, to where none has a rate; grips that close wherever they
        are have rates alone."""
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
                        if turn < 2 and self.floats[j]:
                            self.wanted[self.closed_at[j]] = 0.0
                for j in range(self.nt):
                    if self.sticks_at[j] >= 0:
                        self.wanted[self.sticks_at[j]] = -self.tau[i * self.nt + j]
                        if turn < 2:
                            self.wanted[self.sticks_at[j]] += self.anchors[self.holds[i], j]
                for j in range(self.nj):
                    self.wanted[self.closed + self.sticking + j] = -self.phi[i * self.nj + j]
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
        """Masses, gradients, and gaps, tangential positions and joints, or their rates, of n
        rows."""
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
        if self.nj:
            results[0] = &self.phi[0]
            if rates:
                self.joint_rate.run(n, args, stride, results)
            else:
                self.joint.run(n, args, stride, results)
        return 0

    def project(
        self, mode, double[:, ::1] y, const double[::1] t, anchors, bint rates=True
    ):
        """Move rows y = (q | v ...) at the times t (n,), in place, the shortest way by the masses
        to where the conditions of a mode hold: closed gaps and joints are zero, what sticks is at
        its place ``anchors`` (n, nt), and, if ``rates``, none has a rate."""
        cdef ptrdiff_t n = y.shape[0], begin = 0, i, count, turns = 3 if rates else 2
        self._enter(mode)
        self._rows(n, y.shape[1], t.shape[0])
        self._anchor(n, anchors)
        if not self.m:
            return
        with nogil:
            while begin < n:
                count = min(self.capacity, n - begin)
                for i in range(count):
                    self.holds[i], self.t[i] = begin + i, t[begin + i]
                self.project_rows(count, y.shape[1], &y[begin, 0], turns)
                begin += count

    def reaction(
        self, mode, const double[:, ::1] y, const double[:, ::1] u, const double[::1] t
    ):
        """Accelerations and forces of rows of states (q | v ...) in a mode, with inputs u (n, nu)
        at times t (n,); forces are not numbers where the conditions of the mode contradict one
        another."""
        cdef ptrdiff_t n = y.shape[0], nq = self.nq, begin = 0, i, j, k, count
        self._enter(mode)
        self._rows(n, y.shape[1], t.shape[0])
        if u.shape[0] != n or u.shape[1] != self.nu:
            raise ValueError(f"expected {self.nu} inputs of {n} rows")
        accelerations, normals, tangentials, joints = (
            np.zeros((n, max(size, 1))) for size in (nq, self.nc, self.nt, self.nj)
        )
        cdef double[:, ::1] a = accelerations, normal = normals, tangential = tangentials
        cdef double[:, ::1] joint = joints
        with nogil:
            while begin < n:
                count = min(self.capacity, n - begin)
                for i in range(count):
                    self.t[i] = t[begin + i]
                    for j in range(self.nu):
                        self.u[i * self.nu + j] = u[begin + i, j]
                    for j in range(2 * nq):
                        self.at[i * 2 * nq + j] = y[begin + i, j]
                self.slope(count, 2 * nq, &self.at[0], &self.rates[0])
                for i in range(count):
                    for j in range(nq):
                        a[begin + i, j] = self.rates[i * 2 * nq + nq + j]
                    for j in range(self.m if self.contradicted[i] else 0):
                        self.lam[i * self.m + j] = NAN
                    self.spread(i, &normal[begin + i, 0], &tangential[begin + i, 0])
                    for j in range(self.nj):
                        joint[begin + i, j] = self.lam[(i + 1) * self.m - self.nj + j]
                begin += count
        return Reaction(
            accelerations, normals[:, : self.nc], tangentials[:, : self.nt], joints[:, : self.nj]
        )

    def _rows(self, n, width, times):
        """Refuse rows that do not fit together."""
        if width < 2 * self.nq or times != n:
            raise ValueError(f"expected {self.nq} coordinates and their rates at {n} times")

    def _anchor(self, n, anchors):
        """Keep what sticks at its places."""
        if self.sticking:
            if anchors is None or anchors.shape != (n, self.nt):
                raise ValueError(f"expected places of {self.nt} tangents in {n} rows")
            self.anchors = anchors


# Two coordinates are many models': constant numbers unroll the loops.


cdef inline bint factored(double *M, ptrdiff_t *pivot, ptrdiff_t nq) noexcept nogil:
    """The factors of masses in place; False where they are singular."""
    return factor(M, pivot, 2, 2) if nq == 2 else factor(M, pivot, nq, nq)


cdef inline void solved(
    const double *LU, const ptrdiff_t *pivot, double *B, ptrdiff_t nq, ptrdiff_t columns
) noexcept nogil:
    """Solve M A = B in place, B of shape (nq, columns)."""
    if nq != 2:
        solve(LU, pivot, B, nq, nq, columns)
    elif columns == 1:
        solve(LU, pivot, B, 2, 2, 1)
    else:
        solve(LU, pivot, B, 2, 2, 4)
