"""The linear system of a Newton step, K = [[H, A'], [A, 0]]: its pattern and the order of its
pivots.

The order follows time, and the mechanics say what belongs together.  The momentum equation of node
k determines q_{k+1}: both are one pivot of two, [[H_qq, A'], [A, .]], which is regular whatever H
is, because A = d(momentum k)/d(q_{k+1}) is close to -M/h.  In the same way the contact determines
the step size of the phase that ends in it, the momenta beside a collision the velocities, and the
energy equation the impulse; the equations of the nodes inside a step come before its momentum
equation.  Inequalities come before their unknowns, since eliminating a slack leaves their own
pivot.  What the chain does not determine - free boundary values, the momentum equation of the last
node, the last step size, constraints on the final time - is a small final group that is factorised
densely.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dmoc.nlp.tables import Index
from dmoc.nlp.transcription import Transcription

# Ranks within the time of one node.
INEQUALITY, INPUT, INSIDE, STATE, COLLISION = range(5)
RANKS = 5


@dataclass(frozen=True)
class KKTLayout:
    """K in elimination order, upper triangle by columns.

    ``place``: position of unknown i (index i) and of row r of (c | d) (index n + r), -1 for fixed
    unknowns.  ``first``: first position of each pivot, then the beginning of the final group.
    ``from_hess``, ``from_jac``: entry of K that each entry of the Hessian and of the Jacobian is
    added to, -1 for none.  ``diagonal``: entry of K on the diagonal of each index.
    """

    place: NDArray[np.int32]
    start: NDArray[np.int32]
    row: NDArray[np.int32]
    first: NDArray[np.int32]
    from_hess: NDArray[np.int32]
    from_jac: NDArray[np.int32]
    diagonal: NDArray[np.int32]

    @property
    def size(self) -> int:
        return len(self.start) - 1


def pivots(nlp: Transcription) -> tuple[Index, Index]:
    """Return the indices of K in elimination order and the first position of each pivot; the
    rest is the final group."""
    lay, c = nlp.layout, nlp.rows.c
    n, last = nlp.n, lay.total

    def row(r: Index) -> Index:
        """Index in K of a row of (c | d)."""
        return np.asarray(n + r)

    singles: list[tuple[Index, Index]] = []  # (index, key)
    pairs: list[tuple[Index, Index, Index]] = []

    def key(node: Index, rank: int) -> Index:
        return np.asarray(node) * RANKS + rank

    free = nlp.lower < nlp.upper
    # An inequality at a node comes before the node, which is eliminated with the momentum equation
    # of the node before it.
    for block in nlp.inequalities:
        if block.nodes is not None:
            singles.append(
                (row(block.numbers), key(block.nodes[block.places[:, 0]] - 1, INEQUALITY))
            )
    steps = np.arange(lay.total)
    singles.append((lay.index_u.ravel(), np.repeat(key(lay.step_of_input, INPUT), lay.nu)))
    between = np.repeat(key(steps, INSIDE), c.inside.index.shape[1])
    pairs.append((lay.index_q_i.ravel(), row(c.inside.numbers), between))
    pairs.append(
        (
            lay.index_q[1:].ravel(),
            row(c.momentum.index[:-1]).ravel(),
            np.repeat(key(steps, STATE), lay.nq),
        )
    )
    pairs.append((lay.index_t[1:], row(c.time.numbers), key(steps[: c.time.count], STATE)))
    nodes = lay.collision_nodes
    pairs.append(
        (
            lay.index_v_a.ravel(),
            row(c.arrival.numbers),
            np.repeat(key(nodes - 1, COLLISION), lay.nq),
        )
    )
    pairs.append((lay.index_h[:-1], row(c.contact.numbers), key(nodes - 1, COLLISION)))
    pairs.append(
        (lay.index_v_c.ravel(), row(c.departure.numbers), np.repeat(key(nodes, COLLISION), lay.nq))
    )
    pairs.append((lay.index_lam, row(c.energy.numbers), key(nodes, COLLISION)))
    pairs.append((lay.index_p_E, row(c.momentum.index[-1]), key(np.full(lay.nq, last), STATE)))
    # An equation whose unknown is fixed keeps its place in the chain, where earlier pivots have
    # filled its diagonal; that of the last node joins the final group.
    first, second, keys = [], [], []
    for index, at in singles:
        kept = (index >= n) | free[np.minimum(index, n - 1)]
        first.append(index[kept])
        second.append(np.full(int(kept.sum()), -1))
        keys.append(at[kept])
    for unknown, equation, at in pairs:
        kept = free[unknown]
        alone = ~kept & (at < key(np.full(len(at), last), STATE))
        first.append(equation[alone])
        second.append(np.full(int(alone.sum()), -1))
        keys.append(at[alone])
        first.append(unknown[kept])
        second.append(equation[kept])
        keys.append(at[kept])
    a, b, k = np.concatenate(first), np.concatenate(second), np.concatenate(keys)
    order = np.argsort(k, kind="stable")
    members = np.stack([a[order], b[order]], axis=1)
    chain = members[members >= 0]
    widths = 1 + (members[:, 1] >= 0)
    m = nlp.n_eq + nlp.n_in
    taken = np.zeros(n + m, dtype=bool)
    taken[chain] = True
    taken[:n] |= ~free
    return np.concatenate([chain, np.flatnonzero(~taken)]), np.concatenate([[0], np.cumsum(widths)])


def kkt_layout(nlp: Transcription) -> KKTLayout:
    """Analyse K for a program without minimal times."""
    n = nlp.n
    order, first = pivots(nlp)
    place = np.full(n + nlp.n_eq + nlp.n_in, -1, dtype=np.int64)
    place[order] = np.arange(len(order))
    hess, jac = nlp.assembled.hessian, nlp.assembled.jacobian
    groups: list[tuple[Any, Any]] = [
        (np.repeat(np.arange(n), np.diff(hess.indptr)), hess.indices),
        (n + np.repeat(np.arange(jac.shape[0]), np.diff(jac.indptr)), jac.indices),
        (np.arange(len(place)), np.arange(len(place))),
    ]
    size = len(order)
    keys = []
    for i, j in groups:
        a, b = place[i], place[j]
        keys.append(np.where((a < 0) | (b < 0), -1, np.maximum(a, b) * size + np.minimum(a, b)))
    entries = np.sort(np.concatenate(keys))  # np.unique would take most of the time of the analysis
    entries = entries[(entries >= 0) & np.diff(entries, prepend=-1).astype(bool)]
    found = [np.where(k >= 0, np.searchsorted(entries, k), -1).astype(np.int32) for k in keys]
    start = np.concatenate([[0], np.cumsum(np.bincount(entries // size, minlength=size))])
    return KKTLayout(
        place.astype(np.int32),
        start.astype(np.int32),
        (entries % size).astype(np.int32),
        first.astype(np.int32),
        *found,
    )
