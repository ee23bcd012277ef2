"""The fields of a system as they were passed, read one by one into lists, mappings, numbers and
expressions."""

from __future__ import annotations

import math
import numbers
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import sympy as sp

from dmoc.base.arguments import check_magnitude, listed, shown
from dmoc.base.errors import ModelError
from dmoc.base.names import name_of
from dmoc.symbolic.drawing import parts_in
from dmoc.symbolic.expressions import expression_in, zero_of
from dmoc.symbolic.grips import grip_in
from dmoc.symbolic.surface_ends import joined
from dmoc.symbolic.tangent_pairs import with_pairs

if TYPE_CHECKING:
    from dmoc.symbolic.system import MechanicalSystem

SEQUENCES = ("coordinates", "inputs")
MAPPINGS = {  # with an example each
    "parameters": "{m: 1.0}",
    "surfaces": '{"wall": x <= 1}',
    "path_constraints": '{"speed": v <= 1}',
    "constraints": '{"rod": sp.Eq(x**2 + y**2, l**2)}',
    "forces": "{x: F}",
    "units": '{x: "m"}',
    "within": '{"table": x >= 0}',
    "tangents": '{"floor": x}',
    "friction": '{"floor": 0.5}',
    "restitution": '{"wall": 0.8}',
    "tangential_restitution": '{"floor": 0.5}',
    "impact_laws": '{"floor": "poisson"}',
    "grips": '{"hand": (x - x_bar, y - y_bar)}',
    "strength": '{"hand": 50.0}',
    "definitions": "{x1: l * sp.sin(a)}",
    "quantities": '{"tip": x + l * sp.sin(a)}',
    "integrals": '{"effort": u**2}',
    "switches": '{"gate": x - 1}',
    "attitudes": '{"q": (q0, q1, q2, q3)}',
}


def containers_of(system: MechanicalSystem) -> dict[str, Any]:
    """Lists and mappings, whatever their entries are."""
    read: dict[str, Any] = {n: _sequence(getattr(system, n), n) for n in SEQUENCES}
    read |= {n: mapping(getattr(system, n), n, example) for n, example in MAPPINGS.items()}
    within = {name: joined(value) for name, value in read["within"].items()}
    read |= with_pairs(read["tangents"], read["impact_laws"])
    return read | {"path_constraints": _relations(read["path_constraints"]), "within": within}


def entries_of(system: MechanicalSystem) -> dict[str, Any]:
    """Numbers, texts and expressions, where the names of the model are in order."""
    read: dict[str, Any] = {
        "parameters": {s: _parameter_value(s, value) for s, value in system.parameters.items()},
        "units": _units(system),
    }
    if not isinstance(system.title, str) or not system.title.isprintable():
        raise ModelError(f"title = {shown(system.title)}: expected one line of text.")
    for name in ("lagrangian", "cost", "dissipation", "terminal_cost", "objective"):
        what = "Lagrangian" if name == "lagrangian" else name.replace("_", " ")
        read[name] = expression_in(getattr(system, name), f"the {what}")
    read["forces"] = _forces(system)
    read["definitions"] = {
        s: expression_in(e, f"definition {name_of(s)}") for s, e in system.definitions.items()
    }
    read["friction"] = {name: _friction(name, mu) for name, mu in system.friction.items()}
    for name in ("tangents", "restitution", "tangential_restitution", "strength"):
        what = name.removesuffix("s").replace("_", " ")
        read[name] = {
            key: expression_in(e, f"the {what} of {key!r}")
            for key, e in getattr(system, name).items()
        }
    read["constraints"] = {
        name: zero_of(equation, f"constraint {name!r}")
        for name, equation in system.constraints.items()
    }
    read["grips"] = {name: grip_in(parts, name) for name, parts in system.grips.items()}
    kinds = ("quantities", "quantity"), ("integrals", "integral"), ("switches", "switch")
    for kind, what in kinds:
        read[kind] = {
            name: expression_in(e, f"{what} {name!r}") for name, e in getattr(system, kind).items()
        }
    contacts = dict.fromkeys((*system.surfaces, *system.tangents))
    return read | {"drawing": parts_in(system.drawing, contacts, system.inputs)}


def _sequence(value: Any, what: str) -> tuple[Any, ...]:
    if isinstance(value, (str, bytes, sp.Basic)):
        raise ModelError(
            f"{what} = {shown(value)}: expected a list of dynamicsymbols, such as [x]."
        )
    return tuple(listed(value, what, "dynamicsymbols", ModelError))


def mapping(value: Any, what: str, example: str) -> dict[Any, Any]:
    """Read a mapping; raise ModelError for what is none."""
    if not isinstance(value, Mapping):
        raise ModelError(f"{what} = {shown(value)}: expected a mapping such as {example}.")
    return dict(value)


def _relations(constraints: Mapping[Any, Any]) -> dict[Any, Any]:
    """Path constraints by name; those of a conjunction have the numbers 1, 2, ... behind it."""
    numbered = dict[Any, Any]()
    for name, relation in constraints.items():
        joined = isinstance(relation, sp.And) and isinstance(name, str)
        parts = sorted(relation.args, key=sp.default_sort_key) if joined else [relation]
        names = [f"{name}_{i + 1}" for i in range(len(parts))] if joined else [name]
        for one, part in zip(names, parts, strict=True):
            if one in numbered:
                raise ModelError(f"two path constraints have the name {one!r}: rename one.")
            numbered[one] = part
    return numbered


def _parameter_value(symbol: Any, value: Any) -> float | None:
    """The default value of a parameter as a float that its symbol may have."""
    if value is None:
        return None
    number = math.nan
    if not isinstance(value, bool) and (
        isinstance(value, numbers.Real) or (isinstance(value, sp.Expr) and value.is_comparable)
    ):
        try:
            number = float(value)
        except (OverflowError, ValueError, TypeError):
            number = math.inf
    if not math.isfinite(number):
        raise ModelError(f"parameter {symbol} = {shown(value)}: a finite number was expected.")
    check_magnitude(number, value, f"parameter {symbol}", ModelError)
    for fact in ("positive", "negative", "nonnegative", "nonpositive", "nonzero"):
        if getattr(symbol, f"is_{fact}") and getattr(sp.Float(number), f"is_{fact}") is False:
            raise ModelError(
                f"parameter {symbol} = {shown(value)}: its symbol is assumed to be {fact}; give "
                "such a value, or make the symbol without it."
            )
    return number


def _units(system: MechanicalSystem) -> dict[str, str]:
    names = [name_of(s) for s in (*system.coordinates, *system.inputs)] + [*system.quantities]
    units = {}
    for symbol, unit in system.units.items():
        name = name_of(symbol) if isinstance(symbol, (str, sp.Basic)) else ""
        if name not in names:
            raise ModelError(
                f"unit of {shown(symbol)}: expected a coordinate, an input or a quantity, one of "
                f"{', '.join(names)}."
            )
        if not isinstance(unit, str) or not unit.isprintable() or not 0 < len(unit) <= 16:
            raise ModelError(
                f"unit of {name} = {shown(unit)}: expected a short text such as 'rad', 'm' or 'N'."
            )
        units[name] = unit
    return units


def _friction(name: str, value: Any) -> Any:
    """A coefficient of friction, or the static and the kinetic one."""
    if not isinstance(value, (tuple, list, sp.Tuple)):
        return expression_in(value, f"the friction of {name!r}")
    if len(value) != 2:
        raise ModelError(
            f"the friction of {name!r} has {len(value)} coefficients: expected one, or a pair "
            "(static, kinetic)."
        )
    kinds = zip(("static", "kinetic"), value, strict=True)
    both = [expression_in(e, f"the {kind} friction of {name!r}") for kind, e in kinds]
    return both[0] if both[0] == both[1] else sp.Tuple(*both)


def _forces(system: MechanicalSystem) -> dict[Any, Any]:
    named = {name_of(q): q for q in system.coordinates}
    forces: dict[Any, Any] = {}
    for key, expression in dict(system.forces).items():
        q = named.get(key, key) if isinstance(key, str) else key
        if q not in system.coordinates:
            raise ModelError(
                f"the force on {shown(key)} belongs to no coordinate: expected one of "
                f"{', '.join(map(name_of, system.coordinates))}."
            )
        if q in forces:
            raise ModelError(f"the force on {name_of(q)} is given twice: add both.")
        forces[q] = expression_in(expression, f"the force on {name_of(q)}")
    return forces


def added_forces(
    coordinates: Sequence[Any], forces: Mapping[Any, Any], more: Mapping[Any, Any]
) -> dict[Any, Any]:
    """Forces by coordinate, and more of them by coordinate or name."""
    total, named = dict(forces), {name_of(q): q for q in coordinates}
    for key, force in more.items():
        q = named.get(key, key) if isinstance(key, str) else key
        total[q] = total.get(q, sp.S.Zero) + expression_in(force, f"the force on {shown(q)}")
    return total
