"""The conditions of a mode at rows of states: gradients, pushes and multipliers."""

# Determinant, measured by the sizes of its rows and columns, of conditions that are far from saying
# the same twice, and singular values, as shares of the largest, of those that do.
cdef double REGULAR = 1e-6, REDUNDANT = DEPENDENT**2
# What conditions that can hold together leave of second derivatives, as a share of their terms.
cdef double AGREEING = 1e-9
NONE = object()  # where no mode has been entered
cdef enum:
    SIDE_BY_SIDE = 16     # rows: what fits into a processor's cache
    SIDE_BY_SIDE_NUMPY = 256


cdef class Conditions:
    """What a mode demands of one model: closed gaps, what sticks, joints; for one thread."""
    cdef object kernels, contacts, entered  # the mode whose conditions these are
    cdef dict known  # conditions of modes, and the places of what is closed and of what sticks
    cdef bint ready  # for joints, and modes with contacts or friction
    cdef bint free  # nothing of the mode acts on the motion
    cdef ptrdiff_t nq, nu, nc, nt, nj, capacity
    cdef Rows surface, within, tangent, gap_rate, slide_rate, bearing, holding
    cdef Rows gap_rate_jac, slide_rate_jac, joint, joint_rate, joint_rate_jac
    cdef double[::1] par, t, u
    cdef ptrdiff_t[::1] pivot  # of the masses at one state
    # Conditions of the mode, those of closed contacts, of what sticks and of joints: their number,
    # their gradients C and the directions B of their pushes at one state, and the places of
    # surfaces and tangents; joints are the last.
    cdef ptrdiff_t m, closed, sticking, sliding
    cdef ptrdiff_t[::1] closed_at, sticks_at, slides_at, presses, support, partner, exchange
    cdef ptrdiff_t[::1] gamma_row, gamma_column, sigma_row, sigma_column, phi_row, phi_column
    # Coefficients of friction of rows of states, of what slides and, where there are others, of
    # what sticks, and which of them vary; directions of sliding.
    cdef bint static_too, slows, ended
    cdef int[::1] sides
    cdef double[::1] mu, mu_s, varied, pressed, way, speed
    cdef ptrdiff_t[::1] varies
    cdef double[::1] gamma_D, sigma_D, phi_D, g, W, tau, phi, C, B, along, bent, lam, change
    cdef double[::1] responses, A, scaled, V, size, wanted, spare
    # Whether the conditions that were answered last say the same twice, and whether those of a row
    # contradict one another.
    cdef bint dependent
    cdef unsigned char[::1] contradicted
    # Surfaces that are places of grips, those of them that close wherever they are, and those that
    # are closed in every mode.
    cdef unsigned char[::1] pull, floats
    cdef readonly tuple gripped
    # Places of grips that have a strength F, one grip after the other, and F^2 at the last of each,
    # -1 at the others.
    cdef ptrdiff_t[::1] strong
    cdef double[::1] strength

    def __init__(self, kernels, par):
        self.nq, self.nu = len(kernels.coordinates), len(kernels.inputs)
        self.nc, self.nt, self.nj = (
            len(names) for names in (kernels.surfaces, kernels.tangents, kernels.joints)
        )
        self.kernels, self.par, self.entered = kernels, np.append(par[0], 0.0), NONE
        self.capacity = SIDE_BY_SIDE if kernels.compiled else SIDE_BY_SIDE_NUMPY
        self.t, self.pivot = _space(self.capacity), np.zeros(self.nq, dtype=np.intp)
        self.contradicted = np.zeros(self.capacity, dtype=np.uint8)
        self.grip((), ())
        facts, surfaces = kernels.manifest, kernels.surfaces
        places = {name for of_grip in facts.grips.values() for name in of_grip}
        self.pull, self.floats = (
            np.array([name in own for name in surfaces] or [False], dtype=np.uint8)
            for own in (places, facts.by_rate)
        )
        if self.nc:
            self.surface = Rows(kernels, "surface")
        self.ended = kernels.has("within")
        if self.ended:
            self.within = Rows(kernels, "within")

    def grip(self, gripped, strong):
        """Keep places of grips closed in every mode, by their numbers; ``strong`` are those of each
        grip that has a strength, with this."""
        self.gripped, self.entered, self.known = tuple(gripped), NONE, {}
        self.strong = np.array([j for places, _ in strong for j in places], dtype=np.intp)
        self.strength = np.array(
            [x for places, F in strong for x in (*[-1.0] * (len(places) - 1), F * F)], dtype=float
        )

    def _contacts(self):
        """Make what joints, and modes with contacts or friction, need."""
        cdef ptrdiff_t nq = self.nq, rows = self.capacity, most = self.nc + self.nt + self.nj
        kernels, self.ready = self.kernels, True
        self.contacts = contacts_of(kernels.manifest)
        partner = {k: j for pair in self.contacts.rolling for k, j in (pair, pair[::-1])}
        self.partner = np.array([*(partner.get(k, NOWHERE) for k in range(self.nt)), NOWHERE])
        self.support = np.array([*self.contacts.supports, RAIL], dtype=np.intp)
        none = np.zeros(0, dtype=np.intp)
        self.gamma_row = self.gamma_column = self.sigma_row = self.sigma_column = none
        self.phi_row = self.phi_column = none
        if self.nc:
            self.gap_rate, self.gap_rate_jac = (
                Rows(kernels, name) for name in ("gap_rate", "gap_rate_jac")
            )
            places = kernels.pattern("gap_rate_jac", "gamma_D")
            self.gamma_row, self.gamma_column = map(np.array, places)
        if self.nt:
            self.tangent, self.slide_rate = Rows(kernels, "tangent"), Rows(kernels, "slide_rate")
            self.slide_rate_jac = Rows(kernels, "slide_rate_jac")
            places = kernels.pattern("slide_rate_jac", "sigma_D")
            self.sigma_row, self.sigma_column = map(np.array, places)
            par = np.asarray(self.par)[None, : self.par.shape[0] - 1]
            kinds = [np.tile(mu[0], rows) for mu in kernels.call("friction", np.array(par))]
            self.mu, self.mu_s, self.static_too = kinds[0], kinds[len(kinds) - 1], len(kinds) > 1
            self.varied, self.speed = _space(rows * self.nt), _space(rows * self.nt)
            self.slows = kernels.has("dragging")
            varying = kernels.manifest.varying_friction
            names = [self.contacts.tangent_numbers[row["name"]] for row in varying]
            self.varies, self.pressed = np.array(names, dtype=np.intp), np.ones(self.nt)
            self.bearing = Rows(kernels, "bearing") if names else None
            self.holding = Rows(kernels, "holding") if names and self.static_too else None
        if self.nj:
            self.joint, self.joint_rate, self.joint_rate_jac = (
                Rows(kernels, name) for name in ("joint", "joint_rate", "joint_rate_jac")
            )
            places = kernels.pattern("joint_rate_jac", "phi_dot_D")
            self.phi_row, self.phi_column = map(np.array, places)
        self.gamma_D = _space(rows * self.gamma_row.shape[0])
        self.sigma_D = _space(rows * self.sigma_row.shape[0])
        self.phi_D, self.phi = _space(rows * self.phi_row.shape[0]), _space(rows * self.nj)
        self.g, self.tau = _space(rows * self.nc), _space(rows * self.nt)
        self.W, self.sides = np.ones(rows * self.nc), np.zeros(self.nc + 1, dtype=np.intc)
        self.lam = _space(rows * most)
        self.C, self.B, self.along = _space(most * nq), _space(most * nq), _space(self.nt * nq)
        self.responses = _space(2 * most * nq)
        self.A, self.scaled, self.V = (_space(most * most) for _ in range(3))
        self.bent, self.wanted, self.size, self.spare = (_space(most) for _ in range(4))
        self.change, self.way = _space(nq), _space(self.nt)
        self.closed_at, self.sticks_at, self.slides_at, self.presses, self.exchange = (
            np.zeros(n + 1, dtype=np.intp) for n in (self.nc, self.nt, self.nt, self.nt, most)
        )

    def _enter(self, mode):
        """Go by the conditions of a mode, without one by those of free flight, and of joints."""
        cdef ptrdiff_t i, k
        if mode is self.entered:
            return
        self.m = self.closed = self.sticking = self.sliding = 0
        self.free, self.entered = True, NONE
        if mode is None and not (self.nj or self.gripped):
            self.entered = None
            return
        if not self.ready:
            self._contacts()
        if mode not in self.known:
            own = FREE if mode is None else mode
            held = conditions_among(self.contacts, own, self.nj, self.gripped)
            self.known[mode] = held.drags, len(held), held.places(GAPS), held.places(TANGENTS)
        drags, self.m, closed, sticking = self.known[mode]
        self.sliding = len(drags)
        self.free = not (self.m or self.sliding)
        self.closed, self.sticking = len(closed[0]), len(sticking[0])
        self.closed_at[:], self.sticks_at[:], self.slides_at[:] = -1, -1, -1
        for places, (here, numbers) in ((self.closed_at, closed), (self.sticks_at, sticking)):
            for i, k in zip(here, numbers):
                places[k] = i
        for i, (k, way, pressed_by) in enumerate(drags):
            self.slides_at[k], self.way[i], self.presses[i] = i, way, pressed_by
        self.entered = mode

    cdef int gradients(self, ptrdiff_t n, ptrdiff_t width, const double *y) except -1 nogil:
        """Evaluate what the conditions of n rows are made of."""
        cdef const double *args[DMOC_MOST]
        cdef ptrdiff_t stride[DMOC_MOST]
        cdef double *results[DMOC_MOST]
        if (self.sticking or self.sliding) and self.varies.shape[0]:
            self.rub(n, width, y)
        args[0], args[1], args[2], args[3] = y, y + self.nq, &self.t[0], &self.par[0]
        stride[0], stride[1], stride[2], stride[3] = width, width, 1, 0
        if self.closed:
            results[0] = &self.gamma_D[0]
            self.gap_rate_jac.run(n, args, stride, results)
        if self.sticking or self.sliding:
            results[0] = &self.sigma_D[0]
            self.slide_rate_jac.run(n, args, stride, results)
        if self.nj:
            results[0] = &self.phi_D[0]
            self.joint_rate_jac.run(n, args, stride, results)
        return 0

    cdef int rub(self, ptrdiff_t n, ptrdiff_t width, const double *y) except -1 nogil:
        """Evaluate the coefficients of friction that vary, at n rows with the inputs u."""
        cdef const double *args[DMOC_MOST]
        cdef ptrdiff_t stride[DMOC_MOST]
        cdef double *results[DMOC_MOST]
        cdef double between = 0.0
        if self.slows:
            self.slide(n, width, y)
        args[0], args[1], args[2], args[3] = y, &self.speed[0], &self.u[0], &self.u[0]
        args[4], args[5], args[6], args[7] = &between, &self.pressed[0], &self.t[0], &self.par[0]
        stride[0], stride[1], stride[2], stride[3] = width, self.nt, self.nu, self.nu
        stride[4], stride[5], stride[6], stride[7] = 0, 0, 1, 0
        results[0] = &self.varied[0]
        self.bearing.run(n, args, stride, results)
        self.take(n, self.mu)
        if self.static_too:
            self.holding.run(n, args, stride, results)
            self.take(n, self.mu_s)
        return 0

    cdef int slide(self, ptrdiff_t n, ptrdiff_t width, const double *y) except -1 nogil:
        """Evaluate the sliding speeds of n rows, zero of what does not slide in the mode."""
        cdef const double *args[DMOC_MOST]
        cdef ptrdiff_t stride[DMOC_MOST]
        cdef double *results[DMOC_MOST]
        cdef ptrdiff_t i, k
        if not self.sliding:
            for i in range(n * self.nt):
                self.speed[i] = 0.0
            return 0
        args[0], args[1], args[2], args[3] = y, y + self.nq, &self.t[0], &self.par[0]
        stride[0], stride[1], stride[2], stride[3] = width, width, 1, 0
        results[0] = &self.speed[0]
        self.slide_rate.run(n, args, stride, results)
        for k in range(self.nt):
            for i in range(n):
                self.speed[i * self.nt + k] *= (
                    self.way[self.slides_at[k]] if self.slides_at[k] >= 0 else 0.0
                )
        return 0

    cdef void take(self, ptrdiff_t n, double[::1] mu) noexcept nogil:
        """Put the coefficients that vary into those of n rows."""
        cdef ptrdiff_t i, k
        for k in range(self.varies.shape[0]):
            for i in range(n):
                mu[i * self.nt + self.varies[k]] = self.varied[i * self.nt + self.varies[k]]

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
        for e in range(self.phi_row.shape[0]):
            p = self.closed + self.sticking + self.phi_row[e]
            self.enter(p, self.phi_column[e], self.phi_D[i * self.phi_row.shape[0] + e], v)
        for e in range(self.m * nq):
            self.B[e] = -self.C[e] if e < self.closed * nq else self.C[e]
        for e in range(self.nt if self.sliding else 0):
            p = self.slides_at[e]
            for c in range(nq if p >= 0 else 0):
                if self.presses[p] >= 0:
                    self.B[self.presses[p] * nq + c] -= self.drag(i, e) * self.along[p * nq + c]
                elif F != NULL:
                    F[c] -= self.drag(i, e) * self.along[p * nq + c]

    cdef double drag(self, ptrdiff_t i, ptrdiff_t tangent) noexcept nogil:
        """Friction against the direction of a tangent that slides in row i, of what a unit of
        force presses."""
        return self.way[self.slides_at[tangent]] * self.mu[i * self.nt + tangent]

    cdef double margin(self, ptrdiff_t i, ptrdiff_t k) noexcept nogil:
        """What row i leaves tangent k until its friction changes: of its cone where it sticks, of
        its speed, which is the last that was evaluated, where it slides; 1 where it does not rub."""
        cdef ptrdiff_t p = self.closed_at[self.support[k]] if self.support[k] >= 0 else -1
        cdef double load = self.lam[i * self.m + p] if p >= 0 else 1.0, needs
        if self.sticks_at[k] >= 0:
            needs = self.lam[i * self.m + self.sticks_at[k]]
            if self.partner[k] >= 0:
                needs = hypot(needs, self.lam[i * self.m + self.sticks_at[self.partner[k]]])
            return self.mu_s[i * self.nt + k] * load - fabs(needs)
        if self.slides_at[k] >= 0:
            return self.speed[i * self.nt + k] if not self.mu[i * self.nt + k] < 0 else -1.0
        return 1.0

    cdef void enter(self, ptrdiff_t p, ptrdiff_t c, double x, const double *v) noexcept nogil:
        """A derivative of the rate of condition p by entry c of (q, v, t)."""
        if c < self.nq:
            self.bent[p] += x * v[c]
        elif c < 2 * self.nq:
            self.C[p * self.nq + c - self.nq] = x
        else:
            self.bent[p] += x

    cdef void react(self, ptrdiff_t i, const double *LU, double *a) noexcept nogil:
        """Add to a = M^-1 F of row i what its multipliers make of it: as little as possible is left
        of conditions that contradict one another."""
        cdef ptrdiff_t p, c
        for p in range(self.m):
            self.wanted[p] = -self.bent[p]
            for c in range(self.nq):
                self.wanted[p] -= self.C[p * self.nq + c] * a[c]
        self.answer(LU, &self.B[0], &self.lam[i * self.m])
        for c in range(self.nq):
            a[c] += self.change[c]
        self.contradicted[i] = self.dependent and self.disagree(a)

    cdef bint disagree(self, const double *a) noexcept nogil:
        """Whether an acceleration keeps something that the mode demands beside the joints from
        staying where it is, measured by all that accelerates the conditions."""
        cdef ptrdiff_t p, c
        cdef double slope, terms, most = 0.0
        for p in range(self.m):
            self.wanted[p], terms = self.bent[p], fabs(self.bent[p])
            for c in range(self.nq):
                slope = self.C[p * self.nq + c]
                self.wanted[p] += slope * a[c]
                terms += fabs(slope) * (fabs(a[c]) + fabs(self.change[c]))
            most = fmax(most, terms / self.size[p])
        for p in range(self.closed + self.sticking):
            if fabs(self.wanted[p]) > AGREEING * most * self.size[p]:
                return True
        return False

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
            self.size[p] = 0.0
            for c in range(nq):
                self.size[p] += self.C[p * nq + c] * self.responses[c * columns + columns - m + p]
            self.size[p] = sqrt(fabs(self.size[p])) if self.size[p] > 0 and m > 1 else 1.0
        for p in range(m):
            lam[p] = self.wanted[p] / self.size[p]
            for k in range(m):
                self.A[p * m + k] = 0.0
                for c in range(nq):
                    self.A[p * m + k] += self.C[p * nq + c] * self.responses[c * columns + k]
                self.A[p * m + k] /= self.size[p] * self.size[k]
                self.scaled[p * m + k] = self.A[p * m + k]
        self.dependent = False
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
                self.dependent = True
                shortest(&self.scaled[0], &self.V[0], lam, &self.A[0], m, REDUNDANT)
        for p in range(m):
            lam[p] /= self.size[p]
        for c in range(nq):
            self.change[c] = 0.0
            for p in range(m):
                self.change[c] += self.responses[c * columns + p] * lam[p]

    cdef double contact_power(self, ptrdiff_t i, const double *v) noexcept nogil:
        """Power of contact and friction forces of row i, whose conditions were the last."""
        cdef ptrdiff_t p, c, k
        cdef double power = 0.0
        for c in range(self.nq):
            for p in range(self.m):
                power += self.lam[i * self.m + p] * self.B[p * self.nq + c] * v[c]
            for k in range(self.nt if self.sliding else 0):
                p = self.slides_at[k]
                if p >= 0 and self.presses[p] < 0:
                    power -= self.drag(i, k) * self.along[p * self.nq + c] * v[c]
        return power

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
                tangential[j] = -self.drag(i, j) * (lam[p] if p >= 0 else 1.0)
