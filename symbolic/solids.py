"""Shapes in space: boxes, balls, capsules and cylinders with a place and an attitude, planes, and
arrows of inputs.  Bodies of :mod:`dmoc.spatial` take them along."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, TypeAlias, TypeVar

import sympy as sp
from sympy.core.function import AppliedUndef

from dmoc.base.arguments import flag, shown
from dmoc.base.errors import ModelError
from dmoc.base.names import name_of
from dmoc.base.signatures import public
from dmoc.motion.attitude import Attitude, rotation
from dmoc.symbolic.vectors import Vector, positive_length, vector

HERE: Vector = (sp.S.Zero,) * 3
Moved: TypeAlias = Callable[[Vector], Vector]  # a point or a direction of a body in the world
_Solid = TypeVar("_Solid", "Box", "Sphere", "Capsule", "Cylinder")


@public(ModelError)
@dataclass(frozen=True)
class Box:
    """A box in space around its middle.

    Attributes
    ----------
    size : triple
        Its sides along the axes of its frame, in the unit of lengths.
    at : triple
        Its middle: in the frame of a body that takes it (``body.draw``), or in the world where
        it stands in the ``drawing`` of a system.
    attitude : optional
        How its frame is turned against that one: a :class:`dmoc.Attitude`, four expressions that
        are a unit quaternion, or a 3 x 3 matrix that takes its vectors into that frame.

    Examples
    --------
    >>> import dmoc
    >>> dmoc.spatial.Box((0.4, 0.2, 0.1), at=(0, 0, 1)).at
    (0, 0, 1)
    """

    size: Any
    at: Any = HERE
    attitude: Any = None

    def __post_init__(self) -> None:
        size = vector(self.size, 3, "the size of a Box")
        own = tuple(positive_length(e, "a side of a Box") for e in size)
        _set(self, size=own, **_frame(self))


@public(ModelError)
@dataclass(frozen=True)
class Sphere:
    """A ball, in two colours that show how it turns.

    Attributes
    ----------
    radius : Expr
    at, attitude
        As those of :class:`Box`.

    Examples
    --------
    >>> import dmoc
    >>> dmoc.spatial.Sphere(0.1).radius
    0.100000000000000
    """

    radius: Any
    at: Any = HERE
    attitude: Any = None

    def __post_init__(self) -> None:
        radius = positive_length(self.radius, "the radius of a Sphere")
        _set(self, radius=radius, **_frame(self))


@public(ModelError)
@dataclass(frozen=True)
class Cylinder:
    """A cylinder around the z axis of its frame.

    Attributes
    ----------
    radius, length : Expr
        The length is that along the axis; a short one is a disc or a coin.
    at, attitude
        As those of :class:`Box`.

    Examples
    --------
    >>> import dmoc
    >>> lying = dmoc.attitude(axis=(0, 1, 0), angle=1.5707963)
    >>> dmoc.spatial.Cylinder(0.1, 0.5, attitude=lying).length
    0.500000000000000
    """

    radius: Any
    length: Any
    at: Any = HERE
    attitude: Any = None

    def __post_init__(self) -> None:
        _set(self, **_round(self), **_frame(self))


@public(ModelError)
@dataclass(frozen=True)
class Capsule:
    """A cylinder around the z axis of its frame, with half a ball at each end.

    Attributes
    ----------
    radius, length : Expr
        The length is that of the cylinder alone.
    at, attitude
        As those of :class:`Box`.

    Examples
    --------
    >>> import dmoc
    >>> dmoc.spatial.Capsule(0.05, 0.3, at=(0, 0, 0.15)).radius
    0.0500000000000000
    """

    radius: Any
    length: Any
    at: Any = HERE
    attitude: Any = None

    def __post_init__(self) -> None:
        _set(self, **_round(self), **_frame(self))


@public(ModelError)
@dataclass(frozen=True)
class Plane:
    """A floor or a wall in space, solid behind its normal; seen as far as the motion reaches.

    Attributes
    ----------
    at : triple
        A point of it.
    normal : triple
        Away from what is solid, of any length but zero.

    Examples
    --------
    >>> import dmoc
    >>> dmoc.spatial.Plane().normal
    (0, 0, 1)
    """

    at: Any = HERE
    normal: Any = (0, 0, 1)

    def __post_init__(self) -> None:
        _set(self, at=vector(self.at, 3, "the place of a Plane"),
             normal=_direction(self.normal, "the normal of a Plane"))  # fmt: skip


@public(ModelError)
@dataclass(frozen=True)
class Arrow:
    """An arrow as long as an input is large, where it acts.

    Attributes
    ----------
    input : dynamicsymbol
        An input of the system.
    at : triple
        Where it acts.
    along : triple
        The direction of a force, or the axis of a torque.
    turns : bool
        Whether it is a torque, which has two heads.

    Examples
    --------
    >>> from sympy.physics.mechanics import dynamicsymbols
    >>> import dmoc
    >>> dmoc.spatial.Arrow(dynamicsymbols("F"), along=(0, 0, 1)).turns
    False
    """

    input: Any
    at: Any = HERE
    along: Any = (0, 0, 1)
    turns: bool = False

    def __post_init__(self) -> None:
        if not isinstance(self.input, AppliedUndef):
            raise ModelError(
                f"the input of an Arrow = {shown(self.input)}: expected a dynamicsymbol that is an "
                "input of the system."
            )
        flag(self.turns, "the turns of an Arrow", ModelError)
        _set(self, at=vector(self.at, 3, "the place of an Arrow"),
             along=_direction(self.along, "the direction of an Arrow"))  # fmt: skip


Solid: TypeAlias = Box | Sphere | Capsule | Cylinder | Plane | Arrow
SOLIDS = (Box, Sphere, Capsule, Cylinder, Plane, Arrow)
KINDS = {Box: "block", Sphere: "sphere", Capsule: "capsule", Cylinder: "cylinder", Plane: "plane"}


def kind_of(part: Solid) -> tuple[str, str]:
    """The kind of a shape in a scene, and its name: the input of an arrow."""
    if isinstance(part, Arrow):
        return ("torque" if part.turns else "force"), name_of(part.input)
    return KINDS[type(part)], ""


def columns_of(part: Solid) -> Vector:
    """The expressions of a shape: its place, the first two axes of its frame or its direction, of
    length 1, and its sizes."""
    match part:
        case Plane():
            return (*part.at, *unit(part.normal))
        case Arrow():
            return (*part.at, *unit(part.along))
        case Box():
            sizes = part.size
        case Sphere():
            sizes = (part.radius,)
        case Capsule() | Cylinder():
            sizes = part.radius, part.length
    first, second, _ = zip(*part.attitude, strict=True)
    return (*part.at, *first, *second, *sizes)


def carried_solid(part: Solid, point: Moved, turned: Moved) -> Solid:
    """A shape in the frame of a body as one in the world: what its points and its directions are
    there."""
    at = point(part.at)
    match part:
        case Plane():
            return replace(part, at=at, normal=turned(part.normal))
        case Arrow():
            return replace(part, at=at, along=turned(part.along))
    columns = [turned(axis) for axis in zip(*part.attitude, strict=True)]
    return replace(part, at=at, attitude=sp.Matrix(columns).T)


def _set(part: Any, **fields: Any) -> None:
    for name, value in fields.items():
        object.__setattr__(part, name, value)


def _round(part: Any) -> dict[str, Any]:
    kind = type(part).__name__
    return {
        name: positive_length(getattr(part, name), f"the {name} of a {kind}")
        for name in ("radius", "length")
    }


def _frame(part: Any) -> dict[str, Any]:
    """The place of a shape, and the rows of the matrix that turns it."""
    kind = type(part).__name__
    at = vector(part.at, 3, f"the place of a {kind}")
    return {"at": at, "attitude": _rows(part.attitude, f"the attitude of a {kind}")}


def _rows(value: Any, what: str) -> tuple[Vector, ...]:
    if value is None:
        return tuple(tuple(sp.Integer(i == j) for j in range(3)) for i in range(3))
    if isinstance(value, Attitude):
        value = value.quaternion
    entries = value.tolist() if isinstance(value, sp.MatrixBase) else value
    count = len(entries) if isinstance(entries, (tuple, list)) else 0
    if count == 4:
        return rotation(vector(entries, 4, what))
    if count == 3:
        return tuple(vector(row, 3, f"a row of {what}") for row in entries)
    raise ModelError(
        f"{what} = {shown(value)}: expected a dmoc.attitude, four expressions that are a unit "
        "quaternion, or a 3 x 3 matrix."
    )


def _direction(value: Any, what: str) -> Vector:
    entries = vector(value, 3, what)
    if not any(entries):
        raise ModelError(f"{what} is zero: expected a direction, as in (0, 0, 1).")
    return entries


def unit(direction: Vector) -> Vector:
    """A direction as one of length 1."""
    length = sp.sqrt(sum(e**2 for e in direction))
    return tuple(e / length for e in direction)
