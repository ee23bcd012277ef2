# cython: language_level=3
"""Nonlinear programs as Cython sees them (passes.h)."""
from dmoc_kernel cimport DMOC_MOST, dmoc_entry

cdef extern from "passes.h" nogil:
    ctypedef struct dmoc_element:
        const dmoc_entry *entry
        ptrdiff_t n
        ptrdiff_t base[DMOC_MOST]
        ptrdiff_t stride[DMOC_MOST]
        const ptrdiff_t *gather[DMOC_MOST]
        const ptrdiff_t *slot[DMOC_MOST]
        const double *factor[DMOC_MOST]
    ctypedef struct dmoc_pass:
        ptrdiff_t targets
        const double *constant
        ptrdiff_t terms
        const ptrdiff_t *row
        const ptrdiff_t *column
        const double *coefficient
        ptrdiff_t elements
        dmoc_element *element
        double *scratch
    ctypedef struct dmoc_program:
        ptrdiff_t n, m, equalities
        const double *lower
        const double *upper
        const double *sizes
        double *pool
        dmoc_pass values, slopes, curvatures
        const int *row_start
        const int *column
        const int *hess_start
        const int *hess_column
    ptrdiff_t dmoc_scratch_size(const dmoc_pass *p)
    void dmoc_assemble(const dmoc_pass *p, const double *pool, double *target)
    void dmoc_put(const dmoc_program *program, const double *x)
