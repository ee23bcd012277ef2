"""Starts for motions with contacts that last: straight ways, put onto the contacts of their modes,
with the impulses that come closest to the balance of momentum."""

from __future__ import annotations

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.guess.hits import through_hits, with_hidden
from dmoc.guess.waypoints import end_velocity
from dmoc.mechanics.algebra import solved
from dmoc.problem.problem import Problem, midpoints
from dmoc.program.blocks import NOWHERE
from dmoc.program.contact_table import phase_nodes
from dmoc.program.layout import Layout

# Gauss-Newton steps onto the contacts of a mode, and the largest of a coordinate, in its reach.
PROJECTIONS, LONGEST = 12, 0.5


def standing(problem: Problem, natural: float) -> Array:
    """Unknowns along straight ways from the start to the goal, in phases of equal durations."""
    lay = Layout.of(problem)
    low, high = problem.final_time_bounds
    time = float(np.clip(natural, low, high))
    durations = np.clip(np.full(lay.phases, time / lay.phases), *problem.duration_bounds.T)
    start = problem.start_position
    goal = midpoints(problem.goal_bounds.position, start)
    share = np.concatenate(
        [[0.0], *((i + np.arange(1, n + 1) / n) / lay.phases for i, n in enumerate(lay.steps))]
    )
    x = np.zeros(lay.size)
    x[lay.index_h] = durations / np.array(lay.steps)
    x[lay.index_q] = start + share[:, None] * (goal - start)
    x[lay.index_u] = midpoints(problem.input_bounds, np.zeros(problem.nu))
    v = np.tile((goal - start) / durations.sum(), (lay.phases - 1, 1))
    x[lay.index_v_a] = x[lay.index_v_c] = v
    if lay.timed:
        x[lay.index_t] = lay.times(x)
    for boundary, q, index_p, index_v in (
        (problem.start_bounds, start, lay.index_p_B, lay.index_v_B),
        (problem.goal_bounds, goal, lay.index_p_E, lay.index_v_E),
    ):
        at = end_velocity(problem, boundary, q, (goal - start) / durations.sum())
        x[index_p] = problem.model.momentum(q, at)
        if len(index_v):
            x[index_v] = at
    return in_contact(problem, x)


def in_contact(problem: Problem, x: Array) -> Array:
    """Unknowns with positions on the contacts that are closed, and impulses that balance the
    momenta as well as they can, and with the ways through impacts with friction; those of a problem
    without either are as they were."""
    lay = Layout.of(problem)
    x = with_hidden(problem, lay, through_hits(problem, lay, x))
    if lay.touch.free:
        return x
    x = x.copy()
    _put_onto(problem, lay, x)
    _balance(problem, lay, x)
    return x


def _put_onto(problem: Problem, lay: Layout, x: Array) -> None:
    """Move the positions of each phase onto its contacts, those that stick to where they are at the
    phase's first node."""
    t = lay.times(x)
    fixed = [
        np.asarray(b.position[:, 0] == b.position[:, 1])
        for b in (problem.start_bounds, problem.goal_bounds)
    ]
    for i in range(lay.phases):
        nodes = np.arange(lay.ends[i], lay.ends[i + 1] + 1)
        q = x[lay.index_q[nodes]]
        held = np.ones((len(nodes), lay.nq))
        if i == 0:
            held[0] = ~fixed[0]
        if i == lay.phases - 1:
            held[-1] = ~fixed[1]
        x[lay.index_q[nodes]] = _onto(problem, lay, i, q, t[nodes], held)


def _onto(problem: Problem, lay: Layout, i: int, q: Array, t: Array, free: Array) -> Array:
    """Rows of positions on the contacts of phase i, by Gauss-Newton steps in reaches."""
    model, reach, touch = problem.model, problem.reach, lay.touch
    closed = list(touch.closed[i])
    sticking = [int(k) for k in np.flatnonzero(touch.sticks[i])]
    if not closed and not sticking:
        return q
    for _ in range(PROJECTIONS):
        tau = model.tangents(q, t)[:, sticking]
        miss = np.hstack([model.gaps(q, t)[:, closed], tau - tau[:1]])
        slopes = np.concatenate(
            [model.gap_slopes(q, t)[:, closed, :-1], model.tangent_slopes(q, t)[:, sticking, :-1]],
            axis=1,
        )
        slopes = slopes * (reach * free)[:, None, :]
        finite = np.isfinite(slopes).all(axis=(1, 2)) & np.isfinite(miss).all(axis=1)
        step = np.zeros_like(q)
        inverse = np.linalg.pinv(slopes[finite], rcond=1e-8)
        step[finite] = np.einsum("kij,kj->ki", inverse, -miss[finite])
        size = np.abs(step).max(axis=1, keepdims=True)
        q = q + reach * step * np.minimum(1.0, LONGEST / np.maximum(size, LONGEST))
    return q


def _balance(problem: Problem, lay: Layout, x: Array) -> None:
    """Impulses at the nodes of phases that leave the least imbalance of the momenta."""
    model, touch = problem.model, lay.touch
    starts, ends = model.step_momenta(lay.step_inputs(x))
    nodes, t = phase_nodes(lay.steps), lay.times(x)
    q = np.ascontiguousarray(x[lay.index_q[nodes]])
    normal = model.gap_slopes(q, t[nodes])[:, :, :-1]
    along = model.tangent_slopes(q, t[nodes])[:, :, :-1]
    mass = model.mass(q, t[nodes])
    rows = np.concatenate([[0], np.cumsum(np.array(lay.steps) + 1)])
    for i, steps in enumerate(lay.steps):
        closed, rubs = list(touch.closed[i]), [k for k, _ in touch.rubbing[i]]
        if not closed and not rubs:
            continue
        inner, node = rows[i] + np.arange(1, steps), int(lay.ends[i]) + np.arange(1, steps)
        missing = ends[node - 1] - starts[node]
        G = np.concatenate([normal[inner][:, closed], -along[inner][:, rubs]], axis=1)
        response = [solved(mass[inner], np.ascontiguousarray(G[:, m])) for m in range(G.shape[1])]
        A = G @ np.stack(response, axis=2)
        b = (G @ solved(mass[inner], missing)[..., None])[..., 0]
        good = np.isfinite(A).all(axis=(1, 2)) & np.isfinite(b).all(axis=1)
        found = np.zeros((steps - 1, G.shape[1]))
        found[good] = (np.linalg.pinv(A[good], rcond=1e-8) @ b[good][..., None])[..., 0]
        x[lay.index_P[np.ix_(inner, closed)]] = np.maximum(found[:, : len(closed)], 0.0)
        x[lay.index_T[np.ix_(inner, rubs)]] = found[:, len(closed) :]
        for index in (lay.index_P, lay.index_T):
            for row, inner in ((rows[i], 1), (rows[i + 1] - 1, -2)):
                used = index[row] != NOWHERE
                beside = rows[i] + (inner if inner > 0 else steps - 1)
                x[index[row, used]] = x[index[beside, used]] / 2
