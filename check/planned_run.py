"""A motion with lasting contacts or friction, followed through its planned modes and events.

Segments show what ends a mode elsewhere than planned: a contact that lifts off, friction that gives
way and sliding that stops are located by the flow itself, and so are surfaces that are met in
phases in which nothing is closed or rubs.  The run from the start to the end is not independent in
this: it goes through the planned events at their planned times.
"""

from __future__ import annotations

import numpy as np

from dmoc.check.checked_motion import Motion
from dmoc.check.contact_forces import BEARABLE, TURNED
from dmoc.check.contact_location import ON_TIME, is_free, is_planned, left
from dmoc.check.runs import Departures, Run, contacts_of_phase
from dmoc.check.segments import put
from dmoc.check.verdict import PASSING
from dmoc.codegen.kernels import Array
from dmoc.motion.trajectory import GRAZING, Collision
from dmoc.simulation.flow import FIRST, SurfaceContact


def planned_run(motion: Motion, sizes: tuple[Array, Array]) -> Run:
    """The run through the plan; ``sizes`` are those of contact forces and of friction."""
    # What errors of discretisation explain.
    slack = BEARABLE * sizes[0], BEARABLE * sizes[1], TURNED * motion.sizes.slide
    met, ends = left(motion, np.concatenate(slack))
    missed, early = list[Collision](), list[str]()
    for i in range(len(motion.modes)):
        if is_free(motion, i):
            contacts = contacts_of_phase(motion, i)
            planned = [c for c in contacts if is_planned(motion, i, c.surface, c.time)]
            met += [c for c in contacts if c not in planned]
            early += [_early(motion, i, c) for c in planned if _too_early(motion, i, c)]
            missed += _missed(motion, i, planned)
    contacts = [c for c in met if c.jump > GRAZING]
    # What the segments meet counts for the run too.
    way = Departures(tuple(missed), tuple(contacts))
    return Run(_terminal_error(motion), contacts, way, way, (*ends, *early))


def _terminal_error(motion: Motion) -> float:
    """The error at the end of a simulation from the start, which goes through the planned modes and
    events at their planned times."""
    nq, phases = motion.model.nq, motion.trajectory.phases
    y = np.hstack([phases[0].q[:1], phases[0].v[:1]])
    for i, (phase, mode) in enumerate(zip(phases, motion.modes, strict=True)):
        y, held = put(motion, mode, y, phase.t[:1])
        motion.flow.advance(y, motion.steps[i], FIRST, np.array([phase.steps]), mode, held)
        if i + 1 < len(phases):
            q, v = (np.ascontiguousarray(a) for a in np.split(y, [nq], axis=1))
            y = np.hstack([q, motion.passages[i].after_law(q, v).velocity])
    return float(motion.error(y, phase.t[-1:], phase.q[-1:], phase.p[-1:])[0])


def _missed(motion: Motion, i: int, planned: list[SurfaceContact]) -> list[Collision]:
    """The planned contact at the end of a free phase, where the simulation misses it."""
    return [
        c
        for c in motion.trajectory.collisions[i : i + 1]
        if c.surface
        and c.surface not in motion.trajectory.ignored
        and not c.grazes
        and not planned
        and not _softly(motion, i)
    ]


def _softly(motion: Motion, i: int) -> bool:
    """Whether a phase ends on its surface with hardly a rate, so that a simulation may just not
    reach it."""
    c, phase = motion.trajectory.collisions[i], motion.trajectory.phases[i]
    j = motion.model.surface_numbers[c.surface]
    rate = motion.model.gap_rates(phase.q[-1], phase.v[-1], c.time)[j]
    return bool(rate <= TURNED * motion.sizes.rate[j])


def _too_early(motion: Motion, i: int, contact: SurfaceContact) -> bool:
    """Whether a contact is met so long before the end of a phase that the gap, which goes on with
    its rate at the end, is further behind the surface than a segment may be off."""
    phase, j = motion.trajectory.phases[i], motion.model.surface_numbers[contact.surface]
    early = float(phase.t[-1]) - contact.time
    rate = float(motion.model.gap_rates(phase.q[-1], phase.v[-1], phase.t[-1])[j])
    behind = early * rate > PASSING["segment error"] * motion.sizes.gap[j]
    return behind and early > ON_TIME * phase.duration


def _early(motion: Motion, i: int, c: SurfaceContact) -> str:
    end = motion.trajectory.phases[i].t[-1]
    return f"the simulation meets {c.surface!r} at {c.time:.4g} s, not at {end:.4g} s as planned"
