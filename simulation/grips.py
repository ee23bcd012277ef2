"""Grips in a simulation: when they close and let go, and what their closing does."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import groupby
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np

from dmoc.base.arguments import check_known, is_number, shown
from dmoc.base.errors import SimulationError
from dmoc.codegen.kernels import Array
from dmoc.mechanics.conditions import conditions_of
from dmoc.mechanics.contact_mode import Mode
from dmoc.mechanics.model import Model
from dmoc.mechanics.model_values import by_name
from dmoc.motion.trajectory import Trajectory
from dmoc.simulation.mode_choice import Place, Setting, is_borne

# A grip takes hold of what is within this share of the size of its place, and moves it there.
WITHIN = 0.01


class Grasp(NamedTuple):
    """Grips that close and that let go at a time, by the numbers of their places; one that closes
    at a single place, and not at the start, does so when this vanishes, from ``ready`` on."""

    time: float
    closes: tuple[int, ...]
    opens: tuple[int, ...]
    ready: float

    def waits(self, floating: Sequence[int]) -> bool:
        """Whether it closes when its place vanishes, and not at its time."""
        return self.time > 0 and len(self.closes) == 1 and self.closes[0] not in floating


def grasps_of(model: Model, grips: Any) -> tuple[Grasp, ...]:
    """What a user says of grips, times from and to which each is closed, in the order of time; the
    grasps of a motion as they are.

    Raises
    ------
    SimulationError
        If a name is none, or times are none or overlap.
    """
    if isinstance(grips, tuple):
        return grips
    changes = list[tuple[float, int, tuple[int, ...]]]()
    contacts = model.contacts
    for name, spans in by_name({} if grips is None else grips, "grips", SimulationError).items():
        check_known(name, contacts.grip_names, "grip", "in grips", SimulationError)
        places, last = tuple(map(contacts.surface_numbers.__getitem__, contacts.places(name))), 0.0
        for begin, end in _spans(name, spans):
            if not last <= begin < end:
                raise SimulationError(
                    f"grips[{name!r}] = {shown(spans)}: expected times that go on, from which to "
                    f"which it is closed, got {begin:g} and {end:g} s after {last:g} s."
                )
            last = end
            changes += [(begin, 1, places), (end, 0, places)]
    by_time = groupby(sorted(changes), itemgetter(0))
    return tuple(_grasp(time, list(of)) for time, of in by_time if np.isfinite(time))


def _grasp(time: float, changes: list[tuple[float, int, tuple[int, ...]]]) -> Grasp:
    """Changes of one time together."""
    closes, opens = (tuple(j for _, c, js in changes if c == one for j in js) for one in (1, 0))
    return Grasp(time, closes, opens, time)


def grasps_along(model: Model, motion: Trajectory) -> tuple[Grasp, ...]:
    """The grasps of a motion; a grip with a single place is ready from the half of the phase before
    its event on."""
    numbers, before = model.surface_numbers, 0.0
    grips = {name for places in motion.grips.values() for name in places}
    first = tuple(numbers[name] for name in motion.phases[0].closed if name in grips)
    grasps = [Grasp(0.0, first, (), 0.0)] if first else []
    for c in motion.collisions:
        closes, opens = (tuple(numbers[n] for n in names if n in grips)
                         for names in (c.lands, c.leaves))  # fmt: skip
        if closes or opens:
            grasps.append(Grasp(c.time, closes, opens, (before + c.time) / 2))
        before = c.time
    return tuple(grasps)


def _spans(name: str, spans: Any) -> Iterator[tuple[float, float]]:
    expected = "expected pairs of times in seconds, such as [(0.4, 1.2)], None for the end"
    if not isinstance(spans, Sequence) or isinstance(spans, str):
        raise SimulationError(f"grips[{name!r}] = {shown(spans)}: {expected}.")
    for span in spans:
        pair = isinstance(span, Sequence) and len(span) == 2
        begin, end = span if pair else ("", "")
        if not is_number(begin) or not (end is None or is_number(end)):
            raise SimulationError(f"grips[{name!r}] has {shown(span)}: {expected}.")
        yield float(begin), np.inf if end is None else float(end)


def closed_by(
    setting: Setting, place: Place, mode: Mode, grasp: Grasp
) -> tuple[Setting, Array, tuple[tuple[int, float], ...]]:
    """The setting from a grasp on, the state y after it, shape (2 nq,), and the impulses of what
    has an impulse in it, by surface.

    Places that have a position move there, the shortest way by the masses; the impulses are those
    after which all that is gripped, and what was closed where it is pressed, has no rate.

    Raises
    ------
    SimulationError
        If a place is too far off to be gripped.
    """
    model, t = setting.model, np.array([place.t])
    _check_within(model, place, grasp)
    kept = tuple(j for j in (*model.gripped, *grasp.closes) if j not in grasp.opens)
    setting = replace(setting, model=model.gripping(kept))
    if not grasp.closes:
        return setting, place.y, ()
    nq, y = model.nq, place.y[None].copy()
    setting.integrator.project(mode, y, t, model.tangents(y[:, :nq], t), False)
    q, v = y[:, :nq], y[:, nq : 2 * nq]
    there = setting.model.in_impact_at(q, t)
    for also in (mode, mode.among((), lambda _: False)):
        held = conditions_of(there, also)
        change, lam = held.answers(there, q, t, -held.rates(there, q, v, t))
        forces = held.spread(there, lam)
        small = np.zeros(model.nc), np.zeros(model.nt)
        if is_borne(there, also, (forces.normal[0], forces.tangential[0]), *small):
            break
    y[:, nq : 2 * nq] = v + change
    felt = np.flatnonzero(forces.normal[0]).tolist()
    return setting, y[0], tuple((j, float(forces.normal[0, j])) for j in felt)


def _check_within(model: Model, place: Place, grasp: Grasp) -> None:
    """Refuse what is too far off to be gripped."""
    q, contacts = place.y[: model.nq], model.contacts
    gaps, slopes = model.gaps(q, place.t), model.gap_slopes(q, place.t)[:, :-1]
    sizes = np.fmax(model.gap_sizes(q, place.t), np.abs(slopes) @ place.small.size[: model.nq])
    for j in grasp.closes:
        if j not in contacts.floating and abs(gaps[j]) > WITHIN * sizes[j]:
            (name,) = contacts.named([j])
            raise SimulationError(
                f"grip {name!r} closes at {place.t:.6g} s, where its place misses zero by "
                f"{-gaps[j]:.3g}: let it close where the place vanishes."
            )
