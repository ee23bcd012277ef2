"""The independent check of a motion with lasting contacts or friction.

It is compared with the flow of its planned modes, whose forces follow from the conditions on the
accelerations: step by step and segment by segment, each from its own states.  There a contact that
lifts off, friction that gives way and sliding that stops are located by the flow itself, and so are
surfaces that are met in phases in which nothing is closed or rubs: another event, or one at another
time, contradicts the motion.  The run from the start to the end is not independent in this: it goes
through the planned events at their planned times.  Events must obey their law.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dmoc.codegen.kernels import Array
from dmoc.simulation.amplification import carried
from dmoc.simulation.contact_events import event_errors
from dmoc.simulation.contact_forces import (
    BEARABLE,
    TURNED,
    ForceErrors,
    force_errors,
    left_out,
    still_held,
)
from dmoc.simulation.contact_location import ON_TIME
from dmoc.simulation.contact_measures import (
    event_slope,
    flow_of,
    is_free,
    is_planned,
    open_loop,
    segments,
    step_errors,
)
from dmoc.simulation.flow import Contact
from dmoc.simulation.joins import torn
from dmoc.simulation.measures import input_excess, wrong_places
from dmoc.simulation.motion import Motion
from dmoc.simulation.runs import contacts_of_phase
from dmoc.simulation.verdict import (
    PASSING,
    TERMINAL,
    Verification,
    broken,
    exceeded,
    is_unstable,
    largest_excess,
    lost_by,
    too_coarse,
    unstable,
)
from dmoc.trajectory import GRAZING


def judged_with_contacts(motion: Motion) -> Verification:
    """Measure a motion and judge it."""
    flow, held = flow_of(motion), _forces(motion)
    steps, on_the_way = step_errors(motion, flow), segments(motion, flow, _slack(motion, held))
    parts = on_the_way.parts
    events, inputs = event_errors(motion, steps.work), input_excess(motion)
    missed, in_flight, early = _in_flight(motion)
    met = [c for c in (*on_the_way.met, *in_flight) if c.jump > GRAZING]
    extra = dict.fromkeys(f"a contact with {c.surface!r} at {c.time:.4g} s" for c in met)
    defects = np.array([part.error for part in parts])
    worst = float(defects.max(initial=0.0))
    terminal, flowed = open_loop(motion, flow), carried(motion, parts, event_slope)
    amplified = flowed.amplification
    measured = {
        "step error": steps.worst, "segment error": worst, "energy error": events.energy,
        "error of the law of impact": events.law,
        "error of the law of impact relative to its own rates": events.own,
        "penetration": steps.penetration, "excess of a limit": steps.excess,
        "excess of an input": inputs, "error of a contact force": held.largest,
    }  # fmt: skip
    told = [*torn(motion), *wrong_places(motion, "contact"), *held.told, *events.told]
    told += [*on_the_way.told, *early, *still_held(motion, held.sizes)]
    told += lost_by(missed, tuple(extra), 0.0)
    too_far, note = exceeded(measured) + broken(steps.path), ""
    if not terminal <= TERMINAL:
        lost = lost_by((), (), terminal)
        if is_unstable(worst, amplified, terminal, flowed.end) and not (told or too_far):
            note = unstable(amplified, lost, worst)
        else:
            too_far = lost + too_far
    message = "; ".join(told + too_far)
    if too_far and not told:
        message = too_coarse(too_far, amplified)
    return Verification(
        not (told or too_far), message or note, terminal, amplified,
        steps.worst, defects, events.energy, events.law, missed,
        tuple(extra), steps.penetration, max(steps.excess, inputs), tuple(met), held.largest,
        largest_excess(steps.path),
    )  # fmt: skip


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


def _in_flight(motion: Motion) -> tuple[tuple[str, ...], list[Contact], list[str]]:
    """Planned contacts at the ends of free phases that are missed, contacts on the way there that
    were not planned, and those that are met before their time."""
    missed, met, early = list[str](), list[Contact](), list[str]()
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
            f"the contact with {c.surface!r} at {phase.t[-1]:.4g} s"
            for c in motion.trajectory.collisions[i : i + 1]
            if c.surface
            and c.surface not in motion.trajectory.ignored
            and not c.grazes
            and not planned
            and not _softly(motion, i)
        ]
    return tuple(missed), met, early


def _too_early(motion: Motion, i: int, contact: Contact) -> bool:
    """Whether a contact is met so long before the end of a phase that the gap, which goes on with
    its rate at the end, is further behind the surface than a segment may be off."""
    phase, j = motion.trajectory.phases[i], motion.model.kernels.surfaces.index(contact.surface)
    early = float(phase.t[-1]) - contact.time
    rate = float(motion.model.gap_rates(phase.q[-1], phase.v[-1], phase.t[-1])[j])
    behind = early * rate > PASSING["segment error"] * motion.sizes.gap[j]
    return behind and early > ON_TIME * phase.duration
