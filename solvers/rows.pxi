"""Solves of the rows of one form, one after the other with nothing of Python between two of them
(row_solves.py): each from its own point, a first motion or a neighbouring solution with its
multipliers, judged, and looked at in second order."""


cdef struct Demands:
    # Largest residuals of a solution, and the cost below which these are another matter.
    double optimality, violation, least_cost, scale_from
    # First barriers, and constants of the second order (curvature.py).
    double barrier, least, clearly, noise, level, bent, fixed, relaxed, held, idle


cdef class Rows:
    """Rows of numbers of one form, and what becomes of them, as :func:`dmoc.solvers.row_solves.
    solve_rows` has them; for one thread."""
    cdef dmoc_program c
    cdef dmoc_kkt kkt
    cdef dmoc_options options
    cdef Demands demands
    cdef Room room
    cdef object program, layout, keep
    cdef ptrdiff_t count, phases, parameters
    cdef ptrdiff_t sums[3]
    cdef double *factors[3]
    cdef const ptrdiff_t *at_left[3]
    cdef const ptrdiff_t *at_right[3]
    cdef const double *by[3]
    cdef const double[:, ::1] lower, upper, sizes, inverse, constant, coefficient, slope_constant, par
    cdef double[:, ::1] x, y, z_lower, z_upper, left
    cdef int[::1] iterations, status
    cdef unsigned char[::1] plain, holds, may
    cdef const double[::1] stretch, weights, kept
    cdef double[::1] size, reach, z, w, values, slopes, hess, gradient, H, A, K, curvature
    cdef int interrupted

    def __init__(
        self, program, layout, elements, numbers, point, ends, of_form, demands, limits
    ):
        cdef dmoc_program *c = <dmoc_program *>PyCapsule_GetPointer(program.capsule(), "dmoc_program")
        cdef ptrdiff_t n = c.n, m = c.m
        self.program, self.layout, self.c = program, layout, c[0]
        self.kkt, self.room = _layout(c, layout), _room(program, layout)
        self.keep = elements
        for i, (into, left, right, by) in enumerate(elements):
            self._element(i, into, left, right, by)
        (
            self.lower, self.upper, self.sizes, self.inverse, self.constant, self.coefficient,
            self.slope_constant, self.par,
        ) = numbers
        self.x, self.y, self.z_lower, self.z_upper = point
        self.left, self.iterations, self.status, self.plain = ends
        self.stretch, self.weights, self.kept, self.phases = of_form
        self.count, self.parameters = self.x.shape[0], self.par.shape[1]
        self._fit(*numbers, *point, *ends, *of_form[:3])
        self.demands = demands
        self.options.least_violation, self.options.price = False, NULL
        self.options.clock, self.options.report = dmoc_clock, _report
        self._set(**limits)
        self.size, self.reach = np.ones(n), np.ones(n)
        self.z, self.gradient, self.curvature = (np.zeros(n + 1) for _ in range(3))
        self.w = np.zeros(m + 1)
        self.values, self.slopes = np.zeros(m + 2), np.zeros(c.slopes.targets + 1)
        self.hess = np.zeros(c.curvatures.targets + 1)
        self.H, self.A, self.K = (np.zeros(self.kkt.start[self.kkt.size] + 1) for _ in range(3))
        self.holds, self.may = np.zeros(n + m, np.uint8), np.zeros(n + m, np.uint8)

    def _fit(self, *arrays):
        """Refuse arrays that are not those of so many rows of the program."""
        cdef ptrdiff_t n = self.c.n, m = self.c.m, k = self.count
        terms, slopes = self.c.values.terms, self.c.slopes.targets
        rows = n, n, n + m + 1, m + 1, m + 1, terms, slopes, self.parameters, n, m, n, n, 2
        shapes = [(k, width) for width in rows] + [(k,)] * 3 + [(n,)] * 3
        for array, shape in zip(arrays, shapes, strict=True):
            if array.shape != shape:
                raise ValueError(f"expected an array of shape {shape}, got {array.shape}")

    cdef int _element(
        self, int i, double[::1] factors, const ptrdiff_t[::1] left, const ptrdiff_t[::1] right,
        const double[::1] by,
    ) except -1:
        """Take the factors of a pass, and what they are products of."""
        self.sums[i] = by.shape[0]
        if not factors.shape[0] == left.shape[0] == right.shape[0] == by.shape[0]:
            raise ValueError(f"expected {factors.shape[0]} factors")
        if by.shape[0]:
            self.factors[i], self.at_left[i] = &factors[0], &left[0]
            self.at_right[i], self.by[i] = &right[0], &by[0]

    def _set(
        self, *, double optimality, double demanded, double violation, double least_cost,
        double infeasible, int iterations, bint warm,
    ):
        self.options.optimality, self.options.demanded = optimality, demanded
        self.options.violation, self.options.least_cost = violation, least_cost
        self.options.infeasible, self.options.iterations = infeasible, iterations
        self.options.warm = warm

    def solve(self, double seconds):
        """Solve the rows until a time has passed; returns how many had their turn."""
        cdef _Listener listener = _Listener()
        cdef _Hearing hearing = _Hearing(<PyObject *>listener, False, clock())
        cdef double until = dmoc_clock() + seconds
        cdef ptrdiff_t k, done = 0
        listener.report = _nothing
        self.options.user = <void *>&hearing
        with nogil:
            for k in range(self.count):
                self.options.seconds = until - dmoc_clock()
                if self.interrupted or not self.options.seconds > 0:
                    break
                self.row(k)
                done = k + 1
        self.layout.rooms.append(self.room)
        if listener.raised is not None:
            raise listener.raised
        return done

    cdef void fill(self, ptrdiff_t k) noexcept nogil:
        """Put the numbers of a row into the program."""
        cdef ptrdiff_t i, e, n = self.c.n, m = self.c.m
        cdef const double *inverse = &self.inverse[k, 0]
        cdef const double *sizes = &self.sizes[k, 0]
        for e in range(self.sums[0]):
            self.factors[0][e] = inverse[self.at_left[0][e]] * self.by[0][e]
        for e in range(self.sums[1]):
            self.factors[1][e] = (
                inverse[self.at_left[1][e]] * sizes[self.at_right[1][e]] * self.by[1][e]
            )
        for e in range(self.sums[2]):
            self.factors[2][e] = (
                sizes[self.at_left[2][e]] * sizes[self.at_right[2][e]] * self.by[2][e]
            )
        self.c.lower, self.c.upper, self.c.sizes = (
            &self.lower[k, 0], &self.upper[k, 0], &self.sizes[k, 0]
        )
        self.c.values.constant = &self.constant[k, 0]
        self.c.values.coefficient = &self.coefficient[k, 0]
        self.c.slopes.constant = &self.slope_constant[k, 0]
        for i in range(self.parameters):
            self.c.pool[n + m + 2 + i] = self.par[k, i]

    cdef void row(self, ptrdiff_t k) noexcept nogil:
        """Solve a row; it is plain where it ends in a strict minimum."""
        cdef ptrdiff_t i, n = self.c.n, m = self.c.m
        cdef double *x = &self.x[k, 0]
        cdef dmoc_result result
        self.fill(k)
        for i in range(n):
            x[i] = _clipped(x[i], self.c.lower[i], self.c.upper[i])
        for i in range(self.phases):
            self.size[i] = x[i]
        dmoc_put(&self.c, x)
        dmoc_assemble(&self.c.values, self.c.pool, &self.values[0])
        self.options.mu = self.demands.barrier * fabs(self.values[0])
        if self.demands.least > self.options.mu:
            self.options.mu = self.demands.least
        result = dmoc_interior_point(
            &self.c, &self.kkt, &self.options, &self.size[0], <const double *>&self.stretch[0], x,
            &self.y[k, 0], &self.z_lower[k, 0], &self.z_upper[k, 0], self.room.factorisation.f,
            &self.room.memory[0],
        )
        self.iterations[k], self.status[k] = result.iterations, result.status
        self.interrupted = result.status == DMOC_INTERRUPTED
        for i in range(m - self.c.equalities):
            self.w[i] = _not_below(-self.y[k, self.c.equalities + i])
            self.y[k, self.c.equalities + i] = -self.w[i]
        for i in range(n):
            self.z[i] = self.z_lower[k, i] - self.z_upper[k, i]
        self.plain[k] = not self.interrupted and self.is_solution(k) and self.is_bowl(k)

    cdef bint is_solution(self, ptrdiff_t k) noexcept nogil:
        """Whether the residuals are those of a solution (judge.py)."""
        cdef ptrdiff_t i, r, e, n = self.c.n, m = self.c.m, eq = self.c.equalities
        cdef double mean = 0.0, worst, size
        cdef const double *x = &self.x[k, 0]
        cdef const double *jac
        dmoc_put(&self.c, x)
        dmoc_assemble(&self.c.values, self.c.pool, &self.values[0])
        dmoc_assemble(&self.c.slopes, self.c.pool, &self.slopes[0])
        jac = &self.slopes[0] + n
        for i in range(n):
            self.gradient[i] = 0.0
        for r in range(m):
            for e in range(self.c.row_start[r], self.c.row_start[r + 1]):
                self.gradient[self.c.column[e]] += jac[e] * self.y[k, r]
        for i in range(n):
            self.gradient[i] = self.slopes[i] + self.gradient[i]
        for i in range(self.phases):
            self.reach[i] = fabs(x[i])
        worst = left_of(
            n, eq, m - eq, &self.gradient[0], &self.reach[0], x, self.c.lower, self.c.upper,
            &self.z[0], &self.y[k, 0], &self.values[1 + eq], &self.w[0], &mean,
        )
        size = _largest(fabs(self.values[0]), self.demands.least_cost)
        worst /= _largest(self.demands.scale_from, mean) / self.demands.scale_from * size
        self.left[k, 0] = worst if isfinite(worst) else INFINITY
        self.left[k, 1] = violation_of(
            n, eq, m - eq, x, self.c.lower, self.c.upper, &self.values[1], &self.values[1 + eq]
        )
        return (
            fabs(self.values[0]) > self.demands.least_cost
            and self.left[k, 0] <= self.demands.optimality
            and self.left[k, 1] <= self.demands.violation
        )

    cdef bint is_bowl(self, ptrdiff_t k) noexcept nogil:
        """Whether the cost is curved along all ways that keep what holds (curvature.py)."""
        cdef ptrdiff_t i, n = self.c.n, m = self.c.m, eq = self.c.equalities, free = 0
        cdef ptrdiff_t entries = self.kkt.start[self.kkt.size]
        cdef double size = fabs(self.values[0]), most, shift
        cdef Demands *d = &self.demands
        for i in range(m):
            self.c.pool[n + i] = self.c.sizes[n + i] * self.y[k, i]
        self.c.pool[n + m] = self.c.sizes[n + m]
        dmoc_assemble(&self.c.curvatures, self.c.pool, &self.hess[0])
        hold(
            n, eq, m - eq, &self.x[k, 0], self.c.lower, self.c.upper, &self.z[0],
            &self.values[1 + eq], &self.w[0], size, d.clearly, d.noise, &self.holds[0],
            &self.may[0],
        )
        for i in range(entries):
            self.H[i] = self.A[i] = 0.0
        put_entries(self.c.hess_start[n], self.kkt.from_hess, &self.hess[0], &self.H[0])
        put_entries(self.c.row_start[m], self.kkt.from_jac, &self.slopes[n], &self.A[0])
        most = d.bent * bend_of(
            n, self.kkt.diagonal, &self.H[0], &self.weights[0], self.c.lower, self.c.upper
        )
        size = _largest(size, most if isfinite(most) else 0.0)
        shift = -d.level * size
        for i in range(n):
            self.curvature[i] = shift * self.weights[i] + size * self.kept[i]
            free += self.c.lower[i] < self.c.upper[i]
        put_signs(
            entries, n, eq, n + m, self.kkt.diagonal, &self.H[0], &self.A[0], &self.holds[0],
            &self.curvature[0], d.fixed, d.relaxed, d.held, d.idle, &self.K[0],
        )
        dmoc_ldl_factor(self.room.factorisation.f, &self.K[0], TINY)
        return self.room.factorisation.f.positive == free and not self.room.factorisation.f.zero


def _nothing(*args):
    """Nobody listens to the iterations of rows."""


cdef inline double _clipped(double x, double lower, double upper) noexcept nogil:
    x = lower if x < lower else x
    return upper if x > upper else x


cdef inline double _not_below(double x) noexcept nogil:
    return x if x > 0.0 else 0.0


cdef inline double _largest(double a, double b) noexcept nogil:
    return a if a > b else b
