"""Impacts on several surfaces at one moment of which the order decides: what each order makes of
them, in words."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from dmoc.base.names import velocity_name
from dmoc.base.records import record
from dmoc.base.tolerances import ROUNDING, SAME
from dmoc.codegen.kernels import Array
from dmoc.mechanics.model import Model
from dmoc.simulation.simultaneous_impacts import Impacts

MOST_SHOWN = 4  # surfaces that may be hit first


@record(frozen=True, eq=False)
class Undecided:
    """A moment at which several surfaces are hit, whose order decides: the velocity (nq,) with
    which the motion goes on, and those that there would be with one of them hit first."""

    time: float
    taken: Array
    orders: tuple[tuple[int, Array], ...]


def undecided_of(model: Model, state: tuple[Array, Array, float], impacts: Impacts) -> Undecided:
    """The moment of impacts without friction in a state (q, v, t)."""
    q, v, t = state
    changes = model.responses(q, model.gap_slopes(q, t)[:, :-1], t)
    whole = np.zeros(model.nc)
    for j, impulse in impacts.impulses:
        whole[j] += impulse
    orders = tuple((j, v - changes @ sums) for j, sums in impacts.orders)
    return Undecided(t, v - changes @ whole, orders)


def notes_of(model: Model, moments: Sequence[Undecided]) -> Iterator[str]:
    """Notes on what the order of impacts decides, the first time for each set of surfaces."""
    by_surfaces: dict[tuple[int, ...], list[Undecided]] = {}
    for at in moments:
        by_surfaces.setdefault(tuple(j for j, _ in at.orders), []).append(at)
    names = model.kernels.surfaces
    for hit, (at, *more) in by_surfaces.items():
        ways = [("", at.taken), *((f"{names[j]!r} first: ", v) for j, v in at.orders[:MOST_SHOWN])]
        told = "; ".join(f"{way}{rates}" for way, rates in _shown(model, ways))
        often = f", and {len(more)} {'times' if len(more) > 1 else 'time'} more" if more else ""
        yield (
            f"{' and '.join(repr(names[j]) for j in hit)} are hit at once at t = {at.time:.6g} s"
            f"{often}, and which comes first decides; taken together they leave {told}"
        )


def _shown(model: Model, ways: list[tuple[str, Array]]) -> Iterator[tuple[str, str]]:
    """The velocities that differ between ways, in words."""
    rates = np.array([v for _, v in ways])
    size = np.abs(rates).max()
    rates = np.where(np.abs(rates) > ROUNDING * size, rates, 0.0)
    differ = np.flatnonzero(np.ptp(rates, axis=0) > SAME * size).tolist()
    for (way, _), row in zip(ways, rates, strict=True):
        shown = (f"{velocity_name(model.kernels.coordinates[i])} = {row[i]:.4g}" for i in differ)
        yield way, ", ".join(shown)
