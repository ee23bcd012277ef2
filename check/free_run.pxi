"""The simulation of a free motion from its start to its end, and of the segments that meet surfaces,
through the contacts that they meet (dmoc.check.runs, dmoc.simulation.flow)."""

cdef double LOCATED = _flow.LOCATED, ROUNDED_TIME = ROUNDING, SAME_CONTACT = _runs.SAME_CONTACT
cdef double ASTRAY_RANGES = _runs.ASTRAY, SLIGHT = GRAZING
cdef ptrdiff_t MOST_IMPACTS = _flow.MOST_IMPACTS, MOST_BISECTIONS = _roots.MOST_STEPS
# Contacts of a run that are kept; a motion with more is looked at in another way.
cdef enum:
    CONTACTS = 256
    BETWEEN = 17  # places between two others, for the last moment inside

# What comes of a step or a search.
cdef enum:
    GOES_ON
    HIT
    LOST


cdef struct Contact:
    ptrdiff_t surface
    double time, jump


cdef class FreeRun(FreeParts):
    """Runs of a free motion."""
    cdef Contact contacts[CONTACTS]
    cdef Contact met[CONTACTS]
    cdef double terminal
    cdef ptrdiff_t contact_count
    cdef double[::1] y_now, y_next, y_ends, saved, lap_u

    def _run(self):
        cdef ptrdiff_t m = 2 * self.nq
        self.y_now, self.y_next, self.y_ends, self.saved = (_space(m) for _ in range(4))
        self.lap_u = _space(4 * self.nu)

    # A step through contacts ----------------------------------------------------------------------

    cdef void inputs_at(self, ptrdiff_t k, double t, double *u) noexcept nogil:
        cdef double share = (t - self.begins_at[k]) / (
            self.begins_at[k] + self.h[k] - self.begins_at[k]
        )
        cdef ptrdiff_t i
        for i in range(self.nu):
            u[i] = (1 - share) * self.u_begin[k, i] + share * self.u_end[k, i]

    cdef int until(
        self, ptrdiff_t k, double t, double end, const double *y, double *to, double *ends
    ) except -1 nogil:
        """The state at a later time of step k, and the accelerations at both ends."""
        cdef ptrdiff_t i
        cdef double h = end - t
        for i in range(2 * self.nq):
            to[i] = y[i]
        self.inputs_at(k, t, &self.lap_u[0])
        self.inputs_at(k, end, &self.lap_u[self.nu])
        self.which[0] = self.step[0] = 0
        return self.advance_rows(
            1, 2 * self.nq, to, &t, &h, &self.lap_u[0], &self.lap_u[self.nu], ends
        )

    cdef double gap_at(
        self, ptrdiff_t k, double t, double end, const double *y, ptrdiff_t j
    ) except? -1 nogil:
        """The gap to a surface at a later time."""
        cdef const double *args[DMOC_MOST]
        cdef ptrdiff_t stride[DMOC_MOST]
        cdef double *results[DMOC_MOST]
        cdef ptrdiff_t i
        self.until(k, t, end, y, &self.saved[0], NULL)
        for i in range(3):
            stride[i] = 0
        args[0], args[1], args[2] = &self.saved[0], &end, &self.par[0]
        results[0] = &self.between_gaps[0]
        self.surface.run(1, args, stride, results)
        return self.between_gaps[j]

    cdef double rate_at(self, const double *y, double t, ptrdiff_t j) except? -1 nogil:
        """The rate of a gap."""
        cdef double normal[65]
        cdef double response[64]
        cdef double rate
        cdef ptrdiff_t i
        self.normal_at(y, t, j, normal, response)
        rate = normal[self.nq]
        for i in range(self.nq):
            rate += normal[i] * y[self.nq + i]
        return rate

    cdef int through_contacts(
        self, ptrdiff_t k, Contact *contacts, ptrdiff_t *count
    ) except -1 nogil:
        """Take ``y_now`` over step k, through the contacts that it meets."""
        cdef ptrdiff_t nq = self.nq, j = 0, turn, i
        cdef double t = self.begins_at[k], end = self.begins_at[k] + self.h[k], at = 0.0, rate
        cdef double v[64]
        cdef double impulse = 0.0, inertia = 0.0
        for turn in range(MOST_IMPACTS):
            self.until(k, t, end, &self.y_now[0], &self.y_next[0], &self.y_ends[0])
            if not finite(2 * nq, &self.y_next[0]):
                return LOST
            if self.first_hit(k, t, end, &at, &j) == GOES_ON:
                for i in range(2 * nq):
                    self.y_now[i] = self.y_next[i]
                return GOES_ON
            if at > t:
                self.until(k, t, at, &self.y_now[0], &self.y_next[0], NULL)
                for i in range(2 * nq):
                    self.y_now[i] = self.y_next[i]
            t = at
            rate = self.hits(j, &self.y_now[0], t, v, &impulse, &inertia)
            if not finite(nq, v) or count[0] == CONTACTS:
                return LOST
            if rate <= 0:  # leaves by itself
                for i in range(nq):
                    v[i] = self.y_now[nq + i]
            contacts[count[0]].surface, contacts[count[0]].time = j, t
            contacts[count[0]].jump = self.jump(t, v)
            count[0] += 1
            for i in range(nq):
                self.y_now[nq + i] = v[i]
            if end - t <= ROUNDED_TIME * self.time:
                return GOES_ON
        return LOST

    cdef double jump(self, double t, const double *v) except? -1 nogil:
        """The largest change of a momentum of ``y_now`` to another velocity, in sizes."""
        cdef const double *args[DMOC_MOST]
        cdef ptrdiff_t stride[DMOC_MOST]
        cdef double *results[DMOC_MOST]
        cdef double before[64]
        cdef double after[64]
        cdef double most = 0.0
        cdef ptrdiff_t i
        for i in range(4):
            stride[i] = 0
        args[0], args[1], args[2], args[3] = (
            &self.y_now[0], &self.y_now[self.nq], &t, &self.par[0]
        )
        results[0] = before
        self.momentum.run(1, args, stride, results)
        args[1], results[0] = v, after
        self.momentum.run(1, args, stride, results)
        for i in range(self.nq):
            most = fmax(most, fabs(after[i] - before[i]) / self.size_p[i])
        return most

    cdef int first_hit(
        self, ptrdiff_t k, double t, double end, double *at, ptrdiff_t *surface
    ) except -1 nogil:
        """The first crossing of a surface from ``y_now`` to ``y_next``."""
        cdef const double *args[DMOC_MOST]
        cdef ptrdiff_t stride[DMOC_MOST]
        cdef double *results[DMOC_MOST]
        cdef ptrdiff_t places = PLACES.shape[0], nc = self.nc, s, j, over, outside
        cdef double error, low, when, first = INFINITY
        cdef double gaps[512]
        cdef double times[64]
        cdef bint leaving
        quintic(
            self.nq, &self.y_now[0], &self.y_ends[0], &self.y_next[0], end - t, PLACES,
            &self.path[0], self.nq
        )
        for s in range(places):
            times[s] = t + PLACES[s] * (end - t)
        args[0], args[1], args[2], results[0] = &self.path[0], times, &self.par[0], gaps
        stride[0], stride[1], stride[2] = self.nq, 1, 0
        if nc:
            self.surface.run(places, args, stride, results)
        for j in range(nc):
            if not self.watched[j]:
                continue
            error, outside, over = GAP_ERROR * self.size_gap[j], 0, -1
            for s in range(places):
                if gaps[s * nc + j] > error:
                    over = s
            if over < 0:
                continue
            leaving = gaps[j] > error and self.rate_at(&self.y_now[0], t, j) < 0
            if leaving:
                for s in range(places):
                    if gaps[s * nc + j] <= error:
                        outside = s
                        break
                if not outside:
                    continue
            over = -1
            for s in range(places):
                if gaps[s * nc + j] > error and not (leaving and s <= outside):
                    over = s
                    break
            if over < 0:
                continue
            if over == 0 or gaps[(over - 1) * nc + j] >= -error:
                # Starts on the surface: look for the last moment inside.
                low = NAN
                for s in range(1, BETWEEN - 1):
                    if over == 0:
                        break
                    when = times[over - 1] + s * (times[over] - times[over - 1]) / (BETWEEN - 1)
                    if self.gap_at(k, t, when, &self.y_now[0], j) < -error:
                        low = when
                if low != low:  # leaves the admissible set at once
                    at[0], surface[0] = t if over <= 1 else times[over - 1], j
                    return HIT
            else:
                low = times[over - 1]
            when = self.crossing(k, t, low, times[over], j)
            if when == when and when < first:
                first, surface[0] = when, j
        at[0] = first
        return HIT if first < INFINITY else GOES_ON

    cdef double crossing(
        self, ptrdiff_t k, double t, double low, double high, ptrdiff_t j
    ) except? -1 nogil:
        """When the gap to a surface passes zero between two times (dmoc.simulation.roots); not a
        number where it does not."""
        cdef double a = low, b = high, c, x, share = 0.5, least, xi, phi
        cdef double f_a = self.gap_at(k, t, low, &self.y_now[0], j)
        cdef double f_b = self.gap_at(k, t, high, &self.y_now[0], j), f_c, f_x
        cdef ptrdiff_t turn
        if f_a >= 0 or f_b <= 0:
            return NAN
        for turn in range(MOST_BISECTIONS):
            x = a + share * (b - a)
            f_x = self.gap_at(k, t, x, &self.y_now[0], j)
            if (f_x > 0) == (f_a > 0):
                c, f_c = a, f_a
            else:
                c, f_c, b, f_b = b, f_b, a, f_a
            a, f_a = x, f_x
            least = 0.5 * LOCATED * self.time / fabs(b - a) if b != a else 1.0
            if f_a == 0 or least > 0.5:
                break
            xi, phi = (a - b) / (c - b), (f_a - f_b) / (f_c - f_b)
            if phi**2 < xi and (1 - phi) ** 2 < 1 - xi:
                share = f_a / (f_b - f_a) * f_c / (f_b - f_c) + (c - a) / (b - a) * f_a / (
                    f_c - f_a
                ) * f_b / (f_c - f_b)
            else:
                share = 0.5
            share = fmin(fmax(share, least), 1 - least)
        return a if fabs(f_a) < fabs(f_b) else b

    # Runs -----------------------------------------------------------------------------------------

    cdef ptrdiff_t quietly(self, ptrdiff_t k, ptrdiff_t last, bint anywhere) except -2 nogil:
        """Take ``y_now`` over steps from k on that meet no surface; the first that might, or
        ``last``, and -1 where the motion has come astray."""
        cdef ptrdiff_t i, m = 2 * self.nq
        while k < last:
            for i in range(m):
                self.y_next[i] = self.y_now[i]
            self.which[0], self.step[0] = 0, k
            self.advance_rows(
                1, m, &self.y_next[0], &self.begins_at[0], &self.h[0], self.inputs(0),
                self.inputs(1), &self.y_ends[0]
            )
            if not finite(m, &self.y_next[0]):
                return k
            if self.nc:
                self.look(
                    &self.y_now[0], &self.y_ends[0], &self.y_next[0], self.begins_at[k], self.h[k],
                    PLACES, self.path, self.moments, self.between_gaps
                )
                if over(
                    PLACES.shape[0], self.nc, &self.between_gaps[0], &self.upper[0], &self.near[0]
                ):
                    return k
            for i in range(m):
                self.y_now[i] = self.y_next[i]
            k += 1
            if not anywhere and self.is_astray(k - 1):
                return -1
        return k

    cdef bint is_astray(self, ptrdiff_t k) noexcept nogil:
        """Whether ``y_now`` at the end of a step is far away from the motion."""
        cdef ptrdiff_t i
        for i in range(self.nq):
            if not fabs(self.y_now[i] - self.q[self.node(k) + 1, i]) <= (
                ASTRAY_RANGES * self.size_q[i]
            ):
                return True
        return False

    cdef bint run_open(self) except -1 nogil:
        """The run from the start to the end; False where it leaves the motion."""
        cdef ptrdiff_t i, k = 0, last
        self.contact_count = 0
        for i in range(self.nq):
            self.y_now[i], self.y_now[self.nq + i] = self.q[0, i], self.v[0, i]
        for i in range(self.P):
            last = self.begins[i + 1] - 1 - i
            while k < last:
                k = self.quietly(k, last, False)
                if k < 0:
                    return False
                if k < last:
                    if self.through_contacts(k, self.contacts, &self.contact_count) == LOST:
                        return False
                    if self.is_astray(k):
                        return False
                    k += 1
        self.terminal = self.off_by(&self.y_now[0], self.n - 1)
        return isfinite(self.terminal) and self.as_planned(self.contacts, self.contact_count)

    cdef bint is_planned(self, const Contact *contact, ptrdiff_t i) noexcept nogil:
        """Whether a contact is the hit at the end of a phase."""
        return contact.surface == self.hit[i] and (
            fabs(contact.time - self.numbers[i, 0]) <= SAME_CONTACT * self.time
        )

    cdef bint as_planned(self, const Contact *contacts, ptrdiff_t count) noexcept nogil:
        """Whether contacts are the planned hits, and others that merely graze."""
        cdef unsigned char taken[CONTACTS]
        cdef ptrdiff_t i, c
        for c in range(count):
            taken[c] = False
        for i in range(self.P - 1):
            for c in range(count):
                if not taken[c] and self.is_planned(&contacts[c], i):
                    taken[c] = True
                    break
            else:
                return False
        for c in range(count):
            if not taken[c] and contacts[c].jump > SLIGHT:
                return False
        return True

    cdef bint run_segments(self) except -1 nogil:
        """The segments that may meet a surface, from their own starts; False where they meet what is
        not planned, or miss what is."""
        cdef ptrdiff_t s, k, last, m = 2 * self.nq, i, count = 0
        cdef bint strikes
        for s in range(self.S):
            k, last = self.first[s], self.behind[s]
            while k < last and not self.meets_surface(k):
                k += 1
            strikes = (s == self.S - 1 or self.of_phase[s + 1] != self.of_phase[s]) and (
                self.of_phase[s] < self.P - 1
            )
            if not (k < last or strikes):
                continue
            for i in range(m):
                self.y_now[i] = self.course[k, i] if k < last else self.course[last - 1, 2 * m + i]
            if not self.run_segment(s, k, strikes, &count):
                return False
        return self.as_planned(self.met, count)

    cdef bint meets_surface(self, ptrdiff_t k) except -1 nogil:
        cdef ptrdiff_t m = 2 * self.nq
        if not self.nc:
            return False
        self.look(
            &self.course[k, 0], &self.course[k, m], &self.course[k, 2 * m], self.begins_at[k],
            self.h[k], PLACES, self.path, self.moments, self.between_gaps
        )
        return over(PLACES.shape[0], self.nc, &self.between_gaps[0], &self.upper[0], &self.near[0])

    cdef bint run_segment(
        self, ptrdiff_t s, ptrdiff_t k, bint strikes, ptrdiff_t *count
    ) except -1 nogil:
        """What is left of a segment from a step on, with its planned hit a little early or late;
        False where it is lost."""
        cdef ptrdiff_t i = self.of_phase[s], last = self.behind[s], begun = count[0], c, m = 2 * self.nq
        cdef double before[128]
        cdef bint planned = False
        while k < last and not planned:
            for c in range(m):
                before[c] = self.y_now[c]
            begun = count[0]
            if self.through_contacts(k, self.met, count) == LOST:
                return False
            if strikes:
                for c in range(begun, count[0]):
                    planned = planned or self.is_planned(&self.met[c], i)
            if planned:
                count[0] = begun + 1
            else:
                k = self.quietly(k + 1, last, True)
        return planned or not strikes or self.strikes_late(i, count)

    cdef bint strikes_late(self, ptrdiff_t i, ptrdiff_t *count) except -1 nogil:
        """Whether ``y_now``, at the end of a phase, comes to its hit a little later."""
        cdef ptrdiff_t j = self.hit[i]
        cdef double t = self.T[self.begins[i + 1] - 1], gap, rate
        gap = self.gap_at(self.begins[i + 1] - 2 - i, t, t, &self.y_now[0], j)
        rate = self.rate_at(&self.y_now[0], t, j)
        if not (rate > 0 and -gap <= SAME_CONTACT * self.time * rate) or count[0] == CONTACTS:
            return False
        self.met[count[0]].surface, self.met[count[0]].time = j, t
        self.met[count[0]].jump = 1.0
        count[0] += 1
        return True
