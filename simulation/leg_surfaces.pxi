"""What surfaces say along a leg: gaps, their rates, where they are crossed, and when they are hit."""

cdef enum:
    ROOT_LIMIT = 200


cdef class LegAmongSurfaces(Leg):
    """A leg that surfaces may end."""

    cdef double gap(self, double x, int j) except? -1e300 nogil:
        """g_j at the share x."""
        self.place(x)
        self.surface.run()
        return self.g[0, j]

    cdef double rate(self, double x, int j) except? -1e300 nogil:
        """Derivative of g_j with respect to the share x."""
        cdef int k, i
        cdef double value = 0.0, change
        self.place(x)
        self.slope.run()
        self.weigh(x, 1)
        for k in range(self.g_row.shape[0]):
            if self.g_row[k] == j:
                i = <int>self.g_col[k]
                if i == self.nq:
                    change = self.h[0, 0]
                else:
                    change = self.along(i)
                value += self.g_q[0, k] * change
        return value

    cdef double crossing(self, int j, bint touching) except? -1.0 nogil:
        """Share of the leg at which surface j is certainly crossed; 0 if it is not.  One that is touched may be left by rounding errors."""
        cdef double low, high, middle, x, most = self.tolerance[j]
        cdef int i
        if touching:
            most += RATE_TOLERANCE * self.rate_size[j] * self.h[0, 0]
        if self.gap(1.0, j) > most:
            return 1.0
        for x in (0.25, 0.5, 0.75):
            if self.gap(x, j) > most:
                return x
        if self.rate(0.0, j) > 0 and self.rate(1.0, j) < 0:  # in and out again: look at the summit
            low, high = 0.0, 1.0
            for i in range(50):
                middle = 0.5 * (low + high)
                if self.rate(middle, j) > 0:
                    low = middle
                else:
                    high = middle
            if self.gap(low, j) > most:
                return low
        return 0.0

    cdef double hit_time(self, int j, double s_high) except? -3.0 nogil:
        """Duration in (0, s_high] at which a leg ends on surface j; -1 if a leg has no solution, -2 if the motion does not leave the surface."""
        cdef double low = s_high, high = s_high, g_low, g_high, s, g, width
        cdef int k, side = 0
        if not self.leg(high):
            return -1.0
        g_high = self.gap(1.0, j)
        g_low = g_high
        for k in range(60):  # a start inside: shorter and shorter legs, because a leg may start on this surface
            low *= 0.5
            if low < SHORTEST_LEG * self.full:
                break
            if not self.leg(low):
                return -1.0
            g_low = self.gap(1.0, j)
            if g_low < -self.tolerance[j] or (g_high <= 0 and g_low < g_high):
                break
            if g_low < g_high and g_low > self.tolerance[j]:
                high, g_high = low, g_low
        if not g_low < -self.tolerance[j] and g_high > 0:
            low, g_low = 0.0, self.start_gap[j]
            if not g_low < -self.tolerance[j]:
                return -2.0
        if g_high <= 0:
            return high
        for k in range(ROOT_LIMIT):
            width = high - low
            s = (low * g_high - high * g_low) / (g_high - g_low)
            if not low < s < high or k % 3 == 2:
                s = 0.5 * (low + high)
            if width <= 4e-16 * high:
                break
            if not self.leg(s):
                return -1.0
            g = self.gap(1.0, j)
            if g == 0.0:
                return s
            if g > 0:
                high, g_high = s, g
                if side == 1:
                    g_low *= 0.5
                side = 1
            else:
                low, g_low = s, g
                if side == -1:
                    g_high *= 0.5
                side = -1
        return low
