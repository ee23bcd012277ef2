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

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dmoc.mechanics.modes import STICK
from dmoc.program.blocks import NOWHERE, Index
from dmoc.program.contact_table import phase_nodes
from dmoc.program.hit_stages import STOP
from dmoc.program.laws.hit import AFTER
from dmoc.program.transcription import Transcription
from dmoc.solvers.compiled import kkt_pattern

# Ranks within the time of one node.
INEQUALITY, INPUT, INSIDE, STATE, CONTACT, COLLISION, AT_REST = range(7)
RANKS = 7


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
    n, m, last = nlp.n, nlp.n_eq + nlp.n_in, lay.total
    members: list[tuple[Index, Index, Index]] = []  # indices in K, the second -1 for none, and key

    def key(node: Index | int, rank: int) -> Index:
        return np.asarray(node) * RANKS + rank

    def single(index: Index, at: Index) -> None:
        members.append((index, np.full(len(index), -1), at))

    def pair(unknown: Index, row: Index, at: Index) -> None:
        members.append((unknown.ravel(), n + row.ravel(), at))

    # An inequality at a node comes before the node, which is eliminated with the momentum equation
    # of the node before it.
    for block in nlp.inequalities:
        if block.nodes is not None:
            node = block.nodes[np.nonzero(block.index != NOWHERE)[0]]
            single(n + block.numbers, key(node - 1, INEQUALITY))
    steps = np.arange(last)
    for index in (lay.index_s, lay.index_u):
        single(index.ravel(), np.repeat(key(lay.step_of_input, INPUT), index.shape[1]))
    inside = c.inside.index
    pair(lay.index_q_i, c.inside.numbers, np.repeat(key(steps, INSIDE), inside.shape[1]))
    at_state = np.repeat(key(steps, STATE), lay.nq)
    pair(lay.index_q[1:], c.momentum.index[:-1], at_state)
    pair(lay.index_t[1:], c.time.numbers, key(steps[: c.time.count], STATE))
    nodes = lay.collision_nodes
    before, after = key(nodes - 1, COLLISION), key(nodes, COLLISION)
    pair(lay.index_v_a, c.arrival.numbers, np.repeat(before, lay.nq))
    hit, newton = nlp.law.impact, nlp.law.impact & ~nlp.law.rough
    pair(lay.index_h[:-1][hit], c.contact.numbers, before[hit])
    pair(lay.index_v_c, c.departure.numbers, np.repeat(after, lay.nq))
    for unknown, row, event, late in _within_impacts(nlp):
        pair(unknown, row, np.repeat((after if late else before)[event], len(unknown)))
    pair(lay.index_lam[newton], c.energy.index[newton], after[newton])
    for unknown, row, node, rank in _contacts(nlp):
        both = (unknown != NOWHERE) & (row != NOWHERE)
        pair(unknown[both], row[both], key(node, rank)[np.nonzero(both)[0]])
    end = key(last, STATE)
    pair(lay.index_p_E, c.momentum.index[-1], np.repeat(end, lay.nq))
    first, second, at = (np.concatenate(part) for part in zip(*members, strict=True))
    # An equation whose unknown is fixed keeps its place in the chain, where earlier pivots have
    # filled its diagonal; those of the last two nodes join the final group, because a coordinate
    # that no input reaches leaves them to the times alone.
    free = np.append(nlp.lower < nlp.upper, np.ones(m, dtype=bool))
    kept = free[first]
    alone = ~kept & (second >= 0) & (at < end - RANKS)
    chosen = np.flatnonzero(kept | alone)
    chosen = chosen[np.argsort(at[chosen], kind="stable")]
    table = np.stack([np.where(kept, first, second), np.where(kept, second, -1)], axis=1)[chosen]
    chain = table[table >= 0]
    free[chain] = False  # what is left of the free ones is the final group
    widths = 1 + (table[:, 1] >= 0)
    order = np.concatenate([chain, np.flatnonzero(free)])
    return order, np.concatenate([[0], np.cumsum(widths)])


def _within_impacts(nlp: Transcription) -> Iterator[tuple[Index, Index, int, bool]]:
    """Unknowns of impacts with friction and the rows that determine them, in an order in which both
    can be eliminated, the event, and whether that is after the impact.

    A velocity follows from its momentum, the tangential impulse from the law of sliding or from the
    rest, and then the normal one from the rate that ends its stage.
    """
    lay, c = nlp.layout, nlp.rows.c
    for p in lay.touch.passages:
        i = p.event
        for stage, moment in enumerate(p.moments):
            T, P = lay.index_T_h[i, [moment]], lay.index_P_h[i, [moment]]
            yield lay.index_v_h[i, moment], c.within.index[i, moment], i, False
            slides = p.friction[stage] != STICK
            rest = c.halts.index[i, [1 + moment]]
            yield T, c.slips.index[i, [stage]] if slides else rest, i, False
            yield P, rest if moment == STOP else c.energy.index[[i]], i, False
        if not p.lands:
            yield lay.index_lam[[i]], c.restitution.index[[i]], i, False
        T_c, last = lay.index_T_c[i, [p.tangent]], len(p.moments)
        if p.friction[-1] != STICK:
            yield T_c, c.slips.index[i, [last]], i, False
        else:
            yield T_c, c.halts.index[i, [AFTER]], i, True


def _contacts(nlp: Transcription) -> list[tuple[Index, Index, Index, int]]:
    """Impulses of contacts that last, the rows that determine them, and the node and the rank at
    which both can be eliminated, one a row of both.  Those of the last node are determined through
    the final state, which belongs to the final group, and so do they."""
    lay, c = nlp.layout, nlp.rows.c
    if lay.touch.free:
        return []
    nodes, events = phase_nodes(lay.steps), lay.collision_nodes
    last = np.append(nodes[1:] == nodes[:-1], True)
    found = [(lay.index_T, c.sliding.index, nodes - last, INPUT)]
    for impulse, held, rest in (
        (lay.index_P, c.closed.index, c.at_rest.index),
        (lay.index_T, c.stuck.index, np.where(lay.touch.sticks, c.stopped.index[1:], NOWHERE)),
    ):
        following = np.full_like(held, NOWHERE)
        following[:-1] = held[1:]
        following[last] = NOWHERE
        found.append((impulse, following, nodes, CONTACT))
        ends = rest[-lay.phases : -1]
        found.append((impulse[last][:-1], ends, nodes[last][:-1] - 1, AT_REST))
    found.append((lay.index_P_c, c.stays.index, events, AT_REST))
    found.append((lay.index_T_c, c.sticks.index, events, AT_REST))
    found.append((lay.index_T_c, c.slides.index, events - 1, INPUT))
    return found


def kkt_layout(nlp: Transcription) -> KKTLayout:
    """Analyse K for a program without minimal times; programs of one structure with the same fixed
    unknowns share it."""
    free = (nlp.lower < nlp.upper).tobytes()
    return nlp.structure.once(("kkt", free), lambda: _analysed(nlp))


def _analysed(nlp: Transcription) -> KKTLayout:
    order, first = pivots(nlp)
    place = np.full(nlp.n + nlp.n_eq + nlp.n_in, -1, dtype=np.int32)
    place[order] = np.arange(len(order))
    hess, jac = nlp.assembled.hessian, nlp.assembled.jacobian
    patterns = (a.astype(np.int32) for a in (hess.indptr, hess.indices, jac.indptr, jac.indices))
    return KKTLayout(
        place, first=first.astype(np.int32), **kkt_pattern(place, len(order), *patterns)
    )
