"""How a planar model looks: rods, masses, bodies, springs and walls, with places in q, t and
parameters.

A drawing is looks and no physics: solutions do not depend on it.
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

Place: TypeAlias = tuple[Any, Any]  # x and y, as SymPy expressions


@public(ModelError)
@dataclass(frozen=True, init=False)
class Link:
    """A rod, or a polyline through several points: ``Link((0, 0), elbow, tip)``.

    Points are pairs of SymPy expressions in coordinates, parameters and the time, or matrices of
    two entries; x points to the right, y upwards.

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
        object.__setattr__(self, "points", tuple(_place(p, "a point of a Link") for p in points))


@public(ModelError)
@dataclass(frozen=True)
class Point:
    """A point mass.

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
    """A disc; a mark shows its angle in rad, which grows counterclockwise.

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
        object.__setattr__(self, "radius", _size(self.radius, "the radius of a Disc"))
        object.__setattr__(self, "angle", expression_in(self.angle, "the angle of a Disc"))


@public(ModelError)
@dataclass(frozen=True)
class Box:
    """A rectangle around its centre, turned by an angle in rad counterclockwise.

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
        object.__setattr__(self, "width", _size(self.width, "the width of a Box"))
        object.__setattr__(self, "height", _size(self.height, "the height of a Box"))
        object.__setattr__(self, "angle", expression_in(self.angle, "the angle of a Box"))


@public(ModelError)
@dataclass(frozen=True)
class Spring:
    """A spring between two points.

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
        object.__setattr__(self, "b", _place(self.b, "an end of a Spring"))


@public(ModelError)
@dataclass(frozen=True)
class Wall:
    """A wall or a floor from a to b, solid on the right as one looks from a to b: a floor goes from
    left to right.

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
        The point that touches.
    normal : pair, optional
        Direction in which the surface pushes what it touches; of any length but zero.  By default
        that in which its gap moves the place, or, of a rail, the one to the left of its tangent.
        Friction is drawn along the normal turned by 90 degrees clockwise: to the right over a
        floor.

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
        normal = _place(self.normal, "the normal of a Contact")
        if normal == (0, 0):
            raise ModelError(
                f"the normal of the Contact {shown(self.surface)} is zero: expected the direction "
                "in which the surface pushes, as in normal=(0, 1)."
            )
        object.__setattr__(self, "normal", normal)


Part: TypeAlias = Link | Point | Disc | Box | Spring | Wall | Contact
PARTS = (Link, Point, Disc, Box, Spring, Wall, Contact)


def parts_in(drawing: Any, contacts: Iterable[str]) -> tuple[Part, ...]:
    """Read a drawing, whose contacts are some of those named; raise ModelError for what is none."""
    names = list(contacts)
    kinds = ", ".join(part.__name__ for part in PARTS)
    if not isinstance(drawing, Sequence) or isinstance(drawing, str):
        raise ModelError(f"drawing = {shown(drawing)}: expected a list of shapes out of {kinds}.")
    seen: set[str] = set()
    for part in drawing:
        if not isinstance(part, PARTS):
            raise ModelError(f"the drawing contains {shown(part)}: expected shapes out of {kinds}.")
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
    return tuple(drawing)


def values_of(part: Part) -> tuple[Any, ...]:
    """The expressions of a shape, in the order of the columns of a scene."""
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
            x, y = part.normal or (0, 1)  # of one whose place in a table counts alone
            length = sp.sqrt(x**2 + y**2)
            return (*part.at, x / length, y / length)


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
    x, y = direction
    if (x, y) == (0, 0):
        raise ModelError(
            f"the Contact {shown(part.surface)} is at a place that its surface does not move: give "
            "the direction in which it pushes, as in normal=(0, 1)."
        )
    return replace(part, normal=(-y, x) if rail else (x, y))


def _slopes(place: Sequence[Any], symbols: Sequence[Any]) -> tuple[Any, Any]:
    """Derivatives of a place, and of what is along the force there, by symbols."""
    slopes = sp.Matrix(place).jacobian(symbols)
    return slopes[:2, :], slopes[2, :].T


def _axis(slopes: Any, v: Any) -> Place | None:
    """The direction of F in slopes' F = v if it is along an axis, as nearly always."""
    for along in ((0, 1), (1, 0), (0, -1), (-1, 0)):
        if (slopes.T * sp.Matrix(along) - v).expand().is_zero_matrix:
            return along
    return None


def _force(slopes: Any, v: Any) -> Place:
    """The direction of F in slopes' F = v."""
    gram = slopes * slopes.T
    flat = sp.simplify(gram.det()) == 0
    x, y = (slopes if flat else gram.adjugate() * slopes) * v
    return (0, 0) if sp.simplify(x) == 0 and sp.simplify(y) == 0 else (x, y)


def table_of_drawing(drawing: Iterable[Part]) -> list[list[Any]]:
    """Kind, name, first column and number of columns of each shape."""
    table: list[list[Any]] = []
    start = 0
    for part in drawing:
        name, size = part.surface if isinstance(part, Contact) else "", len(values_of(part))
        table.append([type(part).__name__.lower(), name, start, size])
        start += size
    return table


def _place(value: Any, what: str) -> Place:
    """A pair of expressions."""
    matrix = isinstance(value, sp.MatrixBase)
    try:
        entries = listed(list(value) if matrix else value, what, "expressions", ModelError)
    except ModelError:
        raise ModelError(
            f"{what} = {shown(value)}: expected two expressions, as in (x, y)."
        ) from None
    if len(entries) != 2:
        raise ModelError(
            f"{what} = {shown(value)} has {len(entries)} entries: expected two, as in (x, y)."
        )
    return expression_in(entries[0], what), expression_in(entries[1], what)


def _size(value: Any, what: str) -> Any:
    """An expression that is positive where it is a number."""
    size = expression_in(value, what)
    if size.is_number and not size > 0:
        raise ModelError(f"{what} = {shown(size)}: expected a positive length.")
    return size
