"""What moves as one: links that are fixed to each other, or held, lumped behind the joint that
moves them.

All frames are parallel to that of the world, or of the free body, where no joint has moved from
how the file draws it: a joint is an axis and a place, without turns in between.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from dmoc.base.errors import ModelError
from dmoc.robots.records import Array, Description, Joint, Link, Shape

# A turn that is a quarter's within this, in rad, is one: files write 1.5707963.
EXACT = 1e-7
SMALL = 1e-12  # of entries that vanish: of turns, of places in m, of inertias in kg m2
# By how much one moment of inertia may exceed the sum of the other two, as a part of it: files have
# three or four digits, and of flat bodies both are the same.
ROUNDED = 1e-3
LISTED = 3  # links of a body that a message names


@dataclass(eq=False)
class Part:
    """A body behind a joint, or what stands in the world, with its links: where the frame of each
    is in that of the part, and its turn."""

    name: str
    before: Part | None
    joint: Joint | None
    place: Array  # of the joint in the frame of the part before
    axis: Array
    frames: dict[str, tuple[Array, Array]] = field(default_factory=dict)
    shapes: list[tuple[str, Shape]] = field(default_factory=list)  # with their links
    mass: float = 0.0
    moment: Array = field(default_factory=lambda: np.zeros(3))  # mass times centre
    about: Array = field(default_factory=lambda: np.zeros((3, 3)))  # inertia about the joint

    @property
    def centre(self) -> Array:
        return self.moment / self.mass if self.mass > 0 else np.zeros(3)

    @property
    def inertia(self) -> Array:
        """About the centre of mass."""
        inertia = self.about - self.mass * _steiner(self.centre)
        return (inertia + inertia.T) / 2


def parts_of(description: Description, held: Mapping[str, float], label: str) -> list[Part]:
    """Lump links; ``held`` has values of joints that do not move."""
    parts: list[Part] = []
    ends: list[tuple[Part, Array, Array]] = []  # of each link: its part, origin and turn there
    for link in description.links:
        if link.before is None:
            part, origin, turn = None, np.zeros(3), np.eye(3)
        else:
            part, origin, turn = ends[link.before]
        origin, turn = origin + turn @ link.place, _exact(turn @ link.turn)
        for joint in link.joints:
            axis = _exact_axis(turn @ joint.axis)
            if joint.name in held:
                way = held[joint.name] - joint.zero
                if joint.kind == "hinge":
                    pivot = origin + turn @ joint.place
                    turn = _exact(about(axis, way) @ turn)
                    origin = pivot - turn @ joint.place
                else:
                    origin = origin + axis * way
                continue
            place = origin + turn @ joint.place
            if joint.kind == "free":
                place, turn = np.zeros(3), np.eye(3)
                origin = np.zeros(3)
            else:
                origin = origin - place
            part = Part(link.name, part, joint, _clean(place), axis)
            parts.append(part)
        if part is None:
            part = Part(link.name, None, None, np.zeros(3), np.zeros(3))
            parts.append(part)
        _add(part, link, origin, turn, label)
        ends.append((part, origin, turn))
    for part in parts:
        description.notes.extend(_doubts(part.inertia, several(part.frames), label))
    return parts


def _add(part: Part, link: Link, origin: Array, turn: Array, label: str) -> None:
    """Put a link into a part."""
    _check_load(link, label)
    centre = origin + turn @ link.centre
    part.frames[link.name] = origin, turn
    part.mass += link.mass
    part.moment = part.moment + link.mass * centre
    part.about = part.about + turn @ link.inertia @ turn.T + link.mass * _steiner(centre)
    for shape in link.shapes:
        place, own = origin + turn @ shape.place, _exact(turn @ shape.turn)
        part.shapes.append((link.name, replace(shape, place=place, turn=own)))


def _check_load(link: Link, label: str) -> None:
    numbers = [link.mass, *link.centre, *link.inertia.ravel(), *link.place]
    if not np.all(np.isfinite(numbers)) or link.mass < 0:
        raise ModelError(
            f"link {link.name} of {label} has the mass {link.mass:g} kg and the inertia "
            f"{np.round(link.inertia, 6).tolist()}: expected finite numbers, a mass of 0 or more."
        )


def several(links: Collection[str]) -> str:
    """Names of links that are one body, as a message lists them."""
    more = f" and {len(links) - LISTED} more" if len(links) > LISTED else ""
    return " + ".join([*links][:LISTED]) + more


def _doubts(inertia: Array, what: str, label: str) -> Iterator[str]:
    """Refuse negative moments of inertia, and say of one above the sum of the other two that no
    body has it: energies are positive with it, and simulators take it."""
    small, middle, large = np.linalg.eigvalsh(inertia)
    if small < -ROUNDED * large - SMALL:
        raise ModelError(
            f"the inertia of {what} in {label} has the principal moments {small:.4g}, {middle:.4g} "
            f"and {large:.4g} kg m2: expected none below 0; correct the file."
        )
    if small + middle - large < -ROUNDED * large - SMALL:
        yield (
            f"inertia of {what}: no body has the principal moments {small:.4g}, {middle:.4g} and "
            f"{large:.4g} kg m2, of which the last exceeds the sum of the others; taken as it is"
        )


def _steiner(r: Array) -> Array:
    inertia: Array = r @ r * np.eye(3) - np.outer(r, r)
    return inertia


def about(axis: Array, angle: float) -> Array:
    """The turn about an axis of length 1."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    turn: Array = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return turn


def _clean(values: Array) -> Array:
    """Values without what rounding leaves of zeros."""
    cleaned: Array = np.where(abs(values) < SMALL, 0.0, values)
    return cleaned


def _exact(turn: Array) -> Array:
    """A turn by quarters without what the digits of a file leave of them: it makes short code."""
    near: Array = np.round(turn)
    return near if np.max(abs(turn - near)) < EXACT else _clean(turn)


def _exact_axis(axis: Array) -> Array:
    near: Array = np.round(axis)
    return near if np.max(abs(axis - near)) < EXACT else _clean(axis)


def carried(parts: Sequence[Part], first: Part) -> list[Part]:
    """A part and those that it carries."""
    found = [first]
    for part in parts:
        if part.before in found:
            found.append(part)
    return found
