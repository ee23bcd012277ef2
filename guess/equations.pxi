"""The equations of motion M q'' = F + B (u - u_0) at one state, around inputs u_0: the rows that no
input enters, and the inputs that come closest to accelerations."""

cdef double SAME_INPUT = 1e-15  # inputs whose singular values differ by this factor act as one


def _block(size):
    return np.zeros((1, size))


cdef class Equations:
    """The equations of motion of one model."""
    cdef readonly int nq, nu
    cdef int silent                                         # rows that no input enters
    cdef Call dynamics, input_matrix
    cdef double[:, ::1] q, v, t, mass, force, B             # of the state that is looked at
    cdef double[::1] root, known_B, rest, inverse          # rest (silent, nq), inverse (nu, nq)
    cdef double[::1] around                                 # u_0
    cdef double[::1] a, u                                   # accelerations and inputs
    cdef double[::1] rows, right, part, solution, work

    def __init__(self, kernels, par, inertia, around):
        cdef int nq = len(kernels.coordinates), nu = len(kernels.inputs), most = max(nq, nu)
        self.nq, self.nu = nq, nu
        q, v, t = (_block(n) for n in (nq, nq, 1))
        self.q, self.v, self.t = q, v, t
        mass, force, B = _block(nq * nq), _block(nq), _block(nq * nu)
        self.mass, self.force, self.B = mass, force, B
        self.around = np.append(around, 0.0)
        state = (q, v, np.array(around)[None], t, par)
        self.dynamics = Call(kernels, "dynamics", state, (mass, force))
        self.input_matrix = Call(kernels, "input_matrix", state, (B,))
        self.root = np.sqrt(inertia)
        self.known_B = np.full(nq * nu + 1, np.nan)
        self.rest, self.inverse = np.empty(nq * nq), np.empty(nu * nq + 1)
        self._forget()
        self.a, self.u = np.empty(nq), np.empty(nu + 1)
        self.rows, self.right, self.part = (np.empty(most * most + 1) for _ in range(3))
        self.solution = np.empty(most * most + 1)
        self.work = np.empty(dmoc_work_size(most, most))

    cdef int look(self, const double *q, const double *v, double t) except -1 nogil:
        """Evaluate them at one state and time."""
        memcpy(&self.q[0, 0], q, self.nq * sizeof(double))
        memcpy(&self.v[0, 0], v, self.nq * sizeof(double))
        self.t[0, 0] = t
        self.dynamics.run()
        self.input_matrix.run()
        cdef size_t bytes = self.nq * self.nu * sizeof(double)
        if memcmp(&self.B[0, 0], &self.known_B[0], bytes):  # B is the same in most states
            memcpy(&self.known_B[0], &self.B[0, 0], bytes)
            self.split()
        return 0

    cdef void _forget(self) noexcept nogil:
        """No input enters any row."""
        cdef int i
        self.silent = self.nq
        for i in range(self.nq * self.nq):
            self.rest[i] = 0.0
        for i in range(self.nq):
            self.rest[i * (self.nq + 1)] = 1 / self.root[i]
        for i in range(self.nu * self.nq):
            self.inverse[i] = 0.0

    cdef void split(self) noexcept nogil:
        """A basis of the rows that no input enters, orthonormal where forces count by the roots
        of the inertias, and the inverse of B by least squares in the same measure."""
        cdef int i, j, nq = self.nq, nu = self.nu
        cdef double length
        self._forget()
        for i in range(nq):
            for j in range(nu):
                self.part[i * nu + j] = self.B[0, i * nu + j] / self.root[i]
                if not isfinite(self.part[i * nu + j]):
                    return
        for j in range(nu):
            length = 0.0
            for i in range(nq):
                length += self.part[i * nu + j] * self.part[i * nu + j]
            self.right[j] = sqrt(length) if length > 0 else 1.0
            for i in range(nq):
                self.part[i * nu + j] /= self.right[j]
        self.silent = max(nq - nu, 0)
        if self.silent:
            dmoc_complement(nq, nu, &self.part[0], &self.rest[0], &self.work[0])
        for i in range(self.silent):
            for j in range(nq):
                self.rest[i * nq + j] /= self.root[j]
        dmoc_pseudo_inverse(nq, nu, &self.part[0], SAME_INPUT, &self.inverse[0], &self.work[0])
        for j in range(nu):
            for i in range(nq):
                self.inverse[j * nq + i] /= self.right[j] * self.root[i]

    cdef double reach(self, const int[::1] prescribed) noexcept nogil:
        """Smallest singular value of the matrix that gives the other accelerations, relative to
        its rows; 1 if there are no others."""
        cdef int r, i, k, others = 0, nq = self.nq
        cdef double square, entry
        for i in range(nq):
            others += not prescribed[i]
        if others == 0:
            return 1.0
        for r in range(self.silent):
            square, k = 0.0, 0
            for i in range(nq):
                entry = self._row_of_mass(r, i) / sqrt(self.mass[0, i * (nq + 1)])
                square += entry * entry
                if not prescribed[i]:
                    self.rows[r * others + k] = entry
                    k += 1
            for k in range(others):
                self.rows[r * others + k] /= sqrt(square)
        if self.silent == others == 1:
            return fabs(self.rows[0])
        return dmoc_smallest_singular(self.silent, others, &self.rows[0], &self.work[0])

    cdef double _row_of_mass(self, int r, int i) noexcept nogil:
        """Entry (r, i) of the rows that no input enters times M."""
        cdef int j
        cdef double total = 0.0
        for j in range(self.nq):
            total += self.rest[r * self.nq + j] * self.mass[0, j * self.nq + i]
        return total

    cdef void accelerate(self, const int[::1] prescribed, const double *wanted,
                         bint free) noexcept nogil:
        """Find the accelerations a: the prescribed ones as wanted and the others from the rows
        without inputs, or the reverse in free motion."""
        cdef int r, i, j, k, count = 0, nq = self.nq, silent = self.silent
        cdef double sum
        for i in range(nq):
            count += (prescribed[i] != 0) == free
            self.a[i] = wanted[i] if prescribed[i] and not free else 0.0
        if count == 0:
            return
        for r in range(silent):
            self.right[r], k = 0.0, 0
            for j in range(nq):
                sum = self.force[0, j]
                if not free:
                    for i in range(nq):
                        if prescribed[i]:
                            sum -= self.mass[0, j * nq + i] * self.a[i]
                self.right[r] += self.rest[r * nq + j] * sum
            for i in range(nq):
                if (prescribed[i] != 0) == free:
                    self.part[r * count + k] = self._row_of_mass(r, i)
                    k += 1
        dmoc_pseudo_inverse(silent, count, &self.part[0], DBL_EPSILON * max(silent, count),
                            &self.solution[0], &self.work[0])
        k = 0
        for i in range(nq):
            if (prescribed[i] != 0) == free:
                for r in range(silent):
                    self.a[i] += self.solution[k * silent + r] * self.right[r]
                k += 1

    cdef void drive(self) noexcept nogil:
        """Find the inputs u that come closest to the accelerations a."""
        cdef int i, j, nq = self.nq
        cdef double sum
        for j in range(self.nu):
            self.u[j] = self.around[j]
        for i in range(nq):
            sum = -self.force[0, i]
            for j in range(nq):
                sum += self.mass[0, i * nq + j] * self.a[j]
            for j in range(self.nu):
                self.u[j] += self.inverse[j * nq + i] * sum

    def control(self, const double[::1] q, tuple prescribed):
        """How well the accelerations of the other coordinates follow from the prescribed ones, at
        rest in q at time 0: the smallest singular value of the matrix that gives them, relative to
        its rows; 1 if there are no others."""
        cdef double[::1] rest = np.zeros(self.nq)
        self.look(&q[0], &rest[0], 0.0)
        return self.reach(self._flags(prescribed))

    def _flags(self, prescribed):
        flags = np.zeros(self.nq, dtype=np.intc)
        flags[list(prescribed)] = 1
        return flags
