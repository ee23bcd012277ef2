# cython: language_level=3, boundscheck=False, wraparound=False, binding=False
"""Entry to the interior-point method in C (interior_point.h), and to its factorisation
(factorisation.pxi); what a point leaves of the optimality conditions (residuals.pxi), of first and
of second order (second_order.pxi); solves of many neighbours (rows.pxi)."""
from cpython.exc cimport PyErr_CheckSignals
from cpython.pycapsule cimport PyCapsule_GetPointer
from cpython.ref cimport PyObject
from libc.math cimport INFINITY
from libc.time cimport CLOCKS_PER_SEC, clock, clock_t

from passes cimport dmoc_assemble, dmoc_program, dmoc_put

import numpy as np

include "factorisation.pxi"
include "residuals.pxi"
include "second_order.pxi"

cdef extern from "interior_point.h" nogil:
    ctypedef int dmoc_report(void *user, int iteration, double cost, double violation, double mu,
                             int restoring) noexcept nogil
    ctypedef struct dmoc_options:
        double optimality, demanded, violation, least_cost, infeasible, mu, seconds
        int warm, iterations, least_violation
        const double *price
        double (*clock)() noexcept nogil
        dmoc_report *report
        void *user
    ctypedef struct dmoc_kkt:
        int size, pivots
        const int *place
        const int *start
        const int *row
        const int *first
        const int *from_hess
        const int *from_jac
        const int *diagonal
    ctypedef struct dmoc_result:
        int status, iterations, restorations
        long factorisations
        double seconds_kernels, seconds_linear, seconds
    enum: DMOC_INTERRUPTED
    size_t dmoc_interior_memory(const dmoc_program *program, const dmoc_kkt *kkt)
    dmoc_result dmoc_interior_point(const dmoc_program *program, const dmoc_kkt *kkt,
                                    const dmoc_options *options, const double *size,
                                    const double *stretch, double *x, double *y, double *z_lower,
                                    double *z_upper, dmoc_ldl *ldl, void *memory)
    double dmoc_clock()
    ctypedef struct dmoc_starts:
        int count
        const double *size
        const double *mu
        const int *hurried
        double *x
        double *y
        double *z_lower
        double *z_upper
        int *status
        int *iterations
        int *turn
        const int *stop
    void dmoc_interior_starts(const dmoc_program *program, const dmoc_kkt *kkt,
                              const dmoc_options *options, const double *stretch,
                              const dmoc_starts *starts, dmoc_ldl *ldl, void *memory)


# Seconds of processor time between two looks at signals where nobody listens to every iteration:
# taking the lock of the interpreter that often would make solves in several threads wait for each
# other.
cdef double PATIENCE = 0.02


cdef class _Listener:
    """Hands iterations to Python; what is raised there ends the solve and is raised afterwards."""
    cdef object report
    cdef object raised


cdef struct _Hearing:
    PyObject *listener
    bint every      # iteration is reported
    clock_t heard   # the last one, if not


cdef int _report(void *user, int iteration, double cost, double violation, double mu,
                 int restoring) noexcept nogil:
    cdef _Hearing *hearing = <_Hearing *>user
    cdef clock_t now = 0 if hearing.every else clock()
    if not hearing.every and now - hearing.heard < PATIENCE*CLOCKS_PER_SEC:
        return 0
    hearing.heard = now
    with gil:
        listener = <_Listener>hearing.listener
        try:
            listener.report(iteration, cost, violation, mu, bool(restoring))
            PyErr_CheckSignals()
        except BaseException as error:
            listener.raised = error
            return 1
    return 0


cdef const int *_indices(int[::1] array, ptrdiff_t size, str name) except? NULL:
    """The address of an array of this size; NULL if it is empty."""
    if array.shape[0] != size:
        raise ValueError(f"{name}: expected {size} entries, got {array.shape[0]}")
    return &array[0] if size else NULL


cdef double *_numbers(double[::1] array, ptrdiff_t size, str name, double *none) except NULL:
    if array.shape[0] != size:
        raise ValueError(f"{name}: expected {size} numbers, got {array.shape[0]}")
    return &array[0] if size else none


cdef dmoc_kkt _layout(const dmoc_program *program, layout) except *:
    """A :class:`dmoc.solvers.kkt_layout.KKTLayout` as C takes it."""
    cdef dmoc_kkt kkt
    cdef ptrdiff_t n = program.n, m = program.m
    kkt.size, kkt.pivots = layout.size, len(layout.first) - 1
    kkt.place = _indices(layout.place, n + m, "place")
    kkt.start = _indices(layout.start, kkt.size + 1, "start")
    kkt.row = _indices(layout.row, kkt.start[kkt.size], "row")
    kkt.first = _indices(layout.first, kkt.pivots + 1, "first")
    kkt.from_hess = _indices(layout.from_hess, program.hess_start[n], "from_hess")
    kkt.from_jac = _indices(layout.from_jac, program.row_start[m], "from_jac")
    kkt.diagonal = _indices(layout.diagonal, n + m, "diagonal")
    return kkt


def interior_point(
    program, layout, double[::1] size, double[::1] stretch,
    double[::1] x, double[::1] y, double[::1] z_lower, double[::1] z_upper, *,
    double[::1] price=None, bint least_violation=False, double optimality, double demanded,
    double violation, double least_cost, double infeasible, double mu, bint warm, int iterations,
    double seconds, report, bint every,
):
    """Minimise from x, in place; returns the fields of ``dmoc_result`` as a dictionary.

    ``report`` hears of every iteration, or now and then.
    """
    cdef dmoc_program *c = <dmoc_program *>PyCapsule_GetPointer(program.capsule(), "dmoc_program")
    cdef dmoc_kkt kkt = _layout(c, layout)
    cdef Room room = _room(program, layout)
    cdef dmoc_options options
    cdef dmoc_result result
    cdef _Listener listener = _Listener()
    cdef _Hearing hearing = _Hearing(<PyObject *>listener, every, clock())
    cdef double none = 0.0
    cdef double *sizes = _numbers(size, c.n, "size", &none)
    cdef double *stretches = _numbers(stretch, c.n, "stretch", &none)
    cdef double *unknowns = _numbers(x, c.n, "x", &none)
    cdef double *multipliers = _numbers(y, c.m, "y", &none)
    cdef double *lower = _numbers(z_lower, c.n, "z_lower", &none)
    cdef double *upper = _numbers(z_upper, c.n, "z_upper", &none)
    listener.report = report
    options.optimality, options.demanded, options.violation = optimality, demanded, violation
    options.least_cost, options.infeasible, options.mu = least_cost, infeasible, mu
    options.warm, options.iterations, options.seconds = warm, iterations, seconds
    options.least_violation, options.clock = least_violation, dmoc_clock
    options.price = NULL if price is None else _numbers(price, c.m, "price", &none)
    options.report, options.user = _report, <void *>&hearing
    with nogil:
        result = dmoc_interior_point(c, &kkt, &options, sizes, stretches, unknowns, multipliers,
                                     lower, upper, room.factorisation.f, &room.memory[0])
    layout.rooms.append(room)
    if listener.raised is not None:
        raise listener.raised
    return result


cdef double *_rows(double[:, ::1] array, ptrdiff_t count, ptrdiff_t size, str name) except NULL:
    if array.shape[0] != count or array.shape[1] != size:
        raise ValueError(f"{name}: expected {count} rows of {size} numbers")
    return &array[0, 0] if count and size else &_NONE


cdef double _NONE = 0.0


def interior_points(
    program, layout, double[:, ::1] size, double[::1] stretch, double[::1] mu, int[::1] hurried,
    double[:, ::1] x, double[:, ::1] y, double[:, ::1] z_lower, double[:, ::1] z_upper,
    int[::1] status, int[::1] iterations, int[::1] turn, int[::1] stop, *, double optimality,
    double demanded, double violation, double least_cost, double infeasible, int most,
    double seconds,
):
    """Minimise from rows of x, in place, without multipliers, in as many threads as call it with
    programs of their own and the same arrays; nothing of Python is between two of them.

    Rows with a number other than 0 in ``hurried`` are given up where they come no nearer to a
    motion: they end at a limit of iterations, before that.
    ``turn`` counts the rows that have been taken; what is stored in ``stop`` ends all.  ``status``
    and ``iterations`` stay as they were where there was no time.
    """
    cdef dmoc_program *c = <dmoc_program *>PyCapsule_GetPointer(program.capsule(), "dmoc_program")
    cdef dmoc_kkt kkt = _layout(c, layout)
    cdef Room room = _room(program, layout)
    cdef ptrdiff_t count = x.shape[0]
    cdef dmoc_options options
    cdef dmoc_starts starts
    cdef double *stretches = _numbers(stretch, c.n, "stretch", &_NONE)
    starts.count = count
    starts.size, starts.mu = _rows(size, count, c.n, "size"), _numbers(mu, count, "mu", &_NONE)
    starts.hurried = _indices(hurried, count, "hurried")
    starts.x, starts.y = _rows(x, count, c.n, "x"), _rows(y, count, c.m, "y")
    starts.z_lower = _rows(z_lower, count, c.n, "z_lower")
    starts.z_upper = _rows(z_upper, count, c.n, "z_upper")
    starts.status = <int *>_indices(status, count, "status")
    starts.iterations = <int *>_indices(iterations, count, "iterations")
    starts.turn, starts.stop = <int *>_indices(turn, 1, "turn"), _indices(stop, 1, "stop")
    options.optimality, options.demanded, options.violation = optimality, demanded, violation
    options.least_cost, options.infeasible, options.iterations = least_cost, infeasible, most
    options.warm, options.least_violation, options.price = False, False, NULL
    options.seconds = seconds
    with nogil:
        dmoc_interior_starts(c, &kkt, &options, stretches, &starts, room.factorisation.f,
                             &room.memory[0])
    layout.rooms.append(room)


def interior_memory(program, layout):
    """Bytes that a solve needs beside its arguments and the factorisation."""
    cdef dmoc_program *c = <dmoc_program *>PyCapsule_GetPointer(program.capsule(), "dmoc_program")
    cdef dmoc_kkt kkt = _layout(c, layout)
    return dmoc_interior_memory(c, &kkt)


cdef class Room:
    """What a solve of one form works in: a factorisation, and memory of the method.  It serves one
    solve after the other: new memory takes longer than an iteration."""
    cdef readonly Factorisation factorisation
    cdef double[::1] memory

    def __init__(self, program, layout):
        self.factorisation = Factorisation(like=layout.factorisation)
        self.memory = np.empty(interior_memory(program, layout)//sizeof(double))

    @property
    def nbytes(self):
        return self.factorisation.nbytes + self.memory.nbytes


cdef Room _room(program, layout):
    """One that is free, or a new one; it goes back to the others of its layout afterwards."""
    try:
        return layout.rooms.pop()
    except IndexError:
        return Room(program, layout)


def kkt_pattern(
    int[::1] place, int size,
    int[::1] hess_start, int[::1] hess_column, int[::1] jac_start, int[::1] jac_column,
):
    """The pattern of K = [[H, A'], [A, 0]] with a full diagonal: the arrays ``start``, ``row``,
    ``from_hess``, ``from_jac`` and ``diagonal`` of a
    :class:`dmoc.solvers.kkt_layout.KKTLayout`."""
    cdef int n = hess_start.shape[0] - 1, m = jac_start.shape[0] - 1
    cdef int h = hess_column.shape[0], j = jac_column.shape[0], last = -1, i, e
    cdef int[::1] low = np.full(h + j + n + m, -1, np.intc)  # positions of each number's unknowns
    cdef int[::1] high = np.full(h + j + n + m, -1, np.intc)
    if place.shape[0] != n + m or hess_start[n] != h or jac_start[m] != j:
        raise ValueError(f"expected the places of {n + m} indices, {h} and {j} entries")
    if n + m and not (-1 <= np.min(place) and np.max(place) < size):
        raise ValueError(f"place: expected -1 to {size - 1}")
    for i in range(n):
        for e in range(hess_start[i], hess_start[i + 1]):
            _pair(place, n, i, hess_column[e], e, &low[0], &high[0])
    for i in range(m):
        for e in range(jac_start[i], jac_start[i + 1]):
            _pair(place, n, n + i, jac_column[e], h + e, &low[0], &high[0])
    for i in range(n + m):
        low[h + j + i] = high[h + j + i] = place[i]
    # Sorted by columns, then by rows, like digits of a number.
    cdef int[::1] order = _sorted(high, _sorted(low, np.arange(len(low), dtype=np.intc), size), size)
    cdef int[::1] start = np.zeros(size + 1, np.intc), row = np.empty(len(order), np.intc)
    cdef int[::1] found = np.full(len(low), -1, np.intc)
    cdef int count = 0
    for e in range(order.shape[0]):
        i = order[e]
        if count == 0 or low[i] != row[count - 1] or high[i] != last:
            last = high[i]
            row[count] = low[i]
            start[last + 1] += 1
            count += 1
        found[i] = count - 1
    for i in range(size):
        start[i + 1] += start[i]
    every = np.asarray(found)
    return {
        "start": np.asarray(start), "row": np.asarray(row)[:count].copy(),
        "from_hess": every[:h].copy(), "from_jac": every[h : h + j].copy(),
        "diagonal": every[h + j :].copy(),
    }


cdef int _pair(
    int[::1] place, int n, int i, int column, int at, int *low, int *high
) except -1:
    """Positions of index i and of an unknown in K, unless one is fixed."""
    if column < 0 or column >= n:
        raise ValueError(f"column {column}: expected 0 to {n - 1}")
    cdef int a = place[i], b = place[column]
    if a >= 0 and b >= 0:
        low[at], high[at] = min(a, b), max(a, b)
    return 0


cdef int[::1] _sorted(int[::1] digit, int[::1] order, int size):
    """The members of ``order`` that have a digit, ascending, others in their order."""
    cdef int[::1] first = np.zeros(size + 1, np.intc)
    cdef int e, d
    for e in range(order.shape[0]):
        d = digit[order[e]]
        if d >= 0:
            first[d + 1] += 1
    for d in range(size):
        first[d + 1] += first[d]
    cdef int[::1] found = np.empty(first[size], np.intc)
    for e in range(order.shape[0]):
        d = digit[order[e]]
        if d >= 0:
            found[first[d]] = order[e]
            first[d] += 1
    return found


include "rows.pxi"
