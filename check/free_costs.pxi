"""What a free motion costs along its integrated steps (dmoc.check.integrals,
dmoc.check.quadrature)."""

cdef double SMALL = _integrals.SMALL, AGREES = _quadrature.AGREES, PLACED = _integrals.PLACED
cdef double MOST = _integrals.MOST, ALMOST_NOTHING = _paths.ALMOST_NOTHING
# Parts of a step that are looked at for its cost; where rules need more, another look is needed.
cdef ptrdiff_t MOST_LOOKS = 200
# Where in a step costs are looked at, and the weights of the two rules.
cdef const double[::1] COST_PLACES = _quadrature.PLACES
cdef const double[:, ::1] QUINTIC = _steps.QUINTIC
cdef const double[::1] HALF = np.array([0.5])
cdef const double[:, ::1] RULES = np.ascontiguousarray(_quadrature.RULES)


cdef struct Part:
    double value, size, off


cdef class FreeCosts(FreeSteps):
    """The cost of a free motion."""
    cdef Rows running_cost, terminal_cost
    cdef double[::1] place_x, place_q, place_v, place_u, place_t, costs, curvatures, looks, needed
    cdef double cost_error

    def __init__(self, kernels, inside):
        super().__init__(kernels, inside)
        cdef ptrdiff_t places = COST_PLACES.shape[0], nq = self.nq
        self.running_cost = Rows(kernels, "running_cost")
        if kernels.has("terminal_cost"):
            self.terminal_cost = Rows(kernels, "terminal_cost")
        self.place_q, self.place_v = _space(places * nq), _space(places * nq)
        self.place_u, self.place_t = _space(places * self.nu), _space(places)
        self.place_x = _space(places)
        self.costs, self.curvatures = _space(places), _space(places * self.nu)
        self.needed = _space(self.nu)

    def _costs(self):
        self.looks = _space(3 * self.N)

    cdef void states_at(
        self, ptrdiff_t k, ptrdiff_t count, const double *shares, double *q, double *v, double *u,
        double *t
    ) noexcept nogil:
        """States at shares of a step: rows of q, v and u, and times."""
        cdef ptrdiff_t nq = self.nq, nu = self.nu, s, i, b, c
        cdef double data[6]
        cdef double factor[6]
        cdef double h = self.h[k], place, rate
        cdef const double *end = &self.stop[k * (2 * nq + 1)]
        for i in range(nq):
            data[0], data[1] = self.q[self.node(k), i], h * self.v[self.node(k), i]
            data[2], data[3] = h * h * self.bends[k * 2 * nq + i], end[i]
            data[4], data[5] = h * end[nq + i], h * h * self.bends[(k * 2 + 1) * nq + i]
            for c in range(6):
                factor[c] = 0.0
                for b in range(6):
                    factor[c] += QUINTIC[c, b] * data[b]
            for s in range(count):
                place = rate = 0.0
                for c in range(5, -1, -1):
                    place = place * shares[s] + factor[c]
                    if c:
                        rate = rate * shares[s] + c * factor[c]
                q[s * nq + i], v[s * nq + i] = place, rate / h
        for s in range(count):
            t[s] = self.T[self.node(k)] + shares[s] * h
            for i in range(nu):
                u[s * nu + i] = self.u_begin[k, i] + shares[s] * (
                    self.u_end[k, i] - self.u_begin[k, i]
                )

    cdef int price(
        self, ptrdiff_t k, double begin, double part, const double[::1] shares
    ) except -1 nogil:
        """The integrand of the cost at shares of a part of a step, whose places are kept."""
        cdef const double *args[DMOC_MOST]
        cdef ptrdiff_t stride[DMOC_MOST]
        cdef double *results[DMOC_MOST]
        cdef ptrdiff_t nq = self.nq, nu = self.nu, count = shares.shape[0], s
        for s in range(count):
            self.place_x[s] = begin + part * shares[s]
        self.states_at(
            k, count, &self.place_x[0], &self.place_q[0], &self.place_v[0], &self.place_u[0],
            &self.place_t[0]
        )
        args[0], args[1], args[2] = &self.place_q[0], &self.place_v[0], &self.place_u[0]
        args[3], args[4] = &self.place_t[0], &self.par[0]
        stride[0], stride[1], stride[2], stride[3], stride[4] = nq, nq, nu, 1, 0
        results[0], results[1] = &self.costs[0], &self.curvatures[0]
        return self.running_cost.run(count, args, stride, results)

    cdef bint judge_cost(self, double claim) except -1 nogil:
        """The error of the cost; False where the quadrature has to look more closely."""
        cdef const double *args[DMOC_MOST]
        cdef ptrdiff_t stride[DMOC_MOST]
        cdef double *results[DMOC_MOST]
        cdef ptrdiff_t k, s, left
        cdef double value = 0.0, size = 0.0, off, enough
        cdef Part parts
        cdef double[::1] offs = self.looks
        self.cost_error = 0.0
        if claim != claim:
            return True
        for k in range(self.N):
            self.add_up(k, 0.0, 1.0, &parts)
            offs[k] = parts.off
            value += parts.value
            size += parts.size
            if not isfinite(parts.value + parts.off):
                return False
        enough = AGREES * size / self.N
        for k in range(self.N):
            if not offs[k] <= enough:
                self.add_up(k, 0.0, 1.0, &parts)
                value -= parts.value
                size -= parts.size
                left = MOST_LOOKS
                if not self.refine(k, 0.0, 1.0, enough, &left, &value, &size):
                    return False
        if self.terminal_cost is not None:
            args[0], args[1] = &self.q[self.n - 1, 0], &self.v[self.n - 1, 0]
            args[2], args[3], results[0] = &self.T[self.n - 1], &self.par[0], &off
            for s in range(4):
                stride[s] = 0
            self.terminal_cost.run(1, args, stride, results)
            value += off
            size += fabs(off)
        off = fabs(value - claim)
        if not off <= SMALL * size:
            size = fmax(size, self.least_size())
        self.cost_error = off / (size if size > 0 else 1.0)
        return isfinite(self.cost_error)

    cdef int add_up(self, ptrdiff_t k, double begin, double part, Part *of) except -1 nogil:
        """The integral of the cost over a part of a step by the finer rule, that of the magnitude,
        and by how much the coarser one differs."""
        cdef double h = part * self.h[k], fine = 0.0, rough = 0.0, size = 0.0, rough_size = 0.0
        cdef ptrdiff_t s
        self.price(k, begin, part, COST_PLACES)
        for s in range(COST_PLACES.shape[0]):
            fine += RULES[0, s] * self.costs[s]
            rough += RULES[1, s] * self.costs[s]
            size += RULES[0, s] * fabs(self.costs[s])
            rough_size += RULES[1, s] * fabs(self.costs[s])
        of.value, of.size = fine * h, size * h
        of.off = fmax(fabs(rough * h), fabs(rough_size * h))
        return 0

    cdef bint refine(
        self, ptrdiff_t k, double begin, double part, double enough, ptrdiff_t *left,
        double *value, double *size
    ) except -1 nogil:
        """Add both halves of a part of a step, halved again until the rules agree; False where they
        do not in time."""
        cdef Part half
        cdef ptrdiff_t side
        for side in range(2):
            left[0] -= 1
            if left[0] < 0:
                return False
            self.add_up(k, begin + side * part / 2, part / 2, &half)
            if half.off <= enough:
                value[0] += half.value
                size[0] += half.size
            elif not self.refine(k, begin + side * part / 2, part / 2, enough, left, value, size):
                return False
        return True

    cdef double least_size(self) except? -1 nogil:
        """The size of a cost below which there are errors of positions that pass alone."""
        cdef const double *args[DMOC_MOST]
        cdef ptrdiff_t stride[DMOC_MOST]
        cdef double *results[DMOC_MOST]
        cdef ptrdiff_t nq = self.nq, nu = self.nu, k, i, look
        cdef double sign, value, least = 0.0
        cdef double *strong = &self.push[0]
        self.need_inputs()
        for i in range(nu):
            strong[i] = self.needed[i] if isfinite(self.needed[i]) else 0.0
        for k in range(self.N):
            for i in range(nu):
                strong[i] = fmax(strong[i], fabs((self.u_begin[k, i] + self.u_end[k, i]) / 2))
        for i in range(5):
            stride[i] = 0
        for k in range(self.N):
            self.price(k, 0.0, 1.0, HALF)
            args[0], args[1], args[2] = &self.place_q[0], &self.size_v[0], strong
            args[3], args[4] = &self.place_t[0], &self.par[0]
            value, results[0], results[1] = self.costs[0], &self.costs[0], &self.curvatures[0]
            self.running_cost.run(1, args, stride, results)
            self.looks[k] = finite_size(ALMOST_NOTHING * self.costs[0])
            args[1], args[2] = &self.place_v[0], &self.place_u[0]
            for look in range(2):
                sign = -1.0 if look else 1.0
                for i in range(nq):
                    self.place_q[nq + i] = self.place_q[i] + sign * PLACED * self.size_q[i]
                args[0] = &self.place_q[nq]
                self.running_cost.run(1, args, stride, results)
                self.looks[(look + 1) * self.N + k] = finite_size(self.costs[0] - value)
        for look in range(3):
            least = fmax(least, quantile(&self.looks[look * self.N], self.N, MOST))
        return self.time * least

    cdef int need_inputs(self) except -1 nogil:
        """Inputs that accelerate as much as the forces of the motion."""
        cdef const double *args[DMOC_MOST]
        cdef ptrdiff_t stride[DMOC_MOST]
        cdef double *results[DMOC_MOST]
        cdef ptrdiff_t nq = self.nq, nu = self.nu, k, i, j
        cdef double along
        cdef double *B = &self.push[0]
        cdef double *response = &self.push[nq * nu]
        for j in range(nu):
            self.needed[j] = self.room[j] = 0.0
        if not nu:
            return 0
        args[2], args[4] = &self.room[0], &self.par[0]
        for i in range(5):
            stride[i] = 0
        for k in range(self.n):
            args[0], args[1], args[3], results[0] = &self.q[k, 0], &self.v[k, 0], &self.T[k], B
            self.input_matrix.run(1, args, stride, results)
            for i in range(nq * nq):
                self.mass[i] = self.M[k * nq * nq + i]
            if not factored(&self.mass[0], &self.pivot[0], nq):
                continue
            for j in range(nu):
                for i in range(nq):
                    response[i] = B[i * nu + j]
                solved(&self.mass[0], &self.pivot[0], response, nq, 1)
                along = 0.0
                for i in range(nq):
                    along += B[i * nu + j] * response[i]
                self.needed[j] = fmax(self.needed[j], along)
        for j in range(nu):
            self.needed[j] = self.acceleration / sqrt(self.needed[j])
        return 0


cdef inline double finite_size(double value) noexcept nogil:
    return fabs(value) if isfinite(value) else 0.0


cdef int ascending(const void *a, const void *b) noexcept nogil:
    cdef double x = (<const double *>a)[0], y = (<const double *>b)[0]
    return (x > y) - (x < y)


cdef double quantile(double *values, ptrdiff_t n, double share) noexcept nogil:
    """The value below which a share of values lie, which are put in order."""
    cdef double at = share * (n - 1), left
    cdef ptrdiff_t k = <ptrdiff_t>at
    qsort(values, n, sizeof(double), &ascending)
    left = at - k
    if k + 1 >= n:
        return values[n - 1]
    return values[k] + left * (values[k + 1] - values[k])
