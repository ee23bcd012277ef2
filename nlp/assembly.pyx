# cython: language_level=3, boundscheck=False, wraparound=False, binding=False
"""The nonlinear program as C data: :class:`Program` owns the arrays of a ``dmoc_program`` (passes.h) and evaluates its three passes.

Kernels on NumPy have no C function; their passes run in Python.
"""
from cpython.pycapsule cimport PyCapsule_GetPointer, PyCapsule_New
from libc.stdlib cimport calloc, free

import numpy as np

cdef extern from "passes.h" nogil:
    ctypedef void dmoc_kernel(ptrdiff_t n, const double *const *args, const ptrdiff_t *stride, double *const *results)
    enum: DMOC_MOST
    ctypedef struct dmoc_element:
        dmoc_kernel *kernel
        ptrdiff_t n
        int arguments, results
        ptrdiff_t base[DMOC_MOST]
        ptrdiff_t stride[DMOC_MOST]
        ptrdiff_t size[DMOC_MOST]
        const ptrdiff_t *gather[DMOC_MOST]
        ptrdiff_t count[DMOC_MOST]
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
        const double *unit
        double *pool
        dmoc_pass values, slopes, curvatures
        const int *row_start
        const int *column
        const int *hess_start
        const int *hess_column
    ptrdiff_t dmoc_scratch_size(const dmoc_pass *p)
    void dmoc_assemble(const dmoc_pass *p, const double *pool, double *target)
    void dmoc_put(const dmoc_program *program, const double *x)


cdef class Pass:
    """One pass: constants, linear part (rows, columns, coefficients) and elements (kernel, arguments, slots, factors)."""
    cdef dmoc_pass c
    cdef object kernels, elements, constant, linear, keep
    cdef bint compiled

    def __cinit__(self):
        self.c.element = NULL

    def __dealloc__(self):
        free(self.c.element)

    def __init__(self, kernels, constant, linear, elements):
        cdef ptrdiff_t[::1] indices
        cdef double[::1] numbers
        self.kernels, self.elements, self.linear = kernels, elements, linear
        self.constant = np.ascontiguousarray(constant, dtype=np.float64)
        self.keep = []
        self.compiled = kernels.backend == "compiled"
        self.c.targets, self.c.terms, self.c.elements = len(constant), len(linear[0]), len(elements)
        self.c.constant = self._numbers(self.constant)
        self.c.row, self.c.column, self.c.coefficient = self._indices(linear[0]), self._indices(linear[1]), self._numbers(linear[2])
        self.c.element = <dmoc_element *>calloc(max(len(elements), 1), sizeof(dmoc_element))
        if self.c.element == NULL:
            raise MemoryError()
        if self.compiled:
            for e, (kernel, arguments, results) in enumerate(elements):
                self._fill(&self.c.element[e], kernel, arguments, results)
            self.c.scratch = self._numbers(np.empty(dmoc_scratch_size(&self.c) + 1))

    cdef int _fill(self, dmoc_element *element, str kernel, tuple arguments, tuple results) except -1:
        element.kernel = <dmoc_kernel *>PyCapsule_GetPointer(self.kernels.module.capsule(kernel), "dmoc_kernel")
        if max(len(arguments), len(results)) > DMOC_MOST:
            raise ValueError(f"{kernel}: more than {DMOC_MOST} arguments")
        element.n = max(len(at) for at in arguments)
        element.arguments, element.results = len(arguments), len(results)
        for a, at in enumerate(arguments):
            element.size[a] = at.shape[1]
            if at.size == 0:
                element.base[a] = element.stride[a] = 0
                continue
            stride = int(at[1, 0] - at[0, 0]) if len(at) > 1 else 0
            straight = at[0, 0] + stride * np.arange(len(at))[:, None] + np.arange(at.shape[1])
            if np.array_equal(at, straight):
                element.base[a], element.stride[a] = at[0, 0], stride
            elif len(at) != element.n:
                raise ValueError(f"{kernel}: an argument of one row must have consecutive positions")
            else:
                element.gather[a], element.stride[a] = self._indices(at.ravel()), at.shape[1]
        for b, (slots, factors) in enumerate(results):
            element.count[b] = slots.shape[1]
            if slots.size and slots.max() >= 0:
                element.slot[b], element.factor[b] = self._indices(slots.ravel()), self._numbers(factors.ravel())
        return 0

    cdef const ptrdiff_t *_indices(self, array) except? NULL:
        """Keep a copy of an array of positions and return its address."""
        cdef ptrdiff_t[::1] view = np.append(array, 0).astype(np.intp)
        self.keep.append(view)
        return &view[0]

    cdef double *_numbers(self, array) except? NULL:
        cdef double[::1] view = np.append(array, 0.0).astype(np.float64)
        self.keep.append(view)
        return &view[0]

    cdef object run(self, double[::1] pool):
        cdef double[::1] target
        if not self.compiled:
            return self._run_numpy(np.asarray(pool))
        values = np.empty(self.c.targets + 1)  # never empty, so that it has an address
        target = values
        with nogil:
            dmoc_assemble(&self.c, &pool[0], &target[0])
        return values[: self.c.targets]

    def _run_numpy(self, pool):
        values = self.constant.copy()
        rows, columns, coefficients = self.linear
        np.add.at(values, rows, coefficients * pool[columns])
        for kernel, arguments, results in self.elements:
            inputs = [np.ascontiguousarray(pool[at]) for at in arguments]
            for found, (slots, factors) in zip(self.kernels.call(kernel, *inputs), results):
                kept = slots >= 0
                np.add.at(values, slots[kept], (factors * found)[kept])
        return values


cdef class Program:
    """The program of :mod:`dmoc.nlp.transcription`; positions, patterns and units come from there.

    ``unit`` holds the sizes of the unknowns, the inverse sizes of the constraints and that of the cost: what x, y and sigma are multiplied by.
    """
    cdef dmoc_program c
    cdef Pass _values, _slopes, _curvatures
    cdef double[::1] pool, lower, upper, unit
    cdef int[::1] row_start, column, hess_start, hess_column
    cdef readonly bint compiled

    def __init__(self, kernels, bounds, equalities, m, unit, par, passes, jacobian, hessian):
        self.lower, self.upper = (np.append(b, 0.0) for b in bounds)
        self.unit = np.ascontiguousarray(unit, dtype=np.float64)
        self._values, self._slopes, self._curvatures = (Pass(kernels, *p) for p in passes)
        self.row_start, self.column = (np.append(a, 0).astype(np.intc) for a in jacobian)
        self.hess_start, self.hess_column = (np.append(a, 0).astype(np.intc) for a in hessian)
        n = len(bounds[0])
        self.pool = np.concatenate([np.zeros(n + m + 2), par, [0.0]])
        self.compiled = kernels.backend == "compiled"
        self.c.n, self.c.m, self.c.equalities = n, m, equalities
        self.c.lower, self.c.upper, self.c.pool, self.c.unit = &self.lower[0], &self.upper[0], &self.pool[0], &self.unit[0]
        self.c.values, self.c.slopes, self.c.curvatures = self._values.c, self._slopes.c, self._curvatures.c
        self.c.row_start, self.c.column = &self.row_start[0], &self.column[0]
        self.c.hess_start, self.c.hess_column = &self.hess_start[0], &self.hess_column[0]

    def capsule(self):
        """Return a capsule named "dmoc_program"; it is valid as long as this object."""
        return PyCapsule_New(&self.c, "dmoc_program", NULL)

    cdef int _put(self, const double[::1] x) except -1:
        if x.shape[0] != self.c.n:
            raise ValueError(f"expected {self.c.n} unknowns")
        if self.c.n:
            dmoc_put(&self.c, &x[0])
        return 0

    def values(self, const double[::1] x):
        """r(x) = (f | c | d), shape (1 + m,)."""
        self._put(x)
        return self._values.run(self.pool)

    def slopes(self, const double[::1] x):
        """The gradient of f, shape (n,), followed by the entries of d(c | d)/dx."""
        self._put(x)
        return self._slopes.run(self.pool)

    def curvatures(self, const double[::1] x, const double[::1] y, double sigma):
        """The entries of the upper triangle of the Hessian of sigma f + y . (c | d)."""
        cdef ptrdiff_t r
        self._put(x)
        if y.shape[0] != self.c.m:
            raise ValueError(f"expected {self.c.m} multipliers")
        for r in range(self.c.m):
            self.pool[self.c.n + r] = self.unit[self.c.n + r] * y[r]
        self.pool[self.c.n + self.c.m] = self.unit[self.c.n + self.c.m] * sigma
        return self._curvatures.run(self.pool)
