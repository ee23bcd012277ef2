"""Accelerations and forces of contacts and constraints at states of a mode.

They are what keeps closed contacts closed, what sticks in its place, and the constraints of the
model, equation :eq:`reaction` of the theory.
"""

from __future__ import annotations

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.mechanics.algebra import solved
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
