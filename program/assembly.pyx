# cython: language_level=3, boundscheck=False, wraparound=False, binding=False
"""The nonlinear program as C data (passes.h).

:class:`Program` owns the arrays of a ``dmoc_program`` and evaluates its three passes.

Kernels on NumPy have no C function; their passes run in Python.
"""
from cpython.pycapsule cimport PyCapsule_New
from libc.math cimport fabs, isfinite
from libc.stdlib cimport calloc, free

from dmoc_kernel cimport dmoc_array, find_kernel
from passes cimport (
    dmoc_assemble, dmoc_element, dmoc_pass, dmoc_program, dmoc_put, dmoc_scratch_size
)

import numpy as np


def strided(const ptrdiff_t[:, :] at):
    """Position of the first row and distance of the rows, if rows are consecutive and evenly apart;
    else None.

    An argument that is not has to be gathered value by value.
    """
    cdef ptrdiff_t rows = at.shape[0], size = at.shape[1], first, stride, i, j
    if rows == 0 or size == 0:
        return 0, 0
    first, stride = at[0, 0], at[1, 0] - at[0, 0] if rows > 1 else 0
    for i in range(rows):
        for j in range(size):
            if at[i, j] != first + stride*i + j:
                return None
    return first, stride


def pattern(const ptrdiff_t[::1] row, const ptrdiff_t[::1] column, int rows, int columns):
    """The distinct places (row, column) by rows, then columns: starts of the rows, columns, and the
    number of each place given, -1 where its row is negative."""
    cdef ptrdiff_t e, i, count = 0
    cdef ptrdiff_t size = row.shape[0]
    cdef int last = -1
    if column.shape[0] != size:
        raise ValueError(f"expected {size} columns, got {column.shape[0]}")
    # Sorted by columns, then by rows, like digits of a number.
    cdef ptrdiff_t[::1] by_column = np.zeros(columns + 1, np.intp)
    cdef ptrdiff_t[::1] by_row = np.zeros(rows + 1, np.intp)
    for e in range(size):
        if row[e] < 0:
            continue
        if row[e] >= rows or not 0 <= column[e] < columns:
            raise ValueError(f"({row[e]}, {column[e]}): expected places of {rows} by {columns}")
        by_column[column[e] + 1] += 1
        by_row[row[e] + 1] += 1
    for i in range(columns):
        by_column[i + 1] += by_column[i]
    for i in range(rows):
        by_row[i + 1] += by_row[i]
    cdef ptrdiff_t[::1] once = np.empty(by_row[rows], np.intp), order = np.empty_like(once)
    for e in range(size):
        if row[e] >= 0:
            once[by_column[column[e]]] = e
            by_column[column[e]] += 1
    for i in range(once.shape[0]):
        e = once[i]
        order[by_row[row[e]]] = e
        by_row[row[e]] += 1
    starts, found = np.zeros(rows + 1, np.intc), np.empty(once.shape[0], np.intc)
    slots = np.full(size, -1, np.intp)
    cdef int[::1] start = starts, entry = found
    cdef ptrdiff_t[::1] slot = slots
    for i in range(order.shape[0]):
        e = order[i]
        if count == 0 or row[e] != last or column[e] != entry[count - 1]:
            last = row[e]
            entry[count] = column[e]
            start[last + 1] += 1
            count += 1
        slot[e] = count - 1
    for i in range(rows):
        start[i + 1] += start[i]
    return starts, found[:count].copy(), slots


def _pattern(pattern, rows, entries):
    """A pattern as C takes it, never empty."""
    start, column = pattern
    if len(start) != rows + 1 or start[len(start) - 1] != len(column) or len(column) != entries:
        raise ValueError(f"expected a pattern of {rows} rows and {entries} entries")
    return _filled(start, len(start), np.intc), _filled(column, entries, np.intc)


def _filled(array, ptrdiff_t size, dtype=np.float64):
    """An array of numbers as C takes it, which has an address if it has no entries."""
    if array.size != size:
        raise ValueError(f"expected {size} numbers, got {array.size}")
    return np.ascontiguousarray(array, dtype=dtype).reshape(-1) if size else np.zeros(1, dtype)


cdef class Pass:
    """One pass over elements, from a :class:`dmoc.program.arrays.PassData`.

    Positions lie in the pool, slots in the target.  Arrays of positions that are those of ``like``
    are shared with it, and were checked there.  Arrays of numbers are those of the data.
    """
    cdef dmoc_pass c
    cdef object kernels, data, keep
    cdef double[::1] scratch
    cdef bint compiled

    def __cinit__(self):
        self.c.element = NULL

    def __dealloc__(self):
        free(self.c.element)

    def __init__(self, kernels, data, ptrdiff_t pool, Pass like=None):
        cdef ptrdiff_t targets = len(data.constant), terms = len(data.coefficients)
        cdef ptrdiff_t elements = len(data.places), at = 0
        cdef const double[::1] factors
        self.kernels, self.data, self.keep = kernels, data, []
        self.compiled = kernels.backend == "compiled"
        self.c.targets, self.c.terms, self.c.elements = targets, terms, elements
        self.c.constant = self._numbers(data.constant, targets)
        if like is not None and like.c.targets == targets and (
            like.data.rows is data.rows and like.data.columns is data.columns
        ):
            self.c.row, self.c.column = like.c.row, like.c.column
            self.keep.append(like)
        else:
            _within(data.rows, 0, targets)
            _within(data.columns, 0, pool)
            self.c.row = self._indices(data.rows, terms)
            self.c.column = self._indices(data.columns, terms)
        self.c.coefficient = self._numbers(data.coefficients, terms)
        self.c.element = <dmoc_element *>calloc(max(elements, 1), sizeof(dmoc_element))
        if self.c.element == NULL:
            raise MemoryError()
        if self.compiled:
            kept = ()
            if like is not None and like.compiled and like.c.targets == targets:
                kept = like.data.places
                self.keep.append(like)
            factors = _filled(data.factors, sum([s.size for p in data.places for s in p.slots]))
            self.keep.append(factors)
            for e, element in enumerate(data.places):
                if e < len(kept) and element is kept[e]:
                    self.c.element[e] = like.c.element[e]
                else:
                    self._fill(&self.c.element[e], element, pool)
                for a, slots in enumerate(element.slots):
                    self.c.element[e].factor[a] = &factors[at]
                    at += slots.size
            size = dmoc_scratch_size(&self.c)
            self.scratch = np.empty(max(size, 1))
            self.c.scratch = &self.scratch[0]

    cdef int _fill(self, dmoc_element *c, element, ptrdiff_t pool) except -1:
        cdef const dmoc_array *array
        cdef int a
        cdef int inputs, outputs
        kernel = element.kernel
        c.entry = find_kernel(self.kernels.module, kernel)
        inputs, outputs = c.entry.inputs, c.entry.outputs
        if (len(element.arguments), len(element.slots)) != (inputs, outputs):
            raise ValueError(f"{kernel}: expected {inputs} arguments and {outputs} results")
        c.n = max(len(at) for at in element.arguments)
        for a, at in enumerate((*element.arguments, *element.slots)):
            array = &c.entry.array[a]
            one = a < inputs and len(at) == 1
            if at.shape[1:] != (array.size,) or not (one or len(at) == c.n):
                expected = f"expected ({c.n}, {array.size})"
                raise ValueError(f"{kernel}: {array.name.decode()} of shape {at.shape}, {expected}")
        for a, at in enumerate(element.arguments):
            _within(at, 0, pool)
            evenly = strided(at)
            if evenly is not None:
                c.base[a], c.stride[a] = evenly
            elif len(at) == c.n:
                c.gather[a], c.stride[a] = self._indices(at, at.size), at.shape[1]
            else:
                raise ValueError(f"{kernel}: the positions of a single row must be consecutive")
        for a, slots in enumerate(element.slots):
            if slots.size and slots.max() >= 0:
                _within(slots, -1, self.c.targets)
                c.slot[a] = self._indices(slots, slots.size)
        return 0

    cdef const ptrdiff_t *_indices(self, array, ptrdiff_t size) except? NULL:
        """Keep an array of positions and return its address."""
        cdef const ptrdiff_t[::1] view = _filled(array, size, np.intp)
        self.keep.append(view)
        return &view[0]

    cdef const double *_numbers(self, array, ptrdiff_t size) except? NULL:
        cdef const double[::1] view = _filled(array, size)
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
        data = self.data
        values = data.constant.copy()
        np.add.at(values, data.rows, data.coefficients * pool[data.columns])
        for element in data.elements:
            inputs = [np.ascontiguousarray(pool[at]) for at in element.arguments]
            results = self.kernels.call(element.kernel, *inputs)
            for result, slots, factors in zip(results, element.slots, element.factors, strict=True):
                kept = slots >= 0
                np.add.at(values, slots[kept], (factors * result)[kept])
        return values


def transposed_product(
    const int[::1] start, const int[::1] column, const double[::1] values, const double[::1] y,
    ptrdiff_t columns
):
    """A' y of a matrix A by rows, whose entries stand in ``column`` from ``start`` on."""
    cdef ptrdiff_t rows = start.shape[0] - 1, r, e
    product = np.zeros(columns)
    cdef double[::1] x = product
    if not (y.shape[0] == rows and values.shape[0] == column.shape[0] == start[rows]):
        raise ValueError(f"expected {rows} numbers and {start[rows]} entries")
    for r in range(rows):
        for e in range(start[r], start[r + 1]):
            x[column[e]] += values[e] * y[r]
    return product


def products(
    const double[::1] left, const ptrdiff_t[::1] rows, const double[::1] right,
    const ptrdiff_t[::1] columns, const double[::1] factors, const ptrdiff_t[::1] places
):
    """left[rows] * right[columns] * factors[places]; positions are those of the arrays."""
    cdef ptrdiff_t n = rows.shape[0], l = left.shape[0], r = right.shape[0], f = factors.shape[0], i
    if not columns.shape[0] == places.shape[0] == n:
        raise ValueError(f"expected {n} columns and places")
    product = np.empty(n)
    cdef double[::1] x = product
    for i in range(n):
        if not (-l <= rows[i] < l and -r <= columns[i] < r and -f <= places[i] < f):
            raise ValueError(f"factor {i}: a position lies outside")
        x[i] = (
            left[rows[i] + l*(rows[i] < 0)] * right[columns[i] + r*(columns[i] < 0)]
            * factors[places[i] + f*(places[i] < 0)]
        )
    return product


def on_limits(
    const double[::1] x, const double[::1] sizes, const double[::1] lower, const double[::1] upper,
    double rounding
):
    """x * sizes; those next to a finite limit, up to rounding relative to it, are the limit."""
    cdef ptrdiff_t n = x.shape[0], i
    if not sizes.shape[0] == lower.shape[0] == upper.shape[0] == n:
        raise ValueError(f"expected sizes and limits of {n} unknowns")
    values = np.empty(n)
    cdef double[::1] y = values
    for i in range(n):
        y[i] = _on_limit(_on_limit(x[i] * sizes[i], lower[i], rounding), upper[i], rounding)
    return values


cdef inline double _on_limit(double y, double limit, double rounding) noexcept nogil:
    return limit if isfinite(limit) and fabs(y - limit) <= rounding * fabs(limit) else y


cdef int _within(positions, ptrdiff_t least, ptrdiff_t end) except -1:
    """The C code trusts positions: refuse those outside."""
    cdef const ptrdiff_t[::1] view = np.ascontiguousarray(positions, dtype=np.intp).ravel()
    cdef ptrdiff_t i
    for i in range(view.shape[0]):
        if view[i] < least or view[i] >= end:
            raise ValueError(f"position {view[i]}: expected {least} to {end - 1}")
    return 0


cdef class Program:
    """The program of a :class:`dmoc.program.arrays.ProgramData`, on the kernels of its model;
    ``like`` is another program of the same kernels, with which it may share positions."""
    cdef dmoc_program c
    cdef Pass _values, _slopes, _curvatures
    cdef double[::1] pool, lower, upper, sizes
    cdef const int[::1] row_start, column, hess_start, hess_column
    cdef readonly bint compiled
    cdef readonly object data

    def __init__(self, kernels, data, Program like=None):
        cdef ptrdiff_t n = data.n, m = data.m
        self.data = data
        self.lower, self.upper = np.append(data.lower, 0.0), np.append(data.upper, 0.0)
        self.sizes = np.ascontiguousarray(data.sizes, dtype=np.float64)
        self.pool = np.append(data.pool, 0.0)
        lengths = len(data.upper), len(data.sizes), min(len(data.pool), n + m + 2)
        if lengths != (n, n + m + 1, n + m + 2):
            raise ValueError(f"expected bounds of {n} unknowns and sizes of {n + m + 1} numbers")
        passes, size = (data.values, data.slopes, data.curvatures), len(data.pool)
        kept = (None, None, None)
        if like is not None and len(like.pool) == size + 1:
            kept = (like._values, like._slopes, like._curvatures)
        self._values, self._slopes, self._curvatures = (
            Pass(kernels, p, size, k) for p, k in zip(passes, kept))
        self.row_start, self.column = _pattern(data.jacobian, m, len(data.slopes.constant) - n)
        self.hess_start, self.hess_column = _pattern(data.hessian, n, len(data.curvatures.constant))
        self.compiled = kernels.backend == "compiled"
        self.c.n, self.c.m, self.c.equalities = n, m, data.equalities
        self.c.lower, self.c.upper = &self.lower[0], &self.upper[0]
        self.c.pool, self.c.sizes = &self.pool[0], &self.sizes[0]
        self.c.values, self.c.slopes = self._values.c, self._slopes.c
        self.c.curvatures = self._curvatures.c
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
            self.pool[self.c.n + r] = self.sizes[self.c.n + r] * y[r]
        self.pool[self.c.n + self.c.m] = self.sizes[self.c.n + self.c.m] * sigma
        return self._curvatures.run(self.pool)
