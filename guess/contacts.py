"""Starts for motions that are held: straight ways, put where contacts of their modes hold them,
with the impulses that come closest to the balance of momentum."""

from __future__ import annotations

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.guess.hits import completed, follows
from dmoc.guess.inverse_dynamics import acting
from dmoc.guess.waypoints import end_velocity
from dmoc.mechanics.algebra import solved
from dmoc.mechanics.attitudes import bulge
from dmoc.mechanics.projection import onto
from dmoc.problem.contacts import event_point
from dmoc.problem.problem import Problem
from dmoc.problem.ranges import midpoints
from dmoc.program.blocks import NOWHERE
from dmoc.program.implied_values import with_forces
from dmoc.program.iterate import Iterate
from dmoc.program.layout import Layout


def standing(problem: Problem, natural: float) -> Array:
    """Unknowns along straight ways from the start through points of what is hit to the goal, in
    phases of equal durations."""
    lay = Layout.of(problem)
    low, high = problem.final_time_bounds
    time = float(np.clip(natural, low, high))
    durations = np.clip(np.full(lay.phases, time / lay.stepped), *problem.duration_bounds.T)
    points = _points(problem, lay, durations)
    legs = np.diff(points, axis=0)
    speeds = legs[: lay.stepped] / durations[: lay.stepped, None]
    speeds = np.vstack([speeds, *[speeds[-1:]] * (lay.phases - lay.stepped)])
    x = lay.zeros(problem)
    x[lay.index_h] = lay.step_sizes(durations)
    shares = [np.arange(1, n + 1)[:, None] / n for n in lay.steps if n]
    on = [
        a + share * leg + bulge(problem.kernels, a, a + leg, share)
        for a, leg, share in zip(points[:-1], legs, shares, strict=False)
    ]
    x[lay.index_q] = np.vstack([points[:1], *on])
    x[lay.index_u] = midpoints(problem.input_bounds, np.zeros(problem.nu))
    x[lay.impact.v_a], x[lay.impact.v_c] = speeds[:-1], speeds[1:]
    x[lay.index_q_i] = lay.scheme.within(x[lay.index_q[:-1]], x[lay.index_q[1:]]).reshape(
        lay.total, -1
    )
    lay.put_times(x)
    for boundary, k, index_p, index_v in (
        (problem.start_bounds, 0, lay.index_p_B, lay.index_v_B),
        (problem.goal_bounds, -1, lay.index_p_E, lay.index_v_E),
    ):
        at = end_velocity(problem, boundary, points[k], speeds[k])
        x[index_p] = problem.models[k].momentum(points[k], at)
        if len(index_v):
            x[index_v] = at
    return in_contact(problem, acting(problem, x))


def _points(problem: Problem, lay: Layout, durations: Array) -> Array:
    """Points of the straight way at the start, the events and the goal, those of hits on their
    surfaces, shape (phases + 1, nq)."""
    share = np.minimum(np.arange(lay.phases + 1) / lay.stepped, 1.0)[:, None]
    a, b = problem.start_position, problem.goal_position
    points = (1 - share) * a + share * b + bulge(problem.kernels, a, b, share)
    for i in range(len(problem.touch.events)):
        t = float(durations[: i + 1].sum())
        points[i + 1] = event_point(problem, points[i + 1], points[i], i, t)
    points[lay.stepped :] = points[lay.stepped]
    return points


def in_contact(problem: Problem, x: Array) -> Array:
    """Unknowns, shape (n,), with positions where phases are held, by contacts or constraints.
    Impulses balance the momenta as well as they can, and there are the ways through impacts with
    friction. Unknowns of a problem without either are as they were."""
    (row,) = all_in_contact(problem, x[None])
    return np.asarray(row)


def all_in_contact(problem: Problem, x: Array) -> Array:
    """The unknowns of :func:`in_contact` for several motions, shape (count, n)."""
    lay = Layout.of(problem)
    held = any(map(lay.reactions, range(lay.phases)))
    if not len(x) or not (held or follows(lay)):
        return x
    each = (Iterate.of(problem, row) for row in x)
    return np.array([_held(at) if held else completed(at) for at in each])


def _held(at: Iterate) -> Array:
    at = at.moved(completed(at))
    for moved in (_onto_contacts, _balanced):
        at = at.moved(moved(at))
    return with_forces(at)


def _onto_contacts(at: Iterate) -> Array:
    """Unknowns whose positions are moved in each phase to where it is held, what sticks to where
    it is at the phase's first node; velocities at nodes inside phases are those between their
    neighbours."""
    problem, lay, x = at.problem, at.lay, at.x.copy()
    lay.put_times(x)
    t = lay.place_times(x)
    fixed = [
        np.asarray(b.position[:, 0] == b.position[:, 1])
        for b in (problem.start_bounds, problem.goal_bounds)
    ]
    for i in range(lay.phases):
        places = lay.places_of_phase(i)
        q = lay.index_places[places]
        held = np.ones(q.shape)
        if i == 0:
            held[0] = ~fixed[0]
        if i >= lay.stepped - 1:
            held[-1] = ~fixed[1]
        x[q] = _onto(problem, lay, i, x[q], t[places], held)
    (k,) = np.nonzero(lay.index_w[:, 0] != NOWHERE)
    h = x[lay.index_h][lay.phase_of_step[k - 1]][:, None]
    x[lay.index_w[k]] = (x[lay.index_q[k + 1]] - x[lay.index_q[k - 1]]) / (2 * h)
    return x


def _onto(problem: Problem, lay: Layout, i: int, q: Array, t: Array, free: Array) -> Array:
    """Rows of positions where phase i is held."""
    model = problem.model
    holding = [r for r in lay.reactions(i) if r.held]
    if not holding:
        return q

    def conditions(q: Array) -> tuple[Array, Array]:
        miss = np.hstack([r.misses(model, q, t) for r in holding])
        slopes = np.concatenate([r.miss_slopes(model, q, t) for r in holding], axis=1)
        return miss, slopes

    return onto(conditions, q, problem.reach * free)


def _balanced(at: Iterate) -> Array:
    """Unknowns with the impulses along phases that leave the least imbalance of the momenta, and of
    the equations inside steps."""
    problem, lay, x = at.problem, at.lay, at.x.copy()
    model, t, stations = problem.model, lay.place_times(x), lay.stations
    starts, ends, inside = at.model.step_balance(at.steps)
    left = np.full((len(lay.index_places), lay.nq), np.nan)
    left[:: lay.scheme.degree][1:-1] = ends[:-1] - starts[1:]
    left[:-1].reshape(lay.total, -1, lay.nq)[:, 1:] = inside
    for i in range(lay.stepped):
        reactions = lay.reactions(i)
        if not reactions:
            continue
        places = np.arange(len(t))[lay.places_of_phase(i)][1:-1]
        missing, now = left[places], t[places]
        q = np.ascontiguousarray(x[lay.index_places[places]])
        mass = problem.models[i].mass(q, now)
        G = np.concatenate([-r.functions.push * r.slopes(model, q, now) for r in reactions], axis=1)
        response = [solved(mass, np.ascontiguousarray(G[:, m])) for m in range(G.shape[1])]
        A = G @ np.stack(response, axis=2)
        b = (G @ solved(mass, missing)[..., None])[..., 0]
        good = np.isfinite(A).all(axis=(1, 2)) & np.isfinite(b).all(axis=1)
        impulses = np.zeros((len(places), G.shape[1]))
        impulses[good] = (np.linalg.pinv(A[good], rcond=1e-8) @ b[good][..., None])[..., 0]
        if not len(impulses):
            continue
        # Those of a place by the share of each row; at the ends of the phase by those beside.
        rows, degree = stations.rows(i), lay.scheme.degree
        share = stations.share[rows]
        whole, row = np.bincount(stations.place[rows], share), stations.place[rows] - places[0]
        beside = np.clip(row, degree - 1, len(places) - degree)
        beside = np.where((row < 0) | (row == len(places)), beside, row)
        first = 0
        for r in reactions:
            pushed = impulses[beside, first : first + len(r.columns)]
            pushed = pushed * (share / whole[places[beside]])[:, None]
            first += len(r.columns)
            x[r.unknowns] = np.where(r.pulls, pushed, np.maximum(pushed, 0.0))
    return x
