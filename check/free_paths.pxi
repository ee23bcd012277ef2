"""Where a free motion is looked at for its path constraints and the bounds of its velocities
(dmoc.check.limit_functions, dmoc.check.depth)."""

cdef double GOLDEN = _depth.GOLDEN
cdef ptrdiff_t SECTIONS = _depth.SECTIONS


cdef class FreePaths(FreeCosts):
    """m functions r >= 0 of states (q | v | u | t): the path constraints, then the bounds
    (place, sign, value) of velocities, sign (v - value) >= 0."""
    cdef ptrdiff_t m, paths, d, seen
    cdef Rows path_limit, path_slopes, path_terms
    cdef ptrdiff_t[::1] r_row, r_col, term_of
    cdef unsigned char[::1] by_terms, varies, on  # (paths,), (paths,), (paths, d)
    cdef double[:, ::1] rates
    cdef bint constant
    cdef bytes limited  # the mesh and the bounds that arrays are laid out for
    # Of the states at which a step is looked at: shares, states, functions, and whether
    # constraints stand there.
    cdef double[::1] share_of, look_q, look_v, look_u, look_t, looked
    cdef unsigned char[::1] stands_at
    cdef double[::1] term_values, path_stored
    # Of all states that are visited, "seen" of them: the step and its share, whether constraints
    # stand there, functions, terms, and what slopes and widths move functions by, (states, m).
    cdef ptrdiff_t[::1] visited_step, behind
    cdef double[::1] visited_share, functions, terms, moved
    cdef unsigned char[::1] stands
    # Sizes and widths of a state, and those as wide in all directions.
    cdef double[::1] size_of, width_of, even_width
    cdef double[::1] state, ways, farthest, depths  # of what lies beyond (free_limits.pxi)

    def __init__(self, kernels, scheme):
        super().__init__(kernels, scheme.nodes[2:].copy())
        facts, nq, nu = kernels.manifest, self.nq, self.nu
        rows = facts.path_limits
        self.paths, self.d = len(rows), 2 * nq + nu + 1
        self.limited = b""
        self.r_row = self.r_col = self.term_of = np.zeros(0, dtype=np.intp)
        if self.paths:
            self.path_limit = Rows(kernels, "path_limit")
            self.path_slopes, self.path_terms = (
                Rows(kernels, "path_limit_jac"), Rows(kernels, "path_terms")
            )
            self.r_row, self.r_col = map(np.array, kernels.pattern("path_limit_jac", "r_s_D"))
            self.term_of = np.repeat(np.arange(self.paths), [row["terms"] for row in rows])
        by_terms = [bool(row["velocities"] or row["inputs"]) for row in rows]
        self.by_terms = np.array(by_terms, dtype=np.uint8)
        moves = [row["inputs"] and bool(row["coordinates"] or row["velocities"]) for row in rows]
        self.varies = np.array(moves, dtype=np.uint8)
        on = np.zeros((self.paths, self.d), dtype=np.uint8)
        for j, row in enumerate(rows):
            on[j, row["coordinates"]] = True
            on[j, nq : 2 * nq], on[j, 2 * nq : 2 * nq + nu] = row["velocities"], row["inputs"]
            on[j, 2 * nq + nu] = row["time"]
        self.on = on.ravel()
        self.share_of = np.concatenate([PLACES, scheme.places])
        self.stands_at = np.isin(self.share_of, scheme.places).astype(np.uint8)
        looks = self.share_of.shape[0]
        self.look_q, self.look_v = _space(looks * nq), _space(looks * nq)
        self.look_u, self.look_t = _space(looks * nu), _space(looks)
        self.term_values = _space(self.term_of.shape[0])
        self.path_stored = _space(self.r_row.shape[0])
        self.size_of, self.width_of, self.even_width, self.state = (
            _space(self.d) for _ in range(4)
        )
        self.ways, self.farthest = _space(4 * (self.d + 1) * self.d), _space(4 * (self.d + 1))

    def limit(self, rates, constant):
        """Take bounds of velocities, rows (place, sign, value), and whether inputs are constant in
        steps."""
        cdef ptrdiff_t most, looks = self.share_of.shape[0]
        self.rates, self.constant, self.m = rates, constant, self.paths + len(rates)
        key = bytes(self.begins) + bytes([self.m])
        if self.limited == key or not self.m:
            return
        self.limited, m = key, self.m
        most = self.N * (looks + PLACES.shape[0] * m)
        self.visited_step = np.zeros(most, dtype=np.intp)
        self.behind = np.zeros(most + 2 * DEEPEST, dtype=np.intp)
        self.visited_share, self.stands = _space(most), np.zeros(most, dtype=np.uint8)
        self.functions, self.terms, self.moved = (_space(most * m) for _ in range(3))
        self.depths = _space(most)
        self.looked = _space(looks * m)

    cdef int functions_of(
        self, ptrdiff_t count, const double *q, const double *v, const double *u, const double *t,
        double *values
    ) except -1 nogil:
        """The functions at states (count, m)."""
        cdef const double *args[DMOC_MOST]
        cdef ptrdiff_t stride[DMOC_MOST]
        cdef double *results[DMOC_MOST]
        cdef ptrdiff_t nq = self.nq, s, j
        args[0], args[1], args[2], args[3], args[4] = q, v, u, t, &self.par[0]
        stride[0], stride[1], stride[2], stride[3], stride[4] = nq, nq, self.nu, 1, 0
        results[0] = values
        if self.paths:
            self.path_limit.run(count, args, stride, results)
        if self.m == self.paths:
            return 0
        for s in range(count - 1, -1, -1):  # from the last one on: rows grow by their bounds
            for j in range(self.paths - 1, -1, -1):
                values[s * self.m + j] = values[s * self.paths + j]
            for j in range(self.paths, self.m):
                values[s * self.m + j] = self.rates[j - self.paths, 1] * (
                    v[s * nq + <ptrdiff_t>self.rates[j - self.paths, 0]]
                    - self.rates[j - self.paths, 2]
                )
        return 0

    cdef int measure_states(self) noexcept nogil:
        """Sizes of what states consist of, and widths in which they lie."""
        cdef ptrdiff_t nq = self.nq, nu = self.nu, i, k, begin
        cdef double most
        for i in range(nq):
            self.size_of[i], self.size_of[nq + i] = self.size_q[i], self.size_v[i]
        for i in range(nu):
            most = self.needed[i] if isfinite(self.needed[i]) else 0.0
            for k in range(self.N):
                most = fmax(most, fmax(fabs(self.u_begin[k, i]), fabs(self.u_end[k, i])))
            self.size_of[2 * nq + i] = most
        self.size_of[2 * nq + nu] = self.time
        for i in range(self.d):
            k = 2 if nq <= i < 2 * nq + nu else 1
            self.width_of[i] = self.even_width[i] = k * self.size_of[i]
        for k in range(2):
            begin, most = k * nq, 0.0
            for i in range(nq):
                most = fmax(most, self.width_of[begin + i] * self.root[i])
            for i in range(nq):
                self.even_width[begin + i] = most / self.root[i]
        return 0

    cdef int visit(
        self, ptrdiff_t k, double share, bint stands, const double *q, const double *v,
        const double *u, const double *t, const double *values, double *sizes
    ) except -1 nogil:
        """Keep a state with its functions (m,), and by how much sizes could move them at most."""
        cdef const double *args[DMOC_MOST]
        cdef ptrdiff_t stride[DMOC_MOST]
        cdef double *results[DMOC_MOST]
        cdef ptrdiff_t at = self.seen, m = self.m, i, j, e
        cdef double whole[64]
        cdef double slope
        self.visited_step[at], self.visited_share[at], self.stands[at] = k, share, stands
        for j in range(m):
            self.functions[at * m + j] = values[j]
            self.terms[at * m + j] = self.moved[at * m + j] = 0.0
            whole[j] = 0.0
        if self.paths:
            for i in range(5):
                stride[i] = 0
            args[0], args[1], args[2], args[3], args[4] = q, v, u, t, &self.par[0]
            results[0] = &self.term_values[0]
            self.path_terms.run(1, args, stride, results)
            results[0] = &self.path_stored[0]
            self.path_slopes.run(1, args, stride, results)
        for e in range(self.term_of.shape[0]):
            self.terms[at * m + self.term_of[e]] += fabs(self.term_values[e])
        for e in range(self.r_row.shape[0]):
            j, slope = self.r_row[e], fabs(self.path_stored[e])
            self.moved[at * m + j] += slope * self.width_of[self.r_col[e]]
            whole[j] += slope * self.size_of[self.r_col[e]]
        for j in range(self.paths, m):
            i = <ptrdiff_t>self.rates[j - self.paths, 0]
            self.terms[at * m + j] = fabs(v[i]) + fabs(self.rates[j - self.paths, 2])
            self.moved[at * m + j] = self.width_of[self.nq + i]
            whole[j] = self.size_of[self.nq + i]
        for j in range(m):
            if isfinite(whole[j]):
                sizes[j] = fmax(sizes[j], whole[j])
            if not isfinite(self.terms[at * m + j]):
                self.terms[at * m + j] = 0.0
        self.seen += 1
        return 0

    cdef int look_at_step(self, ptrdiff_t k, double *values) except -1 nogil:
        """The functions (looks, m) at the places of a step, whose states are kept."""
        cdef ptrdiff_t looks = self.share_of.shape[0]
        self.states_at(
            k, looks, &self.share_of[0], &self.look_q[0], &self.look_v[0], &self.look_u[0],
            &self.look_t[0]
        )
        return self.functions_of(
            looks, &self.look_q[0], &self.look_v[0], &self.look_u[0], &self.look_t[0], values
        )

    # Between places -------------------------------------------------------------------------------

    cdef int visit_dips(self, double *moved) except -1 nogil:
        """Visit the states where functions are lowest between the places of steps."""
        cdef ptrdiff_t m = self.m, last = PLACES.shape[0] - 1, looks = self.share_of.shape[0]
        cdef ptrdiff_t k, s, j
        cdef double here, left, right, share
        for k in range(self.N):
            for s in range(last + 1):
                for j in range(m):
                    here = self.kept(k, s, j)
                    left = self.kept(k, s - 1, j) if s else (
                        self.kept(k - 1, last - 1, j) if k else INFINITY
                    )
                    right = self.kept(k, s + 1, j) if s < last else (
                        self.kept(k + 1, 1, j) if k + 1 < self.N else INFINITY
                    )
                    if not (here <= left and here <= right and here < fmax(left, right)):
                        continue
                    share = self.lowest(
                        k, j, <double>max(s - 1, 0) / last, <double>min(s + 1, last) / last
                    )
                    self.function_at(k, share, j)
                    self.visit(
                        k, share, False, &self.look_q[0], &self.look_v[0], &self.look_u[0],
                        &self.look_t[0], &self.looked[0], moved
                    )
        return 0

    cdef double kept(self, ptrdiff_t k, ptrdiff_t s, ptrdiff_t j) noexcept nogil:
        """A function at a place of a step, infinite where it has no value."""
        cdef double value = self.functions[(k * self.share_of.shape[0] + s) * self.m + j]
        return value if value == value else INFINITY

    cdef double function_at(self, ptrdiff_t k, double share, ptrdiff_t j) except? -1 nogil:
        """A function at a share of a step."""
        self.states_at(
            k, 1, &share, &self.look_q[0], &self.look_v[0], &self.look_u[0], &self.look_t[0]
        )
        self.functions_of(
            1, &self.look_q[0], &self.look_v[0], &self.look_u[0], &self.look_t[0], &self.looked[0]
        )
        return self.looked[j]

    cdef double lowest(
        self, ptrdiff_t k, ptrdiff_t j, double low, double high
    ) except? -1 nogil:
        """The share of a step, between two, at which a function is lowest, by golden sections."""
        cdef double left = high - GOLDEN * (high - low), right = low + GOLDEN * (high - low)
        cdef double at_left = self.function_at(k, left, j), at_right = self.function_at(k, right, j)
        cdef ptrdiff_t turn
        for turn in range(SECTIONS):
            if at_left < at_right:
                high, right, at_right = right, left, at_left
                left = high - GOLDEN * (high - low)
                at_left = self.function_at(k, left, j)
            else:
                low, left, at_left = left, right, at_right
                right = low + GOLDEN * (high - low)
                at_right = self.function_at(k, right, j)
        return left if at_left < at_right else right
