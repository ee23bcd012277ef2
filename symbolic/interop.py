"""From models of sympy.physics.mechanics to coordinates, Lagrangian and generalised forces.

A LagrangesMethod has a Lagrangian in q and q'; JointsMethod and System describe bodies and joints
with generalised speeds u, which the kinematic differential equations replace by q'.  Loads F at
velocities v become generalised forces Q_i = F . dv/dq_i'.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import sympy as sp
from sympy.physics.mechanics import (
    JointsMethod,
    LagrangesMethod,
    Lagrangian,
    Point,
    ReferenceFrame,
    System,
    dynamicsymbols,
)

from dmoc.base.arguments import check_known, shown
from dmoc.base.errors import ModelError
from dmoc.symbolic.system_fields import MAPPINGS, added_forces, mapping

IMPORTED = ("name", "coordinates", "lagrangian", "parameters")  # not beside an imported model
AS_THEY_ARE = ("inputs", "title", "units")  # fields without velocities


@dataclass(frozen=True)
class Imported:
    """Coordinates, Lagrangian, generalised forces by coordinate, the generalised speeds in terms of
    q', and what the constraints keep at zero, the holonomic ones first."""

    coordinates: list[Any]
    lagrangian: Any
    forces: dict[Any, Any]
    speeds: dict[Any, Any]
    constraints: list[Any]

    def fields_with(self, others: Mapping[str, Any], allowed: Iterable[str]) -> dict[str, Any]:
        """The fields of a system with others beside them, in which speeds become velocities and
        whose forces are added; ``allowed`` are the names of all fields."""
        beside = [name for name in allowed if name not in IMPORTED]
        for key in others:
            check_known(key, beside, "field", "beside an imported model", ModelError)
        fields = {
            key: value if key in AS_THEY_ARE else self._in_velocities(value)
            for key, value in others.items()
        }
        more = mapping(fields.get("forces", {}), "forces", MAPPINGS["forces"])
        forces = added_forces(self.coordinates, self.forces, more)
        own = {"coordinates": self.coordinates, "lagrangian": self.lagrangian, "forces": forces}
        named = {f"constraint_{i + 1}": phi for i, phi in enumerate(self.constraints)}
        more = mapping(fields.get("constraints", {}), "constraints", MAPPINGS["constraints"])
        return fields | own | {"constraints": named | more}

    def _in_velocities(self, value: Any) -> Any:
        if isinstance(value, Mapping):
            return {key: self._in_velocities(part) for key, part in value.items()}
        return value.xreplace(self.speeds) if isinstance(value, sp.Basic) else value


def from_lagranges_method(method: Any) -> Imported:
    """Read a ``sympy.physics.mechanics.LagrangesMethod``."""
    if not isinstance(method, LagrangesMethod):
        raise ModelError(
            f"{shown(method)} is not a LagrangesMethod: expected one from sympy.physics.mechanics."
        )
    places = list(method._hol_coneqs)
    constraints = [*places, *method.coneqs[len(places) :]]
    coordinates = list(method.q)
    forces = _generalised_forces(coordinates, method.forcelist or (), method.inertial, {})
    return Imported(coordinates, sp.Matrix([method._L])[0], forces, {}, constraints)


def from_joints(model: Any) -> Imported:
    """Read a ``JointsMethod`` or a ``System`` of bodies and joints."""
    if not isinstance(model, (JointsMethod, System)):
        raise ModelError(
            f"{shown(model)} is no model: expected a JointsMethod or a System from "
            "sympy.physics.mechanics."
        )
    coordinates = list(model.q)
    speeds = _speeds(model)
    loads = [
        *model.loads,
        *(load for actuator in getattr(model, "actuators", ()) for load in actuator.to_loads()),
    ]
    lagrangian = _replaced(Lagrangian(model.frame, *model.bodies), speeds)
    return Imported(
        coordinates,
        lagrangian,
        _generalised_forces(coordinates, loads, model.frame, speeds),
        speeds,
        [
            *getattr(model, "holonomic_constraints", ()),
            *(_replaced(c, speeds) for c in getattr(model, "nonholonomic_constraints", ())),
        ],
    )


def _speeds(model: Any) -> dict[Any, Any]:
    """Generalised speeds in terms of q', from the kinematic differential equations."""
    t = dynamicsymbols._t
    rates = [q.diff(t) for q in model.q]
    others = [u for u in model.u if u not in rates]
    solutions = sp.solve(list(model.kdes), others, dict=True) if others else [{}]
    if len(solutions) != 1 or set(solutions[0]) != set(others):
        raise ModelError(
            "the kinematic differential equations do not give the generalised speeds: expected one "
            "equation for each speed."
        )
    return dict(solutions[0])


def _replaced(expression: Any, speeds: dict[Any, Any]) -> Any:
    t = dynamicsymbols._t
    rates = {u.diff(t): value.diff(t) for u, value in speeds.items()}
    return expression.xreplace(rates).xreplace(speeds)


def _generalised_forces(
    coordinates: list[Any], loads: Iterable[Any], frame: ReferenceFrame, speeds: dict[Any, Any]
) -> dict[Any, Any]:
    t = dynamicsymbols._t
    forces = dict.fromkeys(coordinates, sp.S.Zero)
    for place, vector in loads:
        if isinstance(place, Point):
            velocity = place.vel(frame)
        elif isinstance(place, ReferenceFrame):
            velocity = place.ang_vel_in(frame)
        else:
            raise ModelError(
                f"the load on {place} acts on a {type(place).__name__}: expected a Point (force) "
                "or a ReferenceFrame (torque)."
            )
        matrix = velocity.to_matrix(frame).applyfunc(lambda e: _replaced(e, speeds))
        load = vector.to_matrix(frame).applyfunc(lambda e: _replaced(e, speeds))
        for q in coordinates:
            forces[q] += sp.trigsimp((matrix.diff(q.diff(t)).T * load)[0])
    return {q: Q for q, Q in forces.items() if Q != 0}
