# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, binding=False
"""The variational integrator with collisions, one step at a time (Kern & Gross 2018, "Collision Time Step").

A step of size h is a chain of *legs*.  The first leg starts at a node with momentum p_0, the others start at a collision::

    first leg     r_minus(q_0, q_1, s) + p_0 = 0
    later legs    p_minus + r_minus(q_c, q_1, s) - lam grad g(q_c, t_c) = 0
                  e (e_plus(leg before) - e_minus(q_c, q_1, s)) = lam (e dg/dt + (1 - e)/2 w)

with unknowns q_1, or q_1 and lam, and the nodes inside the leg with their equations r_i = 0 at order 4; e is the coefficient of restitution and w the rate
of the gap after the collision, w = w(before) - lam grad g . M^-1 grad g.  A leg that would cross a surface is shortened to the duration s = tau h at which g(q_1) = 0.
"""
from cpython.pycapsule cimport PyCapsule_GetPointer
from libc.math cimport fabs, isfinite, sqrt

import numpy as np

from dmoc.errors import SimulationError

ctypedef void dmoc_kernel(ptrdiff_t n, const double *const *args, const ptrdiff_t *stride, double *const *results) noexcept nogil

cdef enum:
    MOST = 12           # arrays of a kernel
    NEWTON_LIMIT = 50
    ROOT_LIMIT = 200
    MOST_HITS = 100     # collisions within one step before the motion counts as Zeno

cdef double TOLERANCE = 1e-14      # of a Newton step relative to the coordinates
cdef double GAP_TOLERANCE = 1e-13  # a gap above it counts as crossed
cdef double SHORTEST_LEG = 1e-9    # share of a step below which a leg is replaced by its limit: its equations divide by s


cdef class _Call:
    """A kernel bound to arrays that stay where they are."""
    cdef dmoc_kernel *kernel
    cdef const double *args[MOST]
    cdef double *results[MOST]
    cdef ptrdiff_t stride[MOST]
    cdef object function
    cdef tuple arrays

    def __init__(self, kernels, str name, tuple inputs, tuple outputs):
        cdef double[:, ::1] view
        cdef int a
        self.arrays = inputs + outputs
        self.kernel = NULL
        self.function = getattr(kernels.module, name)
        if kernels.backend == "compiled":
            self.kernel = <dmoc_kernel *>PyCapsule_GetPointer(kernels.module.capsule(name), "dmoc_kernel")
        for a in range(len(inputs)):
            view = inputs[a]
            self.args[a] = &view[0, 0] if view.shape[1] else NULL
            self.stride[a] = 0
        for a in range(len(outputs)):
            view = outputs[a]
            self.results[a] = &view[0, 0] if view.shape[1] else NULL

    cdef int run(self) except -1:
        if self.kernel != NULL:
            self.kernel(1, self.args, self.stride, self.results)
        else:
            self.function(*self.arrays)
        return 0


cdef bint _solve(double[:, ::1] A, double[::1] b, int n) noexcept:
    """Solve A x = b in place by elimination with partial pivoting; False if A is singular."""
    cdef int i, j, k, best
    cdef double factor, swap
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if fabs(A[i, k]) > fabs(A[best, k]):
                best = i
        if not (fabs(A[best, k]) > 0 and isfinite(A[best, k])):
            return False
        if best != k:
            for j in range(k, n):
                swap = A[k, j]; A[k, j] = A[best, j]; A[best, j] = swap
            swap = b[k]; b[k] = b[best]; b[best] = swap
        for i in range(k + 1, n):
            factor = A[i, k] / A[k, k]
            if factor != 0:
                for j in range(k + 1, n):
                    A[i, j] -= factor * A[k, j]
                b[i] -= factor * b[k]
    for k in range(n - 1, -1, -1):
        for j in range(k + 1, n):
            b[k] -= A[k, j] * b[j]
        b[k] /= A[k, k]
    return True


cdef class Stepper:
    """Steps one model with given parameters.

    Parameters
    ----------
    kernels : Kernels
    par : array of shape (1, npar)
    restitution : array of shape (nc,)
    """
    cdef readonly int nq, nu, nc, ni
    cdef readonly list collisions
    cdef object names
    cdef _Call step, step_jac, impact, impact_jac, surface, slope, dynamics, legendre
    cdef double[:, ::1] q_a, q_b, q_i, t, now, r_i, r_i_z, u, h, r_minus, r_plus, C_d, r_minus_z, r_plus_z, C_d_z, e_plus, e_minus, e_plus_z, e_minus_z
    cdef double[:, ::1] q_g, g, g_q, zero, mass, force, p_zero, energy, A
    cdef ptrdiff_t[::1] r_row, r_col, i_row, i_col, e_col, g_row, g_col
    cdef double[::1] b, p, normal, velocity, restitution
    cdef double lam, e_before, e, approach, inertia
    cdef bint after_impact

    def __init__(self, kernels, par, restitution):
        cdef int nq = len(kernels.coordinates), nu = len(kernels.inputs), nc = len(kernels.surfaces)
        cdef int ni = nq * (kernels.manifest["order"] // 2 - 1)
        self.nq, self.nu, self.nc, self.ni = nq, nu, nc, ni
        self.restitution = np.append(restitution, 1.0)
        self.names = kernels.surfaces
        self.collisions = []

        def block(size):
            return np.zeros((1, size))

        def stored(kernel, output):
            rows, columns = kernels.pattern(kernel, output)
            return np.ascontiguousarray(rows), np.ascontiguousarray(columns)

        self.q_a, self.q_b, self.u, self.h = block(nq), block(nq), block(nu), block(1)
        self.t, self.now, self.q_i, self.r_i = block(1), block(1), block(ni), block(ni)
        inputs = tuple(map(np.asarray, (self.q_a, self.q_b, self.u, self.u, self.h, self.t, self.q_i))) + (par,)
        self.r_minus, self.r_plus, self.C_d = block(nq), block(nq), block(1)
        self.step = _Call(kernels, "step", inputs, tuple(map(np.asarray, (self.r_minus, self.r_plus, self.C_d, self.r_i))))
        self.r_row, self.r_col = stored("step_jac", "r_minus_D_z")
        self.r_minus_z = block(len(self.r_row))
        self.r_plus_z = block(len(stored("step_jac", "r_plus_D_z")[0]))
        self.C_d_z = block(len(stored("step_jac", "C_d_D_z")[0]))
        self.i_row, self.i_col = stored("step_jac", "r_i_D_z")
        self.r_i_z = block(len(self.i_row))
        self.step_jac = _Call(kernels, "step_jac", inputs,
                              tuple(map(np.asarray, (self.r_minus_z, self.r_plus_z, self.C_d_z, self.r_i_z))))
        self.e_plus, self.e_minus = block(1), block(1)
        self.impact = _Call(kernels, "impact", inputs, tuple(map(np.asarray, (self.e_plus, self.e_minus))))
        self.e_col = stored("impact_jac", "e_minus_D_z")[1]
        self.e_plus_z = block(len(stored("impact_jac", "e_plus_D_z")[0]))
        self.e_minus_z = block(len(self.e_col))
        self.impact_jac = _Call(kernels, "impact_jac", inputs, tuple(map(np.asarray, (self.e_plus_z, self.e_minus_z))))
        self.q_g, self.zero = block(nq), block(nq)
        if nc:
            self.g = block(nc)
            self.g_row, self.g_col = stored("surface_jac", "g_D_q")
            self.g_q = block(len(self.g_row))
            place = (np.asarray(self.q_g), np.asarray(self.now), par)
            self.surface = _Call(kernels, "surface", place, (np.asarray(self.g),))
            self.slope = _Call(kernels, "surface_jac", place, (np.asarray(self.g_q),))
        self.mass, self.force = block(nq * nq), block(nq)
        at = (np.asarray(self.q_g), np.asarray(self.zero), np.asarray(self.u), np.asarray(self.now), par)
        self.dynamics = _Call(kernels, "dynamics", at, (np.asarray(self.mass), np.asarray(self.force)))
        self.p_zero, self.energy = block(nq), block(1)
        self.legendre = _Call(kernels, "legendre", (np.asarray(self.q_g), np.asarray(self.zero), np.asarray(self.now), par),
                              (np.asarray(self.p_zero), np.asarray(self.energy)))
        self.A = np.zeros((nq + ni + 1, nq + ni + 1))
        self.b, self.p = np.zeros(nq + ni + 1), np.zeros(nq)
        self.normal, self.velocity = np.zeros(nq + 1), np.zeros(nq)

    # One leg ---------------------------------------------------------------------------------------------------------

    cdef int find_velocity(self, double[::1] p) except -1:
        """velocity = M^-1 (p - dL/dv(q_g, 0)), at the time ``now``."""
        cdef int i, j, n = self.nq
        self.dynamics.run()
        self.legendre.run()
        for i in range(n):
            self.b[i] = p[i] - self.p_zero[0, i]
            for j in range(n):
                self.A[i, j] = self.mass[0, i * n + j]
        if not _solve(self.A, self.b, n):
            raise SimulationError("the mass matrix is singular along the motion: check the parameters.")
        for i in range(n):
            self.velocity[i] = self.b[i]
        return 0

    cdef int column(self, ptrdiff_t z) noexcept:
        """Position among the unknowns (q_b, q_i) of a leg of a position in z = (q_k, q_kp1, u_k, u_kp1, h, t_k, q_i); -1 for none."""
        cdef ptrdiff_t n = self.nq, inside = 2 * (self.nq + self.nu) + 2
        if n <= z < 2 * n:
            return <int>(z - n)
        return <int>(n + z - inside) if z >= inside else -1

    cdef int leg(self, double s) except -1:
        """Solve for q_b and q_i (and lam after an impact) at the end of a leg of duration s; 0 if Newton's method fails."""
        cdef int i, j, k, it, n = self.nq, m = self.nq + self.ni, size = self.nq + self.ni + (1 if self.after_impact else 0)
        cdef double change, scale, previous = 1e300
        self.h[0, 0] = s
        for i in range(n):
            self.q_b[0, i] = self.q_a[0, i] + s * self.velocity[i]
        for i in range(self.ni):
            self.q_i[0, i] = self.q_a[0, i] + 0.5 * s * self.velocity[i]
        for it in range(NEWTON_LIMIT):
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
            if not _solve(self.A, self.b, size):
                return 0
            change, scale = 0.0, 0.0
            for i in range(n):
                self.q_b[0, i] -= self.b[i]
                change = max(change, fabs(self.b[i]))
                scale = max(scale, fabs(self.q_b[0, i]), fabs(self.q_b[0, i] - self.q_a[0, i]))
            for i in range(self.ni):
                self.q_i[0, i] -= self.b[n + i]
                change = max(change, fabs(self.b[n + i]))
            if self.after_impact:
                self.lam -= self.b[m]
            if not isfinite(change):
                return 0
            if change <= TOLERANCE * scale or (change >= 0.5 * previous and change <= 1e4 * TOLERANCE * max(scale, 1e-3)):
                self.step.run()
                self.impact.run()
                return 1
            previous = change
        return 0

    # Along the leg that was just solved: the place at the share x, and what surfaces say there.

    cdef int place(self, double x) except -1:
        """q_g and now at the share x of the leg."""
        cdef int i
        cdef double a = 1 - x, b = x, c = 0.0
        if self.ni:  # the polynomial through the node inside
            a, b, c = (1 - x) * (1 - 2 * x), x * (2 * x - 1), 4 * x * (1 - x)
        for i in range(self.nq):
            self.q_g[0, i] = a * self.q_a[0, i] + b * self.q_b[0, i] + (c * self.q_i[0, i] if self.ni else 0.0)
        self.now[0, 0] = self.t[0, 0] + x * self.h[0, 0]
        return 0

    cdef double gap(self, double x, int j) except? -1e300:
        """g_j at the share x."""
        self.place(x)
        self.surface.run()
        return self.g[0, j]

    cdef double rate(self, double x, int j) except? -1e300:
        """Derivative of g_j with respect to the share x."""
        cdef int k, i
        cdef double value = 0.0, change, a = -1.0, b = 1.0, c = 0.0
        if self.ni:
            a, b, c = 4 * x - 3, 4 * x - 1, 4 - 8 * x
        self.place(x)
        self.slope.run()
        for k in range(self.g_row.shape[0]):
            if self.g_row[k] == j:
                i = self.g_col[k]
                if i == self.nq:
                    change = self.h[0, 0]
                else:
                    change = a * self.q_a[0, i] + b * self.q_b[0, i] + (c * self.q_i[0, i] if self.ni else 0.0)
                value += self.g_q[0, k] * change
        return value

    cdef double crossing(self, int j) except? -1.0:
        """Share of the leg at which surface j is certainly crossed; 0 if it is not."""
        cdef double low, high, middle, x
        cdef int i
        if self.gap(1.0, j) > GAP_TOLERANCE:
            return 1.0
        for x in (0.25, 0.5, 0.75):
            if self.gap(x, j) > GAP_TOLERANCE:
                return x
        if self.rate(0.0, j) > 0 and self.rate(1.0, j) < 0:  # in and out again: look at the summit
            low, high = 0.0, 1.0
            for i in range(50):
                middle = 0.5 * (low + high)
                if self.rate(middle, j) > 0:
                    low = middle
                else:
                    high = middle
            if self.gap(low, j) > GAP_TOLERANCE:
                return low
        return 0.0

    cdef double hit_time(self, int j, double s_high, double t) except? -1.0:
        """Duration in (0, s_high] at which a leg ends on surface j."""
        cdef double low = s_high, high, g_low, g_high, s, g, width
        cdef int k, side = 0
        high = s_high
        if not self.leg(high):
            raise SimulationError(f"the collision step at t = {t:.6g} s has no solution: reduce the step size, or stop before the motion comes to rest on a surface.")
        g_high = self.gap(1.0, j)
        g_low = 1.0
        for k in range(60):  # a start inside: shorter and shorter legs, because a leg may start on this surface
            low *= 0.5
            if not self.leg(low):
                break
            g_low = self.gap(1.0, j)
            if g_low <= 0 or (g_high <= 0 and g_low < g_high):
                break
            if g_low < g_high and g_low > 0:
                high, g_high = low, g_low
        if not g_low <= 0:
            raise SimulationError(
                f"the motion rests on surface {self.names[j]!r} at t = {t:.6g} s: lasting contact is not a collision, stop before it."
            )
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
                raise SimulationError(f"the collision step at t = {t:.6g} s has no solution: reduce the step size, or stop before the motion comes to rest on a surface.")
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

    cdef int advance(self, double h, double t, long number) except -1:
        """Take a step from (q_a, p); leaves q_b, p at its end and records collisions."""
        cdef int i, j, hits = 0, found
        cdef double rest = h, x, s, first
        self.after_impact = False
        self.t[0, 0] = t
        found = self.contact_at_start(h)
        if found >= 0:  # the step before ended on the surface
            hits = 1
            self.start_collision(found, t, number)
        while True:
            self.t[0, 0] = t
            if not self.after_impact:
                self.at_start()
                self.find_velocity(self.p)
            if self.after_impact and rest <= SHORTEST_LEG * h:
                self.finish_at_impact(rest)
                return 0
            if not self.leg(rest):
                raise SimulationError(f"the step at t = {t:.6g} s has no solution: reduce the step size.")
            found, first = -1, rest
            for j in range(self.nc):
                x = self.crossing(j)
                if x > 0:
                    s = self.hit_time(j, x * rest, t)
                    if found < 0 or s < first:
                        found, first = j, s
                    if not self.leg(rest):
                        raise SimulationError(f"the step at t = {t:.6g} s has no solution: reduce the step size.")
            if self.after_impact and self.lam < 0:
                raise SimulationError(f"the impulse at t = {t:.6g} s is negative: reduce the step size.")
            if found < 0:
                for i in range(self.nq):
                    self.p[i] = self.r_plus[0, i]
                if self.after_impact:
                    self.finish_collision()
                return 0
            hits += 1
            if hits > MOST_HITS:
                raise SimulationError(
                    f"more than {MOST_HITS} collisions within the step at t = {t:.6g} s (Zeno): reduce the step size or stop before it."
                )
            self.leg(first)
            self.place(1.0)
            if self.after_impact:
                self.finish_collision()
            t += first
            rest -= first
            self.start_collision(found, t, number)

    cdef int at_start(self) except -1:
        """q_g and now at the start of the leg to come."""
        cdef int i
        for i in range(self.nq):
            self.q_g[0, i] = self.q_a[0, i]
        self.now[0, 0] = self.t[0, 0]
        return 0

    cdef int contact_at_start(self, double h) except -2:
        """Index of a surface that the motion from (q_a, p) meets in less than the shortest leg; -1 if there is none."""
        cdef int j, k
        cdef double rate
        self.at_start()
        self.find_velocity(self.p)
        for j in range(self.nc):
            self.surface.run()
            self.slope.run()
            rate = 0.0
            for k in range(self.g_row.shape[0]):
                if self.g_row[k] == j:
                    rate += self.g_q[0, k] * (1.0 if self.g_col[k] == self.nq else self.velocity[self.g_col[k]])
            if rate > 0 and self.g[0, j] > -SHORTEST_LEG * h * rate:
                return j
        return -1

    cdef int start_collision(self, int j, double t, long number) except -1:
        """Begin a leg at the collision reached by the leg that was just solved."""
        cdef int i, k, n = self.nq
        self.e = self.restitution[j]
        self.e_before = self.e_plus[0, 0]
        for i in range(n):
            self.p[i] = self.r_plus[0, i]
            self.q_a[0, i] = self.q_b[0, i]
            self.q_g[0, i] = self.q_b[0, i]
        self.now[0, 0] = t
        self.normal[:] = 0.0  # gradient and derivative with respect to the time
        self.slope.run()
        for k in range(self.g_row.shape[0]):
            if self.g_row[k] == j:
                self.normal[self.g_col[k]] = self.g_q[0, k]
        # First guess: the impact law of the continuous theory.
        self.find_velocity(self.p)
        self.approach = self.normal[n]
        for i in range(n):
            self.approach += self.normal[i] * self.velocity[i]
            self.b[i] = self.normal[i]
            for k in range(n):
                self.A[i, k] = self.mass[0, i * n + k]
        _solve(self.A, self.b, n)
        self.inertia = 0.0
        for i in range(n):
            self.inertia += self.normal[i] * self.b[i]
        self.lam = (1 + self.e) * max(self.approach, 0.0) / self.inertia
        for i in range(n):
            self.velocity[i] -= self.lam * self.b[i]
        self.after_impact = True
        self.collisions.append(
            [number, t, j, self.lam, np.array(self.q_a[0]), np.array(self.p), np.array(self.p) - self.lam * np.array(self.normal[:n])]
        )
        return 0

    cdef int finish_collision(self) except -1:
        """Record the impulse of the collision that started the leg which was just solved."""
        record = self.collisions[len(self.collisions) - 1]
        record[3] = self.lam
        record[6] = record[5] - self.lam * np.array(self.normal[: self.nq])
        return 0

    cdef int finish_at_impact(self, double rest) except -1:
        """A leg too short for its equations: its limit is the impact law."""
        cdef int i
        for i in range(self.nq):
            self.p[i] -= self.lam * self.normal[i]
            self.q_b[0, i] = self.q_a[0, i] + rest * self.velocity[i]
        return 0

    def run(self, double[::1] q0, double[::1] p0, double[:, ::1] u, double h, long every):
        """Take ``len(u)`` steps of size h; return t, q and p at every ``every``-th node.  Collisions are appended to ``collisions``."""
        cdef long k, row, steps = u.shape[0]
        cdef int i
        rows = steps // every + 1
        times, positions, momenta = np.arange(rows) * (h * every), np.empty((rows, self.nq)), np.empty((rows, self.nq))
        cdef double[:, ::1] q_out = positions, p_out = momenta
        for i in range(self.nq):
            self.q_a[0, i] = q0[i]
            self.p[i] = p0[i]
            q_out[0, i] = q0[i]
            p_out[0, i] = p0[i]
            # As if a leg had ended at the start, for a motion that starts on a surface.
            self.q_b[0, i] = q0[i]
            self.q_g[0, i] = q0[i]
            self.r_plus[0, i] = p0[i]
        self.now[0, 0] = 0.0
        self.find_velocity(self.p)
        for i in range(self.nq):
            self.zero[0, i] = self.velocity[i]
        self.legendre.run()
        self.e_plus[0, 0] = -self.energy[0, 0]
        for i in range(self.nq):
            self.zero[0, i] = 0.0
        for k in range(steps):
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
        return times, positions, momenta
