"""A motion simulated through the contacts it meets: from the start to the end, or segment by
segment."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from dmoc.base.records import record, value_class
from dmoc.check.checked_motion import Motion
from dmoc.check.consistency import JOINED
from dmoc.check.findings import largest
from dmoc.check.segments import Segments
from dmoc.codegen.kernels import Array
from dmoc.mechanics.bound_kernels import Index
from dmoc.motion.trajectory import GRAZING, Collision
from dmoc.simulation.flow import Lost, SurfaceContact

# A contact belongs to a planned collision if it happens within this share of the final time from
# it.
SAME_CONTACT = 0.05
# An open-loop run may leave a motion by so many times what the errors of its segments predict.
EXPLAINED = 5.0
ASTRAY = 100.0  # ranges from the motion at which an open-loop run ends


@value_class(frozen=True)
class Departures:
    """Planned collisions that a simulation misses, and other contacts that it meets."""

    missed: tuple[Collision, ...] = ()
    extra: tuple[SurfaceContact, ...] = ()

    def __bool__(self) -> bool:
        return bool(self.missed or self.extra)

    @property
    def missed_texts(self) -> tuple[str, ...]:
        return tuple(f"the collision with {c.surface!r} at {c.time:.4g} s" for c in self.missed)

    @property
    def extra_texts(self) -> tuple[str, ...]:
        texts = (f"a contact with {c.surface!r} at {c.time:.4g} s" for c in self.extra)
        return tuple(dict.fromkeys(texts))


@record(frozen=True, eq=False)
class WholeRun:
    """A run from the start to the end: the error at the end, the contacts that are reported, where
    they depart from the plan, where those of segments do (None: nobody has looked), and what
    contradicts the motion on the way, in sentences."""

    terminal: float
    contacts: Sequence[SurfaceContact]
    departures: Departures
    way: Departures | None = None
    contradictions: Sequence[str] = ()


def open_run(motion: Motion) -> WholeRun:
    """The run through the contacts that it meets."""
    terminal, contacts = open_loop(motion)
    return WholeRun(terminal, contacts, departures(motion, contacts))


def open_loop(motion: Motion) -> tuple[float, list[SurfaceContact]]:
    """Simulate from the start with the motion's inputs; return the terminal error and the
    contacts."""
    flow, sizes, nq, upper = motion.flow, motion.sizes, motion.model.nq, motion.upper
    first, last = motion.trajectory.phases[0], motion.trajectory.phases[-1]
    strikes = motion.stepped - 1
    y, contacts = np.concatenate([first.q[0], first.v[0]]), list[SurfaceContact]()
    far = ASTRAY * sizes.q
    try:
        for i, (phase, steps) in enumerate(
            zip(motion.trajectory.phases, motion.steps, strict=True)
        ):
            most, wanted, k = upper[motion.steps_of(i)], np.ascontiguousarray(phase.q), 0
            while k < len(steps):
                k, astray = flow.quiet(y, steps, most, k, len(steps), wanted, far)
                if not astray and k < len(steps):
                    y = flow.through_contacts(y, steps, k, contacts)
                    k += 1
                    astray = bool((np.abs(y[:nq] - wanted[k]) > far).any())
                if astray:
                    return float((np.abs(y[:nq] - wanted[k]) / sizes.q).max()), contacts
    except Lost:
        return np.inf, contacts
    if not last.steps and not any(is_planned(motion, strikes, c) for c in contacts):
        # It comes late: the end is that before the event, whose contact is to come.
        contacts += _late(motion, strikes, y, float(last.t[0]), [])
        last = motion.trajectory.phases[strikes]
    return largest(motion.errors(y[None], last.t[-1:], last.q[-1:], last.p[-1:])), contacts


def on_the_way(motion: Motion, parts: Segments) -> list[SurfaceContact]:
    """Contacts met in segments, each simulated from the motion's own state; one that ends in
    a planned collision meets it a little early or late."""
    met = contacts_of_phases(motion, parts, range(motion.stepped))
    return [contact for contacts in met for contact in contacts]


def contacts_of_phases(
    motion: Motion, parts: Segments, phases: Sequence[int]
) -> Iterator[list[SurfaceContact]]:
    """Contacts met in the segments of some phases."""
    stops = _stops(motion, parts) if phases else parts.first
    for i in phases:
        contacts, own = list[SurfaceContact](), parts.of_phase(i)
        for k, last in zip(stops[own].tolist(), parts.last[own].tolist(), strict=True):
            strikes = last == len(motion.steps[i]) and i < len(motion.trajectory.collisions)
            if k < last or strikes:
                contacts += _met_in_segment(motion.within(i), parts, i, (k, last))
        yield contacts


def _stops(motion: Motion, parts: Segments) -> Index:
    """The first step of each segment that might meet a surface, or its last node, (n,)."""
    course, begins = parts.course, motion.begins[parts.phase]
    states = course.start, course.ends, course.stop
    meets = motion.flow.meets(*states, motion.run, motion.upper)
    steps = np.append(np.flatnonzero(meets), len(meets))
    first = steps[np.searchsorted(steps, begins + parts.first)] - begins
    return np.minimum(first, parts.last)


def _met_in_segment(
    motion: Motion, parts: Segments, i: int, steps: tuple[int, int]
) -> list[SurfaceContact]:
    """Contacts met in a segment from the first of its steps on that may meet one."""
    (k, last), met = steps, list[SurfaceContact]()
    phase, begin, course = motion.trajectory.phases[i], int(motion.begins[i]), parts.course
    y = course.start[begin + k] if k < last else course.stop[begin + last - 1]
    try:
        y = _segment(motion, i, (y, k, last), met)
        if last == phase.steps and i < len(motion.trajectory.collisions):
            met += _late(motion, i, y, float(phase.t[last]), met)
    except Lost:
        pass  # what it has met until then does not fit
    return met


def _segment(
    motion: Motion, i: int, stopped: tuple[Array, int, int], met: list[SurfaceContact]
) -> Array:
    """Simulate what is left of a segment from a state before a step up to its last; where its
    planned collision is met early, the end is that of the motion without the impact."""
    (y, k, last), phase, steps = stopped, motion.trajectory.phases[i], motion.steps[i]
    upper, wanted = motion.upper[motion.steps_of(i)], np.ascontiguousarray(phase.q)
    everywhere = np.full(motion.model.nq, np.inf)
    while k < last:
        before, count = y, len(met)
        y = motion.flow.through_contacts(y, steps, k, met)
        early = last == len(steps) and any(is_planned(motion, i, c) for c in met[count:])
        if early:
            del met[count + 1 :]
            return motion.flow.freely(before, steps, k, last)
        k, _ = motion.flow.quiet(y, steps, upper, k + 1, last, wanted, everywhere)
    return y


def is_planned(motion: Motion, i: int, contact: SurfaceContact) -> bool:
    """Whether a contact is the one that ends a phase."""
    return any(
        contact.surface in (c.surface, *c.lands)
        and abs(contact.time - c.time) <= SAME_CONTACT * motion.sizes.time
        for c in motion.trajectory.collisions[i : i + 1]
    )


def _late(
    motion: Motion, i: int, y: Array, t: float, met: list[SurfaceContact]
) -> list[SurfaceContact]:
    """The planned collision where a segment ends just before it: by the rate of the gap."""
    collision = motion.trajectory.collisions[i]
    if not collision.surface or any(is_planned(motion, i, c) for c in met):
        return []
    j = motion.model.surface_numbers[collision.surface]
    gap = float(motion.model.gaps(y[: motion.model.nq], t)[j])
    rate = _gap_rate(motion, y, t, j)
    if rate > 0 and -gap <= SAME_CONTACT * motion.sizes.time * rate:
        return [SurfaceContact(collision.surface, t, 1.0)]
    return []


def departures(motion: Motion, contacts: Sequence[SurfaceContact]) -> Departures:
    """Match contacts with planned collisions by surface and time: those that are missed, and of
    the other contacts those that do not merely graze."""
    left, missed = list(contacts), list[Collision]()
    for planned in motion.trajectory.collisions:
        if planned.switch:
            continue
        match = next((c for c in left if _same(motion, planned, c)), None)
        if match is not None:
            left.remove(match)
        elif not planned.grazes:
            missed.append(planned)
    return Departures(tuple(missed), tuple(c for c in left if c.jump > GRAZING))


def _same(motion: Motion, planned: Collision, contact: SurfaceContact) -> bool:
    """Whether a contact is a planned collision."""
    near = abs(contact.time - planned.time) <= SAME_CONTACT * motion.sizes.time
    return contact.surface == planned.surface and near


def predicted(motion: Motion, run: Departures, parts: Segments, deviations: Array) -> bool:
    """Whether an open-loop run first departs from the motion where the deviations at the ends of
    segments, in sizes, say that it may: they move the gap of the first collision that it misses by
    what its rate makes up for in the time in which it would count, and close the gap to a surface
    that it meets before.  What follows is elsewhere."""
    missed = run.missed[:1]
    before = [c for c in run.extra if not missed or c.time < missed[0].time]

    def explained(c: Collision | SurfaceContact, gap: float) -> bool:
        return EXPLAINED * _moved(motion, c, parts, deviations) >= gap

    return all(explained(c, _made_up(motion, c)) for c in missed) and all(
        explained(c, _clearance(motion, c)) for c in before[:1]
    )


def _moved(
    motion: Motion, c: Collision | SurfaceContact, parts: Segments, deviations: Array
) -> float:
    """Distance by which deviations move the gap of a contact at its time."""
    q = _state(motion, c.time)[: motion.model.nq]
    ends = motion.nodes.t[motion.nodes.begins[parts.phase] + parts.last][:-1]
    k = np.searchsorted(ends, c.time - JOINED * motion.sizes.time)
    j = motion.model.surface_numbers[c.surface]
    slope = np.abs(motion.model.gap_slopes(q, c.time)[j, :-1])
    return float(slope @ (deviations[k, : len(q)] * motion.sizes.q))


def _made_up(motion: Motion, c: Collision) -> float:
    """Distance by which the gap of a collision moves, by its rate, in the time in which it
    counts."""
    j = motion.model.surface_numbers[c.surface]
    rate = _gap_rate(motion, _state(motion, c.time), c.time, j)
    return SAME_CONTACT * motion.sizes.time * abs(rate)


def _clearance(motion: Motion, c: SurfaceContact) -> float:
    """Distance of the motion itself from a surface that a run meets."""
    q = _state(motion, c.time)[: motion.model.nq]
    return -float(motion.model.gaps(q, c.time)[motion.model.surface_numbers[c.surface]])


def _gap_rate(motion: Motion, y: Array, t: float, j: int) -> float:
    q, v = y[: motion.model.nq], y[motion.model.nq :]
    return float(motion.model.gap_rates(q, v, t)[j])


def _state(motion: Motion, t: float) -> Array:
    """The motion's own state at a time: at an event the one before it."""
    phases = motion.trajectory.phases
    ends = [phase.t[-1] for phase in phases[:-1]]
    phase = phases[int(np.searchsorted(ends, t - JOINED * motion.sizes.time))]
    return np.array([np.interp(t, phase.t, x) for x in np.hstack([phase.q, phase.v]).T])
