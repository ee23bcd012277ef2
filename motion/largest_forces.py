"""The largest forces along a motion."""

from __future__ import annotations

import numpy as np

from dmoc.base.records import value_class
from dmoc.motion.trajectory import Trajectory


@value_class(frozen=True)
class LargestForce:
    """The largest force of a contact along a motion, "N" or "T", or of a constraint, "R": its
    value, in newton for contacts, which has a sign for T and R, and its time in seconds."""

    contact: str
    kind: str
    value: float
    time: float


def largest_forces(motion: Trajectory) -> list[LargestForce]:
    """The largest normal force and the largest friction of each contact, and the largest force of
    each constraint and of each place of a grip, at its first time, along phases that have steps."""
    largest: dict[tuple[str, str], LargestForce] = {}
    of_grips = {place for places in motion.grips.values() for place in places}
    for phase in motion.phases:
        if not phase.steps:
            continue
        rows = (
            (kind, name, row)
            for kind, names, forces in (
                ("N", phase.closed, phase.normal), ("T", phase.rubbing, phase.tangential),
                ("R", phase.joints, phase.reaction),
            )
            for name, row in zip(names, forces.T, strict=True)
        )  # fmt: skip
        for of, name, forces in rows:
            kind = "R" if name in of_grips else of
            k = int(np.argmax(np.abs(forces)))
            force = LargestForce(name, kind, float(forces[k]), float(phase.t[k]))
            before = largest.get((name, kind))
            if before is None or abs(force.value) > abs(before.value):
                largest[name, kind] = force
    return sorted(largest.values(), key=lambda force: (force.contact, force.kind))
