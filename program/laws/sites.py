"""The places along a motion at which functions of states stand, as arguments of their kernels."""

from __future__ import annotations

import numpy as np

from dmoc.program.blocks import NOWHERE, Index
from dmoc.program.layout import Layout
from dmoc.program.terms import Places


def nodes_of_ends(lay: Layout) -> Index:
    """Nodes at the start and at the end of each phase, shape (2 phases,); a phase without steps
    has one."""
    return np.stack([lay.ends[:-1], lay.ends[1:]], axis=1).ravel()[: lay.phases + lay.stepped]


def inputs_of_ends(lay: Layout) -> Index:
    """Rows of u there; after an event that ends the motion those before it."""
    last = lay.row_u_kp1[lay.ends[1:] - 1]
    first = np.append(lay.row_u_k, last[-1:])[lay.ends[:-1]]
    return np.stack([first, last], axis=1).ravel()[: lay.phases + lay.stepped]


def forces_of_ends(lay: Layout) -> Index:
    """Rows of the unknown forces there, but after an event that ends the motion; none where these
    stand in the middle of steps."""
    if lay.inside:
        d, ends = lay.scheme.degree, lay.ends[: lay.stepped + 1]
        first, last = (d + 1) * ends[:-1], (d + 1) * ends[1:] - 1
        return np.stack([first, last], axis=1).ravel()
    rows = inputs_of_ends(lay) if lay.form.width else np.zeros(0, dtype=np.intp)
    return rows[: 2 * lay.stepped]


def arguments_along(
    lay: Layout, places: Places, nodes: Index, forces: bool
) -> dict[str, tuple[Index, ...]]:
    """Arguments of kernels by the ends of their names: in all steps, at their ends, at some nodes
    inside phases, and at the ends of phases; with ``forces`` behind them, where quantities of the
    model contain any."""
    step, at, k = places.step(np.arange(lay.total)), nodes_of_ends(lay), nodes
    q, u = lay.index_q, lay.index_u
    state = q[at], places.or_zero(_velocities(lay)), u[inputs_of_ends(lay)], places.times(at)
    by_suffix = {"": step, "_ends": step, "_point": state}
    if len(k):
        h = lay.index_h[lay.phase_of_step[k]][:, None]
        by_suffix["_node"] = q[k - 1], q[k], q[k + 1], u[lay.row_u_k[k]], h, places.times(k)
    if not (forces and lay.force.count):
        return by_suffix
    y, per = places.or_zero(lay.force.y), lay.force.count
    idle = np.full((1, per), places.zero)
    ends = forces_of_ends(lay)
    own = {"": np.repeat(idle, lay.scheme.points, axis=1), "_ends": idle, "_node": idle}
    if lay.inside:
        own["_ends"] = y.reshape(lay.total, -1)
    elif lay.form.width:
        own["_node"] = y[lay.row_u_k[k]]
    else:
        own[""] = y
    own["_point"] = np.vstack([y[ends], idle])[: len(at)] if len(ends) else idle
    return {suffix: (*arguments, own[suffix]) for suffix, arguments in by_suffix.items()}


def _velocities(lay: Layout) -> Index:
    """Unknown velocities at those nodes, shape (nodes, nq); nowhere where they are not needed."""
    velocities = np.full((lay.phases + lay.stepped, lay.nq), NOWHERE)
    velocities[1:-1:2], velocities[2::2] = lay.impact.v_a, lay.impact.v_c
    for row, index in ((0, lay.index_v_B), (-1, lay.index_v_E)):
        if len(index):
            velocities[row] = index
    return velocities
