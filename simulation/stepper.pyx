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
from libc.math cimport fabs, isfinite, isnan, sqrt
from libc.time cimport CLOCKS_PER_SEC, clock, clock_t

from dmoc_kernel cimport DMOC_MOST, dmoc_entry, find_kernel
from elimination cimport factor, solve

import numpy as np

from dmoc.base.discretisation import DISCRETISATIONS
from dmoc.base.errors import SimulationError
from dmoc.mechanics.model import Model
from dmoc.simulation.hit_coefficients import hit_coefficients, several_by_law
from dmoc.simulation.simultaneous_impacts import NOISE, Lasting, simultaneous


include "call.pxi"
include "leg.pxi"
include "leg_surfaces.pxi"


cdef class Stepper(LegAmongSurfaces):
    """Steps one model with given parameters.

    Parameters
    ----------
    kernels : Kernels
    par : array of shape (1, npar)
    restitution : array of shape (nc,)
    """

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
        self.e_before = self.e_plus[0, 0]
        for i in range(n):
            self.p[i] = self.r_plus[0, i]
            self.q_a[0, i] = self.q_b[0, i]
        self.t[0, 0] = t
        self.at_start(self.full)
        self.approach = self.rates[j]
        self.e = self.restitution[j]
        if isnan(self.e):
            with gil:
                self.e = self.by_law(j, t)
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
            if k != j and self.start_gap[k] > -near and max(self.rates[k], self.rates_before[k]) > RATE_TOLERANCE * self.rate_size[k]:
                alone = False
        with gil:
            if alone:
                self.after_impact = True
                self.record(number, t, j, self.lam_limit, np.array(self.normal[:n]))
            else:
                self.strike(t, number)
        return 0

    cdef double by_law(self, int j, double t) except? -1.0:
        """The coefficient that the law of the model says at this state."""
        hit = np.arange(self.nc) == j
        state = np.array(self.q_a[0]), np.array(self.velocity), t
        return hit_coefficients(self.model, np.asarray(self.restitution)[: self.nc], state, hit)[j]

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
        touched = np.asarray(self.start_gap) >= -np.asarray(self.tolerance)
        by_law = np.flatnonzero(touched & np.isnan(np.asarray(self.restitution)[: self.nc]))
        if len(by_law):
            raise SimulationError(several_by_law(self.model, by_law, t))
        impacts = simultaneous(
            np.asarray(self.start_gap), np.asarray(self.tolerance), np.asarray(self.rates_before), np.asarray(self.rate_size), normals @ np.linalg.solve(mass, normals.T),
            np.asarray(self.restitution)[: self.nc], SHORTEST_LEG * self.full,
        )
        if impacts is None:
            touched = [repr(name) for name, gap, near in zip(self.names, self.start_gap, self.tolerance) if gap >= -near]
            raise SimulationError(
                f"the impacts on surfaces {', '.join(touched)} at t = {t:.6g} s come to no end: bodies that meet so cannot be simulated, change the "
                "start or give the surfaces a restitution below 1."
            )
        if impacts.orders:
            self.undecided.append((number, t, np.array(self.q_a[0]), np.array(self.p), impacts))
        for j, lam in impacts.impulses:
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
            self.largest = max(self.largest, h * h * self.weight[i] * fabs(self.b[i]))
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

        Compiled kernels step without the interpreter's lock.  Where Lasting is raised, ``unfinished`` are the number of the step and what has been
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
            self.unfinished = self.number, (times, positions, momenta)
            raise
        return times, positions, momenta
