"""The totals of a motion: integrals over its steps, and what its hits add to them."""

from __future__ import annotations

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.mechanics.contacts import NOWHERE
from dmoc.mechanics.touch import Touch
from dmoc.problem.problem import Problem
from dmoc.program.blocks import Bools, Index
from dmoc.program.implied_values import lifted, quantity_inputs
from dmoc.program.iterate import Iterate
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


def totals_at(at: Iterate) -> Array:
    """The totals of a motion, shape (totals,)."""
    model = at.problem.model
    if not model.totals_of:
        return np.zeros(0)
    totals = at.model.totals(lifted(at, at.steps))
    np.add.at(totals, model.hit_sums[:, 0], of_hits(at).sum(axis=0))
    return totals


def peaks_at(at: Iterate) -> Array:
    """The peaks of quantities of a motion, those of hits last, shape (peaks,)."""
    if not at.lay.index_peaks.size:
        return np.zeros(0)
    along = at.model.peaks(quantity_inputs(at))
    return np.append(along, at.model.hit_peaks(*hit_quantities(at)))


def of_hits(at: Iterate) -> Array:
    """What the events add to the totals, shape (events, terms)."""
    terms, events = len(at.problem.model.hit_sums), len(at.lay.collision_nodes)
    if not (terms and events):
        return np.zeros((events, terms))
    values = at.problem.models.along(np.arange(events)).hit_terms(*_at_events(at))
    return np.where(counted(at.problem, at.lay), values, 0.0)


def hit_quantities(at: Iterate) -> tuple[Array, Bools]:
    """The quantities of hits at the events, and which of them have some, shape (events, number)
    each."""
    model = at.problem.models.along(np.arange(len(at.lay.touch.events)))
    there = model.hits_of_quantities(surfaces_hit(at.lay.touch))
    if not there.size:
        return np.zeros(there.shape), there
    return model.hit_quantities(*_at_events(at)), there


def _at_events(at: Iterate) -> tuple[Array, Array, Array, Array, Array]:
    """Places, velocities before and after, normal impulses and times of the events."""
    lay, x, lam = at.lay, at.x, impulses_at_events(at.lay)
    pushed, nodes = np.where(lam == NOWHERE, 0.0, x[lam]), lay.collision_nodes
    return at.q[nodes], x[lay.impact.v_a], x[lay.impact.v_c], pushed, at.t[nodes]
