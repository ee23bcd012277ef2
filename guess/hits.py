"""First values of what happens within impacts with friction: the way that the words of a sequence
say, from the velocity before."""

from __future__ import annotations

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.mechanics.contact_forces import held_responses
from dmoc.motion.friction import friction_word
from dmoc.problem.problem import Problem
from dmoc.program.hit_stages import END, STOP, Passage
from dmoc.program.implied_values import hidden_values, with_forces
from dmoc.program.iterate import Iterate
from dmoc.program.laws.hit import RESTITUTIONS
from dmoc.program.laws.restitution import Spent
from dmoc.program.laws.whole_hits import WHOLE_HITS
from dmoc.program.layout import Layout
from dmoc.program.totals import peaks_at, totals_at


def follows(lay: Layout) -> bool:
    """Whether some unknowns are first values that follow from others: those within impacts, hidden
    ones, totals, peaks and forces."""
    sizes = (lay.index_totals.size, lay.index_peaks.size, lay.index_s.size, lay.force.count)
    return bool(lay.hit.passages) or any(sizes)


def completed(at: Iterate) -> Array:
    """Unknowns, shape (n,), with those that follow from the others: velocities and impulses within
    impacts with friction, from the velocities before them; totals, peaks and forces, from the
    motion; hidden ones, which are on the functions with kinks for which they stand."""
    lay = at.lay
    for p in lay.hit.passages:
        at = at.moved(_passed(at, p))
    if lay.index_totals.size or lay.index_peaks.size:
        x = at.x.copy()
        x[lay.index_totals], x[lay.index_peaks] = totals_at(at), peaks_at(at)
        at = at.moved(x)
    x = with_forces(at)
    if lay.index_s.size:
        x = x.copy()
        x[lay.index_s] = hidden_values(at, at.steps)
    return x


def jams(at: Iterate) -> tuple[str, ...]:
    """Sentences on impacts of a motion that slide to the end of compression where sliding presses
    the contact together (Painleve's paradox)."""
    problem, lay, sentences = at.problem, at.lay, []
    for p in lay.hit.passages:
        s = p.friction[p.moments.index(END) if END in p.moments else -1]
        node = lay.collision_nodes[p.event]
        q, time = at.q[node], float(at.t[node])
        A, mu = response(problem, p, q, time), friction_of(problem, p, q, time)
        if s and A[0, 0] <= s * mu * A[0, 1]:
            name = problem.kernels.surfaces[p.surface]
            sentences.append(
                f"sliding as {friction_word(s)} presses {name} together at event {p.event + 1} "
                "whatever its impulse (Painleve's paradox): it can only stop before compression "
                "ends"
            )
    return tuple(sentences)


def friction_of(problem: Problem, p: Passage, q: Array, t: float) -> float:
    """The coefficient of friction of an impact at a position, shape (nq,)."""
    there = problem.models[p.event].with_friction_at(q, t=t)
    return float(there.hit_friction[p.tangent])


def response(problem: Problem, p: Passage, q: Array, t: float) -> Array:
    """The matrix A = D M^-1 D^T of the directions of an impact at q, shape (nq,): what impulses
    along them change the rates of separation and of sliding by, shape (2, 2)."""
    D = _directions(problem, p, q, t)
    return np.asarray(D @ held_responses(problem.models[p.event], p.holding, q, D, t)[0])


def rates_and_response(
    problem: Problem, p: Passage, state: tuple[Array, Array, float]
) -> tuple[Array, Array]:
    """Rates of separation and of sliding at a state (q, v, t) before an impact, and the matrix of
    :func:`response`."""
    return _rates(problem, p, state), response(problem, p, state[0], state[2])


def _rates(problem: Problem, p: Passage, state: tuple[Array, Array, float]) -> Array:
    gap_rates, slide_rates = problem.model.gap_rates(*state), problem.model.slide_rates(*state)
    return np.array([-gap_rates[p.surface], *slide_rates[list(p.tangents)]])


def _directions(problem: Problem, p: Passage, q: Array, t: float) -> Array:
    """The directions (-grad g, grad tau), shape (2, nq), (3, nq) where the tangent has two."""
    normal = problem.model.gap_slopes(q, t)[p.surface, :-1]
    return np.vstack([-normal, problem.model.tangent_slopes(q, t)[list(p.tangents), :-1]])


def _passed(at: Iterate, p: Passage) -> Array:
    """Unknowns with the impulses of one impact, the velocities within it and the one after it."""
    problem, lay, i = at.problem, at.lay, p.event
    model, node = problem.models[i], lay.collision_nodes[i]
    q, v, t = at.q[node], at.x[lay.impact.v_a[i]], float(at.t[node])
    D = _directions(problem, p, q, t)
    pushed, normal, tangential = held_responses(model, p.holding, q, D, t)
    rates, A = _rates(problem, p, (q, v, t)), D @ pushed
    e = float(model.coefficients(problem.restitution_values, q, v, t)[p.surface])
    mu = friction_of(problem, p, q, t)
    if p.whole:
        lam = WHOLE_HITS[p.law](
            rates, A, mu, e, float(model.tangential_restitution[p.tangent])
        ).path
    else:
        lam = _impulses(p, rates, A, (e, mu))
    if not np.isfinite(lam).all() or not np.isfinite(pushed).all():
        return at.x
    x, moments = at.x.copy(), list(p.moments)
    x[lay.hit.P_h[i, moments]], x[lay.hit.T_h[i, moments]] = lam[:-1, 0], lam[:-1, 1]
    x[lay.hit.v_h[i, moments]] = v + lam[:-1] @ pushed.T
    closed, rubs = list(p.holding.closed), list(p.holding.rubbing)
    unknowns = [(lay.held.P_b[i, m], lay.held.T_b[i, m]) for m in moments]
    unknowns.append((lay.contact.P_c[i], lay.contact.T_c[i]))
    for (P, T), beside, friction in zip(unknowns, lam @ normal, lam @ tangential, strict=True):
        x[P[closed]], x[T[rubs]] = beside[closed], friction[rubs]
    x[lay.impact.lam[i]], x[lay.contact.T_c[i, list(p.tangents)]] = lam[-1, 0], lam[-1, 1:]
    x[lay.impact.v_c[i]] = v + pushed @ lam[-1]
    return x


def _sticking(A: Array, mu: float) -> float:
    """The tangential impulse beside a unit normal one where a contact sticks."""
    return float(np.clip(-A[1, 0] / A[1, 1], -mu, mu)) if A[1, 1] > 0 else 0.0


def _impulses(p: Passage, rates: Array, A: Array, law: tuple[float, float]) -> Array:
    """Impulses (P, T) until each moment and of the whole impact, shape (moments + 1, 2).

    Where the way is not that of the law from these rates, the impulses are cut to what one of an
    approach could have.
    """
    e, mu = law
    hardest = max(-rates[0], 0.0) / A[0, 0]
    impulses, at, W, full = [], np.zeros(2), 0.0, None
    for moment, s in zip((*p.moments, None), p.friction, strict=True):
        slope = -s * mu if s else _sticking(A, mu)
        way = A @ np.array([1.0, slope])
        now, most = rates + A @ at, np.inf
        if full is not None:
            most = RESTITUTIONS[p.law].left(e, full, Spent(at[0], W), now[0], way[0])
        if moment == STOP:
            dP = -now[1] / way[1] if now[1] * way[1] < 0 else 0.0
        elif moment == END or p.lands:
            dP = -now[0] / way[0] if way[0] > 0 else hardest
        else:
            dP = most
        dP = min(max(dP, 0.0), most)
        W += dP * (now[0] + way[0] * dP / 2)
        at = at + dP * np.array([1.0, slope])
        if moment == END:
            full = Spent(at[0], W)
        impulses.append(at)
    return np.array(impulses)
