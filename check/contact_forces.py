"""The forces of lasting contacts and of friction in a motion, beside those of the flow and beside
what contacts can bear."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields, replace

import numpy as np

from dmoc.base.names import unit_constraint
from dmoc.base.tolerances import ROUNDING
from dmoc.check.checked_motion import Motion, PlannedNodes, put
from dmoc.check.consistency import DRIFT, OFF
from dmoc.check.findings import Findings, largest
from dmoc.codegen.kernels import Array
from dmoc.mechanics.conditions import conditions_of
from dmoc.mechanics.contact_mode import FREE
from dmoc.mechanics.contacts import RAIL
from dmoc.mechanics.touch import friction_changes
from dmoc.motion.friction import sticks
from dmoc.simulation.contact_modes import Reaction, nearest
from dmoc.simulation.sizes import NOTHING, pushes

# What a force may pull or exceed its cone by, as a share of the largest of its contact, and what a
# sliding velocity may turn by, as a share of its size.
BEARABLE, TURNED = 0.01, 1e-3
# A friction force counts by at least this share of a weak contact force: solvers leave 1e-10 of the
# forces of a motion, and friction whose coefficient is zero holds nothing.
SMOOTH = 1e-5
# An event that is planned may happen within this share of the phase that it ends.
ON_TIME = 0.01
# What a contact may still push with where it leaves, as a share of its largest force.
PRESSED = 0.05
FORCE, REACTION = "error of a contact force", "error of a constraint force"


def forces(motion: Motion, i: int) -> Reaction:
    """The forces (2, n, ...) that hold a phase at its places, with the inputs before each and after
    it: where others have the same effect, those next to the planned ones."""
    at, mode = motion.places[i], motion.modes[i]
    own = motion.nodes.of_phase(i)
    y, inside = motion.held.y[own], slice(own.stop - own.start, None)
    if len(at.t[inside]):
        rows, _ = put(motion, mode, np.hstack([at.q[inside], at.v[inside]]), at.t[inside])
        y = np.concatenate([y, rows])
    planned = np.hstack([at.normal, _sticking(motion, i, at), at.reaction])
    y, v, t, planned = (np.concatenate([a, a]) for a in (y, at.v, at.t, planned))
    q, u = np.ascontiguousarray(y[:, : motion.model.nq]), np.concatenate(at.inputs)
    there = motion.model.with_friction_at(q, v, u, t)
    reaction = motion.flow.integrator.reaction(mode, y, u, t)
    best = nearest(there, mode, reaction, q, t, planned)
    kinds = (getattr(best, field.name) for field in fields(Reaction))
    return Reaction(*(kind.reshape(2, len(at.t), -1) for kind in kinds))


def _sticking(motion: Motion, i: int, at: PlannedNodes) -> Array:
    """The planned friction of what sticks in a phase, in the order of its mode."""
    names, tangents = list(motion.trajectory.phases[i].rubbing), motion.model.kernels.tangents
    return at.tangential[:, [names.index(tangents[k]) for k in motion.modes[i].sticking]]


def force_errors(motion: Motion) -> tuple[Findings, tuple[Array, Array, Array]]:
    """Compare the forces of all phases with the flow's, relative to the largest of each contact or
    joint: what is found, and these, of contacts (nc,), friction (nt,) and joints (nj,)."""
    model = motion.model
    if not (motion.has_modes or model.nj):
        none = np.zeros(model.nc), np.zeros(model.nt), np.zeros(0)
        return Findings({FORCE: 0.0, REACTION: 0.0}), none
    flows = [forces(motion.within(i), i) for i in range(motion.stepped)]
    normal, tangential, joint = _sizes(motion, flows)
    worst, sentences = {FORCE: 0.0, REACTION: 0.0}, left_out(motion)
    for i, (mode, flow) in enumerate(zip(motion.modes, flows, strict=False)):
        own = motion.within(i)
        for name, error in _differences(own, i, flow, (normal, tangential, joint)):
            worst[name] = max(worst[name], error)
        if mode == FREE:
            continue
        sentences += _off(own, i)
        sentences += _negative(own, i)
        sentences += _reversed(own, i)
        sentences += _paradoxes(own, i)
        sentences += _pulling(own, i, flow, normal)
        sentences += _slipping(own, i, flow, tangential)
        sentences += _turning(own, i)
    # What leaves or begins to slide would not, with the inputs after the event, kept as it was.
    for i in range(motion.stepped - 1):
        sentences += _pressed(motion.within(i + 1), i, normal)
    for i in range(motion.stepped):
        sentences += _gripped(motion.within(i), i, tangential)
    return Findings(worst, tuple(sentences)), (normal, tangential, joint)


def _pressed(motion: Motion, i: int, size: Array) -> Iterator[str]:
    """Contacts that leave while they are pressed."""
    model = motion.model
    c, after = motion.trajectory.collisions[i], motion.trajectory.phases[i + 1]
    if not c.leaves:
        return
    q, v, t = after.q[:1], after.v[:1], after.t[:1]
    rates = model.gap_rates(q, v, t)[0]
    for name in c.leaves:
        j = model.surface_numbers[name]
        if name in c.off:
            continue  # under its load
        if model.contacts.pull[j] or rates[j] < -DRIFT * motion.sizes.rate[j]:
            continue  # it lets go whatever its force, or opens with a velocity
        still_closed = replace(motion.modes[i + 1], closed=(*motion.modes[i + 1].closed, j))
        y, u = np.hstack([q, v]), motion.steps[i + 1].u0[:1]
        force = motion.flow.integrator.reaction(still_closed, y, u, t).normal[0, j]
        if force > PRESSED * size[j]:
            yield f"{name} leaves at {c.time:.4g} s, pressed with {force:.4g} N"


def _gripped(motion: Motion, i: int, size: Array) -> Iterator[str]:
    """Contacts that begin to slide in phase i while friction holds them, and would go on to for
    longer than an event may be late.  Within steps what it spares is taken as linear."""
    model, mode, after = motion.model, motion.modes[i], motion.trajectory.phases[i]
    if i and motion.trajectory.collisions[i - 1].surface:
        return  # an impact may set it off
    begin = float(after.t[0])
    changed = friction_changes(motion.modes[i - 1] if i else FREE, mode)
    begun = [k for k, state in changed.items() if not sticks(state)]
    if not begun:
        return
    late = ON_TIME * max(p.duration for p in motion.trajectory.phases[max(i - 1, 0) : i + 1])
    soon = int((after.t[:-1] - begin < late).sum())

    def sides(rows: Array, ends: Array) -> Array:
        """Rows at the starts and at the ends of the first steps, one after the other."""
        return np.stack([rows[:soon], ends[:soon]], axis=1).reshape(2 * soon, *rows.shape[1:])

    q, v, t = (sides(rows[:-1], rows[1:]) for rows in (after.q, after.v, after.t))
    u = sides(motion.steps[i].u0, motion.steps[i].u1)
    fast = np.abs(model.slide_rates(after.q[:1], after.v[:1], after.t[:1])[0])
    for k in begun:
        if fast[k] > DRIFT * motion.sizes.slide[k]:
            continue
        sticking = mode.stopping((k,))
        reaction = motion.flow.integrator.reaction(sticking, np.hstack([q, v]), u, t)
        bears = model.with_friction_at(q, v, u, t).bearing(reaction.normal)[:, k]
        spare = bears - np.abs(reaction.tangential[:, k]) - PRESSED * size[k]
        if _lost(t, spare) - begin > late:
            yield (
                f"{model.kernels.tangents[k]} begins to slide at {begin:.4g} s, where friction "
                f"holds it: it has {bears[0]:.4g} N and needs "
                f"{abs(reaction.tangential[0, k]):.4g} N"
            )


def _lost(t: Array, spare: Array) -> float:
    """When a value that is linear between its times first falls to zero."""
    below = np.flatnonzero(~(spare > 0))
    if not len(below) or not below[0]:
        return float(t[0]) if len(below) else np.inf
    a, b = below[0] - 1, below[0]
    return float(t[a] + (t[b] - t[a]) * spare[a] / (spare[a] - spare[b]))


def left_out(motion: Motion) -> list[str]:
    """Friction that a phase leaves out, or has at an open contact."""
    kernels, sentences = motion.model.kernels, []
    for phase in motion.trajectory.phases:
        span = f"from {phase.t[0]:.4g} to {phase.t[-1]:.4g} s"
        for name, j, rubs in zip(
            kernels.tangents, motion.model.supports, motion.model.has_friction, strict=True
        ):
            touches = j == RAIL or kernels.surfaces[j] in phase.closed
            if rubs and touches and name not in phase.rubbing:
                sentences.append(f"the friction of {name!r} is left out {span}")
            elif not touches and name in phase.rubbing:
                sentences.append(f"{name!r} rubs {span} where its contact is open")
    return sentences


def _sizes(motion: Motion, flows: list[Reaction]) -> tuple[Array, Array, Array]:
    """The largest contact forces (nc,), friction forces that are possible (nt,) and forces of
    joints (nj,) of a motion; what carries little counts by a share of the forces of the motion."""
    model = motion.model
    normal, traction, joint = (
        np.max([np.abs(getattr(f, kind)).max(axis=(0, 1)) for f in flows], axis=0, initial=0.0)
        for kind in ("normal", "tangential", "joint")
    )
    nodes, sizes = motion.nodes, motion.sizes
    normal = np.maximum(normal, pushes(nodes, sizes, nodes.gap_slopes))
    smooth = SMOOTH * pushes(nodes, sizes, nodes.tangent_slopes)
    rubbing = [motion.rubbing[i] for i in range(motion.stepped)]
    kinds = [mu for there in rubbing for mu in (there.static_friction, there.friction)]
    most = np.max([mu.max(axis=tuple(range(mu.ndim - 1))) for mu in kinds], axis=0)
    bearing = model.with_coefficients(most).bearing(normal)
    friction = np.maximum.reduce([bearing, BEARABLE * traction, smooth])
    joint = np.maximum(joint, pushes(nodes, sizes, model.joint_slopes(nodes.q, nodes.t)))
    return (*(np.maximum(size, NOTHING) for size in (normal, friction, joint)),)


def _differences(
    motion: Motion, i: int, flow: Reaction, sizes: tuple[Array, ...]
) -> Iterator[tuple[str, float]]:
    """Errors of the planned forces of a phase, relative to the sizes, by what they are; between two
    steps whose inputs differ every force between theirs is right.  Lengths of quaternions are none
    of the motion's constraints: what keeps them does nothing to a body."""
    phase, kernels, at = motion.trajectory.phases[i], motion.model.kernels, motion.places[i]
    lengths = {unit_constraint(name) for name in kernels.manifest.attitudes}
    for what, planned, names, numbers, by_law, size in (
        (FORCE, at.normal, phase.closed, kernels.surfaces, flow.normal, sizes[0]),
        (FORCE, at.tangential, tuple(phase.rubbing), kernels.tangents, flow.tangential, sizes[1]),
        (REACTION, at.reaction, phase.joints, kernels.joints, flow.joint, sizes[2]),
    ):
        for column, name in enumerate(names):
            if name in lengths:
                continue
            j = numbers.index(name)
            low, high = by_law[..., j].min(axis=0), by_law[..., j].max(axis=0)
            off = np.maximum(low - planned[:, column], planned[:, column] - high)
            yield what, largest(off / size[j])


def _off(motion: Motion, i: int) -> Iterator[str]:
    """Closed contacts off their surfaces and what sticks off its place, and their rates."""
    at, model, sizes, mode = motion.places[i], motion.model, motion.sizes, motion.modes[i]
    slid, gaps, floating = (
        model.tangents(at.q, at.t),
        model.gaps(at.q, at.t),
        model.contacts.floating,
    )
    gaps[:, floating] -= gaps[0, floating]
    for names, places, off, rates, size, rate in (
        (
            model.kernels.surfaces, mode.closed, gaps,
            model.gap_rates(at.q, at.v, at.t), sizes.gap, sizes.rate,
        ),
        (
            model.kernels.tangents, mode.sticking, slid - slid[0],
            model.slide_rates(at.q, at.v, at.t),
            sizes.place, sizes.slide,
        ),
    ):  # fmt: skip
        for j in places:
            k = int(np.argmax(np.abs(off[:, j])))
            if not abs(off[k, j]) <= OFF * size[j]:
                surface = places is mode.closed
                where = "place" if surface and model.contacts.pull[j] else "surface"
                what = f"is off its {where}" if surface else "has slipped"
                yield f"{names[j]!r} {what} by {off[k, j]:.3g} at {at.t[k]:.4g} s"
            k = int(np.argmax(np.abs(rates[:, j])))
            if not abs(rates[k, j]) <= DRIFT * rate[j]:
                yield (
                    f"{names[j]!r} moves with {rates[k, j]:.3g} at {at.t[k]:.4g} s, where it is "
                    "held"
                )


def _negative(motion: Motion, i: int) -> Iterator[str]:
    """Friction with a negative coefficient."""
    at, model = motion.places[i], motion.model
    there = motion.rubbing[i]
    for k, s in motion.modes[i].rubbing.items():
        coefficients = there.static_friction if sticks(s) else there.friction
        coefficients = np.broadcast_to(coefficients, (2, len(at.t), model.nt))
        least = coefficients[..., k].min(axis=0)
        row, most = int(np.argmin(least)), float(np.abs(coefficients[..., k]).max())
        if not least[row] >= -ROUNDING * most:
            yield (
                f"the friction of {model.kernels.tangents[k]} is {least[row]:.4g} at "
                f"{_place(motion, i, row)}, which no friction is"
            )


def _reversed(motion: Motion, i: int) -> Iterator[str]:
    """Static friction that varies and is below the kinetic one with which sliding begins."""
    at, model = motion.places[i], motion.model
    pairs = [k for k in motion.modes[i].rubbing if model.paired[k] and k in model.varying_friction]
    sides = [model.with_friction_at(at.q, u=u, t=at.t) for u in at.inputs] if pairs else []
    for k in pairs:
        static, kinetic = (
            np.array([getattr(there, kind)[:, k] for there in sides])
            for kind in ("static_friction", "friction")
        )
        side, row = np.unravel_index(int(np.argmin(static - kinetic)), static.shape)
        if static[side, row] < kinetic[side, row] - ROUNDING * float(np.abs(kinetic).max()):
            yield (
                f"the static friction of {model.kernels.tangents[k]} is {static[side, row]:.4g} at "
                f"{_place(motion, i, int(row))}, below the kinetic one, {kinetic[side, row]:.4g}"
            )


def _place(motion: Motion, i: int, row: int) -> str:
    """When and where a place of a phase is, in words."""
    at = motion.places[i]
    place = zip(motion.model.kernels.coordinates, at.q[row], strict=True)
    return f"{at.t[row]:.4g} s, " + ", ".join(f"{name} = {x:.4g}" for name, x in place)


def _paradoxes(motion: Motion, i: int) -> Iterator[str]:
    """Sliding contacts whose force would press them together (Painleve's paradox)."""
    phase, model, mode = motion.trajectory.phases[i], motion.model, motion.modes[i]
    sliding = mode.among(mode.closed, lambda k: k not in mode.sticking)
    if not sliding.rubbing:
        return
    inputs = np.vstack([motion.steps[i].u0, motion.steps[i].u1[-1:]])
    there = model.with_friction_at(phase.q, phase.v, inputs, phase.t)
    closed = conditions_of(there, sliding, joints=False)
    C = closed.slopes(there, phase.q, phase.t)[..., :-1]
    B = closed.pushes(there, phase.q, phase.t, C)
    for place, j in enumerate(mode.closed):
        pushed = model.responses(phase.q, np.ascontiguousarray(B[:, place]), phase.t)
        wrong = np.flatnonzero(~((C[:, place] * pushed).sum(axis=1) < 0))
        if len(wrong):
            yield (
                f"sliding of {model.kernels.surfaces[j]!r} at {phase.t[wrong[0]]:.4g} s presses "
                "the contact together whatever its force (Painleve's paradox): no motion does that"
            )


def _pulling(motion: Motion, i: int, flow: Reaction, size: Array) -> Iterator[str]:
    """Contacts that would have to pull."""
    at, surfaces = motion.places[i], motion.model.kernels.surfaces
    for column, j in enumerate(motion.modes[i].closed):
        least = np.minimum(flow.normal[..., j].min(axis=0), at.normal[:, column])
        k = int(np.argmin(least))
        if not (motion.model.contacts.pull[j] or least[k] >= -BEARABLE * size[j]):
            yield f"{surfaces[j]} would have to pull with {-least[k]:.4g} N at {at.t[k]:.4g} s"


def _slipping(motion: Motion, i: int, flow: Reaction, size: Array) -> Iterator[str]:
    """Friction beyond what its contact or rail holds."""
    at, model = motion.places[i], motion.model
    there = motion.rubbing[i]
    for j in (k for k in motion.modes[i].sticking if k in model.contacts.lines):
        bears = there.bearing(flow.normal)[..., j]
        needs = model.contacts.needed(flow.tangential)[..., j]
        beyond = (needs - bears).max(axis=0)
        k = int(np.argmax(beyond))
        if not beyond[k] <= BEARABLE * size[j]:
            side = int(np.argmax((needs - bears)[:, k]))
            yield (
                f"{model.kernels.tangents[j]} would have to stick with {needs[side, k]:.4g} N at "
                f"{at.t[k]:.4g} s, where it holds {max(bears[side, k], 0.0):.4g} N"
            )


def _turning(motion: Motion, i: int) -> Iterator[str]:
    """Sliding against its planned direction, or from rest into the other one."""
    phase, model = motion.trajectory.phases[i], motion.model
    rates, size = model.slide_rates(phase.q, phase.v, phase.t), motion.sizes.slide
    slides = conditions_of(model, motion.modes[i])
    for j, forward in slides.forward(rates).items():
        k = int(np.argmin(forward))
        if not forward[k] >= -TURNED * size[j]:
            yield (
                f"{model.kernels.tangents[j]} slides with {rates[k, j]:.4g} at {phase.t[k]:.4g} s, "
                f"against its planned direction {-np.sign(rates[k, j]):+.0f}"
            )
