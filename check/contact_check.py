"""The independent check of a motion with lasting contacts or friction.

It is compared with the flow of its planned modes, whose forces follow from the conditions on the
accelerations: step by step and segment by segment, each from its own states.  There a contact that
lifts off, friction that gives way and sliding that stops are located by the flow itself, and so are
surfaces that are met in phases in which nothing is closed or rubs: another event, or one at another
time, contradicts the motion.  The run from the start to the end is not independent in this: it goes
through the planned events at their planned times.  Events must obey their law.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from dmoc.check.amplification import carried, event_slope
from dmoc.check.checked_motion import Motion
from dmoc.check.contact_events import event_errors
from dmoc.check.contact_forces import (
    BEARABLE,
    TURNED,
    ForceErrors,
    force_errors,
    left_out,
    still_held,
)
from dmoc.check.contact_location import ON_TIME, is_free, is_planned, left
from dmoc.check.joins import torn
from dmoc.check.judgement import Evidence, judged, measured
from dmoc.check.measures import wrong_places
from dmoc.check.runs import Departures, contacts_of_phase, through_plan
from dmoc.check.segments import segments, step_errors
from dmoc.check.verdict import PASSING, Verification
from dmoc.codegen.kernels import Array
from dmoc.motion.trajectory import GRAZING, Collision
from dmoc.simulation.flow import SurfaceContact


def judged_with_contacts(motion: Motion) -> Verification:
    """Measure a motion and judge it."""
    held, in_flight = _forces(motion), _in_flight(motion)
    met, ends = left(motion, _slack(motion, held))
    steps, parts = step_errors(motion), segments(motion)
    events = event_errors(motion, steps.work)
    flowed, terminal = carried(motion, parts, event_slope), through_plan(motion)
    errors = measured(motion, steps, parts, flowed, (events.energy, events.law, events.own))
    errors["error of a contact force"] = held.largest
    told = [*torn(motion), *wrong_places(motion, "contact"), *held.told, *events.told]
    told += [*ends, *in_flight.early, *still_held(motion, held.sizes)]
    contacts = tuple(c for c in (*met, *in_flight.met) if c.jump > GRAZING)
    found = Evidence(told, errors, steps.path, parts, flowed, terminal, contacts)
    # The open-loop run goes through the planned events: what the segments meet counts for both.
    way = Departures(in_flight.missed, contacts)
    return judged(motion, found, way, way)


def _forces(motion: Motion) -> ForceErrors:
    found = force_errors(motion)
    return replace(found, told=(*left_out(motion), *found.told))


def _slack(motion: Motion, held: ForceErrors) -> tuple[Array, Array, Array]:
    """Contact forces, friction and sliding velocities that errors of discretisation explain."""
    sliding = motion.sizes.slide
    normal, tangential = held.sizes
    return BEARABLE * normal, BEARABLE * tangential, TURNED * sliding


def _softly(motion: Motion, i: int) -> bool:
    """Whether a phase ends on its surface with hardly a rate, so that a simulation may just not
    reach it."""
    c, phase = motion.trajectory.collisions[i], motion.trajectory.phases[i]
    j = motion.model.kernels.surfaces.index(c.surface)
    rate = motion.model.gap_rates(phase.q[-1], phase.v[-1], c.time)[j]
    return bool(rate <= TURNED * motion.sizes.rate[j])


@dataclass(frozen=True)
class _InFlight:
    """Planned contacts at the ends of free phases that are missed, contacts on the way there that
    were not planned, and, in sentences, those that are met before their time."""

    missed: tuple[Collision, ...]
    met: tuple[SurfaceContact, ...]
    early: tuple[str, ...]


def _in_flight(motion: Motion) -> _InFlight:
    missed, met, early = list[Collision](), list[SurfaceContact](), list[str]()
    for i, phase in enumerate(motion.trajectory.phases):
        if not is_free(motion, i):
            continue
        contacts = contacts_of_phase(motion, i)
        planned = [c for c in contacts if is_planned(motion, i, c.surface, c.time)]
        met += [c for c in contacts if c not in planned]
        early += [
            f"the simulation meets {c.surface!r} at {c.time:.4g} s, not at {phase.t[-1]:.4g} s as "
            "planned"
            for c in planned
            if _too_early(motion, i, c)
        ]
        missed += [
            c
            for c in motion.trajectory.collisions[i : i + 1]
            if c.surface
            and c.surface not in motion.trajectory.ignored
            and not c.grazes
            and not planned
            and not _softly(motion, i)
        ]
    return _InFlight(tuple(missed), tuple(met), tuple(early))


def _too_early(motion: Motion, i: int, contact: SurfaceContact) -> bool:
    """Whether a contact is met so long before the end of a phase that the gap, which goes on with
    its rate at the end, is further behind the surface than a segment may be off."""
    phase, j = motion.trajectory.phases[i], motion.model.kernels.surfaces.index(contact.surface)
    early = float(phase.t[-1]) - contact.time
    rate = float(motion.model.gap_rates(phase.q[-1], phase.v[-1], phase.t[-1])[j])
    behind = early * rate > PASSING["segment error"] * motion.sizes.gap[j]
    return behind and early > ON_TIME * phase.duration
