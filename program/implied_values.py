"""What the states along a motion imply of other unknowns: first values of forces, forces in its
steps, and what hidden unknowns are on the functions with kinks in whose place they stand."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.mechanics.contact_forces import accelerations_and_forces
from dmoc.problem.problem import Problem
from dmoc.program.blocks import NOWHERE, Index
from dmoc.program.layout import Layout


def with_forces(problem: Problem, lay: Layout, x: Array) -> Array:
    """Unknowns, shape (n,), with the accelerations and forces that the states and inputs of x,
    shape (n,), have."""
    x, force = _with_liftoffs(problem, lay, x), lay.force
    if not (np.append(force.y, force.y_ends, axis=0) != NOWHERE).any():
        return x
    x, steps, problem = x.copy(), np.array([0, lay.total - 1]), lay.problem_at(problem, x)
    for index, step, share in (
        (force.y, force.step, force.share),
        (force.y_ends, steps, np.array([0.0, 1.0])),
    ):
        y, there = _forces(problem, lay, x, step, share), index != NOWHERE
        x[index[there]] = y[there]
    return x


def _with_liftoffs(problem: Problem, lay: Layout, x: Array) -> Array:
    """Unknowns with those before lift-offs."""
    if not lay.liftoff.of:
        return x
    x, t, problem = x.copy(), lay.times(x), lay.problem_at(problem, x)
    for event in (one.event for one in lay.liftoff.of):
        node, index = lay.collision_nodes[event], lay.liftoff.y_lift_off[event]
        q, v, u = lay.index_q[node], lay.impact.v_a[event], lay.index_u[lay.row_u_kp1[node - 1]]
        state = x[q][None], x[v][None], x[u][None], t[[node]]
        (y,) = accelerations_and_forces(problem.models[event], lay.touch.modes[event], state)
        there = index != NOWHERE
        x[index[there]] = np.where(np.isfinite(y), y, 0.0)[there]
    return x


def quantity_inputs(problem: Problem, lay: Layout, x: Array) -> list[Array]:
    """Inputs of the kernels of quantities at all steps for the unknowns x, shape (n,), each of
    shape (total, size). Forces, where quantities contain any, are those of the middles of steps at
    all points."""
    step = lay.step_inputs(x)
    if not lay.force.count:
        return step
    middles = np.arange(lay.total), np.full(lay.total, 0.5)
    y = _forces(lay.problem_at(problem, x), lay, x, *middles)
    return [*step, np.tile(y, (1, lay.scheme.points))]


def _forces(problem: Problem, lay: Layout, x: Array, step: Index, share: Array) -> Array:
    """Accelerations and forces at shares of steps, shape (n, ny); zero where they are none."""
    t, d = lay.place_times(x), lay.scheme.degree
    y = np.zeros((len(step), lay.force.count))
    u = x[lay.index_u]
    first, last = u[lay.row_u_k[step]], u[lay.row_u_kp1[step]]
    inputs = first + share[:, None] * (last - first)
    for i, mode in enumerate(lay.touch.modes):
        at = np.flatnonzero(lay.phase_of_step[step] == i)
        if not len(at) or not lay.reactions(i):
            continue
        places = np.arange(len(t))[lay.places_of_phase(i)]
        q, times = x[lay.index_places[places]], t[places]
        v = np.gradient(q, times, axis=0)
        begin = t[d * step[at]]
        now = begin + share[at] * (t[d * (step[at] + 1)] - begin)
        state = _between(now, times, q), _between(now, times, v), inputs[at], now
        y[at] = accelerations_and_forces(problem.models[i], mode, state)
    return np.where(np.isfinite(y), y, 0.0)


def _between(now: Array, times: Array, rows: Array) -> Array:
    """Rows at times between theirs."""
    return np.stack([np.interp(now, times, column) for column in rows.T], axis=1)


def hidden_values(problem: Problem, lay: Layout, step: Sequence[Array]) -> Array:
    """Values of the hidden unknowns in steps (q_k, q_kp1, u_k, u_kp1, h, t_k, q_i) of shape (total,
    size), shape (total, values in a step)."""
    q_k, q_kp1, u_k, u_kp1, h, t_k, q_i = step
    scheme, n, model = lay.scheme, len(q_k), lay.model_of_steps(problem)
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
        model.hidden(
            q[i], rates[i] / h, u_k + share * (u_kp1 - u_k), (t_k + scheme.places[i] * h)[:, 0]
        )
        for i, share in places
    ]
    return np.hstack(values)


def lifted(problem: Problem, lay: Layout, step: list[Array]) -> list[Array]:
    """Steps of shape (total, size) with the hidden unknowns behind, as kernels take them that have
    any; these are on their functions."""
    if not lay.index_s.size:
        return step
    values = hidden_values(problem, lay, step)
    both = lay.hidden_of_kernels.shape[1] // values.shape[1]
    return [*step, np.tile(values, (1, both))]
