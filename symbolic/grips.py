"""Grips of a system: places that vanish, or rates, while something is held both ways."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import sympy as sp

from dmoc.base.arguments import shown
from dmoc.base.errors import ModelError
from dmoc.base.names import name_of
from dmoc.symbolic.definitions import atoms_below, expanded
from dmoc.symbolic.expressions import zero_of

if TYPE_CHECKING:
    from dmoc.symbolic.system import MechanicalSystem


def grip_in(value: Any, name: str) -> tuple[Any, ...]:
    """The functions of a grip, one or several; ModelError for none."""
    several = isinstance(value, (tuple, list, sp.Tuple, sp.MatrixBase))
    parts = list(value) if several else [value]
    if not parts:
        raise ModelError(
            f"grip {name!r} has no place: expected one that vanishes while it holds, or several, "
            "such as (x - x_bar, y - y_bar)."
        )
    return tuple(zero_of(part, f"grip {name!r}") for part in parts)


def names_of_places(grips: Mapping[str, Any]) -> dict[str, list[str]]:
    """Names of the places of each grip: its own, or with the numbers 1, 2, ... behind it."""
    return {
        name: [name] if len(parts) == 1 else [f"{name}_{i + 1}" for i in range(len(parts))]
        for name, parts in grips.items()
    }


def functions_of_grips(system: MechanicalSystem) -> dict[str, Any]:
    """The places phi of all grips by their names; of a rate that with this rate."""
    names = (name for of_grip in names_of_places(system.grips).values() for name in of_grip)
    functions = (part for parts in system.grips.values() for part in parts)
    return {n: _place(system, n, e) for n, e in zip(names, functions, strict=True)}


def rates_alone(system: MechanicalSystem) -> list[str]:
    """Names of the places that are stated by their rates, and close wherever they are."""
    names = (name for of_grip in names_of_places(system.grips).values() for name in of_grip)
    functions = (part for parts in system.grips.values() for part in parts)
    return [n for n, e in zip(names, functions, strict=True) if _moving(system, e)]


def _moving(system: MechanicalSystem, function: Any) -> bool:
    return bool(atoms_below(function, system.definitions) & {*system.velocities})


def _place(system: MechanicalSystem, name: str, function: Any) -> Any:
    """The place of a function that is one, or whose rate it is."""
    if not _moving(system, function):
        return function
    rate = expanded(function, system.definitions)
    slopes = [rate.diff(v) for v in system.velocities]
    rest = rate - sum(c * v for c, v in zip(slopes, system.velocities, strict=True))
    known = {*system.parameters}
    if any(c.free_symbols - known or c.atoms(sp.Function) for c in slopes) or sp.expand(rest) != 0:
        raise ModelError(
            f"grip {name!r} contains velocities: expected the rate of a place, a sum of velocities "
            f"with factors that are constant, such as a.diff() - b.diff(), got {shown(function)}; "
            "state the place itself, or what holds in every phase as a constraint."
        )
    return sum(c * q for c, q in zip(slopes, system.coordinates, strict=True))


def check_grips(system: MechanicalSystem) -> None:
    """Refuse grips whose places move with no coordinate, and names that are in use."""
    taken = [*system.surfaces, *system.tangents, *system.constraints, *system.path_constraints]
    taken += [name for names in names_of_places(system.grips).values() for name in names]
    for grip, names in names_of_places(system.grips).items():
        for name in names:
            if taken.count(name) > 1 or (name != grip and name in system.grips):
                raise ModelError(
                    f"a place of grip {grip!r} has the name {name!r}, which the model uses "
                    "already: choose another name."
                )
    for name, place in functions_of_grips(system).items():
        if not atoms_below(place, system.definitions) & {*system.coordinates}:
            raise ModelError(
                f"grip {name!r} contains no coordinate: expected a place in "
                f"{', '.join(map(name_of, system.coordinates))}."
            )
