"""What a problem says in numbers and ranges: states at both ends, bounds, durations, steps, places
at events."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from dmoc.base.arguments import (
    Range,
    check_known,
    check_largest,
    interval,
    is_zero,
    limits,
    listed,
    shown,
    whole,
)
from dmoc.base.errors import ProblemError
from dmoc.base.names import bounded_momentum, load_of, momentum_name, velocity_name
from dmoc.base.records import value_class
from dmoc.codegen.kernels import Array
from dmoc.mechanics.attitudes import in_coordinates, said_of
from dmoc.mechanics.model_values import by_name
from dmoc.mechanics.phase_models import ENDS
from dmoc.problem.attitudes import with_pitches
from dmoc.problem.dependent import following_rates, places_follow
from dmoc.problem.design import samples

if TYPE_CHECKING:
    from dmoc.problem.problem import Problem

IN_PHASE = " steps in each phase"
BOX = "expected a pair (lower, upper) such as (-5, 5) or (None, 5), where (5, 5) holds the value 5"
MOST_STEPS = (
    100_000  # beyond it rounding errors of v = (q_kp1 - q_k)/h outweigh those of the discretisation
)
# Steps of a phase, times the degree of the discretisation, of the first mesh of a solve that
# chooses its own.
FIRST_MESH = 100
# Unknowns of all steps; the compiled method takes some 2.5 kB for each of them, 5 GB for so many.
MOST_UNKNOWNS = 2_000_000
# Seconds of a motion; powers of the times of its steps stay within the numbers.
LONGEST_TIME = 1e60


@value_class(frozen=True)
class Boundary:
    """Bounds of the state at one end: shape (nq, 2) each; equal bounds fix a value, infinite
    ones leave it free."""

    position: Array
    velocity: Array
    momentum: Array
    meant: Array | None = None  # velocities that were given, which the momenta stand for

    @property
    def needs_velocity(self) -> bool:
        return bool(np.isfinite(self.velocity).any())

    @property
    def by_velocity(self) -> bool:
        """Whether the momenta stand for velocities that were given."""
        return self.meant is not None

    @property
    def known_velocity(self) -> Array | None:
        """The velocity, where it is given."""
        fixed = bool((self.velocity[:, 0] == self.velocity[:, 1]).all())
        return self.velocity[:, 0] if self.meant is None and fixed else self.meant

    @property
    def is_state(self) -> bool:
        """Whether position and velocity are fixed."""
        bounds = self.position, self.velocity, self.momentum
        position, velocity, momentum = (bool((b[:, 0] == b[:, 1]).all()) for b in bounds)
        return position and (velocity or momentum)


def via_of(problem: Problem) -> Array:
    """Bounds of the coordinates at the events, shape (events, nq, 2)."""
    via = [None] * len(problem.sequence) if problem.via is None else problem.via
    if len(via) != len(problem.sequence):
        raise ProblemError(
            f"via has {len(via)} entries: expected one for each of the {len(problem.sequence)} "
            "events of the sequence."
        )
    bounds = np.tile((-np.inf, np.inf), (len(via), problem.nq, 1))
    for i, places in enumerate(via):
        what = f"via of event {i + 1}"
        said = by_name({} if places is None else places, what)
        for name, value in in_coordinates(problem.kernels, said, what).items():
            known = [*problem.kernels.coordinates, *problem.kernels.quantities]
            kind = "coordinate or quantity" if problem.kernels.quantities else "coordinate"
            check_known(name, known, kind, f"in {what}")
            if name in problem.kernels.quantities:
                continue
            j = problem.kernels.coordinates.index(name)
            bounds[i, j] = _of_state(value, f"{what}: {name}")
            low, high = problem.coordinate_bounds[j]
            if bounds[i, j, 1] < low or bounds[i, j, 0] > high:
                raise ProblemError(
                    f"{what}: {name} = {shown(value)} lies outside its bounds {low:g} to "
                    f"{high:g}: move one of them."
                )
    return bounds


def ends_with_event(problem: Problem) -> bool:
    """Whether the duration of the last phase is given as zero."""
    durations: Sequence[Any] = problem.durations or ()
    if not problem.sequence or len(durations) != problem.phases:
        return False
    pair = isinstance(durations[-1], (tuple, list, np.ndarray)) and np.shape(durations[-1]) == (2,)
    return all(map(is_zero, durations[-1] if pair else durations[-1:]))


def check_last_event(problem: Problem) -> None:
    """Refuse a motion that ends with an event at which nothing is hit or lands."""
    if problem.ends_with_event and not problem.touch.impacts[-1]:
        word = f"event {len(problem.sequence)} ({problem.sequence[-1]})"
        raise ProblemError(
            f"the motion ends with {word}, at which nothing is hit or lands, so that its state is "
            "the same before and after it: leave the event out, or give the last phase a duration."
        )


def durations_of(problem: Problem) -> Array:
    """Bounds of the durations T_i, shape (I + 1, 2)."""
    if problem.durations is None:
        return np.tile((0.0, np.inf), (problem.phases, 1))
    if len(problem.durations) != problem.phases:
        raise ProblemError(
            f"durations has {len(problem.durations)} entries: expected one for each of the "
            f"{problem.phases} phases."
        )
    last = len(problem.sequence) if problem.ends_with_event else None
    return np.array(
        [(0.0, 0.0) if i == last else _of_phase(d, i) for i, d in enumerate(problem.durations)]
    )


def _of_phase(value: Any, i: int) -> Range:
    """Bounds of the duration of a phase that has steps."""
    if is_zero(value):
        last = "only the last of several phases may have the duration 0, which ends the motion with"
        raise ProblemError(
            f"durations of phase {i} = 0: expected a positive time; {last} its last event, and "
            "what happens at one instant is one event, as '+right -left'."
        )
    return duration(value, f"durations of phase {i}")


def steps_of(problem: Problem) -> int | tuple[int, ...] | None:
    """The numbers of steps as they were passed: one, one for each phase, or none."""
    steps = problem.steps
    if steps is None:
        return None
    if isinstance(steps, (Sequence, np.ndarray)) and not isinstance(steps, (str, bytes)):
        given = listed(steps, "steps", "numbers")
        if len(given) != problem.phases:
            raise ProblemError(
                f"steps = {shown(steps)}: expected one number, or one for each of the "
                f"{problem.phases} phases."
            )
        return tuple(_steps_of_phase(problem, n, i) for i, n in enumerate(given))
    return whole(steps, "steps", 2, MOST_STEPS, unit=IN_PHASE)


def _steps_of_phase(problem: Problem, value: Any, i: int) -> int:
    """Steps of one phase: none of the last one of a motion that ends with its last event."""
    if not (problem.ends_with_event and i == len(problem.sequence)):
        return whole(value, f"steps of phase {i}", 2, MOST_STEPS, unit=IN_PHASE)
    if not is_zero(value):
        raise ProblemError(
            f"steps of phase {i} = {shown(value)}: expected 0, because its duration is 0; one "
            "number for all phases leaves it out."
        )
    return 0


def phase_steps_of(problem: Problem) -> tuple[int, ...]:
    """Steps N_i of each phase; those of the first mesh where they are not given."""
    steps = problem.steps
    if isinstance(steps, Sequence):
        return tuple(steps)
    if steps is None:
        steps = FIRST_MESH // problem.scheme.degree
    with_steps = problem.phases - problem.ends_with_event
    return (steps,) * with_steps + (0,) * problem.ends_with_event


def check_size(problem: Problem) -> None:
    """Refuse more steps than fit in memory."""
    unknowns = sum(problem.phase_steps) * (problem.nq + problem.nu) * problem.scheme.degree
    if unknowns > MOST_UNKNOWNS:
        raise ProblemError(
            f"steps = {shown(problem.steps or max(problem.phase_steps))} makes {unknowns} unknowns "
            f"in {problem.phases} phases: expected at most {MOST_UNKNOWNS}, more would not fit in "
            "memory; take fewer steps."
        )


def names_in(problem: Problem, field: str) -> tuple[list[str], str]:
    """Names that "start", "goal" or "bounds" may contain, and what they are called."""
    kernels = problem.kernels
    if field == "bounds":
        velocities = map(velocity_name, kernels.coordinates)
        names, kinds = [*kernels.inputs, *kernels.coordinates, *velocities], "input, coordinate"
        quantities = [*kernels.quantities, *kernels.hit_quantities]
        if not quantities:
            return names, f"{kinds} or velocity"
        return [*names, *quantities], f"{kinds}, velocity or quantity"
    names = [*problem.states, *kernels.quantities]
    if field == "goal" and kernels.integrals:
        return [*names, *kernels.integrals], "state, quantity or integral"
    return names, "state or quantity" if kernels.quantities else "state"


def boxes_of(problem: Problem, names: Sequence[str]) -> Array:
    """Bounds of inputs, coordinates, velocities or quantities, shape (names, 2)."""
    bounded, what = names_in(problem, "bounds")
    for name in problem.bounds:
        check_known(name, bounded, what, "in the bounds")
    boxes = [limits(problem.bounds.get(name), f"bounds of {name}", BOX) for name in names]
    return np.array(boxes, dtype=float).reshape(len(names), 2)


def input_bounds_of(problem: Problem) -> Array:
    """Bounds of the inputs, shape (nu, 2)."""
    return boxes_of(problem, problem.kernels.inputs)


def coordinate_bounds_of(problem: Problem) -> Array:
    """Bounds of the coordinates, shape (nq, 2)."""
    return with_pitches(problem, boxes_of(problem, problem.kernels.coordinates))


def velocity_bounds_of(problem: Problem) -> Array:
    """Bounds of the velocities, shape (nq, 2)."""
    return boxes_of(problem, [velocity_name(q) for q in problem.kernels.coordinates])


def quantity_bounds_of(problem: Problem) -> Array:
    """Bounds of the quantities, shape (nz, 2)."""
    names = problem.kernels.quantities
    boxes = boxes_of(problem, names)
    for grip in problem.kernels.manifest.strength:
        box = boxes[names.index(load_of(grip))]
        if box[0] > 1:
            raise ProblemError(
                f"the bounds of {load_of(grip)} begin at {box[0]:g}: beyond 1 grip {grip!r} lets "
                "go; leave them out."
            )
        box[1] = min(box[1], 1.0)
    return boxes


def hit_quantity_bounds_of(problem: Problem) -> Array:
    """Bounds of the quantities of hits, shape (number, 2)."""
    return boxes_of(problem, problem.kernels.hit_quantities)


def limits_of(problem: Problem) -> dict[str, Range]:
    """Bounds of the velocities and quantities that have some, by name."""
    kernels = problem.kernels
    names = [*map(velocity_name, kernels.coordinates), *kernels.quantities, *kernels.hit_quantities]
    own = problem.velocity_bounds, problem.quantity_bounds, problem.hit_quantity_bounds
    boxes = np.vstack(own)
    return {
        name: (float(low), float(high))
        for name, (low, high) in zip(names, boxes, strict=True)
        if low > -np.inf or high < np.inf
    }


def boundary_of(problem: Problem, end: str) -> Boundary:
    """The state at the "start" or at the "goal"."""
    state, coordinates = problem.ends[end], problem.kernels.coordinates
    velocities = [velocity_name(q) for q in coordinates]
    momenta = [momentum_name(q) for q in coordinates]
    for name in state:
        check_known(name, *names_in(problem, end), f"at the {end}", said=said_of(problem.kernels))
    position, velocity, momentum = (
        np.array([_of_state(state.get(name), f"{end} of {name}") for name in names])
        for names in (coordinates, velocities, momenta)
    )
    if end == "start":
        said = {*state, *(name for r in problem.relations for name in r.starts)}
        left = [i for i, q in enumerate(coordinates) if q not in said]
        if not places_follow(problem, left):
            first = coordinates[left[0]]
            name, *_ = (*said_of(problem.kernels)([first]), first)
            what = "a number, a range" if name == first else "an attitude"
            raise ProblemError(
                f"the start of {name} is not given: give {what}, or None to leave it free."
            )
        rates = enumerate(zip(velocities, momenta, strict=True))
        still = [i for i, names in rates if not said & {*names}]
        velocity = following_rates(problem, position, velocity, still, left)
    for q, v, p in zip(coordinates, velocities, momenta, strict=True):
        if all(isinstance(state.get(n), (int, float, np.number)) for n in (v, p)):
            raise ProblemError(
                f"the {end} of {q} has a fixed velocity ({v}) and a fixed momentum ({p}): give "
                "one of them."
            )
    boundary = Boundary(position, velocity, momentum)
    for names, ranges, boxes in (
        (coordinates, boundary.position, problem.coordinate_bounds),
        (velocities, boundary.velocity, problem.velocity_bounds),
        (momenta, momentum, boxes_of(problem, [bounded_momentum(q) for q in coordinates])),
    ):
        for name, (low, high), (below, above) in zip(names, ranges, boxes, strict=True):
            if high < below or low > above:
                raise ProblemError(
                    f"the {end} of {name} ({low:g} to {high:g}) lies outside its bounds {below:g} "
                    f"to {above:g}."
                )
    return _as_momenta(problem, boundary, end == "start")


def _of_state(value: Any, what: str) -> Range:
    """Read a number or a range of a state."""
    low, high = interval(value, what)
    for side in (low, high):
        check_largest(side, what)
    return low, high


def _as_momenta(problem: Problem, boundary: Boundary, at_start: bool) -> Boundary:
    """Express fully fixed velocities at a fully fixed position as momenta, which needs no
    further unknowns.

    The same is done for rest at any position where L has no terms linear in the velocities, so
    that p = M(q) v = 0.  In a model that depends on the time these are known at the start
    alone.
    """
    velocity = boundary.velocity
    if np.isfinite(boundary.momentum).any() or not (velocity[:, 0] == velocity[:, 1]).all():
        return boundary
    if problem.explicit_time and (velocity.any() or not at_start):
        return boundary
    fixed = bool((boundary.position[:, 0] == boundary.position[:, 1]).all())
    if not fixed and velocity.any():
        return boundary
    at = midpoints(boundary.position, np.zeros(problem.nq))
    end = ENDS["start" if at_start else "goal"]
    momentum = problem.models[end].momentum(at, velocity[:, 0])
    others = [p.models[end].momentum(at, velocity[:, 0]) for p in samples(problem)]
    if problem.design and not (np.array(others) == momentum).all():
        return boundary
    if not np.isfinite(momentum).all() or (not fixed and momentum.any()):
        return boundary
    free, fixed_momentum = (
        np.full_like(velocity, (-np.inf, np.inf)),
        np.repeat(momentum[:, None], 2, axis=1),
    )
    return Boundary(boundary.position, free, fixed_momentum, velocity[:, 0])


def fixed_velocity(boundary: Boundary, problem: Problem, q: Array) -> Array | None:
    """The velocity at an end where it is fixed, by itself or by momenta."""
    momentum = boundary.momentum
    if boundary.known_velocity is not None:
        return boundary.known_velocity
    if not (momentum[:, 0] == momentum[:, 1]).all():
        return None
    model = problem.models[-1 if boundary is problem.goal_bounds else 0]
    return model.velocity(q, momentum[:, 0])


def midpoints(bounds: Array, default: Array) -> Array:
    """A value for each pair of bounds, shape (n, 2): the middle of two finite ones, else the
    default, shape (n,), moved within them; shape (n,)."""
    finite = np.isfinite(bounds).all(axis=1)
    with np.errstate(invalid="ignore"):
        middle = (bounds / 2).sum(axis=1)  # the sum of both could overflow
    return np.where(finite, middle, np.clip(default, bounds[:, 0], bounds[:, 1]))


def duration(value: Any, what: str) -> Range:
    low, high = interval(value, what)
    if high <= 0 or -np.inf < low < 0:
        raise ProblemError(
            f"{what} = {shown(value)}: expected a positive time in seconds, or a range such as "
            "(0.1, None)."
        )
    for time in (low, high):
        if np.isfinite(time) and time > 0 and not 1 / LONGEST_TIME <= time <= LONGEST_TIME:
            raise ProblemError(
                f"{what} = {shown(value)}: expected times from {1 / LONGEST_TIME:g} to "
                f"{LONGEST_TIME:g} s; use another unit of time."
            )
    return max(low, 0.0), high
