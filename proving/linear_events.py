"""The events of a problem that moves linearly, as numbers: Newton's law of what is hit, impulses of
what lands or stays closed, and what holds before and after."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np

from dmoc.base.errors import ProblemError
from dmoc.base.records import record
from dmoc.codegen.kernels import Array
from dmoc.mechanics.contact_mode import Mode
from dmoc.mechanics.contacts import NOWHERE, RAIL
from dmoc.problem.problem import Problem
from dmoc.proving.linear import LinearEvent, Rows, Times
from dmoc.proving.linear_model import Frame, LinearModel
from dmoc.proving.shared_forces import told_of
from dmoc.proving.step_conditions import sides


@record(frozen=True, eq=False)
class Impact:
    """What an event does at shifts s of surfaces: velocities v are jump v + offset s after it, the
    impulses of the surfaces and tangents that take any are by_v v + by s, in the directions
    ``pushes``; shapes of ``offset`` and ``by`` (nq, shifts) and (impulses, shifts)."""

    jump: Array
    offset: Array
    by_v: Array
    by: Array
    pushes: Array
    surfaces: tuple[int, ...]
    tangents: tuple[int, ...]


def event_of(model: LinearModel, i: int, before: Frame, after: Frame) -> LinearEvent:
    """What happens between two phases."""
    p, n = model.problem, model.problem.nq
    event = p.touch.events[i]
    zero, most = list[Rows](), list[Rows]()
    none = np.zeros((1, n))
    for j in (event.hit, *event.lands):
        if j != NOWHERE:
            gap = model.gap(j)
            zero.append(model.rows(before, gap.A, none, gap.b, model.shift(j)[:1]))
    zero += _lifts(model, i, before)
    if event.impact:
        gap, speed = model.gap(event.surface), model.shift(event.surface)[1:2]
        most.append(model.rows(before, none, -gap.A, 0 * gap.b, -speed))  # it comes nearer
    impact = impact_of(model, i)
    zero += [*_stops(model, i, before, impact)]
    most += [*_directions(model, i, before, impact), *_impulses(model, before, impact)]
    most += [*_speeds(model, before, impact)]
    for j, (low, high) in enumerate(p.via_bounds[i]):
        add_range(zero, most, low, high, partial(coordinate, model, before, j))
    v = model.velocity(before)
    G, p_0, r = model.momentum.A[:, :n], model.momentum.b, before.size
    position = np.hstack([before.Z, np.zeros((n, r))])
    momentum = model.M @ impact.jump @ v.A + G @ position
    rest = model.M @ impact.jump @ v.b + G @ before.origin + p_0
    moved = model.M @ (impact.jump @ v.shifted + impact.offset) + G @ before.moved
    after_it = Rows(
        after.state(position, momentum), after.state(before.origin - after.origin, rest),
        after.state(before.moved - after.moved, moved),
    )  # fmt: skip
    zero = [row for row in zero if not row.is_decided]
    most = [row for row in most if not row.is_constant]
    own = [model.stacked(rows, 2 * r) for rows in (zero, most)]
    of_state = [rows.of_state for rows in own]
    when = Times.among(own[0], own[1], (~of_state[0], ~of_state[1]))
    return LinearEvent(after_it, own[0][of_state[0]], own[1][of_state[1]], when)


def impact_of(model: LinearModel, i: int) -> Impact:
    """Impulses of what is hit, lands or stays closed at an event: they stop what stays closed and
    sticks, and turn the rate of what is hit by Newton's law."""
    p, n = model.problem, model.problem.nq
    event, before, after = p.touch.events[i], *p.touch.modes[i : i + 2]
    count = model.movers.count
    if not event.impact:
        none = np.zeros((0, n))
        return Impact(np.eye(n), np.zeros((n, count)), none, np.zeros((0, count)), none, (), ())
    stays = after.among(
        [j for j in after.closed if j in (*before.closed, *event.lands)],
        lambda k: p.touch.contacts.supports[k] != RAIL,
    )
    hits = () if event.hit == NOWHERE else (event.hit,)
    surfaces = (*hits, *stays.closed)
    gaps = [model.gap(j).A[0] for j in surfaces]
    E = np.array([*gaps, *(model.tangent(k) for k in stays.sticking)])
    D = np.array([*gaps[: len(hits)], *model.pushes(stays)])
    # E v+ = share v- + rates and v+ = v- + change impulses; what follows from others shares them
    share, rates = 0 * E, -model.movers.speeds(surfaces, stays.sticking)
    for j in hits:
        e = _restitution(p, j)
        share[0], rates[0] = -e * E[0], -(1 + e) * model.shift(j)[1]
    change = np.linalg.solve(model.M, D.T)
    inverse = np.linalg.pinv(E @ change)
    by_v, by = inverse @ (share - E), inverse @ rates
    return Impact(np.eye(n) + change @ by_v, change @ by, by_v, by, D, surfaces, stays.sticking)


def _stops(model: LinearModel, i: int, before: Frame, impact: Impact) -> Iterator[Rows]:
    """What sticks after an event and takes no impulse there has no speed, nor has what turns."""
    touch = model.problem.touch
    for k in sorted({*touch.modes[i + 1].sticking, *np.flatnonzero(touch.stops[i]).tolist()}):
        if k not in impact.tangents:
            yield _after(model, before, impact, model.tangent(k), model.movers.of_tangent(k)[1])


def _directions(model: LinearModel, i: int, before: Frame, impact: Impact) -> Iterator[Rows]:
    """What slides after an impact does so in its direction, and before it in that of then."""
    touch = model.problem.touch
    for k, s in touch.modes[i + 1].sliding:
        if not touch.rubs_in_impact[i, k]:
            continue
        back, moved = -s * model.tangent(k), -s * model.movers.of_tangent(k)[1]
        sign = -1.0 if touch.turns[i, k] else 1.0
        yield model.rows(before, 0 * back[None], sign * back[None], np.zeros(1), sign * moved)
        yield _after(model, before, impact, back, moved)


def _after(model: LinearModel, before: Frame, impact: Impact, row: Array, moved: Array) -> Rows:
    """A function row v + moved s of the velocity after an event."""
    none = 0 * row[None]
    return model.rows(
        before, none, row[None] @ impact.jump, np.zeros(1), moved + row @ impact.offset
    )


def _lifts(model: LinearModel, i: int, before: Frame) -> Iterator[Rows]:
    """The sum of the forces of what lifts off, which vanishes: F of M a = F + pushes f, where the
    accelerations of what is closed are those of the surfaces."""
    n, mode = model.problem.nq, model.problem.touch.modes[i]
    for one in model.liftoffs:
        if one.event != i:
            continue
        rows = [*(model.gap(j).A[0] for j in mode.closed), *map(model.tangent, mode.sticking)]
        E, D = np.array(rows), np.array(model.pushes(mode))
        free = (
            np.linalg.solve(model.M, model.force.A),
            np.linalg.solve(model.M, model.force.b + model.drag(mode)),
        )
        inverse = np.linalg.inv(E @ np.linalg.solve(model.M, D.T))
        own = inverse[[j in one.surfaces for j in mode.closed] + [False] * len(mode.sticking)]
        by_state, rest = own.sum(axis=0) @ E @ free[0], own.sum(axis=0) @ E @ free[1]
        speeds = model.movers.speeds(mode.closed, mode.sticking)
        bent = own.sum(axis=0) @ model.movers.derived(speeds)
        yield model.rows(
            before, by_state[None, :n], by_state[None, n : 2 * n], np.array([rest]), bent
        )


def directions(model: LinearModel, frame: Frame, mode: Mode) -> Iterator[Rows]:
    """What slides in a mode does so in its direction."""
    for k, s in mode.sliding:
        back, moved = -s * model.tangent(k)[None], -s * model.movers.of_tangent(k)[1]
        row = model.rows(frame, 0 * back, back, np.zeros(1), moved)
        if not row.is_decided:
            yield row


def _speeds(model: LinearModel, before: Frame, impact: Impact) -> Iterator[Rows]:
    """Velocities on both sides of an event are within their bounds; what it does not change is
    said once."""
    for j, sign, most in sides(model.problem.velocity_bounds):
        row = sign * np.eye(model.problem.nq)[[j]]
        yield rate(model, before, j, sign, sign * most)
        after = row @ impact.jump
        if (after != row).any() or impact.offset[j].any():
            yield model.rows(before, 0 * row, after, np.array([-most]), row @ impact.offset)


def _impulses(model: LinearModel, before: Frame, impact: Impact) -> Iterator[Rows]:
    """What takes an impulse only pushes, and takes no more than its friction along it, in sum where
    surfaces share theirs; the impulse of one surface alone does so."""
    if len(impact.pushes) > 1:
        none = np.zeros((1, model.problem.nq))
        cones = ((row, 0.0) for row in model.cones(impact.surfaces, impact.tangents))
        for cone, _ in told_of(impact.pushes, cones):
            row = cone[None]
            yield model.rows(before, none, row @ impact.by_v, np.zeros(1), row @ impact.by)


def _restitution(problem: Problem, j: int) -> float:
    e = float(problem.restitution_values[j])
    if np.isnan(e):
        raise ProblemError(
            f"the restitution of {problem.kernels.surfaces[j]} depends on the speed: proofs cover "
            "a constant coefficient."
        )
    return e


def coordinate(model: LinearModel, frame: Frame, j: int, sign: float, value: float) -> Rows:
    """A coordinate's distance from a value, with a sign."""
    row = sign * np.eye(model.problem.nq)[[j]]
    return model.rows(frame, row, 0 * row, np.array([-sign * value]))


def rate(model: LinearModel, frame: Frame, j: int, sign: float, value: float) -> Rows:
    """A velocity's distance from a value, with a sign."""
    row = sign * np.eye(model.problem.nq)[[j]]
    return model.rows(frame, 0 * row, row, np.array([-sign * value]))


def add_range(
    zero: list[Rows], most: list[Rows], low: float, high: float, row: Callable[[float, float], Rows]
) -> None:
    """Add what keeps a value within a range; ``row`` is the value's distance from a number, with a
    sign. What a mode decides is left out where it agrees."""
    if low == high:
        rows = row(1.0, low)
        if not rows.is_decided:
            zero.append(rows)
        return
    if np.isfinite(high):
        most.append(row(1.0, high))
    if np.isfinite(low):
        most.append(row(-1.0, low))
