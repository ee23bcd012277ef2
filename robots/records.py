"""What a file says of a robot, as plain data: links in a tree, with joints and shapes.

Lengths are in m, angles in rad, masses in kg.  A turn is a matrix (3, 3) that takes vectors of a
frame into the one before it.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Limits = tuple[float, float] | None


@dataclass(frozen=True)
class Joint:
    """What moves a link: a hinge, a slide, a ball joint, or nothing at all (free)."""

    name: str
    kind: str  # "hinge", "slide", "ball" or "free"
    place: Array  # (3,) in the frame of its link
    axis: Array  # (3,) of length 1, in the frame of its link
    zero: float = 0.0  # the coordinate where the link is as the file draws it
    limits: Limits = None
    speed: float | None = None
    effort: Limits = None
    driven: bool = False
    damping: float = 0.0
    armature: float = 0.0
    friction: float = 0.0
    stiffness: float = 0.0
    rest: float = 0.0  # where its spring is slack
    follows: tuple[str, tuple[float, ...]] | None = None  # powers of another joint's way


@dataclass(frozen=True)
class Shape:
    """A shape that touches: half sizes of a box, a radius, a radius and half a length."""

    name: str
    kind: str  # "sphere", "capsule", "cylinder", "box", or "site", a point
    size: Array
    place: Array
    turn: Array


@dataclass(frozen=True)
class Link:
    """A rigid body, in the frame of the link that it hangs from."""

    name: str
    before: int | None
    place: Array
    turn: Array
    mass: float
    centre: Array  # of mass
    inertia: Array  # (3, 3) about the centre
    joints: tuple[Joint, ...] = ()
    shapes: tuple[Shape, ...] = ()


@dataclass(frozen=True)
class Description:
    """The links of a file, each behind the one that it hangs from, and what was not taken."""

    name: str
    links: tuple[Link, ...]
    gravity: Array
    notes: list[str] = field(default_factory=list)
