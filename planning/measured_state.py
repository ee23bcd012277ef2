"""Measured states: read by name, moved to where contacts and constraints hold, and which events of
the plan they show to be over."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from dmoc.base.arguments import array, check_known, is_number, number, shown
from dmoc.base.errors import ProblemError
from dmoc.base.names import velocity_name
from dmoc.codegen.kernels import Array
from dmoc.mechanics.attitudes import in_coordinates, in_rates, said_of
from dmoc.mechanics.conditions import (
    GAPS,
    JOINTS,
    Condition,
    Conditions,
    answers,
    conditions_of,
)
from dmoc.mechanics.contact_mode import Mode
from dmoc.mechanics.model_values import by_name
from dmoc.mechanics.projection import onto_places
from dmoc.mechanics.sequence_words import parts_of
from dmoc.motion.trajectory import Collision
from dmoc.problem.problem import Problem
from dmoc.problem.reach import rate_sizes

# Where a surface that is open is measured to be entered, a state is put so far in front of it, as a
# share of how far the coordinates move: at it a motion could not move into it any more.
IN_FRONT = 1e-6
# Shares of the reach of a coordinate, and of how fast the state moves, that projections leave of
# zero, where sizes of gaps may begin.
LEFT_OF_ZERO = 1e-13
# How early an event may be, as a share of the phase before it: a foot that scuffs the floor in the
# middle of its swing has not landed.
EARLY = 0.25
# A state that is further beyond an open surface, as a share of how far the coordinates move, is no
# state of the model.
BEYOND = 0.05

# A sliding velocity against its word by more than this share of what makes the reach of the
# coordinates in the time of a problem is no error of a measurement.
AGAINST = 0.25

MeasuredState = tuple[Array, Array]


def read_state(problem: Problem, state: Any) -> MeasuredState:
    """Positions and velocities of a state by name, or of (q, v) as one array or two."""
    names = problem.kernels.coordinates
    rates = [velocity_name(name) for name in names]
    if isinstance(state, Mapping):
        entries = in_coordinates(problem.kernels, by_name(state, "state"), "state")
        entries = in_rates(problem.kernels, entries, entries, "state")
        for name in entries:
            check_known(
                name, [*names, *rates], "coordinate or velocity", "in the state",
                said=said_of(problem.kernels),
            )  # fmt: skip
        missing = [name for name in names if name not in entries]
        if missing:
            raise ProblemError(
                f"the state leaves {', '.join(missing)} out: expected every coordinate, and "
                "velocities that are not zero."
            )
        q, v = (
            np.array([number(entries.get(name, 0.0), f"{name} in the state") for name in part])
            for part in (names, rates)
        )
        return q, v
    halves = [array(part) for part in (state if _is_pair(state) else (state,))]
    parts = np.concatenate([np.ravel(np.nan if half is None else half) for half in halves])
    if parts.shape != (2 * len(names),) or not np.isfinite(parts).all():
        raise ProblemError(
            f"state = {shown(state)}: expected a mapping by name, or {2 * len(names)} finite "
            f"numbers: {', '.join([*names, *rates])}."
        )
    q, v = np.split(parts, 2)
    return q, v


def _is_pair(state: Any) -> bool:
    return isinstance(state, (tuple, list)) and len(state) == 2 and not is_number(state[0])


def consistent(problem: Problem, mode: Mode, state: MeasuredState) -> MeasuredState:
    """The state moved to where the constraints hold and the mode's contacts are closed, as near as
    the reach of the coordinates and the masses of the velocities say; within bounds, and in front
    of what is open."""
    model, (q, v) = problem.model, state
    q, v = (
        np.clip(x, *box.T)
        for x, box in ((q, problem.coordinate_bounds), (v, problem.velocity_bounds))
    )
    passed = *problem.ignored, *model.contacts.named(model.contacts.of_grips)
    seen = [j for j, name in enumerate(model.contacts.surfaces) if name not in passed]
    joints = [Condition(JOINTS, i) for i in range(model.nj)]
    on, aside = list(mode.closed), np.zeros(model.nj + len(mode.closed))
    while True:
        if model.nj or on:
            kept = Conditions((*joints, *(Condition(GAPS, j) for j in on)), ())
            q = onto_places(model, kept, q, 0.0, problem.reach, aside)
            q = np.where(np.abs(q) <= LEFT_OF_ZERO * problem.reach, 0.0, q)
        gaps = model.barriers(q, 0.0, model.within_rounding(q))
        sizes = np.abs(model.gap_slopes(q)[:, :-1]) @ problem.reach
        entered = [j for j in seen if j not in on and gaps[j] > -IN_FRONT * sizes[j]]
        if not entered:
            _check_sliding(problem, mode, q, v)
            return q, _along(problem, mode, q, v)
        _check_near(problem, entered, gaps, sizes)
        on, aside = on + entered, np.append(aside, IN_FRONT * sizes[entered])


def _check_near(problem: Problem, entered: list[int], gaps: Array, sizes: Array) -> None:
    """Refuse a state far behind an open surface."""
    for j in entered:
        if gaps[j] > BEYOND * sizes[j]:
            raise ProblemError(
                f"the state lies {gaps[j]:.3g} behind surface {problem.kernels.surfaces[j]!r}: "
                "nothing can be planned from there; check what is measured."
            )


def _check_sliding(problem: Problem, mode: Mode, q: Array, v: Array) -> None:
    """Refuse a state that slides against the word of its phase by more than what was measured
    wrong."""
    slopes, still = problem.model.tangent_slopes(q), np.zeros(problem.nq)
    rates, sizes = problem.model.slide_rates(q, v), rate_sizes(problem, slopes, still)
    for k, forward in conditions_of(problem.model, mode).forward(rates).items():
        if forward < -AGAINST * sizes[k]:
            name, words = problem.kernels.tangents[k], parts_of(mode, problem.touch.contacts)
            word = next(word for word in words if word.partition(":")[0] == name)
            raise ProblemError(
                f"the state slides with {rates[k]:.3g} per second, against its contact {word!r}: "
                "nothing can be planned from there; check what is measured, or say the phase."
            )


def _along(problem: Problem, mode: Mode, q: Array, v: Array) -> Array:
    """The velocity without what constraints, closed contacts and friction do not allow."""
    model = problem.model
    slides = model.tangent_slopes(q)[:, :-1]
    forward = conditions_of(model, mode).forward(slides @ v)
    against = [k for k, rate in forward.items() if rate < 0]
    rows = [
        model.joint_slopes(q)[:, :-1], model.gap_slopes(q)[list(mode.closed), :-1],
        slides[[*mode.sticking, *against]],
    ]  # fmt: skip
    C = np.vstack(rows)[None]
    if not C.size:
        return v
    along = v + answers(model.mass(q)[None], C, C, -(C @ v))[0][0]
    left = LEFT_OF_ZERO * problem.reach * np.abs(v / problem.reach).max()
    return np.where(np.abs(along) <= left, 0.0, along)


def arrival(problem: Problem, event: Collision | None, state: MeasuredState) -> float:
    """Seconds until a state that goes on as it moves reaches the surface, the switch or the end of
    an event; endless where it does not."""
    if event is not None and (event.switch or event.off):
        w, rate = _passing(problem, event, state)
        return max(-w, 0.0) / rate if rate > 0 else np.inf
    if event is None or not (event.surface or event.lands):
        return np.inf
    model, (q, v) = problem.model, state
    j = model.contacts.surface_numbers[event.surface or event.lands[0]]
    gap, rate = float(model.gaps(q)[j]), float(model.gap_rates(q, v)[j])
    if gap > 0 and model.contacts.pull[j]:  # a grip is come to from both sides
        gap, rate = -gap, -rate
    return max(-gap, 0.0) / rate if rate > 0 else np.inf


def _passing(problem: Problem, event: Collision, state: MeasuredState) -> tuple[float, float]:
    """The value of the switch of an event, or how far past its end a contact is, and its rate
    without acceleration."""
    model, (q, v) = problem.model, state
    if event.off:
        j = model.surface_numbers[event.off[0]]
        return -float(model.within(q)[j]), -float(model.within_rates(q, v)[j])
    k = model.contacts.switches.index(event.switch)
    rate = model.crossing_rates(q, v, np.zeros_like(v))[k]
    return float(model.crossings(q, v)[k]), float(rate)


def is_over(
    problem: Problem, event: Collision, state: MeasuredState, late: float, lasts: float, step: float
) -> bool:
    """Whether a state shows that the next event of the plan has happened: ``late`` seconds after
    the plan's time of it, at the end of a phase that ``lasts`` as long, and ``step`` seconds after
    the last state.

    What is hit or lands is left or at rest, and is still near; a switch is not below zero, and what
    slips off is past its end; what leaves, or rubs in another way, does so at its time.
    """
    if event.switch or event.off:
        return late >= -EARLY * lasts and _passing(problem, event, state)[0] >= 0
    if not (event.surface or event.lands):
        return late >= 0
    if late < -EARLY * lasts:
        return False
    model, (q, v) = problem.model, state
    j = model.contacts.surface_numbers[event.surface or event.lands[0]]
    gap, rate = float(model.gaps(q)[j]), float(model.gap_rates(q, v)[j])
    rates = event.rate_before, event.rate_after
    if model.contacts.pull[j] and event.rate_before < 0:  # a grip is come to from both sides
        gap, rate, rates = -gap, -rate, (-event.rate_before, -event.rate_after)
    return -gap <= 2 * max(map(abs, rates)) * step and rate < sum(rates) / 2
