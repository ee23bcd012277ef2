"""Tenths of the phases of a free motion, and its hits: how far off they end, and how far they carry
errors (dmoc.check.segments, dmoc.check.events, dmoc.check.amplification)."""

cdef double SOFT = _events.SOFT, PERTURBED = _passages.PERTURBED, STEADY = _amplification.STEADY
cdef double SHOWN = _segments.NEAR


cdef class FreeParts(FreeLimits):
    """Segments and hits of a free motion."""
    cdef ptrdiff_t S  # segments
    # Of each segment its phase, its first step and the one behind its last, its end (q | v), and that
    # of the linearised flow (q | v | X), which may have to be integrated more finely; of each step
    # the states and accelerations at both ends, on the way from the first of its segment.
    cdef ptrdiff_t[::1] of_phase, first, behind
    cdef double[::1] stops, rows, segment_errors
    cdef unsigned char[::1] far
    cdef double[:, ::1] course
    # Derivatives of the states after hits by those before, in sizes; of ends by starts, in sizes.
    cdef double[::1] passing, carried, defects, products, off, accelerations
    cdef double segment_error, phase_error, energy_error, law_error, own_error, amplification

    def _segments(self):
        """Lay the segments out."""
        cdef ptrdiff_t m = 2 * self.nq, i
        phase, first, behind = [], [], []
        for i in range(self.P):
            cuts = self.begins[i] - i + nodes_of_segments(self.begins[i + 1] - self.begins[i] - 1)
            phase += [i] * (len(cuts) - 1)
            first, behind = [*first, *cuts[: len(cuts) - 1]], [*behind, *cuts[1:]]
        self.of_phase, self.first, self.behind = (np.array(a, np.intp) for a in (phase, first, behind))
        self.S = len(phase)
        self.rows, self.segment_errors = _space(self.S * (m + m * m)), _space(self.S)
        self.stops, self.far = _space(self.S * m), np.zeros(self.S, dtype=np.uint8)
        self.course = np.zeros((self.N, 3 * m))
        self.passing, self.carried = _space(self.P * m * m), _space(self.S * m * m)
        self.defects, self.products = _space(self.S * m), _space(4 * m * m)
        self.off, self.accelerations = _space(m), _space(self.S * m)

    cdef int integrate_segments(self) except -1 nogil:
        """All segments from their first nodes, with the derivatives of their ends by these: by a
        coarse integration where that gets to the same ends."""
        cdef ptrdiff_t m = 2 * self.nq, width = m + m * m, k, i
        self.begin_rows(width, &self.rows[0])
        for k in range(self.S):
            self.far[k] = True
        if self.coarse:
            self.follow(width, &self.rows[0], True)
            for k in range(self.S):
                for i in range(m):
                    self.stops[k * m + i] = self.rows[k * width + i]
            return 0
        self.begin_rows(m, &self.stops[0])
        self.follow(m, &self.stops[0], True)
        self.coarse = True
        self.follow(width, &self.rows[0], False)
        self.coarse = False
        for k in range(self.S):
            self.far[k] = False
            for i in range(m):
                if not fabs(self.rows[k * width + i] - self.stops[k * m + i]) <= (
                    SHOWN * self.size_y[i]
                ):
                    self.far[k] = True
        for k in range(self.S):
            if self.far[k]:
                self.begin_row(k, width, &self.rows[0])
        return self.follow(width, &self.rows[0], False)

    cdef void begin_rows(self, ptrdiff_t width, double *rows) noexcept nogil:
        cdef ptrdiff_t k
        for k in range(self.S):
            self.begin_row(k, width, rows)

    cdef void begin_row(self, ptrdiff_t k, ptrdiff_t width, double *rows) noexcept nogil:
        """The row of a segment at its first node, (q | v) or (q | v | X)."""
        cdef ptrdiff_t nq = self.nq, m = 2 * nq, node = self.node(self.first[k]), i
        cdef double *row = rows + k * width
        for i in range(nq):
            row[i], row[nq + i] = self.q[node, i], self.v[node, i]
        for i in range(width - m):
            row[m + i] = 1.0 if i % (m + 1) == 0 else 0.0

    cdef int follow(self, ptrdiff_t width, double *rows, bint keeps) except -1 nogil:
        """Integrate the rows of segments that are ``far`` to their ends, and keep their course."""
        cdef ptrdiff_t m = 2 * self.nq, i, j, c, begin = 0, count
        while begin < self.S:
            j, count = 0, 1
            while count:
                count = 0
                for i in range(begin, min(begin + self.capacity, self.S)):
                    if self.far[i] and self.first[i] + j < self.behind[i]:
                        self.which[count], self.step[count] = i, self.first[i] + j
                        count += 1
                if keeps:
                    self.record_rows(count, width, rows, 0)
                self.advance_rows(
                    count, width, rows, &self.begins_at[0], &self.h[0], self.inputs(0),
                    self.inputs(1), &self.accelerations[0] if keeps else NULL
                )
                if keeps:
                    for i in range(count):
                        for c in range(m):
                            self.course[self.step[i], m + c] = self.accelerations[
                                self.which[i] * m + c
                            ]
                    self.record_rows(count, width, rows, 2 * m)
                j += 1
            begin += self.capacity
        return 0

    cdef void record_rows(
        self, ptrdiff_t count, ptrdiff_t width, const double *rows, ptrdiff_t at
    ) noexcept nogil:
        """Keep states (q | v) of segments as those of their steps."""
        cdef ptrdiff_t i, c, m = 2 * self.nq
        for i in range(count):
            for c in range(m):
                self.course[self.step[i], at + c] = rows[self.which[i] * width + c]

    cdef bint judge_segments(self) except -1 nogil:
        """Errors of the segments, defects and slopes; False where they are no numbers."""
        cdef ptrdiff_t nq = self.nq, m = 2 * self.nq, k, i, c, node
        cdef double worst, off
        cdef const double *end
        cdef const double *X
        self.segment_error = 0.0
        for k in range(self.S):
            end, X = &self.stops[k * m], &self.rows[k * (m + m * m) + m]
            node = self.node(self.behind[k] - 1) + 1
            worst = self.off_by(end, node)
            self.segment_errors[k] = worst
            self.segment_error = fmax(self.segment_error, worst)
            for i in range(m * m):
                if not isfinite(X[i]):
                    return False
            for i in range(m):
                off = end[i] - (self.q[node, i] if i < nq else self.v[node, i - nq])
                self.defects[k * m + i] = off / self.size_y[i]
                for c in range(m):
                    self.carried[(k * m + i) * m + c] = (
                        X[i * m + c] / self.size_y[i] * self.size_y[c]
                    )
            if not isfinite(worst):
                return False
        return True

    cdef double off_by(self, const double *y, ptrdiff_t node) except? -1 nogil:
        """The largest error of a state (q | v) beside a node."""
        cdef const double *args[DMOC_MOST]
        cdef ptrdiff_t stride[DMOC_MOST]
        cdef double *results[DMOC_MOST]
        cdef ptrdiff_t i
        cdef double worst = 0.0
        args[0], args[1], args[2], args[3] = y, y + self.nq, &self.T[node], &self.par[0]
        for i in range(4):
            stride[i] = 0
        results[0] = &self.push[0]
        self.momentum.run(1, args, stride, results)
        for i in range(self.nq):
            worst = larger(worst, fabs(y[i] - self.q[node, i]) / self.size_q[i])
            worst = larger(worst, fabs(self.push[i] - self.p[node, i]) / self.size_p[i])
        return worst

    # Hits -----------------------------------------------------------------------------------------

    cdef bint judge_hits(self) except -1 nogil:
        """The hits beside their law; False where one is none."""
        cdef ptrdiff_t i
        cdef double off
        self.energy_error = self.law_error = self.own_error = 0.0
        for i in range(self.P):
            off = self.E[self.begins[i + 1] - 1] - self.E[self.begins[i]] - self.works[i]
            self.energy_error = larger(self.energy_error, fabs(off) / self.exchanged)
        for i in range(self.P - 1):
            if not self.joins(i) or not self.judge_hit(i):
                return False
        return isfinite(self.energy_error) and isfinite(self.law_error + self.own_error)

    cdef bint joins(self, ptrdiff_t i) noexcept nogil:
        """Whether two phases share a time, a place on the surface and, beside the impulse, a
        momentum."""
        cdef ptrdiff_t nq = self.nq, c, b = self.begins[i + 1] - 1, a = self.begins[i + 1]
        cdef double late = JOINED * self.time, time = self.numbers[i, 0], jump
        if not (fabs(self.T[a] - self.T[b]) <= late and fabs(time - self.T[b]) <= late):
            return False
        if not fabs(self.gaps[b * self.nc + self.hit[i]]) <= OFF_SURFACE * self.size_gap[self.hit[i]]:
            return False
        for c in range(nq):
            for jump in (
                self.q[a, c] - self.q[b, c], self.recorded[i, 0, c] - self.q[b, c]
            ):
                if not fabs(jump) <= JOINED * self.size_q[c]:
                    return False
            for jump in (
                self.p[b, c] - self.recorded[i, 1, c], self.p[a, c] - self.recorded[i, 2, c]
            ):
                if not fabs(jump) <= UNBALANCED * self.size_p[c]:
                    return False
        return True

    cdef bint normal_at(
        self, const double *q, double time, ptrdiff_t j, double *normal, double *response
    ) except -1 nogil:
        """The slope (nq + 1) of a gap at a place, and M^-1 n; False where M is singular."""
        cdef const double *args[DMOC_MOST]
        cdef ptrdiff_t stride[DMOC_MOST]
        cdef double *results[DMOC_MOST]
        cdef ptrdiff_t i, nq = self.nq
        for i in range(5):
            stride[i] = 0
        args[0], args[1], args[2], results[0] = q, &time, &self.par[0], &self.slope_at[0]
        self.surface_jac.run(1, args, stride, results)
        for i in range(nq + 1):
            normal[i] = 0.0
        for i in range(self.slopes_stored):
            if self.g_row[i] == j:
                normal[self.g_col[i]] = self.slope_at[i]
        for i in range(nq + self.nu):
            self.room[i] = 0.0
        args[1] = args[2] = &self.room[0]
        args[3], args[4] = &time, &self.par[0]
        results[0], results[1] = &self.mass[0], &self.f[0]
        self.dynamics.run(1, args, stride, results)
        if not factored(&self.mass[0], &self.pivot[0], nq):
            return False
        for i in range(nq):
            response[i] = normal[i]
        solved(&self.mass[0], &self.pivot[0], response, nq, 1)
        return True

    cdef double hits(
        self, ptrdiff_t j, const double *y, double time, double *v, double *impulse, double *inertia
    ) except? -1 nogil:
        """The velocity v after a hit from the state y = (q | v), its impulse, n . M^-1 n, and the rate
        before it; not a number where there is none."""
        cdef double normal[65]
        cdef double response[64]
        cdef double rate
        cdef ptrdiff_t i, nq = self.nq
        if not self.normal_at(y, time, j, normal, response):
            return NAN
        rate, inertia[0] = 0.0, 0.0
        for i in range(nq):
            rate += normal[i] * y[nq + i]
            inertia[0] += normal[i] * response[i]
        rate += normal[nq]
        impulse[0] = (1 + self.e[j]) * rate / inertia[0]
        for i in range(nq):
            v[i] = y[nq + i] - impulse[0] * response[i]
        return rate

    cdef bint judge_hit(self, ptrdiff_t i) except -1 nogil:
        """One hit: its energy, rates and impulse, and how it carries errors."""
        cdef ptrdiff_t nq = self.nq, c, b = self.begins[i + 1] - 1, a = b + 1, j = self.hit[i]
        cdef double y[128]
        cdef double v[64]
        cdef double normal[65]
        cdef double response[64]
        cdef double impulse = 0.0, inertia = 0.0, before, after = 0.0, right = 0.0, jump, worst, own
        cdef double time = self.numbers[i, 0]
        for c in range(nq):
            y[c], y[nq + c] = self.q[b, c], self.v[b, c]
        before = self.hits(j, y, time, v, &impulse, &inertia)
        if not before > 0:
            return False
        self.normal_at(y, time, j, normal, response)
        for c in range(nq):
            after += normal[c] * self.v[a, c]
            right += normal[c] * v[c]
            jump = self.p[a, c] - self.p[b, c] + self.numbers[i, 1] * normal[c]
            if not fabs(jump) <= UNBALANCED * self.size_p[c]:
                return False
        after += normal[nq]
        right += normal[nq]
        jump = self.energy_of(&self.q[a, 0], &self.v[a, 0], self.T[a]) - self.energy_of(
            y, v, self.T[b]
        )
        self.energy_error = larger(self.energy_error, fabs(jump) / self.energy_size)
        worst = fmax(fabs(after - right), fabs(impulse - self.numbers[i, 1]) * inertia)
        worst = fmax(worst, fmax(-before, after))
        own = fmax(fmax(fabs(before), fabs(after)), SOFT * self.size_rate[j])
        self.own_error = larger(self.own_error, worst / own)
        self.law_error = larger(self.law_error, worst / self.size_rate[j])
        return self.carry_through(i, before, normal)

    cdef double energy_of(self, const double *q, const double *v, double time) except? -1 nogil:
        cdef const double *args[DMOC_MOST]
        cdef ptrdiff_t stride[DMOC_MOST]
        cdef double *results[DMOC_MOST]
        cdef double energy
        cdef ptrdiff_t i
        args[0], args[1], args[2], args[3] = q, v, &time, &self.par[0]
        for i in range(4):
            stride[i] = 0
        results[0] = &energy
        self.energy.run(1, args, stride, results)
        return energy

    cdef bint accelerate(
        self, ptrdiff_t node, int side, double time, double *a
    ) except -1 nogil:
        """The acceleration at a node with the inputs on one side of it."""
        cdef const double *args[DMOC_MOST]
        cdef ptrdiff_t stride[DMOC_MOST]
        cdef double *results[DMOC_MOST]
        cdef ptrdiff_t i
        args[0], args[1], args[2] = &self.q[node, 0], &self.v[node, 0], self.input_at(node, side)
        args[3], args[4] = &time, &self.par[0]
        for i in range(5):
            stride[i] = 0
        results[0], results[1] = &self.mass[0], a
        self.dynamics.run(1, args, stride, results)
        if not factored(&self.mass[0], &self.pivot[0], self.nq):
            return False
        solved(&self.mass[0], &self.pivot[0], a, self.nq, 1)
        return True

    cdef bint carry_through(
        self, ptrdiff_t i, double rate, const double *normal
    ) except -1 nogil:
        """How a hit carries errors before it behind it, by differences, in sizes."""
        cdef ptrdiff_t nq = self.nq, m = 2 * self.nq, c, k, side
        cdef ptrdiff_t b = self.begins[i + 1] - 1, j = self.hit[i]
        cdef double a[2][64]
        cdef double y[128]
        cdef double v[64]
        cdef double late, impulse, inertia, sign, change, time = self.numbers[i, 0]
        cdef double *to = &self.passing[i * m * m]
        if not (self.accelerate(b, 0, time, a[0]) and self.accelerate(b + 1, 1, time, a[1])):
            return False
        for c in range(m * m):
            to[c] = 0.0
        for k in range(m):
            for side in range(2):
                sign = -1.0 if side else 1.0
                for c in range(nq):
                    y[c], y[nq + c] = self.q[b, c], self.v[b, c]
                y[k] += sign * PERTURBED * self.size_y[k]
                late = 0.0
                for c in range(nq):
                    late -= (y[c] - self.q[b, c]) * normal[c]
                late /= rate
                for c in range(nq):
                    y[c] += late * y[nq + c]
                    y[nq + c] += late * a[0][c]
                change = self.hits(j, y, time + late, v, &impulse, &inertia)
                if change != change:
                    return False
                for c in range(nq):
                    to[c * m + k] += sign * (y[c] - late * v[c])
                    to[(nq + c) * m + k] += sign * (v[c] - late * a[1][c])
        for c in range(m):
            for k in range(m):
                to[c * m + k] /= 2 * PERTURBED * self.size_y[c]
        return True

    # Amplification --------------------------------------------------------------------------------

    cdef bint carry_errors(self) except -1 nogil:
        """The largest ratio of an error at the end to one on the way, and the largest error of a
        phase; False where they are no numbers."""
        cdef ptrdiff_t m = 2 * self.nq, size = m * m, i, k, c, r, last = self.S, first
        cdef double *to_end = &self.products[0]
        cdef double *whole = to_end + size
        cdef double *spare = whole + size
        cdef double *rest = spare + size
        cdef double most, row
        self.amplification = self.phase_error = 0.0
        identity(rest, m)
        self.stretch(rest, spare)
        for i in range(self.P - 1, -1, -1):
            first = last
            while first > 0 and self.of_phase[first - 1] == i:
                first -= 1
            if i < self.P - 1:
                times(rest, &self.passing[i * size], spare, m)
                copy(rest, spare, size)
            identity(to_end, m)
            most = 1.0
            for c in range(m):
                self.off[c] = 0.0
            for k in range(last - 1, first - 1, -1):
                for c in range(m):
                    for r in range(m):
                        self.off[c] += to_end[c * m + r] * self.defects[k * m + r]
                times(to_end, &self.carried[k * size], spare, m)
                copy(to_end, spare, size)
                most = fmax(most, largest_row(to_end, m))
                times(rest, to_end, whole, m)
                self.stretch(whole, spare)
            copy(rest, whole, size)
            row = 0.0
            for c in range(m):
                row = larger(row, fabs(self.off[c]))
            self.phase_error = larger(self.phase_error, row / fmax(1.0, most / STEADY))
            last = first
        return isfinite(self.amplification) and isfinite(self.phase_error)

    cdef void stretch(self, const double *A, double *spare) noexcept nogil:
        """Let a matrix count for the amplification."""
        cdef ptrdiff_t m = 2 * self.nq
        cdef double total = squares(A, m * m)
        if not total > self.amplification * self.amplification:
            if total != total:
                self.amplification = NAN
            return
        copy(spare, A, m * m)
        turn_columns(spare, NULL, m, total)
        self.amplification = fmax(self.amplification, sqrt(largest_column(spare, m)))


cdef inline void identity(double *A, ptrdiff_t m) noexcept nogil:
    cdef ptrdiff_t i
    for i in range(m * m):
        A[i] = 1.0 if i % (m + 1) == 0 else 0.0


cdef inline double largest_row(const double *A, ptrdiff_t m) noexcept nogil:
    """The largest sum of the absolute values of a row."""
    cdef ptrdiff_t i, j
    cdef double most = 0.0, total
    for i in range(m):
        total = 0.0
        for j in range(m):
            total += fabs(A[i * m + j])
        most = fmax(most, total)
    return most


cdef inline void copy(double *to, const double *A, ptrdiff_t size) noexcept nogil:
    cdef ptrdiff_t i
    for i in range(size):
        to[i] = A[i]


cdef inline void times(const double *A, const double *B, double *to, ptrdiff_t m) noexcept nogil:
    cdef ptrdiff_t i, j, c
    cdef double total
    for i in range(m):
        for j in range(m):
            total = 0.0
            for c in range(m):
                total += A[i * m + c] * B[c * m + j]
            to[i * m + j] = total
