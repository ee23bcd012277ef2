"""The totals of a motion: integrals over its steps, and what its hits add to them."""

from __future__ import annotations

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.mechanics.contacts import NOWHERE
from dmoc.mechanics.touch import Touch
from dmoc.problem.problem import Problem
from dmoc.program.blocks import Bools, Index
from dmoc.program.implied_values import lifted, quantity_inputs
from dmoc.program.layout import Layout


def surfaces_hit(touch: Touch) -> list[tuple[int, ...]]:
    """The surfaces that each event hits or lands."""
    return [(*(j for j in (e.hit,) if j != NOWHERE), *e.lands) for e in touch.events]


def counted(problem: Problem, lay: Layout) -> Bools:
    """Which terms of hits each event counts, shape (events, terms)."""
    return problem.model.counting(surfaces_hit(lay.touch))


def impulses_at_events(lay: Layout) -> Index:
    """The unknowns that are normal impulses of surfaces at events, shape (events, nc)."""
    at = np.array(lay.contact.P_c) if lay.contact.P_c.size else np.zeros((0, 0), np.intp)
    count = len(lay.touch.events), len(lay.touch.contacts.surfaces)
    rows = np.full(count, NOWHERE) if at.shape != count else at
    for i, surface in enumerate(lay.touch.surfaces):
        if surface != NOWHERE:
            rows[i, surface] = lay.impact.lam[i]
    return rows


def totals_at(problem: Problem, lay: Layout, x: Array) -> Array:
    """The totals of unknowns x, shape (totals,)."""
    model = problem.model
    if not model.totals_of:
        return np.zeros(0)
    along = lay.model_of_steps(problem)
    totals = along.totals(lifted(problem, lay, lay.step_inputs(x)))
    np.add.at(totals, model.hit_sums[:, 0], of_hits(problem, lay, x).sum(axis=0))
    return totals


def peaks_at(problem: Problem, lay: Layout, x: Array) -> Array:
    """The peaks of quantities of unknowns x, those of hits last, shape (peaks,)."""
    if not lay.index_peaks.size:
        return np.zeros(0)
    model = lay.model_of_steps(lay.problem_at(problem, x))
    along = model.peaks(quantity_inputs(problem, lay, x))
    return np.append(along, model.hit_peaks(*hit_quantities(problem, lay, x)))


def of_hits(problem: Problem, lay: Layout, x: Array) -> Array:
    """What the events add to the totals, shape (events, terms)."""
    terms, events = len(problem.model.hit_sums), len(lay.collision_nodes)
    if not (terms and events):
        return np.zeros((events, terms))
    values = problem.models.along(np.arange(events)).hit_terms(*_at_events(lay, x))
    return np.where(counted(problem, lay), values, 0.0)


def hit_quantities(problem: Problem, lay: Layout, x: Array) -> tuple[Array, Bools]:
    """The quantities of hits at the events, and which of them have some, shape (events, number)
    each."""
    model = lay.problem_at(problem, x).models.along(np.arange(len(lay.touch.events)))
    there = model.hits_of_quantities(surfaces_hit(lay.touch))
    if not there.size:
        return np.zeros(there.shape), there
    return model.hit_quantities(*_at_events(lay, x)), there


def _at_events(lay: Layout, x: Array) -> tuple[Array, Array, Array, Array, Array]:
    """Places, velocities before and after, normal impulses and times of the events."""
    nodes, lam = lay.collision_nodes, impulses_at_events(lay)
    pushed = np.where(lam == NOWHERE, 0.0, x[lam])
    return x[lay.index_q[nodes]], x[lay.impact.v_a], x[lay.impact.v_c], pushed, lay.times(x)[nodes]
