# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, binding=False
"""The variational integrator with collisions, one step at a time (Kern & Gross 2018, "Collision Time Step").

A step of size h is a chain of *legs*.  The first leg starts at a node with momentum p_0, the others start at a collision::

    first leg     r_minus(q_0, q_1, s) + p_0 = 0
    later legs    p_minus + r_minus(q_c, q_1, s) - lam grad g(q_c, t_c) = 0
                  e (e_plus(leg before) - e_minus(q_c, q_1, s)) = lam (e dg/dt + (1 - e)/2 gamma)

with unknowns q_1, or q_1 and lam, and the nodes inside the leg with their equations r_i = 0 at order 4; e is the coefficient of restitution and w the rate
of the gap after the collision, gamma = gamma(before) - lam grad g . M^-1 grad g.  A leg that would cross a surface is shortened to the duration s = tau h at which g(q_1) = 0.

A leg shorter than ``SHORTEST_LEG`` of a step, an impact on several surfaces at once, and one whose flight is too short for the equations above
(bounces that die away within a step) take their limit instead: lam = (1 + e) gamma / (grad g . M^-1 grad g).

Nothing depends on units: coordinates are measured by the masses, sqrt(M_ii) q_i, and gaps and their rates by their slopes.
"""
from cpython.exc cimport PyErr_CheckSignals
from libc.math cimport fabs, isfinite, sqrt
from libc.time cimport CLOCKS_PER_SEC, clock, clock_t

from dmoc_kernel cimport DMOC_MOST, dmoc_entry, find_kernel
from elimination cimport factor, solve

import numpy as np

from dmoc.base.discretisation import DISCRETISATIONS
from dmoc.base.errors import SimulationError
from dmoc.simulation.simultaneous_impacts import NOISE, Lasting, simultaneous

cdef enum:
    NEWTON_LIMIT = 50
    ROOT_LIMIT = 200
    MOST_HITS = 100     # collisions within one step before the motion counts as Zeno
    ATTENTION = 20      # looks for Ctrl-C in a second of computing

cdef double TOLERANCE = 1e-14        # of a Newton step relative to the coordinates
cdef double STALLED = 1e-10          # the same, where Newton's method makes no progress any more
cdef double GAP_TOLERANCE = 1e-13    # of a gap relative to its slopes and the coordinates: what Newton's steps leave; more counts as crossed
cdef double RATE_TOLERANCE = NOISE   # a rate of a gap below it, relative to its slopes and the velocities, is a rounding error
cdef double SHORTEST_LEG = 1e-9      # share of a step below which a leg is replaced by its limit: its equations divide by s
cdef double SINGULAR = 1e-15         # a pivot of the mass matrix below it, relative to the diagonal, is none


include "call.pxi"


cdef bint _factor(double[:, ::1] M, int n) noexcept nogil:
    """Cholesky factor of M in its lower triangle; False if M is not clearly positive definite."""
    cdef int i, j, k
    cdef double diagonal
    for j in range(n):
        diagonal = M[j, j]
        for k in range(j):
            M[j, j] -= M[j, k] * M[j, k]
        if not (isfinite(diagonal) and M[j, j] > SINGULAR * fabs(diagonal)):
            return False
        M[j, j] = sqrt(M[j, j])
        for i in range(j + 1, n):
            for k in range(j):
                M[i, j] -= M[i, k] * M[j, k]
            M[i, j] /= M[j, j]
    return True


cdef void _solve_factored(double[:, ::1] L, double[::1] b, int n) noexcept nogil:
    """Solve L L^T x = b in place."""
    cdef int i, k
    for i in range(n):
        for k in range(i):
            b[i] -= L[i, k] * b[k]
        b[i] /= L[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            b[i] -= L[k, i] * b[k]
        b[i] /= L[i, i]


cdef class Stepper:
    """Steps one model with given parameters.

    Parameters
    ----------
    kernels : Kernels
    par : array of shape (1, npar)
    restitution : array of shape (nc,)
    """
    cdef readonly int nq, nu, nc, ni, width
    cdef readonly list collisions
    cdef readonly tuple held
    cdef object names
    cdef Call step, step_jac, impact, impact_jac, surface, slope, dynamics, momentum, total_energy
    cdef double[:, ::1] q_a, q_b, q_i, t, now, r_i, r_i_z, u, h, r_minus, r_plus, C_d, r_minus_z, r_plus_z, C_d_z, e_plus, e_minus, e_plus_z, e_minus_z
    cdef double[:, ::1] q_g, g, g_q, v_g, mass, force, p_zero, energy, A, L
    cdef ptrdiff_t[::1] pivot, r_row, r_col, i_row, i_col, e_col, g_row, g_col
    cdef double[:, ::1] shapes
    cdef double[::1] share, phi
    cdef double[::1] b, p, normal, velocity, restitution, weight, tolerance, rates, rate_size, start_gap, rates_before
    cdef long number
    cdef double lam, lam_limit, e_before, e, approach, inertia, reach, fastest, full
    cdef bint after_impact
    cdef clock_t heard

    def __init__(self, kernels, par, restitution):
        cdef int nq = len(kernels.coordinates), nu = len(kernels.inputs), nc = len(kernels.surfaces)
        scheme = DISCRETISATIONS[kernels.manifest["order"]]
        cdef int ni = nq * scheme.inside
        self.shapes, self.share, self.phi = scheme.shapes, scheme.nodes, np.zeros(scheme.degree + 1)
        self.nq, self.nu, self.nc, self.ni = nq, nu, nc, ni
        self.restitution = np.append(restitution, 1.0)
        self.names = kernels.surfaces
        self.collisions = []

        def block(size):
            return np.zeros((1, size))

        def stored(kernel, output):
            rows, columns = kernels.pattern(kernel, output)
            return np.array(rows), np.array(columns)

        # Behind the inputs stand hidden unknowns of the cost, which move nothing.
        self.width = nu + len(kernels.manifest["hidden"])
        u = block(self.width)
        self.q_a, self.q_b, self.u, self.h = block(nq), block(nq), u[:, :nu], block(1)
        self.t, self.now, self.q_i, self.r_i = block(1), block(1), block(ni), block(ni)
        inputs = tuple(map(np.asarray, (self.q_a, self.q_b, u, u, self.h, self.t, self.q_i))) + (par,)
        self.r_minus, self.r_plus, self.C_d = block(nq), block(nq), block(1)
        self.step = Call(kernels, "step", inputs, tuple(map(np.asarray, (self.r_minus, self.r_plus, self.C_d, self.r_i))))
        self.r_row, self.r_col = stored("step_jac", "r_minus_D")
        self.r_minus_z = block(len(self.r_row))
        self.r_plus_z = block(len(stored("step_jac", "r_plus_D")[0]))
        self.C_d_z = block(len(stored("step_jac", "C_d_D")[0]))
        self.i_row, self.i_col = stored("step_jac", "r_i_D")
        self.r_i_z = block(len(self.i_row))
        self.step_jac = Call(kernels, "step_jac", inputs,
                              tuple(map(np.asarray, (self.r_minus_z, self.r_plus_z, self.C_d_z, self.r_i_z))))
        self.e_plus, self.e_minus = block(1), block(1)
        self.impact = Call(kernels, "impact", inputs, tuple(map(np.asarray, (self.e_plus, self.e_minus))))
        self.e_col = stored("impact_jac", "e_minus_D")[1]
        self.e_plus_z = block(len(stored("impact_jac", "e_plus_D")[0]))
        self.e_minus_z = block(len(self.e_col))
        self.impact_jac = Call(kernels, "impact_jac", inputs, tuple(map(np.asarray, (self.e_plus_z, self.e_minus_z))))
        self.q_g = block(nq)
        self.v_g = block(nq)
        if nc:
            self.g = block(nc)
            self.g_row, self.g_col = stored("surface_jac", "g_D")
            self.g_q = block(len(self.g_row))
            place = (np.asarray(self.q_g), np.asarray(self.now), par)
            self.surface = Call(kernels, "surface", place, (np.asarray(self.g),))
            self.slope = Call(kernels, "surface_jac", place, (np.asarray(self.g_q),))
        self.mass, self.force = block(nq * nq), block(nq)
        at = (np.asarray(self.q_g), np.asarray(self.v_g), np.asarray(self.u), np.asarray(self.now), par)
        self.dynamics = Call(kernels, "dynamics", at, (np.asarray(self.mass), np.asarray(self.force)))
        self.p_zero, self.energy = block(nq), block(1)
        state = (np.asarray(self.q_g), np.asarray(self.v_g), np.asarray(self.now), par)
        self.momentum = Call(kernels, "momentum", state, (np.asarray(self.p_zero),))
        self.total_energy = Call(kernels, "energy", state, (np.asarray(self.energy),))
        self.A, self.L = np.zeros((nq + ni + 1, nq + ni + 1)), np.zeros((nq, nq))
        self.b, self.p = np.zeros(nq + ni + 1), np.zeros(nq)
        self.pivot = np.zeros(nq + ni + 1, dtype=np.intp)
        self.normal, self.velocity, self.weight = np.zeros(nq + 1), np.zeros(nq), np.zeros(nq)
        self.tolerance, self.rates, self.rate_size, self.start_gap = np.zeros(nc), np.zeros(nc), np.zeros(nc), np.zeros(nc)
        self.rates_before = np.zeros(nc)
        self.reach, self.fastest = 0.0, 0.0
        self.heard = clock()

    cdef int listen(self) except -1 nogil:
        """Let Ctrl-C through now and then."""
        if clock() - self.heard > CLOCKS_PER_SEC // ATTENTION:
            with gil:
                PyErr_CheckSignals()
            self.heard = clock()
        return 0

    # Where the motion is ---------------------------------------------------------------------------------------------

    cdef int find_velocity(self) except -1 nogil:
        """velocity = M^-1 (p - dL/dv(q_g, 0)) at the time ``now``, with the factor L of M and the weights of the coordinates."""
        cdef int i, j, n = self.nq
        self.dynamics.run()
        self.momentum.run()
        for i in range(n):
            self.b[i] = self.p[i] - self.p_zero[0, i]
            for j in range(n):
                self.L[i, j] = self.mass[0, i * n + j]
        if not _factor(self.L, n):
            with gil:
                raise SimulationError(
                    f"the mass matrix at t = {self.now[0, 0]:.6g} s is singular or not positive definite: check the parameters, and stop before "
                    "the motion gets there."
                )
        _solve_factored(self.L, self.b, n)
        for i in range(n):
            self.velocity[i] = self.b[i]
            self.weight[i] = sqrt(self.mass[0, i * n + i])
            self.fastest = max(self.fastest, self.weight[i] * fabs(self.velocity[i]))
        return 0

    cdef void grow(self) noexcept nogil:
        """Keep the largest coordinate and way of a leg, measured by the masses: what rounding errors are compared with."""
        cdef int i
        for i in range(self.nq):
            self.reach = max(self.reach, self.weight[i] * fabs(self.q_b[0, i]), self.weight[i] * fabs(self.q_b[0, i] - self.q_a[0, i]))

    cdef int at_start(self, double h) except -1 nogil:
        """Velocity, gaps, their rates and tolerances at the start of the leg to come."""
        cdef int i, j, k
        for i in range(self.nq):
            self.q_g[0, i] = self.q_a[0, i]
        self.now[0, 0] = self.t[0, 0]
        self.find_velocity()
        for i in range(self.nq):
            self.reach = max(self.reach, self.weight[i] * fabs(self.q_a[0, i]), h * self.weight[i] * fabs(self.velocity[i]))
        if not self.nc:
            return 0
        self.surface.run()
        self.slope.run()
        for j in range(self.nc):
            self.start_gap[j] = self.g[0, j]
            self.rate_size[j] = self.tolerance[j] = 0.0
        for k in range(self.g_row.shape[0]):
            j, i = <int>self.g_row[k], <int>self.g_col[k]
            if i == self.nq:
                self.rate_size[j] += fabs(self.g_q[0, k])
                self.tolerance[j] += GAP_TOLERANCE * fabs(self.g_q[0, k]) * max(fabs(self.t[0, 0]), h)
            else:
                self.rate_size[j] += fabs(self.g_q[0, k]) * self.fastest / self.weight[i]
                self.tolerance[j] += GAP_TOLERANCE * fabs(self.g_q[0, k]) * self.reach / self.weight[i]
        self.find_rates()
        return 0

    cdef void find_rates(self) noexcept nogil:
        """dg/dt of every surface with the slopes and the velocity as they are."""
        cdef int k
        for k in range(self.nc):
            self.rates[k] = 0.0
        for k in range(self.g_row.shape[0]):
            self.rates[self.g_row[k]] += self.g_q[0, k] * (1.0 if self.g_col[k] == self.nq else self.velocity[self.g_col[k]])

    cdef int contact_at_start(self, double h) except -2 nogil:
        """Index of a surface that the motion from (q_a, p) meets in less than the shortest leg; -1 if there is none."""
        cdef int j
        for j in range(self.nc):
            if self.rates[j] > 0 and self.g[0, j] > self.tolerance[j]:
                return j
            if self.rates[j] > RATE_TOLERANCE * self.rate_size[j] and self.g[0, j] > -(self.tolerance[j] + SHORTEST_LEG * h * self.rates[j]):
                return j
        return -1

    cdef int ended(self, double t) except -1 nogil:
        """As if a leg had ended in (q_b, p) at the time t."""
        cdef int i
        for i in range(self.nq):
            self.q_g[0, i] = self.q_b[0, i]
            self.r_plus[0, i] = self.p[i]
        self.now[0, 0] = t
        self.find_velocity()
        for i in range(self.nq):
            self.v_g[0, i] = self.velocity[i]
        self.total_energy.run()
        self.e_plus[0, 0] = -self.energy[0, 0]
        for i in range(self.nq):
            self.v_g[0, i] = 0.0
        return 0

    # One leg ---------------------------------------------------------------------------------------------------------

    cdef int column(self, ptrdiff_t z) noexcept nogil:
        """Position among the unknowns (q_b, q_i) of a leg of a position z in x_k = (q_k, q_kp1, u_k, u_kp1, h, t_k, q_i); -1 for none."""
        cdef ptrdiff_t n = self.nq, inside = 2 * (self.nq + self.width) + 2
        if n <= z < 2 * n:
            return <int>(z - n)
        return <int>(n + z - inside) if z >= inside else -1

    cdef int leg(self, double s) except -1 nogil:
        """Solve for q_b and q_i (and lam after an impact) at the end of a leg of duration s; 0 if Newton's method fails."""
        cdef int i, j, k, it, n = self.nq, m = self.nq + self.ni, size = self.nq + self.ni + (1 if self.after_impact else 0)
        cdef double change, previous = 1e300
        self.h[0, 0] = s
        self.lam = self.lam_limit
        for i in range(n):
            self.q_b[0, i] = self.q_a[0, i] + s * self.velocity[i]
        for i in range(self.ni):
            self.q_i[0, i] = self.q_a[0, i % n] + self.share[2 + i // n] * s * self.velocity[i % n]
        for it in range(NEWTON_LIMIT):
            self.listen()
            self.step.run()
            self.step_jac.run()
            for i in range(size):
                for k in range(size):
                    self.A[i, k] = 0.0
            for i in range(n):
                self.b[i] = self.p[i] + self.r_minus[0, i]
            for i in range(self.ni):
                self.b[n + i] = self.r_i[0, i]
            for k in range(self.r_row.shape[0]):
                j = self.column(self.r_col[k])
                if j >= 0:
                    self.A[self.r_row[k], j] = self.r_minus_z[0, k]
            for k in range(self.i_row.shape[0]):
                j = self.column(self.i_col[k])
                if j >= 0:
                    self.A[n + self.i_row[k], j] = self.r_i_z[0, k]
            if self.after_impact:
                self.impact.run()
                self.impact_jac.run()
                for i in range(n):
                    self.b[i] -= self.lam * self.normal[i]
                    self.A[i, m] = -self.normal[i]
                self.b[m] = (self.e * (self.e_before - self.e_minus[0, 0] - self.lam * self.normal[n])
                             - (1 - self.e) * self.lam / 2 * (self.approach - self.lam * self.inertia))
                self.A[m, m] = -self.e * self.normal[n] - (1 - self.e) * (self.approach / 2 - self.lam * self.inertia)
                for k in range(self.e_col.shape[0]):
                    j = self.column(self.e_col[k])
                    if j >= 0:
                        self.A[m, j] = -self.e * self.e_minus_z[0, k]
            if not factor(&self.A[0, 0], &self.pivot[0], size, self.A.shape[1]):
                return 0
            solve(&self.A[0, 0], &self.pivot[0], &self.b[0], size, self.A.shape[1], 1)
            change = 0.0
            for i in range(n):
                self.q_b[0, i] -= self.b[i]
            for i in range(m):
                change = max(change, self.weight[i % n] * fabs(self.b[i]))
            for i in range(self.ni):
                self.q_i[0, i] -= self.b[n + i]
            if self.after_impact:
                self.lam -= self.b[m]
            if not isfinite(change):
                return 0
            self.grow()
            if change <= TOLERANCE * self.reach or (change >= 0.5 * previous and change <= STALLED * self.reach):
                self.step.run()
                self.impact.run()
                return 1
            previous = change
        return 0

    # Along the leg that was just solved: the place at the share x, and what surfaces say there.

    cdef int place(self, double x) except -1 nogil:
        """q_g and now at the share x of the leg."""
        cdef int i
        self.weigh(x, 0)
        for i in range(self.nq):
            self.q_g[0, i] = self.along(i)
        self.now[0, 0] = self.t[0, 0] + x * self.h[0, 0]
        return 0

    cdef void weigh(self, double x, int derivative) noexcept nogil:
        """Shape functions at the share x, or their derivatives."""
        cdef int a, k, last = <int>self.phi.shape[0] - 1
        for a in range(last + 1):
            self.phi[a] = 0.0
            for k in range(last, derivative - 1, -1):
                self.phi[a] = self.phi[a] * x + self.shapes[a, k] * (k if derivative else 1)

    cdef double along(self, int i) noexcept nogil:
        """Coordinate i of the leg's polynomial, or its derivative, as weighed."""
        cdef int a
        cdef double value = self.phi[0] * self.q_a[0, i] + self.phi[1] * self.q_b[0, i]
        for a in range(self.ni // self.nq):
            value += self.phi[2 + a] * self.q_i[0, a * self.nq + i]
        return value

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

    # One step --------------------------------------------------------------------------------------------------------

    cdef int advance(self, double h, double t, long number) except -1 nogil:
        """Take a step from (q_a, p); leaves q_b, p at its end and records collisions."""
        cdef int i, j, hits = 0, met
        cdef double rest = h, s
        self.full = h
        self.after_impact = False
        self.t[0, 0] = t
        self.at_start(h)
        met = self.contact_at_start(h)
        if met >= 0:  # the step before ended on the surface
            hits = 1
            self.start_collision(met, t, number)
        while True:
            self.t[0, 0] = t
            if hits and rest <= SHORTEST_LEG * h:
                self.finish_at_impact(rest)
                return 0
            s = self.to_next(rest, t, &met)
            if s < 0:
                if not self.after_impact:
                    self.no_solution(rest, t)
                self.take_limit()
                continue
            if met < 0:
                for i in range(self.nq):
                    self.p[i] = self.r_plus[0, i]
                if self.after_impact:
                    self.finish_collision()
                return 0
            hits += 1
            if hits > MOST_HITS:
                with gil:
                    raise Lasting
            self.leg(s)
            if self.after_impact:
                self.finish_collision()
            t += s
            rest -= s
            self.start_collision(met, t, number)

    cdef double to_next(self, double rest, double t, int *met) except? -3.0 nogil:
        """Solve the leg of duration ``rest`` or, where that crosses surfaces, find the duration up to the first one; -1 if there is no solution."""
        cdef int j
        cdef double x, s, first = rest
        cdef bint touching
        met[0] = -1
        if not self.leg(rest) or self.implausible():
            return -1.0
        for j in range(self.nc):
            touching = self.touches(j)
            x = self.crossing(j, touching)
            if x > 0:
                s = self.hit_time(j, x * rest)
                if s == -2.0:
                    if self.after_impact and self.e > 0:
                        return -1.0
                    with gil:  # bounces have died away, or it is pushed against the surface
                        raise Lasting
                if s < 0:
                    return -1.0
                if met[0] < 0 or s < first:
                    met[0], first = j, s
                if not self.leg(rest):
                    return -1.0
        return first

    cdef bint implausible(self) noexcept nogil:
        """Whether the impulse is not the one of the collision but another root of its equations."""
        return self.after_impact and not 0.5 * self.lam_limit <= self.lam <= 2 * self.lam_limit

    cdef bint touches(self, int j) noexcept nogil:
        """Whether the leg starts on surface j without approaching or leaving it."""
        return fabs(self.start_gap[j]) <= self.tolerance[j] and fabs(self.rates[j]) <= RATE_TOLERANCE * self.rate_size[j]

    cdef int no_solution(self, double rest, double t) except -1 nogil:
        """Raise: a leg of duration ``rest`` has no solution, perhaps because the mass matrix on its way is none."""
        cdef int i
        for i in range(self.nq):
            self.q_g[0, i] = self.q_a[0, i] + rest * self.velocity[i]
        self.now[0, 0] = t + rest
        self.find_velocity()
        with gil:
            raise SimulationError(f"the step at t = {t:.6g} s has no solution: change the step size.")

    cdef int start_collision(self, int j, double t, long number) except -1 nogil:
        """Begin a leg at the collision reached by the leg that was just solved."""
        cdef int i, k, n = self.nq
        cdef double near
        cdef bint alone = True
        self.e = self.restitution[j]
        self.e_before = self.e_plus[0, 0]
        for i in range(n):
            self.p[i] = self.r_plus[0, i]
            self.q_a[0, i] = self.q_b[0, i]
        self.t[0, 0] = t
        self.at_start(self.full)
        self.approach = self.rates[j]
        for i in range(n + 1):
            self.normal[i] = 0.0  # gradient and derivative with respect to the time
        for k in range(self.g_row.shape[0]):
            if self.g_row[k] == j:
                self.normal[self.g_col[k]] = self.g_q[0, k]
        for i in range(n):
            self.b[i] = self.normal[i]
        _solve_factored(self.L, self.b, n)
        self.inertia = 0.0
        for i in range(n):
            self.inertia += self.normal[i] * self.b[i]
        if not self.inertia > 0:
            with gil:
                raise SimulationError(
                    f"the gap to surface {self.names[j]!r} has no slope at t = {t:.6g} s: no impulse can hold the motion back, state the surface "
                    "so that its gradient does not vanish."
                )
        # The impact law of the continuous theory: the limit of short steps, and a first guess.
        self.lam_limit = (1 + self.e) * max(self.approach, 0.0) / self.inertia
        for i in range(n):
            self.velocity[i] -= self.lam_limit * self.b[i]
        for k in range(self.nc):
            self.rates_before[k] = self.rates[k]
        self.find_rates()
        for k in range(self.nc):
            self.rate_size[k] = max(self.rate_size[k], fabs(self.rates_before[k] - self.rates[k]))
            near = self.tolerance[k] + SHORTEST_LEG * self.full * max(self.rates_before[k], 0.0)
            if k != j and self.start_gap[k] > -near and self.rates[k] > RATE_TOLERANCE * self.rate_size[k]:
                alone = False
        with gil:
            if alone:
                self.after_impact = True
                self.record(number, t, j, self.lam_limit, np.array(self.normal[:n]))
            else:
                self.strike(t, number)
        return 0

    cdef int record(self, long number, double t, int j, double lam, normal) except -1:
        p = np.array(self.p)
        self.collisions.append([number, t, j, lam, np.array(self.q_a[0]), p, p - lam * normal])
        return 0

    cdef int strike(self, double t, long number) except -1:
        """Impacts on several surfaces at once, from (q_a, p)."""
        cdef int i, j
        normals = np.zeros((self.nc, self.nq + 1))
        normals[np.asarray(self.g_row), np.asarray(self.g_col)] = self.g_q[0]
        normals = normals[:, : self.nq]
        mass = np.asarray(self.mass).reshape(self.nq, self.nq)
        impulses = simultaneous(
            np.asarray(self.start_gap), np.asarray(self.tolerance), np.asarray(self.rates_before), np.asarray(self.rate_size), normals @ np.linalg.solve(mass, normals.T),
            np.asarray(self.restitution)[: self.nc], SHORTEST_LEG * self.full,
        )
        if impulses is None:
            touched = [repr(name) for name, gap, near in zip(self.names, self.start_gap, self.tolerance) if gap >= -near]
            raise SimulationError(
                f"the impacts on surfaces {', '.join(touched)} at t = {t:.6g} s come to no end: bodies that meet so cannot be simulated, change the "
                "start or give the surfaces a restitution below 1."
            )
        for j, lam in impulses:
            self.record(number, t, j, lam, normals[j])
            for i in range(self.nq):
                self.p[i] -= lam * normals[j, i]
        self.after_impact = False
        self.lam_limit = 0.0
        self.find_velocity()
        self.find_rates()
        return 0

    cdef int take_limit(self) except -1 nogil:
        """Replace the impact that starts the leg by its limit, as far as this leg is concerned."""
        cdef int i
        for i in range(self.nq):
            self.p[i] -= self.lam_limit * self.normal[i]
        self.lam = self.lam_limit
        self.finish_collision()
        self.after_impact = False
        self.lam_limit = 0.0
        return 0

    cdef int finish_collision(self) except -1 with gil:
        """Record the impulse of the collision that started the leg which was just solved."""
        record = self.collisions[len(self.collisions) - 1]
        record[3] = self.lam
        record[6] = record[5] - self.lam * np.array(self.normal[: self.nq])
        return 0

    cdef int finish_at_impact(self, double rest) except -1 nogil:
        """A leg too short for its equations: its limit is the impact law."""
        cdef int i
        if self.after_impact:
            self.take_limit()
        for i in range(self.nq):
            self.q_b[0, i] = self.q_a[0, i] + rest * self.velocity[i]
        self.ended(self.t[0, 0] + rest)
        return 0

    cdef int begin(self, double[::1] q0, double[::1] p0, double h) except -1:
        """Look at the first state: how far a step reaches, and whether it is more than a rounding error."""
        cdef int i
        cdef double size = 0.0
        for i in range(self.nq):
            self.q_a[0, i] = self.q_b[0, i] = q0[i]
            self.p[i] = p0[i]
        self.ended(0.0)
        for i in range(self.nq):
            size = max(size, self.weight[i] * fabs(q0[i]))
        for i in range(self.nq):
            self.b[i] = self.force[0, i]
        _solve_factored(self.L, self.b, self.nq)
        for i in range(self.nq):
            self.reach = max(self.reach, h * h * self.weight[i] * fabs(self.b[i]))
        self.at_start(h)
        if 0 < h * self.fastest < np.finfo(float).eps * size:
            raise SimulationError(
                f"step_size = {h:g}: the motion of a step is less than a rounding error of the coordinates, take larger steps."
            )
        return 0

    cdef int go(self, const double[:, :] u, double h, long every, double[:, ::1] q_out, double[:, ::1] p_out) except -1:
        """Take the steps and record nodes; ``number`` is that of the step at work."""
        cdef long k, row
        cdef int i
        with nogil:
            for k in range(u.shape[0]):
                self.number = k
                for i in range(self.nu):
                    self.u[0, i] = u[k, i]
                self.advance(h, k * h, k)
                for i in range(self.nq):
                    self.q_a[0, i] = self.q_b[0, i]
                if (k + 1) % every == 0:
                    row = (k + 1) // every
                    for i in range(self.nq):
                        q_out[row, i] = self.q_b[0, i]
                        p_out[row, i] = self.p[i]
        return 0

    def run(self, double[::1] q0, double[::1] p0, const double[:, :] u, double h, long every):
        """Take ``len(u)`` steps of size h; return t, q and p at every ``every``-th node.  Collisions are appended to ``collisions``.

        Compiled kernels step without the interpreter's lock.  Where Lasting is raised, ``held`` are the number of the step and what has been
        recorded.
        """
        cdef int i
        rows = u.shape[0] // every + 1
        times, positions, momenta = np.arange(rows) * (h * every), np.empty((rows, self.nq)), np.empty((rows, self.nq))
        cdef double[:, ::1] q_out = positions, p_out = momenta
        self.begin(q0, p0, h)
        for i in range(self.nq):
            q_out[0, i] = q0[i]
            p_out[0, i] = p0[i]
        try:
            self.go(u, h, every, q_out, p_out)
        except Lasting:
            self.held = self.number, (times, positions, momenta)
            raise
        return times, positions, momenta
