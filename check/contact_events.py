"""The events of a motion with lasting contacts beside their laws."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from dmoc.check.checked_motion import Motion
from dmoc.check.contact_forces import BEARABLE, TURNED
from dmoc.check.contact_law import ImpactEvent, ImpactResult, after_event, event_of
from dmoc.check.joins import impulsive_change, planned_impulses, unheld
from dmoc.check.measures import imbalance
from dmoc.codegen.kernels import Array
from dmoc.motion.trajectory import Collision
from dmoc.simulation.contact_modes import RAIL, supports


@dataclass(frozen=True)
class EventErrors:
    """Largest imbalance of energy, of a phase relative to what the motion exchanges, of an event to
    its kinetic energy; errors of the law of impact, relative to the largest momenta and rates and
    to the rates of the event itself; and what contradicts the motion, in sentences."""

    energy: float
    law: float
    own: float
    told: tuple[str, ...]


def event_errors(motion: Motion, work: tuple[float, ...]) -> EventErrors:
    """Compare the energies of phases with their work, and the events with their laws."""
    energy, law, own, told = imbalance(motion, work), 0.0, 0.0, list[str]()
    for i, c in enumerate(motion.trajectory.collisions):
        event = event_of(motion, i)
        if event.wrong:
            told.append(event.wrong)
            continue
        before, after = motion.trajectory.phases[i], motion.trajectory.phases[i + 1]
        found = after_event(motion, event, before.q[-1:], before.v[-1:], c.time)
        energies = motion.model.energy(
            np.vstack([before.q[-1:]] * 2), np.vstack([found.velocity, after.v[:1]]), c.time
        )
        energy = max(energy, abs(float(energies[1] - energies[0])) / motion.sizes.energy)
        law = max(law, _law(motion, i, found))
        own = max(own, _own(motion, i, event, found))
        told += _unbearable(motion, c, event, found)
        told += _otherwise(motion, c, event, found)
        told += _turned(motion, i, event, found)
        told += _approached(motion, i, event)
    energy, law, own = (float(np.nan_to_num(x, nan=np.inf)) for x in (energy, law, own))
    return EventErrors(energy, law, own, tuple(told))


def _given(motion: Motion, c: Collision) -> tuple[Array, Array]:
    """The planned impulses of all surfaces and tangents; none of what grazes."""
    kernels = motion.model.kernels
    if c.grazes:
        return np.zeros(len(kernels.surfaces)), np.zeros(len(kernels.tangents))
    return planned_impulses(kernels, c)


def _law(motion: Motion, i: int, found: ImpactResult) -> float:
    """Errors of the momentum after an event and of its planned impulses, relative to the largest
    momenta."""
    c, model = motion.trajectory.collisions[i], motion.model
    before, after = motion.trajectory.phases[i], motion.trajectory.phases[i + 1]
    q = before.q[-1]
    change = impulsive_change(motion, c, q, _given(motion, c))
    errors = [
        after.p[0] - model.momentum(q, found.velocity[0], c.time),
        unheld(model, q, c.time, after.p[0] - before.p[-1] - change),
    ]
    return float(np.abs(errors / motion.sizes.p).max())


def _own(motion: Motion, i: int, event: ImpactEvent, found: ImpactResult) -> float:
    """Errors of the rates after a hit or a landing relative to the largest of them."""
    if not event.mode.closed:
        return 0.0
    c, model, closed = motion.trajectory.collisions[i], motion.model, list(event.mode.closed)
    before, after = motion.trajectory.phases[i], motion.trajectory.phases[i + 1]
    old, new, right = (
        model.gap_rates(before.q[-1], v, c.time)[closed]
        for v in (before.v[-1], after.v[0], found.velocity[0])
    )
    soft = TURNED * float(motion.sizes.rate[closed].max())  # a landing may have no rate at all
    return float(np.abs(new - right).max() / max(float(np.abs([old, new]).max()), soft))


def _slack(motion: Motion, c: Collision, found: ImpactResult) -> float:
    """What an impulse may be off: a share of the largest of its event, or of what would change the
    rate of a gap by a small share of its size."""
    model = motion.model
    normals = np.ascontiguousarray(model.gap_slopes(c.position, c.time)[:, :-1])
    inertia = (normals * model.responses(c.position, normals, c.time).T).sum(1)
    soft = TURNED * motion.sizes.rate / np.where(inertia > 0, inertia, np.inf)
    return BEARABLE * float(max(np.abs(found.normal).max(initial=0.0), soft.max(initial=0.0)))


def _unbearable(
    motion: Motion, c: Collision, event: ImpactEvent, found: ImpactResult
) -> Iterator[str]:
    """Impulses that pull or leave the cone, by the law or by the plan, and surfaces that take one
    without a part in the event."""
    model, mode, at = motion.model, event.mode, supports(motion.model.kernels)
    normal, tangential = _given(motion, c)
    surfaces, tangents = model.kernels.surfaces, model.kernels.tangents
    slack = _slack(motion, c, found)
    for j, name in enumerate(surfaces):
        least = min(float(found.normal[0, j]), normal[j])
        if least < -slack:
            yield f"{name} would have to pull with an impulse of {-least:.4g} N s at {c.time:.4g} s"
        if j not in mode.closed and normal[j] > slack:
            yield f"{name} takes an impulse at {c.time:.4g} s without being hit or closed"
    for k, name in enumerate(tangents):
        held = model.friction[k] * found.normal[0, at[k]] if at[k] != RAIL else 0.0
        needed = max(abs(float(found.tangential[0, k])), abs(tangential[k]))
        if needed > held + slack * max(model.friction[k], 1.0):
            yield (
                f"{name} would need an impulse of friction of {needed:.4g} N s at {c.time:.4g} s, "
                f"where it holds {max(held, 0.0):.4g} N s"
            )
    sigma = model.slide_rates(c.position, found.velocity[0], c.time)
    along = motion.sizes.slide
    for k, s in mode.sliding:
        if event.rubs is None and s * sigma[k] < -TURNED * along[k]:
            yield f"{tangents[k]} does not slide with the sign {s:+d} after {c.time:.4g} s"


def _turned(motion: Motion, i: int, event: ImpactEvent, found: ImpactResult) -> Iterator[str]:
    """Contacts whose sliding turns in an impact that presses them: how much of their friction acts
    in either direction, the law of impact does not say."""
    before, c, model = motion.modes[i], motion.trajectory.collisions[i], motion.model
    slid, at = dict(before.sliding), supports(model.kernels)
    slack = _slack(motion, c, found)
    for k, s in event.mode.sliding:
        pressed = float(found.normal[0, at[k]])
        if slid.get(k) == -s and model.friction[k] * pressed > slack:
            yield (
                f"{model.kernels.tangents[k]} turns round in the impact at {c.time:.4g} s, which "
                f"presses it with {pressed:.4g} N s: that is known only of contacts that the "
                "impact does not press"
            )


def _otherwise(
    motion: Motion, c: Collision, event: ImpactEvent, found: ImpactResult
) -> Iterator[str]:
    """A hit with friction that goes another way than planned, with other impulses: where both ways
    have the same, the motion lies between them."""
    if event.rubs is None or event.hit is None or not c.course or c.course == found.course:
        return
    normal, tangential = _given(motion, c)
    law = np.array([found.normal[0, event.hit], found.tangential[0, event.rubs]])
    planned = np.array([normal[event.hit], tangential[event.rubs]])
    if np.abs(law - planned).max() > _slack(motion, c, found):
        yield (
            f"by Poisson's law the hit of {c.surface} at {c.time:.4g} s goes {found.course}, not "
            f"{c.course} as planned"
        )


def _approached(motion: Motion, i: int, event: ImpactEvent) -> Iterator[str]:
    """Surfaces hit without being approached, and contacts that leave without opening."""
    c, model = motion.trajectory.collisions[i], motion.model
    surfaces = model.kernels.surfaces
    before, after = motion.trajectory.phases[i], motion.trajectory.phases[i + 1]
    old = model.gap_rates(before.q[-1], before.v[-1], c.time) / motion.sizes.rate
    new = model.gap_rates(before.q[-1], after.v[0], c.time) / motion.sizes.rate
    for name in dict.fromkeys((c.surface, *c.lands) if c.surface else ()):
        if old[surfaces.index(name)] < -TURNED:
            yield f"{name} is not approached where it is hit at {c.time:.4g} s"
    for j in {
        *(surfaces.index(n) for n in c.leaves),
        *((event.hit,) if event.hit is not None and not event.lands else ()),
    }:
        if new[j] > TURNED:
            yield f"{surfaces[j]} is entered where it should open at {c.time:.4g} s"
