"""Where the equations F(z) = 0 of a symmetric Jacobian K have exactly one solution (R. Krawczyk,
Computing 4, 1969; S. M. Rump, Acta Numerica 19, 2010, section 13).

With R about the inverse of K(z) and balls of radii r around z, every K of these balls has
|1 - R K| <= G.  If |R F(z)| + G r < r, there is exactly one solution in the balls, all these K are
regular, and the solution lies within |R F(z)| + G r of z.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.proving.factorisation import SignedFactors, lost_of

Matrix = Any  # of SciPy, sparse

COLUMNS = 256  # of the inverse that are worked on at a time
# The radii begin at so many times |R F|; where some are too small, all are that many times what
# they should be, so often: those that are too large shrink, or the others would grow with them.
BEGIN, ENLARGED, TRIALS = 2.0, 1.2, 12
# More than what rounding to single precision takes away of a number, and the least one.
SINGLE, LEAST = 1e-6, 1e-37


class Inverse:
    """About the inverse R of a symmetric K, whose whole is given, and how good it is."""

    def __init__(self, K: Matrix, factors: SignedFactors) -> None:
        self.size = K.shape[0]
        self.columns = factors.solve(np.eye(self.size))
        # |1 - K R'| with its rounding errors, in single precision to save memory.
        self.off = np.empty((self.size, self.size), np.float32)
        sizes, lost = abs(K), lost_of(int(np.diff(K.indptr).max(initial=0)))
        for first in range(0, self.size, COLUMNS):
            own = self.columns[:, first : first + COLUMNS]
            off = K @ own
            at = np.arange(own.shape[1])
            off[first + at, at] -= 1.0
            off = np.abs(off) * (1 + lost) + lost * (sizes @ np.abs(own))
            self.off[:, first : first + COLUMNS] = off * (1 + SINGLE) + LEAST
        self._lost = 1 + lost_of(self.size)

    def times(self, sizes: Array) -> Array:
        """More than |R| s of sizes s."""
        return np.asarray(sizes @ np.abs(self.columns) * self._lost)

    def errors(self, sizes: Array) -> Array:
        """More than |1 - R K| s of sizes s."""
        return np.asarray(sizes @ self.off * self._lost)

    @property
    def norm(self) -> float:
        """More than the 2-norm of the inverse of K, which is symmetric; infinite where it is not
        known to have one."""
        ones = np.ones(self.size)
        left = 1 - float(self.errors(ones).max(initial=0.0)) * (1 + lost_of(8))
        most = float(self.times(ones).max(initial=0.0)) * (1 + lost_of(8))
        return most / left if left > 0 else np.inf


def radii(inverse: Inverse, F: Array, variation: Callable[[Array], Matrix]) -> Array | None:
    """Radii within which there is exactly one solution; None where there are none.

    F: more than |F(z)|.  variation: of radii, how far K(z) and all K in these balls are from the K
    of the inverse.
    """
    first = inverse.times(F)
    r = BEGIN * first
    for _ in range(TRIALS):
        needed = first + inverse.errors(r) + inverse.times(r @ variation(r))
        needed *= 1 + lost_of(8)
        if (needed < r).all():
            return needed
        if not np.isfinite(needed).all():
            return None
        r = ENLARGED * needed
    return None
