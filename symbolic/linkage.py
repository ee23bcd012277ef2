"""What linkages in the plane and in space have in common: joints, names for places and velocities,
energies, forces and shapes that are collected body by body, and the system that they make."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import sympy as sp
from sympy.core.function import AppliedUndef
from sympy.physics.mechanics import dynamicsymbols

from dmoc.base.arguments import listed, shown
from dmoc.base.errors import ModelError
from dmoc.base.names import check_name, name_of
from dmoc.base.signatures import public
from dmoc.motion.attitude import rates
from dmoc.symbolic.definitions import atoms_below
from dmoc.symbolic.drawing import Part
from dmoc.symbolic.expressions import expression_in
from dmoc.symbolic.system import MechanicalSystem
from dmoc.symbolic.system_fields import MAPPINGS, added_forces, mapping
from dmoc.symbolic.vectors import Vector, dot, vector

JOINED = ("coordinates", "drawing")  # fields to which a user's are appended
EFFORTS = {"rad": "torque", "m": "force"}  # by the unit of a joint


@dataclass
class Linkage:
    """What the bodies of a linkage add up to."""

    coordinates: list[Any] = field(default_factory=list)
    definitions: dict[Any, Any] = field(default_factory=dict)
    lagrangian: Any = sp.S.Zero
    forces: dict[Any, Any] = field(default_factory=dict)
    units: dict[Any, str] = field(default_factory=dict)
    drawing: list[Part] = field(default_factory=list)
    sizes: list[tuple[Any, str, str]] = field(default_factory=list)
    attitudes: dict[str, Vector] = field(default_factory=dict)
    looks: list[Any] = field(default_factory=list)  # of bodies in space

    def define(self, name: str, value: Any) -> Any:
        """A name for an expression; what has one, or is fixed, stays as it is."""
        named = isinstance(value, (AppliedUndef, sp.Derivative))
        if named or not value.atoms(AppliedUndef):
            return value
        symbol, number = dynamicsymbols(name), 1
        while symbol in self.definitions:
            number += 1
            symbol = dynamicsymbols(f"{name}_{number}")
        self.definitions[symbol] = value
        return symbol

    def join(self, name: str, joint: tuple[Any, str], effort: Any, measure: Any) -> None:
        """Add a coordinate with its unit, unless it is made of others, and a force or torque along
        a measure, whose work counts for every coordinate that changes the measure."""
        coordinate, unit = joint
        effort = expression_in(effort, f"the {EFFORTS[unit]} on body {name}")
        if isinstance(coordinate, AppliedUndef):
            self.coordinates.append(coordinate)
            self.units[coordinate] = unit
        while names := measure.atoms(AppliedUndef) & set(self.definitions):
            measure = measure.xreplace({n: self.definitions[n] for n in names})
        later = sorted(map(name_of, measure.atoms(AppliedUndef) - {*self.coordinates}))
        if later and effort != 0:
            raise ModelError(
                f"body {name} follows {', '.join(later)}, which no joint has yet: hang its body "
                f"first, or leave the {EFFORTS[unit]} out."
            )
        for q in self.coordinates:
            force = effort * measure.diff(q)
            if force != 0:
                self.forces[q] = self.forces.get(q, sp.S.Zero) + force

    def turn(self, attitude: str, p: Vector, torque: Vector) -> None:
        """Add the quaternion of an attitude, and a torque in the axes that it turns, with the work
        2 torque . G p'."""
        self.coordinates += p
        self.attitudes[attitude] = p
        for q, column in zip(p, zip(*rates(p), strict=True), strict=True):
            force = 2 * dot(column, torque)
            if force != 0:
                self.forces[q] = self.forces.get(q, sp.S.Zero) + force

    def size(self, value: Any, what: str, remedy: str = "") -> Any:
        """A length, a mass or a moment of inertia, and what helps where it is negative."""
        size = expression_in(value, what)
        check_size(size, what, remedy)
        self.sizes.append((size, what, remedy))
        return size


def check_size(value: Any, what: str, remedy: str) -> None:
    if value.is_negative:
        raise ModelError(f"{what} = {shown(value)}: expected 0 or more{remedy}.")


@public(ModelError)
class Member:
    """What bodies in the plane and in space have in common."""

    name: str
    _linkage: Linkage
    _end: Vector

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.name}>"

    def _read_joint(self, coordinate: Any, name: Any, at: Any) -> tuple[str, Vector]:
        """The name of a body behind a new joint, that of its coordinate if it has no other, and
        the place of the joint in the frame of this body."""
        follows = isinstance(coordinate, sp.Expr) and not isinstance(coordinate, AppliedUndef)
        if follows and coordinate.atoms(AppliedUndef):
            if name is None:
                raise ModelError(
                    f"the body whose joint follows {shown(coordinate)} has no coordinate of its "
                    'own: give it a name, such as name="wheel".'
                )
        elif not isinstance(coordinate, AppliedUndef):
            raise ModelError(
                f"coordinate {shown(coordinate)} of a joint is not a function of time: make it "
                "with sympy.physics.mechanics.dynamicsymbols."
            )
        if coordinate in self._linkage.coordinates:
            raise ModelError(
                f"coordinate {name_of(coordinate)} belongs to a joint already: give each joint "
                "one of its own."
            )
        name = check_name(name_of(coordinate) if name is None else name, "body")
        return name, self._end if at is None else vector(at, len(self._end), f"at of body {name}")


@public(ModelError)
class Ground:
    """What a linkage stands on, which makes its system."""

    _linkage: Linkage

    def system(
        self, name: str, parameters: Mapping[Any, float | None] | None = None, **fields: Any
    ) -> MechanicalSystem:
        """Return the system of all bodies.

        Parameters
        ----------
        name : str
        parameters : mapping of Symbol to float or None, optional
        **fields
            Those of :class:`dmoc.MechanicalSystem`: inputs, surfaces, cost, ...  A ``lagrangian``
            (minus the energy of springs) and ``forces`` are added to those of the bodies;
            ``coordinates``, ``definitions``, ``units`` and ``drawing`` follow theirs.

        Returns
        -------
        MechanicalSystem

        Raises
        ------
        ModelError
            For any of the reasons of MechanicalSystem.
        """
        bodies = self._linkage
        allowed = {f.name for f in dataclasses.fields(MechanicalSystem)} - {"name", "parameters"}
        for key in fields:
            if key not in allowed:
                raise ModelError(
                    f"{key!r} is no field of a system: expected fields such as inputs, forces, "
                    "surfaces, cost."
                )
        own = {key: fields[key] for key in fields if key not in JOINED}
        more = {key: listed(fields.get(key, ()), key, "entries", ModelError) for key in JOINED}
        own |= {key: [*getattr(bodies, key), *more[key]] for key in JOINED}
        own["drawing"] += self._looks(own)
        own["lagrangian"] = bodies.lagrangian + expression_in(
            fields.get("lagrangian", 0), "the Lagrangian"
        )
        forces = mapping(fields.get("forces", {}), "forces", MAPPINGS["forces"])
        own["forces"] = added_forces(own["coordinates"], bodies.forces, forces)
        for key in ("definitions", "units", "attitudes"):
            own[key] = getattr(bodies, key) | mapping(fields.get(key, {}), key, MAPPINGS[key])
        for symbol in fields.get("definitions", {}):
            if symbol in bodies.definitions:
                raise ModelError(
                    f"definition {name_of(symbol)} is a name of the linkage: choose another one."
                )
        system = MechanicalSystem(name, parameters={} if parameters is None else parameters, **own)
        values = {p: value for p, value in system.parameters.items() if value is not None}
        known = {*system.coordinates, *system.parameters, dynamicsymbols._t}
        for size, what, remedy in bodies.sizes:
            for atom in atoms_below(size, system.definitions) - known - set(system.definitions):
                raise ModelError(
                    f"{what} = {shown(size)} contains {shown(atom)}: expected coordinates, the "
                    "time and parameters alone."
                )
            check_size(size.subs(values), what, remedy)
        return system

    def _looks(self, fields: Mapping[str, Any]) -> list[Part]:
        """What is drawn beside the drawing among the fields of a system."""
        return []


def coordinates(values: Any, count: int, what: str) -> list[Any]:
    """Several coordinates, which joints look at one by one."""
    entries = list(values) if isinstance(values, (tuple, list)) else []
    if len(entries) != count:
        raise ModelError(f"{what} = {shown(values)}: expected {count} dynamicsymbols.")
    return entries
