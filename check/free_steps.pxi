"""Every step of a free motion, integrated from its first node: errors at its end and inside, and
what the motion does between nodes (dmoc.check.segments)."""

# Where gaps are looked at in a step.
cdef const double[::1] PLACES = _flow.PLACES


cdef class FreeSteps(FreeNodes):
    """The steps of a free motion."""
    # Rows (q | v | work) at the ends of the steps, and the accelerations at both ends.
    cdef double[::1] stop, bends, works, path, moments, between_gaps, slope_at
    cdef double[::1] nodes_inside
    cdef double step_error, penetration, limit_excess

    def __init__(self, kernels, inside):
        super().__init__(kernels)
        cdef ptrdiff_t places = PLACES.shape[0], nq = self.nq
        self.nodes_inside = inside
        self.path, self.moments = _space(places * nq), _space(places)
        self.between_gaps, self.slope_at = _space(places * self.nc), _space(self.slopes_stored)

    def _steps(self):
        self.stop, self.bends = _space(self.N * (2 * self.nq + 1)), _space(self.N * 2 * self.nq)
        self.works = _space(self.P)
        self._costs()

    cdef ptrdiff_t node(self, ptrdiff_t k) noexcept nogil:
        """The node at which step k begins."""
        return k + self.phase_of[k]

    cdef int integrate_steps(self) except -1 nogil:
        """All steps from their first nodes, with their work."""
        cdef ptrdiff_t nq = self.nq, width = 2 * nq + 1, k, i, m, begin = 0
        for k in range(self.N):
            for i in range(nq):
                self.stop[k * width + i] = self.q[self.node(k), i]
                self.stop[k * width + nq + i] = self.v[self.node(k), i]
            self.stop[k * width + 2 * nq] = 0.0
        while begin < self.N:
            m = min(self.capacity, self.N - begin)
            for i in range(m):
                self.which[i] = self.step[i] = begin + i
            self.advance_rows(
                m, width, &self.stop[0], &self.begins_at[0], &self.h[0], self.inputs(0),
                self.inputs(1), &self.bends[0]
            )
            begin += m
        return 0

    cdef const double *inputs(self, int side) noexcept nogil:
        """The inputs at one end of all steps."""
        return &(self.u_end if side else self.u_begin)[0, 0]

    cdef bint judge_steps(self) except -1 nogil:
        """Errors of the steps, and how far they enter surfaces and leave limits; False where they
        are none."""
        cdef const double *args[DMOC_MOST]
        cdef ptrdiff_t stride[DMOC_MOST]
        cdef double *results[DMOC_MOST]
        cdef ptrdiff_t nq = self.nq, width = 2 * nq + 1, inside = self.nodes_inside.shape[0]
        cdef ptrdiff_t k, i, s, node
        cdef double error, worst = 0.0
        cdef const double *end
        self.penetration = self.limit_excess = 0.0
        for i in range(self.P):
            self.works[i] = 0.0
        args[3] = &self.par[0]
        for i in range(4):
            stride[i] = 0
        for k in range(self.N):
            node, end = self.node(k), &self.stop[k * width]
            args[0], args[1], args[2] = end, end + nq, &self.T[node + 1]
            results[0] = &self.push[0]
            self.momentum.run(1, args, stride, results)
            for i in range(nq):
                error = fabs(end[i] - self.q[node + 1, i]) / self.size_q[i]
                worst = larger(worst, error)
                error = fabs(self.push[i] - self.p[node + 1, i]) / self.size_p[i]
                worst = larger(worst, error)
            self.works[self.phase_of[k]] += end[2 * nq]
            if inside:
                self.along_step(k, self.nodes_inside)
                for s in range(inside):
                    for i in range(nq):
                        error = self.path[s * nq + i] - self.q_inside[k * inside + s, i]
                        worst = larger(worst, fabs(error) / self.size_q[i])
            if not self.look_between(k):
                return False
        for k in range(self.n):
            self.leave_limits(&self.q[k, 0])
            self.depth_at(&self.q[k, 0], &self.T[k], &self.gaps[k * self.nc])
        self.step_error = worst
        return isfinite(worst)

    cdef void along_step(self, ptrdiff_t k, const double[::1] shares) noexcept nogil:
        """Positions at shares of a step, into the path."""
        cdef double begin[64]
        cdef ptrdiff_t i
        for i in range(self.nq):
            begin[i], begin[self.nq + i] = self.q[self.node(k), i], self.v[self.node(k), i]
        quintic(
            self.nq, begin, &self.bends[k * 2 * self.nq], &self.stop[k * (2 * self.nq + 1)],
            self.h[k], shares, &self.path[0], self.nq
        )

    cdef bint look_between(self, ptrdiff_t k) except -1 nogil:
        """Gaps and limits within a step; False where a gap is not a number."""
        cdef const double *args[DMOC_MOST]
        cdef ptrdiff_t stride[DMOC_MOST]
        cdef double *results[DMOC_MOST]
        cdef ptrdiff_t places = PLACES.shape[0], s, i, inside = self.nodes_inside.shape[0]
        args[1], args[2] = &self.moments[0], &self.par[0]
        stride[0], stride[1], stride[2] = self.nq, 1, 0
        results[0] = &self.between_gaps[0]
        if inside:  # the planned nodes there
            for s in range(inside):
                self.moments[s] = self.T[self.node(k)] + self.nodes_inside[s] * self.h[k]
                self.leave_limits(&self.q_inside[k * inside + s, 0])
            if self.nc:
                args[0] = &self.q_inside[k * inside, 0]
                self.surface.run(inside, args, stride, results)
                for s in range(inside):
                    self.depth_at(
                        &self.q_inside[k * inside + s, 0], &self.moments[s],
                        &self.between_gaps[s * self.nc]
                    )
        self.along_step(k, PLACES)
        for s in range(places):
            self.moments[s] = self.T[self.node(k)] + PLACES[s] * self.h[k]
            if s:
                self.leave_limits(&self.path[s * self.nq])
        if not self.nc:
            return True
        args[0] = &self.path[0]
        self.surface.run(places, args, stride, results)
        for s in range(1, places):
            for i in range(self.nc):
                if not isfinite(self.between_gaps[s * self.nc + i]):
                    return False
            self.depth_at(
                &self.path[s * self.nq], &self.moments[s], &self.between_gaps[s * self.nc]
            )
        return True

    cdef void leave_limits(self, const double *q) noexcept nogil:
        cdef ptrdiff_t i
        cdef double over
        for i in range(self.nq):
            over = fmax(self.box[i, 0] - q[i], q[i] - self.box[i, 1]) / self.size_q[i]
            self.limit_excess = larger(self.limit_excess, over)

    cdef int depth_at(self, const double *q, const double *t, const double *gaps) except -1 nogil:
        """The depth of a position in surfaces, relative to how far the ranges move their gaps."""
        cdef const double *args[DMOC_MOST]
        cdef ptrdiff_t stride[DMOC_MOST]
        cdef double *results[DMOC_MOST]
        cdef ptrdiff_t i, j, width = self.nq + 1
        cdef double size
        for j in range(self.nc):
            if not (self.watched[j] and gaps[j] > 0):
                continue
            for i in range(3):
                stride[i] = 0
            args[0], args[1], args[2], results[0] = q, t, &self.par[0], &self.slope_at[0]
            self.surface_jac.run(1, args, stride, results)
            self.fill(&self.slope_at[0], &self.full[0])
            size = fabs(self.full[j * width + self.nq]) * self.time
            for i in range(self.nq):
                size += fabs(self.full[j * width + i]) * self.size_q[i]
            self.penetration = larger(
                self.penetration, gaps[j] / fmax(size, LEVEL * self.size_gap[j])
            )
        return 0


cdef inline double larger(double most, double value) noexcept nogil:
    """The larger of two numbers; not one where one is none."""
    return value if value > most or value != value else most
