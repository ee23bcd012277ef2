"""Kernels for rows of states."""


cdef class Rows:
    """A kernel whose rows of inputs lie some stride apart in memory, in C or on NumPy."""
    cdef const dmoc_entry *entry
    cdef object function
    cdef list sizes
    cdef ptrdiff_t inputs

    def __init__(self, kernels, str name):
        facts = kernels.manifest.kernels[name]
        self.sizes = [size for _, size in facts["inputs"]]
        self.inputs = len(self.sizes)
        self.sizes += [len(o["rows"]) if "rows" in o else o["shape"][0] for o in facts["outputs"]]
        self.entry = NULL
        self.function = kernels.functions[name]
        if kernels.backend == "compiled":
            self.entry = find_kernel(kernels.module, name)

    cdef ptrdiff_t size(self, ptrdiff_t output):
        return self.sizes[self.inputs + output]

    cdef int run(
        self, ptrdiff_t n, const double *const *args, const ptrdiff_t *stride,
        double *const *results
    ) except -1 nogil:
        if self.entry != NULL:
            self.entry.kernel(n, args, stride, results)
            return 0
        return self.on_numpy(n, args, stride, results)

    # Apart: a function with Python's objects takes the interpreter's lock even where it needs none.
    cdef int on_numpy(
        self, ptrdiff_t n, const double *const *args, const ptrdiff_t *stride,
        double *const *results
    ) except -1 with gil:
        arrays = []
        for a, size in enumerate(self.sizes):
            if a < self.inputs:
                arrays.append(_seen(<double *>args[<ptrdiff_t>a], n, stride[<ptrdiff_t>a], size))
            else:
                arrays.append(_seen(results[<ptrdiff_t>a - self.inputs], n, size, size))
        self.function(*arrays)
        return 0


cdef object _seen(double *at, ptrdiff_t n, ptrdiff_t stride, ptrdiff_t size):
    """Rows in memory as an array of shape (n, size), or (1, size) where the stride is 0."""
    if not size:
        return np.empty((n, 0))
    if not stride:
        return np.asarray(<double[:1, :size]>at)
    return np.asarray(<double[:n, :stride]>at)[:, :size]


cdef double[::1] _space(ptrdiff_t size):
    return np.zeros(max(size, 1))
