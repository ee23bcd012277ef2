"""Attitudes of a system: coordinates that are unit quaternions, with the constraint that they are,
and the angular velocities that they make."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from sympy.physics.mechanics import dynamicsymbols

from dmoc.base.arguments import listed, shown
from dmoc.base.errors import ModelError
from dmoc.base.names import check_name, omega_names, unit_constraint
from dmoc.motion.attitude import rates
from dmoc.symbolic.vectors import Vector, dot

if TYPE_CHECKING:
    from dmoc.symbolic.system import MechanicalSystem


def quaternion(name: str) -> Vector:
    """The four coordinates of an attitude of a name."""
    return tuple(dynamicsymbols(f"{name}{k}") for k in range(4))


def angular_velocity(p: Vector) -> Vector:
    """omega = 2 G(p) p' in the frame that p turns."""
    speeds = tuple(e.diff(dynamicsymbols._t) for e in p)
    return tuple(2 * dot(row, speeds) for row in rates(p))


def regularised(p: Vector, inertia: Any) -> Any:
    """2 J (p . p')^2, which vanishes on the sphere and makes the mass matrix regular across it
    (Betsch and Siebert, Int. J. Numer. Meth. Engng 79, 2009, 444-473)."""
    return 2 * inertia * dot(p, tuple(e.diff(dynamicsymbols._t) for e in p)) ** 2


def with_attitudes(system: MechanicalSystem) -> dict[str, Any]:
    """Attitudes as they were passed, read, with the constraints, quantities and units that they
    bring."""
    attitudes = {name: _read(system, name, p) for name, p in system.attitudes.items()}
    if not attitudes:
        return {}
    constraints, quantities = dict(system.constraints), dict(system.quantities)
    units = dict(system.units)
    for name, p in attitudes.items():
        if len(p) == 3:
            continue
        own = {unit_constraint(name): sum(e**2 for e in p) - 1}
        spin = dict(zip(omega_names(name), angular_velocity(p), strict=True))
        for kind, fields, more in (
            ("constraint", constraints, own), ("quantity", quantities, spin),
        ):  # fmt: skip
            for key, value in more.items():
                if fields.setdefault(key, value) != value:
                    raise ModelError(
                        f"{kind} {key!r} has a name of the attitude {name!r}: choose another name."
                    )
        units |= {key: units.get(key, "rad/s") for key in spin}
    return {
        "attitudes": attitudes, "constraints": constraints, "quantities": quantities,
        "units": units,
    }  # fmt: skip


def _read(system: MechanicalSystem, name: Any, p: Any) -> Vector:
    """Coordinates of the system: a quaternion, or yaw, pitch and roll."""
    check_name(name, "attitude")
    entries = tuple(listed(p, f"attitude {name!r}", "coordinates", ModelError))
    known = {*entries} <= {*system.coordinates} and len({*entries}) == len(entries)
    if len(entries) not in (3, 4) or not known:
        raise ModelError(
            f"attitude {name!r} = {shown(p)}: expected four coordinates of the model, the "
            "quaternion with the cosine of half the angle first, or yaw, pitch and roll."
        )
    return entries
