"""A film: motions as one plain document, which a page or a movie plays.

The document holds numbers, texts, lists and mappings alone, so that it is JSON as it stands.  Where
a column of a scene does not change, it is one number.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypedDict

import numpy as np

from dmoc.motion.scene import Scene, Shape
from dmoc.motion.trajectory import Collision, Trajectory
from dmoc.report.animation.curves import Panel, panels_of
from dmoc.report.animation.numbers import rounded, short
from dmoc.report.animation.places import Bounds, Part, Place, bounds_of, parts_of, place_at
from dmoc.report.default_drawing import scene_for
from dmoc.report.rounding import without_rounding

FORMAT = 1


@dataclass(frozen=True)
class Take:
    """A motion that is shown.

    Attributes
    ----------
    name : str
    trajectory : Trajectory
    status, message : str
        How it was found; empty where nothing is known.
    cost : float or None
    """

    name: str
    trajectory: Trajectory
    status: str = ""
    message: str = ""
    cost: float | None = None


@dataclass(frozen=True)
class Branch:
    """A sequence of a search.

    Attributes
    ----------
    sequence : tuple of str
    name : str
    verdict : str
    cost : float or None
    evidence : tuple of str
        Why the verdict is what it is.
    take : int or None
        Its motion among the takes of the film.
    """

    sequence: tuple[str, ...]
    name: str
    verdict: str
    cost: float | None = None
    evidence: tuple[str, ...] = ()
    take: int | None = None


class Mark(TypedDict):
    """A contact that takes part in an event: where it is, its impulse there as a share of the
    largest of the motion, and what is told of it."""

    contact: str
    at: Place
    impulse: list[float]
    told: str


class Event(TypedDict):
    """What happens between two phases: its word, its impulses in words, and where it does."""

    time: float
    word: str
    told: str
    marks: list[Mark]


class Arrow(TypedDict):
    """A contact force that is drawn: its curve, by panel and position, and the shape where it
    acts."""

    panel: int
    curve: int
    shape: int
    kind: str


class Drawn(TypedDict):
    """A shape: kind, name, and which columns of the parts are its own."""

    kind: str
    name: str
    columns: list[int]


class Motion(TypedDict):
    """A motion of a film.  ``parts`` and the values of panels have one entry a phase."""

    name: str
    model: str
    status: str
    message: str
    cost: float | None
    duration: float
    starts: list[float]
    modes: list[str]
    lasting: bool
    unit: str
    shapes: list[Drawn]
    parts: list[Part]
    bounds: Bounds
    events: list[Event]
    panels: list[Panel]
    arrows: list[Arrow]
    largest: float


class Node(TypedDict):
    """A sequence of a search, and its motion among those of the film."""

    sequence: list[str]
    name: str
    verdict: str
    cost: float | None
    evidence: list[str]
    motion: int | None


class Film(TypedDict):
    """The document: motions that share a clock, or those of the nodes of a tree."""

    format: int
    title: str
    motions: list[Motion]
    tree: list[Node]


def film_of(title: str, takes: Sequence[Take], branches: Sequence[Branch] = ()) -> Film:
    """The document of some motions, or of a search.

    Parameters
    ----------
    title : str
    takes : sequence of Take
    branches : sequence of Branch, optional
        The tree of a search, whose motions the takes are.
    """
    return {
        "format": FORMAT,
        "title": title,
        "motions": [_motion(take) for take in takes],
        "tree": [_node(branch) for branch in branches],
    }


def _node(branch: Branch) -> Node:
    return {
        "sequence": list(branch.sequence),
        "name": branch.name,
        "verdict": branch.verdict,
        "cost": branch.cost,
        "evidence": list(branch.evidence),
        "motion": branch.take,
    }


def _motion(take: Take) -> Motion:
    motion = take.trajectory
    scene = scene_for(motion)
    panels, (parts, which) = panels_of(without_rounding(motion)), parts_of(scene)
    return {
        "name": take.name,
        "model": motion.model,
        "status": take.status,
        "message": take.message,
        "cost": take.cost,
        "duration": motion.final_time,
        "starts": [float(phase.t[0]) for phase in motion.phases],
        "modes": [phase.mode for phase in motion.phases],
        "lasting": motion.lasting,
        "unit": "m" if motion.scene else "",
        "shapes": [_drawn(shape, which) for shape in scene.shapes],
        "parts": parts,
        "bounds": bounds_of(scene),
        "events": [_event(scene, motion, i) for i in range(len(motion.collisions))],
        "panels": panels,
        "arrows": list(_arrows(scene, panels)),
        "largest": _largest_force(motion),
    }


def _drawn(shape: Shape, which: list[int]) -> Drawn:
    columns = which[shape.start : shape.start + shape.size]
    return {"kind": shape.kind, "name": shape.name, "columns": columns}


def _event(scene: Scene, motion: Trajectory, phase: int) -> Event:
    """What happens at the end of a phase, where its contacts are then."""
    event, largest = motion.collisions[phase], _largest_impulse(motion)
    several = event.word != event.surface
    return {
        "time": event.time,
        "word": event.word,
        "told": ", ".join(_impulses(event, name, several) for name in _contacts(event)).strip(", "),
        "marks": [
            {
                "contact": name,
                "at": place,
                "impulse": _along(place, event, name, largest),
                "told": _told(event, name),
            }
            for name in _contacts(event)
            if (place := place_at(scene, phase, name)) is not None
        ],
    }


def _along(place: Place, event: Collision, name: str, largest: float) -> list[float]:
    """The impulse of a contact in the plane, as a share of the largest: P along the normal, T along
    the normal turned clockwise."""
    nx, ny = place[2:]
    normal, friction = (of.get(name, 0.0) / largest for of in (_normal(event), event.tractions))
    return rounded(np.array([normal * nx + friction * ny, normal * ny - friction * nx]))


def _largest_impulse(motion: Trajectory) -> float:
    """What the longest arrow of an impulse stands for; 1 where there is none."""
    events = motion.collisions
    sizes = [abs(p) for e in events for of in (_normal(e), e.tractions) for p in of.values()]
    return max(sizes, default=0.0) or 1.0


def _normal(event: Collision) -> Mapping[str, float]:
    """The normal impulse of each surface."""
    return event.impulses or {event.surface: event.impulse}


def _contacts(event: Collision) -> list[str]:
    """The contacts that take part in an event."""
    surface = [event.surface] if event.surface else []
    parts = (event.impulses, event.tractions, event.lands, event.leaves, event.friction)
    return list(dict.fromkeys(name for part in (surface, *parts) for name in part))


def _told(event: Collision, name: str) -> str:
    """What happens to a contact in the word of its event, and its impulses."""
    words = [w for w in event.word.split() if w.lstrip("+-").split(":")[0] == name] or [name]
    return " ".join([*words, _impulses(event, name, False)]).strip()


def _impulses(event: Collision, name: str, named: bool) -> str:
    """The impulses of a contact in words."""
    if event.grazes:
        return "grazes" if name == event.surface else ""
    whose = f" of {name}" if named else ""
    parts = (("impulse", _normal(event)), ("friction", event.tractions))
    words = [f"{what} {short(of[name])}{whose}" for what, of in parts if of.get(name)]
    return ", ".join(words)


def _arrows(scene: Scene, panels: Iterable[Panel]) -> Iterable[Arrow]:
    """The contact forces whose places are in the scene."""
    at = {shape.name: i for i, shape in enumerate(scene.shapes) if shape.kind == "contact"}
    for i, panel in enumerate(panels):
        for j, curve in enumerate(panel["curves"]):
            if curve["contact"] in at:
                kind = "N" if panel["what"] == "normal" else "T"
                yield {"panel": i, "curve": j, "shape": at[curve["contact"]], "kind": kind}


def _largest_force(motion: Trajectory) -> float:
    """What the longest arrow stands for, in newton."""
    forces = [f for phase in motion.phases for f in (phase.normal, phase.tangential)]
    return max((float(np.abs(f).max(initial=0.0)) for f in forces), default=0.0)
