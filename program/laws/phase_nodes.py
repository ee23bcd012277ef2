"""What laws that push along phases have in common: the stations of the impulses, and the terms and
pivots of what is held there."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from dmoc.base.records import record
from dmoc.codegen.kernels import Array
from dmoc.program.blocks import NOWHERE, Bools, Index
from dmoc.program.laws.law import AT_REST, CONTACT, Pivot, key
from dmoc.program.layout import Layout
from dmoc.program.scale import Scale
from dmoc.program.stations import Stations
from dmoc.program.terms import Places, Term

if TYPE_CHECKING:
    from dmoc.program.laws.laws import Laws


@record(frozen=True, eq=False)
class PhaseNodes:
    """The stations of a motion.  Where nothing pushes, ``used`` is False and there are none."""

    lay: Layout
    used: bool

    @cached_property
    def at(self) -> Stations:
        return self.lay.stations if self.used else Stations((), self.lay.scheme)

    def along(self, of_phase: Bools) -> Bools:
        """Values of the stations, shape (rows, size), from those of their phases, shape (phases,
        size)."""
        return np.asarray(of_phase[self.at.phase])

    def state(self, places: Places) -> tuple[Index, Index]:
        """Unknown coordinates and times of the stations, shapes (rows, nq) and (rows, 1)."""
        return self.lay.index_places[self.at.place], places.times_of(self.at.place)

    def places(self, of_phase: Bools, settled: Bools) -> Bools:
        """Stations at which places are held, shape (rows, size), of what is held in each phase,
        shape (phases, size). Those where something has ended before have no rows, nor has what is
        ``settled``, shape (phases + 1, size), at the start and at the end of each phase."""
        held = self.along(of_phase) & ~self.at.begins[:, None]
        if len(held):
            held[0] = of_phase[0] & ~settled[0]
            held[self.at.is_last] &= ~settled[1 : self.lay.stepped + 1]
        return held

    def rates(self, of_phase: Bools, at_ends: Bools) -> Bools:
        """Nodes at which rates vanish, shape (total + 1, size): the start and the end of each phase
        where ``at_ends`` says so, and those that phases pass in which they are held."""
        lay = self.lay
        held = np.zeros((lay.total + 1, of_phase.shape[1]), dtype=bool)
        held[:-1] = of_phase[lay.phase_of_step] & (lay.index_w[:-1, :1] != NOWHERE)
        own = slice(lay.stepped + 1)
        held[lay.ends[own]] = at_ends[own]
        return held

    def in_a_step(self, rate: Array, s: Scale) -> Array:
        """How far a place could move in one step: an error of a place is one of the velocity times
        the step, which in a phase that shrinks is far below the sizes of the motion."""
        return np.asarray(rate * s.h[self.at.phase][:, None])

    def pushes(
        self, kernel: str, impulses: Index, sign: float, places: Places, laws: Laws
    ) -> Iterator[Term]:
        """Impulses, unknowns of shape (rows, size), in the equations of their places, and in those
        beside events."""
        lay, (q, t), impulse = self.lay, self.state(places), places.or_zero(impulses)
        first, last = self.at.is_first.copy(), self.at.is_last.copy()
        first[0] = False  # the ends of the motion have momenta of their own
        last[-1] = lay.ends_with_event
        for at, rows in (
            (np.ones(len(q), dtype=bool), self._equations(laws)),
            (last, laws.impact.arrival.index),
            (first, laws.impact.departure.index),
        ):
            when = t[at] if lay.timed else t
            rows = rows[at] if len(rows) == len(at) else rows[: at.sum()]
            yield Term(kernel, (q[at], impulse[at], when), (rows,), sign)

    def _equations(self, laws: Laws) -> Index:
        """Rows of the momenta at the stations, or of the equations of motion inside steps."""
        lay, step = self.lay, laws.step
        inside = step.inside.index.reshape(lay.total, lay.inside, lay.nq)
        starts = np.concatenate([step.momentum.index[:-1, None], inside], axis=1)
        by_place = np.vstack([starts.reshape(-1, lay.nq), step.momentum.index[-1:]])
        ends = step.reached[self.at.place[self.at.ends] // lay.scheme.degree]
        rows = by_place[self.at.place]
        rows[self.at.ends] = ends
        return rows

    def rests(self, kernel: str, rows: Index, places: Places) -> Iterator[Term]:
        """Rates at nodes, in rows of shape (total + 1, size)."""
        v = self.lay.velocities
        (at,) = np.nonzero((rows != NOWHERE).any(axis=1) & (v[:, 0] != NOWHERE))
        if len(at):
            yield Term(kernel, (self.lay.index_q[at], v[at], places.times(at)), (rows[at],))

    def pivots(self, impulse: Index, held: Index, rest: Index) -> Iterator[Pivot]:
        """Places determine the impulses of the stations before them, rates those at the ends of
        phases and of steps. Impulses at the last node of all belong to the final group, as the
        final state does. ``impulse`` and ``held`` have the shape (rows, size), ``rest`` (total + 1,
        size)."""
        at, d = self.at, self.lay.scheme.degree
        following = later(held)
        following[at.ends] = NOWHERE
        yield Pivot(impulse, following, key(at.place // d, CONTACT))
        (ends,) = np.nonzero(at.ends[: len(at.ends) - self._left_over])
        nodes = at.place[ends] // d
        yield Pivot(impulse[ends], rest[nodes], key(nodes - 1, AT_REST))

    @property
    def _left_over(self) -> int:
        """How many stations the final state determines: the last one, but where an event is there
        and has a velocity before it."""
        return 0 if self.lay.ends_with_event else 1

    def loose(
        self, impulse: Index, in_impacts: Index, follows: Bools
    ) -> Iterator[tuple[Index, Index]]:
        """Impulses, shape (rows, size), of conditions that follow from others in a phase, shape
        (phases, size): along the phases, and in impacts, shape (events, size). Yields unknowns and
        their places in the chain, as :meth:`~dmoc.program.laws.law.Law.loose`, shape (k,) each."""
        node = self.at.place // self.lay.scheme.degree
        at = np.where(self.at.ends, key(node - 1, AT_REST), key(node, CONTACT))
        at[len(at) - self._left_over :] = NOWHERE
        chosen = self.along(follows) & (impulse != NOWHERE)
        yield impulse[chosen], np.broadcast_to(at[:, None], impulse.shape)[chosen]
        chosen = follows[1:] & (in_impacts != NOWHERE)
        at = np.broadcast_to(key(self.lay.collision_nodes, AT_REST)[:, None], chosen.shape)
        yield in_impacts[chosen], at[chosen]


def later(rows: Index) -> Index:
    """Rows of the next station at each one, NOWHERE at the last, shape (rows, size)."""
    following = np.full_like(rows, NOWHERE)
    following[:-1] = rows[1:]
    return following


def ends_of_phases(held: Bools, settled: Bools, more: Bools | None = None) -> Bools:
    """Where rates vanish: at the start and at the end of each phase, shape (phases + 1, size), of
    what is ``held`` in it, and ``more``, but for those that are ``settled`` at both ends of the
    motion."""
    ends = np.vstack([held[:1] & ~settled[0], held if more is None else held | more])
    ends[-1] &= ~settled[1]
    return ends


def end_of_phase(lay: Layout, node: int) -> str:
    """A node in words: the start of a motion, the end of a phase before it, or one inside."""
    if node not in lay.ends:
        return f"at node {node}"
    phase = int(np.searchsorted(lay.ends, node)) - 1
    return f"at the end of phase {phase}" if node else "at the start"
