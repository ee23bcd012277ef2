# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, binding=False
"""Motions along plans, step by step: prescribed coordinates on cubic splines, the others by the
equations of motion.

The accelerations of the coordinates that are not prescribed follow from the rows of the equations
of motion that no input enters.  The matrix that gives them can become singular (cart-pendulum: at
alpha = k pi, where cart accelerations exert no torque on the pendulum): the window around such a
point is where nothing should be prescribed.
"""
from libc.float cimport DBL_EPSILON
from libc.math cimport INFINITY, NAN, fabs, fmax, fmin, isfinite, isnan, sqrt
from libc.string cimport memcmp, memcpy

from dmoc_kernel cimport DMOC_MOST, dmoc_entry, find_kernel
from least_squares cimport (
    dmoc_complement, dmoc_pseudo_inverse, dmoc_smallest_singular, dmoc_work_size
)

import numpy as np

include "call.pxi"
include "equations.pxi"

# Smallest singular value, relative to the rows and with inertia scaled to one, below which
# controllability counts as lost.
WINDOW = 0.15
# Speed, in reaches of the coordinates per final time, above which a motion counts as growing
# without bound.
RUNAWAY = 1e6

cdef double LOST = WINDOW, TOO_FAST = RUNAWAY


cdef class Marcher(Equations):
    """Follows plans of one problem.

    Work arrays belong to the object: each thread takes its own.
    """
    cdef Call running_cost, slopes
    cdef double[:, ::1] u_end, cost_now, slope_entries, par
    cdef const double[:, ::1] of_phases
    cdef const ptrdiff_t[::1] slope_row, slope_column
    cdef double[::1] low, high, size, reaches, restitution
    cdef object model
    cdef ptrdiff_t[::1] hits
    cdef double[::1] at, speed, middle, pace, wanted        # along the motion
    cdef double[::1] spline_q, spline_v, c2, c3, fastest, normal
    # Results of the last motion.
    cdef readonly double cost, excess
    cdef readonly int free_steps
    cdef double impulse

    def __init__(self, problem):
        kernels, par = problem.kernels, problem.parameter_values[:1].copy()
        self.par, self.of_phases = par, problem.parameter_values
        super().__init__(kernels, par, problem.inertia, problem.operating_inputs)
        cdef int nq = self.nq, nu = self.nu
        q, t, u_end, cost = map(np.asarray, (self.q, self.t, _block(nu), _block(1)))
        self.u_end, self.cost_now = u_end, cost
        end = (q, _block(nq), u_end, t, par)
        self.running_cost = Call(kernels, "running_cost", end, (cost, _block(nu)))
        if kernels.surfaces:
            self.slope_row, self.slope_column = kernels.pattern("surface_jac", "g_D")
            entries = _block(len(self.slope_row))
            self.slope_entries = entries
            self.slopes = Call(kernels, "surface_jac", (q, t, par), (entries,))
        box, self.reaches = problem.input_bounds, np.ascontiguousarray(problem.reach)
        self.low, self.high = np.append(box[:, 0], 0.0), np.append(box[:, 1], 0.0)
        self.size = np.append(_input_ranges(box), 1.0)
        self.model = problem.model
        self.restitution = np.append(problem.restitution_values, 1.0)
        hits = [event.hit for event in problem.touch.events]
        self.hits = np.array([*hits, 0], dtype=np.intp)
        self.at, self.speed = np.empty(nq), np.empty(nq)
        self.middle, self.pace, self.wanted = (np.empty(nq) for _ in range(3))
        self.spline_q, self.spline_v, self.c2, self.c3 = (np.empty(nq) for _ in range(4))
        self.fastest, self.normal = np.empty(nq), np.empty(nq + 1)

    # Splines: cubics to a position and a velocity in a time ---------------------------------------

    cdef void aim(self, const double *q, const double *v, double duration) noexcept nogil:
        """Begin a spline here."""
        cdef int i
        cdef double T = duration if duration > 0 else 1.0
        for i in range(self.nq):
            self.spline_q[i], self.spline_v[i] = self.at[i], self.speed[i]
            self.c2[i] = (3 * (q[i] - self.at[i]) / T - 2 * self.speed[i] - v[i]) / T
            self.c3[i] = (2 * (self.at[i] - q[i]) / T + self.speed[i] + v[i]) / (T * T)

    cdef void wish(self, double t) noexcept nogil:
        """The acceleration of the spline, in ``wanted``."""
        cdef int i
        for i in range(self.nq):
            self.wanted[i] = 2 * self.c2[i] + 6 * t * self.c3[i]

    # Motions --------------------------------------------------------------------------------------

    cdef int step(self, const int[::1] prescribed, double now, double h, double t,
                  bint free) except -1 nogil:
        """One step of the explicit midpoint rule from where ``look`` was; ``t`` is the time on the
        spline."""
        cdef int i, nq = self.nq
        self.wish(t)
        self.accelerate(prescribed, &self.wanted[0], free)
        for i in range(nq):
            self.middle[i] = self.at[i] + h / 2 * self.speed[i]
            self.pace[i] = self.speed[i] + h / 2 * self.a[i]
        self.look(&self.middle[0], &self.pace[0], now + h / 2)
        self.wish(t + h / 2)
        self.accelerate(prescribed, &self.wanted[0], free)
        self.drive()
        t += h
        for i in range(nq):
            self.at[i] += h * self.speed[i] + h * h / 2 * self.a[i]
            self.speed[i] += h * self.a[i]
            if prescribed[i] and not free:  # stay on the spline: sums of steps drift
                self.at[i] = self.spline_q[i] + t * (
                    self.spline_v[i] + t * (self.c2[i] + t * self.c3[i]))
                self.speed[i] = self.spline_v[i] + t * (2 * self.c2[i] + 3 * t * self.c3[i])
        return 0

    cdef bint bounded(self) noexcept nogil:
        """Whether the motion does not grow without bound."""
        cdef int i
        for i in range(self.nq):
            if not (isfinite(self.at[i]) and fabs(self.speed[i]) < self.fastest[i]):
                return False
        return True

    cdef int pay(self, double h) except -1 nogil:
        """Add the cost of a step and look how far its inputs are beyond their bounds."""
        cdef int j
        cdef double over
        for j in range(self.nu):
            over = fmax(fmax(self.low[j] - self.u[j], self.u[j] - self.high[j]), 0.0) / self.size[j]
            if isnan(self.u[j]):
                over = INFINITY
            self.excess = fmax(self.excess, over)
            self.u_end[0, j] = fmin(fmax(self.u[j], self.low[j]), self.high[j])
        memcpy(&self.q[0, 0], &self.at[0], self.nq * sizeof(double))
        self.running_cost.run()
        self.cost += h * self.cost_now[0, 0]
        return 0

    cdef int bounce(self, ptrdiff_t surface, double t) except -1 nogil:
        """The velocity after an impact and its impulse lam = (1 + e) (n.v + dg/dt) / (n M^-1 n)
        with n = grad g; as it was without a surface."""
        cdef int i, nq = self.nq
        cdef ptrdiff_t k
        cdef double approach, inertia = 0.0
        self.impulse = 0.0
        if surface < 0:
            return 0
        for i in range(nq):
            self.middle[i] = 0.0
        self.look(&self.at[0], &self.middle[0], t)
        self.slopes.run()
        for i in range(nq + 1):
            self.normal[i] = 0.0
        for k in range(self.slope_row.shape[0]):
            if self.slope_row[k] == surface:
                self.normal[self.slope_column[k]] = self.slope_entries[0, k]
        dmoc_pseudo_inverse(nq, nq, &self.mass[0, 0], 0.0, &self.solution[0], &self.work[0])
        approach = self.normal[nq]
        for i in range(nq):
            self.middle[i] = 0.0
            for k in range(nq):
                self.middle[i] += self.solution[i * nq + k] * self.normal[k]
            inertia += self.normal[i] * self.middle[i]
            approach += self.normal[i] * self.speed[i]
        if inertia > 0:
            self.impulse = fmax((1 + self.coefficient(surface)) * approach / inertia, 0.0)
        for i in range(nq):
            self.speed[i] -= self.impulse * self.middle[i]
        return 0

    cdef double coefficient(self, ptrdiff_t surface) except? -1.0 nogil:
        """That of restitution at the state before a hit."""
        cdef double e = self.restitution[surface]
        if not isnan(e):
            return e
        with gil:
            q, v = np.array(self.at), np.array(self.speed)
            of_surfaces = np.asarray(self.restitution[: self.restitution.shape[0] - 1])
            return self.model.coefficients(of_surfaces, q, v, self.t[0, 0])[surface]

    cdef bint follow(self, const double[:, ::1] positions, const double[:, ::1] velocities,
                     const double[::1] durations, const ptrdiff_t[::1] steps,
                     const int[::1] prescribed, _Record record) except -1 nogil:
        """March along a plan; False where the motion grows without bound."""
        cdef ptrdiff_t i, k, since, phases = durations.shape[0], done = 0
        cdef int j, nq = self.nq
        cdef double h, now, begin = 0.0, total = 0.0, far
        cdef bint free, was_free
        for i in range(phases):
            total += durations[i]
        for j in range(nq):
            far = self.reaches[j]
            for i in range(phases + 1):
                far = fmax(far, fabs(positions[i, j]))
            self.fastest[j] = TOO_FAST * far / total
            self.at[j], self.speed[j] = positions[0, j], velocities[0, j]
        self.cost, self.excess, self.free_steps = 0.0, 0.0, 0
        for i in range(phases):
            h = durations[i] / steps[i]
            if i < self.of_phases.shape[0]:
                memcpy(&self.par[0, 0], &self.of_phases[i, 0],
                       self.par.shape[1] * sizeof(double))
            was_free, since = False, 0
            self.aim(&positions[i + 1, 0], &velocities[i + 1, 0], durations[i])
            for k in range(steps[i]):
                now = begin + k * h
                self.look(&self.at[0], &self.speed[0], now)
                free = self.reach(prescribed) < LOST
                if was_free and not free:
                    since = k
                    self.aim(&positions[i + 1, 0], &velocities[i + 1, 0], durations[i] - k * h)
                was_free = free
                self.step(prescribed, now, h, (k - since) * h, free)
                if not self.bounded():
                    return False
                self.pay(h)
                self.free_steps += free
                done += 1
                if record is not None:
                    record.step(done, self)
            begin += durations[i]
            if i < phases - 1:
                if record is not None:
                    record.before(i, self)
                self.bounce(self.hits[i], begin)
                if record is not None:
                    record.after(i, self)
        return True

    def trials(self, plans, tuple steps, tuple prescribed):
        """Follow several plans; return the largest violation of an input bound relative to its
        range, not a number where a motion grows without bound, and the cost of each, shape
        (count,)."""
        cdef const double[:, :, ::1] q = np.ascontiguousarray(plans.positions)
        cdef const double[:, :, ::1] v = plans.velocities
        cdef const double[:, ::1] T = plans.durations
        cdef const ptrdiff_t[::1] n = self._checked(plans[0], steps)
        cdef const int[::1] flags = self._flags(prescribed)
        cdef ptrdiff_t i, count = T.shape[0]
        cdef bint followed
        results = np.empty(count), np.empty(count)
        cdef double[::1] excess = results[0], cost = results[1]
        with nogil:
            for i in range(count):
                followed = self.follow(q[i], v[i], T[i], n, flags, None)
                excess[i], cost[i] = self.excess if followed else NAN, self.cost
        return results

    def motion(self, plan, tuple steps, tuple prescribed):
        """Follow a plan; return q (total + 1, nq), u (total, nu), accelerations (total, nq),
        impulses, velocities before and after the collisions (collisions, nq) and at the end (nq,),
        or None where the motion grows without bound.  ``excess`` and ``cost`` are then those of the
        motion."""
        cdef const double[:, ::1] q = plan.positions, v = plan.velocities
        cdef const double[::1] T = plan.durations
        cdef const ptrdiff_t[::1] n = self._checked(plan, steps)
        cdef const int[::1] flags = self._flags(prescribed)
        cdef _Record record = _Record(plan.positions[0], self.nu, sum(steps), len(steps) - 1)
        cdef bint followed
        with nogil:
            followed = self.follow(q, v, T, n, flags, record)
        return (*record.arrays, np.array(self.speed)) if followed else None

    def _checked(self, plan, steps):
        """The steps as an array, if they and a plan have the phases of the problem."""
        phases, ends = len(self.hits), (plan.positions, plan.velocities)
        if not len(plan.durations) == len(steps) == phases == len(ends[0]) - 1 == len(ends[1]) - 1:
            raise ValueError(f"expected a plan of {phases} phases and as many steps")
        return np.array(steps, dtype=np.intp)


cdef class _Record:
    """What is kept of a motion."""
    cdef double[:, ::1] q, u, a, v_a, v_c
    cdef double[::1] lam
    cdef tuple arrays

    def __init__(self, start, nu, total, hits):
        nq = len(start)
        self.arrays = (np.empty((total + 1, nq)), np.empty((total, nu)), np.empty((total, nq)),
                       np.empty(hits), np.empty((hits, nq)), np.empty((hits, nq)))
        self.q, self.u, self.a, self.lam, self.v_a, self.v_c = self.arrays
        self.arrays[0][0] = start

    cdef void step(self, ptrdiff_t done, Marcher m) noexcept nogil:
        cdef int i
        for i in range(m.nq):
            self.q[done, i], self.a[done - 1, i] = m.at[i], m.a[i]
        for i in range(m.nu):
            self.u[done - 1, i] = m.u[i]

    cdef void before(self, ptrdiff_t hit, Marcher m) noexcept nogil:
        cdef int i
        for i in range(m.nq):
            self.v_a[hit, i] = m.speed[i]

    cdef void after(self, ptrdiff_t hit, Marcher m) noexcept nogil:
        cdef int i
        for i in range(m.nq):
            self.v_c[hit, i] = m.speed[i]
        self.lam[hit] = m.impulse


def _input_ranges(box):
    """What violations of the bounds of inputs, shape (nu, 2), are measured by: their ranges, or
    the sizes of what is bounded on one side, shape (nu,)."""
    low, high = box.T
    sizes = np.where(np.isfinite(box), np.abs(box), 0.0).max(axis=1, initial=0.0)
    with np.errstate(invalid="ignore"):
        ranges = np.where(np.isfinite(high - low) & (high > low), high - low, sizes)
    return np.where(ranges > 0, ranges, 1.0)
