"""The totals of a motion: integrals over its steps, and what its hits add to them."""

from __future__ import annotations

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.mechanics.contacts import NOWHERE
from dmoc.mechanics.touch import Touch
from dmoc.problem.problem import Problem
from dmoc.program.blocks import Bools, Index
from dmoc.program.hidden_values import lifted
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
    totals = model.totals(lifted(problem, lay, lay.step_inputs(x)))
    np.add.at(totals, model.hit_sums[:, 0], of_hits(problem, lay, x).sum(axis=0))
    return totals


def of_hits(problem: Problem, lay: Layout, x: Array) -> Array:
    """What the events add to the totals, shape (events, terms)."""
    nodes, terms = lay.collision_nodes, len(problem.model.hit_sums)
    if not (terms and len(nodes)):
        return np.zeros((len(nodes), terms))
    lam = impulses_at_events(lay)
    at = x[lay.index_q[nodes]], x[lay.impact.v_a], x[lay.impact.v_c]
    pushed = np.where(lam == NOWHERE, 0.0, x[lam])
    values = problem.model.hit_terms(*at, pushed, lay.times(x)[nodes])
    return np.where(counted(problem, lay), values, 0.0)
