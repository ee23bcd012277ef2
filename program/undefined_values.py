"""Where a program says nothing: a singular mass matrix, or values that are no numbers."""

from __future__ import annotations

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.program.transcription import Transcription

# Smallest eigenvalue of a mass matrix, relative to the inertias at the start, below which it counts
# as singular.
SINGULAR = 1e-6


def singular_at(nlp: Transcription, x: Array) -> float | None:
    """First time in seconds at which the mass matrix at the scaled unknowns x, shape (n,), is not
    positive definite, up to rounding errors of its entries; None if it is everywhere."""
    nlp, y = nlp.designed(x), nlp.physical(x)
    q, t = y[nlp.layout.index_q], nlp.layout.times(y)
    root = 1 / np.sqrt(np.abs(nlp.problem.inertia))
    phases = np.append(nlp.layout.phase_of_step, nlp.layout.phases - 1)
    mass = nlp.problem.models.along(phases).mass(q, t)
    scaled = mass * root[:, None] * root
    good = np.array(np.isfinite(scaled).all(axis=(1, 2)))
    good[good] = np.linalg.eigvalsh(scaled[good])[:, 0] > SINGULAR
    return None if good.all() else float(t[int(np.argmin(good))])


def undefined_at(nlp: Transcription, x: Array) -> str:
    """The first one of the cost, the constraints and their first derivatives that is no finite
    number at the scaled unknowns x, shape (n,), in words; empty where all are."""
    if not np.isfinite(x).all():
        return ""
    with np.errstate(all="ignore"):
        values, slopes = nlp.values(x), nlp.slopes(x)
    for k in np.flatnonzero(~np.isfinite(values))[:1]:
        return _named(nlp, int(k) - 1)
    for k in np.flatnonzero(~np.isfinite(slopes))[:1]:
        row, unknown = -1, int(k)
        if k >= nlp.n:
            pattern = nlp.assembled.jacobian
            row = int(np.searchsorted(pattern.indptr, k - nlp.n, side="right")) - 1
            unknown = int(pattern.indices[k - nlp.n])
        return f"the derivative of {_named(nlp, row)} in {nlp.layout.names()[unknown]}"
    return ""


def _named(nlp: Transcription, row: int) -> str:
    """A row of (c | d) in the user's words; -1 is the cost."""
    for block in (*nlp.equalities, *nlp.inequalities):
        if block.count and block.numbers[0] <= row <= block.numbers[-1]:
            return f"the row {block.name_of(row - int(block.numbers[0]))!r}"
    return "the cost"
