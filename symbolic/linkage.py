"""What builders of linkages have in common: names for places and velocities, energies, forces and
shapes that are collected body by body, and the system that they make."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import sympy as sp
from sympy.core.function import AppliedUndef
from sympy.physics.mechanics import dynamicsymbols

from dmoc.base.arguments import listed, shown
from dmoc.base.errors import ModelError
from dmoc.base.names import check_name, name_of
from dmoc.symbolic.drawing import Part
from dmoc.symbolic.expressions import expression_in
from dmoc.symbolic.system import MechanicalSystem
from dmoc.symbolic.system_fields import MAPPINGS, added_forces, mapping

JOINED = ("coordinates", "drawing")  # fields to which a user's are appended


@dataclass
class Linkage:
    """What the bodies of a linkage add up to."""

    coordinates: list[Any] = field(default_factory=list)
    definitions: dict[Any, Any] = field(default_factory=dict)
    lagrangian: Any = sp.S.Zero
    forces: dict[Any, Any] = field(default_factory=dict)
    units: dict[Any, str] = field(default_factory=dict)
    drawing: list[Part] = field(default_factory=list)

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

    def push(self, coordinate: Any, force: Any) -> None:
        if force != 0:
            self.forces[coordinate] = self.forces.get(coordinate, sp.S.Zero) + force

    def name_for(self, coordinate: Any, name: Any) -> str:
        """The name of a body behind a new joint, that of its coordinate if it has no other."""
        if not isinstance(coordinate, AppliedUndef):
            raise ModelError(
                f"coordinate {shown(coordinate)} of a joint is not a function of time: make it "
                "with sympy.physics.mechanics.dynamicsymbols."
            )
        if coordinate in self.coordinates:
            raise ModelError(
                f"coordinate {name_of(coordinate)} belongs to a joint already: give each joint "
                "one of its own."
            )
        return check_name(name_of(coordinate) if name is None else name, "body")

    def move(self, coordinate: Any, unit: str) -> None:
        """Add a coordinate."""
        self.coordinates.append(coordinate)
        self.units[coordinate] = unit


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
        for key in JOINED:
            more = listed(fields.get(key, ()), key, "entries", ModelError)
            own[key] = [*getattr(bodies, key), *more]
        own["lagrangian"] = bodies.lagrangian + expression_in(
            fields.get("lagrangian", 0), "the Lagrangian"
        )
        forces = mapping(fields.get("forces", {}), "forces", MAPPINGS["forces"])
        own["forces"] = added_forces(own["coordinates"], bodies.forces, forces)
        for key in ("definitions", "units"):
            own[key] = getattr(bodies, key) | mapping(fields.get(key, {}), key, MAPPINGS[key])
        for symbol in fields.get("definitions", {}):
            if symbol in bodies.definitions:
                raise ModelError(
                    f"definition {name_of(symbol)} is a name of the linkage: choose another one."
                )
        values = {} if parameters is None else parameters
        return MechanicalSystem(name, parameters=values, **own)


def coordinates(values: Any, size: int, what: str) -> list[Any]:
    """Several coordinates, which :meth:`Linkage.move` looks at one by one."""
    entries = list(values) if isinstance(values, (tuple, list)) else []
    if len(entries) != size:
        raise ModelError(f"{what} = {shown(values)}: expected {size} dynamicsymbols.")
    return entries


def vector(value: Any, size: int, what: str) -> tuple[Any, ...]:
    """Expressions of a place or a direction in the frame of a body."""
    example = "(" + ", ".join("ab0"[:size]) + ")"
    try:
        entries: Sequence[Any] = listed(
            list(value) if isinstance(value, sp.MatrixBase) else value, what, "", ModelError
        )
    except ModelError:
        entries = ()
    if len(entries) != size:
        raise ModelError(f"{what} = {shown(value)}: expected {size} expressions, as in {example}.")
    return tuple(expression_in(e, what) for e in entries)


def unit_vector(value: Any, size: int, what: str) -> tuple[Any, ...]:
    """A direction of length 1."""
    entries = vector(value, size, what)
    length = sp.sqrt(sum(e**2 for e in entries))
    if length == 0 or not length.is_number:
        raise ModelError(f"{what} = {shown(value)}: expected numbers, not all 0.")
    return tuple(e / length for e in entries)
