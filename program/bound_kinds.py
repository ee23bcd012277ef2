"""What can hold a motion back, and the texts that say so."""

from __future__ import annotations

from enum import Enum


class BoundKind(Enum):
    """What is limited; the values are the texts, in which ``s`` is that of a plural."""

    GAP = "gap to {name} at {places} node{s}"
    INSIDE = "gap to {name} inside {places} step{s}"
    PATH = "path constraint {name} in {places} step{s}"
    BOUND = "bound of {name} in {places} step{s}"
    PEAK = "peak of {name} in {places} step{s}"
    CONE = "friction cone of {name} at {places} node{s}"
    DIRECTION = "sliding of {name} in {places} step{s}"
    DURATION = "duration of phase {name} {side} {value} s"
    INPUT = "{name} {side} {value} in {places} step{s}"
    COORDINATE = "{name} {side} {value} in {places} node{s}"
    IMPULSE = "impulse of collision {name} >= 0"
    OTHER = "{name}"


# Those that hold inputs or the motion along the way, and not only the times.
ALONG_THE_WAY = (
    BoundKind.GAP,
    BoundKind.INSIDE,
    BoundKind.PATH,
    BoundKind.BOUND,
    BoundKind.INPUT,
    BoundKind.COORDINATE,
)
