"""What impulses do to velocities where contacts of a mode hold."""

from __future__ import annotations

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.mechanics.contact_mode import Mode
from dmoc.mechanics.model import Model

# Singular values below this share of the largest are those of contacts that say the same twice.
REDUNDANT = 1e-10


def held_responses(
    model: Model, holding: Mode, q: Array, B: Array, t: float = 0.0
) -> tuple[Array, Array]:
    """Changes of the velocity (nq, m) by impulses B (m, nq) at a position, where what is closed and
    what sticks hold, and the impulses of these (held, m)."""
    pushed = model.responses(q, B, t)
    closed = -model.gap_slopes(q, t)[list(holding.closed), :-1]
    C = np.vstack([closed, model.tangent_slopes(q, t)[list(holding.sticking), :-1]])
    if not len(C):
        return pushed, np.zeros((0, len(B)))
    response = model.responses(q, C, t)
    A = C @ response
    if not (np.isfinite(A).all() and np.isfinite(pushed).all()):
        return np.full_like(pushed, np.nan), np.full((len(C), len(B)), np.nan)
    size = np.sqrt(np.maximum(np.diagonal(A), np.finfo(float).tiny))
    inverse = np.linalg.pinv(A / size / size[:, None], rcond=REDUNDANT) / size / size[:, None]
    impulses = -inverse @ (C @ pushed)
    return pushed + response @ impulses, impulses
