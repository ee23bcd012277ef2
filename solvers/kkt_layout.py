"""The linear system of a Newton step, K = [[H, A'], [A, 0]]: its pattern and the order of its
pivots.

The order follows time, and the mechanics say what belongs together.  The momentum equation of node
k determines q_{k+1}: both are one pivot of two, [[H_qq, A'], [A, .]], which is regular whatever H
is, because A = d(momentum k)/d(q_{k+1}) is close to -M/h.  In the same way the contact determines
the step size of the phase that ends in it, the momenta beside a collision the velocities, and the
energy equation the impulse; within an impact with friction each equation determines what it is the
end of; the equations of the nodes inside a step come before its momentum
equation.  Inequalities come before their unknowns, since eliminating a slack leaves their own
pivot.  What the chain does not determine - free boundary values, the momentum equation of the last
node, the last step size, constraints on the final time - is a small final group that is factorised
densely.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import field

import numpy as np
from numpy.typing import NDArray

from dmoc.base.records import record
from dmoc.program.blocks import NOWHERE, Index
from dmoc.program.laws.law import INEQUALITY, INPUT, RANKS, STATE, key
from dmoc.program.transcription import Transcription
from dmoc.solvers.compiled import Factorisation, Room, kkt_pattern


@record(frozen=True, eq=False)
class KKTLayout:
    """K in elimination order, upper triangle by columns.

    ``place``: position of unknown i (index i) and of row r of (c | d) (index n + r), -1 for fixed
    unknowns.  ``first``: first position of each pivot, then the beginning of the final group.
    ``from_hess``, ``from_jac``: entry of K that each entry of the Hessian and of the Jacobian is
    added to, -1 for none.  ``diagonal``: entry of K on the diagonal of each index.
    ``factorisation``: one of this pattern, whose analysis serves others.  ``rooms``: where solves
    of this form may work that nobody uses.
    """

    place: NDArray[np.int32]
    start: NDArray[np.int32]
    row: NDArray[np.int32]
    first: NDArray[np.int32]
    from_hess: NDArray[np.int32]
    from_jac: NDArray[np.int32]
    diagonal: NDArray[np.int32]
    factorisation: Factorisation
    rooms: list[Room] = field(default_factory=list, init=False)

    @classmethod
    def of(
        cls,
        place: NDArray[np.int32],
        first: NDArray[np.int32],
        patterns: Iterable[NDArray[np.int32]],
    ) -> KKTLayout:
        """Lay K out for places (n + n_eq + n_in,) and first positions of pivots (pivots + 1,);
        ``patterns`` are those of H and A: starts of rows and columns of both."""
        size = int((place >= 0).sum())
        arrays = kkt_pattern(place, size, *patterns)
        factorisation = Factorisation(first, arrays["start"], arrays["row"])
        return cls(place, first=first, factorisation=factorisation, **arrays)

    @property
    def size(self) -> int:
        return len(self.start) - 1


def pivots(nlp: Transcription) -> tuple[Index, Index]:
    """Return the indices of K in elimination order, shape (size,), and the first position of each
    pivot, shape (pivots + 1,); the rest is the final group."""
    lay, n, m = nlp.layout, nlp.n, nlp.n_eq + nlp.n_in
    members: list[tuple[Index, Index, Index]] = []  # indices in K, the second -1 for none, and key

    def single(index: Index, at: Index) -> None:
        members.append((index, np.full(len(index), -1), at))

    def pair(unknown: Index, row: Index | None, at: Index | int) -> None:
        both = unknown != NOWHERE
        keys = np.broadcast_to(np.reshape(at, (-1, *[1] * (unknown.ndim - 1))), unknown.shape)
        if row is None:
            single(unknown[both], keys[both])
            return
        both &= row != NOWHERE
        members.append((unknown[both], n + row[both], keys[both]))

    # An inequality at a node comes before the node, which is eliminated with the momentum equation
    # of the node before it.
    for block in nlp.inequalities:
        if block.nodes is not None:
            node = block.nodes[np.nonzero(block.index != NOWHERE)[0]]
            single(n + block.numbers, key(node - 1, INEQUALITY))
    for index, step in ((lay.index_s, np.arange(lay.total)), (lay.index_u, lay.step_of_input)):
        single(index.ravel(), np.repeat(key(step, INPUT), index.shape[1]))
    for law in nlp.laws:
        for pivot in law.pivots(nlp.laws):
            pair(*pivot)
    for law in nlp.laws:
        for index, at in law.loose():
            single(index[at != NOWHERE], at[at != NOWHERE])
    first, second, at = (np.concatenate(part) for part in zip(*members, strict=True))
    # An equation whose unknown is fixed keeps its place in the chain, where earlier pivots have
    # filled its diagonal; those of the last two nodes join the final group, because a coordinate
    # that no input reaches leaves them to the times alone.
    free = np.append(nlp.lower < nlp.upper, np.ones(m, dtype=bool))
    kept = free[first]
    alone = ~kept & (second >= 0) & (at < key(lay.total, STATE) - RANKS)
    chosen = np.flatnonzero(kept | alone)
    chosen = chosen[np.argsort(at[chosen], kind="stable")]
    table = np.stack([np.where(kept, first, second), np.where(kept, second, -1)], axis=1)[chosen]
    chain = table[table >= 0]
    free[chain] = False  # what is left of the free ones is the final group
    widths = 1 + (table[:, 1] >= 0)
    order = np.concatenate([chain, np.flatnonzero(free)])
    return order, np.concatenate([[0], np.cumsum(widths)])


def kkt_layout(nlp: Transcription) -> KKTLayout:
    """Analyse K for a program without minimal times; programs of one structure with the same fixed
    unknowns share it."""
    if "kkt" not in nlp.analyses:
        free = (nlp.lower < nlp.upper).tobytes()
        nlp.analyses["kkt"] = nlp.structure.once(("kkt", free), lambda: _analysed(nlp))
    layout: KKTLayout = nlp.analyses["kkt"]
    return layout


def _analysed(nlp: Transcription) -> KKTLayout:
    order, first = pivots(nlp)
    place = np.full(nlp.n + nlp.n_eq + nlp.n_in, -1, dtype=np.int32)
    place[order] = np.arange(len(order))
    hess, jac = nlp.assembled.hessian, nlp.assembled.jacobian
    patterns = (a.astype(np.int32) for a in (hess.indptr, hess.indices, jac.indptr, jac.indices))
    return KKTLayout.of(place, first.astype(np.int32), patterns)
