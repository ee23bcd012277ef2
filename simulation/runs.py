"""A motion simulated through the contacts it meets: from the start to the end, or segment by
segment."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.simulation.flow import Contact, Lost
from dmoc.simulation.measures import Segment
from dmoc.simulation.motion import Motion, nodes_of_segments
from dmoc.trajectory import GRAZING, Collision

# A contact belongs to a planned collision if it happens within this share of the final time from
# it.
SAME_CONTACT = 0.05
# An open-loop run may leave a motion by so many times what the errors of its segments predict.
EXPLAINED = 5.0
ASTRAY = 100.0  # ranges from the motion at which an open-loop run ends


def open_loop(motion: Motion) -> tuple[float, list[Contact]]:
    """Simulate from the start with the motion's inputs; return the terminal error and the
    contacts."""
    flow, sizes, nq = motion.flow, motion.sizes, motion.model.nq
    first, last = motion.trajectory.phases[0], motion.trajectory.phases[-1]
    y, contacts = np.concatenate([first.q[0], first.v[0]]), list[Contact]()
    far = ASTRAY * sizes.q
    try:
        for phase, steps in zip(motion.trajectory.phases, motion.steps, strict=True):
            upper, wanted, k = flow.upper(steps), np.ascontiguousarray(phase.q), 0
            while k < len(steps):
                k, astray = flow.quiet(y, steps, upper, k, len(steps), wanted, far)
                if not astray and k < len(steps):
                    y = flow.through_contacts(y, steps, k, contacts)
                    k += 1
                    astray = bool((np.abs(y[:nq] - wanted[k]) > far).any())
                if astray:
                    return float((np.abs(y[:nq] - wanted[k]) / sizes.q).max()), contacts
    except Lost:
        return np.inf, contacts
    return float(motion.error(y[None], last.t[-1:], last.q[-1:], last.p[-1:])[0]), contacts


def on_the_way(motion: Motion) -> list[Contact]:
    """Contacts met in segments, each simulated from the motion's own state; one that ends in
    a planned collision meets it a little early or late."""
    phases = range(len(motion.trajectory.phases))
    return [contact for i in phases for contact in contacts_of_phase(motion, i)]


def contacts_of_phase(motion: Motion, i: int) -> list[Contact]:
    """Contacts met in the segments of one phase."""
    contacts, phase = list[Contact](), motion.trajectory.phases[i]
    upper = motion.flow.upper(motion.steps[i])
    for first, last in pairwise(map(int, nodes_of_segments(phase.steps))):
        met = list[Contact]()
        try:
            y = _segment(motion, i, upper, (first, last), met)
            if last == phase.steps and i < len(motion.trajectory.collisions):
                met += _late(motion, i, y, float(phase.t[last]), met)
        except Lost:
            pass  # what it has met until then does not fit
        contacts += met
    return contacts


def _segment(
    motion: Motion, i: int, upper: Array, span: tuple[int, int], met: list[Contact]
) -> Array:
    """Simulate a segment; where its planned collision is met early, the end is that of the
    motion without the impact."""
    (k, last), phase, steps = span, motion.trajectory.phases[i], motion.steps[i]
    wanted, everywhere = np.ascontiguousarray(phase.q), np.full(motion.model.nq, np.inf)
    y = np.concatenate([phase.q[k], phase.v[k]])
    while True:
        k, _ = motion.flow.quiet(y, steps, upper, k, last, wanted, everywhere)
        if k == last:
            return y
        before, count = y, len(met)
        y = motion.flow.through_contacts(y, steps, k, met)
        early = last == len(steps) and any(
            _planned(motion, c, i, phase.t[last]) for c in met[count:]
        )
        if early:
            del met[count + 1 :]
            return motion.flow.freely(before, steps, k, last)
        k += 1


def _planned(motion: Motion, contact: Contact, i: int, end: float) -> bool:
    collisions = motion.trajectory.collisions
    window = SAME_CONTACT * motion.sizes.time
    return (
        i < len(collisions)
        and contact.surface in (collisions[i].surface, *collisions[i].lands)
        and abs(contact.time - end) <= window
    )


def _late(motion: Motion, i: int, y: Array, t: float, met: list[Contact]) -> list[Contact]:
    """The planned collision where a segment ends just before it: by the rate of the gap."""
    collision = motion.trajectory.collisions[i]
    if not collision.surface or any(_planned(motion, c, i, t) for c in met):
        return []
    j = motion.model.kernels.surfaces.index(collision.surface)
    gap = float(motion.model.gaps(y[: motion.model.nq], t)[j])
    rate = motion.flow.rate(y, t, j)
    if rate > 0 and -gap <= SAME_CONTACT * motion.sizes.time * rate:
        return [Contact(collision.surface, t, 1.0)]
    return []


def missable(
    motion: Motion, contacts: Sequence[Contact], parts: Sequence[Segment], deviations: Array
) -> bool:
    """Whether the first planned collision that an open-loop run does not meet, if any, is predicted
    to be missed: by the deviations at the ends of segments, in sizes, which move its gap by what
    its rate makes up for in the time in which it would count."""
    missed = [
        (i, c) for i, c in enumerate(motion.trajectory.collisions)
        if not c.grazes and not any(_same(motion, c, contact) for contact in contacts)
    ]  # fmt: skip
    if not missed:
        return True
    (i, c), nq = missed[0], motion.model.nq
    j, phase = motion.model.kernels.surfaces.index(c.surface), motion.trajectory.phases[i]
    k = max(n for n, part in enumerate(parts) if part.phase == i)
    slope = np.abs(motion.model.gap_slopes(phase.q[-1], c.time)[j, :nq])
    rate = motion.flow.rate(np.concatenate([phase.q[-1], phase.v[-1]]), c.time, j)
    off = float(slope @ (deviations[k, :nq] * motion.sizes.q))
    return EXPLAINED * off >= SAME_CONTACT * motion.sizes.time * abs(rate)


def _same(motion: Motion, planned: Collision, contact: Contact) -> bool:
    """Whether a contact is a planned collision."""
    near = abs(contact.time - planned.time) <= SAME_CONTACT * motion.sizes.time
    return contact.surface == planned.surface and near


def compare(motion: Motion, contacts: Sequence[Contact]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Match contacts with planned collisions by surface and time: those that are missed, and of
    the other contacts those that do not merely graze."""
    left, missed = list(contacts), []
    for planned in motion.trajectory.collisions:
        match = next((c for c in left if _same(motion, planned, c)), None)
        if match is not None:
            left.remove(match)
        elif not planned.grazes:
            missed.append(f"the collision with {planned.surface!r} at {planned.time:.4g} s")
    return tuple(missed), tuple(
        f"a contact with {c.surface!r} at {c.time:.4g} s" for c in left if c.jump > GRAZING
    )
