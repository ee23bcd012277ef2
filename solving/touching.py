"""Collisions without effect: where the best motion would rather not collide, it touches the surface
without an impulse.

The law of impact, e (E+ - E-) - W = -lam (gamma+ + e gamma-)/2, has no slope in any unknown at a
touch, lam
= gamma- = gamma+ = 0, so that a solver ends beside it or not at all.  Stated as g = 0, gamma = 0,
lam = 0 a touch is regular; its multipliers tell whether a real collision would cost less.
"""

from __future__ import annotations

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.nlp.tables import Index
from dmoc.nlp.transcription import Transcription
from dmoc.solvers.kkt import cost_size
from dmoc.solvers.outcome import Outcome

# A collision whose rate of approach or impulse is below this share of its size is suspected of
# being none.
SUSPECT = 1e-3
# Slope of the cost along a real collision, relative to the cost, below which it would pay.
PAYS = 1e-6
# Scaled impulse to begin with where a collision pays.
PUSH = 0.05


def suspects(nlp: Transcription, x: Array) -> Index:
    """Hits that hardly approach their surface, or hardly push it; a landing may be soft."""
    lay, law = nlp.layout, nlp.law
    hits = np.flatnonzero(law.impact & ~law.landing & ~law.touching)
    if not len(hits):
        return np.zeros(0, dtype=np.intp)
    y, nodes, surfaces = nlp.physical(x), lay.collision_nodes[hits], lay.surfaces[hits]
    rates = nlp.problem.model.gap_rates(
        y[lay.index_q[nodes]], y[lay.index_v_a[hits]], lay.times(y)[nodes]
    )
    before = rates[np.arange(len(hits)), surfaces]
    faint = (before <= SUSPECT * nlp.scale.rate[surfaces]) | (x[lay.index_lam[hits]] <= SUSPECT)
    return np.asarray(hits[faint])


def pushed(nlp: Transcription, x: Array, at: Index) -> Array:
    """A touch with some impulse, to look for a collision from."""
    x = x.copy()
    x[nlp.layout.index_lam[at]] = PUSH
    return x


def pays(nlp: Transcription, outcome: Outcome) -> bool:
    """Whether the cost of a minimum that touches falls where a touch becomes a collision.

    A collision with the rate of approach s has gamma+ = -e s and lam = (1 + e) s / (n . M^-1 n), so
    that dJ/ds = e y + (1 + e) dL/dlam / (n . M^-1 n) with the multiplier y of gamma = 0.
    """
    lay, x, duals = nlp.layout, outcome.x, outcome.duals
    slope = nlp.lagrangian_gradient(x, duals.y, duals.w)
    y, model = nlp.physical(x), nlp.problem.model
    times = lay.times(y)
    for i in np.flatnonzero(nlp.law.touching):
        node, j = lay.collision_nodes[i], int(lay.surfaces[i])
        q, t = y[lay.index_q[node]], times[node]
        _, inertia = model.impulse_response(q, model.gap_slopes(q, t)[j, :-1], t)
        e = float(nlp.problem.restitution_values[j])
        response = (1 + e) / inertia * nlp.scale.rate[j] / nlp.scale.lam[j]
        gain = e * duals.y[nlp.rows.c.energy.index[i]] + response * slope[lay.index_lam[i]]
        if gain < -PAYS * cost_size(nlp, x):
            return True
    return False
