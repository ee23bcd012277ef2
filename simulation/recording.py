"""A simulated motion as phases between its events, as solutions have them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import groupby, pairwise

import numpy as np

from dmoc.base.records import record
from dmoc.base.tolerances import ROUNDING, SAME
from dmoc.codegen.kernels import Array
from dmoc.mechanics.contact_mode import Mode, names_of
from dmoc.mechanics.model import Model
from dmoc.mechanics.model_trajectory import motion_along
from dmoc.mechanics.phase_models import PhaseModels
from dmoc.motion.trajectory import Collision, Phase, Trajectory
from dmoc.simulation.contact_modes import borne
from dmoc.simulation.forward import Run
from dmoc.simulation.mode_choice import Setting
from dmoc.simulation.motion_record import ContactState
from dmoc.simulation.switches import with_switches

SIDES = ("before", "after")
# Events of a motion that is drawn: nobody looks at the pieces between more.
MOST_DRAWN = 1000


@record(frozen=True, eq=False)
class _Side:
    """The state on one side of an event: position, velocity, momentum, forces of all surfaces and
    tangents."""

    q: Array
    v: Array
    p: Array
    normal: Array
    tangential: Array


@dataclass(frozen=True)
class _Moment:
    """A moment between two phases: its sides, and the mode, the collisions and the switch
    there."""

    t: float
    before: _Side
    after: _Side
    mode: Mode = field(default_factory=Mode)
    collisions: tuple[Collision, ...] = ()
    switch: str = ""


def motion_of(run: Run) -> Trajectory:
    """The motion of a simulation: phases with constant inputs between the recorded nodes, and one
    event between any two of them."""
    model = run.model
    near = ROUNDING * float(run.t[-1])  # events that are closer are one moment
    events = [_merged(list(same)) for same in _at_once(_events(run), near)]
    first, last = _recorded(run, 0), _recorded(run, -1)
    mode = Mode()
    if events and events[0].t <= near:  # the mode of the start
        mode, first = events[0].mode, events[0].after
        events = events[1:]
    events = [e for e in events if e.t < run.t[-1] - near]
    edges = [(0.0, first), *((e.t, e.after) for e in events)]
    ends = [*((e.t, e.before) for e in events), (float(run.t[-1]), last)]
    modes = [mode, *(e.mode for e in events)]
    phases = [
        _phase(run, begin, end, m, near) for begin, end, m in zip(edges, ends, modes, strict=True)
    ]
    collisions = [
        _collision(run, e, *ends) for e, ends in zip(events, pairwise(phases), strict=True)
    ]
    own = [run.model_of(float(phase.t[0]), after=True) for phase in phases]
    phases, collisions = with_switches(own, phases, collisions)
    drawn = len(collisions) <= MOST_DRAWN
    rows = [run.model_of(float(phase.t[0]), after=True).par for phase in phases]
    par = np.concatenate(rows) if run.models.change else run.models.par
    return motion_along(
        PhaseModels(model.kernels, par), phases, collisions, run.restitution, drawn=drawn
    )


def _events(run: Run) -> Iterator[_Moment]:
    """Everything between two phases, in the order of time: impacts of the free motion, then the
    moments of contacts that last."""
    model = run.model
    begin = run.marks[0].before.t if run.marks else np.inf
    none = np.zeros(model.nc), np.zeros(model.nt)
    free = [c for c in run.collisions if c.time < begin]
    if free:
        q, t = np.array([c.position for c in free]), np.array([c.time for c in free])
        p = [np.array([getattr(c, f"momentum_{side}") for c in free]) for side in SIDES]
        v = [model.velocity(q, momenta, t) for momenta in p]
        for i, c in enumerate(free):
            before, after = (_Side(q[i], v[k][i], p[k][i], *none) for k in range(2))
            yield _Moment(c.time, before, after, collisions=(c,))
    for mark in run.marks:
        time = mark.after.t
        here = tuple(c for c in run.collisions if c.time == time)
        models = run.model_of(time, after=False), run.model_of(time, after=True)
        sides = _side(models[0], mark.before), _side(models[1], mark.after)
        yield _Moment(time, *sides, mark.mode, here, mark.switch)


def _side(model: Model, at: ContactState) -> _Side:
    q, v = at.y[: model.nq], at.y[model.nq : 2 * model.nq]
    return _Side(q, v, model.momentum(q[None], v[None], at.t)[0], at.normal, at.tangential)


def _recorded(run: Run, k: int) -> _Side:
    return _Side(run.q[k], run.v[k], run.p[k], run.normal[k], run.tangential[k])


def _at_once(events: Iterator[_Moment], near: float) -> Iterator[Iterator[_Moment]]:
    """Events of one moment together."""
    last = -np.inf
    number = 0

    def moment(event: _Moment) -> int:
        nonlocal last, number
        number += event.t - last > near
        last = event.t
        return number

    return (same for _, same in groupby(events, moment))


def _merged(events: list[_Moment]) -> _Moment:
    """Events of one moment as one: from before the first to after the last."""
    hits = tuple(dict.fromkeys(id(c) for e in events for c in e.collisions))
    collisions = {id(c): c for e in events for c in e.collisions}
    last, switch = events[-1], "".join(e.switch for e in events[:1])
    return replace(
        events[0], after=last.after, mode=last.mode, switch=switch,
        collisions=tuple(collisions[i] for i in hits),
    )  # fmt: skip


def _phase(
    run: Run, begin: tuple[float, _Side], end: tuple[float, _Side], mode: Mode, near: float
) -> Phase:
    """The nodes from one event to the next."""
    (first, start), (last, stop) = begin, end
    inner = slice(
        int(np.searchsorted(run.t, first + near, "right")),
        int(np.searchsorted(run.t, last - near, "left")),
    )

    def stacked(name: str) -> Array:
        parts = [getattr(start, name)[None], getattr(run, name)[inner], getattr(stop, name)[None]]
        return np.vstack(parts)

    t = np.concatenate([[first], run.t[inner], [last]])
    contacts, rubbing, closed = run.model.contacts, list(mode.rubbing), sorted(mode.closed)
    q, v, u = stacked("q"), stacked("v"), _inputs(run, t)
    return Phase(
        t,
        q,
        stacked("p"),
        v,
        u,
        contacts.named(closed),
        names_of(contacts, mode)[1],
        np.ascontiguousarray(stacked("normal")[:, closed]),
        np.ascontiguousarray(stacked("tangential")[:, rubbing]),
        joints=tuple(run.model.kernels.joints),
        reaction=_joint_forces(run, mode, np.hstack([q, v]), np.vstack([u[:1], u]), t),
    )


def _joint_forces(run: Run, mode: Mode, y: Array, u: Array, t: Array) -> Array:
    """Forces of the joints at nodes, beside those of contacts."""
    if not run.model.nj:
        return np.zeros((0, 0))
    model = run.model_of(float(t[0]), after=True)
    integrator = Setting(model, run.restitution, run.step_size).integrator
    reaction = integrator.reaction(mode, y, u, t)
    q, v = (np.ascontiguousarray(part) for part in np.split(y, 2, axis=1))
    return borne(model.with_friction_at(q, v, u, t), mode, reaction, q, t).joint


def _inputs(run: Run, t: Array) -> Array:
    """Inputs between nodes, those of the step in which the interval begins."""
    k = np.floor(t[:-1] / run.step_size + ROUNDING * len(run.u)).astype(np.intp)
    return np.array(run.u[np.clip(k, 0, len(run.u) - 1)])


def _collision(run: Run, event: _Moment, before: Phase, after: Phase) -> Collision:
    """The event between two phases; hits at one moment are one, with the name of the first."""
    model, kernels = run.model_of(event.t, after=False), run.model.kernels
    closes = dict.fromkeys((*after.closed, *_torn(model, event)))
    lands = tuple(name for name in closes if name not in before.closed)
    leaves = tuple(name for name in (*before.closed, *lands) if name not in after.closed)
    numbers, h = model.surface_numbers, run.step_size
    off = tuple(name for name in leaves if _slips_off(model, event, numbers[name], h))
    changed = {n: s for n, s in after.rubbing.items() if before.rubbing.get(n) != s}
    changed = model.contacts.said(changed)
    stays = [*lands, *(name for name in before.closed if name in after.closed)]
    hit = [c for c in event.collisions if c.surface not in stays]
    surface = hit[0].surface if hit else (lands[0] if lands else "")
    impulses = {c.surface: float(c.impulse) for c in event.collisions}
    tractions = {name: v for c in event.collisions for name, v in c.tractions.items()}
    q, t = np.array([event.before.q]), np.array([event.t])
    of_grips = model.contacts.named(model.contacts.of_grips)
    still = [name for name in stays if name in of_grips and name not in impulses]
    of = _kept_impulses(model, event, still, (impulses, tractions))
    reactions = dict(zip(kernels.joints, of, strict=False))
    impulses |= dict(zip(still, of[len(kernels.joints) :] if impulses else (), strict=False))
    rates = (0.0, 0.0)
    if surface:
        j = model.surface_numbers[surface]
        v = np.array([event.before.v, event.after.v])
        before_it, after_it = model.gap_rates(np.repeat(q, 2, 0), v, np.repeat(t, 2))[:, j]
        rates = (float(before_it), float(after_it))
    return Collision(
        surface, event.t, event.before.q, impulses.get(surface, 0.0),
        event.before.p, event.after.p, *rates, lands=lands, leaves=leaves, friction=changed,
        impulses=impulses, tractions=tractions, reactions=reactions, off=off, switch=event.switch,
        grips=dict(model.contacts.grips),
    )  # fmt: skip


def _torn(model: Model, event: _Moment) -> Iterator[str]:
    """Places of grips that close in an event, if only to let go at once."""
    of_grips = model.contacts.named(model.contacts.of_grips)
    return (name for c in event.collisions for name in c.lands if name in of_grips)


def _slips_off(model: Model, event: _Moment, j: int, h: float) -> bool:
    """Whether a contact that leaves is at an end of its surface, on its way out, as far as steps of
    the size h locate that."""
    if j not in model.ends:
        return False
    q, v, t = event.before.q, event.after.v, event.t
    rate = model.within_rates(q, v, t)[j]
    return bool(rate < 0 and abs(model.within(q, t)[j]) <= SAME * h * -rate)


def _kept_impulses(
    model: Model, event: _Moment, grips: list[str],
    of_contacts: tuple[dict[str, float], dict[str, float]],
) -> list[float]:  # fmt: skip
    """Impulses of the joints, and of grips that stay closed: what normal and tangential ones of
    contacts leave of the change of the momentum."""
    if not (model.nj or grips):
        return []
    model = model.gripping(tuple(map(model.surface_numbers.__getitem__, grips)))
    impulses, tractions = of_contacts
    q, t = event.before.q, event.t
    rest = model.momentum(q, event.after.v, t) - event.before.p
    normals, along = model.gap_slopes(q, t)[:, :-1], model.tangent_slopes(q, t)[:, :-1]
    for name, impulse in impulses.items():
        rest = rest + impulse * normals[model.surface_numbers[name]]
    for name, traction in tractions.items():
        rest = rest - traction * along[model.tangent_numbers[name]]
    return [float(R) for R in model.joint_forces(model.mass(q, t), -rest[None], q, t)[0]]
