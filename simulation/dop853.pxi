"""DOP853 for rows of states side by side (dormand_prince.py)."""

cdef enum:
    STAGE = 12       # stages of the method; the slope at the end is one more
    END = 12         # places of the sums: the end of a step and its error estimates
    FIFTH = 13
    THIRD = 14
    SUMS = 15
    TERMS = 80       # of all sums, at most
    ATTENTION = 256  # parts between two looks at the clock
    MOST_PARTS = 64

# Seconds of processor time between two looks at the time that is left, and at signals.
cdef double PATIENCE = 0.02

# Error of an integration over a step, as a share of the sizes, far below the discretisation errors
# that are to be seen.
cdef double ACCURACY = 1e-11
# An error below the first that more parts do not bring below this share of it is one of rounding.
cdef double ROUNDED = 1e-6, FALLING = 0.5


# The coefficients of the method: of each sum the first of its terms, their stages and factors; where
# the stages are.
cdef ptrdiff_t SUM_START[SUMS + 1]
cdef ptrdiff_t SUM_INDEX[TERMS]
cdef double SUM_FACTOR[TERMS]
cdef double SHARE[STAGE]


def _read_coefficients():
    cdef ptrdiff_t k = 0, s
    for s, terms in enumerate(((), *sums())):
        SUM_START[s] = k
        for SUM_INDEX[k], SUM_FACTOR[k] in terms:
            k += 1
    SUM_START[SUMS] = k
    for s, share in enumerate(shares()):
        SHARE[s + 1] = share


_read_coefficients()


cdef class Method(Dynamics):
    """Integrates rows of states over steps whose inputs are linear."""
    cdef ptrdiff_t parts
    cdef bint coarse
    cdef clock_t looked_at  # the time
    cdef object check_time
    cdef public double[::1] sizes
    cdef readonly double worst  # error of the last rows
    cdef double[::1] start, y, stage, slopes, u0, u1, begin, span, error, before
    cdef ptrdiff_t[::1] row, which, step

    def __init__(self, kernels, par, size, check_time):
        cdef ptrdiff_t rows, widest
        super().__init__(kernels, par)
        rows, widest = self.capacity, 2 * self.nq * (2 * self.nq + 1)
        self.sizes, self.check_time = np.array(size), check_time
        if self.sizes.shape[0] != 2 * self.nq + 1:
            raise ValueError(f"expected {2 * self.nq + 1} sizes")
        self.start, self.y = (_space(rows * widest) for _ in range(2))
        self.stage, self.slopes = (_space(n * rows * widest + FOUR) for n in (1, STAGE + 1))
        self.u0, self.u1 = _space(rows * self.nu), _space(rows * self.nu)
        self.begin, self.span, self.error, self.before = (_space(rows) for _ in range(4))
        self.row, self.which, self.step = (np.zeros(rows, dtype=np.intp) for _ in range(3))

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
        cdef ptrdiff_t i, c
        cdef const double *y = &self.y[0]
        cdef double part
        self.total(n * width, n * width, s, 0, out)
        for i in range(n):
            part = self.span[i] / count
            for c in range(i * width, (i + 1) * width):
                out[c] = y[c] + part * out[c]

    cdef void total(
        self, ptrdiff_t count, ptrdiff_t stride, ptrdiff_t s, ptrdiff_t begin, double *out
    ) noexcept nogil:
        """The sum s of so many slopes, from one on."""
        cdef ptrdiff_t e = SUM_START[s]
        sum_of(
            out, &self.slopes[begin], count, stride, SUM_START[s + 1] - e, &SUM_INDEX[e],
            &SUM_FACTOR[e],
        )

    cdef double largest(
        self, ptrdiff_t n, ptrdiff_t width, ptrdiff_t s, ptrdiff_t count, ptrdiff_t i
    ) noexcept nogil:
        """Largest entry of an error estimate of row i relative to the sizes."""
        cdef ptrdiff_t c, first = 2 * self.nq + (width == 2 * self.nq + 1)
        cdef double *estimate = &self.stage[0]
        cdef double most = 0.0, part = fabs(self.span[i] / count)
        self.total(first, n * width, s, i * width, estimate)
        for c in range(first):
            most = fmax(most, part * fabs(estimate[c]) / self.sizes[c])
        return most

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
            self.accelerations_at(n, width, &self.slopes[0], ends)
        for k in range(count):
            for s in range(1, STAGE):
                self.add(n, width, s, count, &self.stage[0])
                self.moment(n, (k + SHARE[s]) / count)
                self.slope(n, width, &self.stage[0], &self.slopes[s * total])
            self.add(n, width, END, count, &self.stage[0])
            for c in range(total):
                self.y[c] = self.stage[c]
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
                self.project_rows(n, width, &self.y[0], 3)
            if k + 1 < count or ends != NULL:
                self.slope(n, width, &self.y[0], &self.slopes[0])
        if ends != NULL:
            self.accelerations_at(n, width, &self.slopes[0], ends + nq)
        for i in range(n):
            if not finite(2 * nq, &self.y[i * width]) and finite(2 * nq, &self.start[i * width]):
                self.error[i] = INFINITY
        return self.attend(n * count)

    cdef int attend(self, ptrdiff_t parts) except -1 nogil:
        """Look at the time now and then: taking the lock of the interpreter more often would make
        threads wait for each other."""
        cdef clock_t now
        self.parts += parts
        if self.parts < ATTENTION:
            return 0
        self.parts, now = 0, clock()
        if now - self.looked_at < PATIENCE * CLOCKS_PER_SEC:
            return 0
        self.looked_at = now
        with gil:
            self.check_time()
        return 0

    cdef int classical(self, ptrdiff_t n, ptrdiff_t width, double *ends) except -1 nogil:
        """Integrate n rows from ``start`` in one part to ``y`` by the classical method of order 4,
        without an estimate of the error; accelerations at both ends."""
        cdef ptrdiff_t i, c, s, total = n * width
        cdef double share
        cdef double *slope
        for c in range(total):
            self.y[c] = self.stage[c] = self.start[c]
        for s in range(4):
            share = 0.0 if s == 0 else 0.5 if s < 3 else 1.0
            self.moment(n, share)
            if s:
                slope = &self.slopes[(s - 1) * total]
                for i in range(n):
                    for c in range(i * width, (i + 1) * width):
                        self.stage[c] = self.start[c] + share * self.span[i] * slope[c]
            slope = &self.slopes[s * total]
            self.slope(n, width, &self.stage[0], slope)
            for i in range(n):
                for c in range(i * width, (i + 1) * width):
                    self.y[c] += self.span[i] / (3.0 if 0 < s < 3 else 6.0) * slope[c]
        if self.m:
            self.project_rows(n, width, &self.y[0], 3)
        if ends != NULL:
            slope = &self.slopes[4 * total]
            self.slope(n, width, &self.y[0], slope)
            self.accelerations_at(n, width, &self.slopes[0], ends)
            self.accelerations_at(n, width, slope, ends + self.nq)
        return self.attend(n)

    cdef void accelerations_at(
        self, ptrdiff_t n, ptrdiff_t width, const double *slopes, double *ends
    ) noexcept nogil:
        """Those of slopes of n rows, as the ones at an end of their steps."""
        cdef ptrdiff_t i, c, nq = self.nq
        for i in range(n):
            for c in range(nq):
                ends[2 * nq * self.which[self.row[i]] + c] = slopes[i * width + nq + c]

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
        self.begin[i], self.span[i], self.row[i], self.holds[i] = t[k], h[k], row, at

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
        if self.coarse and n:
            self.classical(n, width, ends)
            for i in range(n):
                row = y + self.which[i] * width
                for c in range(width):
                    row[c] = self.y[i * width + c]
            return 0
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
        double[:, ::1] u1, mode=None, anchors=None, bint coarse=False, course=None
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
            What is closed or rubs (a ``Mode`` of ``contact_modes``); nothing, if left out.
            Rows begin where its conditions hold.
        anchors : array of shape (n, nt), optional
            Places that what sticks keeps.
        coarse : bool
            By the classical method of order 4 instead, one part a step, which tells no
            accelerations.
        course : array of shape (N, 6 nq), optional
            Into which go, of each step that a row is integrated over, the state before it, the
            accelerations at both of its ends, and the state after it.

        Returns
        -------
        array of shape (n, 2, nq)
            Accelerations at both ends of the last steps.
        """
        cdef ptrdiff_t n = y.shape[0], width = y.shape[1], N = t.shape[0], nq = self.nq
        cdef ptrdiff_t begin = 0, i, j, m
        cdef double[:, ::1] kept = course
        if width not in (2 * nq, 2 * nq + 1, 2 * nq * (2 * nq + 1)):
            raise ValueError(f"rows of {width} numbers: expected (q | v), and work or X")
        if not (h.shape[0] == u0.shape[0] == u1.shape[0] == N):
            raise ValueError(f"expected {N} steps")
        if not u0.shape[1] == u1.shape[1] == self.nu:
            raise ValueError(f"expected {self.nu} inputs")
        self._enter(mode)
        self._anchor(n, anchors)
        if width > 2 * nq + 1 and not self.free:
            raise ValueError("expected (q | v), and work, of rows in a mode")
        if not (first.shape[0] == last.shape[0] == n):
            raise ValueError(f"expected {n} rows")
        for i in range(n):
            if not 0 <= first[i] <= last[i] <= N:
                raise ValueError(f"steps {first[i]} to {last[i]}: expected 0 to {N}")
        if kept is not None and not (kept.shape[0] == N and kept.shape[1] == 6 * nq):
            raise ValueError(f"expected room for states and accelerations of {N} steps")
        accelerations = np.empty((n, 2, nq))
        cdef double[:, :, ::1] ends = accelerations
        self.worst, self.coarse = 0.0, coarse
        try:
            with nogil:
                while begin < n:
                    j, m = 0, 1
                    while m:
                        m = 0
                        for i in range(begin, min(begin + self.capacity, n)):
                            if first[i] + j < last[i]:
                                self.which[m], self.step[m] = i, first[i] + j
                                m += 1
                        if kept is not None:
                            self.record(m, width, &y[0, 0], kept, 0)
                        self.advance_rows(
                            m, width, &y[0, 0], &t[0], &h[0], &u0[0, 0], &u1[0, 0],
                            NULL if coarse else &ends[0, 0, 0],
                        )
                        if kept is not None:
                            self.record(m, 2 * nq, &ends[0, 0, 0], kept, 2 * nq)
                            self.record(m, width, &y[0, 0], kept, 4 * nq)
                        j += 1
                    begin += self.capacity
        finally:
            self.coarse = False
        return accelerations

    cdef void record(
        self, ptrdiff_t n, ptrdiff_t width, const double *y, double[:, ::1] kept, ptrdiff_t begin
    ) noexcept nogil:
        """Keep numbers of n rows, from a column on, as those of their steps."""
        cdef ptrdiff_t i, c
        for i in range(n):
            for c in range(2 * self.nq):
                kept[self.step[i], begin + c] = y[self.which[i] * width + c]


cdef bint finite(ptrdiff_t n, const double *x) noexcept nogil:
    cdef ptrdiff_t i
    for i in range(n):
        if not isfinite(x[i]):
            return False
    return True
