"""One leg of a step: its equations, and where it is."""

cdef enum:
    NEWTON_LIMIT = 50
    MOST_HITS = 100     # collisions within one step before the motion counts as Zeno
    ATTENTION = 20      # looks for Ctrl-C in a second of computing

cdef double TOLERANCE = 1e-14        # of a Newton step relative to the coordinates
cdef double STALLED = 1e-10          # the same, where Newton's method makes no progress any more
cdef double GAP_TOLERANCE = 1e-13    # of a gap relative to its slopes and the coordinates: what Newton's steps leave; more counts as crossed
cdef double RATE_TOLERANCE = NOISE   # a rate of a gap below it, relative to its slopes and the velocities, is a rounding error
cdef double SHORTEST_LEG = 1e-9      # share of a step below which a leg is replaced by its limit: its equations divide by s
cdef double SINGULAR = 1e-15         # a pivot of the mass matrix below it, relative to the diagonal, is none


cdef bint _factor(double[:, ::1] M, int n) noexcept nogil:
    """Cholesky factor of M in its lower triangle; False if M is not clearly positive definite."""
    cdef int i, j, k
    cdef double diagonal
    for j in range(n):
        diagonal = M[j, j]
        for k in range(j):
            M[j, j] -= M[j, k] * M[j, k]
        if not (isfinite(diagonal) and M[j, j] > SINGULAR * fabs(diagonal)):
            return False
        M[j, j] = sqrt(M[j, j])
        for i in range(j + 1, n):
            for k in range(j):
                M[i, j] -= M[i, k] * M[j, k]
            M[i, j] /= M[j, j]
    return True


cdef void _solve_factored(double[:, ::1] L, double[::1] b, int n) noexcept nogil:
    """Solve L L^T x = b in place."""
    cdef int i, k
    for i in range(n):
        for k in range(i):
            b[i] -= L[i, k] * b[k]
        b[i] /= L[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            b[i] -= L[k, i] * b[k]
        b[i] /= L[i, i]


cdef class Leg:
    """A leg of one model with given parameters, from (q_a, p) at the time t."""
    cdef readonly int nq, nu, nc, ni
    cdef readonly list collisions, undecided
    cdef readonly tuple unfinished
    cdef object names, model
    cdef Call step, step_jac, impact, impact_jac, surface, slope, dynamics, momentum, total_energy
    cdef double[:, ::1] q_a, q_b, q_i, t, now, r_i, r_i_z, u, h, r_minus, r_plus, r_minus_z, e_plus, e_minus, e_minus_z
    cdef double[:, ::1] q_g, g, g_q, v_g, mass, force, p_zero, energy, A, L
    cdef ptrdiff_t[::1] pivot, r_row, r_col, i_row, i_col, e_col, g_row, g_col
    cdef double[:, ::1] shapes
    cdef double[::1] share, phi
    cdef double[::1] b, p, normal, velocity, restitution, weight, tolerance, rates, rate_size, start_gap, rates_before
    cdef long number
    cdef double lam, lam_limit, e_before, e, approach, inertia, largest, fastest, full
    cdef bint after_impact
    cdef clock_t heard

    def __init__(self, kernels, par, restitution):
        cdef int nq = len(kernels.coordinates), nu = len(kernels.inputs), nc = len(kernels.surfaces)
        scheme = DISCRETISATIONS[kernels.manifest.order]
        cdef int ni = nq * scheme.inside
        self.shapes, self.share, self.phi = scheme.shapes, scheme.nodes, np.zeros(scheme.degree + 1)
        self.nq, self.nu, self.nc, self.ni = nq, nu, nc, ni
        self.restitution = np.append(restitution, 1.0)
        self.names, self.model = kernels.surfaces, Model(kernels, np.asarray(par))
        self.collisions, self.undecided = [], []

        def block(size):
            return np.zeros((1, size))

        def bound(kernel, *inputs):
            """A kernel, and the arrays that it writes."""
            outputs = kernels.manifest.kernels[kernel]["outputs"]
            results = tuple(block(len(o["rows"]) if "rows" in o else o["shape"][0]) for o in outputs)
            return Call(kernels, kernel, tuple(map(np.asarray, inputs)), results), *results

        self.q_a, self.q_b, self.u, self.h = block(nq), block(nq), block(nu), block(1)
        self.t, self.now, self.q_i, self.q_g, self.v_g = block(1), block(1), block(ni), block(nq), block(nq)
        leg = self.q_a, self.q_b, self.u, self.u, self.h, self.t, self.q_i, par
        self.step, self.r_minus, self.r_plus, _, self.r_i = bound("step", *leg)
        self.step_jac, self.r_minus_z, _, _, self.r_i_z = bound("step_jac", *leg)
        self.impact, self.e_plus, self.e_minus = bound("impact", *leg)
        self.impact_jac, _, self.e_minus_z = bound("impact_jac", *leg)
        self.r_row, self.r_col = map(np.array, kernels.pattern("step_jac", "r_minus_D"))
        self.i_row, self.i_col = map(np.array, kernels.pattern("step_jac", "r_i_D"))
        self.e_col = np.array(kernels.pattern("impact_jac", "e_minus_D")[1])
        if nc:
            self.surface, self.g = bound("surface", self.q_g, self.now, par)
            self.slope, self.g_q = bound("surface_jac", self.q_g, self.now, par)
            self.g_row, self.g_col = map(np.array, kernels.pattern("surface_jac", "g_D"))
        self.dynamics, self.mass, self.force = bound("dynamics", self.q_g, self.v_g, self.u, self.now, par)
        self.momentum, self.p_zero = bound("momentum", self.q_g, self.v_g, self.now, par)
        self.total_energy, self.energy = bound("energy", self.q_g, self.v_g, self.now, par)
        self.A, self.L = np.zeros((nq + ni + 1, nq + ni + 1)), np.zeros((nq, nq))
        self.b, self.p = np.zeros(nq + ni + 1), np.zeros(nq)
        self.pivot = np.zeros(nq + ni + 1, dtype=np.intp)
        self.normal, self.velocity, self.weight = np.zeros(nq + 1), np.zeros(nq), np.zeros(nq)
        self.tolerance, self.rates, self.rate_size, self.start_gap = np.zeros(nc), np.zeros(nc), np.zeros(nc), np.zeros(nc)
        self.rates_before = np.zeros(nc)
        self.largest, self.fastest = 0.0, 0.0
        self.heard = clock()

    cdef int listen(self) except -1 nogil:
        """Let Ctrl-C through now and then."""
        if clock() - self.heard > CLOCKS_PER_SEC // ATTENTION:
            with gil:
                PyErr_CheckSignals()
            self.heard = clock()
        return 0

    # Where the motion is ---------------------------------------------------------------------------------------------

    cdef int find_velocity(self) except -1 nogil:
        """velocity = M^-1 (p - dL/dv(q_g, 0)) at the time ``now``, with the factor L of M and the weights of the coordinates."""
        cdef int i, j, n = self.nq
        self.dynamics.run()
        self.momentum.run()
        for i in range(n):
            self.b[i] = self.p[i] - self.p_zero[0, i]
            for j in range(n):
                self.L[i, j] = self.mass[0, i * n + j]
        if not _factor(self.L, n):
            with gil:
                raise SimulationError(
                    f"the mass matrix at t = {self.now[0, 0]:.6g} s is singular or not positive definite: check the parameters, and stop before "
                    "the motion gets there."
                )
        _solve_factored(self.L, self.b, n)
        for i in range(n):
            self.velocity[i] = self.b[i]
            self.weight[i] = sqrt(self.mass[0, i * n + i])
            self.fastest = max(self.fastest, self.weight[i] * fabs(self.velocity[i]))
        return 0

    cdef void grow(self) noexcept nogil:
        """Keep the largest coordinate and way of a leg, measured by the masses: what rounding errors are compared with."""
        cdef int i
        for i in range(self.nq):
            self.largest = max(self.largest, self.weight[i] * fabs(self.q_b[0, i]), self.weight[i] * fabs(self.q_b[0, i] - self.q_a[0, i]))

    cdef int at_start(self, double h) except -1 nogil:
        """Velocity, gaps, their rates and tolerances at the start of the leg to come."""
        cdef int i, j, k
        for i in range(self.nq):
            self.q_g[0, i] = self.q_a[0, i]
        self.now[0, 0] = self.t[0, 0]
        self.find_velocity()
        for i in range(self.nq):
            self.largest = max(self.largest, self.weight[i] * fabs(self.q_a[0, i]), h * self.weight[i] * fabs(self.velocity[i]))
        if not self.nc:
            return 0
        self.surface.run()
        self.slope.run()
        for j in range(self.nc):
            self.start_gap[j] = self.g[0, j]
            self.rate_size[j] = self.tolerance[j] = 0.0
        for k in range(self.g_row.shape[0]):
            j, i = <int>self.g_row[k], <int>self.g_col[k]
            if i == self.nq:
                self.rate_size[j] += fabs(self.g_q[0, k])
                self.tolerance[j] += GAP_TOLERANCE * fabs(self.g_q[0, k]) * max(fabs(self.t[0, 0]), h)
            else:
                self.rate_size[j] += fabs(self.g_q[0, k]) * self.fastest / self.weight[i]
                self.tolerance[j] += GAP_TOLERANCE * fabs(self.g_q[0, k]) * self.largest / self.weight[i]
        self.find_rates()
        return 0

    cdef void find_rates(self) noexcept nogil:
        """dg/dt of every surface with the slopes and the velocity as they are."""
        cdef int k
        for k in range(self.nc):
            self.rates[k] = 0.0
        for k in range(self.g_row.shape[0]):
            self.rates[self.g_row[k]] += self.g_q[0, k] * (1.0 if self.g_col[k] == self.nq else self.velocity[self.g_col[k]])

    cdef int contact_at_start(self, double h) except -2 nogil:
        """Index of a surface that the motion from (q_a, p) meets in less than the shortest leg; -1 if there is none."""
        cdef int j
        for j in range(self.nc):
            if self.rates[j] > 0 and self.g[0, j] > self.tolerance[j]:
                return j
            if self.rates[j] > RATE_TOLERANCE * self.rate_size[j] and self.g[0, j] > -(self.tolerance[j] + SHORTEST_LEG * h * self.rates[j]):
                return j
        return -1

    cdef int ended(self, double t) except -1 nogil:
        """As if a leg had ended in (q_b, p) at the time t."""
        cdef int i
        for i in range(self.nq):
            self.q_g[0, i] = self.q_b[0, i]
            self.r_plus[0, i] = self.p[i]
        self.now[0, 0] = t
        self.find_velocity()
        for i in range(self.nq):
            self.v_g[0, i] = self.velocity[i]
        self.total_energy.run()
        self.e_plus[0, 0] = -self.energy[0, 0]
        for i in range(self.nq):
            self.v_g[0, i] = 0.0
        return 0

    # One leg ---------------------------------------------------------------------------------------------------------

    cdef int column(self, ptrdiff_t z) noexcept nogil:
        """Position among the unknowns (q_b, q_i) of a leg of a position z in x_k = (q_k, q_kp1, u_k, u_kp1, h, t_k, q_i); -1 for none."""
        cdef ptrdiff_t n = self.nq, inside = 2 * (self.nq + self.nu) + 2
        if n <= z < 2 * n:
            return <int>(z - n)
        return <int>(n + z - inside) if z >= inside else -1

    cdef int leg(self, double s) except -1 nogil:
        """Solve for q_b and q_i (and lam after an impact) at the end of a leg of duration s; 0 if Newton's method fails."""
        cdef int i, j, k, it, n = self.nq, m = self.nq + self.ni, size = self.nq + self.ni + (1 if self.after_impact else 0)
        cdef double change, previous = 1e300
        self.h[0, 0] = s
        self.lam = self.lam_limit
        for i in range(n):
            self.q_b[0, i] = self.q_a[0, i] + s * self.velocity[i]
        for i in range(self.ni):
            self.q_i[0, i] = self.q_a[0, i % n] + self.share[2 + i // n] * s * self.velocity[i % n]
        for it in range(NEWTON_LIMIT):
            self.listen()
            self.step.run()
            self.step_jac.run()
            for i in range(size):
                for k in range(size):
                    self.A[i, k] = 0.0
            for i in range(n):
                self.b[i] = self.p[i] + self.r_minus[0, i]
            for i in range(self.ni):
                self.b[n + i] = self.r_i[0, i]
            for k in range(self.r_row.shape[0]):
                j = self.column(self.r_col[k])
                if j >= 0:
                    self.A[self.r_row[k], j] = self.r_minus_z[0, k]
            for k in range(self.i_row.shape[0]):
                j = self.column(self.i_col[k])
                if j >= 0:
                    self.A[n + self.i_row[k], j] = self.r_i_z[0, k]
            if self.after_impact:
                self.impact.run()
                self.impact_jac.run()
                for i in range(n):
                    self.b[i] -= self.lam * self.normal[i]
                    self.A[i, m] = -self.normal[i]
                self.b[m] = (self.e * (self.e_before - self.e_minus[0, 0] - self.lam * self.normal[n])
                             - (1 - self.e) * self.lam / 2 * (self.approach - self.lam * self.inertia))
                self.A[m, m] = -self.e * self.normal[n] - (1 - self.e) * (self.approach / 2 - self.lam * self.inertia)
                for k in range(self.e_col.shape[0]):
                    j = self.column(self.e_col[k])
                    if j >= 0:
                        self.A[m, j] = -self.e * self.e_minus_z[0, k]
            if not factor(&self.A[0, 0], &self.pivot[0], size, self.A.shape[1]):
                return 0
            solve(&self.A[0, 0], &self.pivot[0], &self.b[0], size, self.A.shape[1], 1)
            change = 0.0
            for i in range(n):
                self.q_b[0, i] -= self.b[i]
            for i in range(m):
                change = max(change, self.weight[i % n] * fabs(self.b[i]))
            for i in range(self.ni):
                self.q_i[0, i] -= self.b[n + i]
            if self.after_impact:
                self.lam -= self.b[m]
            if not isfinite(change):
                return 0
            self.grow()
            if change <= TOLERANCE * self.largest or (change >= 0.5 * previous and change <= STALLED * self.largest):
                self.step.run()
                self.impact.run()
                return 1
            previous = change
        return 0

    # Along the leg that was just solved.

    cdef int place(self, double x) except -1 nogil:
        """q_g and now at the share x of the leg."""
        cdef int i
        self.weigh(x, 0)
        for i in range(self.nq):
            self.q_g[0, i] = self.along(i)
        self.now[0, 0] = self.t[0, 0] + x * self.h[0, 0]
        return 0

    cdef void weigh(self, double x, int derivative) noexcept nogil:
        """Shape functions at the share x, or their derivatives."""
        cdef int a, k, last = <int>self.phi.shape[0] - 1
        for a in range(last + 1):
            self.phi[a] = 0.0
            for k in range(last, derivative - 1, -1):
                self.phi[a] = self.phi[a] * x + self.shapes[a, k] * (k if derivative else 1)

    cdef double along(self, int i) noexcept nogil:
        """Coordinate i of the leg's polynomial, or its derivative, as weighed."""
        cdef int a
        cdef double value = self.phi[0] * self.q_a[0, i] + self.phi[1] * self.q_b[0, i]
        for a in range(self.ni // self.nq):
            value += self.phi[2 + a] * self.q_i[0, a * self.nq + i]
        return value
