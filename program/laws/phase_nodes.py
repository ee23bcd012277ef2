"""What laws that push along phases have in common: the nodes of the phases, and the terms and
pivots of what is held there."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.program.blocks import NOWHERE, Bools, Index
from dmoc.program.laws.law import AT_REST, CONTACT, Pivot, key
from dmoc.program.layout import Layout
from dmoc.program.reactions import phase_nodes
from dmoc.program.scale import Scale
from dmoc.program.terms import Places, Term

if TYPE_CHECKING:
    from dmoc.program.laws.laws import Laws


@dataclass(frozen=True, eq=False)
class PhaseNodes:
    """The nodes of each phase; those that two phases share come twice.  Where nothing pushes,
    ``used`` is False and there are none."""

    lay: Layout
    used: bool

    @cached_property
    def nodes(self) -> Index:
        return phase_nodes(self.lay.steps)[: None if self.used else 0]

    @cached_property
    def phase(self) -> Index:
        """The phase of each."""
        counts = [n + 1 for n in self.lay.steps] if self.used else [0] * self.lay.phases
        return np.repeat(np.arange(self.lay.phases), counts)

    @cached_property
    def is_first(self) -> Bools:
        return np.diff(self.phase, prepend=-1) > 0

    @cached_property
    def is_last(self) -> Bools:
        return np.diff(self.phase, append=self.lay.phases) > 0

    def along(self, of_phase: Bools) -> Bools:
        """What holds of a phase at each of its nodes."""
        return np.asarray(of_phase[self.phase])

    def places(self, of_phase: Bools, settled: Bools) -> Bools:
        """Nodes at which places are held: those after the first of a phase, and the first of all,
        but for what is ``settled`` at the start and at the end of each phase."""
        held = self.along(of_phase) & ~self.is_first[:, None]
        if len(held):
            held[0] = of_phase[0] & ~settled[0]
            held[self.is_last] &= ~settled[1:]
        return held

    def in_a_step(self, rate: Array, s: Scale) -> Array:
        """How far a place could move in one step: an error of a place is one of the velocity times
        the step, which in a phase that shrinks is far below the sizes of the motion."""
        return np.asarray(rate * s.h[self.phase][:, None])

    def pushes(
        self, kernel: str, impulses: Index, sign: float, places: Places, laws: Laws
    ) -> Iterator[Term]:
        """Impulses in the momenta of their nodes, and in those beside events."""
        lay, momentum = self.lay, laws.step.momentum.index
        q, t, impulse = lay.index_q[self.nodes], places.times(self.nodes), places.known(impulses)
        first, last = self.is_first.copy(), self.is_last.copy()
        first[0] = last[-1] = False  # the ends of the motion have momenta of their own
        for at, rows in (
            (np.ones(len(self.nodes), dtype=bool), momentum[self.nodes]),
            (last, laws.impact.arrival.index),
            (first, laws.impact.departure.index),
        ):
            when = t[at] if lay.timed else t
            rows = rows if len(rows) == at.sum() else rows[at]
            yield Term(kernel, (q[at], impulse[at], when), (rows,), sign)

    def rests(self, kernel: str, rows: Index, places: Places) -> Iterator[Term]:
        """Rates at the start and at the end of each phase, rows of shape (phases + 1, size)."""
        lay, ends = self.lay, self.lay.ends
        for at, v, r in (
            (ends[:1], lay.index_v_B[None], rows[:1]),
            (ends[1:-1], lay.impact.v_a, rows[1:-1]),
            (ends[-1:], lay.index_v_E[None], rows[-1:]),
        ):
            if len(at) and v.size:
                yield Term(kernel, (lay.index_q[at], v, places.times(at)), (r,))

    def pivots(self, impulse: Index, held: Index, rest: Index) -> Iterator[Pivot]:
        """The place of a node determines the impulse of the node before it, the rate at the end of
        a phase that of its last node.  Those of the last node of all are determined through the
        final state, which belongs to the final group, and so do they."""
        nodes, last = self.nodes, self.is_last
        following = np.full_like(held, NOWHERE)
        following[:-1] = held[1:]
        following[last] = NOWHERE
        yield Pivot(impulse, following, key(nodes, CONTACT))
        ends = rest[-self.lay.phases : -1]
        yield Pivot(impulse[last][:-1], ends, key(nodes[last][:-1] - 1, AT_REST))

    def loose(
        self, impulse: Index, in_impacts: Index, follows: Bools
    ) -> Iterator[tuple[Index, Index]]:
        """Impulses of conditions that follow from others in a phase: along the phases, and in
        impacts."""
        at = np.where(self.is_last, key(self.nodes - 1, AT_REST), key(self.nodes, CONTACT))
        at[-1:] = NOWHERE
        chosen = self.along(follows) & (impulse != NOWHERE)
        yield impulse[chosen], np.broadcast_to(at[:, None], impulse.shape)[chosen]
        chosen = follows[1:] & (in_impacts != NOWHERE)
        at = np.broadcast_to(key(self.lay.collision_nodes, AT_REST)[:, None], chosen.shape)
        yield in_impacts[chosen], at[chosen]


def ends_of_phases(held: Bools, settled: Bools, more: Bools | None = None) -> Bools:
    """Where rates vanish: at the start and at the end of each phase, shape (phases + 1, size), of
    what is ``held`` in it, and ``more``, but for those that are ``settled`` at both ends of the
    motion."""
    ends = np.vstack([held[:1] & ~settled[0], held if more is None else held | more])
    ends[-1] &= ~settled[1]
    return ends


def end_of_phase(i: int) -> str:
    """The start of a motion, or the end of a phase before it."""
    return f"at the end of phase {i - 1}" if i else "at the start"
