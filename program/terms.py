"""The physics of the program as a table of terms: which kernel, on which arguments, enters which
rows.

A term is n rows of a kernel family; its values, first and second derivatives follow from the family
(:mod:`dmoc.program.elements`).  Arguments are positions in the pool (:mod:`dmoc.program.arrays`):
those below the number of unknowns are the unknowns that the term depends on.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from dmoc.base.discretisation import DISCRETISATIONS, Discretisation
from dmoc.base.records import record
from dmoc.codegen.kernels import Array
from dmoc.program.blocks import NOWHERE, Index
from dmoc.program.layout import Layout

# Slopes of a parabola at three nodes of distance 1, from its values there.
PARABOLA = DISCRETISATIONS[4].slopes_of_nodes / 2
# The row of the cost.
COST = -2


@record(frozen=True, eq=False)
class Term:
    """Results of n rows of a kernel times a factor are added to rows.

    Attributes
    ----------
    kernel : str
    arguments : tuple of positions, shape (n, size) or (1, size)
        Those before the parameters.
    rows : tuple of arrays of int, shape (n, size)
        For each result, the rows of (c | d) that its components enter; COST for the cost, NOWHERE
        for none.
    factor : float or array of shape (n, 1)
        In a form, where it stands among the factors of all (:func:`apart`).
    phase : array of int, shape (n,) or (1,)
        The phase whose parameters each row takes; without any it follows from the arguments
        (:meth:`~dmoc.program.layout.Layout.phase_of_rows`) where parameters change.
    """

    kernel: str
    arguments: tuple[Index, ...]
    rows: tuple[Index, ...]
    factor: Array | Index | float = 1.0
    phase: Index | None = None

    def in_phases(self, lay: Layout) -> Term:
        """The same term with its phases."""
        if self.phase is not None:
            return self
        return replace(self, phase=lay.phase_of_rows(self.arguments, len(self.rows[0])))

    @property
    def enters(self) -> bool:
        """Whether any of its results enters a row."""
        return any(bool((r != NOWHERE).any()) for r in self.rows)


@record(frozen=True, eq=False)
class Places:
    """Positions of arguments in the pool; ``zero`` is that of a zero, ``nc`` the number of
    surfaces, ``constants`` the position of the first of the shares of a step, and ``change`` says
    that parameters have a value for each phase."""

    lay: Layout
    zero: int
    nc: int
    constants: int
    change: bool

    @property
    def of_events(self) -> Index | None:
        """The phases whose parameters events have, those that they end, shape (events,); None where
        all phases have the same."""
        return np.arange(self.lay.phases - 1) if self.change else None

    def number(self, shares: Array) -> Index:
        """Positions in the pool of numbers of any shape (...) that are among those of
        :func:`shares_of`, in their shape."""
        off = np.abs(shares_of(self.lay.scheme)[:, None] - shares.ravel())
        return np.asarray(self.constants + off.argmin(axis=0).reshape(shares.shape))

    def step(self, steps: Index) -> tuple[Index, ...]:
        """(q_k, q_kp1, u_k, u_kp1, h, t_k, q_i) of some steps, shape (k,), with k rows each."""
        *before, _, q_i = self.lay.split(self.lay.index_step[steps])
        return (*before, self.times(steps), q_i)

    def at_end(self, last: bool) -> tuple[Index, ...]:
        """(q, v, u, t) at the start of the motion, or at its end; velocities that are no unknowns
        are zero."""
        lay = self.lay
        node, v = np.array([lay.total * last]), lay.index_v_E if last else lay.index_v_B
        v = v if len(v) else np.full(lay.nq, NOWHERE)
        u = lay.index_u[lay.row_u_kp1[-1] if last else lay.row_u_k[0]]
        return lay.index_q[node], self.or_zero(v[None]), u[None], self.times(node)

    def quantities_at_end(self, last: bool) -> tuple[Index, ...]:
        """The state of :meth:`at_end` as quantities take it, with the forces behind, if they
        contain any."""
        state, y = self.at_end(last), self.or_zero(self.lay.force.y_ends[[-last]])
        return (*state, y) if self.lay.force.count else state

    def times(self, nodes: Index) -> Index:
        """Unknown times of nodes, shape (nodes, 1); one zero in a model without explicit time."""
        return self.lay.time_columns[nodes] if self.lay.timed else np.full((1, 1), self.zero)

    def times_of(self, places: Index) -> Index:
        """Unknown times of places (:class:`~dmoc.program.stations.Stations`), shape (places, 1);
        one zero in a model without explicit time."""
        return self.lay.time_places[places] if self.lay.timed else np.full((1, 1), self.zero)

    def or_zero(self, index: Index) -> Index:
        """Unknowns where there are some, the position of a zero elsewhere; shape (...) as
        ``index``."""
        return np.where(index == NOWHERE, self.zero, index)


def shares_of(scheme: Discretisation) -> Array:
    """Numbers in the pool, shape (numbers,): places in a step, its nodes and the middle, slopes of
    polynomials at their nodes, and signs."""
    slopes = scheme.slopes_of_nodes, PARABOLA
    return np.concatenate([scheme.nodes, [0.5], *map(np.ravel, slopes), [-1.0, 0.0, 1.0]])


def apart(terms: Sequence[Term]) -> tuple[list[Term], Array]:
    """Terms with the places of their factors in the place of these, and the factors of all."""
    factors = [np.asarray(term.factor, dtype=float) for term in terms]
    ends = np.cumsum([0, *(f.size for f in factors)])
    places = (
        np.arange(end - f.size, end).reshape(f.shape)
        for f, end in zip(factors, ends[1:], strict=True)
    )
    placed = [replace(term, factor=at) for term, at in zip(terms, places, strict=True)]
    return placed, np.concatenate([f.ravel() for f in factors])


def like(rows: Index) -> Index:
    """No rows, in the shape of others."""
    return np.full_like(rows, NOWHERE)


def forward(
    lay: Layout, nodes: Index, v: Index, signs: Array, rows: Index, places: Places
) -> Iterator[Term]:
    """The terms s sigma of sliding velocities in their directions, shape (n, nt) as their rows, at
    nodes (n,) with velocities (n, nq)."""
    for sign in (1.0, -1.0):
        at = np.where(signs == sign, rows, NOWHERE)
        (k,) = np.nonzero((at != NOWHERE).any(axis=1))
        if len(k):
            state = lay.index_q[nodes[k]], v[k], places.times(nodes[k])
            yield Term("slide_rate", state, (at[k],), sign)
