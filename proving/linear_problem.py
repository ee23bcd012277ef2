"""Reads a problem as numbers, where its motion is linear between events."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from dmoc.base.errors import ProblemError
from dmoc.base.names import momentum_name, velocity_name
from dmoc.codegen.kernels import Array
from dmoc.problem.problem import Problem
from dmoc.program.bounds import shortest_durations
from dmoc.proving.coverage import check_covered
from dmoc.proving.linear import DECIDED, LinearProblem, Rows, Times, through
from dmoc.proving.linear_events import add_range, coordinate, directions, event_of, rate
from dmoc.proving.linear_model import Frame, LinearModel
from dmoc.proving.linear_steps import LinearSteps
from dmoc.proving.recognition import SAME_VALUE, check_linear
from dmoc.proving.state_costs import cost_of_end

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
    events = [event_of(model, i, *frames[i : i + 2]) for i in range(len(problem.sequence))]
    start = _start(model, frames[0])
    zero, most, *ties = _ends(model, frames[0], frames[-1], start)
    hard = len(zero.b)
    squares, cost = _cost_of_end(model, frames[-1])
    zero = model.stacked([zero, squares], 2 * frames[-1].size)
    soft = (np.arange(len(zero.b)) >= hard).astype(float)
    if problem.ends_with_event:
        last = events.pop()
        size = last.after.A.shape[1]
        zero = model.stacked([through(zero, last.after), last.zero], size)
        most = model.stacked([through(most, last.after), last.most], size)
        cost = through(cost, last.after)
    soft = np.append(soft, np.zeros(len(zero.b) - len(soft)))
    tied = [_padded(tie, len(of.b)) for tie, of in zip(ties, (zero, most), strict=True)]
    kept = [of.of_state | tie.any(axis=1) for of, tie in zip((zero, most), tied, strict=True)]
    kept[0] |= soft > 0
    when = Times.among(zero, most, (~kept[0], ~kept[1]))
    if problem.ends_with_event:
        when = when.beside(last.when)
    return LinearProblem(
        tuple(steps.phase(i, frames[i]) for i in range(count)), tuple(events), start,
        np.vstack([tie[own] for tie, own in zip(tied, kept, strict=True)]),
        zero[kept[0]], most[kept[1]], cost, when, soft[kept[0]], _durations(problem)[:count],
        problem.final_time_bounds, model.shifts, model.sizes, np.diag(model.M),
        _left_out(model, steps),
    )  # fmt: skip


def _durations(problem: Problem) -> Array:
    """Ranges of the durations, shape (phases, 2); none is zero: boxes are halved by ratios."""
    low, high = shortest_durations(problem).T
    latest = problem.final_time_bounds[1]
    return np.stack([np.maximum(low, SHORTEST * latest), np.minimum(high, latest)], axis=1)


def _left_out(model: LinearModel, steps: LinearSteps) -> tuple[str, ...]:
    """Conditions that no bound takes into account: without them it is still one."""
    p = model.problem
    others = [name for j, name in enumerate(p.kernels.surfaces) if j not in model.flat]
    rates = {*map(velocity_name, p.kernels.coordinates)}
    return (
        *(f"the gap to {name} along phases" for name in others),
        *(f"bounds of {name}" for name in p.limits if name not in rates),
        *(f"the path constraint {name}" for name in p.kernels.manifest.path_constraints),
        *(("that steps share inputs where they meet",) if steps.parts_inputs else ()),
    )


def _start(model: LinearModel, frame: Frame) -> Array:
    """The state at the start, shape (1 + spreads, 2 r): its middle, and what is added to it by any
    shares from -1 to 1."""
    p, n = model.problem, model.problem.nq
    bounds, names = p.start_bounds, p.kernels.coordinates
    place = _within(bounds.position, p.coordinate_bounds)
    free = ~np.isfinite(place).all(axis=1)
    if free.any():
        name = names[int(np.argmax(free))]
        raise ProblemError(
            f"the start of {name} is free: proofs need a value, or a range with both ends, such as "
            f"bounds={{{name!r}: (-1, 1)}}."
        )
    given = bool(np.isfinite(bounds.momentum).all())
    speed = bounds.momentum if given else _within(bounds.velocity, p.velocity_bounds)
    if not np.isfinite(speed).all():
        name = velocity_name(names[int(np.argmin(np.isfinite(speed).all(axis=1)))])
        raise ProblemError(
            f"a velocity at the start is free: proofs need values, or ranges with both ends, such "
            f"as start={{{name!r}: (-1, 1)}}."
        )
    G, M, p_0 = model.momentum.A[:, :n], model.M, model.momentum.b
    by_place = 0 * G if given else G
    by_rate = np.eye(n) if given else M
    middle, reach = (np.concatenate([place, speed]) @ half for half in ((0.5, 0.5), (-0.5, 0.5)))
    momentum = by_place @ middle[:n] + by_rate @ middle[n:] + (0 if given else p_0)
    moved = frame.moved @ model.movers.at_start(frame.drives)
    first = frame.state(middle[:n] - frame.origin - moved, momentum)
    alone = np.ones(2 * n) if frame.moving == n else _freedoms(model, frame, given)
    if (reach > 0)[alone == 0].any():
        name = [*names, *map(velocity_name, names)][int(np.argmax((reach > 0) & (alone == 0)))]
        raise ProblemError(
            f"the start of {name} is a range, which a contact that is closed there decides or ties "
            "to others: proofs need its value."
        )
    spread = frame.state(
        np.hstack([np.eye(n), np.zeros((n, n))]) * reach, np.hstack([by_place, by_rate]) * reach
    ).T
    return np.vstack([first[None], spread[reach > 0]])


def _freedoms(model: LinearModel, frame: Frame, given: bool) -> Array:
    """Ones for coordinates and rates at the start that a mode leaves to be chosen alone, shape
    (2 nq,)."""
    Z = frame.Z[:, : frame.moving]
    places = np.abs(np.eye(len(Z)) - frame.Z @ frame.Z.T).max(axis=1) < DECIDED
    rates = np.abs(np.eye(len(Z)) - Z @ Z.T).max(axis=1) < DECIDED
    return np.concatenate([places, rates & (not given)]).astype(float)


def _ties(model: LinearModel, first: Frame, last: Frame) -> tuple[list[Rows], list[Rows]]:
    """What ``periodic`` asks of the states (end, start), zero and not positive."""
    zero, most = list[Rows](), list[Rows]()
    for relation in model.problem.relations:
        end = _state(model, last, relation.end)
        parts = [(f, _state(model, first, name)) for name, f in relation.terms]
        tie, begin = sum(-f * row.A for f, row in parts), model.movers.at_start(first.drives)
        rest = end.b - sum(f * (row.b + row.shifted @ begin) for f, row in parts)
        rows = Rows(np.hstack([end.A, np.asarray(tie)]), rest, end.shifted)

        def row(sign: float, value: float, rows: Rows = rows) -> Rows:
            return Rows(sign * rows.A, sign * (rows.b - value), sign * rows.shifted)

        add_range(zero, most, relation.low, relation.high, row)
    return zero, most


def _state(model: LinearModel, frame: Frame, name: str) -> Rows:
    """A coordinate, velocity or momentum as function of a state."""
    names = model.problem.kernels.coordinates
    for kind, row in ((str, coordinate), (velocity_name, rate), (momentum_name, _impetus)):
        for j, q in enumerate(names):
            if kind(q) == name:
                return row(model, frame, j, 1.0, 0.0)
    raise ProblemError(f"proofs do not cover the quantity {name} in periodic.")


def _cost_of_end(model: LinearModel, frame: Frame) -> tuple[Rows, Rows]:
    """The squares that the end costs, and a row that it costs beside, or none."""
    p, n = model.problem, model.problem.nq
    cost = cost_of_end(p, model.sizes, p.final_time_bounds[1] / p.phases)
    squares = model.rows(frame, cost.E[:, :n], cost.E[:, n:], cost.e)
    beside = [cost.slope[None]] if cost.slope.any() or cost.rest else []
    slopes = np.array(beside).reshape(-1, 2 * n)
    rest = np.full(len(slopes), cost.rest)
    return squares, model.rows(frame, slopes[:, :n], slopes[:, n:], rest)


def _ends(
    model: LinearModel, first: Frame, last: Frame, start: Array
) -> tuple[Rows, Rows, Array, Array]:
    """What vanishes at the end and what is not positive there, at the middle of the start, and what
    each of both adds for other starts, shapes (rows, 2 r)."""
    ends, ties, size = list[Rows](), list[Array](), 2 * last.size
    goals, pairs = _goal(model, last), _ties(model, first, last)
    goals[1].extend(_slides_at_end(model, last, goals[0]))
    pairs[1].extend(_slides_at_start(model, first, start, size))
    for goal, tied in zip(goals, pairs, strict=True):
        own = model.stacked(goal, size)
        both = model.stacked(tied, size + 2 * first.size)
        tie = both.A[:, size:]
        end = Rows(both.A[:, :size], both.b + tie @ start[0], both.shifted)
        ends.append(model.stacked([own, end], size))
        ties.append(np.vstack([np.zeros((len(own.b), 2 * first.size)), tie]))
    return ends[0], ends[1], ties[0], ties[1]


def _slides_at_end(model: LinearModel, last: Frame, zero: list[Rows]) -> Iterator[Rows]:
    """The directions of what slides at the end, where the goal does not decide its speed."""
    if model.problem.ends_with_event:
        return
    fixed = model.stacked(zero, 2 * last.size).A
    for row in directions(model, last, model.problem.touch.modes[-1]):
        rest = row.A - (row.A @ np.linalg.pinv(fixed)) @ fixed
        if np.abs(rest).max(initial=0.0) > SAME_VALUE * np.abs(row.A).max(initial=0.0):
            yield row


def _slides_at_start(model: LinearModel, first: Frame, start: Array, size: int) -> Iterator[Rows]:
    """The directions of what slides at the start, where its speed is a range, as functions of both
    ends."""
    for row in directions(model, first, model.problem.touch.modes[0]):
        if (start[1:] @ row.A[0]).any():
            rest = row.b + row.shifted @ model.movers.at_start(first.drives)
            yield Rows(np.hstack([np.zeros((1, size)), row.A]), rest, 0 * row.shifted)


def _padded(rows: Array, count: int) -> Array:
    """Rows with zeros below them, so many in all."""
    return np.vstack([rows, np.zeros((count - len(rows), rows.shape[1]))])


def _goal(model: LinearModel, frame: Frame) -> tuple[list[Rows], list[Rows]]:
    """What vanishes at the goal, and what is not positive there."""
    bounds, speeds = model.problem.goal_bounds, _speeds_at_goal(model)
    zero, most = list[Rows](), list[Rows]()
    for j in range(model.problem.nq):
        for (low, high), row in (
            (bounds.position[j], coordinate),
            (speeds[j], rate),
            (bounds.momentum[j], _impetus),
        ):
            add_range(zero, most, low, high, partial(row, model, frame, j))
    return zero, most


def _speeds_at_goal(model: LinearModel) -> Array:
    """Ranges of the velocities at the goal, shape (nq, 2), within their bounds where no event or
    momentum says so already."""
    p = model.problem
    low, high = p.goal_bounds.momentum.T
    decided = (low == high).all() and not model.momentum.A[:, : p.nq].any()
    if p.ends_with_event or decided:
        return p.goal_bounds.velocity
    return _within(p.goal_bounds.velocity, p.velocity_bounds)


def _within(ranges: Array, bounds: Array) -> Array:
    """What ranges and bounds have in common, shape (n, 2)."""
    low, high = np.maximum(ranges[:, 0], bounds[:, 0]), np.minimum(ranges[:, 1], bounds[:, 1])
    return np.stack([low, high], axis=1)


def _impetus(model: LinearModel, frame: Frame, j: int, sign: float, value: float) -> Rows:
    n, p = model.problem.nq, model.momentum
    row = sign * p.A[[j]]
    return model.rows(frame, row[:, :n], row[:, n:], np.array([sign * (p.b[j] - value)]))
