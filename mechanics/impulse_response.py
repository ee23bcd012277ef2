"""What impulses do to velocities beside the closed contacts of a mode."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.mechanics.algebra import multipliers
from dmoc.mechanics.conditions import conditions_of
from dmoc.mechanics.contact_mode import Mode
from dmoc.mechanics.model import Model


def held_responses(
    model: Model, holding: Mode, q: Array, B: Array, t: float = 0.0
) -> tuple[Array, Array, Array]:
    """Changes of the velocity (nq, m) by impulses B (m, nq) at a position, where what is closed and
    what sticks hold, and the impulses beside them of surfaces (m, nc) and tangents (m, nt)."""
    model, held = model.in_impact_at(q, t), conditions_of(model, holding, joints=False)
    pushed = model.responses(q, B, t)
    if not len(held):
        return pushed, np.zeros((len(B), model.nc)), np.zeros((len(B), model.nt))
    C = held.slopes(model, q, t)[:, :-1]
    push, along = np.split(
        model.responses(q, np.vstack([held.pushes(model, q, t, C), C]), t), 2, axis=1
    )
    size = np.sqrt(np.maximum(np.diagonal(C @ along), np.finfo(float).tiny))
    times = len(B), 1, 1
    A, sizes = np.tile(C @ push, times), np.tile(size, times[:2])
    forces = held.spread(model, lam := multipliers(A, sizes, -(C @ pushed).T))
    return pushed + push @ lam.T, forces.normal, forces.tangential


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
