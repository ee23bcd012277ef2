"""Nodes of a free motion, their sizes, and whether the motion holds together as it is planned
(dmoc.simulation.sizes, dmoc.check.arcs, dmoc.check.consistency)."""

cdef double ON_ARC = _arcs.ON_ARC, STILL = _sizes.STILL, FORCED = _sizes.FORCED
cdef double ROOM = _sizes.ROOM, DIGITS = _sizes.DIGITS, NOTHING = _sizes.NOTHING
cdef double LEVEL = _sizes.LEVEL, JOINED = _plan.JOINED, UNBALANCED = _plan.UNBALANCED
cdef double OFF_SURFACE = _plan.OFF_SURFACE, SINGULAR = _plan.SINGULAR
cdef double GAP_ERROR = _flow.GAP_ERROR
# A node that lies on a surface belongs to a hit so many steps away.
cdef double BESIDE = 2.5


cdef class FreeNodes(Surfaces):
    """n nodes and N steps of P phases of a free motion; event i is behind phase i."""
    cdef ptrdiff_t n, N, P, slopes_stored
    cdef Rows momentum, energy, surface_jac, input_matrix
    cdef ptrdiff_t[::1] g_row, g_col, begins, hit, phase_of
    cdef double[:, ::1] q, v, p, u_begin, u_end, q_inside, box, input_box, numbers
    cdef double[:, :, ::1] recorded
    cdef double[::1] T, h, e, begins_at
    cdef unsigned char[::1] watched
    # Those of all rows, of which one is looked at.
    cdef ptrdiff_t count
    cdef double[:, ::1] all_par, all_T
    cdef double[:, :, ::1] all_q, all_v, all_p, all_begin, all_end, all_inside
    cdef double[:, :, ::1] all_boxes, all_input_boxes, all_numbers
    cdef double[:, :, :, ::1] all_recorded
    # At the nodes: masses, forces of the position, momenta, energies, gaps, stored slopes.
    cdef double[::1] M, F, moment_of, E, gaps, stored, inertia, root
    # Sizes, and gaps that no step exceeds without a contact at the places of a step.
    cdef double[::1] size_q, size_v, size_y, upper, near, full, room, push
    cdef readonly double[::1] size_p, size_gap, size_rate
    cdef bytes laid  # the first nodes of the phases that arrays are laid out for
    cdef double time, kinetic, exchanged
    cdef readonly double energy_size, acceleration

    def __init__(self, kernels):
        cdef ptrdiff_t nq
        nothing = np.zeros((1, len(kernels.parameters)))
        super().__init__(kernels, nothing, np.ones(2 * len(kernels.coordinates) + 1), None)
        nq = self.nq
        self.momentum, self.energy = Rows(kernels, "momentum"), Rows(kernels, "energy")
        self.g_row = self.g_col = np.zeros(0, dtype=np.intp)
        if self.nc:
            self.surface_jac = Rows(kernels, "surface_jac")
            self.g_row, self.g_col = map(np.array, kernels.pattern("surface_jac", "g_D"))
        if self.nu:
            self.input_matrix = Rows(kernels, "input_matrix")
        self.slopes_stored = self.g_row.shape[0]
        self.inertia, self.root, self.size_q, self.size_v, self.size_p = (
            _space(nq) for _ in range(5)
        )
        self.size_gap, self.size_rate, self.near = (_space(self.nc) for _ in range(3))
        self.near[:] = -1.0  # nothing rests on a surface
        self.full, self.room = _space((self.nc + 1) * (nq + 1)), _space(nq * (self.nu + 3))
        self.upper, self.size_y = _space(self.nc * PLACES.shape[0]), _space(2 * nq)
        self.push = _space(nq * (self.nu + 2) + self.nu)

    def load(self, par, motions):
        """Take rows of parameters, shape (R, npar), and the arrays of R motions
        (free_motion.py)."""
        self.entered = NONE
        self._enter(None)
        self.all_par = np.hstack([par, np.zeros((len(par), 1))])  # there is at least one number
        (
            self.all_q, self.all_v, self.all_p, self.all_T, self.begins, self.all_begin,
            self.all_end, self.all_inside, self.hit, self.all_numbers, self.all_recorded,
            self.all_boxes, self.all_input_boxes, self.e, self.watched,
        ) = motions
        self.count, self.n = self.all_T.shape[0], self.all_T.shape[1]
        self.P, self.N = self.begins.shape[0] - 1, self.all_begin.shape[1]
        if self.laid != bytes(self.begins):
            nq, n, self.laid = self.nq, self.n, bytes(self.begins)
            self.M, self.F, self.moment_of = (_space(n * size) for size in (nq * nq, nq, nq))
            self.E, self.gaps = _space(n), _space(n * self.nc)
            self.stored = _space(n * self.slopes_stored)
            self.h, self.begins_at = _space(self.N), _space(self.N)
            self.phase_of = np.zeros(self.N, dtype=np.intp)
            self._steps()
            self._segments()
            self._run()

    cdef void look_at(self, ptrdiff_t row) noexcept nogil:
        """Make a row the motion that is looked at."""
        cdef ptrdiff_t i, k, at = 0
        self.par, self.T = self.all_par[row], self.all_T[row]
        self.q, self.v, self.p = self.all_q[row], self.all_v[row], self.all_p[row]
        self.u_begin, self.u_end = self.all_begin[row], self.all_end[row]
        self.q_inside, self.numbers = self.all_inside[row], self.all_numbers[row]
        self.recorded = self.all_recorded[row]
        self.box, self.input_box = self.all_boxes[row], self.all_input_boxes[row]
        for i in range(self.P):
            for k in range(self.begins[i], self.begins[i + 1] - 1):
                self.phase_of[at], self.begins_at[at] = i, self.T[k]
                self.h[at] = self.T[k + 1] - self.T[k]
                at += 1
        self.time = self.T[self.n - 1] - self.T[0]

    cdef void arguments(self, const double **args, ptrdiff_t *stride) noexcept nogil:
        """The nodes as (q, v, t, parameters)."""
        args[0], args[1], args[2], args[3] = &self.q[0, 0], &self.v[0, 0], &self.T[0], &self.par[0]
        stride[0] = stride[1] = self.nq
        stride[2], stride[3] = 1, 0

    cdef int look_at_nodes(self) except -1 nogil:
        """What the model makes of the nodes."""
        cdef const double *args[DMOC_MOST]
        cdef ptrdiff_t stride[DMOC_MOST]
        cdef double *results[DMOC_MOST]
        cdef ptrdiff_t i
        self.arguments(args, stride)
        results[0] = &self.moment_of[0]
        self.momentum.run(self.n, args, stride, results)
        results[0] = &self.E[0]
        self.energy.run(self.n, args, stride, results)
        args[1], args[2] = args[2], args[3]
        stride[1], stride[2] = 1, 0
        if self.nc:
            results[0] = &self.gaps[0]
            self.surface.run(self.n, args, stride, results)
            results[0] = &self.stored[0]
            self.surface_jac.run(self.n, args, stride, results)
        for i in range(self.nq + self.nu):
            self.room[i] = 0.0
        args[1] = args[2] = &self.room[0]  # at rest, without inputs
        args[3], args[4] = &self.T[0], &self.par[0]
        stride[1], stride[2], stride[3], stride[4] = 0, 0, 1, 0
        results[0], results[1] = &self.M[0], &self.F[0]
        return self.dynamics.run(self.n, args, stride, results)

    cdef bint measure_sizes(self) except -1 nogil:
        """The sizes of the motion; False where it has none."""
        cdef ptrdiff_t nq = self.nq, i, k, c
        cdef double most = 0.0, speed, strongest, rounding, form, shortest = INFINITY
        cdef double low, high, energy, rounded = 0.0, way, least
        cdef double *largest = &self.room[0]
        for i in range(nq):
            self.inertia[i] = 0.0
        for k in range(self.n):
            for i in range(nq):
                form = fabs(self.M[(k * nq + i) * nq + i])
                if not isfinite(form):
                    return False
                self.inertia[i] = fmax(self.inertia[i], form)
                most = fmax(most, form)
        self.kinetic = 0.0
        for k in range(self.n):
            form = 0.0
            for i in range(nq):
                for c in range(nq):
                    form += self.v[k, i] * self.M[(k * nq + i) * nq + c] * self.v[k, c]
            if not isfinite(form):
                return False
            self.kinetic = fmax(self.kinetic, form / 2)
            rounded = fmax(rounded, DIGITS * fabs(self.E[k]))
        for i in range(nq):
            self.inertia[i] = self.inertia[i] if self.inertia[i] > 0 else most
            self.root[i] = sqrt(self.inertia[i])
        strongest = self.strongest_force(largest)
        speed = fmax(STILL * sqrt(2 * self.kinetic), FORCED * strongest * self.time)
        speed = fmax(fmax(speed, ROOM * self.way_around() / self.time), NOTHING)
        for k in range(self.N):
            shortest = fmin(shortest, self.h[k])
        energy = fmax(self.kinetic, rounded)
        form, least = 0.0, 0.0
        for i in range(nq):
            low, high, rounding = INFINITY, -INFINITY, 0.0
            self.size_v[i] = self.size_p[i] = 0.0
            for k in range(self.n):
                low, high = fmin(low, self.q[k, i]), fmax(high, self.q[k, i])
                rounding = fmax(rounding, fabs(self.q[k, i]))
                self.size_v[i] = fmax(self.size_v[i], fabs(self.v[k, i]))
                self.size_p[i] = fmax(self.size_p[i], fabs(self.p[k, i]))
            rounding *= DIGITS
            way, most = speed * self.time / self.root[i], fmax(
                speed / self.root[i], rounding / shortest
            )
            self.size_q[i] = fmax(fmax(high - low, way), rounding)
            self.size_v[i] = fmax(self.size_v[i], most)
            self.size_p[i] = fmax(self.size_p[i], self.inertia[i] * most)
            form += largest[i] * way
            least += most * self.size_p[i]
        self.energy_size = fmax(energy, fmax(form, least))
        self.exchanged = fmax(self.energy_size, self.lifted())
        self.acceleration = fmax(strongest, fmax(sqrt(2 * self.kinetic), speed) / self.time)
        self.measure_gaps()
        for i in range(nq):
            self.size_y[i], self.size_y[nq + i] = self.size_q[i], self.size_v[i]
            self.sizes[i], self.sizes[nq + i] = self.size_q[i], self.size_v[i]
        self.sizes[2 * nq] = self.exchanged
        return isfinite(self.exchanged) and isfinite(self.acceleration)

    cdef double strongest_force(self, double *largest) except? -1 nogil:
        """The largest forces of each coordinate, and the strongest of them by the masses."""
        cdef const double *args[DMOC_MOST]
        cdef ptrdiff_t stride[DMOC_MOST]
        cdef double *results[DMOC_MOST]
        cdef ptrdiff_t nq = self.nq, nu = self.nu, i, j, k, side, step
        cdef double sum, strongest = 0.0
        cdef double *F = &self.push[0]
        cdef double *B = &self.push[nq]
        cdef double *spare = &self.push[nq + nq * nu]
        cdef double[:, ::1] u
        for i in range(nq):
            largest[i] = 0.0
        for i in range(nq + nu):
            spare[i] = 0.0
        for i in range(5):
            stride[i] = 0
        args[4] = &self.par[0]
        for k in range(self.n):
            args[0], args[1], args[2], args[3] = &self.q[k, 0], &self.v[k, 0], spare, &self.T[k]
            results[0], results[1] = &self.mass[0], F
            self.dynamics.run(1, args, stride, results)
            for i in range(nq):
                largest[i] = fmax(largest[i], fmax(fabs(F[i]), fabs(self.F[k * nq + i])))
            if not nu:
                continue
            args[2], results[0] = self.input_at(k, 0), B
            self.input_matrix.run(1, args, stride, results)
            for side in range(2):
                args[2] = self.input_at(k, side)
                for i in range(nq):
                    sum = 0.0
                    for j in range(nu):
                        sum += fabs(B[i * nu + j]) * fabs(args[2][j])
                    largest[i] = fmax(largest[i], sum)
        for i in range(nq):
            strongest = fmax(strongest, largest[i] / self.root[i])
        return strongest

    cdef const double *input_at(self, ptrdiff_t node, int side) noexcept nogil:
        """The inputs before (0) or after (1) a node, of the steps that end and begin there."""
        cdef ptrdiff_t i = 0, step
        while node >= self.begins[i + 1]:
            i += 1
        step = node - i  # that begins there
        if node == self.begins[i + 1] - 1:
            return &self.u_end[step - 1, 0]
        if side == 0 and node > self.begins[i]:
            return &self.u_end[step - 1, 0]
        return &self.u_begin[step, 0]

    cdef double lifted(self) noexcept nogil:
        """The largest work that forces of the position do on the way of one coordinate."""
        cdef ptrdiff_t nq = self.nq, i, k
        cdef double work, most, least, largest = 0.0
        for i in range(nq):
            work = most = least = 0.0
            for k in range(self.n - 1):
                work += (self.F[(k + 1) * nq + i] + self.F[k * nq + i]) / 2 * (
                    self.q[k + 1, i] - self.q[k, i]
                )
                most, least = fmax(most, work), fmin(least, work)
            largest = fmax(largest, most - least)
        return largest

    cdef double way_around(self) noexcept nogil:
        """The shortest way, by the masses, to a surface and between the limits of a coordinate."""
        cdef ptrdiff_t nq = self.nq, i, j, c
        cdef double way, square, least = INFINITY
        for i in range(nq):
            way = (self.box[i, 1] - self.box[i, 0]) * self.root[i]
            if 0 < way < least:
                least = way
        self.fill(&self.stored[0], &self.full[0])
        for j in range(self.nc):
            square = 0.0
            for c in range(nq):
                way = self.full[j * (nq + 1) + c] / self.root[c]
                square += way * way
            way = fabs(self.gaps[j]) / sqrt(square)
            if 0 < way < least:
                least = way
        return least if least < INFINITY else 0.0

    cdef void fill(self, const double *stored, double *full) noexcept nogil:
        """Slopes of all gaps (nc, nq + 1) from those that are stored."""
        cdef ptrdiff_t k, width = self.nq + 1
        for k in range(self.nc * width):
            full[k] = 0.0
        for k in range(self.slopes_stored):
            full[self.g_row[k] * width + self.g_col[k]] = stored[k]

    cdef void measure_gaps(self) noexcept nogil:
        """Sizes of gaps and of their rates, and what no step exceeds without a contact."""
        cdef ptrdiff_t nq = self.nq, width = self.nq + 1, i, j, k, places = PLACES.shape[0]
        cdef double place, rate, slope
        for k in range(self.nc * width):
            self.full[k] = 0.0
        for k in range(self.n):
            for i in range(self.slopes_stored):
                j = self.g_row[i] * width + self.g_col[i]
                slope = fabs(self.stored[k * self.slopes_stored + i])
                self.full[j] = fmax(self.full[j], slope)
        for j in range(self.nc):
            place = rate = 0.0
            for i in range(nq):
                place += self.full[j * width + i] * self.size_q[i]
                rate += self.full[j * width + i] * self.size_v[i]
            place += self.full[j * width + nq] * self.time
            rate += self.full[j * width + nq]
            self.size_gap[j], self.size_rate[j] = fmax(place, NOTHING), fmax(rate, NOTHING)
            slope = GAP_ERROR * self.size_gap[j] if self.watched[j] else INFINITY
            for k in range(places):
                self.upper[k * self.nc + j] = slope

    # As it is planned -----------------------------------------------------------------------------

    cdef bint holds_together(self) noexcept nogil:
        """Whether the plan is in order, lies on no surface but where it hits it, and exceeds no
        limit of an input."""
        cdef ptrdiff_t nq = self.nq, i, j, k
        for k in range(self.N):
            if not self.h[k] > 0:
                return False
            for j in range(self.nu):
                for i in range(2):
                    if not (
                        self.input_box[j, 0] <= (self.u_end if i else self.u_begin)[k, j]
                        <= self.input_box[j, 1]
                    ):
                        return False
        for k in range(self.n):
            for i in range(nq):
                if not fabs(self.p[k, i] - self.moment_of[k * nq + i]) <= (
                    UNBALANCED * self.size_p[i]
                ):
                    return False
            if not self.positive(k):
                return False
        for i in range(self.P):
            for k in range(self.begins[i], self.begins[i + 1]):
                for j in range(self.nc):
                    if not self.watched[j]:
                        continue
                    if not isfinite(self.gaps[k * self.nc + j]):
                        return False
                    if self.gaps[k * self.nc + j] >= -ON_ARC * self.size_gap[j] and not (
                        self.beside_hit(k, j, self.h[self.begins[i] - i])
                    ):
                        return False
        return True

    cdef bint beside_hit(self, ptrdiff_t k, ptrdiff_t j, double h) noexcept nogil:
        cdef ptrdiff_t i
        for i in range(self.P - 1):
            if self.hit[i] == j and fabs(self.T[k] - self.numbers[i, 0]) <= BESIDE * h:
                return True
        return False

    cdef bint positive(self, ptrdiff_t k) noexcept nogil:
        """Whether the mass of a node is positive definite, up to rounding errors."""
        cdef ptrdiff_t nq = self.nq, i, j, c
        cdef double *L = &self.mass[0]
        for i in range(nq * nq):
            L[i] = self.M[k * nq * nq + i]
        for i in range(nq):
            L[i * nq + i] -= SINGULAR * self.inertia[i]
            for j in range(i + 1):
                for c in range(j):
                    L[i * nq + j] -= L[i * nq + c] * L[j * nq + c]
                if j < i:
                    L[i * nq + j] /= L[j * nq + j]
            if not L[i * nq + i] > 0:
                return False
            L[i * nq + i] = sqrt(L[i * nq + i])
        return True
