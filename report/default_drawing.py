"""A drawing of a motion whose model has none, from its coordinates alone.

Lengths are sliders on rails, one below the other and those of one unit to one scale, angles are
hands on dials; lengths called x and y, or x1 and y1, are points in one plane.  The place of a
contact goes with the coordinate that its first event changes most.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from dmoc.base.tolerances import SAME
from dmoc.motion.scene import Array, Scene, Shape, resampled
from dmoc.motion.trajectory import Trajectory

Place: TypeAlias = Callable[[Array], Array]  # columns at rows of positions

ROW = 0.3  # distance of rails, in lengths of a rail
RADIUS = 0.12  # of a dial
SLIDER = (0.06, 0.09)  # width and height
PAIR = re.compile(r"x(\w*)")


@dataclass(frozen=True)
class _Item:
    """A shape and its columns at rows of positions."""

    kind: str
    name: str
    columns: Place


def scene_for(motion: Trajectory) -> Scene:
    """The scene of a motion, or one made from its coordinates alone."""
    return motion.scene or _made(motion)


def _made(motion: Trajectory) -> Scene:
    ways = [resampled(phase.t, phase.q, np.nan_to_num(phase.v)) for phase in motion.phases]
    q = np.vstack([way for _, way in ways])
    items = _items(motion, q)
    shapes, start = [], 0
    for item in items:
        size = item.columns(q[:1]).shape[1]
        shapes.append(Shape(item.kind, item.name, start, size))
        start += size
    values = tuple([np.hstack([item.columns(way) for item in items]) for _, way in ways])
    return Scene(tuple(shapes), tuple([t for t, _ in ways]), values)


def _items(motion: Trajectory, q: Array) -> list[_Item]:
    """Items to draw of a motion through the positions q, shape (n, nq): the plane above, a row for
    each other coordinate below, and the contacts."""
    items: list[_Item] = []
    places: dict[int, Place] = {}
    left, height, span = 0.0, ROW, 1.0
    pairs = _points(motion)
    for pair in pairs:
        items.append(_Item("point", "", _picked(pair)))
        places |= dict.fromkeys(pair, items[-1].columns)
    if pairs:
        at = q[:, [pair[0] for pair in pairs]], q[:, [pair[1] for pair in pairs]]
        left, height = (float(way.min()) for way in at)
        span = max(float(np.ptp(way)) for way in at) or 1.0
    for i, name in enumerate(motion.coordinates):
        if i in places:
            continue
        height -= ROW * span
        if motion.units.get(name) == "rad":
            drawn = _dial(i, name, (left, height, span))
        else:
            drawn = _rail(i, name, (left, height, span), _reach(motion, q, name))
        items += drawn
        places[i] = _place_of(drawn[-1])
    return items + _contacts(motion, places, pairs)


def _points(motion: Trajectory) -> list[list[int]]:
    """Pairs of coordinates that are places of points: x and y with the same ending, all of them in
    the unit of the first."""
    pairs: list[list[int]] = []
    unit = None
    for i, name in enumerate(motion.coordinates):
        match = PAIR.fullmatch(name)
        other = f"y{match[1]}" if match else ""
        units = {motion.units.get(name), motion.units.get(other)}
        if other in motion.coordinates and units == ({unit} if pairs else {motion.units.get(name)}):
            pairs.append([i, motion.coordinates.index(other)])
            unit = motion.units.get(name)
    return pairs


def _picked(columns: list[int]) -> Place:
    return lambda q: q[:, columns]


def _reach(motion: Trajectory, q: Array, name: str) -> tuple[float, float]:
    """Lowest and highest value of the coordinates that have the unit of one."""
    unit = motion.units.get(name)
    same = [i for i, other in enumerate(motion.coordinates) if motion.units.get(other) == unit]
    low, high = float(q[:, same].min()), float(q[:, same].max())
    still = high - low <= SAME * max(abs(low), abs(high))
    return (low - 0.5, high + 0.5) if still else (low, high)


def _rail(
    i: int, name: str, at: tuple[float, float, float], reach: tuple[float, float]
) -> list[_Item]:
    """A slider on a rail from the lowest to the highest value."""
    left, y, span = at
    (low, high), (width, height) = reach, SLIDER

    def slider(q: Array) -> Array:
        x = left + span * (q[:, i] - low) / (high - low)
        return _columns(q, x, y, width * span, height * span, 0.0)

    over = width * span  # the rail goes on beyond the slider
    rail = _Item("link", name, lambda q: _columns(q, left - over, y, left + span + over, y))
    return [rail, _Item("box", "", slider)]


def _dial(i: int, name: str, at: tuple[float, float, float]) -> list[_Item]:
    """A hand on a dial: 0 points to the right, and angles grow counterclockwise."""
    left, y, span = at
    r = RADIUS * span
    x = left + span / 2

    def hand(q: Array) -> Array:
        return _columns(q, x, y, x + r * np.cos(q[:, i]), y + r * np.sin(q[:, i]))

    return [_Item("disc", name, lambda q: _columns(q, x, y, r, 0.0)), _Item("link", "", hand)]


def _columns(q: Array, *values: Array | float) -> Array:
    """Columns of as many rows as there are positions."""
    return np.stack([np.broadcast_to(value, len(q)) for value in values], axis=1).astype(float)


def _place_of(item: _Item) -> Place:
    """The place of a slider, or of the end of a hand."""
    columns = slice(2) if item.kind == "box" else slice(2, 4)
    return lambda q: item.columns(q)[:, columns]


def _contacts(motion: Trajectory, places: dict[int, Place], pairs: list[list[int]]) -> list[_Item]:
    """Contacts at the coordinates that their first events change most, pushing as the impulse
    does."""
    items: dict[str, _Item] = {}
    for event in motion.collisions:
        jump = event.momentum_after - event.momentum_before
        size = np.abs(event.momentum_after) + np.abs(event.momentum_before)
        i = int(np.argmax(np.abs(jump) / np.where(size > 0, size, 1.0)))
        pair = next((pair for pair in pairs if i in pair), [])
        if pair:
            push = _straight(places[i], jump[pair])
        elif motion.units.get(motion.coordinates[i]) == "rad":
            push = _turning(places[i], i, float(np.sign(jump[i])))
        else:
            push = _straight(places[i], jump[i : i + 1])
        for name in dict.fromkeys([event.surface, *event.impulses, *event.lands, *event.leaves]):
            if name:
                items.setdefault(name, _Item("contact", name, push))
    return list(items.values())


def _straight(place: Place, jump: Array) -> Place:
    """Columns of a contact that pushes a point in the plane, or a slider, as its momentum jumps;
    upwards where it does not."""
    size = float(np.linalg.norm(jump))
    normal = [*(jump / size).tolist(), 0.0][:2] if size > 0 else [0.0, 1.0]
    return lambda q: np.hstack([place(q), _columns(q, *normal)])


def _turning(place: Place, i: int, sign: float) -> Place:
    """Columns of a contact that pushes the end of a hand to the side."""
    sign = sign or 1.0

    def push(q: Array) -> Array:
        return np.hstack([place(q), _columns(q, -sign * np.sin(q[:, i]), sign * np.cos(q[:, i]))])

    return push
