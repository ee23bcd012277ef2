"""Impacts on several surfaces at once: corners, flat landings, bodies that touch when one of
them is hit."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dmoc.base.tolerances import SAME
from dmoc.codegen.kernels import Array

# A rate below this share of the rates that the impacts exchange is a rounding error.
NOISE = 1e-11
# Single impacts after which surfaces that lose energy are taken as plastic, and perfectly elastic
# ones are given up.
MOST_IMPACTS = 100
# Sweeps over the surfaces of plastic impacts.
MOST_SWEEPS = 10_000


class Lasting(Exception):  # noqa: N818 - it is caught where the simulation began
    """A motion that stays on a surface, or collisions that accumulate: steps from impact to impact
    do not carry it further."""


def simultaneous(
    gaps: Array,
    tolerance: Array,
    rates: Array,
    size: Array,
    response: Array,
    restitution: Array,
    moment: float,
) -> list[tuple[int, float]] | None:
    """Impulses of the impacts at one moment, in their order, as pairs of surface and impulse.

    Surfaces that are touched and approached get single impacts, lam = (1 + e) gamma / (n . M^-1 n),
    the hardest first, until every one that is touched opens or rests.  Where all of those are
    plastic they act together: lam >= 0, rates after <= 0, one of the two zero; only their sum has a
    meaning, not the momenta between them.

    Parameters
    ----------
    gaps, tolerance : arrays of shape (nc,)
        Gaps g <= 0 and the distances that count as touching.
    rates, size : arrays of shape (nc,)
        dg/dt before the impacts and the size of its terms.
    response : array of shape (nc, nc)
        n_i . M^-1 n_j.
    restitution : array of shape (nc,)
    moment : float
        Time within which surfaces are met at once.

    Returns
    -------
    list of pairs, or None if elastic impacts do not come to an end
    """
    rates, size = rates.copy(), size.copy()
    inertia = np.maximum(np.diag(response), np.finfo(float).tiny)
    impulses: list[tuple[int, float]] = []

    def touched() -> NDArray[np.bool_]:
        return np.asarray(gaps > -(tolerance + moment * np.maximum(rates, 0.0)))

    def strike(j: int, impulse: float) -> None:
        change = response[:, j] * impulse
        np.maximum(size, np.abs(change), out=size)
        np.subtract(rates, change, out=rates)
        impulses.append((j, impulse))

    while (hit := np.logical_and(touched(), rates > NOISE * size)).any():
        if not restitution[touched()].any() or (
            len(impulses) >= MOST_IMPACTS and (restitution[touched()] < 1).any()
        ):
            on = np.flatnonzero(touched())
            for k, impulse in zip(on, plastic(response[np.ix_(on, on)], rates[on]), strict=True):
                if impulse > 0:
                    strike(int(k), float(impulse))
            return impulses
        if len(impulses) >= MOST_IMPACTS:
            return None
        hardness = np.where(hit, rates / np.sqrt(inertia), 0.0)
        j = int(np.flatnonzero(hardness >= (1 - SAME) * hardness.max())[0])
        strike(j, float((1 + restitution[j]) * rates[j] / inertia[j]))
    return impulses


def plastic(response: Array, rates: Array) -> Array:
    """Impulses lam >= 0 after which no rate is positive, and those with an impulse vanish:
    projected Gauss-Seidel sweeps."""
    impulses = np.zeros(len(rates))
    for _ in range(MOST_SWEEPS):
        before = impulses.copy()
        for j in range(len(rates)):
            impulses[j] = max(
                0.0, impulses[j] + (rates[j] - response[j] @ impulses) / response[j, j]
            )
        if np.abs(impulses - before).max() <= np.finfo(float).eps * impulses.max():
            break
    return impulses
