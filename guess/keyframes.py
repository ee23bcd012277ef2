"""A user's own guess: courses of coordinates and inputs by name, and durations.

A course is a number, which is kept, keyframes, which are spread evenly over the time, or a function
of the time.  Keyframes of coordinates are joined by cubics that do not overshoot, those of inputs
by straight lines, attitudes by turns along their sphere.  What is not named is that of the
automatic guess; velocities, momenta and impulses follow from the motion.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np

from dmoc.base.arguments import (
    array,
    check_known,
    function,
    is_number,
    listed,
    number,
    positive,
    shown,
)
from dmoc.base.errors import ProblemError
from dmoc.base.records import value_class
from dmoc.codegen.kernels import Array
from dmoc.guess.contacts import in_contact
from dmoc.guess.inverse_dynamics import acting
from dmoc.guess.tracking import reflected
from dmoc.guess.transfer import times_of_inputs
from dmoc.mechanics.attitudes import HOW, coordinates_of, quaternion_of, said_of
from dmoc.mechanics.model_values import by_name
from dmoc.motion.attitude import Attitude, logarithm, nearer, turned
from dmoc.problem.design import designed
from dmoc.problem.problem import Problem
from dmoc.program.iterate import Iterate
from dmoc.program.layout import Layout

DURATIONS = "durations"
SECONDS = "expected a positive time in seconds"
# Places on the way between two attitudes, which the cubics of their coordinates go through.
BETWEEN = 16
COURSE = "expected a number, a list of keyframes, or a function of the time"

Course: TypeAlias = float | Array | Callable[[Array], Any]


@value_class(frozen=True)
class Courses:
    """What is given for some phases in a row: the first one and the one behind the last, courses
    by name, and durations of the phases or None."""

    first: int
    end: int
    named: Mapping[str, Course]
    durations: tuple[float, ...] | None


def is_by_name(guess: object) -> bool:
    """Whether a guess is a mapping from names, or a list of such mappings."""
    if isinstance(guess, (list, tuple)):
        return any(isinstance(part, Mapping) for part in guess)
    return isinstance(guess, Mapping)


def courses_of(problem: Problem, guess: Any) -> tuple[Courses, ...]:
    """Read a guess by name; unknown names, what is no course, and parts that are not one for each
    phase are refused."""
    phases = int(np.count_nonzero(problem.phase_steps))
    if isinstance(guess, Mapping):
        courses = [_read(problem, guess, 0, phases, "guess")]
    elif len(guess) == phases:
        parts = enumerate(guess)
        courses = [_read(problem, p, i, i + 1, f"guess of phase {i}") for i, p in parts]
    else:
        raise ProblemError(
            f"guess has {len(guess)} parts: expected one mapping, or one for each of the "
            f"{phases} phases{' before the last event' if problem.ends_with_event else ''}."
        )
    if not any(part.named or part.durations for part in courses):
        raise ProblemError(
            f"guess = {shown(guess)}: expected the name of a coordinate or an input; leave it out "
            "for the automatic guess."
        )
    return tuple(courses)


def with_design(problem: Problem, guess: Any) -> tuple[Problem, Any]:
    """The problem with the design that a guess by name has, and the rest of that; None where it has
    nothing else."""
    if not isinstance(guess, Mapping) or set(problem.design).isdisjoint(by_name(guess, "guess")):
        return problem, guess
    guess, values = by_name(guess, "guess"), problem.design_values.copy()
    for i, name in enumerate(problem.design):
        if name in guess:
            low, high = problem.design_bounds[i]
            values[i] = number(guess.pop(name), f"guess: {name}")
            if not low <= values[i] <= high:
                raise ProblemError(
                    f"guess: {name} = {values[i]:g} lies outside its range {low:g} to {high:g}: "
                    "expected a value within."
                )
    return designed(problem, values), guess or None


def along(problem: Problem, courses: Sequence[Courses], automatic: Array) -> Array:
    """Return unknowns x, shape (n,), along courses, in units of the problem.

    ``automatic``, shape (n,), are those for what is not named.  The keyframes of a mapping for all
    phases are spread over the whole motion, those of a mapping for one phase over this phase.
    Times are seconds from the start of the motion.  Where two phases meet, the earlier one that
    names a coordinate counts.
    """
    lay, x = Layout.of(problem), automatic.copy()
    for part in courses:
        if part.durations is not None:
            durations = lay.durations(x)
            durations[part.first : part.end] = part.durations
            x[lay.index_h] = lay.step_sizes(durations)
    q, u, t = x[lay.index_q], x[lay.index_u], lay.times(x)
    for part in reversed(courses):
        first, last = int(lay.ends[part.first]), int(lay.ends[part.end])
        whole = (float(t[first]), float(t[last]))
        for j, name in enumerate(problem.kernels.coordinates):
            if name in part.named:
                nodes = slice(first, last + 1)
                q[nodes, j] = _sampled(part.named[name], name, t[nodes], whole, smooth=True)
        for i in range(part.first, part.end):
            a, b = int(lay.ends[i]), int(lay.ends[i + 1])
            rows = slice(lay.row_u_k[a], lay.row_u_kp1[b - 1] + 1)
            at = times_of_inputs(lay.form.name, t[a : b + 1])
            for j, name in enumerate(problem.kernels.inputs):
                if name in part.named:
                    u[rows, j] = _sampled(part.named[name], name, at, whole, smooth=False)
    x[lay.index_q], x[lay.index_u] = q, u
    return _completed(problem, acting(problem, x))


# Reading ------------------------------------------------------------------------------------------


def _read(problem: Problem, guess: Any, first: int, end: int, what: str) -> Courses:
    if not isinstance(guess, Mapping):
        raise ProblemError(
            f"{what} = {shown(guess)}: expected a mapping from names to numbers, keyframes or "
            "functions."
        )
    named = _in_coordinates(problem, by_name(guess, what), what)
    durations = named.pop(DURATIONS, None)
    names = [*problem.kernels.coordinates, *problem.kernels.inputs]
    for name in named:
        check_known(
            name, [*names, DURATIONS], "coordinate or input", f"in the {what}",
            said=said_of(problem.kernels),
        )  # fmt: skip
    return Courses(
        first,
        end,
        {name: _course(value, f"{what}: {name}") for name, value in named.items()},
        None if durations is None else _seconds(durations, end - first, f"{what}: {DURATIONS}"),
    )


def _in_coordinates(problem: Problem, named: dict[str, Any], what: str) -> dict[str, Any]:
    """Courses in which coordinates stand for attitudes, along the sphere between their keyframes,
    each the short way from the one before and the first from the start."""
    for name, columns in problem.kernels.manifest.attitudes.items():
        if name not in named:
            continue
        value, label = named.pop(name), f"{what}: {name}"
        numbers = None if isinstance(value, Attitude) else array(value)
        alone = isinstance(value, Attitude) or (numbers is not None and numbers.shape == (4,))
        frames = [value] if alone else listed(value, label, "attitudes")
        if not frames:
            raise ProblemError(f"{label} = {shown(value)}: {HOW}, or a list of them.")
        p = [problem.start_position[columns]]
        for k, frame in enumerate(frames):
            p.append(nearer(p[-1], quaternion_of(frame, f"{label}, keyframe {k}")))
        share = np.linspace(0, 1, BETWEEN + 1)[1:, None]
        legs = [turned(a, share * logarithm(a, b)) for a, b in pairwise(p[1:])]
        own = coordinates_of(problem.kernels, name)
        named |= dict(zip(own, np.vstack([p[1], *legs]).T, strict=True))
    return named


def _course(value: Any, what: str) -> Course:
    if callable(value):
        return function(value, what, "an array of times")
    if is_number(value):
        return number(value, what)
    if not isinstance(value, (Sequence, np.ndarray)) or isinstance(value, (str, bytes)):
        raise ProblemError(f"{what} = {shown(value)}: {COURSE}.")
    frames = [number(v, f"{what}, keyframe {i}") for i, v in enumerate(listed(value, what, COURSE))]
    if not frames:
        raise ProblemError(f"{what} = {shown(value)}: {COURSE}; leave the name out for none.")
    return np.array(frames)


def _seconds(value: Any, phases: int, what: str) -> tuple[float, ...]:
    values = [value] if is_number(value) else listed(value, what, "times in seconds")
    if len(values) != phases:
        raise ProblemError(
            f"{what} = {shown(value)}: expected {phases} times in seconds, one for each phase."
        )
    return tuple(positive(v, f"{what} {i}", SECONDS) for i, v in enumerate(values))


# Motion -------------------------------------------------------------------------------------------


def _sampled(
    course: Course, name: str, t: Array, whole: tuple[float, float], smooth: bool
) -> Array:
    """Values of a course at times t; keyframes are spread over the ``whole`` time."""
    if callable(course):
        return _called(course, name, t)
    frames = np.atleast_1d(course)
    if len(frames) == 1:
        return np.full(len(t), frames[0])
    at = np.linspace(*whole, len(frames))
    if not smooth or len(frames) == 2:
        return np.asarray(np.interp(t, at, frames))
    from scipy.interpolate import PchipInterpolator

    return np.asarray(PchipInterpolator(at, frames)(np.clip(t, *whole)))


def _called(course: Callable[[Array], Any], name: str, t: Array) -> Array:
    returned = course(t.copy())
    numbers = array(returned)
    if numbers is None or numbers.shape not in ((), t.shape):
        raise ProblemError(
            f"guess: {name}: the function gave {shown(returned)} for {len(t)} times: "
            "expected as many numbers."
        )
    values = np.array(np.broadcast_to(numbers, t.shape))
    if not np.isfinite(values).all():
        k = int(np.argmin(np.isfinite(values)))
        raise ProblemError(
            f"guess: {name}: the function gave {values[k]:g} at t = {t[k]:g} s: expected finite "
            "numbers."
        )
    return values


def _completed(problem: Problem, x: Array) -> Array:
    """The unknowns that follow from times, positions and inputs: nodes inside the steps, momenta
    and velocities at both ends, impulses and velocities at the collisions; contacts that last
    correct the positions and take impulses."""
    before, x = Iterate.of(problem, x), x.copy()
    lay, q, t, rates = before.lay, before.q, before.t, before.rates
    lay.put_times(x)
    x[lay.index_q_i] = lay.scheme.within(q[:-1], q[1:]).reshape(lay.total, -1)
    for i, (node, event) in enumerate(zip(lay.collision_nodes, problem.touch.events, strict=True)):
        v, after, impulse = rates[node - 1], rates[min(node, lay.total - 1)], 0.0
        if event.impact:
            lands, at = bool(event.lands), float(t[node])
            after, impulse = reflected(problem, q[node], v, event.surface, at, lands=lands)
        x[lay.impact.v_a[i]], x[lay.impact.v_c[i]], x[lay.impact.lam[i]] = v, after, impulse
    last = x[lay.index_v_E] if lay.ends_with_event else rates[-1]
    for node, v, index_p, index_v in (
        (0, rates[0], lay.index_p_B, lay.index_v_B), (-1, last, lay.index_p_E, lay.index_v_E),
    ):  # fmt: skip
        x[index_p] = problem.models[node].momentum(q[node], v, t[node])
        if len(index_v):
            x[index_v] = v
    return in_contact(problem, x)
