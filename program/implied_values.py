"""What the states along a motion imply of other unknowns: first values of forces, forces in its
steps, and what hidden unknowns are on the functions with kinks in whose place they stand."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.mechanics.contact_forces import accelerations_and_forces
from dmoc.program.blocks import NOWHERE, Index
from dmoc.program.iterate import Iterate


def with_forces(at: Iterate) -> Array:
    """Unknowns, shape (n,), with the accelerations and forces that the states and inputs have."""
    x, lay = _with_liftoffs(at), at.lay
    force, last = lay.force, np.array([0, lay.total - 1])
    if not (np.append(force.y, force.y_ends, axis=0) != NOWHERE).any():
        return x
    at = at.moved(x)
    parts = (
        (force.y, _forces(at, force.step, force.share)),
        (force.y_ends, _forces(at, last, np.array([0.0, 1.0]))),
    )
    x = x.copy()
    for index, y in parts:
        there = index != NOWHERE
        x[index[there]] = y[there]
    return x


def _with_liftoffs(at: Iterate) -> Array:
    """Unknowns with those before lift-offs."""
    lay = at.lay
    if not lay.liftoff.of:
        return at.x
    x = at.x.copy()
    for event in (one.event for one in lay.liftoff.of):
        node, index = lay.collision_nodes[event], lay.liftoff.y_lift_off[event]
        v, u = lay.impact.v_a[event], lay.index_u[lay.row_u_kp1[node - 1]]
        state = at.q[[node]], at.x[v][None], at.x[u][None], at.t[[node]]
        (y,) = accelerations_and_forces(at.problem.models[event], lay.touch.modes[event], state)
        there = index != NOWHERE
        x[index[there]] = np.where(np.isfinite(y), y, 0.0)[there]
    return x


def quantity_inputs(at: Iterate) -> list[Array]:
    """Inputs of the kernels of quantities at all steps, each of shape (total, size). Forces, where
    quantities contain any, are those of the middles of steps at all points."""
    if not at.lay.force.count:
        return at.steps
    y = _forces(at, np.arange(at.lay.total), np.full(at.lay.total, 0.5))
    return [*at.steps, np.tile(y, (1, at.lay.scheme.points))]


def _forces(at: Iterate, step: Index, share: Array) -> Array:
    """Accelerations and forces at shares of steps, shape (n, ny); zero where they are none."""
    lay, t = at.lay, at.lay.place_times(at.x)
    d, y = lay.scheme.degree, np.zeros((len(step), lay.force.count))
    u = at.x[lay.index_u]
    first, last = u[lay.row_u_k[step]], u[lay.row_u_kp1[step]]
    inputs = first + share[:, None] * (last - first)
    for i, mode in enumerate(lay.touch.modes):
        of = np.flatnonzero(lay.phase_of_step[step] == i)
        if not len(of) or not lay.reactions(i):
            continue
        places = np.arange(len(t))[lay.places_of_phase(i)]
        q, times = at.x[lay.index_places[places]], t[places]
        v = np.gradient(q, times, axis=0)
        begin = t[d * step[of]]
        now = begin + share[of] * (t[d * (step[of] + 1)] - begin)
        state = _between(now, times, q), _between(now, times, v), inputs[of], now
        y[of] = accelerations_and_forces(at.problem.models[i], mode, state)
    return np.where(np.isfinite(y), y, 0.0)


def _between(now: Array, times: Array, rows: Array) -> Array:
    """Rows at times between theirs."""
    return np.stack([np.interp(now, times, column) for column in rows.T], axis=1)


def hidden_values(at: Iterate, step: Sequence[Array]) -> Array:
    """Values of the hidden unknowns in steps (q_k, q_kp1, u_k, u_kp1, h, t_k, q_i) of shape (total,
    size), of a motion or beside it, shape (total, values in a step)."""
    q_k, q_kp1, u_k, u_kp1, h, t_k, q_i = step
    lay, scheme, n = at.lay, at.lay.scheme, len(q_k)
    powers, c = np.arange(scheme.degree + 1), scheme.places[:, None]
    shapes = c**powers @ scheme.shapes.T
    slopes = powers * c ** np.maximum(powers - 1, 0) @ scheme.shapes.T
    within = q_i.reshape(n, scheme.inside, lay.nq)
    nodes = np.concatenate([q_k[:, None], q_kp1[:, None], within], axis=1)
    q, rates = (np.einsum("ca,kaj->ckj", at, nodes) for at in (shapes, slopes))
    places = [(i, share) for i, share in enumerate(scheme.places)]
    if scheme.points == 1:
        places = [(0, side) for side in ((0.0, 1.0) if lay.form.width else (0.0,))]
    values = [
        at.model.hidden(
            q[i], rates[i] / h, u_k + share * (u_kp1 - u_k), (t_k + scheme.places[i] * h)[:, 0]
        )
        for i, share in places
    ]
    return np.hstack(values)


def lifted(at: Iterate, step: list[Array]) -> list[Array]:
    """Steps of shape (total, size), of a motion or beside it, with the hidden unknowns behind, as
    kernels take them that have any; these are on their functions."""
    if not at.lay.index_s.size:
        return step
    values = hidden_values(at, step)
    both = at.lay.hidden_of_kernels.shape[1] // values.shape[1]
    return [*step, np.tile(values, (1, both))]
