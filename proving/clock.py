"""A clock beside the coordinates of a linear problem whose surfaces are moved unevenly.

It is a unit mass that the force 1 moves from rest, c = t^2/2 with the momentum t. All steps have
this motion exactly at their ends. What is added at events, b_t t + b_tt t^2/2, is a function of its
state.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dmoc.base.discretisation import Discretisation, gauss
from dmoc.codegen.kernels import Array
from dmoc.proving.linear import LinearEvent, LinearPhase, LinearProblem, Rows
from dmoc.proving.state_costs import shapes_at_points


def with_clock(linear: LinearProblem, scheme: Discretisation) -> LinearProblem:
    """The problem with a clock, if something at its events changes unevenly with time."""
    at_events = [rows for event in linear.events for rows in vars(event).values()]
    if not any(rows.b_tt.any() for rows in (*at_events, linear.goal_zero, linear.goal_most)):
        return linear
    return replace(
        linear,
        phases=tuple(_phase(phase, scheme) for phase in linear.phases),
        events=tuple(_event(event) for event in linear.events),
        start=_beside(linear.start), tie=_beside(linear.tie),
        goal_zero=_rows(linear.goal_zero), goal_most=_rows(linear.goal_most),
    )  # fmt: skip


def _phase(phase: LinearPhase, scheme: Discretisation) -> LinearPhase:
    r, d, (_, rows, columns) = phase.size, scheme.degree, phase.P.shape
    values, slopes = shapes_at_points(scheme)
    share = gauss(d)[1]
    order = [*range(1, d), 0, d]  # of the equations: nodes inside, first, last
    stiff, push = ((slopes.T * share) @ slopes)[order], (share @ values)[order]
    P = np.zeros((3, d + 1, r + 1, (d + 1) * (r + 1) + columns - (d + 1) * r))
    own = _spread(phase.P, [r] * (d + 1)).reshape(3, d + 1, r, P.shape[3])
    P[:, :, :r] = own
    P[0, :, r, r : (d + 1) * (r + 1) : r + 1] = stiff
    P[2, :, r, -1] = push
    return replace(
        phase,
        P=P.reshape(3, rows + d + 1, P.shape[3]),
        paths=_spread(phase.paths, [r]),
        S=_spread(phase.S, [r] * (d + 2)),
    )


def _spread(rows: Array, sizes: list[int]) -> Array:
    """Rows with a column of zeros behind each of the first blocks of columns."""
    return np.insert(rows, np.cumsum(sizes), 0.0, axis=-1)


def _beside(rows: Array) -> Array:
    """Rows of a state (y, p) as those of one with a clock, whose state is zero there."""
    r = rows.shape[-1] // 2
    return _spread(rows, [r, r])


def _rows(rows: Rows) -> Rows:
    r = rows.A.shape[1] // 2
    A = _beside(rows.A)
    A[:, r], A[:, -1] = rows.b_tt, rows.b_t
    return replace(rows, A=A, b_t=0 * rows.b_t, b_tt=0 * rows.b_tt)


def _event(event: LinearEvent) -> LinearEvent:
    after = _rows(event.after)
    r = len(after.b) // 2
    A = np.insert(after.A, [r, 2 * r], 0.0, axis=0)
    A[r, after.A.shape[1] // 2 - 1], A[-1, -1] = 1.0, 1.0
    b, none = np.insert(after.b, [r, 2 * r], 0.0), np.zeros(2 * r + 2)
    return replace(
        event, after=Rows(A, b, none, none), zero=_rows(event.zero), most=_rows(event.most)
    )
