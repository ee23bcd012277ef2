# cython: language_level=3
"""Least squares of small dense matrices as Cython sees them (least_squares.h)."""

cdef extern from "least_squares.h" nogil:
    ptrdiff_t dmoc_work_size(int m, int n)
    void dmoc_pseudo_inverse(int m, int n, const double *A, double cut, double *inverse,
                             double *work)
    double dmoc_smallest_singular(int m, int n, const double *A, double *work)
    void dmoc_complement(int m, int n, const double *A, double *rows, double *work)
