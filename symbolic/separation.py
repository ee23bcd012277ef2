"""How far apart two convex shapes are along the direction that tells most.

Of two convex shapes that are apart, some direction separates them by their distance, the gap
between both along it; along any other one their gap is smaller.  It is the normal of a face, or
perpendicular to two edges; or it leads from a corner or a rim to what is nearest, where the gap is
their distance.  Code finds which of all these is the largest: its number has no slopes
(:class:`~dmoc.symbolic.called.LargestOf`), the gap of that number has.

All is in the frame of the first shape: the columns of M are the axes of the second one, d is its
place.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import product
from typing import Any, NamedTuple

import sympy as sp

from dmoc.symbolic.called import LargestOf, SharedExpression
from dmoc.symbolic.locals import Local, local_of
from dmoc.symbolic.rims import RimAndEdge, RimAndRim, defined, root, to_edge, to_rim
from dmoc.symbolic.vectors import Vector, added, cross, dot, times

Define = Callable[[Any], Any]
# Squares of sines below it are those of parallel segments, and of edges between which the faces
# beside them separate what is apart.
PARALLEL = sp.Float(1e-12)
STEEP = sp.Integer(10**6)  # by how much what does not count is made larger
FAR = sp.Integer(10**15)  # so much larger that lengths of what is parallel do not count
# Parts of a radius by which a distance of features may differ from the gap of both shapes: as much
# as where attitudes are none, between the iterates of a solver.
SLACK = sp.Float(1e-3)
AXIS = (sp.S.Zero, sp.S.Zero, sp.S.One)
SIGNS = (sp.S.One, sp.S.NegativeOne)


class Pose(NamedTuple):
    """Two shapes in their frames, and the second one in that of the first."""

    a: Local
    b: Local
    M: tuple[Vector, ...]  # rows
    d: Vector

    def turned(self, v: Vector) -> Vector:
        """A direction of the second frame."""
        return tuple(dot(row, v) for row in self.M)

    def back(self, v: Vector) -> Vector:
        """A direction of the first frame in the second one."""
        return tuple(dot(column, v) for column in zip(*self.M, strict=True))

    def placed(self, v: Vector) -> Vector:
        return added(self.d, self.turned(v))


@dataclass(frozen=True)
class Directions:
    """Directions of one form, by arguments that are constant in the frames of both shapes."""

    direction: Callable[[Pose, Vector], Vector]
    arguments: Sequence[Vector]
    fixed: bool = False  # in the second frame, where it is the argument

    def of(self, pose: Pose, own: Vector, define: Define) -> tuple[Vector, Vector]:
        """A direction in both frames."""
        n = defined(self.direction(pose, own), define)
        return n, own if self.fixed else defined(pose.back(n), define)


@dataclass(frozen=True)
class Nearest:
    """Distances of one form between features, by arguments that are constant; ``found`` gives one
    with its direction, ``shared`` one alone, of functions that code has once."""

    found: Callable[[Pose, Vector, Define], tuple[Any, Vector]]
    shared: Callable[[Pose, Vector, Define], Any]
    arguments: Sequence[Vector]


def gap_between(a: Any, b: Any, define: Define) -> Any:
    """The largest gap between two shapes, of which the first has three axes."""
    way = tuple(define(e) for e in added(b.at, times(-1, a.at)))
    M = tuple(tuple(define(dot(x, y)) for y in b.axes) for x in a.axes)
    pose = Pose(local_of(a), local_of(b), M, tuple(define(dot(x, way)) for x in a.axes))
    z = (*(e for row in M for e in row), *pose.d, *pose.a.sizes, *pose.b.sizes)
    largest, gap = _functions(pose.a.kind, pose.b.kind)
    number = define(largest(*z))
    end = sum(len(own.arguments) for own in _directions(pose))
    gaps = [(define(gap(*z, number)), end)]
    for own in _nearest(pose):
        picked = _picked(own.arguments, number - end, define)
        end += len(own.arguments)
        gaps.append((define(own.shared(pose, picked, define)), end))
    return define(_piece(gaps, number))


@cache
def _functions(a: Any, b: Any) -> tuple[type[LargestOf], type[SharedExpression]]:
    """The functions of two kinds of shapes: the number of the largest gap, and the gap along the
    direction of a number."""
    columns = Local.axes_of(b)
    count = 3 * columns + 3
    parts = Local.sizes_of(a), Local.sizes_of(b)
    own = f"{a[0]}_{b[0]}"
    if a[1:] or b[1:]:
        own += "_" + hashlib.sha256(sp.srepr((a, b)).encode()).hexdigest()[:12]

    def read(z: Sequence[Any]) -> Pose:
        M = tuple(tuple(z[columns * i : columns * (i + 1)]) for i in range(3))
        sizes = z[count:]
        first = Local(a, tuple(sizes[: parts[0]]))
        second = Local(b, tuple(sizes[parts[0] : sum(parts)]))
        return Pose(first, second, M, tuple(z[3 * columns : count]))

    def number(cls: Any, define: Define, *z: Any) -> Any:
        return _largest(read(z), define)

    def gap(cls: Any, define: Define, *z: Any) -> Any:
        pose = read(z)
        n, own = _direction(pose, z[-1], define)
        return along(pose, n, own, define)

    size = count + sum(parts)
    return _made(LargestOf, "largest", own, size, number), _made(
        SharedExpression, "gap", own, size + 1, gap
    )


def _made(kind: Any, what: str, own: str, size: int, value: Any) -> Any:
    """A function of so many arguments."""
    code = f"{what}_{own}"
    fields = {"code": code, "nargs": size, "value": classmethod(value)}
    return type(kind)(code, (kind,), fields)


def _largest(pose: Pose, define: Define) -> Any:
    """The number of the largest gap, the first of those that are equal."""
    best, number = None, sp.S.Zero
    for k, gap in enumerate(_gaps(pose, define)):
        if best is not None:
            number = define(sp.Piecewise((k, gap > best), (number, True)))
        best = gap if best is None else define(sp.Max(gap, best))
    return number


def _gaps(pose: Pose, define: Define) -> Iterator[Any]:
    """All gaps in turn; distances of features are none where others lie between these."""
    for family in _directions(pose):
        for own in family.arguments:
            yield define(along(pose, *family.of(pose, own, define), define))
    for features in _nearest(pose):
        for own in features.arguments:
            gap, n = features.found(pose, own, define)
            gap, n = define(gap), defined(n, define)
            between = define(along(pose, n, defined(pose.back(n), define), define))
            off = sp.Abs(gap - between) - SLACK * pose.a.sizes[0]
            yield define(between - STEEP * sp.Max(off, 0))


def _direction(pose: Pose, number: Any, define: Define) -> tuple[Vector, Vector]:
    """The direction of a number in both frames."""
    found: list[tuple[tuple[Vector, Vector], int]] = []
    first = 0
    for family in _directions(pose):
        own = _picked(family.arguments, number - first, define)
        first += len(family.arguments)
        found.append((family.of(pose, own, define), first))

    def in_frame(k: int) -> Vector:
        columns = zip(*(both[k] for both, _ in found), strict=True)
        ends = [end for _, end in found]
        return tuple(define(_piece(list(zip(c, ends, strict=True)), number)) for c in columns)

    return in_frame(0), in_frame(1)


def _picked(arguments: Sequence[Vector], number: Any, define: Define) -> Vector:
    """The arguments of a number."""
    columns = zip(*arguments, strict=True)
    return tuple(define(_piece([(e, k + 1) for k, e in enumerate(c)], number)) for c in columns)


def _piece(values: Sequence[tuple[Any, int]], number: Any) -> Any:
    """Of values with the numbers at which they end the one of a number."""
    runs: list[tuple[Any, int]] = []
    for value, end in values:
        if runs and runs[-1][0] == value:
            runs.pop()
        runs.append((value, end))
    half = sp.Rational(1, 2)
    pieces = [(value, number < end - half) for value, end in runs[:-1]]
    return sp.Piecewise(*pieces, (runs[-1][0], True))


def along(pose: Pose, n: Vector, own: Vector, define: Define) -> Any:
    """The gap along a direction of any length; along none, as across parallel edges, where nothing
    is learnt, far less than along any other."""
    square, shift = define(dot(n, n)), define(dot(n, pose.d))
    (low, high), (bottom, top) = pose.a.span(n, define), pose.b.span(own, define)
    gap = sp.Max(low - top - shift, shift + bottom - high)
    lost = FAR * sp.Max(PARALLEL - square, 0)
    return (gap - lost) / define(sp.sqrt(sp.Max(square, PARALLEL)))


def _directions(pose: Pose) -> list[Directions]:
    """Normals of faces, and what is perpendicular to two edges."""
    a, b = pose.a, pose.b
    pairs = [(*u, *v) for u, v in product(a.directions, b.directions)]
    own = [
        Directions(lambda _, n: n, a.normals),
        Directions(lambda pose, n: pose.turned(n), b.normals, fixed=True),
        Directions(lambda pose, uv: cross(uv[:3], pose.turned(uv[3:])), pairs),
    ]
    return [family for family in own if family.arguments]


def _nearest(pose: Pose) -> Iterator[Nearest]:
    """Distances of features of a cylinder from those of other shapes."""
    a, b = pose.a, pose.b
    if not a.drum:
        return
    yield Nearest(_to_corner, lambda *own: _to_corner(*own)[0], b.corners or [b.middle])
    yield Nearest(_to_edge, _shared_edge, [(*at, *u) for at, u in b.edges])
    if b.drum:
        yield Nearest(_from_rim, _shared_axis, [(sp.S.Zero,)])
        yield Nearest(_to_rim, _shared_rim, list(product(SIGNS, SIGNS)))


def _to_corner(pose: Pose, corner: Vector, define: Define) -> tuple[Any, Vector]:
    """From the side or the rim of a cylinder to a corner, of another cylinder to its axis."""
    radius, half = pose.a.sizes
    x, y, z = defined(pose.placed(corner), define)
    beside, beyond = define(root(x**2 + y**2)), define(sp.Abs(z) - half)
    over = define(sp.Max(beside - radius, 0))
    above = define(sp.Max(beyond, 0))
    way = define(root(over**2 + above**2))
    out = define(sp.Piecewise((over / beside / way, beyond > 0), (1 / beside, True)))
    gap = sp.Piecewise((way, beyond > 0), (beside - radius, True))
    return gap - pose.b.thick, (out * x, out * y, _sign(z) * above / way)


def _to_edge(pose: Pose, own: Vector, define: Define) -> tuple[Any, Vector]:
    """From a rim of a cylinder to an edge, of another cylinder to its axis."""
    p, u, sign = _edge(pose, own, define)
    gap, n = to_edge(p, u, define)
    return pose.a.sizes[0] * gap - pose.b.thick, (n[0], n[1], sign * n[2])


def _shared_edge(pose: Pose, own: Vector, define: Define) -> Any:
    p, u, _ = _edge(pose, own, define)
    return pose.a.sizes[0] * RimAndEdge(*p, *u) - pose.b.thick


def _edge(pose: Pose, own: Vector, define: Define) -> tuple[Vector, Vector, Any]:
    columns = len(pose.b.axes)
    at, u = pose.placed(own[:columns]), pose.turned(own[columns:])
    return _line(pose.a.sizes, at, u, define)


def _from_rim(pose: Pose, _: Vector, define: Define) -> tuple[Any, Vector]:
    """From the axis of a cylinder to a rim of another one."""
    p, u, sign = _axis(pose, define)
    gap, n = to_edge(p, u, define)
    return pose.b.sizes[0] * gap - pose.a.sizes[0], pose.turned((n[0], n[1], sign * n[2]))


def _shared_axis(pose: Pose, _: Vector, define: Define) -> Any:
    p, u, _ = _axis(pose, define)
    return pose.b.sizes[0] * RimAndEdge(*p, *u) - pose.a.sizes[0]


def _axis(pose: Pose, define: Define) -> tuple[Vector, Vector, Any]:
    return _line(pose.b.sizes, times(-1, pose.back(pose.d)), pose.back(AXIS), define)


def _line(sizes: Vector, at: Vector, u: Vector, define: Define) -> tuple[Vector, Vector, Any]:
    """A line beside a rim of a cylinder, in the frame of the rim, and its side: seen along the
    line, the cylinder is symmetric, and the rim that may be nearest is on the side of the line."""
    radius, half = sizes
    at, u = defined(at, define), defined(u, define)
    sign = define(_sign(define(at[2] - dot(at, u) * u[2])))
    p = times(1 / radius, (at[0], at[1], sign * at[2] - half))
    return defined(p, define), (u[0], u[1], define(sign * u[2])), sign


def _to_rim(pose: Pose, own: Vector, define: Define) -> tuple[Any, Vector]:
    """From a rim of one cylinder to one of the other."""
    radius, (p, b, ratio) = pose.a.sizes[0], _rim(pose, own, define)
    gap, n = to_rim(p, b, ratio, define)
    return radius * gap, (n[0], n[1], own[0] * n[2])


def _shared_rim(pose: Pose, own: Vector, define: Define) -> Any:
    p, b, ratio = _rim(pose, own, define)
    return pose.a.sizes[0] * RimAndRim(*p, *b, ratio)


def _rim(pose: Pose, own: Vector, define: Define) -> tuple[Vector, Vector, Any]:
    """A rim of the second cylinder in the frame of one of the first."""
    (radius, half), (other, length), (s, t) = pose.a.sizes, pose.b.sizes, own
    b = defined(times(t, pose.turned(AXIS)), define)
    at = added(pose.d, times(length, b))
    p = times(1 / radius, (at[0], at[1], s * at[2] - half))
    return defined(p, define), (b[0], b[1], define(s * b[2])), other / radius


def _sign(x: Any) -> Any:
    return sp.Piecewise((1, x >= 0), (-1, True))
