# cython: language_level=3
"""The kernels of a model as Cython sees them (dmoc_kernel.h)."""
from cpython.pycapsule cimport PyCapsule_GetPointer

cdef extern from "dmoc_kernel.h" nogil:
    const char *DMOC_TABLE
    enum: DMOC_MOST
    ctypedef void dmoc_kernel(ptrdiff_t n, const double *const *args, const ptrdiff_t *stride,
                              double *const *results)
    ctypedef struct dmoc_array:
        const char *name
        ptrdiff_t size
    ctypedef struct dmoc_entry:
        const char *name
        dmoc_kernel *kernel
        int inputs, outputs
        const dmoc_array *array
    ctypedef struct dmoc_table:
        const char *model
        const char *code
        int entries
        const dmoc_entry *entry
    const dmoc_entry *dmoc_find(const dmoc_table *table, const char *name)


cdef inline const dmoc_entry *find_kernel(object library, str name) except NULL:
    """The kernel of a model's library."""
    cdef const dmoc_table *table
    cdef const dmoc_entry *entry
    table = <const dmoc_table *>PyCapsule_GetPointer(library.table, DMOC_TABLE)
    entry = dmoc_find(table, name.encode())
    if entry == NULL:
        raise KeyError(name)
    return entry
