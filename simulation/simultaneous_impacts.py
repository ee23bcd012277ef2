"""Impacts on several surfaces at once: corners, flat landings, bodies that touch when one of
them is hit."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dmoc.base.records import record
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


@record(frozen=True, eq=False)
class Impacts:
    """Impulses of the impacts at one moment, in their order, as pairs of surface and impulse. Where
    the order decides, ``orders`` has the surfaces that may be hit first, each with the sums of
    impulses (nc,) that then follow."""

    impulses: list[tuple[int, float]]
    orders: tuple[tuple[int, Array], ...] = ()


def simultaneous(
    gaps: Array,
    tolerance: Array,
    rates: Array,
    size: Array,
    response: Array,
    restitution: Array,
    moment: float,
) -> Impacts | None:
    """The impacts at one moment; None if elastic ones do not come to an end.

    Surfaces that are touched and approached get single impacts, lam = (1 + e) gamma / (n . M^-1 n),
    the hardest first, until every one that is touched opens or rests.  Where all of those are
    plastic they act together: lam >= 0, rates after <= 0, one of the two zero; only their sum has a
    meaning, not the momenta between them.  If it makes a difference which of several is hit first,
    they are all compressed together, in the same way, and released with e times their impulses:
    what is symmetric before stays so.

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
    """
    at = _Moment(gaps, tolerance, response, restitution, moment)
    in_turn = at.in_turn(rates, size)
    hit = np.flatnonzero(at.hit(rates, size)).tolist()
    if in_turn is None or len(hit) < 2:
        return None if in_turn is None else Impacts(in_turn)
    ways = [(j, at.in_turn(rates, size, j)) for j in hit]
    orders = tuple((j, at.sums(way)) for j, way in ways if way is not None)
    whole = at.sums(in_turn)
    if all(at.energy(sums - whole) <= SAME**2 * at.energy(whole) for _, sums in orders):
        return Impacts(in_turn)
    return Impacts(at.together(rates, size), orders)


@record(frozen=True, eq=False)
class _Moment:
    """The data of the impacts at one moment, as in :func:`simultaneous`."""

    gaps: Array
    tolerance: Array
    response: Array
    restitution: Array
    moment: float

    def touched(self, rates: Array) -> NDArray[np.bool_]:
        """Surfaces that are touched, shape (nc,), at rates (nc,)."""
        near = self.tolerance + self.moment * np.maximum(rates, 0.0)
        return np.asarray(self.gaps > -near)

    def hit(self, rates: Array, size: Array) -> NDArray[np.bool_]:
        """Surfaces that are touched and approached, shape (nc,), at rates and sizes (nc,)."""
        return np.logical_and(self.touched(rates), rates > NOISE * size)

    def sums(self, impulses: list[tuple[int, float]]) -> Array:
        """The impulses of all surfaces (nc,)."""
        whole = np.zeros(len(self.gaps))
        for j, impulse in impulses:
            whole[j] += impulse
        return whole

    def energy(self, impulses: Array) -> float:
        """Twice the kinetic energy that impulses (nc,) give to bodies at rest."""
        return float(impulses @ self.response @ impulses)

    def in_turn(
        self, rates: Array, size: Array, first: int | None = None
    ) -> list[tuple[int, float]] | None:
        """Impacts one after the other, from the surface that is hit ``first`` on, at rates and
        sizes (nc,)."""
        rates, size, e = rates.copy(), size.copy(), self.restitution
        inertia = np.maximum(np.diag(self.response), np.finfo(float).tiny)
        impulses: list[tuple[int, float]] = []

        def strike(j: int, impulse: float) -> None:
            change = self.response[:, j] * impulse
            np.maximum(size, np.abs(change), out=size)
            np.subtract(rates, change, out=rates)
            impulses.append((j, impulse))

        if first is not None:
            strike(first, float((1 + e[first]) * rates[first] / inertia[first]))
        while (hit := self.hit(rates, size)).any():
            touched = self.touched(rates)
            if not e[touched].any() or (len(impulses) >= MOST_IMPACTS and (e[touched] < 1).any()):
                for j, impulse in self.plastic(rates):
                    strike(j, impulse)
                return impulses
            if len(impulses) >= MOST_IMPACTS:
                return None
            hardness = np.where(hit, rates / np.sqrt(inertia), 0.0)
            j = int(np.flatnonzero(hardness >= (1 - SAME) * hardness.max())[0])
            strike(j, float((1 + e[j]) * rates[j] / inertia[j]))
        return impulses

    def plastic(self, rates: Array) -> list[tuple[int, float]]:
        """The impulses after which no touched surface is approached, at rates (nc,)."""
        on = np.flatnonzero(self.touched(rates))
        pushes = plastic(self.response[np.ix_(on, on)], rates[on])
        return [(int(k), float(push)) for k, push in zip(on, pushes, strict=True) if push > 0]

    def together(self, rates: Array, size: Array) -> list[tuple[int, float]]:
        """Impacts on all touched surfaces at once, at rates and sizes (nc,)."""
        whole = (1 + self.restitution) * self.sums(self.plastic(rates))
        left = rates - self.response @ whole
        whole += self.sums(self.plastic(np.where(left > NOISE * size, left, np.minimum(left, 0.0))))
        return [(int(j), float(whole[j])) for j in np.flatnonzero(whole > 0)]


def plastic(response: Array, rates: Array) -> Array:
    """Impulses lam >= 0, shape (k,), after which no rate is positive, and those with an impulse
    vanish: projected Gauss-Seidel sweeps. ``response`` is (k, k), ``rates`` (k,)."""
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
