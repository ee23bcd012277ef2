"""Starts for motions that are held: straight ways, put where contacts of their modes hold them,
with the impulses that come closest to the balance of momentum."""

from __future__ import annotations

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.guess.hits import through_hits, with_hidden
from dmoc.guess.waypoints import end_velocity
from dmoc.mechanics.algebra import solved
from dmoc.problem.problem import Problem
from dmoc.problem.ranges import midpoints
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
    x[lay.impact.v_a] = x[lay.impact.v_c] = v
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
    """Unknowns with positions where phases are held, by contacts or constraints, and impulses that
    balance the momenta as well as they can, and with the ways through impacts with friction; those
    of a problem without either are as they were."""
    lay = Layout.of(problem)
    x = with_hidden(problem, lay, through_hits(problem, lay, x))
    if not any(map(lay.reactions, range(lay.phases))):
        return x
    x = x.copy()
    _put_onto(problem, lay, x)
    _balance(problem, lay, x)
    return x


def _put_onto(problem: Problem, lay: Layout, x: Array) -> None:
    """Move the positions of each phase to where it is held, what sticks to where it is at the
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
    """Rows of positions where phase i is held, by Gauss-Newton steps in reaches."""
    model, reach = problem.model, problem.reach
    holding = [r for r in lay.reactions(i) if r.held]
    if not holding:
        return q
    for _ in range(PROJECTIONS):
        miss = np.hstack([r.misses(model, q, t) for r in holding])
        slopes = np.concatenate([r.slopes(model, q, t)[:, r.holds] for r in holding], axis=1)
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
    model, t = problem.model, lay.times(x)
    starts, ends = model.step_momenta(lay.step_inputs(x))
    q = x[lay.index_q]
    for i, steps in enumerate(lay.steps):
        reactions = lay.reactions(i)
        if not reactions:
            continue
        nodes = int(lay.ends[i]) + np.arange(1, steps)
        missing = ends[nodes - 1] - starts[nodes]
        at, mass = np.ascontiguousarray(q[nodes]), model.mass(q[nodes], t[nodes])
        G = np.concatenate([-r.sign * r.slopes(model, at, t[nodes]) for r in reactions], axis=1)
        response = [solved(mass, np.ascontiguousarray(G[:, m])) for m in range(G.shape[1])]
        A = G @ np.stack(response, axis=2)
        b = (G @ solved(mass, missing)[..., None])[..., 0]
        good = np.isfinite(A).all(axis=(1, 2)) & np.isfinite(b).all(axis=1)
        impulses = np.zeros((steps - 1, G.shape[1]))
        impulses[good] = (np.linalg.pinv(A[good], rcond=1e-8) @ b[good][..., None])[..., 0]
        first = 0
        for r in reactions:
            pushed = impulses[:, first : first + len(r.columns)]
            first += len(r.columns)
            x[r.unknowns[1:-1]] = pushed if r.pulls else np.maximum(pushed, 0.0)
            x[r.unknowns[0]], x[r.unknowns[-1]] = x[r.unknowns[1]] / 2, x[r.unknowns[-2]] / 2
