"""Parts as bodies of a linkage, with coordinates, inputs, limits and what their joints cost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from dmoc.base.names import name_of, velocity_name
from dmoc.robots.held import powers
from dmoc.robots.names import Names
from dmoc.robots.parts import Part
from dmoc.robots.records import Joint
from dmoc.robots.shapes import plain, solid_of
from dmoc.symbolic.attitudes import angular_velocity, quaternion
from dmoc.symbolic.drawing import Link
from dmoc.symbolic.joints import ORIGIN
from dmoc.symbolic.spatial import Body, World
from dmoc.symbolic.vectors import dot

EFFORT = {"hinge": ("torque", "N m"), "slide": ("force", "N")}


@dataclass
class Machine:
    """A linkage under construction; names are those of the model."""

    world: World
    euler: bool
    joints: Mapping[str, Joint]
    notes: list[str]
    names: Names = field(default_factory=Names)
    hung: Names = field(default_factory=Names)  # bodies
    bodies: list[Body] = field(default_factory=list)
    symbols: dict[str, Any] = field(default_factory=dict)  # of joints, by their names in the file
    coordinates: dict[str, Any] = field(default_factory=dict)
    attitudes: list[str] = field(default_factory=list)
    quaternions: list[str] = field(default_factory=list)  # those of them that are one
    inputs: dict[str, Any] = field(default_factory=dict)
    units: dict[Any, str] = field(default_factory=dict)
    bounds: dict[str, tuple[float, float]] = field(default_factory=dict)
    tangents: dict[str, Any] = field(default_factory=dict)
    friction: dict[str, float] = field(default_factory=dict)
    lagrangian: Any = sp.S.Zero
    dissipation: Any = sp.S.Zero

    def build(self, parts: Sequence[Part]) -> None:
        """Hang a body for each part."""
        for joint in (part.joint for part in parts):
            if joint is not None and joint.kind in EFFORT and joint.follows is None:
                own = self.names.give(joint.name)
                self.symbols[joint.name] = self.coordinates[own] = dynamicsymbols(own)
        for part in parts:
            before = self.world if part.before is None else self.bodies[parts.index(part.before)]
            self.bodies.append(self._body(part, before))
        for part, body in zip(parts, self.bodies, strict=True):
            solids = [solid_of(shape) for _, shape in part.shapes if shape.kind != "site"]
            if solids:
                ends = [p.place for p in parts if p.before is part and p.place.any()]
                body.draw(*(Link(ORIGIN, plain(end)) for end in ends), *solids)

    def _body(self, part: Part, before: Body) -> Body:
        joint = part.joint
        if joint is None:
            return before
        load = {
            "mass": plain([part.mass])[0],
            "centre": plain(part.centre),
            "inertia": sp.Matrix(3, 3, plain(part.inertia)),
        }
        if joint.kind in EFFORT:
            return self._driven(part, joint, before, load)
        attitude = self.names.give(joint.name)
        self.attitudes.append(attitude)
        if joint.kind == "ball" or not self.euler:
            self.quaternions.append(attitude)
        if joint.kind == "ball":
            place = plain(part.place)
            body = before.ball(attitude, at=place, name=self.hung.give(part.name), **load)
            spin = angular_velocity(quaternion(attitude))
            self._cost(joint, dot(spin, spin))
            return body
        return self._free(joint, attitude, load)

    def _free(self, joint: Joint, attitude: str, load: dict[str, Any]) -> Body:
        place = [self._coordinate(f"{attitude}_{axis}") for axis in "xyz"]
        if self.euler:
            angles = [self._coordinate(f"{attitude}_{angle}") for angle in ("yaw", "pitch", "roll")]
            body = self.world.free(place, angles, attitude=attitude, name=attitude, **load)
        else:
            body = self.world.free(place, attitude=attitude, **load)
        speeds = (*(x.diff() for x in place), *body.spin)
        self._cost(joint, dot(speeds, speeds))
        return body

    def _coordinate(self, name: str) -> Any:
        own = self.names.give(name)
        self.coordinates[own] = dynamicsymbols(own)
        return self.coordinates[own]

    def _driven(self, part: Part, joint: Joint, before: Body, load: dict[str, Any]) -> Body:
        """A body behind a hinge or a slide."""
        way = self._way(joint)
        self._cost(joint, way.diff() ** 2)
        slack = plain([joint.rest - joint.zero])[0]
        self.lagrangian -= plain([joint.stiffness])[0] * (way - slack) ** 2 / 2
        coordinate, zero = self.symbols.get(joint.name), joint.zero
        if coordinate is None:  # it follows another one
            coordinate, zero = way, 0.0
        more = {"name": self.hung.give(part.name), **load}
        if joint.name in self.symbols and joint.driven:
            more[EFFORT[joint.kind][0]] = self._driver(joint)
        if joint.name in self.symbols:
            self._limit(joint, name_of(coordinate))
        axis, place = plain(part.axis), part.place
        if joint.kind == "hinge":
            return before.hinge(coordinate, axis, at=plain(place), zero=plain([-zero])[0], **more)
        return before.slide(coordinate, axis, at=plain(place - zero * part.axis), **more)

    def _way(self, joint: Joint) -> Any:
        """How far a joint is from where the file draws it."""
        if joint.name in self.symbols:
            return self.symbols[joint.name] - plain([joint.zero])[0]
        leader, _ = joint.follows or ("", ())
        return powers(joint, self._way(self.joints[leader]))

    def _driver(self, joint: Joint) -> Any:
        """The input of a joint."""
        name = self.names.give(f"u_{self.names.of[joint.name]}")
        self.inputs[name] = dynamicsymbols(name)
        self.units[self.inputs[name]] = EFFORT[joint.kind][1]
        if joint.effort is not None:
            self.bounds[name] = joint.effort
        return self.inputs[name]

    def _limit(self, joint: Joint, name: str) -> None:
        """Limits of a coordinate and its velocity, and dry friction."""
        if joint.limits is not None:
            self.bounds[name] = joint.limits
        if joint.speed is not None:
            self.bounds[velocity_name(name)] = -joint.speed, joint.speed
        if joint.friction > 0:
            self.tangents[name] = self.symbols[joint.name]
            self.friction[name] = joint.friction

    def _cost(self, joint: Joint, square: Any) -> None:
        """What armature and damping add, with the square of the speed of a joint."""
        self.lagrangian += plain([joint.armature])[0] * square / 2
        self.dissipation += plain([joint.damping])[0] * square / 2
