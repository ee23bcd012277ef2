"""Entry to the factorisation of symmetric matrices in C (ldl.h)."""

cdef extern from "ldl.h" nogil:
    ctypedef struct dmoc_part:
        int owner, from_ "from", at
    ctypedef struct dmoc_ldl:
        int n, entries, pivots, chain, blocks, positive, negative, zero
        int panel_size, work_size, product_at
        const int *first
        const int *block
        const int *row_start
        const int *row
        const int *part_start
        const dmoc_part *part
        const int *target
        const int *height
        const int *panel_start
        const int *place
        int shares
    dmoc_ldl *dmoc_ldl_new(int n, int pivots, const int *first, const int *start, const int *row)
    dmoc_ldl *dmoc_ldl_like(const dmoc_ldl *analysed)
    void dmoc_ldl_free(dmoc_ldl *f)
    void dmoc_ldl_factor(dmoc_ldl *f, const double *values, double tiny)
    void dmoc_ldl_solve(const dmoc_ldl *f, double *x)


cdef double TINY = 1e-20  # a pivot of so much counts as zero


cdef _copied(const int *array, int size):
    """A copy of an array of integers."""
    return np.array(<const int[:size]>array) if size else np.zeros(0, np.intc)


cdef int _targets(const dmoc_ldl *f):
    """How many targets the last of the parts ends with."""
    cdef int b, last = 0, parts = f.part_start[f.blocks]
    if not parts:
        return 0
    for b in range(f.blocks):
        if f.part_start[b + 1] == parts and f.part_start[b] < parts:
            last = b
    cdef const dmoc_part *part = &f.part[parts - 1]
    return part.at + f.row_start[last + 1] - f.row_start[last] - part.from_


cdef class Factorisation:
    """Factorises symmetric matrices K of one pattern, upper triangle by columns in elimination
    order, and solves with the last one; one that is ``like`` another has its pattern and shares its
    analysis."""
    cdef dmoc_ldl *f
    cdef readonly int size, entries
    cdef Factorisation analysed  # whose analysis it has, if it is not its own

    def __cinit__(
        self, int[::1] first=None, int[::1] start=None, int[::1] row=None, *,
        Factorisation like=None
    ):
        cdef const int *rows
        if like is not None:
            self.size, self.entries, self.analysed = like.size, like.entries, like
            self.f = dmoc_ldl_like(like.f)
        elif first is None or start is None or row is None:
            raise TypeError("expected a pattern, or another factorisation")
        else:
            self.size = start.shape[0] - 1
            self.entries = start[self.size]
            rows = _indices(row, self.entries, "row")
            self.f = dmoc_ldl_new(self.size, first.shape[0] - 1, &first[0], &start[0], rows)
        if self.f == NULL:
            raise MemoryError()

    @property
    def nbytes(self):
        """Bytes of the analysis and of the numbers, about."""
        cdef const dmoc_ldl *f = self.f
        return 8 * (f.panel_size + f.work_size + 3 * f.pivots) + 4 * (
            f.entries + 2 * f.row_start[f.blocks] + 3 * f.part_start[f.blocks]
        )

    def __dealloc__(self):
        dmoc_ldl_free(self.f)

    def analysis(self):
        """The fields of ``dmoc_ldl`` that hold the analysis (ldl.h); parts as rows of integers."""
        cdef const dmoc_ldl *f = self.f
        return {
            "n": f.n, "entries": f.entries, "pivots": f.pivots, "chain": f.chain,
            "blocks": f.blocks, "panel_size": f.panel_size, "work_size": f.work_size,
            "product_at": f.product_at,
            "first": _copied(f.first, f.pivots + 1), "block": _copied(f.block, f.blocks + 1),
            "row_start": _copied(f.row_start, f.blocks + 1),
            "row": _copied(f.row, f.row_start[f.blocks]),
            "part_start": _copied(f.part_start, f.blocks + 1),
            "part": _copied(<const int *>f.part, 3 * f.part_start[f.blocks]),
            "target": _copied(f.target, _targets(f)),
            "height": _copied(f.height, f.blocks + 1),
            "panel_start": _copied(f.panel_start, f.blocks + 2),
            "place": _copied(f.place, f.entries),
        }

    def factor(self, double[::1] values, double tiny=TINY):
        """Factorise; returns the numbers of positive, negative and zero pivots."""
        cdef double none = 0.0
        cdef double *numbers = _numbers(values, self.entries, "values", &none)
        with nogil:
            dmoc_ldl_factor(self.f, numbers, tiny)
        return self.f.positive, self.f.negative, self.f.zero

    def solve(self, double[::1] right):
        """The x of K x = right."""
        cdef double none = 0.0
        cdef double[::1] x = np.array(right)
        dmoc_ldl_solve(self.f, _numbers(x, self.size, "right", &none))
        return np.asarray(x)
