"""What holds a motion back: inequalities and bounds that are active, as data that read as text."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.program.blocks import NOWHERE
from dmoc.program.bound_kinds import BoundKind
from dmoc.program.transcription import Transcription

# A multiplier this small holds nothing back, and an impulse this small is none.
NO_FORCE = 1e-7
NO_IMPULSE = 1e-6
# Bounds are named in this order.
IN_ORDER = {kind: i for i, kind in enumerate(BoundKind)}
# Unknowns at ends and events, and totals, that a problem bounds.
STATED = ("p_B", "p_E", "v_B", "v_E", "v_a", "v_c", "totals", "design")


@dataclass(frozen=True, eq=False, repr=False)
class ActiveBound(str):
    """A bound or an inequality that holds a motion back; it is the text that says so.

    Attributes
    ----------
    kind : BoundKind
    name : str
        The input, coordinate, surface or path constraint, the number of the phase, number and
        surface of the collision; of others the whole text.
    side : str
        ">=" or "<=" of a bound.
    value : float or None
        Where the bound is.
    places : int
        Steps or nodes in which it holds.
    """

    kind: BoundKind
    name: str
    side: str = ""
    value: float | None = None
    places: int = 0

    def __new__(
        cls, kind: BoundKind, name: str, side: str = "", value: float | None = None, places: int = 0
    ) -> ActiveBound:
        number = "" if value is None else f"{value:g}"
        plural = "s" * (places > 1)
        text = kind.value.format(name=name, side=side, value=number, places=places, s=plural)
        return super().__new__(cls, text)

    def __getnewargs__(self) -> tuple[BoundKind, str, str, float | None, int]:  # type: ignore[override]
        return self.kind, self.name, self.side, self.value, self.places


def active_bounds(nlp: Transcription, x: Array, w: Array, z: Array) -> tuple[ActiveBound, ...]:
    """Name the inequalities and bounds that hold x, shape (n,), back: those whose multipliers w,
    shape (n_in,), and z, shape (n,), lie above the distance; many of a kind are counted."""
    return (*_inequalities(nlp, x, w), *_bounds(nlp, x, z), *_impulses(nlp, x))


def _inequalities(nlp: Transcription, x: Array, w: Array) -> Iterator[ActiveBound]:
    nodes = dict[tuple[BoundKind, str], set[int]]()
    holds = w > np.maximum(nlp.inequality(x), NO_FORCE)
    for block in nlp.inequalities if holds.any() else ():
        active = holds[block.numbers - nlp.n_eq].nonzero()[0]
        if not len(active):
            continue
        if block.counted is None:
            nodes |= {(BoundKind.OTHER, block.name_of(int(i))): set() for i in active}
            continue
        kind, names, at = block.counted
        for row, column, *_ in block.places[active]:
            name = names[column % len(names)]  # once for each quadrature point
            if name:  # else it is that of a hidden unknown
                nodes.setdefault((kind, name), set()).add(int(at[row]))
    for (kind, name), where in nodes.items():
        yield ActiveBound(kind, name, places=len(where))


def _bounds(nlp: Transcription, x: Array, z: Array) -> Iterator[ActiveBound]:
    lay = nlp.layout
    with np.errstate(invalid="ignore"):
        free = nlp.lower < nlp.upper
        below = free & (z > np.maximum(x - nlp.lower, NO_FORCE))
        above = free & (-z > np.maximum(nlp.upper - x, NO_FORCE))
    both = (">=", nlp.limits[0], below), ("<=", nlp.limits[1], above)
    ends = [(side, limit, active) for side, limit, active in both if active.any()]
    if not ends:
        return
    for i, k in enumerate(lay.index_h):
        for side, limit, active in ends:
            if active[k]:
                yield ActiveBound(BoundKind.DURATION, str(i), side, float(limit[k] * lay.steps[i]))
    counted = [(*b.counted, b.index) for b in lay.unknowns if b.counted]
    for kind, names, at, index in sorted(counted, key=lambda c: IN_ORDER[c[0]]):
        for j, name in enumerate(names):
            for side, limit, active in ends:
                rows = np.flatnonzero(active[index[:, j]])
                places = {(float(limit[index[k, j]]), int(at[k])) for k in rows}
                for value, count in sorted(Counter(value for value, _ in places).items()):
                    yield ActiveBound(kind, name, side, value, count)
    for block in lay.unknowns:
        if block.name in STATED:
            for i, k in enumerate(block.numbers):
                for side, limit, active in ends:
                    if active[k]:
                        yield ActiveBound(
                            BoundKind.OTHER, f"{block.name_of(i)} {side} {limit[k]:g}"
                        )


def _impulses(nlp: Transcription, x: Array) -> Iterator[ActiveBound]:
    lay = nlp.layout
    for i, (k, event) in enumerate(zip(lay.impact.lam, lay.touch.events, strict=True)):
        if event.hit != NOWHERE and x[k] <= NO_IMPULSE:
            yield ActiveBound(BoundKind.IMPULSE, f"{i + 1} ({nlp.problem.sequence[i]})")
