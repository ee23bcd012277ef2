"""How a model looks: rods, masses, bodies, springs and walls, with places in q, t and parameters.

Shapes that the plane alone has are here, and those whose places are in the plane or in space; those
of space are in :mod:`dmoc.symbolic.solids`.  A drawing is looks and no physics: solutions do not
depend on it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import sympy as sp

from dmoc.base.arguments import listed, shown
from dmoc.base.errors import ModelError
from dmoc.base.signatures import public
from dmoc.symbolic.definitions import expanded
from dmoc.symbolic.expressions import expression_in
from dmoc.symbolic.solids import (
    SOLIDS,
    Arrow,
    Moved,
    Solid,
    carried_solid,
    columns_of,
    kind_of,
    unit,
)
from dmoc.symbolic.vectors import Vector, positive_length

# x and y, or x, y and z in space, as SymPy expressions.
Place: TypeAlias = Vector


@public(ModelError)
@dataclass(frozen=True, init=False)
class Link:
    """A rod, or a polyline through several points: ``Link((0, 0), elbow, tip)``.

    Points are pairs of SymPy expressions in coordinates, parameters and the time, or matrices of
    two entries; x points to the right, y upwards.  In space they are triples, and z points upwards.

    Examples
    --------
    >>> import dmoc
    >>> dmoc.Link((0, 0), (0, -1), (1, -1)).points
    ((0, 0), (0, -1), (1, -1))
    """

    points: tuple[Place, ...]

    def __init__(self, *points: Any) -> None:
        if len(points) < 2:
            raise ModelError(
                f"a Link has {len(points)} points: expected two or more, as in "
                "Link((0, 0), (x, y))."
            )
        what = "a point of a Link"
        first = _place(points[0], what)
        rest = [_place(p, what, (len(first),)) for p in points[1:]]
        object.__setattr__(self, "points", (first, *rest))


@public(ModelError)
@dataclass(frozen=True)
class Point:
    """A point mass, in the plane or in space.

    Examples
    --------
    >>> import dmoc
    >>> dmoc.Point(at=(0, 1)).at
    (0, 1)
    """

    at: Any

    def __post_init__(self) -> None:
        object.__setattr__(self, "at", _place(self.at, "the place of a Point"))


@public(ModelError)
@dataclass(frozen=True)
class Disc:
    """A disc in the plane; a mark shows its angle in rad, which grows counterclockwise.

    Examples
    --------
    >>> import dmoc
    >>> dmoc.Disc(centre=(0, 1), radius=0.2).radius
    0.200000000000000
    """

    centre: Any
    radius: Any
    angle: Any = 0

    def __post_init__(self) -> None:
        object.__setattr__(self, "centre", _place(self.centre, "the centre of a Disc"))
        object.__setattr__(self, "radius", positive_length(self.radius, "the radius of a Disc"))
        object.__setattr__(self, "angle", expression_in(self.angle, "the angle of a Disc"))


@public(ModelError)
@dataclass(frozen=True)
class Box:
    """A rectangle in the plane around its centre, turned by an angle in rad counterclockwise.

    Examples
    --------
    >>> import dmoc
    >>> dmoc.Box(centre=(0, 0), width=0.4, height=0.2).width
    0.400000000000000
    """

    centre: Any
    width: Any
    height: Any
    angle: Any = 0

    def __post_init__(self) -> None:
        object.__setattr__(self, "centre", _place(self.centre, "the centre of a Box"))
        object.__setattr__(self, "width", positive_length(self.width, "the width of a Box"))
        object.__setattr__(self, "height", positive_length(self.height, "the height of a Box"))
        object.__setattr__(self, "angle", expression_in(self.angle, "the angle of a Box"))


@public(ModelError)
@dataclass(frozen=True)
class Spring:
    """A spring between two points, of the plane or of space.

    Examples
    --------
    >>> import dmoc
    >>> dmoc.Spring(a=(0, 0), b=(0, 1)).b
    (0, 1)
    """

    a: Any
    b: Any

    def __post_init__(self) -> None:
        object.__setattr__(self, "a", _place(self.a, "an end of a Spring"))
        object.__setattr__(self, "b", _place(self.b, "an end of a Spring", (len(self.a),)))


@public(ModelError)
@dataclass(frozen=True)
class Wall:
    """A wall or a floor of the plane from a to b, solid on the right as one looks from a to b: a
    floor goes from left to right.

    Examples
    --------
    >>> import dmoc
    >>> dmoc.Wall(a=(-1, 0), b=(1, 0)).a
    (-1, 0)
    """

    a: Any
    b: Any

    def __post_init__(self) -> None:
        object.__setattr__(self, "a", _place(self.a, "an end of a Wall"))
        object.__setattr__(self, "b", _place(self.b, "an end of a Wall"))


@public(ModelError)
@dataclass(frozen=True)
class Contact:
    """Where the force of a surface, or the friction of a tangent, acts.

    Attributes
    ----------
    surface : str
        Name of the surface, or of the rail.
    at : pair
        The point that touches; a triple in space.
    normal : pair, optional
        Direction in which the surface pushes what it touches; of any length but zero.  By default
        that in which its gap moves the place, or, of a rail, the one to the left of its tangent.
        Friction is drawn along the normal turned by 90 degrees clockwise: to the right over a
        floor.  In space it is not drawn.

    Examples
    --------
    >>> import dmoc
    >>> dmoc.Contact("floor", at=(0, 0), normal=(0, 1)).normal
    (0, 1)
    """

    surface: str
    at: Any
    normal: Any = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "at", _place(self.at, "the place of a Contact"))
        if self.normal is None:
            return
        normal = _place(self.normal, "the normal of a Contact", (len(self.at),))
        if not any(normal):
            raise ModelError(
                f"the normal of the Contact {shown(self.surface)} is zero: expected the direction "
                "in which the surface pushes, as in normal=(0, 1)."
            )
        object.__setattr__(self, "normal", normal)


Part: TypeAlias = Link | Point | Disc | Box | Spring | Wall | Contact | Solid
PARTS = (Link, Point, Disc, Box, Spring, Wall, Contact, *SOLIDS)
# What has a place in the plane or in space, by its kind in a scene in space.
EITHER = {Link: "rod", Point: "bob", Spring: "coil", Contact: "touch"}


def parts_in(drawing: Any, contacts: Iterable[str], inputs: Iterable[Any]) -> tuple[Part, ...]:
    """Read a drawing, whose contacts and inputs are some of those named; raise ModelError for what
    is none."""
    names, acting = list(contacts), set(inputs)
    kinds = ", ".join(dict.fromkeys(part.__name__ for part in PARTS))
    if not isinstance(drawing, Sequence) or isinstance(drawing, str):
        raise ModelError(f"drawing = {shown(drawing)}: expected a list of shapes out of {kinds}.")
    seen: set[str] = set()
    for part in drawing:
        if not isinstance(part, PARTS):
            raise ModelError(f"the drawing contains {shown(part)}: expected shapes out of {kinds}.")
        if isinstance(part, Arrow) and part.input not in acting:
            raise ModelError(
                f"the drawing has an Arrow of {shown(part.input)}: expected an input of the model."
            )
        if not isinstance(part, Contact):
            continue
        if part.surface not in names:
            raise ModelError(
                f"the drawing has a Contact of {shown(part.surface)}: expected a surface or a rail "
                f"of the model, {'one of ' + ', '.join(names) if names else 'which has none'}."
            )
        if part.surface in seen:
            raise ModelError(f"the drawing has two Contacts of {part.surface!r}: give one.")
        seen.add(part.surface)
    if len({in_space(part) for part in drawing}) > 1:
        flat, solid = (next(p for p in drawing if in_space(p) is where) for where in (False, True))
        raise ModelError(
            f"the drawing has shapes of the plane, such as {shown(flat)}, and of space, such as "
            f"{shown(solid)}: give all places two entries, or all of them three."
        )
    return tuple(drawing)


def in_space(part: Part) -> bool:
    """Whether a shape is one in space."""
    match part:
        case Link():
            return len(part.points[0]) == 3
        case Point() | Contact():
            return len(part.at) == 3
        case Spring():
            return len(part.a) == 3
    return isinstance(part, SOLIDS)


def values_of(part: Part) -> tuple[Any, ...]:
    """The expressions of a shape, in the order of the columns of a scene."""
    if isinstance(part, SOLIDS):
        return columns_of(part)
    match part:
        case Link():
            return tuple(x for point in part.points for x in point)
        case Point():
            return tuple(part.at)
        case Disc():
            return (*part.centre, part.radius, part.angle)
        case Box():
            return (*part.centre, part.width, part.height, part.angle)
        case Spring() | Wall():
            return (*part.a, *part.b)
        case Contact():
            # Of one whose place in a table counts alone, any direction does.
            normal = part.normal or (0, 0, 1)[-len(part.at) :]
            return (*part.at, *unit(normal))


def with_normal(
    part: Part, gaps: Mapping[str, Any], tangents: Mapping[str, Any], coordinates: Sequence[Any],
    definitions: Mapping[Any, Any],
) -> Part:  # fmt: skip
    """A contact with the direction in which it pushes; another shape as it is.

    A force F at the place a(q) does the work of -grad g of a gap g(q) <= 0, or of grad tau of a
    tangent: a_q' F = v.
    """
    if not isinstance(part, Contact) or part.normal is not None:
        return part
    rail = part.surface not in gaps
    along = tangents[part.surface] if rail else -gaps[part.surface]
    place, symbols = (*part.at, along), (*coordinates, *definitions)
    # What is so for any values of definitions is so for their own.
    direction = _axis(*_slopes(place, symbols))
    if direction is None:
        slopes, v = _slopes([expanded(e, definitions) for e in place], coordinates)
        direction = _axis(slopes, v) or _force(slopes, v)
    if not any(direction):
        raise ModelError(
            f"the Contact {shown(part.surface)} is at a place that its surface does not move: give "
            "the direction in which it pushes, as in normal=(0, 1)."
        )
    if rail and len(direction) == 3:
        raise ModelError(
            f"the Contact {shown(part.surface)} in space has a tangent and no surface: give the "
            "direction in which it pushes, as in normal=(0, 0, 1)."
        )
    if rail:
        direction = -direction[1], direction[0]
    return replace(part, normal=direction)


def _slopes(place: Sequence[Any], symbols: Sequence[Any]) -> tuple[Any, Any]:
    """Derivatives of a place, and of what is along the force there, by symbols."""
    slopes = sp.Matrix(place).jacobian(symbols)
    return slopes[:-1, :], slopes[-1, :].T


def _axis(slopes: Any, v: Any) -> Place | None:
    """The direction of F in slopes' F = v if it is along an axis, as nearly always."""
    size = slopes.rows
    axes = [tuple(sign * int(i == k) for i in range(size)) for sign in (1, -1) for k in range(size)]
    for along in (*axes, tuple(slopes * v)):  # that of places that are names of their own is last
        if any(along) and (slopes.T * sp.Matrix(along) - v).expand().is_zero_matrix:
            return along
    return None


def _force(slopes: Any, v: Any) -> Place:
    """The direction of F in slopes' F = v."""
    gram = slopes * slopes.T
    flat = sp.simplify(gram.det()) == 0
    force = (slopes if flat else gram.adjugate() * slopes) * v
    return tuple(e if sp.simplify(e) != 0 else sp.S.Zero for e in force)


def table_of_drawing(drawing: Iterable[Part]) -> list[list[Any]]:
    """Kind, name, first column and number of columns of each shape."""
    table: list[list[Any]] = []
    start = 0
    for part in drawing:
        size = len(values_of(part))
        table.append([*_kind_and_name(part), start, size])
        start += size
    return table


def _kind_and_name(part: Part) -> tuple[str, str]:
    if isinstance(part, SOLIDS):
        return kind_of(part)
    kind = EITHER[type(part)] if in_space(part) else type(part).__name__.lower()
    return kind, part.surface if isinstance(part, Contact) else ""


def carried(part: Part, point: Moved, turned: Moved) -> Part:
    """A shape in the frame of a body as one in the world, by what points and directions are
    there."""
    if isinstance(part, SOLIDS):
        return carried_solid(part, point, turned)
    match part:
        case Link():
            return Link(*map(point, part.points))
        case Spring():
            return Spring(point(part.a), point(part.b))
        case Point():
            return Point(point(part.at))
        case Contact():
            normal = None if part.normal is None else turned(part.normal)
            return replace(part, at=point(part.at), normal=normal)
    raise ModelError(
        f"{shown(part)} is a shape of the plane: a body in space takes those of space."
    )


def _place(value: Any, what: str, sizes: tuple[int, ...] = (2, 3)) -> Place:
    """Expressions of a place or a direction, as many as one of some sizes."""
    words, example = {2: "two", 3: "three"}, {2: "(x, y)", 3: "(x, y, z)"}
    expected, like = words[sizes[0]], example[sizes[0]]
    matrix = isinstance(value, sp.MatrixBase)
    try:
        entries = listed(list(value) if matrix else value, what, "expressions", ModelError)
    except ModelError:
        raise ModelError(
            f"{what} = {shown(value)}: expected {expected} expressions, as in {like}."
        ) from None
    if len(entries) not in sizes:
        raise ModelError(
            f"{what} = {shown(value)} has {len(entries)} entries: expected {expected}, as in "
            f"{like}."
        )
    return tuple(expression_in(e, what) for e in entries)
