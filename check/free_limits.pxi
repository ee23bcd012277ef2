"""By how much a free motion exceeds its path constraints and the bounds of its velocities
(dmoc.check.path_limits, dmoc.check.depth)."""

cdef double LEAST_SIZE = _paths.LEAST_SIZE, VARYING = _paths.VARYING, WAY_LEVEL = _paths.LEVEL
cdef double THIN = _paths.THIN, ROUNDED_LIMIT = ROUNDING
cdef ptrdiff_t DEEPEST = _paths.DEEPEST, HALVES = _depth.HALVES
cdef const double[::1] WAY_SHARES = _depth.SHARES


cdef class FreeLimits(FreePaths):
    """The largest excess of the functions of a free motion."""
    cdef double path_excess

    cdef bint judge_limits(self) except -1 nogil:
        """The largest excess of a function, relative to its size; False where one has no value."""
        cdef ptrdiff_t m = self.m, looks = self.share_of.shape[0], k, s, j
        cdef ptrdiff_t nq = self.nq, nu = self.nu
        cdef double moved[64]
        cdef double excess
        self.path_excess, self.seen = 0.0, 0
        if not m:
            return True
        self.need_inputs()
        self.measure_states()
        for j in range(m):
            moved[j] = 0.0
        for k in range(self.N):
            self.look_at_step(k, &self.looked[0])
            for s in range(looks):
                self.visit(
                    k, self.share_of[s], self.stands_at[s], &self.look_q[s * nq], &self.look_v[s * nq],
                    &self.look_u[s * nu], &self.look_t[s], &self.looked[s * m], moved
                )
        self.visit_dips(moved)
        for j in range(m):
            excess = self.excess_of(j, moved[j])
            if not isfinite(excess):
                return False
            self.path_excess = fmax(self.path_excess, excess)
        return True

    cdef double excess_of(self, ptrdiff_t j, double moved) except? -1 nogil:
        """What the largest excess of a function counts; infinite where it has no value."""
        cdef ptrdiff_t m = self.m, s, count = 0, chosen, i
        cdef double largest = 0.0, least, size, weight, most = 0.0, value
        for s in range(self.seen):
            largest = fmax(largest, self.terms[s * m + j])
        least = fmax(LEAST_SIZE * largest, ALMOST_NOTHING * moved)
        for s in range(self.seen):
            value = self.functions[s * m + j]
            if value != value:
                return INFINITY
            if j >= self.paths or self.by_terms[j]:
                size = fmax(self.terms[s * m + j], least)
                most = fmax(most, self.weight(s, j) * -value / (size if size > 0 else 1.0))
            if value < -ROUNDED_LIMIT * self.terms[s * m + j]:
                self.behind[count] = s
                count += 1
        chosen = self.choose_deepest(j, count)
        for i in range(chosen):
            s = self.behind[self.behind.shape[0] - 1 - i]
            value = self.distance(s, j)
            if value != value:
                return INFINITY
            most = fmax(most, self.weight(s, j) * value)
        return most

    cdef double weight(self, ptrdiff_t s, ptrdiff_t j) noexcept nogil:
        if j < self.paths and self.varies[j] and self.constant and not self.stands[s]:
            return VARYING
        return 1.0

    cdef ptrdiff_t choose_deepest(self, ptrdiff_t j, ptrdiff_t count) noexcept nogil:
        """Put the deepest states of those behind a function, by itself and by its slopes, at the
        end of these, and say how many."""
        cdef ptrdiff_t m = self.m, by, turn, i, best, s, end = self.behind.shape[0], chosen = 0
        cdef double depth
        for by in range(2):
            for i in range(count):
                s = self.behind[i]
                depth = -self.weight(s, j) * self.functions[s * m + j]
                self.depths[i] = depth / self.moved[s * m + j] if by else depth
            for turn in range(min(DEEPEST, count)):
                best = -1
                for i in range(count):
                    if self.depths[i] == self.depths[i] and (
                        best < 0 or self.depths[i] > self.depths[best]
                    ):
                        best = i
                if best < 0:
                    break
                self.depths[best] = NAN
                s = self.behind[best]
                for i in range(chosen):
                    if self.behind[end - 1 - i] == s:
                        break
                else:
                    chosen += 1
                    self.behind[end - chosen] = s
        return chosen

    cdef double distance(self, ptrdiff_t s, ptrdiff_t j) except? -1 nogil:
        """How far a state lies beyond a function, as a share of widths."""
        cdef double near = 0.0, across = 0.0, within = 0.0
        self.leave(s, j, self.width_of, &near, &across)
        if not isfinite(near):
            near = -self.functions[s * self.m + j] / self.moved[s * self.m + j]
        self.leave(s, j, self.even_width, &within, &across)
        return fmax(near, within / across / THIN)

    cdef int leave(
        self, ptrdiff_t s, ptrdiff_t j, const double[::1] widths, double *near, double *across
    ) except -1 nogil:
        """The smallest share of a way that leads a state to where a function is kept, and with it
        that of the same way in the other direction."""
        cdef ptrdiff_t count = self.find_ways(s, j, widths), first = WAY_SHARES.shape[0], w, i
        cdef ptrdiff_t shares = WAY_SHARES.shape[0], best = -1
        cdef ptrdiff_t begun[512]
        for w in range(2 * count):
            begun[w] = shares
            for i in range(shares):
                if self.leads_out(j, w, WAY_SHARES[i]):
                    begun[w] = i
                    break
            first = min(first, begun[w])
        near[0] = across[0] = INFINITY
        for w in range(2 * count):
            if begun[w] == first < shares:
                self.farthest[w] = self.halved(j, w, first)
                if self.farthest[w] < near[0]:
                    near[0], best = self.farthest[w], w
        if best >= 0:
            w = (best + count) % (2 * count)
            if begun[w] < shares:
                across[0] = near[0] + (
                    self.farthest[w] if begun[w] == first else self.halved(j, w, begun[w])
                )
        return 0

    cdef ptrdiff_t find_ways(
        self, ptrdiff_t s, ptrdiff_t j, const double[::1] widths
    ) except -1 nogil:
        """The ways (k, d) out of a function from a state, and those back behind them; k."""
        cdef const double *args[DMOC_MOST]
        cdef ptrdiff_t stride[DMOC_MOST]
        cdef double *results[DMOC_MOST]
        cdef ptrdiff_t d = self.d, nq = self.nq, nu = self.nu, i, e, count = 1
        cdef double *slopes = &self.farthest[0]
        cdef double most = 0.0, width
        self.states_at(
            self.visited_step[s], 1, &self.visited_share[s], &self.state[0], &self.state[nq],
            &self.state[2 * nq], &self.state[2 * nq + nu]
        )
        for i in range(d):
            slopes[i] = 0.0
        if j < self.paths:
            for i in range(5):
                stride[i] = 0
            args[0], args[1], args[2] = &self.state[0], &self.state[nq], &self.state[2 * nq]
            args[3], args[4] = &self.state[2 * nq + nu], &self.par[0]
            results[0] = &self.path_stored[0]
            self.path_slopes.run(1, args, stride, results)
            for e in range(self.r_row.shape[0]):
                if self.r_row[e] == j:
                    slopes[self.r_col[e]] = self.path_stored[e]
        else:
            slopes[nq + <ptrdiff_t>self.rates[j - self.paths, 0]] = self.rates[j - self.paths, 1]
        for i in range(d):
            width = fabs(slopes[i]) * (widths[i] if self.depends(j, i) else 0.0)
            most = fmax(most, width if isfinite(width) else 0.0)
        for i in range(d):
            width = widths[i] if self.depends(j, i) else 0.0
            self.ways[i] = 0.0
            if isfinite(slopes[i] * width) and fabs(slopes[i]) * width > WAY_LEVEL * most:
                self.ways[i] = width if slopes[i] > 0 else -width
        for i in range(d):
            if self.depends(j, i) and widths[i] > 0:
                for e in range(d):
                    self.ways[count * d + e] = widths[i] if e == i else 0.0
                count += 1
        for i in range(count * d):
            self.ways[count * d + i] = -self.ways[i]
        return count

    cdef bint depends(self, ptrdiff_t j, ptrdiff_t i) noexcept nogil:
        """Whether a function depends on an entry of a state: a bound on all velocities."""
        return self.on[j * self.d + i] if j < self.paths else self.nq <= i < 2 * self.nq

    cdef bint leads_out(self, ptrdiff_t j, ptrdiff_t w, double share) except -1 nogil:
        """Whether a function is kept at a share of a way."""
        cdef double moved[192]
        cdef ptrdiff_t i, nq = self.nq, nu = self.nu
        for i in range(self.d):
            moved[i] = self.state[i] + share * self.ways[w * self.d + i]
        self.functions_of(
            1, moved, &moved[nq], &moved[2 * nq], &moved[2 * nq + nu], &self.looked[0]
        )
        return self.looked[j] >= 0

    cdef double halved(self, ptrdiff_t j, ptrdiff_t w, ptrdiff_t first) except? -1 nogil:
        """The share of a way from which on a function is kept, up to a number of shares."""
        cdef double low = WAY_SHARES[first - 1] if first else 0.0, high = WAY_SHARES[first], middle
        cdef ptrdiff_t turn
        for turn in range(HALVES):
            middle = (low + high) / 2
            if self.leads_out(j, w, middle):
                high = middle
            else:
                low = middle
        return high
