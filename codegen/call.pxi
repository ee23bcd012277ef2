cdef class Call:
    """A kernel bound to arrays that stay where they are, one row each.

    Compiled kernels run without the interpreter; those on NumPy take it for their time.
    """
    cdef const dmoc_entry *entry
    cdef const double *args[DMOC_MOST]
    cdef double *results[DMOC_MOST]
    cdef ptrdiff_t stride[DMOC_MOST]
    cdef object function
    cdef tuple arrays

    def __init__(self, kernels, str name, tuple inputs, tuple outputs):
        cdef double[:, ::1] view
        cdef int a
        self.arrays = inputs + outputs
        self.entry = NULL
        self.function = kernels.functions[name]
        if kernels.backend == "compiled":
            self.entry = find_kernel(kernels.module, name)
            count = self.entry.inputs + self.entry.outputs
            shapes = [(1, self.entry.array[a].size) for a in range(count)]
            if [array.shape for array in self.arrays] != shapes:
                raise ValueError(f"{name}: expected arrays of the shapes {shapes}")
        for a in range(len(inputs)):
            view = inputs[a]
            self.args[a] = &view[0, 0] if view.shape[1] else NULL
            self.stride[a] = 0
        for a in range(len(outputs)):
            view = outputs[a]
            self.results[a] = &view[0, 0] if view.shape[1] else NULL

    cdef int run(self) except -1 nogil:
        if self.entry != NULL:
            self.entry.kernel(1, self.args, self.stride, self.results)
        else:
            with gil:
                self.function(*self.arrays)
        return 0
