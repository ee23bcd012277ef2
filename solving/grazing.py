"""Collisions without effect: where the best motion would rather not collide, it grazes the surface
without an impulse.

The law of impact, e (E+ - E-) - W = -lam (gamma+ + e gamma-)/2, has no slope in any unknown at a
graze, lam = gamma- = gamma+ = 0, so that a solver ends beside it or not at all.  Stated as g = 0,
gamma = 0, lam = 0 a graze is regular; its multipliers tell whether a real collision would cost
less.
"""

from __future__ import annotations

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.guess.hits import friction_of, response
from dmoc.motion.friction import sticks
from dmoc.program.blocks import NOWHERE, Index
from dmoc.program.hit_stages import STOP, Passage
from dmoc.program.laws.hit import RESTITUTIONS
from dmoc.program.transcription import Transcription
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
    nlp = nlp.designed(x)
    lay, law = nlp.layout, nlp.laws.impact
    hits = np.flatnonzero(law.impact & ~law.landing & ~law.grazing)
    if not len(hits):
        return np.zeros(0, dtype=np.intp)
    y, nodes, surfaces = nlp.physical(x), lay.collision_nodes[hits], lay.touch.surfaces[hits]
    rates = nlp.problem.model.gap_rates(
        y[lay.index_q[nodes]], y[lay.impact.v_a[hits]], lay.times(y)[nodes]
    )
    before = rates[np.arange(len(hits)), surfaces]
    faint = (before <= SUSPECT * nlp.scale.rate[surfaces]) | (x[lay.impact.lam[hits]] <= SUSPECT)
    return np.asarray(hits[faint])


def pushed(nlp: Transcription, x: Array, at: Index) -> Array:
    """The unknowns x, shape (n,), of a graze with some impulse at events ``at``, shape (k,), to
    look for a collision from."""
    x = x.copy()
    x[nlp.layout.impact.lam[at]] = PUSH
    return x


def pays(nlp: Transcription, outcome: Outcome) -> bool:
    """Whether the cost of a minimum that grazes falls where a graze becomes a collision."""
    grazing = np.flatnonzero(nlp.laws.impact.grazing)
    least = -PAYS * cost_size(nlp, outcome.x)
    return any(slope < least for i in grazing for slope in slopes(nlp, outcome, int(i)))


def slopes(nlp: Transcription, outcome: Outcome, i: int) -> list[float]:
    """Slopes of the cost of a minimum that grazes in the rate of approach of collision i, in the
    units of the program: one, or those of the two ends of what sliding that stops may be.

    A collision with the rate of approach s has gamma+ = -e s and lam = (1 + e) s / (n . M^-1 n), so
    that dJ/ds = e y + (1 + e) z / (n . M^-1 n) with the multipliers y of gamma = 0 and z of lam =
    0, the slope of the Lagrangian without bounds (equation :eq:`graze` of the theory). In a hit
    with friction that equation is one of the end of compression and stays true, and its impulse is
    that of its law of restitution; where sliding stops at an impulse P_h, it may do so anywhere
    from the begin to the end of its part of the impact.
    """
    nlp = nlp.designed(outcome.x)
    lay, x, duals = nlp.layout, outcome.x, outcome.duals
    slope = nlp.lagrangian_gradient(x, duals.y, duals.w) / nlp.sizes
    y, j = nlp.physical(x), int(lay.touch.surfaces[i])
    q, t = y[lay.index_q[lay.collision_nodes[i]]], float(lay.times(y)[lay.collision_nodes[i]])
    model, v = nlp.problem.models[i], y[lay.impact.v_a[i]]
    e = float(model.coefficients(nlp.problem.restitution_values, q, v, t)[j])
    by_impulse = float(slope[lay.impact.lam[i]])
    size = float(nlp.scale.rate[j])
    passage = next((p for p in lay.hit.passages if p.event == i), None)
    if passage is None or passage.whole:
        if passage is None:
            _, inertia = model.impulse_response(q, model.gap_slopes(q, t)[j, :-1], t)
        elif sticks(passage.friction[-1]):  # no graze is next to it: some sliding comes back
            return []
        else:
            mu = friction_of(nlp.problem, passage, q, t)
            inertia = _closing(response(nlp.problem, passage, q, t), mu, passage.friction[-1])
        if not inertia > 0:  # the constraints keep it from moving into the surface
            return []
        row = nlp.laws.impact.energy.index[i]
        # Fixed values at the goal may say it.
        by_rate = 0.0 if row == NOWHERE else float(duals.y[row]) / nlp.row_sizes[row]
        return [e * by_rate * size + (1 + e) * by_impulse * size / inertia]
    return _in_stages(nlp, outcome, passage, (by_impulse, slope), (q, t, e))


def _in_stages(
    nlp: Transcription,
    outcome: Outcome,
    p: Passage,
    slope: tuple[float, Array],
    impact: tuple[Array, float, float],
) -> list[float]:
    """Slopes for a hit with friction; none where the law lets no hit go this way."""
    (by_impulse, by_unknown), (q, t, e) = slope, impact
    A, mu = response(nlp.problem, p, q, t), friction_of(nlp.problem, p, q, t)
    first, last = (_closing(A, mu, friction) for friction in (p.friction[0], p.friction[-1]))
    row = nlp.laws.hit.restitution.index[p.event]
    by_row = 0.0 if row == NOWHERE else float(outcome.duals.y[row]) / nlp.row_sizes[row]

    def whole(slope: float, after: float) -> float:
        """By the impulse of compression, of which the whole one is a multiple: a graze has the row
        of Poisson's law, which another one leaves."""
        ratio = RESTITUTIONS[p.law].ratio(e, slope, after)
        return ratio * by_impulse + (ratio - 1 - e) * by_row

    size = float(nlp.scale.rate[p.surface])
    if STOP not in p.moments:
        if sticks(p.friction[0]):
            bears = abs(A[0, 1]) <= mu * A[1, 1]
            return [whole(first, first) * size / first] if bears else []
        # Sliding that is faster after the hit has its direction before it, which a graze has after.
        faster = max(p.friction[0] * _turning(A, mu, p.friction[0]), 0.0) * (1 + e)
        headed = nlp.laws.hit.heads.index[p.event, 1]
        heading = outcome.duals.w[headed - nlp.n_eq] / nlp.row_sizes[headed]
        return [(whole(first, first) + heading * faster) * size / first]
    stops = p.friction[0] * _turning(A, mu, p.friction[0]) < 0
    goes_on = (
        abs(A[0, 1]) <= mu * A[1, 1]
        if sticks(p.friction[-1])
        else p.friction[-1] * _turning(A, mu, p.friction[-1]) > 0
    )
    if not goes_on or (p.late and not stops):
        return []
    stop = float(by_unknown[nlp.layout.hit.P_h[p.event, STOP]])
    if p.late:
        to_end = whole(first, first) + (1 + e) * stop
        return [(whole(first, last) + stop) * size / first, to_end * size / first]
    after_all = [(whole(first, last) + stop) * size / first] if stops else []
    return [whole(last, last) * size / last, *after_all]


def _closing(A: Array, mu: float, friction: int) -> float:
    """Change of the rate of separation per normal impulse, while the contact slides or sticks, for
    the response A, shape (2, 2)."""
    along = -friction * mu if friction else -A[0, 1] / A[1, 1]
    return float(A[0, 0] + along * A[0, 1])


def _turning(A: Array, mu: float, s: int) -> float:
    """Change of the sliding velocity per normal impulse, while the contact slides, for the response
    A, shape (2, 2)."""
    return float(A[0, 1] - s * mu * A[1, 1])
