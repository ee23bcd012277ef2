"""Accelerations and forces of contacts and constraints at states of a mode, and what impulses do to
velocities beside what is closed in one.

Forces are what keeps closed contacts closed, what sticks in its place, and the constraints of the
model, equation :eq:`reaction` of the theory.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.mechanics.algebra import multipliers, solved
from dmoc.mechanics.conditions import answers, conditions_of
from dmoc.mechanics.contact_mode import Mode
from dmoc.mechanics.model import Model


def accelerations_and_forces(
    model: Model, mode: Mode, state: tuple[Array, Array, Array, Array]
) -> Array:
    """Rows (a | N | T | R) at n rows of states (q, v, u, t) of a mode, shape (n, model.ny). N are
    of all surfaces, T of all tangents, R of all constraints: zero where something is open, not a
    number where the masses are none."""
    (q, v, u, t), kept = state, conditions_of(model, mode)
    model = model.with_friction_at(q, v, u, t)
    M, F = model.equations(q, v, u, t)
    free = solved(M, F + kept.dragged(model, q, t))
    C = kept.slopes(model, q, t)[..., :-1]
    missing = (C @ free[..., None])[..., 0] + kept.bends(model, q, v, t)
    change, lam = answers(M, C, kept.pushes(model, q, t, C), -missing)
    return np.hstack([free + change, *kept.spread(model, lam)])


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
