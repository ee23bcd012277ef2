"""Convex shapes in their own frames: corners, edges, normals, and how far they reach."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any

import sympy as sp

from dmoc.symbolic.cores import Block, Cut, Drum, Round
from dmoc.symbolic.vectors import Vector, dot

Define = Callable[[Any], Any]
LEAST = sp.Float(1e-24)
UNITS: tuple[Vector, ...] = tuple(tuple(sp.Integer(i == k) for i in range(3)) for k in range(3))


@dataclass(frozen=True)
class Local:
    """A shape in its frame, of one axis for a segment and of three for others.

    ``kind`` is its name, of a hull with what it is made of: corners, normals, and edges with their
    directions.  ``sizes`` are the half sides of a box, radius and half length of a cylinder, the
    half length of a segment.
    """

    kind: Any
    sizes: Vector

    @staticmethod
    def axes_of(kind: Any) -> int:
        return {"point": 0, "segment": 1}.get(kind[0], 3)

    @staticmethod
    def sizes_of(kind: Any) -> int:
        return {"box": 3, "cylinder": 2, "segment": 1}.get(kind[0], 0)

    @property
    def axes(self) -> tuple[Vector, ...]:
        return {"point": (), "segment": ((sp.S.One,),)}.get(self.kind[0], UNITS)

    @property
    def drum(self) -> bool:
        return bool(self.kind[0] == "cylinder")

    @property
    def thick(self) -> Any:
        """The radius of a cylinder, of which the edge is its axis."""
        return self.sizes[0] if self.drum else sp.S.Zero

    @property
    def middle(self) -> Vector:
        return tuple(sp.S.Zero for _ in self.axes)

    @property
    def normals(self) -> list[Vector]:
        match self.kind[0]:
            case "box":
                return list(UNITS)
            case "cylinder":
                return [UNITS[2]]
            case "hull":
                return list(self.kind[2])
        return []

    @property
    def directions(self) -> list[Vector]:
        match self.kind[0]:
            case "hull":
                return list(dict.fromkeys(u for _, u in self.kind[3]))
            case "cylinder":
                return [UNITS[2]]
        return list(self.axes)

    @property
    def corners(self) -> list[Vector]:
        match self.kind[0]:
            case "hull":
                return list(self.kind[1])
            case "cylinder":
                return []
        return [
            tuple(s * h for s, h in zip(signs, self.sizes, strict=True))
            for signs in product((1, -1), repeat=len(self.sizes))
        ]

    @cached_property
    def edges(self) -> list[tuple[Vector, Vector]]:
        """Places on them, and their directions; of a cylinder its axis."""
        match self.kind[0]:
            case "hull":
                return list(self.kind[3])
            case "box":
                return [
                    (tuple(s * h for s, h in zip(signs, self.sizes, strict=True)), UNITS[k])
                    for k in range(3)
                    for signs in product(*((0,) if i == k else (1, -1) for i in range(3)))
                ]
        return [(self.middle, self.axes[-1])]

    def span(self, n: Vector, define: Define) -> tuple[Any, Any]:
        """The least and the largest n . x."""
        if self.kind[0] == "hull":
            along = [define(dot(n, corner)) for corner in self.corners]
            return define(sp.Min(*along)), define(sp.Max(*along))
        if self.drum:
            radius, half = self.sizes
            beside = sp.sqrt(sp.Max(define(n[0] ** 2 + n[1] ** 2), LEAST))
            reach = define(half * sp.Abs(n[2]) + radius * beside)
        else:
            reach = define(sum(h * sp.Abs(e) for h, e in zip(self.sizes, n, strict=True)))
        return -reach, reach


def local_of(core: Block | Cut | Drum | Round) -> Local:
    match core:
        case Block():
            return Local(("box",), tuple(half for _, half in core.sides))
        case Drum():
            return Local(("cylinder",), (core.radius, core.half))
        case Cut():
            return Local(("hull", *core.own), ())
    return Local(("segment",), (core.half,)) if core.along else Local(("point",), ())
