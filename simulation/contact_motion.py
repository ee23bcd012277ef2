"""Forward simulation through lasting contacts and friction: the continuous flow of one mode after
the other, from event to event.

Within a step of the simulation the inputs are constant.  What a mode keeps above zero is looked at
in several places of the way (gaps, contact forces, what friction still bears, sliding velocities);
where something falls below, the moment is located, impacts are resolved, and the laws of contact
and friction choose the mode that follows.  Steps that clearly keep their mode are gone in compiled
code (:meth:`dmoc.simulation.integrator.Integrator.stay`).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dmoc.base.errors import SimulationError
from dmoc.codegen.kernels import Array
from dmoc.mechanics.contact_mode import Mode, names_of
from dmoc.mechanics.model import Model
from dmoc.motion.friction import friction_word
from dmoc.motion.trajectory import Collision
from dmoc.simulation.contact_impacts import dying, struck
from dmoc.simulation.contact_modes import borne
from dmoc.simulation.grips import Grasp, closed_by
from dmoc.simulation.impact_orders import Undecided
from dmoc.simulation.mode_choice import BEHIND, Hints, Place, Setting, check_driven, mode_at, there
from dmoc.simulation.mode_flow import LOCATED, ModeFlow
from dmoc.simulation.motion_record import ContactState, ModeChange, MotionRecord
from dmoc.simulation.roots import crossing
from dmoc.simulation.tolerances import Magnitudes, magnitudes_at, tolerances

MOST_EVENTS, MOST_AT_ONCE = 1000, 50  # within one step, and at one moment of it
MOST_OFTEN = 10  # hits of a step in the long run, beyond which steps resolve nothing
MOMENT = 1e-4  # of a step: flights of bounces that do not die away are longer
MOST_SHOWN = 3  # of the events that come to no end
SHORTEST = 1e-13  # share of a step that is not gone any more


def through_grasps(
    setting: Setting, y: Array, u: Array, span: tuple[float, float],
    so_far: tuple[Magnitudes, MotionRecord], ahead: deque[Grasp],
) -> tuple[Setting, Array, Mode]:  # fmt: skip
    """As :func:`through_step`, through the grasps of the step, which are taken from those
    ``ahead``; also the setting that is left."""
    (largest, journal), (begin, end) = so_far, span
    while ahead and ahead[0].ready < end - SHORTEST * setting.h:
        time = _time_of(setting, y, u, (begin, end), largest, ahead[0])
        if time is None:
            break
        grasp = ahead.popleft()
        if time - begin > SHORTEST * setting.h:
            setting, y, mode = through_step(setting, y, u, (begin, time), so_far)
            journal.last = node(setting, mode, y, u, time)
        place = _place(setting, y, u, time, largest)
        place, mode = _resolved(setting, place, (Mode(), Hints()), largest, journal)
        before, held = place.y, setting.model.gripped
        grasp = grasp._replace(opens=tuple(j for j in grasp.opens if j in held))
        setting, y, impulses = closed_by(setting, place, mode, grasp)
        journal.collisions += _grasped(setting.model, time, (before, y), grasp, impulses)
        begin = time
    return through_step(setting, y, u, (begin, end), so_far)


def _time_of(
    setting: Setting, y: Array, u: Array, span: tuple[float, float], largest: Magnitudes,
    grasp: Grasp,
) -> float | None:  # fmt: skip
    """When grips close or let go in a part of a step, if they do: at their time; one that waits for
    its place where this vanishes."""
    (begin, end), model, nq = span, setting.model, setting.model.nq
    if not grasp.waits(model.contacts.floating):
        return max(grasp.time, begin) if grasp.time < end - SHORTEST * setting.h else None
    (j,) = grasp.closes
    begin = max(begin, grasp.ready)
    if begin > span[0]:
        free = MotionRecord(last=None)
        setting, y, _ = through_step(setting, y, u, (span[0], begin), (largest, free))

    def gap(time: float) -> float:
        _, then, _ = through_step(setting, y, u, (begin, time), (largest, MotionRecord(last=None)))
        return float(model.gaps(then[:nq], time)[j])

    before = float(model.gaps(y[:nq], begin)[j])
    if abs(before) <= model.gap_rounding(y[:nq], begin)[j]:
        return begin
    after = gap(end)
    if before * after > 0:
        return None
    return crossing(gap, (begin, before), (end, after), LOCATED * setting.h)


def _grasped(
    model: Model, t: float, states: tuple[Array, Array], grasp: Grasp,
    impulses: tuple[tuple[int, float], ...],
) -> Iterator[Collision]:  # fmt: skip
    """The event in which grips close, between two states (q | v)."""
    if not grasp.closes:
        return
    nq, names = model.nq, model.kernels.surfaces
    q = states[1][:nq].copy()
    before, after = (model.momentum(q, y[nq : 2 * nq], t) for y in states)
    of = {names[j]: impulse for j, impulse in impulses}
    lands = model.contacts.named(grasp.closes)
    yield Collision(
        lands[0], t, q, of.get(lands[0], 0.0), before, after, lands=lands,
        leaves=model.contacts.named(grasp.opens), impulses=of, grips=dict(model.contacts.grips),
    )  # fmt: skip


def node(setting: Setting, mode: Mode, y: Array, u: Array, t: float) -> ContactState:
    """A state y, shape (2 nq,), at inputs u, shape (nu,), with the forces of its mode."""
    model, times = setting.model, np.array([t])
    q, v = np.split(y[None, : 2 * model.nq], 2, axis=1)
    reaction = setting.integrator.reaction(mode, y[None], u[None], times)
    there = model.with_friction_at(q, v, u[None], times)
    reaction = borne(there, mode, reaction, q, times)
    return ContactState(t, y, reaction.normal[0], reaction.tangential[0])


def start(setting: Setting, y: Array, u: Array, t: float) -> Mode:
    """The mode of a state y, shape (2 nq,), that approaches nothing, at inputs u, shape (nu,)."""
    place = _place(setting, y, u, t, magnitudes_at(setting.model, y, u, t, setting.h, Magnitudes()))
    return mode_at(setting, place, Hints())


def on_surfaces(setting: Setting, y: Array, t: float, share: float) -> Array:
    """A state moved onto the surfaces that it lies on up to a share of the sizes of their gaps."""
    model, q = setting.model, y[: setting.model.nq]
    near = np.abs(model.gaps(q, t)) <= share * model.gap_sizes(q, t)
    near &= (model.within(q, t) >= 0) & ~model.contacts.pull
    return _placed(setting, near, y, t)


def _placed(setting: Setting, on: NDArray[np.bool_], y: Array, t: float) -> Array:
    """A state whose position is moved onto some surfaces."""
    mode, rows = Mode(tuple(map(int, np.flatnonzero(on)))), y[None].copy()
    setting.integrator.project(mode, rows, np.array([t]), np.zeros((1, 0)), False)
    return np.asarray(rows[0])


def _place(setting: Setting, y: Array, u: Array, t: float, largest: Magnitudes) -> Place:
    small = tolerances(setting.model, y[: setting.model.nq], t, setting.h, largest)
    return Place(t, y, u, small)


def through_step(
    setting: Setting,
    y: Array,
    u: Array,
    span: tuple[float, float],
    so_far: tuple[Magnitudes, MotionRecord],
) -> tuple[Setting, Array, Mode]:
    """The state after a step with constant inputs, and its mode there; also the setting, in which
    grips that were loaded beyond their strength have let go."""
    model, (largest, journal), (begin, end) = setting.model, so_far, span
    place, hints = _place(setting, y, u, begin, largest), Hints()
    mode, modes, times = Mode(), list[Mode](), list[float]()
    before, ahead, struck_before = journal.last, None, len(journal.collisions)
    for _ in range(MOST_EVENTS):
        if ahead:
            mode = mode_at(setting, ahead, Hints())
        else:
            place, mode = _resolved(setting, place, (mode, hints), largest, journal)
        way = ModeFlow(setting, place, mode)
        gone = end - place.t <= SHORTEST * setting.h
        last, event = (place.y, None) if gone else way.until(end)
        ahead, lasts = None, False
        if event and event.limit is None:
            ahead = _place(setting, way.state(event.broken), u, event.broken, largest)
        if event is None or event.time > place.t or not ahead:  # or it does not last
            changed = journal.note(model, setting.whole(mode), place.t)
            if before is not None and (changed or len(journal.collisions) > struck_before):
                after = node(setting, mode, place.y, u, place.t)
                journal.marks.append(ModeChange(before, after, setting.whole(mode)))
            struck_before, lasts = len(journal.collisions), True
        if event is None:
            return setting, last, mode
        y = way.state(event.time)
        before = node(setting, mode, y, u, event.time) if lasts else before
        modes.append(mode)
        times.append(event.time)
        often = MOST_EVENTS + MOST_OFTEN * end / setting.h
        if _crowded(times, setting.h) or len(journal.collisions) > often:
            break
        largest = magnitudes_at(model, y, u, event.time, setting.h, largest)
        place = _place(setting, y, u, event.time, largest)
        if event.limit in model.gripped:
            setting, hints = setting.without(event.limit), Hints()
            model = setting.model
        elif event.limit is not None:
            hints = _hints(setting, place, mode, event.limit)
            place = replace(place, y=_on_limit(setting, place, mode, event.limit))
    shown = ", ".join(_events_shown(model, modes, journal))
    raise SimulationError(
        f"collisions or changes of contact come to no end at t = {place.t:.6g} s, {len(modes)} in "
        f"the step of {setting.h:.4g} s (Zeno), the last of {shown}: give these surfaces a "
        "restitution of 0, change the step size, or stop before it."
    )


def _crowded(times: list[float], h: float) -> bool:
    """Whether the last events of a step come to no end."""
    return len(times) >= MOST_AT_ONCE and times[-1] - times[-MOST_AT_ONCE] < MOMENT * h


def _events_shown(model: Model, modes: list[Mode], journal: MotionRecord) -> Iterator[str]:
    """Words for the surfaces hit, and the modes, that alternate in the last events."""
    for name in dict.fromkeys(c.surface for c in journal.collisions[-MOST_SHOWN:]):
        yield f"hits of {name!r}"
    for mode in dict.fromkeys(modes[-MOST_SHOWN:]):
        closed, rubbing = names_of(model.contacts, mode)
        words = [f"{name!r} closed" for name in closed]
        words += [
            f"{name!r} {friction_word(s)}" for name, s in model.contacts.said(rubbing).items()
        ]
        yield " and ".join(words) or "all open"


def _resolved(
    setting: Setting,
    place: Place,
    before: tuple[Mode, Hints],
    largest: Magnitudes,
    journal: MotionRecord,
) -> tuple[Place, Mode]:
    """The place after the impacts on what it touches and approaches, and the mode that follows."""
    model, nq = setting.model, setting.model.nq
    mode, hints = before
    q, v = place.y[:nq], place.y[nq : 2 * nq]
    hit = (model.gaps(q, place.t) >= -place.small.gap) & (
        model.gap_rates(q, v, place.t) > place.small.rate
    )
    hit &= there(model, place)
    if not hit.any():
        return place, mode_at(setting, place, hints)
    check_driven(model, place, [int(j) for j in np.flatnonzero(hit)])
    # Errors of location would add up from bounce to bounce.
    place = replace(place, y=_placed(setting, hit, place.y, place.t))
    resting = setting.integrator.reaction(mode, place.y[None], place.u[None], np.array([place.t]))
    impact = struck(model, place, resting, setting.restitution, setting.h)
    if impact.orders:
        journal.undecided.append(Undecided(place.t, impact.velocity, impact.orders))
    after = place.y.copy()
    after[nq : 2 * nq] = impact.velocity
    largest = magnitudes_at(model, after, place.u, place.t, setting.h, largest)
    place = _place(setting, after, place.u, place.t, largest)
    mode = mode_at(setting, place, Hints())
    if at_rest := dying(setting, place, mode, model.gap_rates(q, v, place.t)):
        closed = replace(mode, closed=(*mode.closed, *at_rest))
        place = replace(place, y=_projected(setting, closed, place))
        mode = mode_at(setting, place, Hints())
    journal.collisions += _records(model, place, (v, mode), impact.impulses)
    return place, mode


def _records(
    model: Model, place: Place, before: tuple[Array, Mode],
    impulses: tuple[tuple[int, float, Mapping[int, float]], ...],
) -> Iterator[Collision]:  # fmt: skip
    """The collisions of one moment, in their order."""
    kernels, (v, mode) = model.kernels, before
    q = place.y[: model.nq].copy()
    p, normals = model.momentum(q, v, place.t), model.gap_slopes(q, place.t)[:, :-1]
    along = model.tangent_slopes(q, place.t)[:, :-1]
    M = model.mass(q, place.t)
    for j, impulse, tractions in impulses:
        name = kernels.surfaces[j]
        own = dict.fromkeys((k for k, on in enumerate(model.supports) if on == j), 0.0)
        own |= tractions
        change = -impulse * normals[j] + sum(T * along[k] for k, T in own.items())
        change = model.with_joints(M, change, q, place.t)
        yield Collision(
            name, place.t, q, impulse, p, p + change,
            lands=(name,) if j in mode.closed else (),
            impulses={name: impulse},
            tractions={kernels.tangents[k]: T for k, T in own.items()},
        )  # fmt: skip
        p = p + change


def _hints(setting: Setting, place: Place, mode: Mode, which: int) -> Hints:
    """Hints for the mode that follows after the limit ``which`` of a mode."""
    nc, nt = setting.model.nc, setting.model.nt
    if which < nc:
        return Hints(opening=(which,) if which in mode.closed else ())
    if which < nc + nt:
        rows = place.y[None], place.u[None], np.array([place.t])
        force = setting.integrator.reaction(mode, *rows).tangential[0, which - nc]
        return Hints(slipping=((which - nc, -1 if force > 0 else 1),))
    return Hints()


def _on_limit(setting: Setting, place: Place, mode: Mode, which: int) -> Array:
    """The state moved to where the mode's conditions hold, and a sliding that has stopped rests; so
    does an open surface that is reached without a rate, or it would be reached at once again."""
    model, nq = setting.model, setting.model.nq
    rates = model.gap_rates(place.y[:nq], place.y[nq : 2 * nq], place.t)
    met = which < model.nc and which not in mode.closed and rates[which] <= place.small.rate[which]
    met = met and bool(there(model, place)[which])
    first = model.nc + model.nt
    stopped = (which - first,) if first <= which < first + model.nt else ()
    if which < model.nc and which not in mode.closed:
        _check_beside(setting, place, which)
    closed = tuple(sorted({*mode.closed, which} if met else mode.closed))
    return _projected(setting, replace(mode.stopping(stopped), closed=closed), place)


def _check_beside(setting: Setting, place: Place, j: int) -> None:
    """Refuse a way that comes into a surface from beside its end."""
    model, q = setting.model, place.y[: setting.model.nq]
    behind = float(model.gaps(q, place.t)[j])
    if j in model.ends and behind > BEHIND * place.small.gap[j]:
        raise SimulationError(
            f"the motion comes into surface {model.kernels.surfaces[j]!r} at t = {place.t:.6g} s "
            f"from beside its end, {behind:.4g} behind it, where no law of impact holds: state "
            "what is hit there as a surface of its own, or stop before it."
        )


def _projected(setting: Setting, mode: Mode, place: Place) -> Array:
    """The state moved, the shortest way by the masses, to where the conditions of a mode hold."""
    t, y = np.array([place.t]), place.y[None].copy()
    setting.integrator.project(mode, y, t, setting.model.tangents(y[:, : setting.model.nq], t))
    return np.asarray(y[0])
