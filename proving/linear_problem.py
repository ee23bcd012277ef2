"""Reads a problem as numbers, where its motion is linear between events."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from dmoc.base.errors import ProblemError
from dmoc.base.names import momentum_name, velocity_name
from dmoc.codegen.kernels import Array
from dmoc.mechanics.contacts import NOWHERE
from dmoc.problem.problem import Problem
from dmoc.program.bounds import shortest_durations
from dmoc.proving.coverage import check_covered
from dmoc.proving.linear import LinearEvent, LinearProblem, Rows, through
from dmoc.proving.linear_model import Frame, LinearModel
from dmoc.proving.linear_steps import LinearSteps
from dmoc.proving.recognition import check_linear

# A value at the start or at the goal that a mode decides, in the coordinates of the mode.
DECIDED = 1e-12
# The shortest phase, relative to the final time, where the program knows none.
SHORTEST = 1e-8


def linear_problem(problem: Problem) -> LinearProblem:
    """A problem as numbers; raise ProblemError for what is not linear or not covered."""
    check_covered(problem)
    model = LinearModel(problem)
    check_linear(problem, model.sizes)
    modes = problem.touch.modes
    frames = [model.frame(mode) for mode in modes]
    steps = LinearSteps(model)
    steps.check_time()
    count = problem.phases - problem.ends_with_event
    events = [_event(model, i, *frames[i : i + 2]) for i in range(len(problem.sequence))]
    start = _start(model, frames[0])
    zero, most, *ties = _ends(model, frames[0], frames[-1], start[0])
    if problem.ends_with_event:
        last = events.pop()
        size = last.after.A.shape[1]
        zero = Rows.stacked([through(zero, last.after), last.zero], size)
        most = Rows.stacked([through(most, last.after), last.most], size)
    return LinearProblem(
        tuple(steps.phase(i, frames[i]) for i in range(count)), tuple(events), start,
        np.vstack([_padded(tie, len(of.b)) for tie, of in zip(ties, (zero, most), strict=True)]),
        zero, most, _durations(problem)[:count],
        problem.final_time_bounds, model.sizes, np.diag(model.M), _left_out(model),
    )  # fmt: skip


def _durations(problem: Problem) -> Array:
    """Ranges of the durations, shape (phases, 2); none is zero: boxes are halved by ratios."""
    low, high = shortest_durations(problem).T
    latest = problem.final_time_bounds[1]
    return np.stack([np.maximum(low, SHORTEST * latest), np.minimum(high, latest)], axis=1)


def _left_out(model: LinearModel) -> tuple[str, ...]:
    """Conditions that no bound takes into account: without them it is still one."""
    p = model.problem
    others = [name for j, name in enumerate(p.kernels.surfaces) if j not in model.flat]
    moving = [p.kernels.surfaces[j] for j, gap in model.flat.items() if gap.A[0, p.nq] != 0]
    return (
        *(f"the gap to {name} along phases" for name in (*others, *moving)),
        *(f"bounds of {name}" for name in p.limits),
        *(f"the path constraint {name}" for name in p.kernels.manifest.path_constraints),
        *(("that contacts which last only push",) if p.lasting else ()),
    )


def _event(model: LinearModel, i: int, before: Frame, after: Frame) -> LinearEvent:
    """What happens between two phases: Newton's law, or velocities that what is closed allows."""
    p, n = model.problem, model.problem.nq
    event = p.touch.events[i]
    zero, most = list[Rows](), list[Rows]()
    jump, offset = np.eye(n), np.zeros(n)  # v after it is jump v + offset
    for j in (event.hit, *event.lands):
        if j == NOWHERE:
            continue
        gap = model.gap(j)
        normal, rate = gap.A[:, :n], gap.A[:, n]
        zero.append(model.rows(before, normal, 0 * normal, gap.b, rate))
        most.append(model.rows(before, 0 * normal, -normal, -rate))  # it comes nearer
        if j == event.hit:
            change = np.linalg.solve(model.M, normal[0])
            share = (1 + _restitution(p, j)) * change / (normal[0] @ change)
            jump, offset = jump - np.outer(share, normal[0]), offset - share * rate
    for j, (low, high) in enumerate(p.via_bounds[i]):
        _add_range(zero, most, low, high, partial(_coordinate, model, before, j))
    V, v_0 = model.velocity(before)
    G, p_0, r = model.momentum.A[:, :n], model.momentum.b, before.size
    position = np.hstack([before.Z, np.zeros((n, r))])
    momentum = model.M @ jump @ V + G @ position
    shift = model.M @ (jump @ v_0 + offset) + G @ before.origin + p_0
    state = Rows(
        np.vstack([after.inverse @ position, after.left @ momentum]),
        np.concatenate([after.inverse @ (before.origin - after.origin), after.left @ shift]),
        np.zeros(2 * after.size),
    )
    return LinearEvent(state, *(Rows.stacked(rows, 2 * r) for rows in (zero, most)))


def _restitution(problem: Problem, j: int) -> float:
    e = float(problem.restitution_values[j])
    if np.isnan(e):
        raise ProblemError(
            f"the restitution of {problem.kernels.surfaces[j]} depends on the speed: proofs cover "
            "a constant coefficient."
        )
    return e


def _start(model: LinearModel, frame: Frame) -> Array:
    """The state at the start, shape (1 + spreads, 2 r): its middle, and what is added to it by any
    shares from -1 to 1."""
    p, n = model.problem, model.problem.nq
    bounds, names = p.start_bounds, p.kernels.coordinates
    place = np.stack(
        [
            np.maximum(bounds.position[:, 0], p.coordinate_bounds[:, 0]),
            np.minimum(bounds.position[:, 1], p.coordinate_bounds[:, 1]),
        ],
        axis=1,
    )
    free = ~np.isfinite(place).all(axis=1)
    if free.any():
        name = names[int(np.argmax(free))]
        raise ProblemError(
            f"the start of {name} is free: proofs need a value, or a range with both ends, such as "
            f"bounds={{{name!r}: (-1, 1)}}."
        )
    given = np.isfinite(bounds.momentum).all()
    rate = bounds.momentum if given else bounds.velocity
    if not np.isfinite(rate).all():
        name = velocity_name(names[int(np.argmin(np.isfinite(rate).all(axis=1)))])
        raise ProblemError(
            f"a velocity at the start is free: proofs need values, or ranges with both ends, such "
            f"as start={{{name!r}: (-1, 1)}}."
        )
    G, M, p_0 = model.momentum.A[:, :n], model.M, model.momentum.b
    by_place = 0 * G if given else G
    by_rate = np.eye(n) if given else M
    middle, reach = (np.concatenate([place, rate]) @ half for half in ((0.5, 0.5), (-0.5, 0.5)))
    momentum = by_place @ middle[:n] + by_rate @ middle[n:] + (0 if given else p_0)
    first = np.concatenate([frame.inverse @ (middle[:n] - frame.origin), frame.left @ momentum])
    if frame.size < n and reach.any():
        raise ProblemError(
            "the start is a range while a contact is closed: proofs need values there."
        )
    spread = reach[:, None] * np.block([[np.eye(n), by_place.T], [np.zeros((n, n)), by_rate.T]])
    return np.vstack([first[None], spread[reach > 0]]) if frame.size == n else first[None]


def _ties(model: LinearModel, first: Frame, last: Frame) -> tuple[list[Rows], list[Rows]]:
    """What ``periodic`` asks of the states (end, start), zero and not positive."""
    zero, most = list[Rows](), list[Rows]()
    for relation in model.problem.relations:
        end = _state(model, last, relation.end)
        parts = [(f, _state(model, first, name)) for name, f in relation.terms]
        tie = sum(-f * row.A for f, row in parts)
        rest = end.b - sum(f * row.b for f, row in parts)
        rows = Rows(np.hstack([end.A, np.asarray(tie)]), rest, np.zeros(1))

        def row(sign: float, value: float, rows: Rows = rows) -> Rows:
            return Rows(sign * rows.A, sign * (rows.b - value), rows.b_t)

        _add_range(zero, most, relation.low, relation.high, row)
    return zero, most


def _state(model: LinearModel, frame: Frame, name: str) -> Rows:
    """A coordinate, velocity or momentum as function of a state."""
    names = model.problem.kernels.coordinates
    for kind, row in ((str, _coordinate), (velocity_name, _rate), (momentum_name, _impetus)):
        for j, q in enumerate(names):
            if kind(q) == name:
                return row(model, frame, j, 1.0, 0.0)
    raise ProblemError(f"proofs do not cover the quantity {name} in periodic.")


def _ends(
    model: LinearModel, first: Frame, last: Frame, start: Array
) -> tuple[Rows, Rows, Array, Array]:
    """What vanishes at the end and what is not positive there, at the middle of the start, and what
    each of both adds for other starts, shapes (rows, 2 r)."""
    ends, ties, size = list[Rows](), list[Array](), 2 * last.size
    for goal, tied in zip(_goal(model, last), _ties(model, first, last), strict=True):
        own = Rows.stacked(goal, size)
        both = Rows.stacked(tied, size + 2 * first.size)
        tie = both.A[:, size:]
        end = Rows(both.A[:, :size], both.b + tie @ start, both.b_t)
        ends.append(Rows.stacked([own, end], size))
        ties.append(np.vstack([np.zeros((len(own.b), 2 * first.size)), tie]))
    return ends[0], ends[1], ties[0], ties[1]


def _padded(rows: Array, count: int) -> Array:
    """Rows with zeros below them, so many in all."""
    return np.vstack([rows, np.zeros((count - len(rows), rows.shape[1]))])


def _goal(model: LinearModel, frame: Frame) -> tuple[list[Rows], list[Rows]]:
    """What vanishes at the goal, and what is not positive there."""
    bounds = model.problem.goal_bounds
    zero, most = list[Rows](), list[Rows]()
    for j in range(model.problem.nq):
        for (low, high), row in (
            (bounds.position[j], _coordinate),
            (bounds.velocity[j], _rate),
            (bounds.momentum[j], _impetus),
        ):
            _add_range(zero, most, low, high, partial(row, model, frame, j))
    return zero, most


def _coordinate(model: LinearModel, frame: Frame, j: int, sign: float, value: float) -> Rows:
    row = sign * np.eye(model.problem.nq)[[j]]
    return model.rows(frame, row, 0 * row, np.array([-sign * value]))


def _rate(model: LinearModel, frame: Frame, j: int, sign: float, value: float) -> Rows:
    row = sign * np.eye(model.problem.nq)[[j]]
    return model.rows(frame, 0 * row, row, np.array([-sign * value]))


def _impetus(model: LinearModel, frame: Frame, j: int, sign: float, value: float) -> Rows:
    n, p = model.problem.nq, model.momentum
    row = sign * p.A[[j]]
    return model.rows(frame, row[:, :n], row[:, n:], np.array([sign * (p.b[j] - value)]))


def _add_range(
    zero: list[Rows], most: list[Rows], low: float, high: float, row: Callable[[float, float], Rows]
) -> None:
    """Add what keeps a value within a range; ``row`` is the value's distance from a number, with a
    sign. What a mode decides is left out where it agrees."""
    if low == high:
        rows = row(1.0, low)
        if np.abs(rows.A).max() > DECIDED or abs(rows.b[0]) > DECIDED:
            zero.append(rows)
        return
    if np.isfinite(high):
        most.append(row(1.0, high))
    if np.isfinite(low):
        most.append(row(-1.0, low))
