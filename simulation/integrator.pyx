# cython: language_level=3, boundscheck=False, wraparound=False, cdivision=True, binding=False, auto_pickle=False
"""The continuous equations of motion M q'' = F, integrated for many rows of states side by side.

A row is (q | v), (q | v | work) or (q | v | X), of 2 nq, 2 nq + 1 or 2 nq + (2 nq)^2 numbers.  The
work is the integral of the power Q . v - dL/dt and of that of the contacts; X, row by row, is the
derivative of (q | v) with respect to what a row starts from, X' = D X with the derivative D of
(v, M^-1 F) by (q, v), where nothing is closed, rubs or is joined.

In a mode the motion obeys (equation :eq:`dae` of the theory)

    M a = F(q, v, u, t) - sum_j N_j grad g_j + sum_k T_k grad tau_k + sum_i J_i grad phi_i

with g_j'' = 0 of closed surfaces, tau_k'' = 0 of what sticks and phi_i'' = 0 of all joints, which
are the model's and hold in every mode; T_k = -s mu N_j of a contact that slides with the sign s of
tau_k', -s F of a rail.  After every part of a step the rows are moved back, the shortest way by the
masses, to where the conditions of the mode hold: errors of integration do not open a contact or let
it slip.  Free flight is the empty mode.

The method is DOP853, that of Hairer, Norsett and Wanner of order 8 (dormand_prince.py), in as many
equal parts as its error estimate asks for.  Kernels in C run without the GIL; kernels on NumPy take
the same way.  An integrator belongs to one thread.
"""
from libc.math cimport INFINITY, NAN, fabs, fmax, hypot, isfinite, pow, sqrt
from libc.time cimport CLOCKS_PER_SEC, clock, clock_t

from dmoc_kernel cimport DMOC_MOST, dmoc_entry, find_kernel
from elimination cimport factor, shortest, solve

import numpy as np

from dmoc.base.tolerances import DEPENDENT
from dmoc.mechanics.conditions import GAPS, TANGENTS, conditions_among
from dmoc.mechanics.contact_mode import FREE
from dmoc.mechanics.contacts import NOWHERE, RAIL, contacts_of
from dmoc.simulation.contact_modes import Reaction
from dmoc.simulation.dormand_prince import shares, sums

cdef extern from "sums.h" nogil:
    enum: FOUR
    void sum_of(
        double *out, const double *slopes, ptrdiff_t count, ptrdiff_t stride, ptrdiff_t terms,
        const ptrdiff_t *which, const double *factor
    )

# Error that shows that a step is too long to be followed.
cdef double ASTRAY = 1e-6


include "rows.pxi"
include "conditions.pxi"
include "dynamics.pxi"
include "dop853.pxi"
include "gaps.pxi"


cdef class Integrator(Surfaces):
    """Integrates rows of states of one model.

    Parameters
    ----------
    kernels : Kernels
    par : array of shape (1, npar)
    size : array of shape (2 nq + 1,)
        Sizes of positions, velocities and energy: integration errors are shares of them.
    check_time : callable
        Called now and then; it may raise.
    """

    # Simulation -----------------------------------------------------------------------------------

    def stay(
        self, mode, double[::1] y, const double[:, ::1] u, double h, ptrdiff_t first,
        const double[::1] shares, double[::1] largest
    ):
        """Simulate a state y = (q | v), in place, over steps of the size h with constant inputs, as
        long as it clearly keeps its mode: closed contacts push, friction holds what sticks, what
        slides goes on, and no other surface is touched.

        Parameters
        ----------
        u : array of shape (n, nu)
            Inputs of the steps, of which the first is number ``first`` of a simulation from zero.
        shares : array of shape (places,)
            Where in a step that is looked at beside its start, up to 1.
        largest : array of shape (3,)
            Largest coordinate, velocity and acceleration so far, measured by the masses, of which
            the sizes follow; made larger by what is met.

        Returns
        -------
        arrays of shapes (steps, 2 nq), (steps, nc) and (steps, nt)
            States, contact forces and friction forces at the ends of the steps that are done.
        """
        cdef ptrdiff_t nq = self.nq, n = u.shape[0], places = shares.shape[0], k = 0, i
        if not (y.shape[0] == 2 * nq and u.shape[1] == self.nu and largest.shape[0] == 3):
            raise ValueError(f"expected {nq} coordinates and {self.nu} inputs")
        if not 0 < places <= self.capacity:
            raise ValueError(f"expected 1 to {self.capacity} places")
        self._enter(mode)
        self.anchors = anchors = np.zeros((places, max(self.nt, 1)))
        states, normals, tangentials = (
            np.zeros((n, max(size, 1))) for size in (2 * nq, self.nc, self.nt)
        )
        cdef double[:, ::1] keep = anchors, ends = states, normal = normals, tangential = tangentials
        cdef double[:, ::1] rows = np.empty((places, 2 * nq))
        cdef double[:, ::1] inputs = np.empty((places, max(self.nu, 1)))
        cdef double[::1] begin = np.empty(places), span = np.empty(places)
        with nogil:
            while k < n:
                self.t[0] = (first + k) * h
                self.u[: self.nu] = u[k]
                self.values(1, 2 * nq, &y[0], False)
                self.measure(&y[0], h, largest)
                for i in range(places):
                    begin[i], span[i] = self.t[0], shares[i] * h
                    rows[i], inputs[i, : self.nu] = y, u[k]
                    keep[i, : self.nt] = self.tau[: self.nt]
                    self.which[i] = self.step[i] = i
                if not self.keeps(1, &y[0]):
                    break
                self.worst = 0.0
                self.advance_rows(
                    places, 2 * nq, &rows[0, 0], &begin[0], &span[0], &inputs[0, 0],
                    &inputs[0, 0], NULL
                )
                for i in range(places):
                    self.t[i] = begin[i] + span[i]
                    self.u[i * self.nu : (i + 1) * self.nu] = u[k]
                if self.worst > ASTRAY or not self.keeps(places, &rows[0, 0]):
                    break
                y[:] = rows[places - 1]
                ends[k] = y
                self.spread(places - 1, &normal[k, 0], &tangential[k, 0])
                k += 1
        return states[:k], normals[:k, : self.nc], tangentials[:k, : self.nt]

    cdef void measure(self, const double *y, double h, double[::1] largest) noexcept nogil:
        """Read the sizes of a motion off what it has reached, with the masses and forces of a
        state."""
        cdef ptrdiff_t nq = self.nq, i
        cdef double root
        for i in range(nq):
            root = sqrt(self.mass[i * nq + i])
            largest[2] = fmax(largest[2], fabs(self.f[i] / root))
            largest[1] = fmax(largest[1], fabs(root * y[nq + i]))
            largest[0] = fmax(largest[0], fabs(root * y[i]))
        largest[1] = fmax(largest[1], h * largest[2])
        largest[0] = fmax(largest[0], h * largest[1])
        for i in range(nq):
            root = sqrt(self.mass[i * nq + i])
            self.sizes[i] = largest[0] / root if largest[0] > 0 else 1.0
            self.sizes[nq + i] = largest[1] / root if largest[1] > 0 else 1.0

    cdef bint keeps(self, ptrdiff_t n, const double *y) except -1 nogil:
        """Whether n rows (q | v), at the times t and with the inputs u, clearly keep the mode."""
        cdef const double *args[DMOC_MOST]
        cdef ptrdiff_t stride[DMOC_MOST]
        cdef double *results[DMOC_MOST]
        cdef ptrdiff_t nq = self.nq, i, j, p
        args[0], args[1], args[2] = y, &self.t[0], &self.par[0]
        stride[0], stride[1], stride[2] = 2 * nq, 1, 0
        if self.nc:
            results[0] = &self.g[0]
            self.surface.run(n, args, stride, results)
        if self.ended:
            results[0] = &self.W[0]
            self.within.run(n, args, stride, results)
        if not self.free:
            self.slide(n, 2 * nq, y)
        self.slope(n, 2 * nq, y, &self.slopes[0])
        for i in range(n):
            if self.m and self.contradicted[i]:
                return False
            for j in range(self.nc):
                if self.pull[j]:
                    continue
                p = self.closed_at[j]
                if p >= 0 and not (self.lam[i * self.m + p] > 0 and self.W[i * self.nc + j] > 0):
                    return False
                if p < 0 and not self.stays_off(i, j, n == 1):
                    return False
            for j in range(self.nt):
                if not self.margin(i, j) > 0:
                    return False
            if not self.bears(i):
                return False
        return True

    cdef bint bears(self, ptrdiff_t i) noexcept nogil:
        """Whether the load of every grip in row i is below its strength."""
        cdef ptrdiff_t k
        cdef double lam, load = 0.0
        for k in range(self.strong.shape[0]):
            lam = self.lam[i * self.m + self.closed_at[self.strong[k]]]
            load += lam * lam
            if self.strength[k] >= 0:
                if not load < self.strength[k]:
                    return False
                load = 0.0
        return True

    cdef bint stays_off(self, ptrdiff_t i, ptrdiff_t j, bint first) noexcept nogil:
        """Whether row i is in front of surface j, or beside its end, as all rows from the ``first``
        one on are."""
        cdef int row = 1 if self.g[i * self.nc + j] < 0 else 0
        row += 2 if self.W[i * self.nc + j] < 0 else 0
        self.sides[j] = row if first else self.sides[j] & row
        return self.sides[j] != 0

    # Without contacts -----------------------------------------------------------------------------

    def between(
        self, const double[:, ::1] y0, const double[:, :, ::1] ends, const double[:, ::1] y1,
        const double[::1] h, const double[::1] shares
    ):
        """Positions at shares of steps from y0 to y1 with the accelerations ``ends``, shape
        (shares, n, nq): the polynomial of degree 5."""
        cdef ptrdiff_t n = y0.shape[0], nq = self.nq, i
        if not (y1.shape[0] == ends.shape[0] == h.shape[0] == n and ends.shape[1] == 2):
            raise ValueError(f"expected {n} steps")
        if not (y0.shape[1] >= 2 * nq and y1.shape[1] >= 2 * nq and ends.shape[2] == nq):
            raise ValueError(f"expected {nq} coordinates")
        places = np.empty((shares.shape[0], n, nq))
        cdef double[:, :, ::1] q = places
        with nogil:
            for i in range(n):
                quintic(
                    nq, &y0[i, 0], &ends[i, 0, 0], &y1[i, 0], h[i], shares, &q[0, i, 0], n * nq
                )
        return places

    def meets(
        self, const double[:, ::1] start, const double[:, :, ::1] ends, const double[:, ::1] stop,
        const double[::1] t, const double[::1] h, const double[::1] shares,
        const double[:, :, ::1] upper, const double[::1] near
    ):
        """Which steps between states (N, 2 nq) with the accelerations (N, 2, nq) at both ends
        might meet a surface, as ``quiet`` sees it, or have ends that are not finite."""
        cdef ptrdiff_t nq = self.nq, nc = self.nc, N = t.shape[0], places = shares.shape[0], k
        cdef double[::1] path = _space(places * nq), moments = _space(places)
        cdef double[::1] gaps = _space(places * nc)
        met = np.zeros(N, dtype=np.uint8)
        cdef unsigned char[::1] meet = met
        if not (start.shape[0] == ends.shape[0] == stop.shape[0] == h.shape[0] == N):
            raise ValueError(f"expected {N} steps")
        if not (start.shape[1] == stop.shape[1] == 2 * nq == 2 * ends.shape[2]):
            raise ValueError(f"expected {nq} coordinates")
        self._look_at(N, places, upper, near)
        with nogil:
            for k in range(N):
                if nc:
                    self.look(
                        &start[k, 0], &ends[k, 0, 0], &stop[k, 0], t[k], h[k], shares, path,
                        moments, gaps
                    )
                meet[k] = not finite(2 * nq, &stop[k, 0]) or over(
                    places, nc, &gaps[0], &upper[0, 0, 0] + k * places * nc, &near[0]
                )
        return met.view(bool)

    def _look_at(self, N, places, const double[:, :, ::1] upper, const double[::1] near):
        """Refuse limits of gaps that do not fit N steps and places in each."""
        if not (upper.shape[0] == N and upper.shape[1] == places > 0):
            raise ValueError(f"expected {N} steps and {places} places")
        if not upper.shape[2] == near.shape[0] == self.nc:
            raise ValueError(f"expected {self.nc} surfaces")

    def gap(
        self, const double[::1] y, double t, double h, const double[::1] u0, const double[::1] u1,
        ptrdiff_t surface, mode=None
    ):
        """The gap to a surface after a step of a state (q | v) in a mode."""
        cdef ptrdiff_t i
        cdef const double *args[DMOC_MOST]
        cdef ptrdiff_t stride[DMOC_MOST]
        cdef double *results[DMOC_MOST]
        cdef double[::1] row = np.array(y), gaps = _space(self.nc)
        if not (y.shape[0] == 2 * self.nq and u0.shape[0] == u1.shape[0] == self.nu):
            raise ValueError(f"expected {self.nq} coordinates and {self.nu} inputs")
        if not 0 <= surface < self.nc:
            raise ValueError(f"expected one of {self.nc} surfaces")
        self._enter(mode)
        if self.sticking:
            raise ValueError("expected a mode in which nothing sticks")
        self.which[0] = self.step[0] = 0
        self.advance_rows(1, 2 * self.nq, &row[0], &t, &h, &u0[0], &u1[0], NULL)
        t += h
        args[0], args[1], args[2], results[0] = &row[0], &t, &self.par[0], &gaps[0]
        for i in range(3):
            stride[i] = 0
        self.surface.run(1, args, stride, results)
        return gaps[surface]

    def quiet(
        self, double[::1] y, const double[::1] t, const double[::1] h, const double[:, ::1] u0,
        const double[:, ::1] u1, ptrdiff_t first, ptrdiff_t last, const double[::1] shares,
        const double[:, :, ::1] upper, const double[::1] near, const double[:, ::1] q_wanted,
        const double[::1] astray
    ):
        """Integrate a state y = (q | v), in place, over steps from ``first`` to before ``last`` as
        long as it can meet no surface.

        Parameters
        ----------
        t, h, u0, u1 : arrays of shapes (N,), (N,), (N, nu), (N, nu)
            Of all steps, as for ``advance``.
        first, last : int
        shares : array of shape (places,)
            Where in a step gaps are looked at; the first is its start.
        upper : array of shape (N, places, nc)
            Gaps that stop the integration before the step.
        near : array of shape (nc,)
            Distances from surfaces at its start that do.
        q_wanted, astray : arrays of shapes (N + 1, nq), (nq,)
            Positions, and the distances from them beyond which it ends after a step.

        Returns
        -------
        int, and bool
            The first step that is not done, and whether the motion has gone astray before it.
        """
        cdef ptrdiff_t nq = self.nq, nc = self.nc, places = shares.shape[0], N = u0.shape[0]
        cdef ptrdiff_t i, k = first
        cdef double[::1] y1 = np.empty(2 * nq), ends = np.empty(2 * nq)
        cdef double[::1] path = _space(places * nq), moments = _space(places)
        cdef double[::1] gaps = _space(places * nc)
        cdef bint lost = False
        if y.shape[0] != 2 * nq:
            raise ValueError(f"expected {nq} coordinates and their rates")
        if not (t.shape[0] == h.shape[0] == u1.shape[0] == N >= last >= first >= 0):
            raise ValueError(f"expected {N} steps, and places among them")
        if not u0.shape[1] == u1.shape[1] == self.nu:
            raise ValueError(f"expected {self.nu} inputs")
        self._look_at(N, places, upper, near)
        if not (q_wanted.shape[0] == N + 1 and q_wanted.shape[1] == astray.shape[0] == nq):
            raise ValueError(f"expected {N + 1} positions of {nq} coordinates")
        self._enter(None)
        with nogil:
            while k < last and not lost:
                for i in range(2 * nq):
                    y1[i] = y[i]
                self.which[0], self.step[0] = 0, k
                self.advance_rows(
                    1, 2 * nq, &y1[0], &t[0], &h[0], &u0[0, 0], &u1[0, 0], &ends[0]
                )
                if not finite(2 * nq, &y1[0]):
                    break
                if nc:
                    self.look(&y[0], &ends[0], &y1[0], t[k], h[k], shares, path, moments, gaps)
                if over(places, nc, &gaps[0], &upper[0, 0, 0] + k * places * nc, &near[0]):
                    break
                for i in range(2 * nq):
                    y[i] = y1[i]
                k += 1
                for i in range(nq):
                    lost = lost or fabs(y[i] - q_wanted[k, i]) > astray[i]
        return k, lost
