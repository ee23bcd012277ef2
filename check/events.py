"""The events of a motion beside their laws."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from dmoc.check.checked_motion import Motion
from dmoc.check.contact_forces import BEARABLE, TURNED
from dmoc.check.findings import Findings, largest
from dmoc.check.passages import EventPassage
from dmoc.mechanics.conditions import conditions_of
from dmoc.mechanics.contacts import RAIL
from dmoc.motion.friction import states_of, sticks, turned
from dmoc.motion.impact_laws import BALL, IMPACT_LAWS, RETURNING
from dmoc.simulation.sizes import Sizes

SOFT = 1e-6  # own rates of a collision count by at least this share of the largest


def event_errors(motion: Motion, work: tuple[float, ...]) -> Findings:
    """Compare the energies of phases with their work, relative to what the motion exchanges, and
    the events with their laws, relative to the largest momenta, rates and kinetic energy, and to
    the rates of the event itself."""
    sizes, fit = motion.sizes, [p for p in motion.passages if not p.wrong]
    laws = [_contact_errors if motion.has_modes or p.c.switch else _impact_errors for p in fit]
    pairs = [law(p, sizes) for law, p in zip(laws, fit, strict=True)]
    own, shares = zip(*pairs, strict=True) if pairs else ((0.0,), (0.0,))
    energies = [_imbalance(motion, work), *[_energy_jump(p) / sizes.energy for p in fit]]
    measured = {
        "energy error": energies,
        "error of the law of impact": shares,
        "error of the law of impact relative to its own rates": own,
    }
    worst = {name: largest(e) for name, e in measured.items()}
    sentences = [p.wrong for p in motion.passages if p.wrong]
    if motion.has_modes:
        sentences += [sentence for p in fit for sentence in _contradictions(p, sizes)]
    return Findings(worst, tuple(sentences))


def _imbalance(motion: Motion, work: tuple[float, ...]) -> float:
    """Largest difference of the change of energy in a phase and the work, friction's too, relative
    to the energy that the motion exchanges."""
    begins, energy = motion.nodes.begins, motion.nodes.energy
    gained = energy[begins[1:] - 1] - energy[begins[:-1]]
    return float(np.abs(gained[: motion.stepped] - work).max()) / motion.sizes.exchanged


def _energy_jump(p: EventPassage) -> float:
    """Difference of the energy after an event from that by the law."""
    q = np.concatenate([p.before.q[-1:], p.after.q[:1]])
    v = np.concatenate([p.law.velocity, p.after.v[:1]])
    by_law, after = p.model.energy(q, v, np.array([p.before.t[-1], p.after.t[0]]))
    return abs(float(after - by_law))


def _impact_errors(p: EventPassage, sizes: Sizes) -> tuple[float, float]:
    """Errors of the rate after a collision, of the impulse, and rates that approach after it or
    leave before it: relative to the rates of the collision itself, and to the largest rate."""
    j = p.model.surface_numbers[p.c.surface]
    before, after, right = p.rates[:, j]
    _, inertia = p.model.impulse_response(p.before.q[-1], p.normals[j], p.c.time)
    impulse = abs(float(p.law.normal[0, j]) - p.c.impulse) * inertia
    off = after - (0.0 if p.c.grazes else right)
    worst = largest([abs(off), impulse, -before, after])
    own = max(abs(before), abs(after), SOFT * float(sizes.rate[j]))
    return 0.0 if p.c.grazes else worst / own, worst / float(sizes.rate[j])


def _contact_errors(p: EventPassage, sizes: Sizes) -> tuple[float, float]:
    """Errors of the rates after a hit or a landing relative to the largest of them, and errors of
    the momentum after an event and of its planned impulses, relative to the largest momenta."""
    off = p.after.p[0] - p.models[1].momentum(p.before.q[-1], p.law.velocity[0], p.c.time)
    share, closed = float(np.abs([off, p.missing] / sizes.p).max()), list(p.mode.closed)
    if not closed:
        return 0.0, share
    before, after, right = p.rates[:, closed]
    soft = TURNED * float(sizes.rate[closed].max())  # a landing may have no rate at all
    return float(np.abs(after - right).max() / max(np.abs([before, after]).max(), soft)), share


def _contradictions(p: EventPassage, sizes: Sizes) -> Iterator[str]:
    """Sentences about an event that its law does not allow."""
    slack = _slack(p, sizes)
    yield from _unbearable(p, sizes, slack)
    yield from _otherwise(p, slack)
    yield from _not_returned(p, sizes)
    if p.law.unheld:
        yield (
            f"{' and '.join(p.law.unheld)} would have to pull or to slip, or stop sliding, in the "
            f"hit of {p.c.surface} at {p.c.time:.4g} s"
        )
    yield from _turned(p, sizes, slack)
    yield from _approached(p, sizes)


def _slack(p: EventPassage, sizes: Sizes) -> float:
    """Errors that an impulse may have: a share of the largest of its event, or of what would change
    the rate of a gap by a small share of its size."""
    response = p.model.responses(p.before.q[-1], p.normals, p.c.time)
    inertia = (p.normals * response.T).sum(axis=1)
    soft = TURNED * sizes.rate / np.where(inertia > 0, inertia, np.inf)
    return BEARABLE * float(max(np.abs(p.law.normal).max(initial=0.0), soft.max(initial=0.0)))


def _unbearable(p: EventPassage, sizes: Sizes, slack: float) -> Iterator[str]:
    """Impulses that pull or leave the cone, by the law or by the plan, and surfaces that take one
    without a part in the event."""
    model, time = p.model, p.c.time
    normal, tangential = (0 * part if p.c.grazes else part for part in p.planned)
    surfaces, tangents = model.kernels.surfaces, model.kernels.tangents
    for j, name in enumerate(surfaces):
        least = min(float(p.law.normal[0, j]), normal[j])
        if least < -slack and not model.contacts.pull[j]:
            yield f"{name} would have to pull with an impulse of {-least:.4g} N s at {time:.4g} s"
        if j not in p.mode.closed and normal[j] > slack:
            yield f"{name} takes an impulse at {time:.4g} s without being hit or closed"
    there = model.in_impact_at(p.before.q[-1], time)
    bearing = np.where(np.array(model.supports) == RAIL, 0.0, there.bearing(p.law.normal[0]))
    for k in model.contacts.lines:
        name, along = tangents[k], model.contacts.directions(k)
        bears = np.inf if k == p.rubs and there.hit_friction[k] == np.inf else float(bearing[k])
        needed = float(
            np.hypot.reduce([p.law.tangential[0, along], tangential[along]], axis=1).max()
        )
        if needed > bears + slack * max(there.friction[k], 1.0):
            yield (
                f"{name} would need an impulse of friction of {needed:.4g} N s at {time:.4g} s, "
                f"where it holds {max(bears, 0.0):.4g} N s"
            )
    sigma = model.slide_rates(p.before.q[-1], p.law.velocity[0], time)
    for k, forward in conditions_of(model, p.mode).forward(sigma).items():
        if p.rubs is None and forward < -TURNED * sizes.slide[k]:
            sign = -np.sign(sigma[k])
            yield f"{tangents[k]} does not slide with the sign {sign:+.0f} after {time:.4g} s"


def _turned(p: EventPassage, sizes: Sizes, slack: float) -> Iterator[str]:
    """Contacts whose sliding turns in an impact that presses them, or stops in one with a course or
    a restitution: how much of their friction acts before and after, the law does not say."""
    model, released = p.model, p.hit is not None and not p.lands and p.restitution[p.hit] != 0
    q, time = p.before.q[-1], p.c.time
    sigma = model.slide_rates(q, p.before.v[-1], time)
    friction = model.with_friction_at(q, t=time).friction
    slid = states_of(sigma, TURNED * sizes.slide)  # of what lands
    for k, s in p.mode.rubbing.items():
        if k == p.rubs:
            continue
        name, pressed = model.kernels.tangents[k], float(p.law.normal[0, model.supports[k]])
        was = p.before.rubbing.get(name, int(slid[k]))
        turns = was == turned(s) != s
        stops = sticks(s) and not sticks(was) and (released or p.rubs is not None)
        if (turns or stops) and friction[k] * pressed > slack:
            yield (
                f"{name} {'turns round' if turns else 'stops sliding'} in the impact at "
                f"{p.c.time:.4g} s, which presses it with {pressed:.4g} N s: that is known only of "
                "contacts that the impact does not press"
            )


def _otherwise(p: EventPassage, slack: float) -> Iterator[str]:
    """A hit with friction that goes another way than planned, with other impulses: where both ways
    have the same, the motion lies between them."""
    c, course = p.c, p.law.course
    if p.rubs is None or p.hit is None or not c.course or c.course == course:
        return
    along = p.model.contacts.directions(p.rubs)
    normal, tangential = p.planned[0][p.hit], p.planned[1][along]
    off = normal - p.law.normal[0, p.hit], *(tangential - p.law.tangential[0, along])
    if max(map(abs, off)) > slack:
        yield (
            f"by {IMPACT_LAWS[p.impact.by].name} the hit of {c.surface} at {c.time:.4g} s goes "
            f"{course}, not {c.course} as planned"
        )


def _not_returned(p: EventPassage, sizes: Sizes) -> Iterator[str]:
    """A hit whose tangential rate after it is not that of its tangential restitution."""
    if p.rubs is None or p.impact.by not in (RETURNING, BALL) or p.c.grazes:
        return
    v = np.vstack([p.before.v[-1], p.after.v[0], p.law.velocity[0]])
    q, t = np.repeat(p.before.q[-1:], len(v), axis=0), np.full(len(v), p.c.time)
    law = IMPACT_LAWS[p.impact.by].name
    law = f"its law of {law}" if p.impact.by == RETURNING else law
    for k in p.model.contacts.directions(p.rubs):
        before, after, right = p.model.slide_rates(q, v, t)[:, k]
        if abs(after - right) > TURNED * sizes.slide[k]:
            yield (
                f"the hit of {p.c.surface} at {p.c.time:.4g} s violates {law}: its point slides "
                f"with {before:.4g} before it and {after:.4g} after it, where the law has "
                f"{right:.4g}"
            )


def _approached(p: EventPassage, sizes: Sizes) -> Iterator[str]:
    """Surfaces hit without being approached, and contacts that leave without opening."""
    c, numbers, grips = p.c, p.model.surface_numbers, p.model.contacts.pull
    before, after = p.rates[:2] / sizes.rate
    for name in dict.fromkeys((c.surface, *c.lands) if c.surface else ()):
        if before[numbers[name]] < -TURNED and not grips[numbers[name]]:
            yield f"{name} is not approached where it is hit at {c.time:.4g} s"
    released = (p.hit,) if p.hit is not None and not p.lands else ()
    leaving = (name for name in c.leaves if name not in c.off)
    for j in {*map(numbers.__getitem__, leaving), *released}:
        if after[j] > TURNED and not grips[j]:
            yield f"{p.model.kernels.surfaces[j]} is entered where it should open at {c.time:.4g} s"
