"""How a linkage in space looks where its bodies are not drawn: rods between joints, boxes with the
inertia of bodies, arrows of inputs at joints, and the floors and walls that surfaces are."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp
from sympy.core.function import AppliedUndef

from dmoc.base.arguments import shown
from dmoc.base.errors import ModelError
from dmoc.symbolic.drawing import EITHER, Contact, Link, Part, Point, carried, in_space
from dmoc.symbolic.expressions import slack_of
from dmoc.symbolic.hulls import Hull
from dmoc.symbolic.joints import ORIGIN, Joint, Load
from dmoc.symbolic.solids import SOLIDS, Arrow, Box, Moved, Plane, Sphere
from dmoc.symbolic.vectors import Vector, added, dot, times

THIN = 1e-3  # the least side of a box that is made of an inertia, in shares of its longest


@dataclass
class BodyLook:
    """What the looks of a body are made of, in its frame."""

    joint: Joint
    placed: Moved
    directed: Moved
    points: Mapping[tuple[Vector, int], Any]  # coordinates in the world that have been asked for
    before: BodyLook | None = None
    load: Load | None = None
    effort: Vector = ORIGIN  # at the joint: a force or, where it turns, a torque
    turns: bool = False
    shapes: list[Part] | None = None  # those that it was given

    @property
    def origin(self) -> Vector:
        return self.placed(ORIGIN)


def shapes_in_space(shapes: Sequence[Any], body: str) -> list[Part]:
    """Shapes that a body is shown by; raise ModelError for what is none in space."""
    parts = [part for s in shapes for part in (edges_of(s) if isinstance(s, Hull) else (s,))]
    for shape in parts:
        known: bool = isinstance(shape, (*SOLIDS, *EITHER))
        if not known or not in_space(shape):
            raise ModelError(
                f"body {body} is drawn by {shown(shape)}: expected shapes in space, such as "
                "dmoc.spatial.Sphere(0.1)."
            )
    return parts


def edges_of(hull: Hull) -> list[Link]:
    return [Link(hull.points[i], hull.points[j]) for i, j in hull.edges]


def looks_of(bodies: Sequence[BodyLook], fields: Mapping[str, Any]) -> list[Part]:
    """What is drawn of a world and its bodies beside the drawing among the fields of a system."""
    parts: list[Part] = []
    for body in bodies:
        own = body.shapes
        if own is None:
            parts += _default(body, [b for b in bodies if b.before is body])
        else:
            parts += [carried(part, body.placed, body.directed) for part in own]
    inputs, surfaces = fields.get("inputs", ()), fields.get("surfaces", {})
    if isinstance(inputs, (list, tuple)):
        parts += [arrow for body in bodies for arrow in _arrows(body, inputs)]
    if isinstance(surfaces, Mapping):
        stated = [*fields.get("drawing", ()), *parts]
        parts += _contacts(bodies, surfaces, stated)
    return parts


def _default(body: BodyLook, children: Iterable[BodyLook]) -> Iterator[Part]:
    """Rods to the tip and to where other bodies hang; a body that has none is a box, what has no
    inertia a point."""
    load = body.load
    if load is None:
        return
    ends = dict.fromkeys([load.tip, *(child.joint.at for child in children)])
    for end in ends:
        if end != ORIGIN and not any(e.atoms(AppliedUndef) for e in end):
            yield Link(body.origin, body.placed(end))
    if load.inertia.is_zero_matrix:
        if load.mass != 0:
            yield Point(body.placed(load.centre))
    elif load.tip == ORIGIN:
        yield carried(box_of(load), body.placed, body.directed)


def box_of(load: Load) -> Box:
    """The box that has the moments of inertia J and the mass m of a body: its sides are
    sqrt(6 (trace J - 2 J_k) / m), about principal axes where J is of numbers; without a mass its
    diagonal is 1."""
    moments, attitude = load.inertia, None
    if not moments.free_symbols and not moments.is_diagonal():
        values, vectors = np.linalg.eigh(np.array(moments, dtype=float))
        vectors[:, 2] *= np.sign(np.linalg.det(vectors))
        moments, attitude = sp.diag(*values.tolist()), sp.Matrix(vectors.tolist())
    trace = moments.trace()
    mass = 6 * trace if load.mass == 0 else load.mass
    squares = [6 * (trace - 2 * moments[k, k]) / mass for k in range(3)]
    if all(e.is_number for e in squares):
        least = (THIN * sp.sqrt(max(squares))) ** 2
        sides = [sp.sqrt(max(e, least)) for e in squares]
    else:
        sides = [sp.sqrt(sp.Abs(e)) for e in squares]  # rounding may make a flat one negative
    return Box(sides, load.centre, attitude)


def _arrows(body: BodyLook, inputs: Iterable[Any]) -> Iterator[Arrow]:
    """The inputs that act on a body at its joint, in the directions in which they do."""
    effort, turns = body.effort, body.turns
    for u in inputs:
        along = tuple(sp.diff(e, u) if isinstance(u, AppliedUndef) else 0 for e in effort)
        if any(along) and not any(sp.sympify(e).has(*inputs) for e in along):
            yield Arrow(u, body.origin, body.directed(along), turns)


def _contacts(
    bodies: Sequence[BodyLook], surfaces: Mapping[str, Any], drawing: Sequence[Any]
) -> Iterator[Contact | Plane]:
    """Contacts and planes of the surfaces that are planes for a point of a body, or for the ball
    around one."""
    stated = {part.surface for part in drawing if isinstance(part, Contact)}
    planes = dict[Plane, None]()
    for name, relation in surfaces.items():
        place = _place_in(slack := slack_of(relation, f"surface {name!r}"), bodies)
        if place is None:
            continue
        body, local = place
        p = body.placed(local)
        normal = tuple(slack.diff(e) if isinstance(e, AppliedUndef) else sp.S.Zero for e in p)
        if not any(normal) or any(n.atoms(AppliedUndef) for n in normal):
            continue
        rest = slack.xreplace(dict.fromkeys(p, sp.S.Zero))
        length = sp.sqrt(dot(normal, normal))
        below = times(-_radius(body, local) / length, normal)
        if name not in stated:
            yield Contact(name, added(p, below), normal)
        planes[Plane(added(times(-rest / length**2, normal), below), normal)] = None
    if not any(isinstance(part, Plane) for part in drawing):
        yield from planes


def _place_in(slack: Any, bodies: Sequence[BodyLook]) -> tuple[BodyLook, Vector] | None:
    """The point whose coordinates alone an expression contains, of the last body that has it."""
    names = slack.atoms(AppliedUndef)
    if not names or slack.atoms(sp.Derivative):
        return None
    for body in reversed(bodies):
        for local in dict.fromkeys(local for local, _ in body.points):
            if names <= {body.points.get((local, k)) for k in range(3)}:
                return body, local
    return None


def _radius(body: BodyLook, local: Vector) -> Any:
    balls = [s for s in body.shapes or () if isinstance(s, Sphere) and s.at == local]
    return balls[0].radius if balls else sp.S.Zero
