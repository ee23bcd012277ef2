"""A film: motions as what figures, films and pages show of them.

Drawings, curves, events and contact forces are found here once; :mod:`dmoc.report.animation.page`
writes them as JSON.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TypedDict

import numpy as np

from dmoc.motion.scene import INPUTS, Array, Scene, Shape
from dmoc.motion.trajectory import SIGNS, Collision, Trajectory
from dmoc.report.curves import Panel, panels_of
from dmoc.report.default_drawing import scene_for
from dmoc.report.labels import short
from dmoc.report.rounding import without_rounding


class EventMark(TypedDict):
    """A contact that takes part in an event: where it is, with the direction in which the surface
    pushes, its impulse as a share of the largest, and what is told of it."""

    contact: str
    at: Array
    impulse: Array
    told: str


class FilmEvent(TypedDict):
    """What happens between two phases: its word, its impulses in words, and where it does."""

    time: float
    word: str
    told: str
    marks: list[EventMark]


class Arrow(TypedDict):
    """A contact force, or an input in space, that is drawn: its curve, by panel and position, the
    shape where it acts, and the value of the longest of its kind."""

    panel: int
    curve: int
    shape: int
    kind: str
    largest: float


@dataclass(frozen=True)
class Take:
    """A motion that is shown."""

    name: str
    trajectory: Trajectory
    status: str = ""  # how it was found, with its message; empty where nothing is known
    message: str = ""
    cost: float | None = None

    @cached_property
    def scene(self) -> Scene:
        """The drawing of its model, or one made from its coordinates alone."""
        return scene_for(self.trajectory)

    @cached_property
    def panels(self) -> list[Panel]:
        return panels_of(without_rounding(self.trajectory))

    @cached_property
    def events(self) -> list[FilmEvent]:
        """Events at the ends of phases, with the places of their contacts then."""
        motion = self.trajectory
        at = {contact.name: contact for contact in self.scene.contacts}
        sizes = [abs(p) for e in motion.collisions for own in _impulses(e) for p in own.values()]
        largest = max(sizes, default=0.0) or 1.0
        events: list[FilmEvent] = []
        for phase, event in enumerate(motion.collisions):
            names, several = _contacts(event), event.word != event.surface
            marks: list[EventMark] = []
            for name in names:
                if name in at:
                    place = self.scene.of(at[name], phase)[-1]
                    push = _push(place, event, name) / largest
                    words = _mark_in_words(event, name)
                    marks.append({"contact": name, "at": place, "impulse": push, "told": words})
            words = ", ".join(_in_words(event, name, several) for name in names).strip(", ")
            events.append({"time": event.time, "word": event.word, "told": words, "marks": marks})
        return events

    @cached_property
    def arrows(self) -> list[Arrow]:
        """The contact forces whose places are in the scene, and the inputs that have arrows there;
        of friction those in the plane."""
        arrows: list[Arrow] = []
        for i, panel in enumerate(self.panels):
            kind = panel.quantity
            if kind not in "uNT":
                continue
            largest = _largest(panel) if kind == "u" else self.largest
            for j, curve in enumerate(panel.curves):
                name = curve.name if kind == "u" else curve.contact
                arrows += [
                    {"panel": i, "curve": j, "shape": k, "kind": kind, "largest": largest}
                    for k, shape in enumerate(self.scene.shapes)
                    if shape.name == name and _shows(shape, kind)
                ]
        return arrows

    @cached_property
    def largest(self) -> float:
        """The force that the longest arrow stands for, in newton."""
        phases = [phase for phase in self.trajectory.phases if phase.steps]
        forces = [f for phase in phases for f in (phase.normal, phase.tangential)]
        return max((float(np.abs(f).max(initial=0.0)) for f in forces), default=0.0)


@dataclass(frozen=True)
class Branch:
    """A sequence of a search."""

    sequence: tuple[str, ...]
    name: str
    verdict: str
    cost: float | None = None
    evidence: tuple[str, ...] = ()  # why the verdict is what it is
    motion: int | None = None  # its motion among the takes of the film
    proved: str = ""  # what is proved of it


@dataclass(frozen=True)
class Film:
    """Motions that share a clock, or those of the nodes of a tree."""

    title: str
    takes: tuple[Take, ...]
    tree: tuple[Branch, ...] = ()
    statement: str = ""  # what is proved of all sequences


@dataclass(frozen=True)
class Proofs:
    """What is proved of the sequences of a search, and of all of them, in words."""

    proved: Mapping[tuple[str, ...], str] = field(default_factory=dict)
    statement: str = ""


def _shows(shape: Shape, kind: str) -> bool:
    """Whether values of a kind have arrows at a shape: friction has none in space."""
    if kind == "u":
        return shape.kind in INPUTS
    return shape.kind == "contact" or (shape.kind == "touch" and kind == "N")


def _largest(panel: Panel) -> float:
    """The largest value of the inputs of a panel."""
    values = [v for curve in panel.curves for v in curve.values if v is not None]
    return max((float(np.abs(v).max(initial=0.0)) for v in values), default=0.0)


def _push(place: Array, event: Collision, name: str) -> Array:
    """The impulse of a contact: P along the normal and, in the plane, T along the normal turned
    clockwise."""
    normal, friction = (own.get(name, 0.0) for own in _impulses(event))
    if len(place) == 6:
        return np.asarray(normal * place[3:])
    nx, ny = place[2:]
    return np.array([normal * nx + friction * ny, normal * ny - friction * nx])


def _impulses(event: Collision) -> tuple[Mapping[str, float], Mapping[str, float]]:
    """The normal impulse of each surface, and the friction."""
    return event.impulses or {event.surface: event.impulse}, event.tractions


def _contacts(event: Collision) -> list[str]:
    """The contacts that take part in an event."""
    surface = [event.surface] if event.surface else []
    parts = (event.impulses, event.tractions, event.lands, event.leaves, event.friction)
    return list(dict.fromkeys(name for part in (surface, *parts) for name in part))


def _mark_in_words(event: Collision, name: str) -> str:
    """The part of an event's word about a contact, and its impulses."""
    signs = "".join(SIGNS)
    words = [w for w in event.word.split() if w.lstrip(signs).split(":")[0] == name] or [name]
    return " ".join([*words, _in_words(event, name, False)]).strip()


def _in_words(event: Collision, name: str, named: bool) -> str:
    """The impulses of a contact."""
    if event.grazes:
        return "grazes" if name == event.surface else ""
    whose = f" of {name}" if named else ""
    parts = zip(("impulse", "friction"), _impulses(event), strict=True)
    return ", ".join(f"{what} {short(own[name])}{whose}" for what, own in parts if own.get(name))
