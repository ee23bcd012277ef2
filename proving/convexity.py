"""Whether a cost of inputs is convex, in exact fractions."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from dmoc.base.errors import ProblemError
from dmoc.codegen.kernels import Array
from dmoc.proving.recognition import SAME_VALUE


def check_convex(R: Array, beside_states: bool) -> None:
    """Refuse the matrix of a cost u R u/2, shape (nb, nb), that falls in some direction, or that
    does not bend in one which belongs to several inputs; ``beside_states`` says that R is what
    squares of them and states leave."""
    curved = np.diag(R) != 0
    bent = R[np.ix_(curved, curved)]
    sizes = np.sqrt(np.abs(np.diag(bent)))
    least = np.linalg.eigvalsh(bent / np.outer(sizes, sizes)).min(initial=1.0)
    if least < -SAME_VALUE or R[~curved].any():
        of = "positions, velocities and inputs together" if beside_states else "the inputs"
        raise ProblemError(f"the cost is not convex in {of}: proofs need one that is.")
    if least <= SAME_VALUE or not is_positive_definite(bent):
        raise ProblemError(
            "the cost is the same for several combinations of its inputs: proofs need a cost of "
            "each, such as a small multiple of its square."
        )


def is_positive_definite(matrix: Array) -> bool:
    """Whether a symmetric matrix is that, by its exact factors L D L^T."""
    A = [[Fraction(x) for x in row] for row in matrix.tolist()]
    for k, row in enumerate(A):
        if row[k] <= 0:
            return False
        for i in range(k + 1, len(A)):
            share = A[i][k] / row[k]
            A[i] = [a - share * b for a, b in zip(A[i], row, strict=True)]
    return True
