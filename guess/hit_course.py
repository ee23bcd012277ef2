"""The way through an impact with friction that its law takes from a state before it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.guess.hits import rates_and_response
from dmoc.mechanics.contact_mode import Course
from dmoc.motion.friction import SLIDING, after_stop, sliding_with
from dmoc.problem.problem import Problem
from dmoc.program.hit_stages import Passage
from dmoc.program.laws.whole_hits import WHOLE_HITS
from dmoc.program.layout import Layout


def course_of(rates: Array, A: Array, mu: float, e: float) -> Course:
    """The course of an impact (:eq:`poisson`) from the rates of separation, negative where the
    bodies approach, and of sliding (2,), and what impulses along normal and tangent change them by
    (2, 2).  Until sliding stops, which says it, all laws of restitution are one."""
    n, sigma = min(float(rates[0]), 0.0), float(rates[1])
    holds = abs(A[1, 0]) <= mu * A[1, 1]
    s = sliding_with(sigma) or (SLIDING[0] if holds else sliding_with(A[1, 0]))
    closing, turning = A[0, 0] - s * mu * A[0, 1], A[1, 0] - s * mu * A[1, 1]
    if sigma == 0 and not holds:
        return Course(s)
    stop = -sigma / turning if s * turning < 0 else np.inf
    compression = -n / closing if closing > 0 else np.inf
    if stop >= (1 + e) * compression and sigma != 0:
        return Course(s)
    sticking, back = after_stop(s)
    return Course(s, sticking if holds else back, bool(stop > compression))


def courses_at(problem: Problem, states: Sequence[tuple[Array, Array, float]]) -> dict[int, Course]:
    """The courses that the law takes in the hits of a problem, whatever its words say, from the
    states (q, v, t) before its events."""
    courses = dict[int, Course]()
    for p in Layout.of(problem).hit.passages:
        course = None if p.lands else course_at(problem, p, states[p.event])
        if course is not None:
            courses[p.event] = course
    return courses


def course_at(problem: Problem, p: Passage, state: tuple[Array, Array, float]) -> Course | None:
    """The course that the law takes in one hit from the state (q, v, t) before it; None where that
    is no state."""
    rates, A = rates_and_response(problem, p, state)
    if not (np.isfinite(A).all() and np.isfinite(rates).all()):
        return None
    q, _, t = state
    model = problem.models[p.event].with_friction_at(q, t=t)
    e = float(model.coefficients(problem.restitution_values, *state)[p.surface])
    mu, e_t = float(model.hit_friction[p.tangent]), float(model.tangential_restitution[p.tangent])
    return (
        Course(WHOLE_HITS[p.law](rates, A, mu, e, e_t).friction)
        if p.whole
        else course_of(rates, A, mu, e)
    )


def states_before(problem: Problem, x: Array) -> list[tuple[Array, Array, float]]:
    """States (q, v, t) before the events in unknowns x, shape (n,): q and v of shape (nq,) each."""
    lay = Layout.of(problem)
    t, nodes = lay.times(x), lay.collision_nodes
    return [
        (x[lay.index_q[node]], x[v], float(t[node]))
        for node, v in zip(nodes, lay.impact.v_a, strict=True)
    ]
