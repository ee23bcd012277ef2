# cython: language_level=3, boundscheck=False, wraparound=False, binding=False
"""The border to compiled kernels: libraries are loaded, and arrays are checked before C code sees
them."""
import ctypes
import os

from cpython.buffer cimport (
    PyBUF_C_CONTIGUOUS, PyBUF_FORMAT, PyBUF_WRITABLE, PyBuffer_Release, PyObject_GetBuffer
)
from cpython.pycapsule cimport PyCapsule_New

from dmoc_kernel cimport DMOC_MOST, DMOC_TABLE, dmoc_array, dmoc_entry, dmoc_table

from numpy import ascontiguousarray, empty


cdef class Library:
    """The shared library of a model's kernels, loaded for good.

    Attributes
    ----------
    path : str
    code : str
        The digest of the sources that it was compiled from.
    table : capsule
        Its kernels, for compiled code.

    Raises
    ------
    OSError
        If it cannot be loaded.
    ValueError
        If it is not that of the model.
    """
    cdef readonly str path, code
    cdef readonly object table
    cdef const dmoc_table *kernels

    def __init__(self, path, str model):
        cdef size_t address
        self.path = os.path.abspath(path)  # what has no folder is looked for elsewhere
        library = ctypes.CDLL(self.path)
        address = ctypes.addressof(ctypes.c_char.in_dll(library, f"{model}_kernels"))
        self.kernels = <const dmoc_table *>address
        self.code = self.kernels.code.decode()
        self.table = PyCapsule_New(<void *>self.kernels, DMOC_TABLE, NULL)

    def __eq__(self, other):
        return isinstance(other, Library) and self.kernels == (<Library>other).kernels

    def __hash__(self):
        return <Py_hash_t>self.kernels

    def functions(self):
        """Return the kernels by name, each a :class:`Function`."""
        cdef Function function
        cdef int i
        functions = {}
        for i in range(self.kernels.entries):
            function = Function.__new__(Function)
            function.entry = &self.kernels.entry[i]
            name = function.entry.name.decode()
            if max(function.entry.inputs, function.entry.outputs) > DMOC_MOST:
                raise ValueError(f"{name}: more than {DMOC_MOST} inputs or outputs")
            functions[name] = function
        return functions


cdef str _name(dmoc_array array):
    return array.name.decode()


cdef class Function:
    """One kernel as a function of its inputs and then its outputs.

    Inputs are C-contiguous float64 arrays of shape (n, size), or (1, size) where one row serves
    all; outputs are arrays of shape (n, size) that the caller owns.
    """
    cdef const dmoc_entry *entry

    def __call__(self, *arrays):
        cdef Py_buffer views[2 * DMOC_MOST]
        cdef const double *args[DMOC_MOST]
        cdef double *results[DMOC_MOST]
        cdef ptrdiff_t stride[DMOC_MOST]
        cdef ptrdiff_t n = -1, rows, size
        cdef int a, taken = 0, flags
        cdef int inputs = self.entry.inputs, total = inputs + self.entry.outputs
        cdef const dmoc_array *array = self.entry.array
        cdef Py_buffer *view
        if len(arrays) != total:
            name = self.entry.name.decode()
            raise TypeError(f"{name}: expected {total} arrays, got {len(arrays)}")
        try:
            for a in range(total - 1, -1, -1):  # outputs first: they tell the number of rows
                view = &views[taken]
                flags = PyBUF_C_CONTIGUOUS | PyBUF_FORMAT
                if a >= inputs:
                    flags |= PyBUF_WRITABLE
                PyObject_GetBuffer(arrays[a], view, flags)
                taken += 1
                if view.format[0] != c"d" or view.format[1] != 0:
                    raise ValueError(f"{_name(array[a])}: expected float64 values")
                size = array[a].size
                rows = view.len // (8 * size) if size else 0
                if rows * size * 8 != view.len:
                    raise ValueError(f"{_name(array[a])}: expected rows of {size} values")
                if a >= inputs:
                    if size and n < 0:
                        n = rows
                    if size and rows != n:
                        raise ValueError(f"{_name(array[a])}: expected {n} rows, got {rows}")
                    results[a - inputs] = <double *>view.buf
                else:
                    if size and n >= 0 and rows != 1 and rows != n:
                        raise ValueError(f"{_name(array[a])}: expected {n} rows or 1, got {rows}")
                    args[a] = <const double *>view.buf
                    stride[a] = 0 if rows == 1 else size
            if n > 0:
                with nogil:
                    self.entry.kernel(n, args, stride, results)
        finally:
            for a in range(taken):
                PyBuffer_Release(&views[a])

    def rows(self, tuple inputs):
        """Return the outputs (n, size) of rows of inputs, of which a vector or a number is one row;
        a vector is n rows of an input of one value."""
        cdef const dmoc_array *array = self.entry.array
        cdef int a, count = self.entry.inputs
        cdef Py_ssize_t n = 0, size
        if len(inputs) != count:
            name = self.entry.name.decode()
            raise TypeError(f"{name}: expected {count} inputs, got {len(inputs)}")
        arrays = []
        for a in range(count):
            one = ascontiguousarray(inputs[a], float)
            size = array[a].size
            n = max(n, one.size // size if size else len(one) if one.ndim > 1 else 1)
            arrays.append(one)
        results = [empty((n, array[a].size)) for a in range(count, count + self.entry.outputs)]
        self(*arrays, *results)
        return tuple(results)
