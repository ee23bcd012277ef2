"""Coefficients of restitution of hits in a simulation."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dmoc.base.errors import SimulationError
from dmoc.codegen.kernels import Array
from dmoc.mechanics.model import Model


def hit_coefficients(
    model: Model,
    restitution: Array,
    state: tuple[Array, Array, float],
    hit: NDArray[np.bool_],
) -> Array:
    """Coefficients (nc,) of a state (q, v, t) before hits of some surfaces; 0 for those of the
    model's law that are not hit.

    Raises
    ------
    SimulationError
        If the law of the model creates energy, or is not a number.
    """
    q, v, t = state
    by_law = np.isnan(restitution)
    if not by_law.any():
        return restitution
    e = np.where(by_law & ~hit, 0.0, model.coefficients(restitution, q, v, t))
    for j in np.flatnonzero(~((e >= 0) & (e <= 1))):
        raise SimulationError(wrong_coefficient(model, int(j), e[j], (q, v, t)))
    return np.asarray(e)


def wrong_coefficient(model: Model, j: int, e: float, state: tuple[Array, Array, float]) -> str:
    """A sentence about a coefficient that no law of restitution has, at a state (q, v, t), shapes
    (nq,) and (nq,)."""
    q, v, t = state
    name, speed = model.kernels.surfaces[j], float(model.gap_rates(q, v, t)[j])
    return (
        f"the restitution of {name!r}, {model.kernels.manifest.restitution[name]}, is {e:.6g} "
        f"at an approach of {speed:.6g} at t = {t:.6g} s: expected 0 to 1, more creates energy; "
        "state a law that stays there, or change its parameters."
    )


def several_by_law(model: Model, surfaces: Sequence[int], t: float) -> str:
    """Why several hits at once, of which some have a law of the approach speed, are refused."""
    names = ", ".join(repr(model.kernels.surfaces[j]) for j in surfaces)
    return (
        f"{names} takes part in several hits at once at t = {t:.6g} s, and its restitution depends "
        "on the approach speed, of which each has several then: give it a number, as "
        "restitution=0.5."
    )
