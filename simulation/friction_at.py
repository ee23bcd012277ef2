"""The friction that a model has where a simulation is, refused where no law of friction has it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dmoc.base.errors import SimulationError
from dmoc.codegen.kernels import Array
from dmoc.mechanics.coefficients import check_pair
from dmoc.mechanics.contacts import RAIL
from dmoc.mechanics.model import Model

BETTER = "state an expression that stays there, or change inputs and parameters"


def with_friction(model: Model, y: Array, u: Array, t: Array, on: Sequence[int]) -> Model:
    """The model with its friction at rows (q | v), shape (n, 2 nq), u (n, nu) and times (n,).

    Raises
    ------
    SimulationError
        If that of a rail, or of a surface that is touched, is negative or not a number, or its
        static one is below the kinetic one with which it begins to slide.
    """
    if not model.varying_friction:
        return model
    q, v = (np.ascontiguousarray(part) for part in np.split(y[:, : 2 * model.nq], 2, axis=1))
    there = model.with_friction_at(q, v, u, t)
    _check_signs(there, q, t, on)
    pairs = [k for k in _rubbing(model, on) if model.paired[k]]
    if pairs:
        begins = model.with_friction_at(q, u=u, t=t)
        for k in pairs:
            static, kinetic = begins.static_friction[:, k], begins.friction[:, k]
            row = int(np.argmin(static - kinetic))
            name, where = model.kernels.tangents[k], _place(model, q[row], t[row])
            check_pair(name, static[row], kinetic[row], SimulationError, where, BETTER)
    return there


def check_impact(model: Model, q: Array, t: float, on: Sequence[int]) -> None:
    """Refuse an impact on some surfaces whose friction is negative or not a number there."""
    if model.varying_friction:
        _check_signs(model.in_impact_at(q, t), q[None], np.array([t]), on)


def _rubbing(model: Model, on: Sequence[int]) -> list[int]:
    """Tangents of rails and of some surfaces whose friction varies."""
    return [k for k in model.varying_friction if model.supports[k] in (RAIL, *on)]


def _check_signs(model: Model, q: Array, t: Array, on: Sequence[int]) -> None:
    least = np.atleast_2d(np.minimum(model.friction, model.static_friction))
    for k in _rubbing(model, on):
        row = int(np.argmin(least[:, k]))
        if not least[row, k] >= 0:
            raise SimulationError(
                f"the friction of {model.kernels.tangents[k]!r} is {least[row, k]:.6g}"
                f"{_place(model, q[row], t[row])}: expected 0 or a positive number; {BETTER}."
            )


def _place(model: Model, q: Array, t: float) -> str:
    """When and where something is, in words."""
    place = zip(model.kernels.coordinates, q, strict=True)
    return f" at t = {t:.6g} s, " + ", ".join(f"{name} = {x:.6g}" for name, x in place)
