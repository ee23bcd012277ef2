"""What impulses do to velocities beside the closed contacts of a mode."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.mechanics.contact_mode import Mode
from dmoc.mechanics.model import Model

# Singular values below this share of the largest are those of contacts that say the same twice.
REDUNDANT = 1e-10


def held_responses(
    model: Model, holding: Mode, q: Array, B: Array, t: float = 0.0
) -> tuple[Array, Array, Array]:
    """Changes of the velocity (nq, m) by impulses B (m, nq) at a position, where what is closed and
    what sticks hold, and the impulses beside them of surfaces (m, nc) and tangents (m, nt)."""
    model = model.in_impact_at(q, t)
    pushed, count = model.responses(q, B, t), len(holding.closed)
    normal, tangential = np.zeros((len(B), model.nc)), np.zeros((len(B), model.nt))
    if not count:
        return pushed, normal, tangential
    along = model.tangent_slopes(q, t)[:, :-1]
    pushes = -model.gap_slopes(q, t)[:, :-1]
    C = np.vstack([pushes[list(holding.closed)], along[list(holding.sticking)]])
    for k, s in holding.sliding:
        pushes[model.supports[k]] -= s * model.friction[k] * along[k]
    D = np.vstack([pushes[list(holding.closed)], C[count:]])
    response = model.responses(q, np.vstack([C, D]), t)
    A = C @ response
    if not (np.isfinite(A).all() and np.isfinite(pushed).all()):
        return np.full_like(pushed, np.nan), normal + np.nan, tangential + np.nan
    squares, A = np.split(A, 2, axis=1)
    size = np.sqrt(np.maximum(np.diagonal(squares), np.finfo(float).tiny))
    inverse = np.linalg.pinv(A / size / size[:, None], rcond=REDUNDANT) / size / size[:, None]
    impulses = -inverse @ (C @ pushed)
    normal[:, list(holding.closed)] = impulses[:count].T
    tangential[:, list(holding.sticking)] = impulses[count:].T
    for k, s in holding.sliding:
        tangential[:, k] = -s * model.friction[k] * normal[:, model.supports[k]]
    return pushed + response[:, len(C) :] @ impulses, normal, tangential


def unknown_in_impacts(model: Model, tangents: Iterable[int]) -> str:
    """Why friction of some tangents has no part in an impact; empty where it has."""
    for k in tangents:
        row, name = model.varying_friction.get(k, {}), model.kernels.tangents[k]
        if row.get("inputs"):
            return (
                f"the friction of {name!r} depends on inputs, which have no value of their own in "
                "an impact, where they may jump"
            )
        if row.get("velocities"):
            return (
                f"the friction of {name!r} depends on the sliding speed, which changes within an "
                "impact"
            )
    return ""
