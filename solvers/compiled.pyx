# cython: language_level=3, boundscheck=False, wraparound=False, binding=False
"""Entry to the interior-point method in C (interior_point.h), and to its factorisation for tests."""
from cpython.exc cimport PyErr_CheckSignals
from cpython.pycapsule cimport PyCapsule_GetPointer

import numpy as np

cdef extern from "passes.h" nogil:
    ctypedef struct dmoc_program:
        ptrdiff_t n, m

cdef extern from "ldl.h" nogil:
    ctypedef struct dmoc_ldl:
        int positive, negative, zero
    dmoc_ldl *dmoc_ldl_new(int n, int pivots, const int *first, const int *start, const int *row)
    void dmoc_ldl_free(dmoc_ldl *f)
    void dmoc_ldl_factor(dmoc_ldl *f, const double *values, double tiny)
    void dmoc_ldl_solve(const dmoc_ldl *f, double *x)

cdef extern from "interior_point.h" nogil:
    enum: DMOC_NO_MEMORY
    ctypedef int dmoc_report(void *user, int iteration, double cost, double violation, double mu, int restoring) noexcept nogil
    ctypedef struct dmoc_options:
        double optimality, demanded, violation, least_cost, infeasible, mu, seconds
        int warm, iterations, least_violation
        const double *price
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
    dmoc_result dmoc_interior_point(const dmoc_program *program, const dmoc_kkt *kkt, const dmoc_options *options, const double *size,
                                    const double *stretch, double *x, double *y, double *z_lower, double *z_upper)


cdef class _Listener:
    """Hands iterations to Python; what is raised there ends the solve and is raised again afterwards."""
    cdef object report
    cdef object raised


cdef int _report(void *user, int iteration, double cost, double violation, double mu, int restoring) noexcept nogil:
    with gil:
        listener = <_Listener>user
        try:
            PyErr_CheckSignals()
            listener.report(iteration, cost, violation, mu, bool(restoring))
        except BaseException as error:
            listener.raised = error
            return 1
    return 0


cdef const int *_address(int[::1] array) noexcept:
    return &array[0] if array.shape[0] else NULL


def interior_point(program, system, double[::1] size, double[::1] stretch, double[::1] x, double[::1] y, double[::1] z_lower, double[::1] z_upper, *,
                   double[::1] price=None, bint least_violation=False,
                   double optimality, double demanded, double violation, double least_cost, double infeasible, double mu, bint warm, int iterations, double seconds, report):
    """Minimise from x, in place; returns the fields of ``dmoc_result`` as a dictionary."""
    cdef dmoc_program *c = <dmoc_program *>PyCapsule_GetPointer(program.capsule(), "dmoc_program")
    cdef dmoc_options options
    cdef dmoc_kkt kkt
    cdef dmoc_result result
    cdef _Listener listener = _Listener()
    cdef double none = 0.0
    if not (x.shape[0] == z_lower.shape[0] == z_upper.shape[0] == size.shape[0] == stretch.shape[0] == c.n and y.shape[0] == c.m):
        raise ValueError(f"expected {c.n} unknowns and {c.m} multipliers")
    if price is not None and price.shape[0] != c.m:
        raise ValueError(f"expected {c.m} prices")
    listener.report = report
    options.optimality, options.demanded, options.violation = optimality, demanded, violation
    options.least_cost, options.infeasible, options.mu = least_cost, infeasible, mu
    options.warm, options.iterations, options.seconds = warm, iterations, seconds
    options.price, options.least_violation = &price[0] if price is not None and c.m else NULL, least_violation
    options.report, options.user = _report, <void *>listener
    kkt.size, kkt.pivots = system.size, len(system.first) - 1
    kkt.place, kkt.start, kkt.row, kkt.first = (
        _address(system.place), _address(system.start), _address(system.row), _address(system.first))
    kkt.from_hess, kkt.from_jac, kkt.diagonal = _address(system.from_hess), _address(system.from_jac), _address(system.diagonal)
    cdef double *multipliers = &y[0] if y.shape[0] else &none
    with nogil:
        result = dmoc_interior_point(c, &kkt, &options, &size[0], &stretch[0], &x[0], multipliers, &z_lower[0], &z_upper[0])
    if listener.raised is not None:
        raise listener.raised
    if result.status == DMOC_NO_MEMORY:
        raise MemoryError("the interior-point method has not enough memory")
    return result


def factor_and_solve(int[::1] first, int[::1] start, int[::1] row, double[::1] values, double[::1] right):
    """Factorise K, solve K x = right, and return x and the numbers of positive, negative and zero pivots."""
    cdef int n = start.shape[0] - 1
    cdef double[::1] x
    cdef dmoc_ldl *f = dmoc_ldl_new(n, first.shape[0] - 1, &first[0], &start[0], _address(row))
    if f == NULL:
        raise MemoryError()
    try:
        solution = np.array(right)
        x = solution
        dmoc_ldl_factor(f, &values[0], 1e-20)
        dmoc_ldl_solve(f, &x[0])
        return solution, (f.positive, f.negative, f.zero)
    finally:
        dmoc_ldl_free(f)
